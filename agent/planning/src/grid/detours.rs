//! Steps that a cheapest way need not take: what A* leaves out of symmetric ways (Harabor and Grastien 2011: pruning
//! rules; Sturtevant and Rabin 2016: canonical orderings), in space, and where no corner is cut.
//!
//! A way comes to a cell by a move and goes on by another. A *detour* leads from where the way came from to where it
//! goes, past the cell, without being longer. Where one is free, the step on can be left out.

use super::moves::{LENGTHS, bit};
use super::{MOVES, moves_to};

/// A detour that does not exist needs this bit free, which never is.
const NEVER: u32 = 1 << 31;
/// Detours by way of another cell that are looked at: the shortest ones.
const LOOKED_AT: usize = 2;
/// Sums of step lengths that differ by less are the same but for rounding.
const SAME_LENGTH: f64 = 1e-9;

/// Which detours do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Worth {
    None,
    Direct,
    /// Those of two steps too: steps from no cell cost more beyond their length than those from the one passed by.
    Any,
}

/// The detours around a cell, for a move to it and one on, as the cells that must be free for them: bits of the
/// neighbourhood of the cell.
#[derive(Clone, Copy)]
struct Detours {
    direct: u32,
    by_way: [u32; LOOKED_AT],
}

/// By the move to the cell and the one on.
static DETOURS: [[Detours; 26]; 26] = all();

/// The ends of moves without those for which there is a detour, for a cell that was arrived at by a move and has these
/// cells around it blocked.
#[inline]
pub(super) fn without(ends: u32, blocked: u32, arrived_by: usize, worth: Worth) -> u32 {
    let blocked = blocked | NEVER;
    let detours = &DETOURS[arrived_by];
    let is_free = |needed: u32| blocked & needed == 0;
    match worth {
        Worth::None => ends,
        Worth::Direct => moves_to(ends).fold(ends, |left, number| {
            left & !(u32::from(is_free(detours[number].direct)) * MOVES[number].end)
        }),
        Worth::Any => moves_to(ends).fold(ends, |left, number| {
            let Detours { direct, by_way: [one, other] } = detours[number];
            let has_detour = is_free(direct) | is_free(one) | is_free(other);
            left & !(u32::from(has_detour) * MOVES[number].end)
        }),
    }
}

const fn all() -> [[Detours; 26]; 26] {
    let mut table = [[Detours { direct: NEVER, by_way: [NEVER; LOOKED_AT] }; 26]; 26];
    let mut to = 0;
    while to < 26 {
        let mut on = 0;
        while on < 26 {
            table[to][on] = around(to, on);
            on += 1;
        }
        to += 1;
    }
    table
}

/// The detours around the middle of a neighbourhood.
const fn around(to: usize, on: usize) -> Detours {
    let [a, b, c] = MOVES[to].by;
    let (from, end) = ([-a, -b, -c], MOVES[on].by);
    let mut found = Detours { direct: NEVER, by_way: [NEVER; LOOKED_AT] };
    if is_one_step(from, end) {
        found.direct = between(from, end);
    }
    let length = MOVES[to].length + MOVES[on].length;
    let mut lengths = [f64::INFINITY; LOOKED_AT];
    let mut number = 0;
    while number < 26 {
        let way = MOVES[number].by;
        number += 1;
        if is_same(way, from) || is_same(way, end) || !is_one_step(from, way) || !is_one_step(way, end) {
            continue;
        }
        let (first, last) = (kind(from, way), kind(way, end));
        let detour = LENGTHS[first] + LENGTHS[last];
        let is_as_good =
            detour < length - SAME_LENGTH || detour < length + SAME_LENGTH && last < MOVES[on].kind;
        if is_as_good && detour < lengths[LOOKED_AT - 1] {
            let needed = between(from, way) | between(way, end);
            if detour < lengths[0] {
                (lengths, found.by_way) = ([detour, lengths[0]], [needed, found.by_way[0]]);
            } else {
                (lengths[1], found.by_way[1]) = (detour, needed);
            }
        }
    }
    found
}

