//! A node as the home of its events: the bids of others that stand here, and what has occurred here.

pub(crate) mod authority;
mod bidder;
mod rights;
mod stalls;
mod standing;
pub(crate) mod table;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use skein_bp::{Bid, Bound, EventSet, Program};

use crate::board::shorten_to;
use crate::clock::Clock;
use crate::config::NodeConfig;
use crate::facts::{Denied, PeerLost, Stalled, Unstalled};
use crate::history::History;
use crate::home::rights::Rights;
use crate::home::stalls::{StallNews, Stalls};
use crate::home::table::{BidTable, Past, TakenIn};
use crate::joint::roster::Roster;
use crate::kept::KeptBlock;
use crate::message::{BidAck, BidRecord};
use crate::name::NodeName;
use crate::run::Run;

/// Bytes of the names of b-threads that are told when a node is lost.
const MOST_NAMES: usize = 4 << 10;
/// The proxy that keeps `guarded` events back after a start.
const RESTART_GUARD: &str = "restart guard";

#[derive(Clone, Debug)]
pub(crate) struct Home {
    /// The events that are selected here and told to others.
    pub(crate) events: EventSet,
    /// The bids of others for them.
    pub(crate) table: BidTable,
    /// The occurrences here, but for joint decisions.
    pub(crate) history: History,
    stalls: Stalls,
    /// Whether `guarded` events are kept back since the start.
    pub(crate) guarding: bool,
}

impl Home {
    /// A home with the blocks that a former life has kept, which are put on the program's board.
    pub(crate) fn new(config: &NodeConfig, kept: Vec<KeptBlock>, run: &mut Run) -> Self {
        let guarding = !config.guarded.is_none();
        if guarding {
            run.program.put_proxy(RESTART_GUARD, &Bid::new().block(config.guarded.clone()));
        }
        let kept = kept.into_iter().filter(|block| config.roster.contains(&block.node)).collect();
        let (table, proxies) = BidTable::new(config.incarnation, Rights::new(config), kept);
        run.change_proxies(proxies);
        let (history, stalls) = (History::new(config.history), Stalls::default());
        Self { events: EventSet::None, table, history, stalls, guarding }
    }

    /// Decides from now on about the node's own events, and about joint ones if it is the coordinator.
    pub(crate) fn decide(&mut self, node: &NodeName, with_joint_events: bool, program: &mut Program) {
        let own = EventSet::prefix(format!("{node}/"));
        self.events = if with_joint_events { own.or(Roster::joint_events()) } else { own };
        program.set_home(self.events.clone().or(homeless()));
        self.table.set_home(self.events.clone());
    }

    /// Takes in a record of a peer in its present life, and gives the answer, if there is one.
    pub(crate) fn take_in(
        &mut self,
        now: Duration,
        record: &BidRecord,
        (term, decisions): (u64, Option<&History>),
        config: &NodeConfig,
        run: &mut Run,
    ) -> Option<BidAck> {
        let past = Past { history: &self.history, term, decisions };
        let TakenIn { proxies, denied } = self.table.take_in(now, record, &past)?;
        run.change_proxies(proxies);
        for refusal in denied.iter().take(Bound::RecordDenials.most()) {
            let (node, bthread) = (record.node.clone(), refusal.bthread.as_str().into());
            let more = (denied.len() > 1).then(|| denied.len() as u64 - 1);
            run.fact_because_of(&record.node, Denied { node, bthread, reason: refusal.reason, more });
        }
        Some(BidAck {
            home: config.name.clone(),
            home_incarnation: config.incarnation,
            node: record.node.clone(),
            incarnation: record.incarnation,
            epoch: record.epoch,
            sent_at: record.sent_at,
            latest_seq: self.history.latest_seq(),
            refused: self.table.refused(&record.node).to_vec(),
        })
    }

    /// Tells that a node is lost, and which of its blocks here end or stay.
    pub(crate) fn tell_loss(&self, node: &NodeName, run: &mut Run) {
        let names = |bthreads: BTreeSet<String>| {
            let mut names = bthreads.into_iter().collect::<Vec<_>>().join(" ");
            shorten_to(&mut names, MOST_NAMES);
            names
        };
        let (released, held) = (names(self.table.released_by(node)), names(self.table.held_for(node)));
        let held = (!held.is_empty()).then(|| held.into());
        run.fact(PeerLost { node: node.clone(), released: released.into(), held });
    }

    /// Lets `guarded` events happen once every peer's blocks are known, or the longest lease has passed since the
    /// start.
    pub(crate) fn open_guard(&mut self, clock: &Clock, config: &NodeConfig, run: &mut Run) {
        if self.guarding
            && (clock.now() >= guard_ends(clock, config)
                || config.roster.iter().all(|member| self.table.knows(member)))
        {
            self.guarding = false;
            run.change_proxies(vec![(RESTART_GUARD.into(), None)]);
        }
    }

    /// Tells which requests are stalled by remote blocks, and which are so no more.
    pub(crate) fn check_stalls(&mut self, run: &mut Run) {
        if !std::mem::take(&mut run.bids_changed) {
            return;
        }
        let mut stalled: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        if self.table.has_blocks() {
            let own = run.program.bids().flat_map(|(_, bid, _)| bid.requests());
            let own = own.filter(|event| self.events.contains(event));
            for event in own.chain(self.table.open_requests()) {
                for by in self.table.blockers_of(event) {
                    stalled.entry(event.name().into()).or_default().insert(by);
                }
            }
        }
        for news in self.stalls.update(stalled) {
            match news {
                StallNews::Stalled { event, by } => {
                    let stalled = Stalled { event: event.into(), by: by.as_str().into() };
                    match self.table.party_name(&by) {
                        Some(node) => run.fact_because_of(node, stalled),
                        None => run.fact(stalled),
                    }
                }
                StallNews::Unstalled { event } => run.fact(Unstalled { event: event.into() }),
            }
        }
    }

    /// When a lease or the guard after a start ends.
    pub(crate) fn next_deadline(&self, clock: &Clock, config: &NodeConfig) -> Option<Duration> {
        let guard = self.guarding.then(|| guard_ends(clock, config));
        guard.into_iter().chain(self.table.next_deadline()).min()
    }
}

fn guard_ends(clock: &Clock, config: &NodeConfig) -> Duration {
    clock.start() + config.longest_lease
}

/// Events that are selected wherever they are requested, and do not travel.
fn homeless() -> EventSet {
    EventSet::from("*").or(EventSet::from("*/*").and(!Roster::joint_events()))
}
