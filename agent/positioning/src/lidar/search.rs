//! Correlative search for where a scan fits a map, over a window of places and headings.
//!
//! Branch and bound, best first: the bound of a square of places is taken from a map of which each cell holds the best
//! of the square beyond it (Hess 2016). The first single place that comes up is the best of all.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::PI;

use nalgebra::{Isometry2, Vector2};

use super::level::Return;
use super::local_map::{CELL_M, LocalMap, SIDE};

/// The widest square of places has 2 to the power of this cells along its edge.
const TOP: usize = 5;
/// Returns that are looked up, at most.
const MOST_POINTS: usize = 120;
/// Score of a cell with a surface, and of one beside it.
const SCORES: [u8; 2] = [255, 130];
/// Less than this share of the best score is no fit.
const LEAST_SCORE: f64 = 0.45;
/// A second place this good, as a share of the first, makes the find ambiguous.
const RIVAL: f64 = 0.88;
/// Places nearer than this, m, and headings nearer, rad, are one find.
const ONE_FIND: (f64, f64) = (0.9, 0.3);
/// Squares in the queue, at most: 32 bytes each.
const MOST_QUEUED: usize = 200_000;

/// The result of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Found {
    /// The budget is used up; more of it goes on.
    Searching,
    /// The scan fits here, to a cell and a step of heading, and nowhere else in the window.
    At(Isometry2<f64>),
    /// It fits nowhere, or at several places.
    Nowhere,
}

/// A search in work. Its memory is at most some ten megabytes, and is freed with it.
#[derive(Clone, Debug)]
pub struct Search {
    guess: Isometry2<f64>,
    /// Maps whose cells hold the best of squares of 1, 2, 4 ... cells.
    levels: Vec<Vec<u8>>,
    /// For each heading: turned from the guess by so much, rad, and the cells of the returns.
    headings: Vec<(f64, Vec<[i32; 2]>)>,
    queue: BinaryHeap<Square>,
    best: Option<Square>,
}

/// A square of places for one heading.
#[derive(Clone, Copy, Debug)]
struct Square {
    /// No place of the square scores more.
    bound: u32,
    heading: u32,
    /// Cells away from the guess, of the corner with the least.
    corner: [i32; 2],
    level: u8,
}

impl Search {
    /// Prepares a search within `reach_m` of the guess along each axis and `turn_rad` of its heading (a whole turn from
    /// pi on).
    pub fn new(map: &LocalMap, scan: &[Return], guess: &Isometry2<f64>, reach_m: f64, turn_rad: f64) -> Self {
        let stride = scan.len().div_ceil(MOST_POINTS).max(1);
        let points: Vec<Vector2<f64>> = scan.iter().step_by(stride).map(|one| one.point).collect();
        let mut ranges: Vec<f64> = points.iter().map(|point| point.norm()).collect();
        ranges.sort_by(f64::total_cmp);
        let far_m = ranges.get(ranges.len() * 4 / 5).copied().unwrap_or(1.0);
        let step = (CELL_M / far_m.max(1.0)).clamp(0.006, 0.05);
        let turns = (turn_rad.min(PI) / step).ceil() as i32;
        let heading = |turn: i32| {
            let turn_rad = f64::from(turn) * step;
            let rotation = guess.rotation * nalgebra::UnitComplex::new(turn_rad);
            let cell = |point: &Vector2<f64>| {
                map.cell(&(rotation * point + guess.translation.vector)).map(|cell| cell as i32)
            };
            (turn_rad, points.iter().map(cell).collect())
        };
        let mut search = Self {
            guess: *guess,
            levels: levels(map),
            headings: (-turns..=turns).map(heading).collect(),
            queue: BinaryHeap::new(),
            best: None,
        };
        let (edge, reach) = (1 << TOP, (reach_m / CELL_M).ceil() as i32);
        let corners = || (-reach..=reach).step_by(edge);
        for heading in 0..search.headings.len() as u32 {
            for corner in corners().flat_map(|x| corners().map(move |y| [x, y])) {
                // Not scored yet: that is part of the search.
                search.queue.push(Square { bound: u32::MAX, heading, corner, level: TOP as u8 });
            }
        }
        search
    }

