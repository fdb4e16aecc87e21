//! Ties: choosing among equals by the run's seed, without starving any.

use rustc_hash::FxHashMap;

use crate::event::Event;

/// Breaks ties: draws by a seeded sequence, except that an event passed over too often goes first.
#[derive(Clone, Debug)]
pub(crate) struct TieBreak {
    seed: u64,
    draws: u64,
    passed_over_limit: Option<u32>,
    /// The ties that each event has lost since it was last selected or first requested.
    passed_over: FxHashMap<Event, u32>,
}

impl TieBreak {
    pub(crate) fn new(seed: u64, passed_over_limit: Option<u32>) -> Self {
        Self { seed, draws: 0, passed_over_limit, passed_over: FxHashMap::default() }
    }

    /// The position of the winner among `tied` distinct events.
    pub(crate) fn choose(&mut self, tied: &[Event]) -> usize {
        if tied.len() < 2 && self.passed_over.is_empty() {
            return 0;
        }
        let winner = match tied.len() {
            0 | 1 => 0,
            count => self.overdue(tied).unwrap_or_else(|| self.draw(count)),
        };
        if self.passed_over_limit.is_some() {
            self.record(tied, winner);
        }
        winner
    }

    /// Forgets an event that nobody requests any more.
    pub(crate) fn forget(&mut self, event: &Event) {
        self.passed_over.remove(event);
    }

    /// Whether `event` has lost a tie and still waits.
    pub(crate) fn is_owed(&self, event: &Event) -> bool {
        !self.passed_over.is_empty() && self.passed_over.contains_key(event)
    }

    /// The event passed over most often, if that is often enough.
    fn overdue(&self, tied: &[Event]) -> Option<usize> {
        let limit = self.passed_over_limit?;
        let mut overdue: Option<(usize, u32)> = None;
        for (at, event) in tied.iter().enumerate() {
            let times = self.passed_over.get(event).copied().unwrap_or(0);
            if times >= limit && overdue.is_none_or(|(_, most)| times > most) {
                overdue = Some((at, times));
            }
        }
        overdue.map(|(at, _)| at)
    }

    fn record(&mut self, tied: &[Event], winner: usize) {
        for (at, event) in tied.iter().enumerate() {
            if at != winner {
                *self.passed_over.entry(event.clone()).or_default() += 1;
            } else if !self.passed_over.is_empty() {
                self.passed_over.remove(event);
            }
        }
    }

    /// The next number below `count`. SplitMix64, because its whole state is a counter.
    fn draw(&mut self, count: usize) -> usize {
        self.draws += 1;
        let bits = mix(mix(self.seed).wrapping_add(self.draws.wrapping_mul(GOLDEN)));
        ((u128::from(bits) * count as u128) >> 64) as usize
    }
}

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// The output function of SplitMix64 (Steele, Lea, Flood 2014).
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn events(count: usize) -> Vec<Event> {
        (0..count).map(|n| Event::new(format!("e{n}"))).collect()
    }

    #[test]
    fn draws_are_even() {
        let (mut ties, tied) = (TieBreak::new(7, None), events(3));
        let mut wins = [0_u32; 3];
        for _ in 0..3000 {
            wins[ties.choose(&tied)] += 1;
        }
        assert!(wins.iter().all(|n| (900..1100).contains(n)), "{wins:?}");
    }

    #[test]
    fn nobody_is_passed_over_more_often_than_the_limit_allows() {
        let (mut ties, tied) = (TieBreak::new(1, Some(4)), events(5));
        let mut lost = [0_u32; 5];
        for _ in 0..10_000 {
            let winner = ties.choose(&tied);
            for (at, lost) in lost.iter_mut().enumerate() {
                *lost = if at == winner { 0 } else { *lost + 1 };
                // At the worst, all others became overdue together and go first.
                assert!(*lost <= 4 + 4, "event {at} lost {lost} ties in a row");
            }
        }
    }
}
