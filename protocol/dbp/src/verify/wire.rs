//! The messages on their way from one node to another.

use std::collections::VecDeque;

use crate::message::{BidAck, BidRecord, Message, Occurrence, Presence};
use crate::name::NodeName;
use crate::node::Node;
use crate::verify::row::{Family, Part, Row};
use crate::verify::step::Cargo;

/// Messages from one node to another that have not arrived. Of records and of acknowledgements any may arrive next, and
/// then older ones count no more; of presences only the newest counts; occurrences arrive in order, since holes are
/// repaired.
#[derive(Clone, Debug, Default)]
pub(super) struct Wire {
    pub(super) records: Vec<BidRecord>,
    pub(super) acks: Vec<BidAck>,
    pub(super) occurrences: VecDeque<Occurrence>,
    pub(super) presence: Option<Presence>,
}

impl Wire {
    pub(super) fn write_standing(&self, row: &mut Row<'_>, from: &NodeName, to: &Node) {
        row.list(&self.records, |row, record| {
            row.plain(record.incarnation);
            row.optional(record.home_incarnation);
            row.number(Family::Epoch(from.clone(), record.incarnation, to.name().clone()), record.epoch);
            // A copy that has been taken in does not count again, but a newer one of the same content does.
            row.flag(to.home.has_taken_in(record));
            let since = to.home.occurred_since(record.applied);
            row.list(&record.bids, |row, bid| {
                row.bid(from, record.incarnation, bid);
                // All that the home will ask of what has occurred since the record was made.
                row.flag(since.iter().any(|event| bid.requests.contains(event)));
            });
        });
        row.list(&self.acks, |row, ack| {
            row.plain(ack.incarnation);
            row.plain(ack.home_incarnation);
            row.number(Family::Epoch(to.name().clone(), ack.incarnation, from.clone()), ack.epoch);
            row.list(&ack.refused, |row, refusal| row.refusal(to.name(), ack.incarnation, refusal));
        });
        row.list(&self.occurrences, |row, occurrence| {
            row.plain(occurrence.incarnation);
            row.number(Family::Seq(from.clone(), occurrence.incarnation), occurrence.seq);
            row.part(Part::Event(occurrence.event.clone()));
            row.list(&occurrence.requests_served, |row, served| {
                row.text(served.node.as_str());
                row.plain(served.incarnation);
                row.text(&served.bthread);
                row.number(
                    Family::Sync(served.node.clone(), served.incarnation, served.bthread.clone()),
                    served.sync,
                );
            });
        });
        row.list(&self.presence, |row, presence| row.plain(presence.incarnation));
    }

    /// All that may arrive next.
    pub(super) fn arrivals(&self) -> impl Iterator<Item = Cargo> {
        let records = (0..self.records.len()).map(Cargo::Record);
        let acks = (0..self.acks.len()).map(Cargo::Ack);
        let occurrence = self.occurrences.front().map(|_| Cargo::Occurrence);
        records.chain(acks).chain(occurrence).chain(self.presence.as_ref().map(|_| Cargo::Presence))
    }

    /// Takes off a message, and those that it overtakes.
    pub(super) fn unload(&mut self, cargo: Cargo) -> Option<Message> {
        match cargo {
            Cargo::Record(at) => self.records.drain(..=at).next_back().map(Message::Bid),
            Cargo::Ack(at) => self.acks.drain(..=at).next_back().map(Message::Ack),
            Cargo::Occurrence => self.occurrences.pop_front().map(Message::Occurrence),
            Cargo::Presence => self.presence.take().map(Message::Presence),
        }
    }

    /// Puts a message on its way; without `delay`, those before it are overtaken at once.
    pub(super) fn load(&mut self, message: Message, delay: bool) {
        match message {
            Message::Bid(record) => {
                self.records.retain(|older| delay && !is_copy(older, &record));
                self.records.push(record);
            }
            Message::Ack(ack) => {
                let content = |ack: &BidAck| (ack.home_incarnation, ack.incarnation, ack.epoch);
                self.acks.retain(|older| delay && content(older) != content(&ack));
                self.acks.push(ack);
            }
            Message::Occurrence(occurrence) => self.occurrences.push_back(occurrence),
            // Nothing that a wire holds is lost for good, so no wish to hear it again is needed, and a sign of life
            // says nothing new but where it is put by hand.
            Message::Presence(_) | Message::Repair(_) => {}
        }
    }

    /// Puts a message that was taken off back on its way, as the wire was `before`: with those that it had overtaken,
    /// and behind it those that were sent since.
    pub(super) fn reload(&mut self, cargo: Cargo, before: &Self) {
        match cargo {
            Cargo::Record(_) => {
                let since = std::mem::replace(&mut self.records, before.records.clone());
                let is_new = |record: &BidRecord| !before.records.iter().any(|old| is_copy(old, record));
                self.records.extend(since.into_iter().filter(is_new));
            }
            Cargo::Ack(_) => {
                let since = std::mem::replace(&mut self.acks, before.acks.clone());
                self.acks.extend(since.into_iter().filter(|ack| !before.acks.contains(ack)));
            }
            Cargo::Occurrence => {
                if let Some(again) = before.occurrences.front() {
                    self.occurrences.push_front(again.clone());
                }
            }
            Cargo::Presence => {}
        }
    }
}

/// Whether two records have the same content.
fn is_copy(one: &BidRecord, other: &BidRecord) -> bool {
    (one.incarnation, one.epoch) == (other.incarnation, other.epoch)
}
