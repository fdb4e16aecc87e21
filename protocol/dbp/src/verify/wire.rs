//! What is on its way from one node to another.

use std::collections::VecDeque;

use super::row::{Family, Part, Row};
use crate::node::Node;
use crate::{BidAck, BidRecord, NodeName, Occurrence, Presence};

/// Messages from one node to another that have not arrived. Of records and of acknowledgements any may arrive next, and then
/// older ones count no more; of presences only the newest counts; occurrences arrive in order, since holes are repaired.
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
            row.flag(to.has_taken_in(record));
            let since = to.occurred_since(record.applied);
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
}
