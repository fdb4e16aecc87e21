//! Frames: MAVLink 1 and 2 packets to and from bytes, whatever carries the bytes.

use std::collections::VecDeque;

use mavlink::dialects::common::MavMessage;
use mavlink::error::ParserError;
use mavlink::{MavlinkVersion, Message, MessageData, calculate_crc, consts};

use crate::address::Address;
use crate::ekf_status;
use crate::signing::{Refused, Signer, Signing, SigningTime, Verifier};

/// One message, and who sent it.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    pub sender: Address,
    /// The sender's packet counter, which wraps at 256.
    pub sequence: u8,
    /// The version of MAVLink that it came in.
    pub version: MavlinkVersion,
    pub message: MavMessage,
}

/// Turns bytes into frames. Bytes that belong to no intact frame are skipped and counted, one at a time, so
/// that a marker inside garbage is never lost.
///
/// Without a key, signed frames are read and their signature is not checked.
///
/// ```
/// use mavlink::dialects::common::HEARTBEAT_DATA;
/// use skein_mav::{Address, FrameReader, FrameWriter};
///
/// let mut writer = FrameWriter::new(Address { system_id: 1, component_id: 191 });
/// writer.write(&HEARTBEAT_DATA::default());
///
/// let mut reader = FrameReader::default();
/// reader.push(b"noise");
/// reader.push(&writer.take());
/// assert_eq!(reader.next_frame().map(|frame| frame.sender.component_id), Some(191));
/// assert_eq!(reader.bad_bytes(), 5);
/// ```
#[derive(Debug, Clone, Default)]
pub struct FrameReader {
    buffer: Vec<u8>,
    /// Bytes of `buffer` already consumed.
    start: usize,
    bad_bytes: u64,
    unknown_messages: u64,
    /// The first of them, until they are taken.
    unread: VecDeque<Unread>,
    verifier: Option<Verifier>,
}

/// Messages kept whose content is not known; more are dropped.
const MAX_UNREAD: usize = 64;

/// An intact frame whose content is not in the common dialect.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Unread {
    pub(crate) sender: Address,
    pub(crate) message_id: u32,
    /// A MAVLink 2 frame leaves out the zeros at its end.
    pub(crate) payload: Vec<u8>,
}

/// The front of the buffer.
enum Candidate {
    /// Not a frame: skip one byte.
    Garbage,
    /// Perhaps a frame, once more bytes are here.
    Incomplete,
    /// An intact frame of this length.
    Intact(Layout),
}

/// The layout of an intact frame.
struct Layout {
    version: MavlinkVersion,
    sender: Address,
    sequence: u8,
    message_id: u32,
    payload: std::ops::Range<usize>,
    /// Where the signature begins, or the frame ends.
    signature_start: usize,
    frame_len: usize,
}

impl FrameReader {
    /// A reader that refuses frames by their signature, and counts them.
    pub fn signed(signing: &Signing) -> Self {
        Self { verifier: Some(Verifier::new(signing)), ..Self::default() }
    }

    /// Tells the time by which senders that are heard first are judged.
    pub fn not_before(&mut self, time: SigningTime) {
        if let Some(verifier) = &mut self.verifier {
            verifier.not_before(time);
        }
    }

    /// The newest timestamp that was told, or heard with a right signature.
    pub fn newest_signing_time(&self) -> SigningTime {
        self.verifier.as_ref().map_or(SigningTime::default(), Verifier::newest)
    }

    /// Intact frames refused so far.
    pub fn refused(&self) -> Refused {
        self.verifier.as_ref().map_or(Refused::default(), Verifier::refused)
    }

    /// Takes in bytes as they came.
    pub fn push(&mut self, bytes: &[u8]) {
        self.buffer.drain(..self.start);
        self.start = 0;
        self.buffer.extend_from_slice(bytes);
    }

    /// The next intact frame whose message the common dialect knows, or `None` until more bytes come.
    pub fn next_frame(&mut self) -> Option<Frame> {
        loop {
            self.skip_to_marker();
            let bytes = self.buffer.get(self.start..).unwrap_or_default();
            match examine(bytes) {
                Candidate::Incomplete => return None,
                Candidate::Garbage => self.skip(1),
                Candidate::Intact(layout) => {
                    let (frame, signature) = bytes
                        .get(..layout.frame_len)
                        .and_then(|frame| frame.split_at_checked(layout.signature_start))
                        .unwrap_or_default();
                    let verifier = self.verifier.as_mut();
                    if verifier.is_some_and(|it| !it.admits(layout.sender, frame, signature)) {
                        self.start += layout.frame_len;
                        continue;
                    }
                    let payload = bytes.get(layout.payload).unwrap_or_default();
                    let parsed = parse(layout.version, layout.message_id, payload);
                    if parsed.is_none() && self.unread.len() < MAX_UNREAD {
                        let Layout { sender, message_id, .. } = layout;
                        self.unread.push_back(Unread { sender, message_id, payload: payload.to_vec() });
                    }
                    self.start += layout.frame_len;
                    let Layout { sender, sequence, version, .. } = layout;
                    match parsed {
                        Some(message) => return Some(Frame { sender, sequence, version, message }),
                        None => self.unknown_messages += 1,
                    }
                }
            }
        }
    }

