//! The order of vehicles: which plans around which.
//!
//! A vehicle that has been at its goal goes behind all that have not. Among the others the one with the longest way
//! goes first, so that the last to arrive arrives early; and whoever goes the same way through the same narrow places
//! goes with it, in its *convoy*: it takes over the leader's rank, and keeps it until it has arrived. So a corridor
//! is used in one direction by many before it is used in the other, and a vehicle in the middle of it is not sent
//! back because the one ahead of it has arrived.
//!
//! Standings that never changed could let all wait for ever: the first for one in its way, and that one for another,
//! which goes before it and has time. So a vehicle that has waited for long is lent another for a while; see
//! [`Traveller`](super::Traveller).

use std::cmp::Reverse;

/// A vehicle's rank by itself: its way at the beginning in steps, the longest first, then its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Rank {
    /// Steps of the shortest way when it set out.
    pub way: Reverse<u16>,
    /// The vehicle's number, which no other has.
    pub number: u32,
}

/// The standing that decides who plans around whom. The lesser goes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Standing {
    pub arrived: bool,
    /// The rank of its convoy's leader.
    pub convoy: Rank,
    /// Steps of its shortest way when it set out: within a convoy the one that began further ahead goes first.
    pub left: u16,
    pub own: Rank,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standing(arrived: bool, leader: u32, left: u16, number: u32) -> Standing {
        let rank = |number| Rank { way: Reverse(100 - number as u16), number };
        Standing { arrived, convoy: rank(leader), left, own: rank(number) }
    }

    #[test]
    fn the_longest_way_goes_first_and_takes_its_convoy_along() {
        let mut all = [
            standing(false, 5, 4, 5),
            standing(false, 1, 60, 1),
            standing(true, 0, 0, 0),
            standing(false, 1, 50, 9),
        ];
        all.sort();
        assert_eq!(all.map(|one| one.own.number), [9, 1, 5, 0]);
    }
}
