//! Deciding together, and learning what was decided (G8).

use std::collections::VecDeque;
use std::time::Duration;

use skein_bp::catalogue::Declared as _;
use skein_bp::{Bid, Event, EventSet};

use crate::facts::{InStep, OutOfStep, RosterRefused, Unknown};
use crate::joint::Joint;
use crate::node::{BoardChange, Delivery, Node};
use crate::outbox::Outbox;
use crate::rule::Lift;
use crate::{JointWord, Message, NodeName, Occurrence, Presence, ROSTER, Recipient, Repair, Roster};

/// The proxy that keeps joint events back while a member has not been heard, or has yet to apply a decision.
const JOINT_GUARD: &str = "joint guard";
/// Last chunk of the event by which an authority lifts a block that outlives its holder: data `node` and `bthread`.
pub const LIFT: &str = "lift";

impl Node {
    /// The term that this node is in; 0 without joint events.
    pub(super) fn term(&self) -> u64 {
        self.joint.as_ref().map_or(0, Joint::term)
    }

    /// Takes up the roster that the node starts with, and what a former life has decided under it.
    pub(super) fn begin_term(&mut self, roster: Option<Roster>, decisions: Vec<Event>) {
        let Some(roster) = roster else { return };
        let mut joint = Joint::new(roster, &self.config.name);
        if joint.leads() {
            let recalled: Vec<_> =
                (1..).zip(decisions).map(|(seq, event)| self.decision(joint.term(), seq, event)).collect();
            self.deliveries.extend(recalled.iter().cloned().map(Delivery::Recalled));
            joint.recall(recalled);
        }
        self.joint = Some(joint);
        self.take_up_roster();
    }

    fn decision(&self, term: u64, seq: u64, event: Event) -> Occurrence {
        Occurrence {
            home: self.config.name.clone(),
            incarnation: self.config.incarnation,
            seq,
            term,
            event,
            requests_served: Vec::new(),
            requested_by: Vec::new(),
            choice: None,
            at: self.now,
        }
    }

    /// Sets what is selected here, and may be bid for here, by the roster.
    fn take_up_roster(&mut self) {
        #[cfg(feature = "mutants")]
        if let Some(joint) = &mut self.joint {
            joint.mutant = self.config.mutant;
        }
        let own = EventSet::prefix(format!("{}/", self.config.name));
        let leads = self.joint.as_ref().is_some_and(Joint::leads);
        self.home = if leads { own.or(Roster::joint_events()) } else { own };
        self.program.set_home(self.home.clone().or(homeless()));
        let home = self.home.clone();
        self.table.rights_mut().set_home(home);
        self.guard_joint_events();
        self.seen_revision = None;
    }

    /// An operator gives this node a new roster.
    fn adopt(&mut self, order: &Event) {
        let refused = match Roster::ordered(order) {
            Err(error) => error.to_string(),
            Ok(roster) if roster.term <= self.term() => format!("term {} is over", roster.term),
            Ok(roster) => match roster.members.iter().find(|member| !self.knows(member)) {
                Some(stranger) => format!("{stranger} is not of this fleet"),
                None => {
                    let former = self.joint.replace(Joint::new(roster, &self.config.name));
                    self.unsaved = true;
                    self.presence_due = self.now;
                    self.take_up_roster();
                    return self.leave_unknown(former.as_ref());
                }
            },
        };
        self.fact(RosterRefused { why: refused.into() });
    }

    /// What was asked of the coordinator of a term that is over may have been decided there or not: it is not asked again
    /// (G4).
    fn leave_unknown(&mut self, former: Option<&Joint>) {
        let Some(former) = former.filter(|former| !former.leads()) else { return };
        let home = &former.roster.coordinator;
        let asked = self.outboxes.get(home).map(Outbox::asked).unwrap_or_default();
        for (bthread, sync) in asked {
            let bids = self.program.bids();
            let stays = bids.filter(|(name, _, now_at)| *name == bthread && *now_at == sync);
            let joint = |event: &&Event| Roster::joint_events().contains(event);
            let event = stays.flat_map(|(_, bid, _)| bid.requests()).find(joint).cloned();
            let Some(event) = event else { continue };
            let coordinator = self.joint.as_ref().map(|joint| &joint.roster.coordinator);
            match coordinator.and_then(|coordinator| self.outboxes.get_mut(coordinator)) {
                Some(outbox) => outbox.leave_unknown(&bthread, sync),
                // From now on it would be decided here.
                None => self.change_board(BoardChange::Withdrawn(bthread.as_str().into())),
            }
            self.fact(Unknown { event: event.name().into(), bthread: bthread.into(), home: home.clone() });
        }
    }

    fn knows(&self, node: &NodeName) -> bool {
        *node == self.config.name || self.outboxes.contains_key(node)
    }

