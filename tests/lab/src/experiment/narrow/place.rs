//! Narrow worlds, drawn on a grid of squares as wide as their corridors: walls that nobody sees over, and what is left.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt::Write as _;

use rand::seq::SliceRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// A square: column from the west, row from the south.
pub type Square = [i32; 2];

/// Rooms are so wide and long at least, m.
const ROOM_M: f64 = 7.0;
/// Those who stand in a room stand so far from one another at least, m.
const APART_M: f64 = 2.0;
/// The height of flight, m: low enough that who takes off between two walls takes neither for a roof.
const HEIGHT_M: f64 = 1.5;
/// The speed of flight, m/s.
pub const CRUISE_M_S: f64 = 1.5;

/// The shapes of places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Shape {
    /// Two rooms, and a corridor between them.
    Corridor,
    /// The same with a bend behind which nobody sees.
    Bend,
    /// Four rooms at two corridors that cross.
    Crossing,
    /// Three rooms at a junction.
    Junction,
    /// Two rooms, and a wall with an opening between them.
    Door,
    /// A corridor that ends blind, off a room.
    DeadEnd,
    /// One way from each place to each other, one wide.
    Maze,
}

impl Shape {
    pub const ALL: [Self; 7] =
        [Self::Corridor, Self::Bend, Self::Crossing, Self::Junction, Self::Door, Self::DeadEnd, Self::Maze];

    /// The shape of the mission with this seed: of five one meets head-on behind a bend.
    pub fn of(seed: u64) -> Self {
        let others = Self::ALL.map(|shape| (shape != Self::Bend).then_some(shape));
        let mut others = others.into_iter().flatten().cycle().skip((seed % 6) as usize);
        others.next().filter(|_| !seed.is_multiple_of(5)).unwrap_or(Self::Bend)
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Corridor => "corridor",
            Self::Bend => "bend",
            Self::Crossing => "crossing",
            Self::Junction => "junction",
            Self::Door => "door",
            Self::DeadEnd => "dead end",
            Self::Maze => "maze",
        }
    }
}

/// A world and its missions.
#[derive(Clone, Debug)]
pub struct Place {
    pub shape: Shape,
    /// The width of what is narrow, m.
    pub width_m: f64,
    /// The squares that are open.
    open: BTreeSet<Square>,
    /// From where to where each vehicle flies, m.
    routes: Vec<[[f64; 2]; 2]>,
    /// Whether all can arrive, if that was found out.
    pub is_solvable: bool,
}

/// A drawing that places are cut out of.
struct Drawing {
    width_m: f64,
    open: BTreeSet<Square>,
    /// Places to stand, m, room by room.
    rooms: Vec<Vec<[f64; 2]>>,
}

impl Drawing {
    fn new(width_m: f64) -> Self {
        Self { width_m, open: BTreeSet::new(), rooms: Vec::new() }
    }

    /// A room of squares from a corner on, with as many places to stand as there is room for.
    fn room(&mut self, corner: Square, squares: i32) {
        for x in 0..squares {
            self.open.extend((0..squares).map(|y| [corner[0] + x, corner[1] + y]));
        }
        let side_m = f64::from(squares) * self.width_m;
        let per_side = ((side_m - APART_M) / APART_M).floor() as i32 + 1;
        let margin_m = (side_m - f64::from(per_side - 1) * APART_M) / 2.0;
        let at =
            |axis: usize, k: i32| f64::from(corner[axis]) * self.width_m + margin_m + f64::from(k) * APART_M;
        let places = (0..per_side * per_side).map(|k| [at(0, k % per_side), at(1, k / per_side)]);
        self.rooms.push(places.collect());
    }

    /// A corridor through the squares of a line.
    fn corridor(&mut self, from: Square, to: Square) {
        let step = [0, 1].map(|axis| (to[axis] - from[axis]).signum());
        let mut square = from;
        self.open.insert(square);
        while square != to {
            square = [square[0] + step[0], square[1] + step[1]];
            self.open.insert(square);
        }
    }

    /// The middle of a square, m.
    fn middle(&self, square: Square) -> [f64; 2] {
        square.map(|index| (f64::from(index) + 0.5) * self.width_m)
    }
}

