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
/// Nodes of the fleet.
const MEMBERS: usize = 5;
/// Ticks of 20 ms.
const TICKS_PER_SECOND: usize = 50;
/// Sets looked at in a tick while one member's messages are taken in. What is read in a tick has some 4000 sets, each of
/// which is looked at some twenty times, and up to 16 times as often where it is compared with what is kept.
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

/// The most refusals of one record: one of each bid that is not honoured, two of each that is, and one for each event
/// that is asked for; and one of each block of a former life.
const REFUSALS: usize =
    Bound::RecordBids.stated() + 2 * Bound::HonouredBids.stated() + Bound::RecordRequests.stated();

/// What one node has counted of the member.
#[derive(Debug, Default)]
pub struct Cost {
    before: SenderStats,
    at: Duration,
    incarnation: Option<u64>,
    bytes: Used,
    facts: Used,
    lives: Used,
}

/// What is used of an allowance that comes back with time. So a member that spares is given no more than one that does
/// not.
#[derive(Debug, Default)]
pub struct Used(f64);

impl Used {
    /// So many more are used, after a time in which `per_second` have come back; gives what is used now.
    pub fn add(&mut self, more: u64, per_second: usize, passed: Duration) -> u64 {
        self.0 = (self.0 - per_second as f64 * passed.as_secs_f64()).max(0.0) + more as f64;
        // Sums of fractions are a little more than they should be.
        (self.0 - 1e-6).ceil() as u64
    }
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
        // Those whom nobody knows are counted together.
        let known = node.node().member(member);
        let (_, stats) = node.senders().find(|(name, _)| *name == known).unwrap_or_default();
        let passed = now - std::mem::replace(&mut self.at, now);
        let since = |of: fn(&SenderStats) -> u64| of(&stats) - of(&self.before);
        let (messages, bytes) = (since(|stats| stats.messages), since(|stats| stats.bytes));
        let taken = bytes + messages * PER_MESSAGE as u64;
        let ahead = self.bytes.add(taken, Bound::TickBytes.stated() * TICKS_PER_SECOND, passed);
        let told = since(|stats| stats.caused.facts_told);
        let told = self.facts.add(told, Bound::FactsPerSecond.stated(), passed);
        let program = node.node().program();
        let own = |name: &str| name.split_once('#').is_some_and(|(node, _)| node == member.as_str());
        let proxies = || program.proxies().filter(|(name, _)| own(name));
        let incarnation =
            node.node().peers().find(|(name, _)| *name == member).and_then(|(_, peer)| peer.incarnation);
        let is_new = std::mem::replace(&mut self.incarnation, incarnation) != incarnation;
        let lives = self.lives.add(u64::from(is_new), Bound::LivesPerSecond.stated(), passed);
        let facts = |name: &str, key: &str, is_meant: &dyn Fn(&str) -> bool| {
            let is_one =
                |one: &&&Happened| one.event.kind() == name && one.event.text(key).is_some_and(is_meant);
            happened.iter().filter(is_one).count() as u64
        };
        let stalls = stalls_of_one_event(happened, &own);
        let counts = [
            ("messages_per_tick", messages, Bound::TickBytes.stated() / PER_MESSAGE + 1),
            ("bytes_per_tick", bytes, Bound::TickBytes.stated() + LONGEST),
            ("bytes_ahead", ahead, Bound::TickBytes.stated() + LONGEST + PER_MESSAGE),
            ("waiting_messages", stats.waiting as u64, Bound::WaitingMessages.stated()),
            ("waiting_bytes", stats.waiting_bytes as u64, Bound::WaitingBytes.stated()),
            ("facts", told, Bound::FactsAtOnce.stated()),
            (
                "denials_per_message",
                per(facts("denied", "node", &|node| node == member.as_str()), messages),
                1,
            ),
            ("stalls_of_one_event", stalls, Bound::StallsNoted.stated()),
            ("lives", lives, Bound::LivesPerSecond.stated()),
            ("entries", stats.caused.entries as u64, 3 * Bound::HonouredBids.stated() + REFUSALS),
            ("entry_bytes", stats.caused.entry_bytes as u64, 4 * Bound::BidBytes.stated() * 4),
            ("pending", stats.caused.pending as u64, Bound::PendingOccurrences.stated()),
            (
                "pending_bytes",
                stats.caused.pending_bytes as u64,
                Bound::PendingBytes.stated() + Bound::OccurrenceBytes.stated(),
            ),
            ("honoured_bids", proxies().count() as u64, Bound::HonouredBids.stated()),
            (
                "requests_of_one_bid",
                proxies().map(|(_, bid)| bid.requests().len()).max().unwrap_or(0) as u64,
                Bound::BidRequests.stated(),
            ),
            (
                "block_nodes",
                proxies().map(|(_, bid)| bid.blocks().extent().nodes).max().unwrap_or(0) as u64,
                Bound::SetNodes.stated(),
            ),
            (
                "waiting_senders",
                node.mailbox().senders() as u64,
                Bound::WaitingSenders.stated() + MEMBERS + 1,
            ),
            ("waiting_in_all", node.mailbox().bytes() as u64, Bound::WaitingInAll.stated()),
            (
                "history_bytes",
                node.node().history_bytes() as u64,
                Bound::HistoryBytes.stated() + Bound::EventBytes.stated(),
            ),
            ("ended_names", program.ended_names() as u64, Bound::EndedNames.stated()),
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