    /// What an event that was selected here means for the node itself.
    pub(super) fn heed(&mut self, event: &Event) {
        let own = event.name().strip_prefix(self.config.name.as_str());
        match own.and_then(|rest| rest.strip_prefix('/')) {
            Some(ROSTER) => self.adopt(event),
            Some(LIFT) => {
                if let Some(lift) = Lift::read(event) {
                    let changes = self.table.lift(&lift.node, &lift.bthread);
                    self.change_proxies(changes);
                }
            }
            _ => {}
        }
    }

    /// Takes in what a sign of life says about joint events.
    pub(super) fn take_in_word(&mut self, presence: &Presence, word: &JointWord) {
        let (node, now) = (&presence.node, self.now);
        let Some(joint) = self.joint.as_mut().filter(|joint| joint.roster.members.contains(node)) else {
            return;
        };
        let astray = joint.hear(node, presence.up, word);
        let mut heard = VecDeque::new();
        if word.term == joint.term() && *node == joint.roster.coordinator && !joint.leads() {
            joint.stream.presence(word.decided, 1, true, &mut heard);
            if word.asks {
                self.presence_due = now;
            }
        }
        self.deliver(node, heard);
        if let Some(term) = astray {
            self.fact(OutOfStep { node: node.clone(), term });
        }
    }

    /// A decision has arrived, in order or not.
    pub(super) fn take_in_decision(&mut self, decision: Occurrence) -> bool {
        let home = decision.home.clone();
        let expected = |joint: &&mut Joint| {
            !joint.leads() && joint.term() == decision.term && joint.roster.coordinator == home
        };
        let Some(joint) = self.joint.as_mut().filter(expected) else { return false };
        let mut heard = VecDeque::new();
        joint.stream.occurrence(decision, &mut heard);
        self.deliver(&home, heard);
        // The coordinator decides nothing more before it has heard of this.
        self.presence_due = self.now;
        true
    }

    /// Whether joint events are kept back although somebody requests one.
    pub(super) fn wants_to_decide(&self) -> bool {
        let is_joint = |event: &Event| Roster::joint_events().contains(event);
        let asked = |bid: &Bid| bid.requests().iter().any(is_joint);
        self.guards_joint
            && (self.program.bids().any(|(_, bid, _)| asked(bid))
                || self.program.proxies().any(|(_, bid)| asked(bid)))
    }

    /// Keeps joint events back, or lets them happen, as the members' last words allow.
    pub(super) fn guard_joint_events(&mut self) {
        let Some(joint) = self.joint.as_ref().filter(|joint| joint.leads()) else {
            if std::mem::take(&mut self.guards_joint) {
                self.change_proxies(vec![(JOINT_GUARD.into(), None)]);
            }
            return;
        };
        let guards = !joint.may_decide(self.up(), self.freshness());
        if std::mem::replace(&mut self.guards_joint, guards) == guards {
            return;
        }
        let block = guards.then(|| Bid::new().block(Roster::joint_events()));
        self.change_proxies(vec![(JOINT_GUARD.into(), block)]);
    }

    /// When joint events must be kept back again, if nobody is heard until then.
    pub(super) fn guard_due(&self) -> Option<Duration> {
        let joint = self.joint.as_ref().filter(|joint| joint.leads() && !self.guards_joint)?;
        Some(self.started.unwrap_or(self.now) + joint.may_decide_until(self.freshness())?)
    }

    /// How old an acknowledgement may be on which a joint event is decided.
    fn freshness(&self) -> Duration {
        self.config.lease
    }

    /// Asks the coordinator at once for the decisions that this node has not heard.
    pub(super) fn ask_for_decisions(&mut self) {
        let Some(joint) = self.joint.as_mut().filter(|joint| !joint.leads()) else { return };
        let Some((term, holes)) = joint.stream.repair(self.now, self.config.lease / 10) else { return };
        let home = joint.roster.coordinator.clone();
        let Some(incarnation) = self.peers.incarnation(&home) else { return };
        for (from_seq, to_seq) in holes {
            let requester = self.config.name.clone();
            let repair = Repair { home: home.clone(), incarnation, from_seq, to_seq, term, requester };
            self.outgoing.push((Recipient::Node(home.clone()), Message::Repair(repair)));
        }
    }

    /// Tells the program once that it has heard all decisions so far.
    pub(super) fn tell_step(&mut self) {
        let Some(joint) = &mut self.joint else { return };
        if joint.comes_into_step() {
            let (term, decided, coordinator) =
                (joint.term(), joint.decided(), joint.roster.coordinator.clone());
            self.fact(InStep { term, decided, coordinator });
        }
    }
}

/// The events by which an operator rules `node`. Who has the right may request them, and nobody from afar can block them:
/// a block must not outlast the order that ends it, nor keep a node in a term that is over.
pub(super) fn orders(node: &NodeName) -> EventSet {
    EventSet::any_of([ROSTER, LIFT].map(|order| node.event_name(order)))
}

/// Events that are selected wherever they are requested, and do not travel.
pub(super) fn homeless() -> EventSet {
    EventSet::from("*").or(EventSet::from("*/*").and(!Roster::joint_events()))
}
