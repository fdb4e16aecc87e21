//! The blocks that this node's b-threads hold at other homes, as far as they are sure (G3).

use std::collections::BTreeMap;
use std::time::Duration;

use crate::NodeName;

/// Every local b-thread whose block concerns other homes.
#[derive(Clone, Debug, Default)]
pub(crate) struct HeldBlocks(BTreeMap<String, HeldBlock>);

/// One b-thread's block.
#[derive(Clone, Debug)]
struct HeldBlock {
    sync: u64,
    /// The homes that it concerns.
    homes: Vec<NodeName>,
    /// Whether its holder was told that it holds everywhere.
    confirmed: bool,
}

/// What a holder is to be told.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum BlockNews {
    /// Every home keeps the block.
    Confirmed { bthread: String, sync: u64 },
    /// `home` may let go of it soon.
    Lapsed { bthread: String, sync: u64, home: NodeName },
}

impl HeldBlocks {
    /// `bthread` blocks, since its synchronisation point `sync`, something of these homes.
    pub(crate) fn state(&mut self, bthread: &str, sync: u64, homes: Vec<NodeName>) {
        if self.0.get(bthread).is_none_or(|held| held.sync != sync || held.homes != homes) {
            self.0.insert(bthread.into(), HeldBlock { sync, homes, confirmed: false });
        }
    }

    /// The synchronisation point since which `bthread` blocks something elsewhere, and the homes it concerns.
    pub(crate) fn get(&self, bthread: &str) -> Option<(u64, &[NodeName])> {
        self.0.get(bthread).map(|held| (held.sync, &*held.homes))
    }

    /// Forgets all b-threads but these, at these synchronisation points.
    pub(crate) fn retain(&mut self, stated: &BTreeMap<String, u64>) {
        self.0.retain(|bthread, held| stated.get(bthread) == Some(&held.sync));
    }

    /// What has changed, given until when each home keeps the block of a b-thread since a synchronisation point.
    pub(crate) fn check(
        &mut self,
        now: Duration,
        kept_until: impl Fn(&NodeName, &str, u64) -> Option<Duration>,
    ) -> Vec<BlockNews> {
        let mut news = Vec::new();
        for (bthread, held) in &mut self.0 {
            let unsure = held
                .homes
                .iter()
                .find(|home| kept_until(home, bthread, held.sync).is_none_or(|until| now >= until));
            let (bthread, sync) = (bthread.clone(), held.sync);
            match (held.confirmed, unsure) {
                (false, None) => news.push(BlockNews::Confirmed { bthread, sync }),
                (true, Some(home)) => news.push(BlockNews::Lapsed { bthread, sync, home: home.clone() }),
                _ => continue,
            }
            held.confirmed = !held.confirmed;
        }
        news
    }

    /// When the next confirmed block lapses if it is not renewed.
    pub(crate) fn next_deadline(
        &self,
        kept_until: impl Fn(&NodeName, &str, u64) -> Option<Duration>,
    ) -> Option<Duration> {
        let confirmed = self.0.iter().filter(|(_, held)| held.confirmed);
        confirmed
            .flat_map(|(bthread, held)| {
                held.homes.iter().filter_map(|home| kept_until(home, bthread, held.sync))
            })
            .min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn held() -> (HeldBlocks, NodeName, NodeName) {
        let (a, b) = (NodeName::new("uav/1").unwrap(), NodeName::new("uav/2").unwrap());
        let mut held = HeldBlocks::default();
        held.state("hold", 4, vec![a.clone(), b.clone()]);
        (held, a, b)
    }

    #[test]
    fn a_block_is_confirmed_once_every_home_keeps_it() {
        let (mut held, a, _) = held();
        assert!(held.check(SECOND, |home, _, _| (*home == a).then_some(2 * SECOND)).is_empty());
        let confirmed = BlockNews::Confirmed { bthread: "hold".into(), sync: 4 };
        assert_eq!(held.check(SECOND, |_, _, _| Some(2 * SECOND)), [confirmed]);
        assert!(held.check(SECOND, |_, _, _| Some(2 * SECOND)).is_empty(), "told twice");
        assert_eq!(held.next_deadline(|_, _, _| Some(2 * SECOND)), Some(2 * SECOND));
    }

    #[test]
    fn it_lapses_with_the_first_home_and_may_be_confirmed_again() {
        let (mut held, _, b) = held();
        held.check(SECOND, |_, _, _| Some(2 * SECOND));
        let kept = |home: &NodeName, _: &str, _: u64| Some(if *home == b { 2 * SECOND } else { 9 * SECOND });
        assert_eq!(
            held.check(2 * SECOND, kept),
            [BlockNews::Lapsed { bthread: "hold".into(), sync: 4, home: b.clone() }]
        );
        assert!(held.check(2 * SECOND, kept).is_empty());
        assert_eq!(held.check(2 * SECOND, |_, _, _| Some(9 * SECOND)).len(), 1);
    }

    #[test]
    fn a_new_synchronisation_point_is_a_new_block() {
        let (mut held, a, _) = held();
        held.check(SECOND, |_, _, _| Some(2 * SECOND));
        held.state("hold", 5, vec![a]);
        assert!(held.check(SECOND, |_, _, sync| (sync == 4).then_some(2 * SECOND)).is_empty());
        held.retain(&BTreeMap::new());
        assert!(held.check(SECOND, |_, _, _| Some(2 * SECOND)).is_empty());
    }
}
