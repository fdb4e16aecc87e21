//! An event that has occurred at its home, on `occ/<home>`; on `occ/<home>/<node>` when it is repeated for one node.

use std::time::Duration;

use skein_bp::Bound;
use skein_dbp::{NodeName, Occurrence, ServedRequest};

use super::field::{Result, bounded, node, ns, number, required, text, words};
use super::record::{Addressee, Kind, Record};
use crate::decode_error::DecodeError;
use crate::proto;

impl Record for Occurrence {
    const KIND: Kind = Kind {
        word: "occ",
        addressee: Addressee::AllOrOne,
        every_node_listens: true,
        bytes: Bound::OccurrenceBytes,
    };

    fn sender(&self) -> Option<&NodeName> {
        Some(&self.home)
    }
}

impl From<&Occurrence> for proto::Occurrence {
    fn from(occurrence: &Occurrence) -> Self {
        let served = |request: &ServedRequest| proto::ServedRequest {
            node: text(&request.node),
            incarnation: request.incarnation,
            bthread: request.bthread.clone(),
            sync: request.sync,
        };
        let names = Bound::NamesServed.stated();
        Self {
            home: text(&occurrence.home),
            incarnation: occurrence.incarnation,
            seq: occurrence.seq,
            event: Some((&occurrence.event).into()),
            requests_served: occurrence.requests_served.iter().take(names).map(served).collect(),
            requested_by: occurrence
                .requested_by
                .iter()
                .take(names)
                .map(|name| words(name.as_ref()))
                .collect(),
            choice: occurrence.choice.as_deref().unwrap_or_default().into(),
            at_ns: ns(occurrence.at),
            term: occurrence.term,
        }
    }
}

impl TryFrom<proto::Occurrence> for Occurrence {
    type Error = DecodeError;

    fn try_from(occurrence: proto::Occurrence) -> Result<Self> {
        bounded("Occurrence.requests_served", Bound::NamesServed, occurrence.requests_served.len())?;
        bounded("Occurrence.requested_by", Bound::NamesServed, occurrence.requested_by.len())?;
        let served = |request: proto::ServedRequest| -> Result<ServedRequest> {
            bounded("ServedRequest.bthread", Bound::NameBytes, request.bthread.len())?;
            Ok(ServedRequest {
                node: node("ServedRequest.node", &request.node)?,
                incarnation: request.incarnation,
                bthread: request.bthread,
                sync: number("ServedRequest.sync", request.sync, 1)?,
            })
        };
        Ok(Self {
            home: node("Occurrence.home", &occurrence.home)?,
            incarnation: occurrence.incarnation,
            seq: number("Occurrence.seq", occurrence.seq, 1)?,
            term: number("Occurrence.term", occurrence.term, 0)?,
            event: required("Occurrence.event", occurrence.event)?.try_into()?,
            requests_served: occurrence.requests_served.into_iter().map(served).collect::<Result<_>>()?,
            requested_by: occurrence.requested_by.into_iter().map(|name| words(name).into()).collect(),
            choice: (!occurrence.choice.is_empty()).then(|| words(occurrence.choice).into()),
            at: Duration::from_nanos(occurrence.at_ns),
        })
    }
}
