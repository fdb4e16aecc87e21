//! Places and speeds: what a double integrator with limits on each axis reaches exactly in equal steps of time.
//!
//! In each step an axis is at rest, or accelerates, cruises or brakes across half a cell or a whole one. With cells
//! of length `c` and steps of `T`, speeds are `c / T` and accelerations `c / T^2` at most, on each axis. A vehicle at
//! rest is in the middle of a cell; one that moves along an axis crosses the border of two cells exactly between two
//! steps.

use std::ops::RangeInclusive;

use nalgebra::Vector3;

/// Where a vehicle is between two steps, and how it moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct State {
    /// In half cells from the middle of the first cell, on each axis: even at rest, odd in motion.
    pub place: [i16; 3],
    /// In cells per step: -1, 0 or 1 on each axis.
    pub speed: [i8; 3],
}

/// The motion of a vehicle in one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Move {
    /// At its beginning.
    pub from: State,
    /// At its end.
    pub to: State,
}

impl State {
    /// At rest in the middle of a cell.
    pub fn at_rest(cell: [i16; 3]) -> Self {
        Self { place: cell.map(|index| 2 * index), speed: [0; 3] }
    }

    /// Whether it moves on no axis.
    pub fn is_at_rest(&self) -> bool {
        self.speed == [0; 3]
    }

    /// The state a step later, when the speed is `speed` then.
    pub fn then(&self, speed: [i8; 3]) -> Self {
        let mut place = self.place;
        for ((place, before), after) in place.iter_mut().zip(self.speed).zip(speed) {
            *place += i16::from(before) + i16::from(after);
        }
        Self { place, speed }
    }

    /// The state a step later, when the vehicle brakes: at rest.
    pub fn braked(&self) -> Self {
        self.then([0; 3])
    }

    /// Every state a step later that the limits allow: no axis turns round without a rest, two at most move, and one
    /// at most cruises. More would carry a vehicle farther in a step than it can answer for within the range of its
    /// radio.
    pub fn successors(&self) -> impl Iterator<Item = Self> + '_ {
        let [x, y, z] = self.speed.map(speeds_after);
        z.flat_map(move |z| {
            let x = x.clone();
            y.clone().flat_map(move |y| x.clone().map(move |x| [x, y, z]))
        })
        .filter(|after| moving(&self.speed, after) <= 2 && cruising(&self.speed, after) <= 1)
        .map(|after| self.then(after))
    }

    /// Every state a step earlier from which this one is allowed.
    pub fn predecessors(&self) -> impl Iterator<Item = Self> + '_ {
        // The same backwards in time.
        let reversed = Self { place: self.place, speed: self.speed.map(|speed| -speed) };
        let before: Vec<_> = reversed.successors().collect();
        before.into_iter().map(|state| Self { place: state.place, speed: state.speed.map(|speed| -speed) })
    }
}

fn speeds_after(speed: i8) -> RangeInclusive<i8> {
    (speed - 1).max(-1)..=(speed + 1).min(1)
}

/// Axes that move at the beginning or the end of a step.
fn moving(before: &[i8; 3], after: &[i8; 3]) -> usize {
    before.iter().zip(after).filter(|(before, after)| **before != 0 || **after != 0).count()
}

/// Axes that move as fast as they may, all through a step.
fn cruising(before: &[i8; 3], after: &[i8; 3]) -> usize {
    before.iter().zip(after).filter(|(before, after)| **before != 0 && before == after).count()
}

impl Move {
    /// Where it is at `phase` of the step, 0 to 1, in half cells.
    pub fn place(&self, phase: f64) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| {
            let (place, before, after) = self.axis(axis);
            place + phase * (2.0 * before + phase * (after - before))
        })
    }

    /// Its speed at `phase` of the step, 0 to 1, in cells per step.
    pub fn speed(&self, phase: f64) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| {
            let (_, before, after) = self.axis(axis);
            before + phase * (after - before)
        })
    }

    /// Place at the beginning, and speeds at both ends, on one axis.
    pub(super) fn axis(&self, axis: usize) -> (f64, f64, f64) {
        let speed = |state: &State| f64::from(state.speed[axis]);
        (f64::from(self.from.place[axis]), speed(&self.from), speed(&self.to))
    }
}

/// Where in the world the cells are.
#[derive(Debug, Clone, PartialEq)]
pub struct Lattice {
    /// Middle of the first cell, world ENU, m.
    first: Vector3<f64>,
    cell_m: f64,
    cells: [usize; 3],
}

