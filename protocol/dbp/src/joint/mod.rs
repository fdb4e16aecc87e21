//! Deciding together, and learning what was decided (G8).

pub(crate) mod roster;
mod term;

use std::time::Duration;

use skein_bp::{Bid, Event, Program};

use crate::channel::stream::Hole;
use crate::clock::Clock;
use crate::config::NodeConfig;
use crate::facts::{InStep, OutOfStep};
use crate::history::History;
use crate::joint::roster::Roster;
use crate::joint::term::Term;
use crate::message::{JointWord, Occurrence, Presence};
use crate::name::NodeName;
use crate::run::{Delivery, Run};

/// The proxy that keeps joint events back while a member has not been heard, or has yet to apply a decision.
const JOINT_GUARD: &str = "joint guard";

#[derive(Clone, Debug, Default)]
pub(crate) struct Joint {
    /// The present term; none if there are no joint events.
    term: Option<Term>,
    /// Whether joint events are kept back.
    guards: bool,
    /// Whether the coordinator has asked for word since it wants to decide.
    asking: bool,
    /// Whether roster or decisions are not saved as they are.
    unsaved: bool,
    /// Whether they are not on disk yet.
    owed: bool,
    /// Whether the disk does not take them.
    store_fails: bool,
    /// Whether it is not known what was decided in this term.
    forgot: bool,
}

impl Joint {
    /// The number of the term that this node is in; 0 without joint events.
    pub(crate) fn number(&self) -> u64 {
        self.term.as_ref().map_or(0, Term::number)
    }

    /// The number of the term's decisions that this node has made or applied.
    pub(crate) fn decided(&self) -> u64 {
        self.term.as_ref().map_or(0, Term::decided)
    }

    pub(crate) fn roster(&self) -> Option<&Roster> {
        self.term.as_ref().map(|term| &term.roster)
    }

    /// Whether this node is the coordinator.
    pub(crate) fn leads(&self) -> bool {
        self.led().is_some()
    }

    /// The decisions of the term, if this node is the one to make them.
    pub(crate) fn decisions(&self) -> Option<&History> {
        self.led().map(|term| &term.decisions)
    }

    /// The decisions of the term with this number that can be repeated.
    pub(crate) fn decisions_of(&self, number: u64) -> Option<&History> {
        self.term.as_ref().filter(|term| term.number() == number).map(|term| &term.decisions)
    }

    fn led(&self) -> Option<&Term> {
        self.term.as_ref().filter(|term| term.leads())
    }

    fn followed(&mut self) -> Option<&mut Term> {
        self.term.as_mut().filter(|term| !term.leads())
    }

    /// Begins the first term of this node's life, and recalls what a former life has decided in it.
    pub(crate) fn begin(
        &mut self,
        roster: Roster,
        decisions: Vec<Event>,
        config: &NodeConfig,
        run: &mut Run,
    ) {
        let mut term = Term::new(roster, config);
        self.forgot = config.forgot;
        if term.leads() {
            for (seq, event) in (1..).zip(decisions) {
                let decision = Occurrence {
                    home: config.name.clone(),
                    incarnation: config.incarnation,
                    seq,
                    term: term.number(),
                    event,
                    requests_served: Vec::new(),
                    requested_by: Vec::new(),
                    choice: None,
                    at: Duration::ZERO,
                };
                run.news.push_back(Delivery::Recalled(decision.clone()));
                term.decisions.push(decision);
            }
        }
        self.term = Some(term);
    }

    /// Begins a new term by an operator's order; gives the coordinator of the former one, if that is another node.
    pub(crate) fn adopt(&mut self, roster: Roster, config: &NodeConfig) -> Option<NodeName> {
        self.unsaved = true;
        self.owed = true;
        self.forgot = false;
        let former = self.term.replace(Term::new(roster, config));
        former.filter(|former| !former.leads()).map(|former| former.roster.coordinator)
    }

    /// The coordinator's next decision gets this term and number.
    pub(crate) fn next_decision(&self) -> Option<(u64, u64)> {
        self.term.as_ref().map(|term| (term.number(), term.decisions.next_seq()))
    }

    pub(crate) fn decide(&mut self, decision: Occurrence) {
        if let Some(term) = &mut self.term {
            term.decisions.push(decision);
            self.unsaved = true;
            self.owed = true;
        }
    }

    /// Roster and decisions are on disk.
    pub(crate) fn saved(&mut self) {
        self.owed = false;
        self.store_fails = false;
    }

    /// Whether roster or decisions are not on disk yet, so that nobody may rely on them.
    pub(crate) fn owes(&self) -> bool {
        self.owed
    }

