//! Going on: what has lapsed, what has happened elsewhere, and what the program selects.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use skein_bp::catalogue::Declared as _;
use skein_bp::{Event, Origin, Rival, Selection};

use crate::board::shorten;
use crate::facts::{BlockLapsed, Orphan, PeerLost, Stalled, Unstalled};
use crate::held_blocks::BlockNews;
use crate::node::{
    Delivery, Happened, Home, MOST_ROUNDS, Node, NodeError, RESTART_GUARD, Select, confirmation,
};
use crate::stalls::StallNews;
use crate::{Message, NodeName, Occurrence, Recipient, Roster};

/// Room for deliveries that is kept between steps.
const DELIVERIES_KEPT: usize = 16;

impl Node {
    pub(super) fn let_go_of_the_lapsed(&mut self) {
        let lapsed = self.table.expire(self.now);
        self.change_proxies(lapsed);
        for node in self.peers.take_lost(self.now) {
            if let Some(joint) = &mut self.joint {
                joint.forget(&node);
            }
            self.tell_loss(&node);
        }
        self.guard_joint_events();
        if self.guarding
            && (self.now >= self.guard_ends() || self.peers.names().all(|member| self.table.knows(member)))
        {
            self.guarding = false;
            self.change_proxies(vec![(RESTART_GUARD.into(), None)]);
        }
    }

    /// A node is lost, and with it what its b-threads blocked here.
    pub(super) fn tell_loss(&mut self, node: &NodeName) {
        let names = |bthreads: BTreeSet<String>| bthreads.into_iter().collect::<Vec<_>>().join(" ");
        let (released, held) = (names(self.table.released_by(node)), names(self.table.held_for(node)));
        let held = (!held.is_empty()).then(|| held.into());
        self.fact(PeerLost { node: node.clone(), released: released.into(), held });
    }

    pub(super) fn guard_ends(&self) -> Duration {
        self.started.unwrap_or(self.now) + self.config.longest_lease.max(self.config.lease)
    }

    /// Lets the program run until it has settled and knows all facts that this brought about; `select` takes each step.
    pub(super) fn run(&mut self, select: &mut Select<'_>) -> Result<(), NodeError> {
        let before = self.selections.len();
        let mut outcome = Ok(());
        self.tell_step();
        for _ in 0..MOST_ROUNDS {
            self.check_held_blocks();
            if let Err(error) = self.run_program(before, select) {
                outcome = Err(error);
            }
            if let Err(error) = self.state_bids() {
                outcome = outcome.and(Err(error));
            }
            self.check_held_blocks();
            self.check_stalls();
            if self.deliveries.is_empty() || outcome.is_err() {
                break;
            }
        }
        // When a fleet meets, hundreds come at once, and never again.
        self.deliveries.shrink_to(DELIVERIES_KEPT);
        outcome
    }

    fn run_program(&mut self, before: usize, select: &mut Select<'_>) -> Result<(), NodeError> {
        #[cfg(feature = "mutants")]
        if self.config.mutant == Some(crate::Mutant::G9)
            && let Some(selection) = self.program.step(self.program_now())?
        {
            self.publish(selection);
        }
        while let Some(delivery) = self.deliveries.pop_front() {
            match delivery {
                Delivery::Fact(event) => self.tell_fact(event)?,
                Delivery::Block(news) => {
                    if let Some(event) = self.block_fact(news) {
                        self.tell_fact(event)?;
                    }
                }
                Delivery::Occurrence(occurrence) => self.apply(occurrence)?,
                Delivery::Recalled(decision) => self.learn(decision)?,
            }
        }
        let now = self.program_now();
        while let Some(selection) = select(&mut self.program, now)? {
            self.publish(selection);
            let limit = self.config.settle_limit;
            if self.selections.len() - before > limit {
                let recent = self
                    .selections
                    .iter()
                    .rev()
                    .take(limit / 2)
                    .flat_map(|happened| happened.requested_by.iter().cloned());
                let bthreads = recent.collect::<BTreeSet<_>>().into_iter().collect();
                return Err(NodeError::Unsettled { node: self.config.name.clone(), limit, bthreads });
            }
        }
        Ok(())
    }

    /// Tells the program a fact, which counts as an event of this node.
    fn tell_fact(&mut self, event: Event) -> Result<(), NodeError> {
        self.program.occurred(event);
        if let Some(selection) = self.program.step(self.program_now())? {
            self.publish(selection);
        }
        Ok(())
    }

    /// What is to be told of a block. Its holder may have moved on meanwhile: a confirmation was for the synchronisation
    /// point that it has left, but that the block has lapsed concerns it for as long as it blocks anything.
    fn block_fact(&self, news: BlockNews) -> Option<Event> {
        match news {
            BlockNews::Confirmed { bthread, sync } => (self.sync_of(&bthread) == Some(sync))
                .then(|| confirmation(&self.config.name, &bthread, sync)),
            BlockNews::Lapsed { bthread, home } => {
                let blocks = self.program.bid(&bthread).is_some_and(|bid| !bid.blocks().is_none());
                blocks.then(|| BlockLapsed { bthread: bthread.into(), home }.at(&self.config.name))
            }
        }
    }

