//! The states that a search has seen.

use super::rows::{Rows, hash};

/// Every state seen, numbered in the order of discovery, each once.
///
/// Found by a hash; equality is of the whole row.
#[derive(Clone, Debug)]
pub(super) struct Store {
    states: Rows,
    /// The move by which each state was first reached.
    arrivals: Vec<Arrival>,
    /// Open addressing: the hash in the upper half, the state's number plus one in the lower; 0 is free.
    table: Vec<u64>,
}

/// The move by which a state was first reached; the first state has none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Arrival {
    pub(super) from: u32,
    pub(super) label: u32,
}

/// The state in which every run begins.
pub(super) const START: u32 = 0;
/// Most states that can be numbered.
pub(super) const MOST_STATES: usize = u32::MAX as usize - 1;
const SMALLEST_TABLE: usize = 1 << 10;

impl Store {
    pub(super) fn new() -> Self {
        Self { states: Rows::default(), arrivals: Vec::new(), table: vec![0; SMALLEST_TABLE] }
    }

    pub(super) fn len(&self) -> usize {
        self.states.len()
    }

    pub(super) fn state(&self, number: u32) -> &[u32] {
        self.states.get(number as usize)
    }

    /// The number of a state, if it has been seen.
    pub(super) fn find(&self, state: &[u32]) -> Option<u32> {
        self.look_up(state, hash(state)).ok()
    }

    /// Takes in a state, of this hash, reached by a move. Gives its number if it is new.
    pub(super) fn insert(&mut self, state: &[u32], hash: u32, arrival: Arrival) -> Option<u32> {
        let free = self.look_up(state, hash).err()?;
        let number = u32::try_from(self.len()).ok()?;
        if let Some(place) = self.table.get_mut(free) {
            *place = u64::from(hash) << 32 | u64::from(number + 1);
        }
        self.states.words.extend_from_slice(state);
        self.states.close();
        self.arrivals.push(arrival);
        if self.len() * 8 > self.table.len() * 5 {
            self.grow();
        }
        Some(number)
    }

    /// The moves by which a state was first reached from the start, in order: labels.
    pub(super) fn path(&self, number: u32) -> Vec<u32> {
        let mut labels = Vec::new();
        let mut at = number;
        while at != START
            && let Some(arrival) = self.arrivals.get(at as usize)
        {
            labels.push(arrival.label);
            at = arrival.from;
        }
        labels.reverse();
        labels
    }

    /// The state's number, or the free place in the table where it belongs.
    fn look_up(&self, state: &[u32], hash: u32) -> Result<u32, usize> {
        let mask = self.table.len() - 1;
        let mut at = self.home(hash);
        loop {
            match self.table.get(at).copied().unwrap_or(0) {
                0 => return Err(at),
                found if (found >> 32) as u32 == hash => {
                    let number = (found as u32).wrapping_sub(1);
                    if self.state(number) == state {
                        return Ok(number);
                    }
                }
                _ => {}
            }
            at = (at + 1) & mask;
        }
    }

    /// The place at which the search for a hash begins.
    fn home(&self, hash: u32) -> usize {
        ((u64::from(hash) * self.table.len() as u64) >> 32) as usize
    }

    fn grow(&mut self) {
        let larger = vec![0; self.table.len() * 2];
        let mask = larger.len() - 1;
        for found in std::mem::replace(&mut self.table, larger) {
            if found == 0 {
                continue;
            }
            let mut at = self.home((found >> 32) as u32);
            while self.table.get(at).is_some_and(|place| *place != 0) {
                at = (at + 1) & mask;
            }
            if let Some(place) = self.table.get_mut(at) {
                *place = found;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_is_numbered_once_and_found_again() {
        let mut store = Store::new();
        let arrival = Arrival { from: START, label: 0 };
        let row = |n: u32| [n % 7, n / 7, 3, n % 3];
        for n in 0..20_000 {
            assert_eq!(store.insert(&row(n), hash(&row(n)), arrival), Some(n));
            assert_eq!(store.insert(&row(n), hash(&row(n)), arrival), None);
        }
        for n in 0..20_000 {
            assert_eq!(store.find(&row(n)), Some(n));
            assert_eq!(store.state(n), row(n));
        }
        assert_eq!(store.find(&[0, 0, 3]), None);
    }

    #[test]
    fn rows_of_one_hash_are_told_apart() {
        let mut store = Store::new();
        let arrival = Arrival { from: START, label: 0 };
        let mut seen = std::collections::HashMap::new();
        let twins = (0..400_000_u32).find_map(|n| seen.insert(hash(&[n, 5]), n).map(|twin| (n, twin)));
        let (one, other) = twins.unwrap();
        assert!(store.insert(&[one, 5], hash(&[one, 5]), arrival).is_some());
        assert!(store.insert(&[other, 5], hash(&[one, 5]), arrival).is_some());
        assert_ne!(store.find(&[one, 5]), store.find(&[other, 5]));
    }
}
