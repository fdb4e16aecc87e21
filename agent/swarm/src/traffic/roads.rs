//! Which moves obstacles allow, and how far it is to a goal.

use std::collections::VecDeque;

use nalgebra::Vector3;

use super::lattice::{Lattice, Move, State};

/// Places of a move at which its clearance is looked at.
const PLACES: u8 = 8;

/// The moves on a lattice that keep clear of everything fixed, and from whose ends a vehicle can brake as clear.
///
/// Building looks at the clearance of at most eight places for each state and speed: some ten thousand for a room of
/// 10 m.
#[derive(Debug, Clone)]
pub struct Roads {
    lattice: Lattice,
    /// For each state a bit for each speed it may have a step later.
    exits: Vec<u32>,
}

/// Steps from every state to a goal, when nobody is in the way.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Distances {
    goal: State,
    steps: Vec<u16>,
}

const UNREACHABLE: u16 = u16::MAX;

impl Roads {
    /// `clearance` is the distance from a point (world ENU, m) to the nearest obstacle, m; a move must keep `least_m`
    /// of it.
    pub fn new(lattice: Lattice, clearance: impl Fn(&Vector3<f64>) -> f64, least_m: f64) -> Self {
        let is_clear = |from: State, to: State| {
            let movement = Move { from, to };
            (0..=PLACES).all(|place| {
                let place = movement.place(f64::from(place) / f64::from(PLACES));
                clearance(&lattice.point(&place)) >= least_m
            })
        };
        let mut roads = Self { exits: Vec::new(), lattice: lattice.clone() };
        let count = roads.state_count();
        let mut can_brake = vec![false; count];
        for index in 0..count {
            let state = roads.state(index);
            if let Some(can_brake) = can_brake.get_mut(index) {
                *can_brake = is_clear(state, state.braked());
            }
        }
        roads.exits = (0..count)
            .map(|index| {
                let state = roads.state(index);
                let mut exits = 0;
                for after in state.successors() {
                    let ends_well =
                        roads.index(&after).is_some_and(|index| can_brake.get(index) == Some(&true));
                    if ends_well && can_brake.get(index) == Some(&true) && is_clear(state, after) {
                        exits |= bit(after.speed);
                    }
                }
                exits
            })
            .collect();
        roads
    }

    /// Where the cells are.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    pub fn state_count(&self) -> usize {
        self.axis_counts().iter().product()
    }

    /// Whether a vehicle can be in this state without touching anything.
    pub fn is_open(&self, state: &State) -> bool {
        self.exits_of(state) != 0
    }

    /// The states that may follow a step later.
    pub fn exits(&self, state: State) -> impl Iterator<Item = State> {
        let exits = self.exits_of(&state);
        (0..27).filter(move |code| exits & (1 << code) != 0).map(move |code| state.then(speed(code)))
    }

    fn exits_of(&self, state: &State) -> u32 {
        self.index(state).and_then(|index| self.exits.get(index)).copied().unwrap_or(0)
    }

    /// Steps from every state to rest at `goal`: a breadth-first search, once for each goal.
    pub fn distances(&self, goal: State) -> Distances {
        let mut steps = vec![UNREACHABLE; self.state_count()];
        let mut queue = VecDeque::new();
        if let Some(step) = self.index(&goal).and_then(|index| steps.get_mut(index)) {
            *step = 0;
            queue.push_back((goal, 0));
        }
        while let Some((state, distance)) = queue.pop_front() {
            for before in state.predecessors() {
                let Some(step) = self.index(&before).and_then(|index| steps.get_mut(index)) else { continue };
                let next: u16 = distance + 1;
                if *step > next && self.exits_of(&before) & bit(state.speed) != 0 {
                    *step = next;
                    queue.push_back((before, next));
                }
            }
        }
        Distances { goal, steps }
    }

    /// The way from `state` to the goal of `distances`, as the cells it passes through in order. Where several are as
    /// short, the one that moves least.
    pub fn route(&self, state: State, distances: &Distances) -> Vec<[i16; 3]> {
        let mut state = state;
        let mut route = Vec::new();
        while let Some(distance) = distances.steps_from(self, &state) {
            let cell = state.braked().place.map(|place| place / 2);
            if route.last() != Some(&cell) {
                route.push(cell);
            }
            let nearer = |after: &State| {
                distances.steps_from(self, after).is_some_and(|steps| Some(steps) == distance.checked_sub(1))
            };
            let next = self.exits(state).filter(nearer).min_by_key(|after| travelled(&state, after));
            let Some(next) = next else { break };
            state = next;
        }
        route
    }

    /// Whether a vehicle can rest in a cell.
    pub fn is_cell_open(&self, cell: [i16; 3]) -> bool {
        self.is_open(&State::at_rest(cell))
    }

    fn axis_counts(&self) -> [usize; 3] {
        self.lattice.cells().map(|cells| 3 * cells - 2)
    }

    /// The index of a state on the lattice; `None` outside of it.
    pub(super) fn index(&self, state: &State) -> Option<usize> {
        let mut index = 0;
        for axis in (0..3).rev() {
            let (place, speed) = (state.place[axis], state.speed[axis]);
            let cell = usize::try_from(place.div_euclid(2)).ok()?;
            let part = match speed {
                0 => 0,
                1 => 1,
                _ => 2,
            };
            let cells = self.lattice.cells()[axis];
            if cell >= cells || (part > 0 && cell + 1 >= cells) {
                return None;
            }
            index = index * (3 * cells - 2) + 3 * cell + part;
        }
        Some(index)
    }

    pub(super) fn state(&self, mut index: usize) -> State {
        let mut state = State { place: [0; 3], speed: [0; 3] };
        for (axis, count) in self.axis_counts().into_iter().enumerate() {
            let (cell, part) = ((index % count) / 3, (index % count) % 3);
            state.speed[axis] = [0, 1, -1][part];
            state.place[axis] = 2 * cell as i16 + i16::from(part > 0);
            index /= count;
        }
        state
    }
}

