//! What one who sees every node, every message that arrives, and the true time knows.

use std::collections::BTreeMap;
use std::time::Duration;

use skein_bp::catalogue::Declared as _;
use skein_bp::{Bid, Event, EventSet, Program};
use skein_dbp::{BidRecord, ChannelMove, Happened, Lift, NewRoster, NodeName, OnLoss, Roster, facts};

use crate::story::{Cast, Grants, Story};

/// One step of one node, as it is seen from outside.
pub(crate) struct Step<'a> {
    /// The true time.
    pub(crate) at: Duration,
    /// What the node's clock shows.
    pub(crate) clock: Duration,
    pub(crate) node: usize,
    /// What was handed to it from outside before it.
    pub(crate) enqueued: &'a [Event],
    /// The bids that came in with it.
    pub(crate) received: &'a [BidRecord],
    /// What its b-threads saw happen.
    pub(crate) happened: &'a [Happened],
    /// What the channel changed on its board.
    pub(crate) moves: &'a [ChannelMove],
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
    /// The blocks that it has to keep whatever becomes of their holders: by holder and b-thread.
    pub(crate) kept: BTreeMap<(usize, String), Keeping>,
    /// Those that were lifted: at which life and synchronisation point of the holder.
    lifted: BTreeMap<(usize, String), (u64, u64)>,
    /// Who decides on joint events, as this node was told last, and as it was told before its last step.
    pub(crate) roster: Option<Roster>,
    pub(crate) former_roster: Option<Roster>,
    /// The rosters that it had one after another in its last step.
    pub(crate) rosters: Vec<Roster>,
}

/// A block that is to outlive its holder.
pub(crate) struct Keeping {
    /// The holder's life in which it was stated, and at which synchronisation point.
    pub(crate) incarnation: u64,
    pub(crate) sync: u64,
    pub(crate) set: EventSet,
}

/// One life of a node.
pub(crate) struct Life {
    /// When it began, true time.
    pub(crate) began: Duration,
    /// When it made its first step, true time: later, if the process was started and then stood still.
    pub(crate) ran: Option<Duration>,
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
        let members: Vec<Member> =
            story.casts.iter().map(|cast| Member::new(cast, story.first_roster())).collect();
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

    /// The node whose events these are, as `node` was told last.
    pub(crate) fn home_of(&self, event: &Event, node: usize) -> Option<usize> {
        if Roster::joint_events().contains(event) {
            return self.number(self.member(node).roster.as_ref()?.coordinator.as_str());
        }
        self.number(event.home())
    }

    /// What a b-thread of `node` stated in its life `incarnation` at a synchronisation point.
    pub(crate) fn stated(&self, node: usize, incarnation: u64, bthread: &str, sync: u64) -> Option<&Bid> {
        self.stated.get(&(node, incarnation, bthread.to_owned(), sync))
    }

    /// A node begins a life.
    pub(crate) fn starts(&mut self, node: usize, at: Duration) {
        let member = &mut self.members[node];
        member.lives.push(Life {
            began: at,
            ran: None,
            began_clock: None,
            over: false,
            occurred: Vec::new(),
        });
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
        for record in step.received {
            if let Some(bidder) = self.number(record.node.as_str()) {
                self.members[step.node].hears(bidder, record, step.clock);
            }
        }
        let numbers = &self.numbers;
        let member = &mut self.members[step.node];
        member.former_roster = member.roster.clone();
        member.rosters = member.roster.iter().cloned().collect();
        for happened in step.happened {
            if happened.home == member.name {
                member.does(happened, |name| numbers.get(name).copied());
            }
        }
        if let Some(life) = member.lives.last_mut() {
            life.ran.get_or_insert(step.at);
            life.began_clock.get_or_insert(step.clock);
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
                        self.stated.insert((step.node, incarnation, bthread.to_owned(), sync), bid.clone());
                    }
                    (bthread.to_owned(), Stated { sync, bid: bid.clone(), since: step.at })
                }
            };
            member.bids.insert(stated.0, stated.1);
        }
    }
}

