//! G3: from `confirmed` until its withdrawal or `block_lapsed`, no event of a block occurs at any home it concerns. A
//! b-thread that moves on with the same block, or with a part of it, withdraws no more than the rest.

use skein_bp::catalogue::Declared as _;
use skein_dbp::facts::{BlockLapsed, Confirmed};
use std::collections::BTreeMap;
use std::time::Duration;

use skein_bp::{Bid, Event, EventSet, Origin, Program};

use super::{Findings, Oracle};
use crate::knowledge::{Knowledge, Member, Step};
use crate::promise::Promise;

/// Follows the blocks that their holders may rely on.
#[derive(Default)]
pub(super) struct ConfirmedBlock {
    /// By holder and b-thread.
    sure: BTreeMap<(usize, String), Sure>,
    /// When a home last received a block: by home, holder's number and life, b-thread and synchronisation point.
    received: BTreeMap<(usize, usize, u64, String, u64), Duration>,
}

/// A block that its holder was told is confirmed, at its present synchronisation point or before.
struct Sure {
    sync: u64,
    /// The first synchronisation point of which it was told, since when it blocks no less than now.
    first: u64,
    set: EventSet,
    hold: bool,
    /// The homes that it concerned.
    homes: Vec<usize>,
    since: Duration,
    /// What occurred in spite of it while its holder stood still, and could be told nothing.
    overtaken: Option<String>,
}

impl Oracle for ConfirmedBlock {
    fn starts(&mut self, node: usize, _: &Program, _: &Knowledge) {
        self.sure.retain(|(holder, _), _| *holder != node);
    }

    fn judge(&mut self, step: &Step<'_>, knowledge: &Knowledge, findings: &mut Findings) {
        self.note_received(step, knowledge);
        let me = knowledge.member(step.node);
        for happened in step.happened {
            let event = &happened.event;
            if me.is_fact(happened) {
                if let Some(confirmed) = Confirmed::read(event) {
                    self.confirm(step, &confirmed, knowledge, findings);
                } else if let Some(lapsed) = BlockLapsed::read(event) {
                    self.sure.remove(&(step.node, lapsed.bthread.to_string()));
                }
            } else if happened.home == me.name && happened.origin != Origin::Occurred {
                self.occurs(step, event, knowledge, findings);
            }
        }
        // What its b-threads have left is withdrawn.
        self.sure.retain(|(holder, bthread), sure| {
            *holder != step.node
                || step
                    .program
                    .bids()
                    .find(|(name, ..)| name == bthread)
                    .is_some_and(|(_, bid, sync)| sync == sure.sync || sure.goes_on(bid, sync))
        });
        for ((_, bthread), sure) in self.sure.iter().filter(|((holder, _), _)| *holder == step.node) {
            // A larger roster: the fact comes in the step after the order at the latest.
            let stranger = concerned(knowledge, step.node, &sure.set).find(|home| !sure.homes.contains(home));
            if let Some(home) = stranger {
                let name = &knowledge.member(home).name;
                let what = format!("{bthread} was not told that {name} has yet to hear of its block");
                findings.broken(Promise::G3, step.node, what);
            }
        }
    }

    fn ends(&mut self, at: Duration, knowledge: &Knowledge, findings: &mut Findings) {
        let settled = at.saturating_sub(4 * knowledge.longest_lease);
        for (node, member) in knowledge.members.iter().enumerate().filter(|(_, member)| member.up) {
            for (bthread, stated) in member.bids.iter().filter(|(_, stated)| stated.since < settled) {
                let set = stated.bid.blocks();
                let homes: Vec<usize> = concerned(knowledge, node, set).collect();
                let granted =
                    homes.iter().all(|home| knowledge.member(*home).may_block(member.name.as_str(), set));
                // What was lifted is not confirmed any more.
                let kept = !stated.bid.holds_when_lost();
                if !homes.is_empty() && granted && kept && !self.sure.contains_key(&(node, bthread.clone())) {
                    let what = format!("the block of {bthread} has waited in vain for its confirmation");
                    findings.broken(Promise::GoesOn, node, what);
                }
            }
        }
    }
}

impl ConfirmedBlock {
    fn note_received(&mut self, step: &Step<'_>, knowledge: &Knowledge) {
        for record in step.received {
            let Some(holder) = knowledge.number(record.node.as_str()) else { continue };
            for bid in record.bids.iter().filter(|bid| !bid.block.is_none()) {
                let key = (step.node, holder, record.incarnation, bid.bthread.clone(), bid.sync);
                self.received.insert(key, step.at);
            }
        }
    }

