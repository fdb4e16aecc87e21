//! The blocks that this node's b-threads hold at other homes, as far as they are sure (G3).

use std::collections::BTreeMap;
use std::time::Duration;

use skein_bp::EventSet;

use crate::guest::outbox::Upheld;
use crate::message::OnLoss;
use crate::name::NodeName;

/// Every local b-thread whose block concerns other homes.
#[derive(Clone, Debug, Default)]
pub(crate) struct HeldBlocks(pub(crate) BTreeMap<String, HeldBlock>);

/// One b-thread's block.
#[derive(Clone, Debug)]
pub(crate) struct HeldBlock {
    pub(crate) sync: u64,
    pub(crate) block: Block,
    pub(crate) standing: Standing,
}

#[derive(Clone, Debug)]
pub(crate) struct Block {
    pub(crate) set: EventSet,
    pub(crate) on_loss: OnLoss,
    /// The homes that it concerns.
    pub(crate) homes: Vec<NodeName>,
    /// Whether its holder waits to be told that it holds, be it that no other home is concerned.
    pub(crate) is_awaited: bool,
}

/// The degree to which the holder may rely on a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Standing {
    Unsure,
    /// It was told that the block holds, and has moved on with it, or with a part of it. Of the present synchronisation
    /// point it has been told nothing yet.
    Inherited,
    /// It was told that the block holds everywhere.
    Confirmed,
}

/// News for a holder.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum BlockNews {
    /// Every home keeps the block.
    Confirmed { bthread: String, sync: u64 },
    /// `home` may let go of it soon, or does not know of it yet.
    Lapsed { bthread: String, home: NodeName },
}

impl HeldBlocks {
    /// `bthread` blocks this at its synchronisation point `sync`.
    ///
    /// While it stays there, the homes change with the roster only: one that is new has to keep the block too.
    pub(crate) fn state(&mut self, bthread: &str, sync: u64, block: Block) {
        let standing = match self.0.get(bthread) {
            Some(before) if before.sync == sync => before.standing,
            Some(before) if before.standing != Standing::Unsure && block.goes_on_from(&before.block) => {
                Standing::Inherited
            }
            _ => Standing::Unsure,
        };
        self.0.insert(bthread.into(), HeldBlock { sync, block, standing });
    }

    /// The synchronisation point at which `bthread` blocks something elsewhere, and the homes it concerns.
    pub(crate) fn get(&self, bthread: &str) -> Option<(u64, &[NodeName])> {
        self.0.get(bthread).map(|held| (held.sync, &*held.block.homes))
    }

    /// Whether `bthread` was told that its block holds, and `set` is what it blocked then, or a part of it.
    pub(crate) fn is_relied_on(&self, bthread: &str, set: &EventSet) -> bool {
        let relied_on = self.0.get(bthread).filter(|held| held.standing != Standing::Unsure);
        relied_on.is_some_and(|held| !set.is_none() && set.is_within(&held.block.set))
    }

    /// Forgets all b-threads but these, at these synchronisation points.
    pub(crate) fn retain(&mut self, stated: &BTreeMap<String, u64>) {
        self.0.retain(|bthread, held| stated.get(bthread) == Some(&held.sync));
    }

    /// The changes, given the sure hold of each home on the block of a b-thread at a synchronisation point.
    pub(crate) fn check(
        &mut self,
        now: Duration,
        upheld: impl Fn(&NodeName, &str, u64) -> Option<Upheld>,
    ) -> Vec<BlockNews> {
        let mut news = Vec::new();
        for (bthread, held) in &mut self.0 {
            let at = |home: &NodeName| upheld(home, bthread, held.sync).filter(|upheld| now < upheld.until);
            let homes = &held.block.homes;
            let unsure = homes.iter().find(|home| at(home).is_none());
            let concerns_anyone = held.block.is_awaited || !homes.is_empty();
            let acknowledged = || homes.iter().all(|home| at(home).is_some_and(|upheld| upheld.acknowledged));
            let (bthread, sync) = (bthread.clone(), held.sync);
            held.standing = match (held.standing, unsure) {
                (Standing::Confirmed | Standing::Inherited, Some(home)) => {
                    news.push(BlockNews::Lapsed { bthread, home: home.clone() });
                    Standing::Unsure
                }
                (Standing::Unsure | Standing::Inherited, None) if concerns_anyone && acknowledged() => {
                    news.push(BlockNews::Confirmed { bthread, sync });
                    Standing::Confirmed
                }
                (standing, _) => standing,
            };
        }
        news
    }

    /// When the next block that its holder relies on lapses if it is not renewed.
    pub(crate) fn next_deadline(
        &self,
        upheld: impl Fn(&NodeName, &str, u64) -> Option<Upheld>,
    ) -> Option<Duration> {
        let relied_on = self.0.iter().filter(|(_, held)| held.standing != Standing::Unsure);
        relied_on
            .flat_map(|(bthread, held)| {
                held.block.homes.iter().filter_map(|home| Some(upheld(home, bthread, held.sync)?.until))
            })
            .min()
    }
}

