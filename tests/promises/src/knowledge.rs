//! What one who sees every node, every message that arrives, and the true time knows.

use std::collections::BTreeMap;
use std::time::Duration;

use skein_bp::{Bid, Event, EventSet, Origin, Program};
use skein_dbp::{BidRecord, Happened, NodeName, ProxyMove, facts};

use crate::story::{Cast, Story};

/// One step of one node, as it is seen from outside.
pub(crate) struct Step<'a> {
    /// The true time.
    pub(crate) at: Duration,
    /// What the node's clock shows.
    pub(crate) clock: Duration,
    /// Which node.
    pub(crate) node: usize,
    /// What was handed to it from outside before it.
    pub(crate) enqueued: &'a [Event],
    /// The bids that came in with it.
    pub(crate) received: &'a [BidRecord],
    /// What its b-threads saw happen.
    pub(crate) happened: &'a [Happened],
    /// How its proxies moved.
    pub(crate) moves: &'a [ProxyMove],
    /// Its program after the step.
    pub(crate) program: &'a Program,
}

/// Everything that has been seen.
pub(crate) struct Knowledge {
    pub(crate) members: Vec<Member>,
    pub(crate) longest_lease: Duration,
    numbers: BTreeMap<NodeName, usize>,
    /// Every bid that concerns other nodes and was ever stated: by node, life, b-thread and synchronisation point.
    stated: BTreeMap<(usize, u64, String, u64), Bid>,
}

/// One node.
pub(crate) struct Member {
    pub(crate) name: NodeName,
    pub(crate) cast: Cast,
    /// The events whose home it is.
    pub(crate) home: EventSet,
    pub(crate) facts: EventSet,
    pub(crate) safety: EventSet,
    pub(crate) gateway: EventSet,
    pub(crate) guarded: EventSet,
    pub(crate) lives: Vec<Life>,
    pub(crate) up: bool,
    pub(crate) paused: bool,
    /// What its b-threads state at the end of its last step.
    pub(crate) bids: BTreeMap<String, Stated>,
    revision: Option<u64>,
    /// The newest record of each other node that has come to it in this life.
    pub(crate) table: BTreeMap<usize, Heard>,
}

/// One life of a node.
pub(crate) struct Life {
    /// When it began, true time.
    pub(crate) began: Duration,
    /// What its clock showed at its first step.
    pub(crate) began_clock: Option<Duration>,
    pub(crate) over: bool,
    /// What has occurred in it, in order: number 1 first.
    pub(crate) occurred: Vec<Event>,
}

/// What a b-thread states.
pub(crate) struct Stated {
    pub(crate) sync: u64,
    pub(crate) bid: Bid,
    /// Since when, true time.
    pub(crate) since: Duration,
}

/// A record that has come to a home.
pub(crate) struct Heard {
    pub(crate) record: BidRecord,
    /// When, on the home's clock.
    pub(crate) clock: Duration,
}

impl Knowledge {
    pub(crate) fn new(story: &Story) -> Self {
        let members: Vec<Member> = story.casts.iter().map(Member::new).collect();
        let numbers = members.iter().enumerate().map(|(at, member)| (member.name.clone(), at)).collect();
        Self { members, numbers, longest_lease: story.longest_lease(), stated: BTreeMap::new() }
    }

    /// Which node has this name.
    pub(crate) fn number(&self, name: &str) -> Option<usize> {
        self.numbers.get(name).copied()
    }

    pub(crate) fn member(&self, node: usize) -> &Member {
        &self.members[node]
    }

    /// The node whose events these are.
    pub(crate) fn home_of(&self, event: &Event) -> Option<usize> {
        self.number(event.home())
    }

    /// What a b-thread of `node` stated in its life `incarnation` at a synchronisation point.
    pub(crate) fn stated(&self, node: usize, incarnation: u64, bthread: &str, sync: u64) -> Option<&Bid> {
        self.stated.get(&(node, incarnation, bthread.to_owned(), sync))
    }

    /// A node begins a life.
    pub(crate) fn starts(&mut self, node: usize, at: Duration) {
        let member = &mut self.members[node];
        member.lives.push(Life { began: at, began_clock: None, over: false, occurred: Vec::new() });
        member.up = true;
        member.bids.clear();
        member.revision = None;
        member.table.clear();
    }

