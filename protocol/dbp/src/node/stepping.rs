//! Going on: what has lapsed, what has happened elsewhere, what the program selects, and what is due to be sent.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use skein_bp::{Event, Origin, Rival, Selection};

use crate::board::shorten;
use crate::error::NodeError;
use crate::facts::Orphan;
use crate::joint::roster::Roster;
use crate::message::{Message, Occurrence};
use crate::node::{Node, Select};
use crate::routes::{Route, Routes};
use crate::run::Delivery;

/// Most rounds in which one step comes back to facts that its own selections have brought about.
const MOST_ROUNDS: usize = 16;
/// Room for news that is kept between steps.
const NEWS_KEPT: usize = 16;

impl Node {
    /// Goes on, with every selection made by `select`.
    pub(crate) fn step_by(&mut self, now: Duration, select: &mut Select<'_>) -> Result<(), NodeError> {
        self.clock.set(now);
        self.run.now = self.clock.now();
        self.let_go_of_the_lapsed();
        let outcome = self.settle(select);
        self.send_what_is_due();
        outcome
    }

    fn let_go_of_the_lapsed(&mut self) {
        self.run.change_proxies(self.home.table.expire(self.clock.now()));
        for node in self.channel.peers.take_lost(self.clock.now()) {
            self.joint.forget(&node);
            self.home.tell_loss(&node, &mut self.run);
        }
        self.joint.guard(&self.clock, self.config.lease, &mut self.run);
        self.home.open_guard(&self.clock, &self.config, &mut self.run);
    }

    /// Lets the program run until it has settled and knows all facts that this brought about; `select` takes each step.
    fn settle(&mut self, select: &mut Select<'_>) -> Result<(), NodeError> {
        // The program's own selections since the last one that another node has asked for. What others have decided and
        // ask for is bounded by what they may say, and is no sign that the program goes round.
        let mut own = 0;
        let mut outcome = Ok(());
        self.joint.tell_step(&mut self.run);
        for _ in 0..MOST_ROUNDS {
            self.check_blocks();
            if let Err(error) = self.run_program(&mut own, select) {
                outcome = Err(error);
            }
            outcome = outcome.and(self.state_bids());
            self.check_blocks();
            self.home.check_stalls(&mut self.run);
            if self.run.news.is_empty() || outcome.is_err() {
                break;
            }
        }
        // When a fleet meets, hundreds come at once, and never again.
        self.run.news.shrink_to(NEWS_KEPT);
        outcome
    }

    fn check_blocks(&mut self) {
        self.guest.check_blocks(self.clock.now(), self.config.lease, &mut self.run);
    }

    fn state_bids(&mut self) -> Result<(), NodeError> {
        let (here, roster, peers) = (&self.home.events, self.joint.roster(), &self.channel.peers);
        self.guest.state_bids(&self.config.name, &Routes { here, roster, peers }, &mut self.run)
    }

    fn run_program(&mut self, own: &mut usize, select: &mut Select<'_>) -> Result<(), NodeError> {
        let now = self.clock.of_bthreads();
        #[cfg(feature = "mutants")]
        if self.config.mutant == Some(crate::mutant::Mutant::G9)
            && let Some(selection) = self.run.program.step(now)?
        {
            self.publish(selection);
        }
        while let Some(delivery) = self.run.news.pop_front() {
            match delivery {
                Delivery::Fact(event) => self.tell_fact(event)?,
                Delivery::Block(news) => {
                    if let Some(event) = self.run.block_fact(news) {
                        self.tell_fact(event)?;
                    }
                }
                Delivery::Occurrence(occurrence) => self.apply(occurrence)?,
                Delivery::Recalled(decision) => self.learn(decision)?,
            }
        }
        while let Some(selection) = select(&mut self.run.program, now)? {
            // A request counts once, so only so many that others ask for can follow one another.
            *own = if self.publish(selection) { 0 } else { *own + 1 };
            let limit = self.config.settle_limit;
            if *own > limit {
                let recent = self.run.selections.iter().rev().take(limit / 2);
                let bthreads: BTreeSet<_> =
                    recent.flat_map(|happened| happened.requested_by.iter()).collect();
                let bthreads = bthreads.into_iter().cloned().collect();
                return Err(NodeError::Unsettled { node: self.config.name.clone(), limit, bthreads });
            }
        }
        Ok(())
    }