impl Block {
    /// Whether it is what its holder blocked before, or a part of it.
    fn goes_on_from(&self, before: &Self) -> bool {
        self.on_loss == before.on_loss && self.set.is_within(&before.set)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn homes() -> [NodeName; 2] {
        ["uav/1", "uav/2"].map(|name| NodeName::new(name).unwrap())
    }

    fn block(set: &str) -> Block {
        Block {
            set: EventSet::from(set),
            on_loss: OnLoss::Release,
            homes: homes().to_vec(),
            is_awaited: false,
        }
    }

    /// A block of both homes.
    fn held() -> HeldBlocks {
        let mut held = HeldBlocks::default();
        held.state("hold", 4, block("uav/*/step"));
        held
    }

    /// The same, after its holder was told that it is confirmed.
    fn confirmed() -> HeldBlocks {
        let mut held = held();
        assert_eq!(held.check(SECOND, |_, _, _| until(2)), [told(4)]);
        held
    }

    fn until(seconds: u32) -> Option<Upheld> {
        Some(Upheld { until: seconds * SECOND, acknowledged: true })
    }

    /// What is known of a block that the home has taken in at an earlier synchronisation point.
    fn from_before(seconds: u32) -> Option<Upheld> {
        Some(Upheld { until: seconds * SECOND, acknowledged: false })
    }

    fn told(sync: u64) -> BlockNews {
        BlockNews::Confirmed { bthread: "hold".into(), sync }
    }

    fn lapsed(home: &NodeName) -> BlockNews {
        BlockNews::Lapsed { bthread: "hold".into(), home: home.clone() }
    }

    #[test]
    fn a_block_is_confirmed_once_every_home_keeps_it() {
        let (mut held, [a, _]) = (held(), homes());
        assert!(held.check(SECOND, |home, _, _| if *home == a { until(2) } else { None }).is_empty());
        assert!(held.check(SECOND, |_, _, _| from_before(2)).is_empty());
        assert_eq!(held.check(SECOND, |_, _, _| until(2)), [told(4)]);
        assert!(held.check(SECOND, |_, _, _| until(2)).is_empty(), "told twice");
        assert_eq!(held.next_deadline(|_, _, _| until(2)), Some(2 * SECOND));
    }

    #[test]
    fn it_lapses_with_the_first_home_and_may_be_confirmed_again() {
        let (mut held, [_, b]) = (confirmed(), homes());
        let kept = |home: &NodeName, _: &str, _: u64| until(if *home == b { 2 } else { 9 });
        assert_eq!(held.check(2 * SECOND, kept), [lapsed(&b)]);
        assert!(held.check(2 * SECOND, kept).is_empty());
        assert_eq!(held.check(2 * SECOND, |_, _, _| until(9)), [told(4)]);
    }

    #[test]
    fn another_block_at_a_new_synchronisation_point_is_a_new_one() {
        let mut held = confirmed();
        held.state("hold", 5, block("uav/*/turn"));
        assert!(held.check(SECOND, |_, _, sync| (sync == 4).then(|| until(2)).flatten()).is_empty());
        held.retain(&BTreeMap::new());
        assert!(held.check(SECOND, |_, _, _| until(2)).is_empty());
    }

    #[test]
    fn who_moves_on_with_a_part_of_a_block_is_told_when_it_lapses_before_it_is_confirmed_anew() {
        let (mut held, [a, _]) = (confirmed(), homes());
        held.state("hold", 5, block("uav/1/step"));
        assert!(held.check(SECOND, |_, _, _| from_before(2)).is_empty());
        assert_eq!(held.next_deadline(|_, _, _| from_before(2)), Some(2 * SECOND));
        assert_eq!(held.clone().check(SECOND, |_, _, _| until(2)), [told(5)]);
        assert_eq!(held.check(2 * SECOND, |_, _, _| from_before(2)), [lapsed(&a)]);
    }

    #[test]
    fn a_home_that_is_concerned_from_now_on_makes_it_unsure() {
        let (mut held, [_, b]) = (confirmed(), homes());
        let new = NodeName::new("uav/3").unwrap();
        let more = Block { homes: vec![b.clone(), new.clone()], ..block("uav/*/step") };
        held.state("hold", 4, more);
        let kept = |home: &NodeName, _: &str, _: u64| if *home == b { until(2) } else { None };
        assert_eq!(held.check(SECOND, kept), [lapsed(&new)]);
        // One home fewer takes nothing away.
        let mut held = confirmed();
        held.state("hold", 4, Block { homes: vec![b.clone()], ..block("uav/*/step") });
        assert!(held.check(SECOND, kept).is_empty());
    }
}
