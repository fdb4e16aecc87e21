//! The log of zones: what is drawn, and which vehicles have regard for it.

use std::collections::BTreeMap;
use std::time::Duration;

use skein_dbp::facts::Refused;
use skein_dbp::{Happened, Node, NodeName, RefusalReason};
use skein_wire::event::Declared as _;
use skein_wire::{KeptZone, State, Zone};

use crate::bthreads::ZoneBlock;
use crate::giver::Giver;
use crate::order_log::Answer;
use crate::refusal::Refusal;

/// A zone, and what has become of it.
#[derive(Clone, Debug, PartialEq)]
pub struct ZoneRecord {
    pub zone: Zone,
    /// Who has drawn it.
    pub by: Giver,
    /// When it was drawn, or is being removed since, on the station's clock; of one from a former life, the start.
    pub at: Duration,
    /// Whether it is being removed.
    pub is_going: bool,
    /// Whether each vehicle keeps it, on disk; of one that is being removed, whether it has let it go. A zone that is gone
    /// from everywhere is on record no more.
    pub answers: BTreeMap<NodeName, Answer>,
}

/// The zones by name.
#[derive(Debug, Default)]
pub(crate) struct ZoneLog {
    records: BTreeMap<String, ZoneRecord>,
    revision: u64,
}

impl ZoneLog {
    /// Why this one cannot be drawn, if so.
    pub(crate) fn objection(&self, zone: &Zone) -> Option<Refusal> {
        let others = || self.standing().filter(|record| record.zone.name() != zone.name());
        let corners = others().map(|record| record.zone.corners()).sum::<usize>() + zone.corners();
        if others().count() >= Zone::MOST {
            return Some(Refusal::TooManyZones);
        }
        (corners > Zone::MOST_CORNERS_IN_ALL).then_some(Refusal::TooManyCorners { corners })
    }

    /// Whether a zone of this name is drawn, and not being removed.
    pub(crate) fn is_standing(&self, name: &str) -> bool {
        self.records.get(name).is_some_and(|record| !record.is_going)
    }

    /// A zone is drawn for these vehicles, in the place of one of its name.
    pub(crate) fn draw(&mut self, now: Duration, by: Giver, zone: Zone, vehicles: &[NodeName]) {
        let answers = pending(vehicles);
        let record = ZoneRecord { zone, by, at: now, is_going: false, answers };
        self.records.insert(record.zone.name().to_owned(), record);
        self.revision += 1;
    }

    /// The zone of this name is to be removed; whether there is one.
    pub(crate) fn erase(&mut self, now: Duration, name: &str, vehicles: &[NodeName]) -> bool {
        let Some(record) = self.records.get_mut(name).filter(|record| !record.is_going) else { return false };
        (record.at, record.is_going, record.answers) = (now, true, pending(vehicles));
        self.revision += 1;
        true
    }

    /// A vehicle tells which zones it has regard for.
    pub(crate) fn note_state(&mut self, now: Duration, state: &State) {
        let going = self.records.values_mut().filter(|record| record.is_going);
        for record in going.filter(|record| !state.zones.iter().any(|name| name == record.zone.name())) {
            let after = now.saturating_sub(record.at);
            if let Some(answer) = record.answers.get_mut(&state.node).filter(|answer| answer.is_open()) {
                *answer = Answer::Acknowledged(after);
                self.revision += 1;
            }
        }
    }

    /// Takes in what has happened since the last call.
    pub(crate) fn update(&mut self, now: Duration, node: &Node, happened: &[Happened]) {
        let refusals = happened.iter().filter(|happened| happened.home == *node.name());
        for refused in refusals.filter_map(|happened| Refused::read(&happened.event)) {
            self.note_refusal(&refused);
        }
        for record in self.records.values_mut().filter(|record| !record.is_going) {
            let after = now.saturating_sub(record.at);
            for (vehicle, kept) in node.kept_by(&ZoneBlock::name(record.zone.name())) {
                let Some(answer) = record.answers.get_mut(vehicle) else { continue };
                match (kept, &*answer) {
                    (true, Answer::Pending | Answer::Missing | Answer::Refused(_)) => {
                        *answer = Answer::Acknowledged(after);
                    }
                    (false, Answer::Acknowledged(_)) => *answer = Answer::Pending,
                    _ => continue,
                }
                self.revision += 1;
            }
        }
        self.look_who_is_there(node);
        let count = self.records.len();
        self.records.retain(|_, record| !record.is_going || record.answers.values().any(Answer::is_open));
        self.revision += u64::from(count != self.records.len());
    }

    fn note_refusal(&mut self, refused: &Refused) {
        let is_meant = |record: &&mut ZoneRecord| ZoneBlock::name(record.zone.name()) == *refused.bthread;
        let record = self.records.values_mut().find(is_meant).filter(|record| !record.is_going);
        if let Some(answer) = record.and_then(|record| record.answers.get_mut(&refused.home)) {
            *answer = Answer::Refused(in_words(refused.reason).to_owned());
            self.revision += 1;
        }
    }

    fn look_who_is_there(&mut self, node: &Node) {
        let alive: BTreeMap<&NodeName, bool> =
            node.peers().map(|(peer, state)| (peer, state.alive)).collect();
        let answers = self.records.values_mut().flat_map(|record| &mut record.answers);
        for (vehicle, answer) in answers.filter(|(_, answer)| answer.is_open()) {
            let is_there = alive.get(vehicle).is_some_and(|alive| *alive);
            let now_it_is = if is_there { Answer::Pending } else { Answer::Missing };
            if *answer != now_it_is {
                *answer = now_it_is;
                self.revision += 1;
            }
        }
    }

    fn standing(&self) -> impl Iterator<Item = &ZoneRecord> {
        self.records.values().filter(|record| !record.is_going)
    }

    pub(crate) fn records(&self) -> impl Iterator<Item = &ZoneRecord> {
        self.records.values()
    }

    pub(crate) fn revision(&self) -> u64 {
        self.revision
    }

    /// The zones that the station's next life is to take up.
    pub(crate) fn kept(&self) -> Vec<KeptZone> {
        let kept = |record: &ZoneRecord| KeptZone { by: record.by.to_string(), zone: record.zone.clone() };
        self.standing().map(kept).collect()
    }
}

fn pending(vehicles: &[NodeName]) -> BTreeMap<NodeName, Answer> {
    vehicles.iter().map(|vehicle| (vehicle.clone(), Answer::Pending)).collect()
}

/// Why a vehicle does not keep a zone.
fn in_words(reason: RefusalReason) -> &'static str {
    match reason {
        RefusalReason::HoldUnsupported => "its disk does not take it",
        RefusalReason::MayNotBlock => "this station has no right to draw zones for it",
        RefusalReason::Lifted => "somebody has lifted it there; draw it again",
        RefusalReason::Quota => "it keeps too much for this station already",
        other => other.word(),
    }
}
