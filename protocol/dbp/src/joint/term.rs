//! One term of joint events, as one node sees it (G8).
//!
//! The decisions of a term are a stream of their own, numbered from 1: whoever joins or comes back hears all of it, in
//! order, and the coordinator decides nothing more until everyone has.

use std::collections::BTreeMap;
use std::time::Duration;

use skein_bp::Event;

use crate::channel::stream::Stream;
use crate::config::NodeConfig;
use crate::history::History;
use crate::joint::roster::Roster;
use crate::message::JointWord;
use crate::name::NodeName;

/// The most decisions of a term; after them the operator begins a new one.
const MOST_DECISIONS: usize = 4096;

#[derive(Clone, Debug)]
pub(super) struct Term {
    pub(super) roster: Roster,
    /// Whether this node is the coordinator.
    leads: bool,
    /// The coordinator's decisions.
    pub(super) decisions: History,
    /// A member's ear for them.
    pub(super) stream: Stream,
    /// The members' last words, as the coordinator heard them.
    words: BTreeMap<NodeName, JointWord>,
    /// `up` of the coordinator's newest sign of life, as a member heard it.
    heard: Option<Duration>,
    /// Whether this node's b-threads know that they have heard all decisions so far.
    in_step: bool,
    /// The members that were last heard in another term, each with that term.
    astray: BTreeMap<NodeName, u64>,
    #[cfg(feature = "mutants")]
    mutant: Option<crate::mutant::Mutant>,
}

impl Term {
    pub(super) fn new(roster: Roster, config: &NodeConfig) -> Self {
        let mut stream = Stream::default();
        stream.begin(roster.term);
        Self {
            leads: roster.coordinator == config.name,
            roster,
            decisions: History::whole(MOST_DECISIONS),
            stream,
            words: BTreeMap::new(),
            heard: None,
            in_step: false,
            astray: BTreeMap::new(),
            #[cfg(feature = "mutants")]
            mutant: config.mutant,
        }
    }

    pub(super) fn number(&self) -> u64 {
        self.roster.term
    }

    /// Whether this node is the coordinator.
    pub(super) fn leads(&self) -> bool {
        self.leads
    }

    /// The number of the term's decisions that this node has made or applied.
    pub(super) fn decided(&self) -> u64 {
        if self.leads { self.decisions.latest_seq() } else { self.stream.applied() }
    }

    /// All decisions, for the next life.
    pub(super) fn events(&self) -> Vec<Event> {
        self.decisions.after(0).into_iter().flatten().map(|decision| decision.event.clone()).collect()
    }

    /// The word to say in a sign of life.
    pub(super) fn word(&self, asks: bool) -> JointWord {
        let heard = self.heard.filter(|_| !self.leads);
        JointWord { term: self.number(), decided: self.decided(), heard, asks: asks && self.leads }
    }

    /// Takes in what a roster member says; gives the term it is in, if that is another one and news.
    pub(super) fn hear(&mut self, node: &NodeName, up: Duration, word: &JointWord) -> Option<u64> {
        if word.term != self.number() {
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

    /// `node` is lost, or begins a new life: its words count no more.
    pub(super) fn forget(&mut self, node: &NodeName) {
        self.words.remove(node);
        if *node == self.roster.coordinator {
            self.heard = None;
            self.in_step = false;
        }
    }

    /// Whether the coordinator, up for so long, may decide: every other member has applied all decisions, and has heard
    /// a sign of life that is not older than `lease`.
    pub(super) fn may_decide(&self, up: Duration, lease: Duration) -> bool {
        let fresh = |word: &JointWord| {
            word.decided == self.decided()
                && word.heard.is_some_and(|heard| heard <= up && heard + lease > up)
        };
        let others = self.roster.members.iter().filter(|member| **member != self.roster.coordinator);
        #[cfg(feature = "mutants")]
        let others = others.filter(|member| {
            self.mutant != Some(crate::mutant::Mutant::G8) || self.words.contains_key(*member)
        });
        self.leads
            && !self.decisions.is_full()
            && others.into_iter().all(|member| self.words.get(member).is_some_and(fresh))
    }

    /// Until when, as time up, the coordinator may decide on what it has heard.
    pub(super) fn may_decide_until(&self, lease: Duration) -> Option<Duration> {
        self.words.values().filter_map(|word| word.heard).min().map(|heard| heard + lease)
    }

    /// Whether it is news that this node has applied all decisions so far.
    pub(super) fn comes_into_step(&mut self) -> bool {
        let latest = self.words.get(&self.roster.coordinator).map(|word| word.decided);
        let news = !self.in_step && (self.leads || latest == Some(self.stream.applied()));
        self.in_step |= news;
        news
    }
}