    /// Nothing is decided until all is saved.
    pub(crate) fn store_fails(&mut self, clock: &Clock, lease: Duration, run: &mut Run) {
        self.store_fails = true;
        self.guard(clock, lease, run);
    }

    /// Whether the disk takes what is decided.
    pub(crate) fn is_stuck(&self) -> bool {
        self.store_fails
    }

    /// Whether roster or decisions have changed since the last call.
    pub(crate) fn take_unsaved(&mut self) -> bool {
        std::mem::take(&mut self.unsaved)
    }

    /// All decisions that this node has made in the term.
    pub(crate) fn events(&self) -> Vec<Event> {
        self.term.as_ref().map(Term::events).unwrap_or_default()
    }

    /// `node` is lost, or begins a new life: its words count no more.
    pub(crate) fn forget(&mut self, node: &NodeName) {
        if let Some(term) = &mut self.term {
            term.forget(node);
        }
    }

    /// Takes in what a sign of life says about joint events. Gives whether the coordinator asks for word.
    pub(crate) fn take_in_word(&mut self, presence: &Presence, word: &JointWord, run: &mut Run) -> bool {
        let node = &presence.node;
        let Some(term) = self.term.as_mut().filter(|term| term.roster.members.contains(node)) else {
            return false;
        };
        let astray = term.hear(node, presence.up, word);
        let is_followed = word.term == term.number() && *node == term.roster.coordinator && !term.leads();
        if is_followed {
            run.hear(node, |heard| term.stream.presence(word.decided, 1, true, heard));
        }
        if let Some(term) = astray {
            run.fact_because_of(node, OutOfStep { node: node.clone(), term });
        }
        is_followed && word.asks
    }

    /// Takes in a decision, in order or not; gives whether it is of the term and its coordinator.
    pub(crate) fn take_in_decision(&mut self, decision: Occurrence, run: &mut Run) -> bool {
        let home = decision.home.clone();
        let is_followed =
            |term: &&mut Term| term.number() == decision.term && term.roster.coordinator == home;
        let Some(term) = self.followed().filter(is_followed) else { return false };
        run.hear(&home, |heard| term.stream.occurrence(decision, heard));
        true
    }

    /// Whether joint events are kept back although somebody requests one, and whether that is so only since this call.
    pub(crate) fn wants_to_decide(&mut self, program: &Program) -> (bool, bool) {
        let asked = |bid: &Bid| bid.requests().iter().any(Roster::is_joint);
        let asks = self.guards
            && (program.bids().any(|(_, bid, _)| asked(bid)) || program.proxies().any(|(_, bid)| asked(bid)));
        let asked_before = std::mem::replace(&mut self.asking, asks);
        (asks, asks && !asked_before)
    }

    /// The word to say in a sign of life.
    pub(crate) fn word(&self, asks: bool) -> Option<JointWord> {
        self.term.as_ref().map(|term| term.word(asks))
    }

    /// Keeps joint events back, or lets them happen, as the members' last words allow; none may be older than `lease`.
    pub(crate) fn guard(&mut self, clock: &Clock, lease: Duration, run: &mut Run) {
        let is_able = !self.store_fails && !self.forgot;
        let may_decide = |term: &Term| is_able && term.may_decide(clock.up(), lease);
        let guards = self.led().is_some_and(|term| !may_decide(term));
        if std::mem::replace(&mut self.guards, guards) != guards {
            let block = guards.then(|| Bid::new().block(Roster::joint_events()));
            run.change_proxies(vec![(JOINT_GUARD.into(), block)]);
        }
    }

    /// Asks for the decisions that are missed: gives the coordinator, the term and their numbers.
    pub(crate) fn missed(&mut self, now: Duration, lease: Duration) -> Option<(&NodeName, u64, Vec<Hole>)> {
        let term = self.followed()?;
        let (number, holes) = term.stream.repair(now, lease / 10)?;
        Some((&term.roster.coordinator, number, holes))
    }

    /// Tells the program once that it has heard all decisions so far.
    pub(crate) fn tell_step(&mut self, run: &mut Run) {
        let Some(term) = &mut self.term else { return };
        if term.comes_into_step() {
            let (decided, coordinator) = (term.decided(), term.roster.coordinator.clone());
            run.fact(InStep { term: term.number(), decided, coordinator });
        }
    }

    /// When joint events must be kept back again if nobody is heard until then, or decisions are to be asked for.
    pub(crate) fn next_deadline(&self, clock: &Clock, lease: Duration) -> Option<Duration> {
        let term = self.term.as_ref()?;
        if !term.leads() {
            return term.stream.next_deadline();
        }
        let until = term.may_decide_until(lease).filter(|_| !self.guards)?;
        Some(clock.start() + until)
    }
}