    fn confirm(&mut self, step: &Step<'_>, fact: &Confirmed, knowledge: &Knowledge, findings: &mut Findings) {
        let incarnation = knowledge.member(step.node).incarnation();
        let (bthread, sync) = (&*fact.bthread, fact.sync);
        let Some(bid) = knowledge.stated(step.node, incarnation, bthread, sync) else {
            findings.broken(Promise::G3, step.node, format!("{fact:?}, which was never stated"));
            return;
        };
        let homes: Vec<usize> = concerned(knowledge, step.node, bid.blocks()).collect();
        for home in &homes {
            if !knowledge.member(*home).may_block(knowledge.member(step.node).name.as_str(), bid.blocks()) {
                let name = &knowledge.member(*home).name;
                findings.broken(
                    Promise::G7,
                    step.node,
                    format!("{fact:?}, which {name} does not let it block"),
                );
            }
            let key = (*home, step.node, incarnation, bthread.to_owned(), sync);
            // One that is kept without renewal may have been heard of long ago.
            let recent = match bid.holds_when_lost() {
                true => Duration::ZERO,
                false => step.at.saturating_sub(lease_of(knowledge.member(step.node))),
            };
            if self.received.get(&key).is_none_or(|at| *at < recent) {
                let name = &knowledge.member(*home).name;
                findings.broken(Promise::G3, step.node, format!("{fact:?}, which {name} has not heard of"));
            }
        }
        let (set, hold) = (bid.blocks().clone(), bid.holds_when_lost());
        let mut sure = Sure { sync, first: sync, set, hold, homes, since: step.at, overtaken: None };
        let key = (step.node, bthread.to_owned());
        if let Some(mut before) = self.sure.remove(&key)
            && (before.sync == sync || before.goes_on(bid, sync))
        {
            (sure.first, sure.overtaken) = (before.first, before.overtaken);
        }
        self.sure.insert(key, sure);
    }

    /// An event has been selected at its home: no confirmed block of another node may hold it.
    fn occurs(&mut self, step: &Step<'_>, event: &Event, knowledge: &Knowledge, findings: &mut Findings) {
        let home = knowledge.member(step.node);
        for ((holder, bthread), sure) in &mut self.sure {
            let who = knowledge.member(*holder);
            if *holder == step.node {
                if let Some(what) = sure.overtaken.take() {
                    findings.broken(Promise::G3, step.node, format!("{event} was done here after {what}"));
                }
                continue;
            }
            let concerned = sure.homes.contains(&step.node) && who.concerns(&sure.set, &home.name);
            // Its holder is told of that with the next acknowledgement.
            let lifted = home.has_lifted(*holder, bthread, (who.incarnation(), sure.first));
            if !concerned || lifted || !sure.set.contains(event) || !home.lets_block(event) {
                continue;
            }
            // Unless guarded, a home that has restarted knows of no block before its holder has told it again.
            let forgotten = home.present().is_some_and(|life| life.began + lease_of(who) > sure.since);
            if forgotten && !home.guarded.contains(event) {
                continue;
            }
            let name = &who.name;
            let what = format!("{event} occurred while {name} was sure of the block of {bthread}");
            if who.paused || !who.up {
                sure.overtaken = Some(what);
            } else {
                findings.broken(Promise::G3, step.node, what);
            }
        }
    }
}

impl Sure {
    /// Its holder has moved on to a synchronisation point with this bid: whether the block goes on, as far as the bid
    /// still states it.
    fn goes_on(&mut self, bid: &Bid, sync: u64) -> bool {
        let blocks = !bid.blocks().is_none() && bid.blocks().is_within(&self.set);
        (self.sync, self.set) = (sync, bid.blocks().clone());
        blocks && bid.holds_when_lost() == self.hold
    }
}

/// The other homes that a block concerns, and that let its holder have it.
fn concerned<'a>(
    knowledge: &'a Knowledge,
    holder: usize,
    set: &'a EventSet,
) -> impl Iterator<Item = usize> + 'a {
    let who = knowledge.member(holder);
    let homes = knowledge.members.iter().enumerate();
    homes.filter(move |(_, home)| who.concerns(set, &home.name)).map(|(node, _)| node)
}

/// A node's lease in true time, however slow its clock.
fn lease_of(member: &Member) -> Duration {
    member.cast.lease.mul_f64(1.01)
}