impl Distances {
    pub fn goal(&self) -> State {
        self.goal
    }

    /// Steps from a state to the goal; `None` if it cannot be reached.
    pub fn steps_from(&self, roads: &Roads, state: &State) -> Option<u16> {
        roads.index(state).and_then(|index| self.at_index(index))
    }

    pub(super) fn at_index(&self, index: usize) -> Option<u16> {
        self.steps.get(index).copied().filter(|steps| *steps != UNREACHABLE)
    }
}

/// Half cells travelled in a step, along all axes together.
pub(super) fn travelled(from: &State, to: &State) -> u32 {
    from.place.iter().zip(to.place).map(|(from, to)| u32::from(from.abs_diff(to))).sum()
}

fn bit(speed: [i8; 3]) -> u32 {
    let [x, y, z] = speed.map(|speed| (speed + 1) as u32);
    1 << (x + 3 * y + 9 * z)
}

fn speed(code: u32) -> [i8; 3] {
    [code % 3, code / 3 % 3, code / 9].map(|digit| digit as i8 - 1)
}

/// A room of cells of 0.5 m, walls where the picture has `#`; north is up.
#[cfg(test)]
pub(super) fn room(picture: &[&str]) -> Roads {
    let walls: Vec<Vector3<f64>> = picture
        .iter()
        .rev()
        .enumerate()
        .flat_map(|(y, row)| {
            row.chars()
                .enumerate()
                .filter(|(_, c)| *c == '#')
                .map(move |(x, _)| Vector3::new(x as f64, y as f64, 0.0) * 0.5)
        })
        .collect();
    let greatest = Vector3::new(picture[0].len() as f64 - 1.0, picture.len() as f64 - 1.0, 0.0) * 0.5;
    let lattice = Lattice::new(Vector3::zeros(), greatest, Vector3::zeros(), 0.5);
    let clearance = move |point: &Vector3<f64>| {
        let to_box =
            |wall: &Vector3<f64>| (point - wall).abs().add_scalar(-0.25).map(|d| d.max(0.0)).xy().norm();
        walls.iter().map(to_box).fold(f64::INFINITY, f64::min)
    };
    Roads::new(lattice, clearance, 0.22)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_of_ten_cells_takes_a_step_for_each_and_one_to_start() {
        let roads = room(&["..........."]);
        let distances = roads.distances(State::at_rest([10, 0, 0]));
        assert_eq!(distances.steps_from(&roads, &State::at_rest([0, 0, 0])), Some(11));
    }

    #[test]
    fn a_corner_costs_no_time_and_its_inside_is_not_cut() {
        let roads = room(&["###.", "....", "####"]);
        let distances = roads.distances(State::at_rest([3, 2, 0]));
        assert_eq!(distances.steps_from(&roads, &State::at_rest([0, 1, 0])), Some(5));
        let route = roads.route(State::at_rest([0, 1, 0]), &distances);
        assert_eq!(route, [[0, 1, 0], [1, 1, 0], [2, 1, 0], [3, 1, 0], [3, 2, 0]]);
    }

    #[test]
    fn what_is_walled_in_cannot_be_reached() {
        let roads = room(&["..#.", "..#."]);
        let distances = roads.distances(State::at_rest([3, 0, 0]));
        assert_eq!(distances.steps_from(&roads, &State::at_rest([0, 0, 0])), None);
        assert!(!roads.is_cell_open([2, 0, 0]) && roads.is_cell_open([3, 1, 0]));
    }

    #[test]
    fn indices_and_states_are_the_same_thing() {
        let roads = room(&["...", "...", "..."]);
        for index in 0..roads.state_count() {
            assert_eq!(roads.index(&roads.state(index)), Some(index));
        }
        assert_eq!(roads.index(&State::at_rest([3, 0, 0])), None);
        assert_eq!(roads.index(&State { place: [-1, 0, 0], speed: [1, 0, 0] }), None);
    }
}
