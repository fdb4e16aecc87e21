//! The moves between neighbours in a grid.

use std::f64::consts::SQRT_2;

use crate::map::VoxelIndex;

/// Square root of three.
pub(crate) const SQRT_3: f64 = 1.732_050_807_568_877_2;

/// The middle of a neighbourhood of 27 cells, as a bit of it.
pub(crate) const CENTRE: u32 = bit([0; 3]);

/// A move to a neighbour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Cells along x, y and z, each -1, 0 or 1.
    pub by: [i8; 3],
    /// Along how many axes it leads, less one: 0 through a face, 1 across an edge, 2 across a corner.
    pub kind: usize,
    pub length: f64,
    /// The box that a body sweeps on its way, without the cell it leaves, as bits of a neighbourhood
    /// ([`OccupancyGrid::blocked_around`](super::OccupancyGrid::blocked_around)).
    pub swept: u32,
    /// The cell it leads to, as a bit of a neighbourhood.
    pub end: u32,
}

/// Length of a move of each kind, in cells.
pub(super) const LENGTHS: [f64; 3] = [1.0, SQRT_2, SQRT_3];

/// The moves to all 26 neighbours: z slowest, x fastest, from -1 to 1. The reverse of move `n` is move `25 - n`.
pub const MOVES: [Move; 26] = moves();

/// The bit of a neighbour in a neighbourhood of 27 cells.
pub(super) const fn bit(by: [i8; 3]) -> u32 {
    1 << ((by[2] + 1) * 9 + (by[1] + 1) * 3 + by[0] + 1)
}

const fn moves() -> [Move; 26] {
    let mut moves = [Move { by: [0; 3], kind: 0, length: 0.0, swept: 0, end: 0 }; 26];
    let mut number = 0;
    let mut place = 0;
    while place < 27 {
        let by = [place % 3 - 1, place / 3 % 3 - 1, place / 9 - 1];
        if place != 13 {
            let kind = (by[0] * by[0] + by[1] * by[1] + by[2] * by[2] - 1) as usize;
            let length = LENGTHS[kind];
            moves[number] = Move { by, kind, length, swept: swept(by), end: bit(by) };
            number += 1;
        }
        place += 1;
    }
    moves
}

/// Each subset of the axes moved along is a corner of the box; the empty one is the cell left.
const fn swept(by: [i8; 3]) -> u32 {
    let mut bits = 0;
    let mut axes = 1;
    while axes < 8 {
        let corner = [by[0] * (axes & 1), by[1] * (axes >> 1 & 1), by[2] * (axes >> 2)];
        bits |= bit(corner);
        axes += 1;
    }
    bits & !bit([0; 3])
}

/// Cells of a neighbourhood that lie in its middle along x, y and z, as bits.
const MIDDLE: [u32; 3] = [0o222_222_222, 0o070_070_070, 0o000_777_000];
/// All 27 cells of a neighbourhood.
const NEIGHBOURHOOD: u32 = 0o777_777_777;

/// The ends of the moves whose boxes are free ([`Move::swept`]), of a neighbourhood with these cells blocked and its
/// middle free. Along one axis after the other, what is blocked in the middle blocks what lies further out.
#[inline]
pub(crate) fn unswept(blocked: u32) -> u32 {
    let spread = |blocked: u32, middle: u32, apart: u32| {
        blocked | (blocked & middle) << apart | (blocked & middle) >> apart
    };
    let [x, y, z] = MIDDLE;
    !spread(spread(spread(blocked, x, 1), y, 3), z, 9) & NEIGHBOURHOOD & !CENTRE
}

#[inline]
pub(crate) fn moves_to(mut ends: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = ends.trailing_zeros();
        ends &= ends.wrapping_sub(1);
        (place < u32::BITS).then_some(place as usize - usize::from(place > 13))
    })
}

/// Where a move leads from a cell; below zero, to the far end of the integers, which is in no grid.
#[inline]
pub fn moved(cell: VoxelIndex, by: [i8; 3]) -> VoxelIndex {
    VoxelIndex {
        x: cell.x.wrapping_add_signed(by[0].into()),
        y: cell.y.wrapping_add_signed(by[1].into()),
        z: cell.z.wrapping_add_signed(by[2].into()),
    }
}

/// Bits of a coordinate in a [`Packed`] cell: more than a grid can have along an axis.
pub(crate) const PACKED_BITS: u32 = 21;

/// A cell in one word, ordered by z, then y, then x.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Packed(u64);

impl Packed {
    #[inline]
    pub fn of(VoxelIndex { x, y, z }: VoxelIndex) -> Packed {
        Packed(((z as u64) << PACKED_BITS | y as u64) << PACKED_BITS | x as u64)
    }

    #[inline]
    pub fn unpacked(self) -> VoxelIndex {
        let at = |axis: u32| (self.0 >> (axis * PACKED_BITS) & ((1 << PACKED_BITS) - 1)) as usize;
        VoxelIndex { x: at(0), y: at(1), z: at(2) }
    }
}

/// Cost of the shortest way between two cells on an empty grid whose steps through a face, across an edge and across a
/// corner cost `[1, sqrt 2, sqrt 3]` times the unit, or anything else for which the longer diagonals pay.
#[inline]
pub fn octile(from: VoxelIndex, to: VoxelIndex, costs: [f64; 3]) -> f64 {
    let apart = [from.x.abs_diff(to.x), from.y.abs_diff(to.y), from.z.abs_diff(to.z)];
    let [x, y, z] = apart.map(|count| count as u32);
    let (least, most) = (x.min(y).min(z), x.max(y).max(z));
    let middle = x + y + z - least - most;
    // Diagonals through space, then through a face, then along an axis.
    f64::from(least) * costs[2] + f64::from(middle - least) * costs[1] + f64::from(most - middle) * costs[0]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn moves_have_their_lengths_reverses_and_boxes() {
        for (number, step) in MOVES.iter().enumerate() {
            let squared: i32 = step.by.iter().map(|c| i32::from(*c) * i32::from(*c)).sum();
            assert_eq!(step.length, f64::from(squared).sqrt());
            assert_eq!(MOVES[25 - number].by, step.by.map(|c| -c));
            assert_eq!(step.swept.count_ones(), [1, 3, 7][step.kind]);
            assert!(step.swept & step.end != 0);
        }
    }

    proptest! {
        #[test]
        fn the_moves_found_are_those_whose_boxes_are_free(blocked in 0..=NEIGHBOURHOOD) {
            let blocked = blocked & !CENTRE;
            let free: Vec<usize> = (0..26).filter(|number| blocked & MOVES[*number].swept == 0).collect();
            prop_assert_eq!(moves_to(unswept(blocked)).collect::<Vec<_>>(), free);
        }
    }

    #[test]
    fn an_empty_grid_is_crossed_by_the_longest_diagonals_first() {
        let [from, to] = [(7, 0, 2), (2, 3, 3)].map(|(x, y, z)| VoxelIndex { x, y, z });
        let expected = SQRT_3 + 2.0 * SQRT_2 + 2.0;
        assert!((octile(from, to, [1.0, SQRT_2, SQRT_3]) - expected).abs() < 1e-12);
    }
}
