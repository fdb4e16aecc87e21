//! The least distance of two vehicles in a step.

use super::lattice::Move;

/// The distance to be kept, as the lattice measures it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Apart {
    /// From centre to centre, in half cells.
    pub half_cells: f64,
    /// Heights count less by this factor: the air below a vehicle is not quiet. 1 for a sphere.
    pub downwash: f64,
}

/// Instants at which a step is looked at: near a minimum the distance is wrong by less than a hundredth of a half cell.
const INSTANTS: u8 = 16;

/// The least distance of two vehicles in the same step, in half cells, heights divided by `downwash`.
pub fn closest(one: &Move, other: &Move, downwash: f64) -> f64 {
    let relative = relative(one, other, downwash);
    (0..=INSTANTS).map(|instant| squared(&relative, instant)).fold(f64::INFINITY, f64::min).sqrt()
}

impl Apart {
    /// Whether two vehicles come nearer than this in the same step.
    pub fn is_broken(&self, one: &Move, other: &Move) -> bool {
        // Each axis changes by two half cells at most for each of the two.
        let is_far = |axis: usize| {
            let offset = one.from.place[axis] - other.from.place[axis];
            let scale = if axis == 2 { self.downwash } else { 1.0 };
            f64::from(offset.abs() - 4) / scale >= self.half_cells
        };
        if (0..3).any(is_far) {
            return false;
        }
        let relative = relative(one, other, self.downwash);
        let least = self.half_cells * self.half_cells;
        (0..=INSTANTS).any(|instant| squared(&relative, instant) < least)
    }
}

/// Relative motion: for each axis the coefficients of a polynomial in the phase of the step.
fn relative(one: &Move, other: &Move, downwash: f64) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|axis| {
        let (place, before, after) = one.axis(axis);
        let (other_place, other_before, other_after) = other.axis(axis);
        let (speed, change) = (before - other_before, (after - before) - (other_after - other_before));
        let scale = if axis == 2 { 1.0 / downwash } else { 1.0 };
        [(place - other_place) * scale, 2.0 * speed * scale, change * scale]
    })
}

fn squared(relative: &[[f64; 3]; 3], instant: u8) -> f64 {
    let phase = f64::from(instant) / f64::from(INSTANTS);
    relative
        .iter()
        .map(|[offset, speed, change]| {
            let coordinate = offset + phase * (speed + phase * change);
            coordinate * coordinate
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::super::lattice::State;
    use super::*;

    fn go(place: [i16; 3], before: [i8; 3], after: [i8; 3]) -> Move {
        let from = State { place, speed: before };
        Move { from, to: from.then(after) }
    }

    #[test]
    fn whoever_follows_close_round_a_corner_keeps_a_diagonal_of_half_a_cell() {
        let turning = go([-1, 0, 0], [1, 0, 0], [0, 1, 0]);
        let behind = go([-3, 0, 0], [1, 0, 0], [1, 0, 0]);
        assert!((closest(&turning, &behind, 1.0) - 2.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn two_that_swap_cells_meet() {
        let east = go([0, 0, 0], [0; 3], [1, 0, 0]);
        let west = go([2, 0, 0], [0; 3], [-1, 0, 0]);
        assert_eq!(closest(&east, &west, 1.0), 0.0);
        assert!(Apart { half_cells: 1.4, downwash: 1.0 }.is_broken(&east, &west));
    }

    #[test]
    fn heights_count_by_the_downwash() {
        let low = go([0, 0, 0], [0; 3], [0; 3]);
        let high = go([0, 0, 2], [0; 3], [0; 3]);
        assert_eq!((closest(&low, &high, 1.0), closest(&low, &high, 2.0)), (2.0, 1.0));
    }

    #[test]
    fn the_quick_look_agrees_with_the_distance() {
        let apart = Apart { half_cells: 1.4, downwash: 2.0 };
        let still = go([0, 0, 0], [0; 3], [0; 3]);
        for x in -6..=6 {
            for z in [-4, -2, 0, 2] {
                let near = go([x, 1, z], [0, -1, 0], [1, 0, 0]);
                let broken = closest(&near, &still, apart.downwash) < apart.half_cells;
                assert_eq!(apart.is_broken(&near, &still), broken, "{x} {z}");
            }
        }
    }
}
