//! A wish to hear some occurrences of a home again, on `repair/<from>/<home>`.

use skein_bp::Bound;
use skein_dbp::{NodeName, Repair};

use super::field::{Result, node, number, text};
use super::record::{Addressee, Kind, Record};
use crate::decode_error::DecodeError;
use crate::proto;

impl Record for Repair {
    const KIND: Kind = Kind {
        word: "repair",
        addressee: Addressee::One,
        every_node_listens: true,
        bytes: Bound::PresenceBytes,
    };

    fn sender(&self) -> Option<&NodeName> {
        Some(&self.requester)
    }

    fn recipient(&self) -> Option<&NodeName> {
        Some(&self.home)
    }
}

impl From<&Repair> for proto::Repair {
    fn from(repair: &Repair) -> Self {
        Self {
            home: text(&repair.home),
            incarnation: repair.incarnation,
            from_seq: repair.from_seq,
            to_seq: repair.to_seq,
            requester: text(&repair.requester),
            term: repair.term,
        }
    }
}

impl TryFrom<proto::Repair> for Repair {
    type Error = DecodeError;

    fn try_from(repair: proto::Repair) -> Result<Self> {
        Ok(Self {
            home: node("Repair.home", &repair.home)?,
            incarnation: repair.incarnation,
            from_seq: number("Repair.from_seq", repair.from_seq, 1)?,
            to_seq: number("Repair.to_seq", repair.to_seq, 1)?,
            term: number("Repair.term", repair.term, 0)?,
            requester: node("Repair.requester", &repair.requester)?,
        })
    }
}