    /// Tells the program a fact, which counts as an event of this node.
    fn tell_fact(&mut self, event: Event) -> Result<(), NodeError> {
        self.run.program.occurred(event);
        if let Some(selection) = self.run.program.step(self.clock.of_bthreads())? {
            self.publish(selection);
        }
        Ok(())
    }

    /// Tells the program what has occurred elsewhere.
    fn apply(&mut self, occurrence: Occurrence) -> Result<(), NodeError> {
        let Occurrence { home, event, requests_served, .. } = &occurrence;
        let decided_there = self.routes().of(event) == Route::Elsewhere(home.clone());
        if !decided_there || Roster::is_joint(event) != (occurrence.term > 0) {
            self.stats.ignored += 1;
            return Ok(());
        }
        for request in requests_served {
            let ours = request.node == self.config.name;
            let wanted = request.incarnation == self.config.incarnation
                && self.run.sync_of(&request.bthread) == Some(request.sync);
            if ours && !wanted {
                let (event, bthread) = (event.name().into(), request.bthread.as_str().into());
                self.run.fact_because_of(home, Orphan { event, bthread, home: home.clone() });
            }
        }
        self.stats.heard += 1;
        self.learn(occurrence)
    }

    /// Tells the program what it cannot change any more.
    fn learn(&mut self, occurrence: Occurrence) -> Result<(), NodeError> {
        self.run.program.occurred(occurrence.event.clone());
        self.run.program.step(self.clock.of_bthreads())?;
        self.run.record(occurrence, Origin::Occurred, self.clock.now());
        Ok(())
    }

    /// Numbers what was selected here and tells it to all; gives whether another node has asked for it.
    fn publish(&mut self, selection: Selection) -> bool {
        let choice = choice(&selection);
        let Selection { event, origin, requested_by, .. } = selection;
        let requested_by = requested_by.into_vec();
        let (requests_served, proxies) = self.home.table.serve(&requested_by);
        let serves_others = !proxies.is_empty();
        self.stats.occurred += 1;
        let travels = self.home.events.contains(&event);
        let decision = self.joint.next_decision().filter(|_| travels && Roster::is_joint(&event));
        let (term, seq) = match decision {
            Some(decision) => decision,
            None => (0, if travels { self.home.history.next_seq() } else { 0 }),
        };
        let (home, incarnation, at) = (self.config.name.clone(), self.config.incarnation, self.clock.now());
        let occurrence = Occurrence {
            home,
            incarnation,
            seq,
            term,
            event: event.clone(),
            requests_served,
            requested_by,
            choice,
            at,
        };
        if travels {
            self.channel.send_to_all(Message::Occurrence(occurrence.clone()));
            match decision {
                Some(_) => self.joint.decide(occurrence.clone()),
                None => self.home.history.push(occurrence.clone()),
            }
        }
        self.run.record(occurrence, origin, at);
        if decision.is_some() {
            self.joint.guard(&self.clock, self.config.lease, &mut self.run);
        }
        self.heed(&event);
        self.run.change_proxies(proxies);
        serves_others
    }

    fn send_what_is_due(&mut self) {
        let (now, lease) = (self.clock.now(), self.config.lease);
        let joint = (self.joint.number(), self.joint.decided());
        self.guest.send_due(now, &self.config, joint, &mut self.channel);
        self.channel.ask_for_missed(now, &self.config);
        if let Some((coordinator, term, holes)) = self.joint.missed(now, lease) {
            self.channel.ask_for_decisions(&self.config.name, coordinator, term, holes);
        }
        let (asks, begins_to_ask) = self.joint.wants_to_decide(&self.run.program);
        if begins_to_ask || self.channel.presence_is_due(now) {
            let word = self.joint.word(asks);
            self.channel.send_presence(&self.clock, &self.config, &self.home.history, word);
        }
    }
}

/// The reason why this event was selected and no other.
fn choice(selection: &Selection) -> Option<Arc<str>> {
    let priority = selection.priority.map(|priority| format!("priority {priority}"));
    let rivals: Vec<String> = selection.rivals.iter().map(Rival::to_string).collect();
    let over = (!rivals.is_empty()).then(|| format!("over {}", rivals.join(", ")));
    let mut choice = priority.into_iter().chain(over).collect::<Vec<_>>().join(", ");
    shorten(&mut choice);
    (!choice.is_empty()).then(|| choice.into())
}