    /// Bytes skipped so far because they belonged to no intact frame of a known message.
    pub fn bad_bytes(&self) -> u64 {
        self.bad_bytes
    }

    /// Intact frames skipped so far because their content is not in the common dialect.
    pub fn unknown_messages(&self) -> u64 {
        self.unknown_messages
    }

    /// The next message whose content is not known.
    pub(crate) fn next_unread(&mut self) -> Option<Unread> {
        self.unread.pop_front()
    }

    fn skip_to_marker(&mut self) {
        let rest = self.buffer.get(self.start..).unwrap_or_default();
        let is_marker = |byte: &u8| *byte == mavlink::MAV_STX || *byte == mavlink::MAV_STX_V2;
        let garbage = rest.iter().position(is_marker).unwrap_or(rest.len());
        self.skip(garbage);
    }

    fn skip(&mut self, bytes: usize) {
        self.start += bytes;
        self.bad_bytes += bytes as u64;
    }
}

/// Reads the front of `bytes`, which is empty or begins with a marker.
fn examine(bytes: &[u8]) -> Candidate {
    let (version, header_len, signature_len) = match *bytes {
        [mavlink::MAV_STX, ..] => (MavlinkVersion::V1, consts::v1::HEADER_SIZE, 0),
        [mavlink::MAV_STX_V2, _, 0, ..] => (MavlinkVersion::V2, consts::v2::MIN_HEADER_SIZE, 0),
        [mavlink::MAV_STX_V2, _, consts::v2::IFLAG_SIGNED, ..] => {
            (MavlinkVersion::V2, consts::v2::MIN_HEADER_SIZE, consts::v2::SIGNATURE_SIZE)
        }
        // Incompatible by its own word.
        [mavlink::MAV_STX_V2, _, _, ..] => return Candidate::Garbage,
        _ => return Candidate::Incomplete,
    };
    let payload_start = consts::STX_SIZE + header_len;
    let payload_len = bytes.get(consts::PAYLOAD_LEN_OFFSET).map_or(0, |len| usize::from(*len));
    let checksum_start = payload_start + payload_len;
    let frame_len = checksum_start + consts::CHECKSUM_SIZE + signature_len;
    let Some(frame) = bytes.get(..frame_len) else {
        return Candidate::Incomplete;
    };
    let (sequence, system_id, component_id, message_id) = match (version, frame) {
        (MavlinkVersion::V1, [_, _, sequence, system, component, id, ..]) => {
            (*sequence, *system, *component, u32::from(*id))
        }
        (MavlinkVersion::V2, [_, _, _, _, sequence, system, component, a, b, c, ..]) => {
            (*sequence, *system, *component, u32::from_le_bytes([*a, *b, *c, 0]))
        }
        _ => return Candidate::Garbage,
    };
    let (Some(covered), Some(&[low, high])) = (
        frame.get(consts::STX_SIZE..checksum_start),
        frame.get(checksum_start..checksum_start + consts::CHECKSUM_SIZE),
    ) else {
        return Candidate::Garbage;
    };
    let extra_crc = match message_id {
        ekf_status::ID => ekf_status::EXTRA_CRC,
        id => MavMessage::extra_crc(id),
    };
    if calculate_crc(covered, extra_crc) != u16::from_le_bytes([low, high]) {
        return Candidate::Garbage;
    }
    Candidate::Intact(Layout {
        version,
        sender: Address { system_id, component_id },
        sequence,
        message_id,
        payload: payload_start..checksum_start,
        signature_start: checksum_start + consts::CHECKSUM_SIZE,
        frame_len,
    })
}

/// Reads a payload. A number that is newer than its enumeration becomes 0, "unknown" in what a sender reports of
/// itself; said to somebody, 0 could be another order or answer, so that such a message is none.
fn parse(version: MavlinkVersion, message_id: u32, payload: &[u8]) -> Option<MavMessage> {
    if message_id == ekf_status::ID {
        return Some(MavMessage::ESTIMATOR_STATUS(ekf_status::parse(payload)));
    }
    let mut payload = payload.to_vec();
    let mut is_whole = true;
    loop {
        match MavMessage::parse(version, message_id, &payload) {
            Ok(message) => return Some(message).filter(|it| is_whole || it.target_system_id().is_none()),
            Err(ParserError::InvalidEnum { enum_type, value }) => {
                is_whole = false;
                payload = without(version, message_id, &payload, (enum_type, value))?;
            }
            Err(_) => return None,
        }
    }
}