impl Member {
    fn new(cast: &Cast, roster: Option<Roster>) -> Self {
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
            kept: BTreeMap::new(),
            lifted: BTreeMap::new(),
            former_roster: roster.clone(),
            rosters: Vec::new(),
            roster,
        }
    }

    /// A record has come. One that this home does not listen to changes nothing: it is older than what is known, of a
    /// former term, or its sender has missed too much.
    fn hears(&mut self, bidder: usize, record: &BidRecord, clock: Duration) {
        let number = |record: &BidRecord| (record.incarnation, record.epoch, record.sent_at);
        let newer = self.table.get(&bidder).is_none_or(|heard| number(record) > number(&heard.record));
        let term = self.roster.as_ref().map_or(0, |roster| roster.term);
        let occurred = self.present().map_or(0, |life| life.occurred.len() as u64);
        let forgotten = occurred.saturating_sub(self.cast.history as u64);
        let missed_too_much =
            record.home_incarnation == Some(self.incarnation()) && record.applied < forgotten;
        if !newer || (1..term).contains(&record.term) || missed_too_much {
            return;
        }
        self.table.insert(bidder, Heard { record: record.clone(), clock });
        let states = |bthread: &str| {
            record.bids.iter().any(|bid| bid.bthread == bthread && bid.on_loss == OnLoss::Hold)
        };
        self.kept.retain(|(holder, bthread), kept| {
            *holder != bidder || kept.incarnation != record.incarnation || states(bthread)
        });
        for bid in record.bids.iter().filter(|bid| bid.on_loss == OnLoss::Hold && !bid.block.is_none()) {
            let key = (bidder, bid.bthread.clone());
            let stay = (record.incarnation, bid.sync);
            let known = self.kept.get(&key).is_some_and(|kept| (kept.incarnation, kept.sync) == stay);
            // What was lifted stays so while its holder moves on with it.
            let begun = (record.incarnation, bid.block_since);
            let lifted = self.lifted.get(&key).is_some_and(|lifted| *lifted >= begun);
            if !known && !lifted && self.may_block(record.node.as_str(), &bid.block) {
                let (incarnation, sync) = stay;
                let set = bid.block.clone();
                self.kept.insert(key, Keeping { incarnation, sync, set });
            }
        }
    }

    /// Something has happened that is its own: what that means for it.
    fn does(&mut self, happened: &Happened, number: impl Fn(&str) -> Option<usize>) {
        let event = &happened.event;
        if happened.seq > 0
            && happened.term == 0
            && let Some(life) = self.lives.last_mut()
        {
            life.occurred.push(event.clone());
        }
        if event.kind() == NewRoster::NAME
            && let Ok(roster) = Roster::ordered(event)
            && self.roster.as_ref().is_none_or(|known| roster.term > known.term)
        {
            self.rosters.push(roster.clone());
            self.roster = Some(roster);
        }
        if let Some(lift) = Lift::read(event)
            && let Some(holder) = number(lift.node.as_str())
        {
            let key = (holder, lift.bthread.to_string());
            if let Some(kept) = self.kept.remove(&key) {
                self.lifted.insert(key, (kept.incarnation, kept.sync));
            }
        }
    }

    /// Whether an authority has lifted this block here.
    pub(crate) fn has_lifted(&self, holder: usize, bthread: &str, stay: (u64, u64)) -> bool {
        self.lifted.get(&(holder, bthread.to_owned())).is_some_and(|lifted| *lifted >= stay)
    }

    /// Whether this home lets `node` request `event`, safety aside.
    pub(crate) fn may_request(&self, node: &str, event: &Event) -> bool {
        let granted = |grants: &Grants| grants.requests.contains(&event.kind());
        self.cast.grants.as_ref().is_none_or(granted)
            || !node.starts_with("uav/")
            || Roster::joint_events().contains(event)
    }

    /// Whether this home lets `node` block a set.
    pub(crate) fn may_block(&self, node: &str, set: &EventSet) -> bool {
        let Some(grants) = self.cast.grants.as_ref().filter(|_| node.starts_with("uav/")) else {
            return true;
        };
        match set {
            EventSet::None => true,
            // A b-thread blocks with one set what it wants to block at all homes together.
            set if !set.could_match_home(self.name.as_str()) => true,
            EventSet::Named(pattern) => {
                let kind = pattern.as_str().rsplit('/').next().unwrap_or_default();
                grants.blocks.contains(&kind)
            }
            EventSet::Or(sets) => sets.iter().all(|set| self.may_block(node, set)),
            _ => false,
        }
    }

    /// Whether a block of this node concerns the events of `home`, under the roster it had before its last step and
    /// under the present one.
    pub(crate) fn concerns(&self, set: &EventSet, home: &NodeName) -> bool {
        let under = |roster: &Option<Roster>| {
            let joint = roster.as_ref().is_some_and(|roster| {
                roster.coordinator == *home && set.may_overlap(&Roster::joint_events())
            });
            let member = roster.as_ref().is_none_or(|roster| roster.members.contains(home));
            member && !set.is_none() && (set.could_match_home(home.as_str()) || joint)
        };
        *home != self.name && under(&self.former_roster) && under(&self.roster)
    }

    /// Its present life's number, from 1; 0 before the first.
    pub(crate) fn incarnation(&self) -> u64 {
        self.lives.len() as u64
    }

    /// Its life of this number.
    pub(crate) fn life(&self, incarnation: u64) -> Option<&Life> {
        self.lives.get(usize::try_from(incarnation.checked_sub(1)?).ok()?)
    }

    pub(crate) fn present(&self) -> Option<&Life> {
        self.lives.last()
    }

    /// Whether this home lets others block `event` at all.
    pub(crate) fn lets_block(&self, event: &Event) -> bool {
        let never = [&self.facts, &self.safety, &self.gateway];
        let is_order = [NewRoster::NAME, Lift::NAME].contains(&event.kind());
        self.home.contains(event) && !is_order && !never.into_iter().any(|set| set.contains(event))
    }

    /// Whether this is one of its own facts.
    pub(crate) fn is_fact(&self, happened: &Happened) -> bool {
        happened.home == self.name && self.facts.contains(&happened.event)
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