    /// Looks at `squares` squares more.
    pub fn advance(&mut self, squares: usize) -> Found {
        for _ in 0..squares {
            let Some(square) = self.queue.pop() else { return self.found() };
            if square.bound == u32::MAX {
                let square = Square { bound: self.score(&square), ..square };
                self.push(square);
                continue;
            }
            let least = self.best.map_or(self.least(), |best| (f64::from(best.bound) * RIVAL) as u32);
            if square.bound < least {
                return self.found();
            }
            if square.level > 0 {
                self.split(&square);
            } else if self.best.is_none_or(|best| self.is_one(&best, &square)) {
                self.best.get_or_insert(square);
            } else {
                return Found::Nowhere;
            }
            if self.queue.len() > MOST_QUEUED {
                return Found::Nowhere;
            }
        }
        Found::Searching
    }

    fn found(&self) -> Found {
        self.best.map_or(Found::Nowhere, |best| Found::At(self.pose(&best)))
    }

    fn pose(&self, square: &Square) -> Isometry2<f64> {
        let (turn_rad, _) = self.headings[square.heading as usize];
        let off = Vector2::from(square.corner.map(f64::from)) * CELL_M;
        let rotation = self.guess.rotation * nalgebra::UnitComplex::new(turn_rad);
        Isometry2::from_parts((self.guess.translation.vector + off).into(), rotation)
    }

    fn is_one(&self, best: &Square, other: &Square) -> bool {
        let (best, other) = (self.pose(best), self.pose(other));
        let off_m = (best.translation.vector - other.translation.vector).norm();
        off_m < ONE_FIND.0 && best.rotation.angle_to(&other.rotation).abs() < ONE_FIND.1
    }

    /// The least score of a fit.
    fn least(&self) -> u32 {
        let points = self.headings.first().map_or(0, |(_, points)| points.len());
        ((points as f64 * 255.0 * LEAST_SCORE) as u32).max(1)
    }

    fn split(&mut self, square: &Square) {
        let level = square.level - 1;
        let half = 1 << level;
        for [x, y] in [[0, 0], [half, 0], [0, half], [half, half]] {
            let corner = [square.corner[0] + x, square.corner[1] + y];
            let part = Square { corner, level, ..*square };
            let bound = self.score(&part).min(square.bound);
            self.push(Square { bound, ..part });
        }
    }

    fn push(&mut self, square: Square) {
        if square.bound >= self.least() {
            self.queue.push(square);
        }
    }

    fn score(&self, square: &Square) -> u32 {
        let (_, points) = &self.headings[square.heading as usize];
        let (map, edge, side) = (&self.levels[usize::from(square.level)], 1 << square.level, SIDE as i32);
        let score = |[x, y]: &[i32; 2]| {
            // A square that begins beyond the map's edge reaches into it.
            let inside = |at: i32| if at < 0 && at > -edge { 0 } else { at };
            let (x, y) = (inside(x + square.corner[0]), inside(y + square.corner[1]));
            let is_inside = (0..side).contains(&x) && (0..side).contains(&y);
            if is_inside { u32::from(map[(y * side + x) as usize]) } else { 0 }
        };
        points.iter().map(score).sum()
    }
}

/// The map's cells by score, and for each level the best of the square that begins at a cell.
fn levels(map: &LocalMap) -> Vec<Vec<u8>> {
    let mut cells = vec![0_u8; SIDE * SIDE];
    let side = SIDE as i64;
    for surface in map.surfaces() {
        let [column, row] = map.cell(&surface.point);
        for (x, y) in (-1..=1).flat_map(|x| (-1..=1).map(move |y| (x, y))) {
            let (column, row) = (column + x, row + y);
            if (0..side).contains(&column) && (0..side).contains(&row) {
                let cell = &mut cells[(row * side + column) as usize];
                *cell = (*cell).max(SCORES[usize::from(x != 0 || y != 0)]);
            }
        }
    }
    let mut levels = vec![cells];
    for level in 0..TOP {
        levels.push(wider(&levels[level], 1 << level));
    }
    levels
}

