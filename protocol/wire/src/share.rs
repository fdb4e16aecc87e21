//! Each sender's share of a node's time.

use std::collections::BTreeMap;
use std::time::Duration;

use skein_bp::Bound;
use skein_dbp::{BidRecord, NodeName};

use crate::key::Key;

/// Reading and following a message costs about as much as so many bytes, however short it is.
const PER_MESSAGE: usize = 512;
/// A record of bids is read, judged and put on the program's board: each of its bytes costs as much as so many.
const PER_BYTE_OF_BIDS: usize = 4;
/// A share is for so long.
const TICK_MS: u128 = 20;

/// The rest of each sender's share.
#[derive(Debug, Default)]
pub(crate) struct Shares {
    left: BTreeMap<Option<NodeName>, Share>,
    /// When the node looked at its messages last.
    looked: Duration,
    /// The most that a share may be now, bytes.
    full: i64,
}

#[derive(Clone, Copy, Debug)]
struct Share {
    /// Bytes; below zero after a long message.
    left: i64,
    /// When it was added to last.
    at: Duration,
}

impl Shares {
    /// Begins to look at messages. After a pause of the node's own there is a share for each tick that it missed: it must
    /// not act on what is old while the newest waits.
    pub(crate) fn begin(&mut self, now: Duration) {
        let ticks = now.saturating_sub(std::mem::replace(&mut self.looked, now)).as_millis() / TICK_MS;
        let share = i64::try_from(Bound::TickBytes.most()).unwrap_or(i64::MAX);
        self.full = share.saturating_mul(i64::try_from(ticks.max(1)).unwrap_or(i64::MAX));
    }

    /// Uses the share of a member, or that of all others together, for a message of so many bytes, if any of it is left
    /// at `now`. A long message uses what is to come.
    pub(crate) fn take(&mut self, now: Duration, member: Option<&NodeName>, key: &Key, bytes: usize) -> bool {
        let (full, share) = (self.full, i64::try_from(Bound::TickBytes.most()).unwrap_or(i64::MAX));
        let more = |passed_ms: u128| {
            i64::try_from(passed_ms.saturating_mul(share as u128) / TICK_MS).unwrap_or(i64::MAX)
        };
        let member = member.cloned();
        let share = self.left.entry(member).or_insert(Share { left: full, at: now });
        let passed_ms = now.saturating_sub(share.at).as_millis();
        if passed_ms > 0 {
            *share = Share { left: share.left.saturating_add(more(passed_ms)).min(full), at: now };
        }
        let may = share.left > 0;
        if may {
            let per_byte = if key.is_of::<BidRecord>() { PER_BYTE_OF_BIDS } else { 1 };
            share.left -= i64::try_from(per_byte * bytes + PER_MESSAGE).unwrap_or(i64::MAX);
        }
        may
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn key() -> Key {
        "skein/demo/state/uav/1".parse().unwrap()
    }

    #[test]
    fn short_messages_use_a_share_up_and_get_it_back_in_a_tick() {
        let (mut shares, one) = (Shares::default(), NodeName::new("uav/1").unwrap());
        shares.begin(MS);
        let mut taken = |at: Duration| (0..1000).filter(|_| shares.take(at, Some(&one), &key(), 0)).count();
        assert_eq!(taken(MS), 128);
        assert_eq!((taken(MS), taken(11 * MS), taken(31 * MS)), (0, 64, 128));
        assert!(shares.take(31 * MS, None, &key(), 0), "another's share is its own");
    }

    #[test]
    fn a_long_message_is_taken_and_paid_for() {
        let mut shares = Shares::default();
        shares.begin(MS);
        assert!(shares.take(MS, None, &key(), 256 << 10));
        assert!(!shares.take(50 * MS, None, &key(), 0));
        assert!(shares.take(100 * MS, None, &key(), 0));
        let bids: Key = "skein/demo/bid/uav/1/uav/2".parse().unwrap();
        assert!(shares.take(200 * MS, None, &bids, 16 << 10));
        assert!(!shares.take(200 * MS, None, &key(), 0), "a record of 16 KiB is a tick's share");
    }

    #[test]
    fn after_a_pause_of_the_node_there_is_a_share_for_each_tick() {
        let mut shares = Shares::default();
        shares.begin(MS);
        assert!(shares.take(MS, None, &key(), 0));
        shares.begin(201 * MS);
        let taken = (0..10_000).filter(|_| shares.take(201 * MS, None, &key(), 0)).count();
        assert_eq!(taken, 10 * 128);
        shares.begin(221 * MS);
        assert_eq!((0..10_000).filter(|_| shares.take(221 * MS, None, &key(), 0)).count(), 128);
    }
}