/// Whether a step, or none, leads from one to the other of two cells of a neighbourhood.
const fn is_one_step(from: [i8; 3], to: [i8; 3]) -> bool {
    let [x, y, z] = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
    x * x <= 1 && y * y <= 1 && z * z <= 1
}

/// Whether they are the same cell.
const fn is_same(one: [i8; 3], other: [i8; 3]) -> bool {
    one[0] == other[0] && one[1] == other[1] && one[2] == other[2]
}

/// The kind of the step between two cells.
const fn kind(from: [i8; 3], to: [i8; 3]) -> usize {
    let axes = (from[0] != to[0]) as usize + (from[1] != to[1]) as usize + (from[2] != to[2]) as usize;
    axes - 1
}

/// The box that a step, or none, from one cell of a neighbourhood to another sweeps, both included, as bits of it.
const fn between(from: [i8; 3], to: [i8; 3]) -> u32 {
    let mut bits = 0;
    let mut corner = 0;
    while corner < 8 {
        bits |= bit([
            if corner & 1 == 0 { from[0] } else { to[0] },
            if corner & 2 == 0 { from[1] } else { to[1] },
            if corner & 4 == 0 { from[2] } else { to[2] },
        ]);
        corner += 1;
    }
    bits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::unswept;

    /// The numbers of the moves left of all from a cell with these around it blocked.
    fn left(blocked: u32, arrived_by: usize, worth: Worth) -> Vec<[i8; 3]> {
        let ends = without(unswept(blocked), blocked, arrived_by, worth);
        moves_to(ends).map(|number| MOVES[number].by).collect()
    }

    fn number(by: [i8; 3]) -> usize {
        MOVES.iter().position(|step| step.by == by).unwrap()
    }

    #[test]
    fn in_the_open_a_way_goes_straight_on_and_only_turns_towards_lesser_diagonals() {
        let straight = left(0, number([1, 0, 0]), Worth::Any);
        assert_eq!(straight, [[1, 0, 0]]);
        let mut across_an_edge = left(0, number([1, -1, 0]), Worth::Any);
        across_an_edge.sort_unstable();
        assert_eq!(across_an_edge, [[0, -1, 0], [1, -1, 0], [1, 0, 0]]);
        assert_eq!(left(0, number([1, 1, 1]), Worth::Any).len(), 7);
    }

    #[test]
    fn without_detours_of_two_steps_all_moves_remain_that_lead_on() {
        let on = left(0, number([0, 0, 1]), Worth::Direct);
        assert_eq!(on, (0..9).map(|n| [n % 3 - 1, n / 3 - 1, 1]).collect::<Vec<_>>());
        assert_eq!(left(0, number([0, 0, 1]), Worth::None).len(), 26);
    }

    #[test]
    fn past_a_corner_ways_turn() {
        // In the plane, eastwards past a blocked cell to the south-west: one may turn south there.
        let flat = 0o777 | 0o777 << 18;
        let past = left(flat | bit([-1, -1, 0]), number([1, 0, 0]), Worth::Any);
        assert_eq!(past, [[0, -1, 0], [1, -1, 0], [1, 0, 0]]);
        assert_eq!(left(flat, number([1, 0, 0]), Worth::Any), [[1, 0, 0]]);
    }

    #[test]
    fn every_detour_is_a_way() {
        for (to, row) in DETOURS.iter().enumerate() {
            for (on, Detours { direct, by_way }) in row.iter().enumerate() {
                for needed in by_way.iter().chain([direct]).filter(|needed| **needed != NEVER) {
                    let ends = MOVES[25 - to].end | MOVES[on].end;
                    assert_eq!(needed & ends, ends, "it begins and ends where the way does");
                }
            }
        }
    }
}