/// Squares twice as wide as those of `cells`, which are `edge` wide.
fn wider(cells: &[u8], edge: usize) -> Vec<u8> {
    let mut wide = cells.to_vec();
    for (row, wide) in cells.chunks_exact(SIDE).zip(wide.chunks_exact_mut(SIDE)) {
        raise(wide, &row[edge..]);
    }
    let narrow = wide.clone();
    raise(&mut wide, &narrow[edge * SIDE..]);
    wide
}

/// The greater of both, one by one, as far as both reach.
fn raise(cells: &mut [u8], by: &[u8]) {
    for (cell, by) in cells.iter_mut().zip(by) {
        *cell = (*cell).max(*by);
    }
}

impl PartialEq for Square {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Square {}

impl PartialOrd for Square {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Square {
    fn cmp(&self, other: &Self) -> Ordering {
        let rank =
            |square: &Self| (square.bound, std::cmp::Reverse(square.level), square.heading, square.corner);
        rank(self).cmp(&rank(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lidar::level::LevelScan;
    use crate::lidar::matching::refine;
    use crate::lidar::synthetic::{World, flat};

    fn level(world: &World, pose: &Isometry2<f64>, seed: u64) -> Vec<Return> {
        LevelScan::new(&world.scan(pose, seed).sweep(), &flat(*pose, 1e-4), |_| false).returns
    }

    fn find(world: &World, pose: &Isometry2<f64>, seed: u64) -> Found {
        let mut map = LocalMap::new(&Vector2::zeros());
        map.add(&Isometry2::identity(), &level(world, &Isometry2::identity(), 1000));
        let mut search = Search::new(&map, &level(world, pose, seed), &Isometry2::identity(), 8.0, PI);
        let mut found = Found::Searching;
        let mut calls = 0;
        while found == Found::Searching {
            found = search.advance(2000);
            calls += 1;
            assert!(calls < 500, "it ends");
        }
        if let Found::At(found) = found {
            let off = pose.inverse() * found;
            assert!(off.translation.vector.norm() < 0.5 && off.rotation.angle().abs() < 0.05, "{off}");
            let fine = refine(&map, &level(world, pose, seed), &found).unwrap();
            assert!((pose.inverse() * fine.pose).translation.vector.norm() < 0.05);
        }
        found
    }

    #[test]
    fn a_lost_scan_is_found_anywhere_in_a_wood() {
        let forest = World::forest(3, 30.0, 0.04);
        let finds = (0..10).filter(|seed| {
            let turn = *seed as f64 * 2.0;
            let pose = Isometry2::new(Vector2::new(5.0 * turn.cos(), 1.0 * turn.sin()), turn);
            matches!(find(&forest, &pose, *seed), Found::At(_))
        });
        assert!(finds.count() >= 9);
    }

    #[test]
    fn what_fits_twice_is_not_found() {
        // Turned by half a turn, the room looks the same.
        assert_eq!(
            find(&World::room(12.0, 7.0), &Isometry2::new(Vector2::new(1.0, 0.5), 0.3), 1),
            Found::Nowhere
        );
        let mut room = World::room(12.0, 7.0);
        room.trunks.push((Vector2::new(4.0, 2.0), 0.6));
        room.walls.push([Vector2::new(-3.0, 3.5), Vector2::new(-3.0, 1.0)]);
        let found = find(&room, &Isometry2::new(Vector2::new(1.0, 0.5), 0.3), 1);
        assert!(matches!(found, Found::At(_)), "a pillar and a niche tell");
    }
}