/// The place of this shape that a seed draws, for so many vehicles at most.
pub fn draw(shape: Shape, vehicles: usize, seed: u64) -> Place {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let width_m = random.random_range(1.2..=2.5_f64);
    let mut drawing = Drawing::new(width_m);
    let room = (ROOM_M / width_m).ceil() as i32;
    let mut squares =
        |from_m: f64, to_m: f64| (random.random_range(from_m..to_m) / width_m).round().max(1.0) as i32;
    let half = room / 2;
    let mut is_solvable = true;
    let routes = match shape {
        Shape::Maze => {
            let side = squares(3.0 * width_m, 5.0 * width_m).clamp(3, 4);
            let ways = maze(&mut drawing, side, &mut random);
            let count = vehicles.clamp(2, 3);
            let nodes: Vec<Square> = ways.keys().copied().collect();
            let mut pick = || {
                let mut picked = nodes.clone();
                picked.shuffle(&mut random);
                picked.truncate(count);
                picked
            };
            let (starts, goals) = (pick(), pick());
            is_solvable = can_all_arrive(&ways, &starts, &goals);
            let route = |(start, goal): (&Square, &Square)| [drawing.middle(*start), drawing.middle(*goal)];
            starts.iter().zip(&goals).map(route).collect()
        }
        Shape::DeadEnd => {
            let long = squares(6.0, 12.0);
            drawing.room([0, 0], room);
            drawing.corridor([room, half], [room + long, half]);
            let blind = drawing.middle([room + long, half]);
            let mut free = drawing.rooms[0].clone();
            free.shuffle(&mut random);
            // One comes out, and another goes in.
            let mut routes = vec![[blind, free[1]], [free[0], blind]];
            routes.extend(
                (1..vehicles.saturating_sub(1).min(free.len() / 4)).map(|k| [free[2 * k], free[2 * k + 1]]),
            );
            routes
        }
        _ => {
            let long = squares(8.0, 20.0);
            match shape {
                Shape::Corridor | Shape::Door => {
                    let long = if shape == Shape::Door { 1 } else { long };
                    drawing.room([0, 0], room);
                    drawing.corridor([room, half], [room + long, half]);
                    drawing.room([room + long, 0], room);
                }
                Shape::Bend => {
                    drawing.room([0, 0], room);
                    drawing.corridor([room, half], [room + long, half]);
                    drawing.corridor([room + long, half], [room + long, half + long]);
                    drawing.room([room + long - half, half + long], room);
                }
                _ => {
                    let centre = [room + long, half];
                    drawing.room([0, 0], room);
                    drawing.corridor([room, half], [room + 2 * long, half]);
                    drawing.room([room + 2 * long, 0], room);
                    drawing.corridor(centre, [centre[0], half + long]);
                    drawing.room([centre[0] - half, half + long], room);
                    if shape == Shape::Crossing {
                        drawing.corridor(centre, [centre[0], half - long]);
                        drawing.room([centre[0] - half, half - long - room + 1], room);
                    }
                }
            }
            between_rooms(&drawing, vehicles, &mut random)
        }
    };
    Place { shape, width_m, open: drawing.open, routes, is_solvable }
}

/// Each flies from one room to another, where a place is left for it.
fn between_rooms(drawing: &Drawing, vehicles: usize, random: &mut ChaCha8Rng) -> Vec<[[f64; 2]; 2]> {
    let mut free = drawing.rooms.clone();
    free.iter_mut().for_each(|room| room.shuffle(random));
    let rooms = free.len();
    // In each room half of the places are free to pass on.
    let most = drawing.rooms.iter().map(|room| room.len() / 4).min().unwrap_or(0) * rooms;
    let count = random.random_range(2..=vehicles.max(2)).min(most.max(2));
    let route = |k: usize| {
        let (from, to) = (k % rooms, (k + 1 + (k / rooms) % (rooms - 1)) % rooms);
        Some([free[from].pop()?, free[to].pop()?])
    };
    (0..count).map_while(route).collect()
}

/// A maze in which one way leads from each node to each other: nodes two squares apart, and the ways between them.
fn maze(drawing: &mut Drawing, side: i32, random: &mut ChaCha8Rng) -> BTreeMap<Square, Vec<Square>> {
    let mut ways: BTreeMap<Square, Vec<Square>> = BTreeMap::from([([0, 0], Vec::new())]);
    let mut stack = vec![[0, 0]];
    drawing.open.insert([0, 0]);
    while let Some(node) = stack.last().copied() {
        let mut steps = [[2, 0], [0, 2], [-2, 0], [0, -2]];
        steps.shuffle(random);
        let next = steps
            .map(|step| [node[0] + step[0], node[1] + step[1]])
            .into_iter()
            .find(|next| next.iter().all(|index| (0..2 * side).contains(index)) && !ways.contains_key(next));
        let Some(next) = next else {
            stack.pop();
            continue;
        };
        drawing.corridor(node, next);
        ways.entry(node).or_default().push(next);
        ways.entry(next).or_default().push(node);
        stack.push(next);
    }
    ways
}

/// Whether all can get from their starts to their goals, one at a time from node to free node (a complete search).
fn can_all_arrive(ways: &BTreeMap<Square, Vec<Square>>, starts: &[Square], goals: &[Square]) -> bool {
    let mut seen = BTreeSet::from([starts.to_vec()]);
    let mut open = VecDeque::from([starts.to_vec()]);
    while let Some(nodes) = open.pop_front() {
        if nodes == goals {
            return true;
        }
        for (index, node) in nodes.iter().enumerate() {
            for next in ways.get(node).into_iter().flatten().filter(|next| !nodes.contains(next)) {
                let mut after = nodes.clone();
                after[index] = *next;
                if seen.insert(after.clone()) {
                    open.push_back(after);
                }
            }
        }
    }
    false
}

impl Place {
    /// From where to where each vehicle flies, m.
    pub fn routes(&self) -> &[[[f64; 2]; 2]] {
        &self.routes
    }