    /// Tells the program what has occurred elsewhere.
    fn apply(&mut self, occurrence: Occurrence) -> Result<(), NodeError> {
        let Occurrence { home, event, requests_served, .. } = &occurrence;
        let joint = Roster::joint_events().contains(event);
        if self.home_of(event) != Home::Elsewhere(home.clone()) || joint != (occurrence.term > 0) {
            // A home decides on its own events only.
            self.stats.ignored += 1;
            return Ok(());
        }
        for request in requests_served {
            let ours = request.node == self.config.name;
            let wanted = request.incarnation == self.config.incarnation
                && self.sync_of(&request.bthread) == Some(request.sync);
            if ours && !wanted {
                let bthread = request.bthread.as_str().into();
                self.fact(Orphan { event: event.name().into(), bthread, home: home.clone() });
            }
        }
        self.stats.heard += 1;
        self.learn(occurrence)
    }

    /// Tells the program what it cannot change any more.
    fn learn(&mut self, occurrence: Occurrence) -> Result<(), NodeError> {
        let Occurrence { home, seq, term, event, requested_by, choice, .. } = occurrence;
        self.program.occurred(event.clone());
        self.program.step(self.program_now())?;
        self.stalls_due = true;
        self.selections.push(Happened {
            event,
            home,
            seq,
            term,
            origin: Origin::Occurred,
            requested_by,
            choice,
            at: self.now,
        });
        Ok(())
    }

    /// Numbers what was selected here and tells it to all.
    fn publish(&mut self, selection: Selection) {
        let choice = choice(&selection);
        let Selection { event, origin, requested_by, .. } = selection;
        let requested_by = requested_by.into_vec();
        let (served, proxies) = self.table.serve(&requested_by);
        self.stalls_due = true;
        self.stats.occurred += 1;
        let travels = self.home.contains(&event);
        let joint = self.joint.as_mut().filter(|_| travels && Roster::joint_events().contains(&event));
        let (term, history) = match joint {
            Some(joint) => (joint.term(), &mut joint.decisions),
            None => (0, &mut self.history),
        };
        let seq = if travels { history.next_seq() } else { 0 };
        if travels {
            let occurrence = Occurrence {
                home: self.config.name.clone(),
                incarnation: self.config.incarnation,
                seq,
                term,
                event: event.clone(),
                requests_served: served,
                requested_by: requested_by.clone(),
                choice: choice.clone(),
                at: self.now,
            };
            history.push(occurrence.clone());
            self.outgoing.push((Recipient::All, Message::Occurrence(occurrence)));
        }
        self.selections.push(Happened {
            event: event.clone(),
            home: self.config.name.clone(),
            seq,
            term,
            origin,
            requested_by,
            choice,
            at: self.now,
        });
        if term > 0 {
            self.unsaved = true;
            self.guard_joint_events();
        }
        self.heed(&event);
        self.change_proxies(proxies);
    }

    fn check_held_blocks(&mut self) {
        let (outboxes, lease) = (&self.outboxes, self.config.lease);
        let news =
            self.held.check(self.now, |home, bthread, sync| outboxes.get(home)?.upheld(bthread, sync, lease));
        self.deliveries.extend(news.into_iter().map(Delivery::Block));
    }

    fn check_stalls(&mut self) {
        if !std::mem::take(&mut self.stalls_due) {
            return;
        }
        let mut stalled: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        if self.table.has_blocks() {
            let local = self
                .program
                .bids()
                .flat_map(|(_, bid, _)| bid.requests())
                .filter(|event| self.home.contains(event));
            for event in local.chain(self.table.open_requests()) {
                for by in self.table.blockers_of(event) {
                    stalled.entry(event.name().into()).or_default().insert(by);
                }
            }
        }
        for news in self.stalls.update(stalled) {
            match news {
                StallNews::Stalled { event, by } => {
                    self.fact(Stalled { event: event.into(), by: by.into() });
                }
                StallNews::Unstalled { event } => self.fact(Unstalled { event: event.into() }),
            }
        }
    }
}

/// Why this event and no other.
fn choice(selection: &Selection) -> Option<Arc<str>> {
    let priority = selection.priority.map(|priority| format!("priority {priority}"));
    let rivals: Vec<String> = selection.rivals.iter().map(Rival::to_string).collect();
    let over = (!rivals.is_empty()).then(|| format!("over {}", rivals.join(", ")));
    let mut choice = priority.into_iter().chain(over).collect::<Vec<_>>().join(", ");
    shorten(&mut choice);
    (!choice.is_empty()).then(|| choice.into())
}
