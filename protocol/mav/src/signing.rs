//! Signatures of MAVLink 2 frames: <https://mavlink.io/en/guide/message_signing.html>.
//!
//! A signed frame ends with the id of the link, a timestamp and the first 48 bits of SHA-256 of the key, the frame,
//! link and timestamp. Timestamps only grow, so that no frame counts twice.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use mavlink::consts::v2;
use sha2::{Digest as _, Sha256};

use crate::address::Address;

/// From 1970 to the beginning of 2015, from which timestamps count.
const SINCE_1970: Duration = Duration::from_secs(1_420_070_400);
/// A sender that has not been heard before may be so far behind: one minute.
const NEW_STREAM_BEHIND: u64 = 60 * 100_000;
/// The greatest timestamp: 48 bits.
const LAST: u64 = (1 << 48) - 1;

/// A secret that both ends of a link know.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct SigningKey([u8; 32]);

impl SigningKey {
    /// The key that is these bytes.
    pub fn new(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    /// The key that MAVProxy, Mission Planner and QGroundControl make of a passphrase: its SHA-256.
    pub fn of_passphrase(passphrase: &str) -> Self {
        Self(Sha256::digest(passphrase).into())
    }

    /// The key in a file: 32 bytes, or 64 hexadecimal digits with white space around them.
    pub fn of_file(content: &[u8]) -> Option<Self> {
        let digits = content.trim_ascii();
        if digits.len() == 64 {
            let mut key = [0; 32];
            for (byte, pair) in key.iter_mut().zip(digits.chunks_exact(2)) {
                let &[high, low] = pair else { return None };
                let digit = |it: u8| char::from(it).to_digit(16).and_then(|digit| u8::try_from(digit).ok());
                *byte = digit(high)? << 4 | digit(low)?;
            }
            return Some(Self(key));
        }
        content.try_into().ok().map(Self)
    }
}

impl fmt::Debug for SigningKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SigningKey(secret)")
    }
}

/// A timestamp of a signature: units of 10 µs since the beginning of 2015, 48 bits.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct SigningTime(u64);

impl SigningTime {
    /// The time of a clock that tells the time since 1970; zero if it has not been set.
    pub fn of_clock(since_1970: Duration) -> Self {
        Self::default().after(since_1970.saturating_sub(SINCE_1970))
    }

    /// The time of this number of units; 2^48 - 1 is the last.
    pub fn of_units(units: u64) -> Self {
        Self(units.min(LAST))
    }

    /// Units of 10 µs.
    pub fn units(self) -> u64 {
        self.0
    }

    /// This time and so much more.
    #[must_use]
    pub fn after(self, time: Duration) -> Self {
        Self::of_units(self.0.saturating_add(u64::try_from(time.as_micros() / 10).unwrap_or(LAST)))
    }
}

/// One end's part in a link whose frames are signed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Signing {
    pub key: SigningKey,
    /// Tells this sender's links apart.
    pub link_id: u8,
    /// Whether frames without a signature are refused, and not only those with a wrong one.
    pub refuses_unsigned: bool,
    /// The timestamp at the run's time zero: not before any that this sender has ever used.
    pub began: SigningTime,
}

/// Intact frames that were refused, by cause.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Refused {
    /// They had no signature.
    pub unsigned: u64,
    /// Their signature is not of this key.
    pub wrong: u64,
    /// They were signed before another of the same sender that has come, or too long ago: perhaps a recording.
    pub old: u64,
}

impl Refused {
    /// All of them.
    pub fn total(&self) -> u64 {
        self.unsigned + self.wrong + self.old
    }
}

/// Signs what one sender writes.
#[derive(Debug, Clone)]
pub(crate) struct Signer {
    key: SigningKey,
    link_id: u8,
    /// The last timestamp that was used.
    last: SigningTime,
    /// What the next one must be at least.
    least: SigningTime,
}

impl Signer {
    pub(crate) fn new(signing: &Signing) -> Self {
        Self {
            key: signing.key,
            link_id: signing.link_id,
            last: SigningTime::default(),
            least: signing.began,
        }
    }

    /// Signs with this timestamp at least from now on.
    pub(crate) fn not_before(&mut self, time: SigningTime) {
        self.least = self.least.max(time);
    }

    /// The signature of a frame, which is whole but for it.
    pub(crate) fn sign(&mut self, frame: &[u8]) -> [u8; v2::SIGNATURE_SIZE] {
        self.last = SigningTime::of_units(self.last.0 + 1).max(self.least);
        let mut signature = [0; v2::SIGNATURE_SIZE];
        let [t0, t1, t2, t3, t4, t5, ..] = self.last.0.to_le_bytes();
        let said = [self.link_id, t0, t1, t2, t3, t4, t5];
        let value = value(&self.key, frame, &said);
        signature.iter_mut().zip(said.into_iter().chain(value)).for_each(|(place, byte)| *place = byte);
        signature
    }
}

/// Judges what comes.
#[derive(Debug, Clone)]
pub(crate) struct Verifier {
    key: SigningKey,
    refuses_unsigned: bool,
    /// The newest of own time and all that was heard with a right signature.
    newest: SigningTime,
    /// The last timestamp of each sender on each of its links.
    heard: BTreeMap<(Address, u8), SigningTime>,
    refused: Refused,
}

impl Verifier {
    pub(crate) fn new(signing: &Signing) -> Self {
        Self {
            key: signing.key,
            refuses_unsigned: signing.refuses_unsigned,
            newest: signing.began,
            heard: BTreeMap::new(),
            refused: Refused::default(),
        }
    }

    pub(crate) fn not_before(&mut self, time: SigningTime) {
        self.newest = self.newest.max(time);
    }

    pub(crate) fn newest(&self) -> SigningTime {
        self.newest
    }

    pub(crate) fn refused(&self) -> Refused {
        self.refused
    }

    /// Whether a frame counts; one that is not signed has no signature.
    pub(crate) fn admits(&mut self, sender: Address, frame: &[u8], signature: &[u8]) -> bool {
        let (said, [link_id, time @ .., _, _, _, _, _, _]) = (signature.get(..7), signature) else {
            self.refused.unsigned += u64::from(self.refuses_unsigned);
            return !self.refuses_unsigned;
        };
        let expected = value(&self.key, frame, said.unwrap_or_default());
        let differs = expected.iter().zip(signature.iter().skip(7)).fold(0, |all, (a, b)| all | (a ^ b));
        if differs != 0 {
            self.refused.wrong += 1;
            return false;
        }
        let time = SigningTime(time.iter().rev().fold(0, |time, byte| time << 8 | u64::from(*byte)));
        let stream = (sender, *link_id);
        let is_new = match self.heard.get(&stream) {
            Some(last) => time > *last,
            None => time.0.saturating_add(NEW_STREAM_BEHIND) >= self.newest.0,
        };
        if is_new {
            self.heard.insert(stream, time);
            self.newest = self.newest.max(time);
        } else {
            self.refused.old += 1;
        }
        is_new
    }
}

/// The last 48 bits of a signature.
fn value(key: &SigningKey, frame: &[u8], link_and_time: &[u8]) -> [u8; v2::SIGNATURE_VALUE_SIZE] {
    let digest = Sha256::new().chain_update(key.0).chain_update(frame).chain_update(link_and_time).finalize();
    let mut value = [0; v2::SIGNATURE_VALUE_SIZE];
    value.iter_mut().zip(digest).for_each(|(place, byte)| *place = byte);
    value
}
