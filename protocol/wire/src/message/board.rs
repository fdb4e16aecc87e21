//! A node's board: the bids of all b-threads there, on `board/<node>`. Only ground stations listen.

use std::time::Duration;

use skein_bp::{Bound, EventSet};
use skein_dbp::{Board, BoardLease, BoardRequest, BoardRow, NodeName};

use super::field::{Result, node, ns, required, text};
use super::record::{Addressee, Kind, Record};
use crate::decode_error::DecodeError;
use crate::proto;

impl Record for Board {
    const KIND: Kind = Kind {
        word: "board",
        addressee: Addressee::All,
        every_node_listens: false,
        bytes: Bound::BoardBytes,
    };

    fn sender(&self) -> Option<&NodeName> {
        Some(&self.node)
    }
}

impl From<&Board> for proto::Board {
    fn from(board: &Board) -> Self {
        Self {
            node: text(&board.node),
            incarnation: board.incarnation,
            time_ns: ns(board.at),
            rows: board.rows.iter().map(Into::into).collect(),
            left_out: board.left_out,
        }
    }
}

impl TryFrom<proto::Board> for Board {
    type Error = DecodeError;

    /// A board that exceeds the quotas is cut here too: a board decides nothing, and part of it is better than none.
    fn try_from(board: proto::Board) -> Result<Self> {
        let rows =
            board.rows.into_iter().take(Self::MAX_ROWS).map(BoardRow::try_from).collect::<Result<_>>()?;
        let cut = Self::new(
            node("Board.node", &board.node)?,
            board.incarnation,
            Duration::from_nanos(board.time_ns),
            rows,
        );
        Ok(Self { left_out: board.left_out, ..cut })
    }
}

impl From<&BoardRow> for proto::BoardRow {
    fn from(row: &BoardRow) -> Self {
        let some = |set: &EventSet| (!set.is_none()).then(|| set.into());
        let request = |request: &BoardRequest| proto::BoardRequest {
            event: Some((&request.event).into()),
            blocked_by: request.blocked_by.clone(),
        };
        Self {
            bthread: row.bthread.clone(),
            requests: row.requests.iter().map(request).collect(),
            waits: some(&row.waits),
            blocks: some(&row.blocks),
            interrupts: some(&row.interrupts),
            states: row.states.iter().map(Into::into).collect(),
            priority: row.priority,
            deadline_ns: row.deadline.map(ns),
            lease_age_ns: row.lease.map(|lease| ns(lease.age)),
            lease_ns: row.lease.map(|lease| ns(lease.length)),
            cut: row.cut,
        }
    }
}

impl TryFrom<proto::BoardRow> for BoardRow {
    type Error = DecodeError;

    fn try_from(row: proto::BoardRow) -> Result<Self> {
        let set = |set: Option<proto::EventSet>| set.map_or(Ok(EventSet::None), EventSet::try_from);
        let request = |request: proto::BoardRequest| -> Result<BoardRequest> {
            let event = required("BoardRequest.event", request.event)?.try_into()?;
            Ok(BoardRequest { event, blocked_by: request.blocked_by })
        };
        let lease = row.lease_age_ns.zip(row.lease_ns);
        Ok(Self {
            bthread: row.bthread,
            requests: row.requests.into_iter().map(request).collect::<Result<_>>()?,
            waits: set(row.waits)?,
            blocks: set(row.blocks)?,
            interrupts: set(row.interrupts)?,
            states: row.states.into_iter().map(TryInto::try_into).collect::<Result<_>>()?,
            priority: row.priority,
            deadline: row.deadline_ns.map(Duration::from_nanos),
            lease: lease.map(|(age, length)| BoardLease {
                age: Duration::from_nanos(age),
                length: Duration::from_nanos(length),
            }),
            cut: row.cut,
        })
    }
}