    /// A node dies.
    pub(crate) fn dies(&mut self, node: usize) {
        let member = &mut self.members[node];
        (member.up, member.paused) = (false, false);
        if let Some(life) = member.lives.last_mut() {
            life.over = true;
        }
    }

    /// Takes note of what came in with a step and of what occurred in it, before it is judged.
    pub(crate) fn receive(&mut self, step: &Step<'_>) {
        let member = &mut self.members[step.node];
        let here = step.happened.iter().filter(|happened| happened.home == member.name && happened.seq > 0);
        if let Some(life) = member.lives.last_mut() {
            life.began_clock.get_or_insert(step.clock);
            life.occurred.extend(here.map(|happened| happened.event.clone()));
        }
        for record in step.received {
            let Some(bidder) = self.number(record.node.as_str()) else { continue };
            let heard = self.members[step.node].table.get(&bidder).map(|heard| &heard.record);
            let number = |record: &BidRecord| (record.incarnation, record.epoch, record.sent_at);
            if heard.is_none_or(|heard| number(record) > number(heard)) {
                let heard = Heard { record: record.clone(), clock: step.clock };
                self.members[step.node].table.insert(bidder, heard);
            }
        }
    }

    /// Takes note of what its b-threads state after a step that has been judged.
    pub(crate) fn conclude(&mut self, step: &Step<'_>) {
        let member = &mut self.members[step.node];
        let revision = step.program.revision();
        if member.revision.replace(revision) == Some(revision) {
            return;
        }
        let incarnation = member.incarnation();
        let mut before = std::mem::take(&mut member.bids);
        for (bthread, bid, sync) in step.program.bids() {
            let stated = match before.remove_entry(bthread) {
                Some((name, stated)) if stated.sync == sync => (name, stated),
                _ => {
                    let means_nothing_elsewhere = bid.blocks().is_none()
                        && bid.requests().iter().all(|event| member.home.contains(event));
                    if !means_nothing_elsewhere {
                        self.stated
                            .insert((step.node, incarnation, bthread.to_owned(), sync), bid.clone());
                    }
                    (bthread.to_owned(), Stated { sync, bid: bid.clone(), since: step.at })
                }
            };
            member.bids.insert(stated.0, stated.1);
        }
    }
}

impl Member {
    fn new(cast: &Cast) -> Self {
        let name = cast.name.clone();
        Self {
            home: EventSet::prefix(format!("{name}/")),
            facts: facts::all(&name),
            safety: safety(cast),
            gateway: EventSet::named(name.event_name("order")),
            guarded: guarded(cast),
            name,
            cast: cast.clone(),
            lives: Vec::new(),
            up: false,
            paused: false,
            bids: BTreeMap::new(),
            revision: None,
            table: BTreeMap::new(),
        }
    }

    /// Its present life's number, from 1; 0 before the first.
    pub(crate) fn incarnation(&self) -> u64 {
        self.lives.len() as u64
    }

    /// Its life of this number.
    pub(crate) fn life(&self, incarnation: u64) -> Option<&Life> {
        self.lives.get(usize::try_from(incarnation.checked_sub(1)?).ok()?)
    }

    /// Its present life.
    pub(crate) fn present(&self) -> Option<&Life> {
        self.lives.last()
    }

    /// Whether this home lets others block `event` at all.
    pub(crate) fn lets_block(&self, event: &Event) -> bool {
        let never = [&self.facts, &self.safety, &self.gateway];
        self.home.contains(event) && !never.into_iter().any(|set| set.contains(event))
    }

    /// Whether this is one of its own facts.
    pub(crate) fn is_fact(&self, happened: &Happened) -> bool {
        happened.home == self.name && happened.origin == Origin::Occurred
    }
}

impl Heard {
    /// Whether its lease has run out when the home's clock shows `clock`.
    pub(crate) fn has_lapsed(&self, clock: Duration) -> bool {
        clock >= self.clock + Duration::from_millis(self.record.lease_ms)
    }
}

/// The safety events of a node.
pub(crate) fn safety(cast: &Cast) -> EventSet {
    EventSet::named(cast.name.event_name("land"))
}

/// The events that a node keeps back after a start.
pub(crate) fn guarded(cast: &Cast) -> EventSet {
    if !cast.guarded {
        return EventSet::None;
    }
    EventSet::any_of(["step", "do", "turn"].map(|what| EventSet::named(cast.name.event_name(what))))
}