    /// The corners of all that is open, m.
    pub fn extent_m(&self) -> [[f64; 2]; 2] {
        let [least, most] = self.corners();
        let side = |index: i32| f64::from(index) * self.width_m;
        [least.map(side), most.map(|index| side(index + 1))]
    }

    /// The distance of a point from the nearest wall, m, as far as the next but one square.
    pub fn clearance_m(&self, point: [f64; 2]) -> f64 {
        let square = point.map(|metres| (metres / self.width_m).floor() as i32);
        let around = (-2..=2).flat_map(|x| (-2..=2).map(move |y| [square[0] + x, square[1] + y]));
        let outside = |axis: usize, index: i32| {
            let low = f64::from(index) * self.width_m;
            (low - point[axis]).max(point[axis] - low - self.width_m).max(0.0)
        };
        let to = |wall: Square| outside(0, wall[0]).hypot(outside(1, wall[1]));
        around.filter(|square| !self.open.contains(square)).map(to).fold(f64::INFINITY, f64::min)
    }

    /// The scenario of vehicles on these routes, m.
    pub fn scenario(&self, routes: &[[[f64; 2]; 2]], network: &str) -> String {
        let mut text = format!(
            "about = \"{} of {:.1} m\"\ncruise_speed_m_s = {CRUISE_M_S:?}\ntakeoff_height_m = {HEIGHT_M:?}\n\
             time_limit_s = 600.0\n{network}\n",
            self.shape.name(),
            self.width_m
        );
        let [least, most] = self.corners();
        let side = |index: i32| f64::from(index) * self.width_m;
        let _ = writeln!(
            text,
            "[bounds]\nmin_m = [{}, {}, -1.0]\nmax_m = [{}, {}, 9.0]",
            side(least[0] - 1),
            side(least[1] - 1),
            side(most[0] + 2),
            side(most[1] + 2)
        );
        for [y, from, to] in self.walls() {
            let (centre_x, centre_y) = ((side(from) + side(to + 1)) / 2.0, side(y) + self.width_m / 2.0);
            let _ = writeln!(
                text,
                "[[obstacle]]\nname = \"wall {from} {y}\"\ncentre_m = [{centre_x}, {centre_y}, 4.0]\nbox_m = [{}, {}, 10.0]",
                side(to + 1) - side(from),
                self.width_m
            );
        }
        for [from, to] in routes {
            let _ = writeln!(
                text,
                "[[vehicle]]\nstart_m = [{}, {}]\nwaypoints_m = [[{}, {}, {HEIGHT_M}]]",
                from[0], from[1], to[0], to[1]
            );
        }
        text
    }

    fn corners(&self) -> [Square; 2] {
        let least = self.open.iter().copied().reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1])]);
        let most = self.open.iter().copied().reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])]);
        [least, most].map(Option::unwrap_or_default)
    }

    /// Rows of closed squares: row, first and last column.
    fn walls(&self) -> Vec<[i32; 3]> {
        let [least, most] = self.corners();
        let mut walls = Vec::new();
        for y in least[1] - 1..=most[1] + 1 {
            let mut from = None;
            for x in least[0] - 1..=most[0] + 2 {
                let is_wall = x <= most[0] + 1 && !self.open.contains(&[x, y]);
                match (from, is_wall) {
                    (None, true) => from = Some(x),
                    (Some(first), false) => {
                        walls.push([y, first, x - 1]);
                        from = None;
                    }
                    _ => {}
                }
            }
        }
        walls
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_cannot_swap_in_a_blind_corridor_and_can_at_a_branch() {
        let line = BTreeMap::from([([0, 0], vec![[2, 0]]), ([2, 0], vec![[0, 0]])]);
        assert!(!can_all_arrive(&line, &[[0, 0], [2, 0]], &[[2, 0], [0, 0]]));
        let star = BTreeMap::from([
            ([2, 2], vec![[0, 2], [4, 2], [2, 4]]),
            ([0, 2], vec![[2, 2]]),
            ([4, 2], vec![[2, 2]]),
            ([2, 4], vec![[2, 2]]),
        ]);
        assert!(can_all_arrive(&star, &[[0, 2], [4, 2]], &[[4, 2], [0, 2]]));
    }

    #[test]
    fn everybody_starts_and_ends_in_the_open_apart_from_the_others() {
        for (shape, seed) in Shape::ALL.into_iter().flat_map(|shape| (1..30).map(move |seed| (shape, seed))) {
            let place = draw(shape, 8, seed);
            assert!(place.routes.len() >= 2, "{shape:?} {seed}");
            for end in [0, 1] {
                let ends: Vec<_> = place.routes.iter().map(|route| route[end]).collect();
                for (index, one) in ends.iter().enumerate() {
                    let square = one.map(|metres| (metres / place.width_m).floor() as i32);
                    assert!(place.open.contains(&square), "{shape:?} {seed}: {one:?}");
                    for other in &ends[..index] {
                        assert!((one[0] - other[0]).hypot(one[1] - other[1]) >= 1.9, "{shape:?} {seed}");
                    }
                }
            }
        }
    }
}
