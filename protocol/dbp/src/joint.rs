//! Where this node stands with joint events (G8).
//!
//! The decisions of a term are a stream of their own, numbered from 1: whoever joins or comes back hears all of it, in
//! order, and the coordinator decides nothing more until everyone has.

use std::collections::BTreeMap;
use std::time::Duration;

use skein_bp::Event;

use crate::history::History;
use crate::stream::Stream;
use crate::{JointWord, NodeName, Occurrence, Roster};

/// How many decisions a term may see; after them the operator begins a new one.
const MOST_DECISIONS: usize = 4096;

/// One term, as one node sees it.
#[derive(Clone, Debug)]
pub(crate) struct Joint {
    pub(crate) roster: Roster,
    /// Whether this node is the coordinator.
    leads: bool,
    /// The coordinator's decisions.
    pub(crate) decisions: History,
    /// A member's ear for them.
    pub(crate) stream: Stream,
    /// What the members have said last, as the coordinator heard it.
    words: BTreeMap<NodeName, JointWord>,
    /// `up` of the coordinator's newest sign of life, as a member heard it.
    heard: Option<Duration>,
    /// Whether this node's b-threads know that they have heard all decisions so far.
    in_step: bool,
    /// Others that were last heard in another term, and in which.
    astray: BTreeMap<NodeName, u64>,
    #[cfg(feature = "mutants")]
    pub(crate) mutant: Option<crate::Mutant>,
}

impl Joint {
    pub(crate) fn new(roster: Roster, me: &NodeName) -> Self {
        let mut stream = Stream::default();
        stream.begin(roster.term);
        Self {
            leads: roster.coordinator == *me,
            roster,
            decisions: History::new(MOST_DECISIONS),
            stream,
            words: BTreeMap::new(),
            heard: None,
            in_step: false,
            astray: BTreeMap::new(),
            #[cfg(feature = "mutants")]
            mutant: None,
        }
    }

    pub(crate) fn term(&self) -> u64 {
        self.roster.term
    }

    /// Whether this node is the coordinator.
    pub(crate) fn leads(&self) -> bool {
        self.leads
    }

    /// How many of the term's decisions this node has made or applied.
    pub(crate) fn decided(&self) -> u64 {
        if self.leads { self.decisions.latest_seq() } else { self.stream.applied() }
    }

    /// Takes over the decisions that a former life of this coordinator has made.
    pub(crate) fn recall(&mut self, decisions: impl IntoIterator<Item = Occurrence>) {
        decisions.into_iter().for_each(|decision| self.decisions.push(decision));
    }

    /// All decisions, for the next life.
    pub(crate) fn events(&self) -> Vec<Event> {
        self.decisions.after(0).into_iter().flatten().map(|decision| decision.event.clone()).collect()
    }

    /// What to say in a sign of life.
    pub(crate) fn word(&self, asks: bool) -> JointWord {
        let heard = self.heard.filter(|_| !self.leads);
        JointWord { term: self.term(), decided: self.decided(), heard, asks: asks && self.leads }
    }

    /// Takes in what a roster member says; gives the term it is in, if that is another one and news.
    pub(crate) fn hear(&mut self, node: &NodeName, up: Duration, word: &JointWord) -> Option<u64> {
        if word.term != self.term() {
            self.words.remove(node);
            return (self.astray.insert(node.clone(), word.term) != Some(word.term)).then_some(word.term);
        }
        self.astray.remove(node);
        if *node == self.roster.coordinator {
            self.heard = Some(self.heard.map_or(up, |before| before.max(up)));
        }
        self.words.insert(node.clone(), *word);
        None
    }

    /// `node` is lost, or begins a new life: what it has said counts no more.
    pub(crate) fn forget(&mut self, node: &NodeName) {
        self.words.remove(node);
        if *node == self.roster.coordinator {
            self.heard = None;
            self.in_step = false;
        }
    }

    /// Whether the coordinator, up for so long, may decide: every other member has applied all decisions, and has heard
    /// a sign of life that is not older than `lease`.
    pub(crate) fn may_decide(&self, up: Duration, lease: Duration) -> bool {
        let fresh = |word: &JointWord| {
            word.decided == self.decided()
                && word.heard.is_some_and(|heard| heard <= up && heard + lease > up)
        };
        let others = self.roster.members.iter().filter(|member| **member != self.roster.coordinator);
        #[cfg(feature = "mutants")]
        let others = others
            .filter(|member| self.mutant != Some(crate::Mutant::G8) || self.words.contains_key(*member));
        self.leads
            && self.decisions.latest_seq() < MOST_DECISIONS as u64
            && others.into_iter().all(|member| self.words.get(member).is_some_and(fresh))
    }

    /// Until when, as time up, the coordinator may decide on what it has heard.
    pub(crate) fn may_decide_until(&self, lease: Duration) -> Option<Duration> {
        self.words.values().filter_map(|word| word.heard).min().map(|heard| heard + lease)
    }

    /// Whether it is news that this node has applied all decisions so far.
    pub(crate) fn comes_into_step(&mut self) -> bool {
        let latest = self.words.get(&self.roster.coordinator).map(|word| word.decided);
        let news = !self.in_step && (self.leads || latest == Some(self.stream.applied()));
        self.in_step |= news;
        news
    }
}
