//! Messages as bytes, and back.

use prost::Message as _;
use skein_dbp::{Board, Message};

use crate::{DecodeError, Scan, Scene, State, proto};

/// The version of the messages that this build writes, and the greatest that it reads.
pub const VERSION: u32 = 1;

/// Longest payload that is read, in bytes.
pub const MAX_PAYLOAD: usize = 1 << 20;

/// What travels under a key.
///
/// ```
/// use skein_wire::{NodeName, Payload, State};
/// let state = Payload::State(State::new(NodeName::new("uav/1")?));
/// assert_eq!(Payload::decode(&state.encode())?, state);
/// assert!(Payload::decode(b"nonsense").is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Payload {
    /// A message of the protocol between b-programs.
    Message(Message),
    /// A vehicle's state.
    State(State),
    /// What a vehicle's lidar sees.
    Scan(Scan),
    /// What stands in a world.
    Scene(Scene),
    /// What all b-threads bid at a node.
    Board(Board),
}

impl Payload {
    /// The payload as bytes; equal payloads give equal bytes.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        use proto::packet::Body;
        let body = match self {
            Self::Message(Message::Bid(bid)) => Body::Bid(bid.into()),
            Self::Message(Message::Ack(ack)) => Body::Ack(ack.into()),
            Self::Message(Message::Occurrence(occurrence)) => Body::Occurrence(occurrence.into()),
            Self::Message(Message::Repair(repair)) => Body::Repair(repair.into()),
            Self::Message(Message::Presence(presence)) => Body::Presence(presence.into()),
            Self::State(state) => Body::State(state.into()),
            Self::Scan(scan) => Body::Scan(scan.into()),
            Self::Scene(scene) => Body::Scene(scene.into()),
            Self::Board(board) => Body::Board(board.into()),
        };
        proto::Packet { version: VERSION, body: Some(body) }.encode_to_vec()
    }

    /// Reads a payload. Fields that this version does not know are passed over.
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        use proto::packet::Body;
        if bytes.len() > MAX_PAYLOAD {
            return Err(DecodeError::TooLong { bytes: bytes.len() });
        }
        let packet = proto::Packet::decode(bytes)?;
        if packet.version == 0 || packet.version > VERSION {
            return Err(DecodeError::Version { given: packet.version });
        }
        let message = match packet.body.ok_or(DecodeError::Missing { field: "Packet.body" })? {
            Body::Bid(bid) => Message::Bid(bid.try_into()?),
            Body::Ack(ack) => Message::Ack(ack.try_into()?),
            Body::Occurrence(occurrence) => Message::Occurrence(occurrence.try_into()?),
            Body::Repair(repair) => Message::Repair(repair.try_into()?),
            Body::Presence(presence) => Message::Presence(presence.try_into()?),
            Body::State(state) => return Ok(Self::State(state.try_into()?)),
            Body::Scan(scan) => return Ok(Self::Scan(scan.try_into()?)),
            Body::Scene(scene) => return Ok(Self::Scene(scene.try_into()?)),
            Body::Board(board) => return Ok(Self::Board(board.try_into()?)),
        };
        Ok(Self::Message(message))
    }
}