impl Lattice {
    /// All cells whose middles lie between `least` and `greatest` (world ENU, m), with one in the middle of which is
    /// `through`. An axis with as little room as for one middle has one cell.
    pub fn new(least: Vector3<f64>, greatest: Vector3<f64>, through: Vector3<f64>, cell_m: f64) -> Self {
        let slack = 1e-6;
        let below = (through - least).map(|room| (room / cell_m + slack).floor().max(0.0));
        let above = (greatest - through).map(|room| (room / cell_m + slack).floor().max(0.0));
        let cells = below + above;
        Self {
            first: through - below * cell_m,
            cell_m,
            cells: [cells.x, cells.y, cells.z].map(|cells| cells as usize + 1),
        }
    }

    /// Length of a cell, m.
    pub fn cell_m(&self) -> f64 {
        self.cell_m
    }

    /// Cells along each axis.
    pub fn cells(&self) -> [usize; 3] {
        self.cells
    }

    /// At rest in the middle of the cell that a point is in, world ENU, m; `None` outside of all.
    pub fn nearest(&self, point: &Vector3<f64>) -> Option<State> {
        let cell = ((point - self.first) / self.cell_m).map(f64::round);
        let inside = (0..3).all(|axis| cell[axis] >= 0.0 && cell[axis] < self.cells[axis] as f64);
        inside.then(|| State::at_rest([cell.x, cell.y, cell.z].map(|index| index as i16)))
    }

    /// A place in half cells, as world ENU, m.
    pub fn point(&self, place: &Vector3<f64>) -> Vector3<f64> {
        self.first + place * (0.5 * self.cell_m)
    }

    /// The greatest way from where a vehicle is when it commits itself to where it will have come to rest, m.
    ///
    /// `ahead_steps` is how long before the beginning of the step in question the commitment is made, counted back to
    /// where the vehicle really is, which lags behind its commands; at most one. Two vehicles that do not hear one
    /// another cannot have commitments that meet, if the range of radio is at least twice this and the distance to be
    /// kept.
    pub fn reach_m(&self, ahead_steps: f64) -> f64 {
        let speeds = || (0..27_i8).map(|code| [code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1]);
        let mut reach = 0.0_f64;
        for before in speeds().map(|speed| State { place: [0; 3], speed }) {
            for at in before.successors() {
                let way = Move { from: before, to: at };
                let here = way.place(1.0 - ahead_steps);
                for then in at.successors() {
                    let end = Vector3::from(then.braked().place.map(f64::from));
                    reach = reach.max((end - here).norm());
                }
            }
        }
        reach * 0.5 * self.cell_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moving(place: [i16; 3], speed: [i8; 3]) -> State {
        State { place, speed }
    }

    #[test]
    fn a_corner_is_flown_in_one_step_like_a_straight() {
        let turn = Move { from: moving([-1, 0, 0], [1, 0, 0]), to: moving([0, 1, 0], [0, 1, 0]) };
        assert_eq!(turn.from.then([0, 1, 0]), turn.to);
        assert_eq!(turn.place(0.5), Vector3::new(-0.25, 0.25, 0.0));
        assert_eq!(turn.place(1.0), Vector3::new(0.0, 1.0, 0.0));
    }

    #[test]
    fn no_axis_turns_round_without_a_rest_two_at_most_move_and_one_cruises() {
        let east = moving([1, 0, 0], [1, 0, 0]);
        assert!(east.successors().all(|after| after.speed[0] >= 0));
        let north_east = moving([1, 1, 0], [1, 1, 0]);
        assert!(north_east.successors().all(|after| after.speed[0] * after.speed[1] == 0));
        assert!(north_east.successors().all(|after| after.speed[2] == 0));
        assert!(north_east.successors().any(|after| after == north_east.braked()), "braking always goes");
    }

    #[test]
    fn predecessors_are_successors_seen_from_the_other_end() {
        let state = moving([3, 4, 1], [1, 0, -1]);
        let before: Vec<_> = state.predecessors().collect();
        assert!(before.iter().all(|one| one.successors().any(|after| after == state)));
        // It cruises on one of its axes at most, and the third stays at rest.
        assert_eq!((before.len(), state.successors().count()), (3, 3));
    }

    #[test]
    fn a_lattice_covers_its_room_through_the_given_point() {
        let lattice = Lattice::new(
            Vector3::new(-1.85, -0.15, 1.0),
            Vector3::new(5.85, 4.15, 1.0),
            Vector3::new(-1.0, 3.0, 1.0),
            0.5,
        );
        assert_eq!(lattice.cells(), [15, 9, 1]);
        let start = lattice.nearest(&Vector3::new(-1.0, 3.0, 1.0));
        assert_eq!(start, Some(State::at_rest([1, 6, 0])));
        assert_eq!(lattice.point(&Vector3::new(2.0, 12.0, 0.0)), Vector3::new(-1.0, 3.0, 1.0));
        assert_eq!(lattice.nearest(&Vector3::new(6.2, 3.0, 1.0)), None);
    }
}
