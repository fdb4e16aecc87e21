//! What a node tells its own b-threads about the fleet: events under its own name that have simply happened.
//!
//! Facts cannot be blocked, nor requested from afar. Like all events of their home they are numbered and published.
//! Texts are under the key given with each; an event is named by its name.

use skein_bp::{Event, EventSet};

use crate::name::NodeName;

/// The block of `bthread` at its synchronisation point `sync` is acknowledged by every home it concerns (G3).
///
/// It is told only while the b-thread is still at that point. One that moves on with the same block, or with a part of it, is
/// told anew once that has been acknowledged, and may rely on the block all the while, unless [`BLOCK_LAPSED`] is told.
pub const CONFIRMED: &str = "confirmed";
/// The block of `bthread`, once confirmed, is not sure any more at `home`, which has not been heard in time, has lifted it, or
/// has come into the roster and has yet to acknowledge it (G3).
pub const BLOCK_LAPSED: &str = "block_lapsed";
/// `home` does not honour a bid of `bthread`, for `reason`.
pub const REFUSED: &str = "refused";
/// This home does not honour a bid of `bthread` at `node`, for `reason` (G7): what [`REFUSED`] is to the bidder.
pub const DENIED: &str = "denied";
/// `home` has restarted, or is coordinator no more, while `bthread` requested `event` there: it may have occurred or not,
/// and is not asked for again before the b-thread's next synchronisation point (G4).
pub const UNKNOWN: &str = "unknown";
/// `event` of `home` has occurred at the request of `bthread`, which had moved on meanwhile.
pub const ORPHAN: &str = "orphan";
/// The occurrences `from` to `to` of `home` are lost for good (G1).
pub const GAP: &str = "gap";
/// `node` is heard, in this `incarnation`.
pub const PEER_JOINED: &str = "peer_joined";
/// `node` has not been heard for its lease, or has restarted (G5). `released` names, with blanks between, those of its
/// b-threads whose blocks ended here with that, and `held` those whose blocks stay.
pub const PEER_LOST: &str = "peer_lost";
/// This node has heard all `decided` decisions of its `term` from the `coordinator` (G8): told after they were, at the
/// start and after each loss of the coordinator.
pub const IN_STEP: &str = "in_step";
/// `node`, a member of the roster, is in another `term`: nothing can be decided until an operator brings both to one.
pub const OUT_OF_STEP: &str = "out_of_step";
/// An order of a new roster was not taken, for the reason `why`.
pub const ROSTER_REFUSED: &str = "roster_refused";
/// `event` is requested here and blocked `by` a remote b-thread, `node#bthread`.
pub const STALLED: &str = "stalled";
/// `event` is no longer stalled.
pub const UNSTALLED: &str = "unstalled";
/// Another process has this node's name, in this `incarnation`; told every few seconds while it goes on.
pub const DUPLICATE_NAME: &str = "duplicate_name";
/// `bthread` requests `event`, whose home is not in the roster.
pub const UNROUTABLE: &str = "unroutable";
/// `event`, whose home is elsewhere, was handed in here as external.
pub const MISDIRECTED: &str = "misdirected";

const ALL: [&str; 17] = [
    CONFIRMED,
    BLOCK_LAPSED,
    REFUSED,
    DENIED,
    UNKNOWN,
    ORPHAN,
    GAP,
    PEER_JOINED,
    PEER_LOST,
    IN_STEP,
    OUT_OF_STEP,
    ROSTER_REFUSED,
    STALLED,
    UNSTALLED,
    DUPLICATE_NAME,
    UNROUTABLE,
    MISDIRECTED,
];

/// The names of all facts.
pub fn names() -> impl Iterator<Item = &'static str> {
    ALL.into_iter()
}

/// All facts of `node`.
#[must_use]
pub fn all(node: &NodeName) -> EventSet {
    EventSet::any_of(ALL.map(|fact| of(node, fact)))
}

/// The fact of this name at `node`, any data.
#[must_use]
pub fn of(node: &NodeName, fact: &str) -> EventSet {
    EventSet::named(node.event_name(fact))
}

/// [`CONFIRMED`] for one b-thread of `node`: what a b-thread waits for after it has stated its block.
#[must_use]
pub fn confirmed(node: &NodeName, bthread: &str) -> EventSet {
    of(node, CONFIRMED).and(EventSet::field_is("bthread", bthread))
}

/// [`BLOCK_LAPSED`] for one b-thread of `node`.
#[must_use]
pub fn block_lapsed(node: &NodeName, bthread: &str) -> EventSet {
    of(node, BLOCK_LAPSED).and(EventSet::field_is("bthread", bthread))
}

/// The event itself.
pub(crate) fn tell(node: &NodeName, fact: &str) -> Event {
    Event::new(node.event_name(fact))
}

/// A counter as an event's datum.
pub(crate) fn count(number: u64) -> i64 {
    i64::try_from(number).unwrap_or(i64::MAX)
}
