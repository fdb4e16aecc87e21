//! The log of orders: which vehicles have heard each.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use skein_dbp::{Happened, Node, NodeName};
use skein_wire::event::{
    Declared as _, Declined, Handover, Heeded, OrderTaken, Overruled, Rerouted, ScriptNews, ScriptState,
    Takeoff, What,
};
use skein_wire::{Order, Who};

use crate::bthreads::{GOING_LASTS, Hold, LAUNCH_LASTS};
use crate::giver::Giver;
use crate::refusal::held_by;

/// The number of orders that are remembered.
const KEPT: usize = 10;

/// An order, and what has become of it.
#[derive(Clone, Debug, PartialEq)]
pub struct OrderRecord {
    /// Its number at this station, from 1.
    pub id: u64,
    /// Who has given it.
    pub by: Giver,
    pub order: Order,
    /// When it was given, on the station's clock.
    pub at: Duration,
    /// The answer of each vehicle that it is for.
    pub answers: BTreeMap<NodeName, Answer>,
}

/// A vehicle's answer to an order.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    Pending,
    /// Nothing, and it is out of reach.
    Missing,
    /// It has taken the order in, so long after it was given. A hold is acknowledged once it is sure to be kept.
    Acknowledged(Duration),
    /// It does not carry the order out, or will not hear of it any more, and this is why.
    Refused(String),
}

impl Answer {
    pub(crate) fn is_open(&self) -> bool {
        matches!(self, Self::Pending | Self::Missing)
    }
}

/// The latest orders, oldest first.
#[derive(Debug, Default)]
pub(crate) struct OrderLog {
    records: VecDeque<OrderRecord>,
    given: u64,
    /// Grows with every change.
    revision: u64,
}

impl OrderLog {
    /// An order is given at `now` to those whose answer is open. Whatever they have not taken in before will not be said
    /// to them again.
    pub(crate) fn give(
        &mut self,
        now: Duration,
        by: Giver,
        order: Order,
        answers: BTreeMap<NodeName, Answer>,
    ) -> u64 {
        let earlier = self.records.iter_mut().filter(|record| supersedes(&order, &record.order));
        let earlier = earlier.flat_map(|record| &mut record.answers);
        for (_, answer) in earlier.filter(|(vehicle, answer)| {
            answers.get(*vehicle).is_some_and(Answer::is_open) && answer.is_open()
        }) {
            *answer = Answer::Refused("another order has taken its place".into());
        }
        self.given += 1;
        self.revision += 1;
        if self.records.len() == KEPT {
            self.records.pop_front();
        }
        self.records.push_back(OrderRecord { id: self.given, by, order, at: now, answers });
        self.given
    }

    /// Takes in what has happened since the last call, and who holds each vehicle. Gives back which vehicles need not be
    /// brought an order any more.
    pub(crate) fn update(
        &mut self,
        now: Duration,
        node: &Node,
        happened: &[Happened],
        holders: &BTreeMap<NodeName, String>,
    ) -> Vec<Overruled> {
        for happened in happened {
            let vehicle = &happened.home;
            // Of several orders of a kind, it is the newest that is answered.
            for record in self.records.iter_mut().rev() {
                let after = now.saturating_sub(record.at);
                if let (Some(answer), Some(known)) =
                    (answer_in(record, happened, after), record.answers.get_mut(vehicle))
                {
                    // A refusal may follow an acknowledgement; nothing else changes what has been said.
                    let declined = matches!((&known, &answer), (Answer::Acknowledged(_), Answer::Refused(_)));
                    if known.is_open() || declined {
                        *known = answer;
                        self.revision += 1;
                    }
                    break;
                }
            }
        }
        self.look_at_holds(now, node);
        for record in &mut self.records {
            let lasts = match record.order.what() {
                What::LaunchTogether => Some(LAUNCH_LASTS),
                What::Route => Some(GOING_LASTS),
                what if what.sets_going() || what.is_about_script() => Some(GOING_LASTS),
                _ => None,
            };
            let late = lasts.is_some_and(|lasts| now > record.at + lasts);
            for (vehicle, answer) in record.answers.iter_mut().filter(|(_, answer)| answer.is_open()) {
                let alive = node.peers().any(|(peer, state)| peer == vehicle && state.alive);
                let now_it_is = match (late, alive) {
                    (true, _) => Answer::Refused("it was not taken in for too long; order it again".into()),
                    (false, true) => Answer::Pending,
                    (false, false) => Answer::Missing,
                };
                if *answer != now_it_is {
                    *answer = now_it_is;
                    self.revision += 1;
                }
            }
        }
        self.look_at_holders(holders)
    }

