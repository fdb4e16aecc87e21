//! Requests that wait because a remote b-thread blocks them: stalled, not deadlocked.

use std::collections::{BTreeMap, BTreeSet};

/// The stalled events, by name, with the proxies that block each.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stalls(pub(crate) BTreeMap<String, BTreeSet<String>>);

/// A change that is to be told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum StallNews {
    /// An event is requested and blocked by this proxy.
    Stalled { event: String, by: String },
    /// It is blocked from afar no more, or wanted no more.
    Unstalled { event: String },
}

impl Stalls {
    /// Takes note of all stalled events and their blockers, and gives what is new: the first blocker and each one
    /// that joins it, once per episode.
    pub(crate) fn update(&mut self, stalled: BTreeMap<String, BTreeSet<String>>) -> Vec<StallNews> {
        let mut news = Vec::new();
        for (event, blockers) in &stalled {
            let before = self.0.get(event);
            let joined = blockers.iter().filter(|by| before.is_none_or(|known| !known.contains(*by)));
            news.extend(joined.map(|by| StallNews::Stalled { event: event.clone(), by: by.clone() }));
        }
        let over = self.0.keys().filter(|event| !stalled.contains_key(*event));
        news.extend(over.map(|event| StallNews::Unstalled { event: event.clone() }));
        self.0 = stalled;
        news
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stalled(by: &[&str]) -> BTreeMap<String, BTreeSet<String>> {
        let by: BTreeSet<String> = by.iter().map(|by| (*by).to_owned()).collect();
        if by.is_empty() { BTreeMap::new() } else { BTreeMap::from([("uav/1/advance".to_owned(), by)]) }
    }

    #[test]
    fn each_blocker_is_told_once_per_episode() {
        let mut stalls = Stalls::default();
        let told = |by: &str| StallNews::Stalled { event: "uav/1/advance".into(), by: by.into() };
        let over = StallNews::Unstalled { event: "uav/1/advance".into() };
        assert_eq!(stalls.update(stalled(&["a"])), [told("a")]);
        assert_eq!(stalls.update(stalled(&["a"])), []);
        assert_eq!(stalls.update(stalled(&["a", "b"])), [told("b")]);
        assert_eq!(stalls.update(stalled(&["b"])), []);
        assert_eq!(stalls.update(stalled(&[])), [over]);
        assert_eq!(stalls.update(stalled(&["a"])), [told("a")]);
    }
}