/// The payload with 0 in place of this value of an enumeration: wherever the value stands, it is the field if the
/// parser then complains no more, or of something else. None if no place does.
fn without(
    version: MavlinkVersion,
    message_id: u32,
    payload: &[u8],
    unknown: (&'static str, u64),
) -> Option<Vec<u8>> {
    let value = unknown.1.to_le_bytes();
    let width = value.iter().rposition(|byte| *byte != 0)? + 1;
    let places = payload.windows(width).enumerate().filter(|(_, window)| value.starts_with(window));
    places.map(|(at, _)| at).find_map(|at| {
        let mut changed = payload.to_vec();
        changed.get_mut(at..at + width)?.fill(0);
        match MavMessage::parse(version, message_id, &changed) {
            Err(ParserError::InvalidEnum { enum_type, value }) if (enum_type, value) == unknown => None,
            Err(ParserError::InvalidEnum { value: 0, .. }) => None,
            _ => Some(changed),
        }
    })
}

/// Turns messages into frames of one sender, and collects the bytes.
#[derive(Debug, Clone)]
pub struct FrameWriter {
    sender: Address,
    version: MavlinkVersion,
    sequence: u8,
    buffer: Vec<u8>,
    signer: Option<Signer>,
}

impl FrameWriter {
    /// A writer for MAVLink 2 frames from `sender`.
    pub fn new(sender: Address) -> Self {
        Self { sender, version: MavlinkVersion::V2, sequence: 0, buffer: Vec::new(), signer: None }
    }

    /// The same writer, whose MAVLink 2 frames are signed.
    #[must_use]
    pub fn signed(self, signing: &Signing) -> Self {
        Self { signer: Some(Signer::new(signing)), ..self }
    }

    /// Signs with this timestamp at least from now on.
    pub fn not_before(&mut self, time: SigningTime) {
        if let Some(signer) = &mut self.signer {
            signer.not_before(time);
        }
    }

    pub fn sender(&self) -> Address {
        self.sender
    }

    /// Writes in this version of MAVLink from now on.
    pub fn speak(&mut self, version: MavlinkVersion) {
        self.version = version;
    }

    /// Appends one message. MAVLink 1 has no frame for a message whose number is above 255: then nothing is written.
    pub fn write<D: MessageData>(&mut self, message: &D) {
        let mut payload = [0; consts::MAX_PAYLOAD_LEN];
        let payload_len = message.ser(self.version, &mut payload);
        self.write_payload((D::ID, D::EXTRA_CRC), payload.get(..payload_len).unwrap_or_default());
    }

    /// The same of a message whose number and checksum's seed are these.
    pub(crate) fn write_payload(&mut self, (message_id, extra_crc): (u32, u8), payload: &[u8]) {
        let [id0, id1, id2, _] = message_id.to_le_bytes();
        let Address { system_id, component_id } = self.sender;
        let (len, sequence) = (payload.len() as u8, self.sequence);
        let frame_start = self.buffer.len();
        match (self.version, id1, id2) {
            (MavlinkVersion::V2, ..) => self.buffer.extend_from_slice(&[
                mavlink::MAV_STX_V2,
                len,
                if self.signer.is_some() { consts::v2::IFLAG_SIGNED } else { 0 },
                0,
                sequence,
                system_id,
                component_id,
                id0,
                id1,
                id2,
            ]),
            (MavlinkVersion::V1, 0, 0) => {
                self.buffer.extend_from_slice(&[
                    mavlink::MAV_STX,
                    len,
                    sequence,
                    system_id,
                    component_id,
                    id0,
                ]);
            }
            (MavlinkVersion::V1, ..) => return,
        }
        self.buffer.extend_from_slice(payload);
        let covered = self.buffer.get(frame_start + 1..).unwrap_or_default();
        let crc = calculate_crc(covered, extra_crc);
        self.buffer.extend_from_slice(&crc.to_le_bytes());
        if let (MavlinkVersion::V2, Some(signer)) = (self.version, &mut self.signer) {
            let signature = signer.sign(self.buffer.get(frame_start..).unwrap_or_default());
            self.buffer.extend_from_slice(&signature);
        }
        self.sequence = self.sequence.wrapping_add(1);
    }

    /// Whether nothing is waiting to be sent.
    pub fn is_empty(&self) -> bool {
        self.buffer.is_empty()
    }

    /// Takes the bytes written since the last call.
    pub fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.buffer)
    }
}
