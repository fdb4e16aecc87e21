//! The counted cost of one member at each of the others, held against what is stated.

use std::collections::BTreeMap;
use std::time::Duration;

use skein_bp::Bound;
use skein_dbp::{Happened, NodeName};
use skein_wire::{NodeLink, SenderStats};

/// The longest message of all kinds, bytes.
const LONGEST: usize = Bound::SceneBytes.stated();
/// Each message costs as much as so many bytes, at least.
const PER_MESSAGE: usize = 512;
/// Sets looked at in a tick while one member's messages are taken in. What is read in a tick has some 4000 sets, each of
/// which is looked at some twenty times; one comparison takes 16384.
#[cfg(feature = "mutants")]
const SETS_PER_TICK: usize = 1 << 17;

/// The most that was counted of something, and the most that is stated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Counted {
    pub most: u64,
    pub stated: u64,
}

/// The worst of each count, by its name.
pub type Worst = BTreeMap<&'static str, Counted>;

/// What one node has counted of the member.
#[derive(Debug, Default)]
pub struct Cost {
    before: SenderStats,
    incarnation: Option<u64>,
    lives: u64,
}

impl Cost {
    /// Looks at a node after a tick, at which these things happened at it; gives the counts that are beyond what is
    /// stated.
    pub fn look(
        &mut self,
        now: Duration,
        node: &NodeLink,
        member: &NodeName,
        happened: &[&Happened],
        worst: &mut Worst,
    ) -> Vec<(&'static str, Counted)> {
        let (_, stats) = node.senders().find(|(name, _)| *name == Some(member)).unwrap_or_default();
        let (ticks, seconds) = (now.as_millis() as usize / 20, now.as_secs_f64().ceil() as usize);
        let since = |of: fn(&SenderStats) -> u64| of(&stats) - of(&self.before);
        let ahead = stats.bytes.saturating_sub((Bound::TickBytes.stated() * ticks) as u64);
        let at_rate = |at_once: Bound, per_second: Bound| at_once.stated() + per_second.stated() * seconds;
        let program = node.node().program();
        let own = |name: &str| name.split_once('#').is_some_and(|(node, _)| node == member.as_str());
        let proxies = || program.proxies().filter(|(name, _)| own(name));
        let incarnation =
            node.node().peers().find(|(name, _)| *name == member).and_then(|(_, peer)| peer.incarnation);
        if incarnation != self.incarnation {
            (self.incarnation, self.lives) = (incarnation, self.lives + 1);
        }
        let facts = |name: &str, key: &str, is_meant: &dyn Fn(&str) -> bool| {
            let is_one =
                |one: &&&Happened| one.event.kind() == name && one.event.text(key).is_some_and(is_meant);
            happened.iter().filter(is_one).count() as u64
        };
        let stalls = stalls_of_one_event(happened, &own);
        let entries =
            Bound::HonouredBids.stated() * 3 + Bound::ListItems.stated() + Bound::PendingOccurrences.stated();
        let counts = [
            ("messages_per_tick", since(|stats| stats.messages), Bound::TickBytes.stated() / PER_MESSAGE + 1),
            ("bytes_per_tick", since(|stats| stats.bytes), Bound::TickBytes.stated() + LONGEST),
            ("bytes_ahead", ahead, Bound::TickBytes.stated() + LONGEST),
            ("waiting_messages", stats.waiting as u64, Bound::WaitingMessages.stated()),
            ("waiting_bytes", stats.waiting_bytes as u64, Bound::WaitingBytes.stated()),
            ("facts", stats.caused.facts_told, at_rate(Bound::FactsAtOnce, Bound::FactsPerSecond)),
            (
                "denials_per_message",
                per(facts("denied", "node", &|node| node == member.as_str()), since(|stats| stats.messages)),
                1,
            ),
            ("stalls_of_one_event", stalls, Bound::StallsNoted.stated()),
            ("lives", self.lives, at_rate(Bound::LivesPerSecond, Bound::LivesPerSecond)),
            ("entries", stats.caused.entries as u64, entries),
            (
                "entry_bytes",
                stats.caused.entry_bytes as u64,
                4 * Bound::BidBytes.stated() * 4 + 2 * Bound::PendingBytes.stated(),
            ),
            ("honoured_bids", proxies().count() as u64, Bound::HonouredBids.stated()),
            (
                "requests_of_one_bid",
                proxies().map(|(_, bid)| bid.requests().len()).max().unwrap_or(0) as u64,
                Bound::BidRequests.stated(),
            ),
            #[cfg(feature = "mutants")]
            ("sets_per_tick", since(|stats| stats.nodes), SETS_PER_TICK),
        ];
        self.before = stats;
        counts.into_iter().filter_map(|(name, most, stated)| note(worst, name, most, stated)).collect()
    }
}

/// Notes a count; gives it back if it is beyond what is stated.
pub fn note(
    worst: &mut Worst,
    name: &'static str,
    most: u64,
    stated: usize,
) -> Option<(&'static str, Counted)> {
    let counted = Counted { most, stated: stated as u64 };
    let before = worst.entry(name).or_insert(counted);
    // What is stated grows with time: the one that was nearest to it is kept.
    if u128::from(most) * u128::from(before.stated.max(1))
        > u128::from(before.most) * u128::from(counted.stated.max(1))
    {
        *before = counted;
    }
    (most > counted.stated).then_some((name, counted))
}

fn per(count: u64, of: u64) -> u64 {
    count.div_ceil(of.max(1))
}

fn stalls_of_one_event(happened: &[&Happened], own: &dyn Fn(&str) -> bool) -> u64 {
    let mut of_event: BTreeMap<&str, u64> = BTreeMap::new();
    for one in happened.iter().filter(|one| one.event.kind() == "stalled") {
        if let (Some(event), Some(by)) = (one.event.text("event"), one.event.text("by"))
            && own(by)
        {
            *of_event.entry(event).or_default() += 1;
        }
    }
    of_event.into_values().max().unwrap_or(0)
}
