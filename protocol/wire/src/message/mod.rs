//! The messages, each in a file of its own: its fields, its keys, who may say it, and its protobuf form.
//!
//! To add one, write its file, its form in `proto/skein.proto`, and its line in the list below.

mod ack;
mod bid;
mod board;
mod event;
mod event_set;
mod field;
mod occurrence;
mod presence;
mod readiness;
mod record;
mod repair;
mod scan;
mod scene;
mod state;

use prost::Message as _;
use skein_dbp::{BidAck, BidRecord, Board, Message, NodeName, Occurrence, Presence, Repair};

pub(crate) use self::field::{Result, node, ns};
pub use self::{
    readiness::{Check, CheckState, Readiness},
    record::{Addressee, Kind, Record},
    scan::Scan,
    scene::{Form, Scene, Solid},
    state::{Echo, MissionState, State},
};
use crate::decode_error::DecodeError;
use crate::proto::{self, MAX_PAYLOAD, VERSION, packet::Body};

/// The list of messages: of each the name that it has in `Packet.body`, and its type. The first ones are those of
/// [`skein_dbp::Message`].
macro_rules! messages {
    (
        protocol: $($said:ident($said_type:ident)),+;
        $($(#[$about:meta])* $other:ident($other_type:ident)),+;
    ) => {
        /// The content of a message.
        ///
        /// ```
        /// use skein_wire::{NodeName, Payload, State};
        /// let state = Payload::State(State::new(NodeName::new("uav/1")?));
        /// assert_eq!(Payload::decode(&state.encode())?, state);
        /// assert!(Payload::decode(b"nonsense").is_err());
        /// # Ok::<(), Box<dyn std::error::Error>>(())
        /// ```
        #[derive(Clone, Debug, PartialEq)]
        #[allow(clippy::large_enum_variant)] // It is taken apart as soon as it is read.
        pub enum Payload {
            /// A message of the protocol between b-programs.
            Message(Message),
            $($(#[$about])* $other($other_type)),+
        }

        /// All kinds of messages.
        pub(crate) const KINDS: &[&Kind] = &[$(&<$said_type>::KIND,)+ $(&<$other_type>::KIND),+];

        impl Payload {
            fn body(&self) -> Body {
                match self {
                    $(Self::Message(Message::$said(record)) => Body::$said(record.into()),)+
                    $(Self::$other(record) => Body::$other(record.into())),+
                }
            }

            fn from_body(body: Body) -> Result<Self> {
                Ok(match body {
                    $(Body::$said(form) => Self::Message(Message::$said(form.try_into()?)),)+
                    $(Body::$other(form) => Self::$other(form.try_into()?)),+
                })
            }

            /// Its kind, and the nodes that it says it is from and for.
            pub(crate) fn heading(&self) -> (&'static Kind, Option<&NodeName>, Option<&NodeName>) {
                fn heading<R: Record>(record: &R) -> (&'static Kind, Option<&NodeName>, Option<&NodeName>) {
                    (&R::KIND, record.sender(), record.recipient())
                }
                match self {
                    $(Self::Message(Message::$said(record)) => heading(record),)+
                    $(Self::$other(record) => heading(record)),+
                }
            }
        }
    };
}

messages! {
    protocol: Bid(BidRecord), Ack(BidAck), Occurrence(Occurrence), Repair(Repair), Presence(Presence);
    /// A vehicle's state.
    State(State),
    /// One turn of a vehicle's lidar.
    Scan(Scan),
    /// A world, for display.
    Scene(Scene),
    /// The bids of all b-threads at a node.
    Board(Board),
    /// A vehicle's checks before take-off.
    Readiness(Readiness);
}

impl Payload {
    /// The payload as bytes; equal payloads give equal bytes.
    pub fn encode(&self) -> Vec<u8> {
        proto::Packet { version: VERSION, body: Some(self.body()) }.encode_to_vec()
    }

    /// Reads a payload. Fields that this version does not know are passed over.
    pub fn decode(bytes: &[u8]) -> Result<Self> {
        if bytes.len() > MAX_PAYLOAD {
            return Err(DecodeError::TooLong { bytes: bytes.len() });
        }
        let packet = proto::Packet::decode(bytes)?;
        if packet.version == 0 || packet.version > VERSION {
            return Err(DecodeError::Version { given: packet.version });
        }
        Self::from_body(field::required("Packet.body", packet.body)?)
    }
}