    /// Another station's order may have come first: the vehicle says who holds it.
    fn look_at_holders(&mut self, holders: &BTreeMap<NodeName, String>) -> Vec<Overruled> {
        let mut overruled = Vec::new();
        for record in self.records.iter_mut().filter(|record| record.order.what().needs_holder()) {
            let by = record.by.as_str();
            for (vehicle, answer) in
                record.answers.iter_mut().filter(|(_, answer)| **answer == Answer::Pending)
            {
                let Some(holder) = holders.get(vehicle).filter(|holder| *holder != by) else { continue };
                *answer = Answer::Refused(held_by(holder, vehicle));
                self.revision += 1;
                overruled.push(Overruled { vehicle: vehicle.clone(), by: holder.as_str().into() });
            }
        }
        overruled
    }

    /// A hold is acknowledged by those who surely keep it now: a vehicle that was out of reach for a lease does not.
    fn look_at_holds(&mut self, now: Duration, node: &Node) {
        for (vehicle, kept) in node.kept_by(Hold::NAME) {
            let newest = self.records.iter_mut().rev().find(|record| {
                !record.order.what().is_beside_flight() && record.answers.contains_key(vehicle)
            });
            let Some(record) = newest.filter(|record| record.order.what() == What::Hold) else {
                continue;
            };
            let after = now.saturating_sub(record.at);
            let Some(answer) = record.answers.get_mut(vehicle) else { continue };
            match (kept, &*answer) {
                (true, Answer::Pending | Answer::Missing) => *answer = Answer::Acknowledged(after),
                (false, Answer::Acknowledged(_)) => *answer = Answer::Pending,
                _ => continue,
            }
            self.revision += 1;
        }
    }

    pub(crate) fn records(&self) -> impl Iterator<Item = &OrderRecord> {
        self.records.iter()
    }

    pub(crate) fn revision(&self) -> u64 {
        self.revision
    }
}

/// Whether whoever has not taken in the `old` order need not any more. A launch is about those on the ground: it
/// takes the place of no order, and only who calls all down calls it off. Scripts are beside all that, and a route takes
/// the place of a route.
fn supersedes(new: &Order, old: &Order) -> bool {
    let calls_all_off = new.what().calls_launch_off() && *new.who() == Who::All;
    match (new.what(), old.what()) {
        (new, _) if new.is_launch() => false,
        (new, old) if new.is_about_script() || old.is_about_script() => false,
        (What::Route, old) => old == What::Route,
        (_, What::Route) => false,
        (_, old) => calls_all_off || !old.is_launch(),
    }
}

/// The answer to an order in an event at a vehicle.
fn answer_in(record: &OrderRecord, happened: &Happened, after: Duration) -> Option<Answer> {
    let (order, by) = (&record.order, record.by.as_str());
    let event = &happened.event;
    let acknowledged = || Some(Answer::Acknowledged(after));
    let refused = |why: &str| Some(Answer::Refused(why.to_owned()));
    if order.what().is_launch() && event.kind() == Takeoff::NAME {
        return acknowledged();
    }
    if let (Some(route), Some(taken)) = (order.way(), Rerouted::read(event)) {
        // The vehicle reads back what it has taken on.
        return if *taken.by == *by && *taken.way == *route.to_string() { acknowledged() } else { None };
    }
    if let Some(taken) = OrderTaken::read(event).filter(|taken| taken.what != What::Route) {
        // What another has ordered, or a script its own vehicle, is nobody's answer.
        return if taken.what == order.what() && *taken.by == *by { acknowledged() } else { None };
    }
    if let Some(handover) = Handover::read(event) {
        return if handover.what == order.what() && *handover.by == *by { acknowledged() } else { None };
    }
    if let Some(heeded) = Heeded::read(event) {
        return if heeded.what == order.what() { acknowledged() } else { None };
    }
    if let Some(declined) = Declined::read(event) {
        return if declined.what == order.what() { refused(&declined.why) } else { None };
    }
    let news = ScriptNews::read(event).filter(|news| order.script() == Some(&*news.name))?;
    match (order.what(), news.state) {
        (_, ScriptState::Refused) => refused(&news.why),
        (What::Load, ScriptState::Accepted) | (What::Unload, ScriptState::Withdrawn | ScriptState::Ended) => {
            acknowledged()
        }
        _ => None,
    }
}
