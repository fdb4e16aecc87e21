//! Facts: what a node tells its own b-threads about the fleet. They are events under its own name that have simply
//! happened.
//!
//! Facts cannot be blocked, nor requested from afar. Like all events of their home they are numbered and published.

use std::sync::Arc;

use skein_bp::EventSet;
use skein_bp::catalogue::Events as _;

use crate::message::RefusalReason;
use crate::name::NodeName;

skein_bp::events! {
    /// Every fact.
    pub const FACTS;

    /// The block of a b-thread is acknowledged by every home it concerns (G3). It is told only while the b-thread is
    /// still at that point. One that moves on with the same block, or with a part of it, is told anew once that has
    /// been acknowledged, and may rely on the block all the while, unless `block_lapsed` is told.
    Confirmed = "confirmed", Own {
        bthread: Arc<str>,
        /// Number of the b-thread's synchronisation point.
        sync: u64,
    }
    /// The block of a b-thread, once confirmed, is not sure any more at `home`, which has not been heard in time, has
    /// lifted it, or has come into the roster and has yet to acknowledge it (G3).
    BlockLapsed = "block_lapsed", Own {
        bthread: Arc<str>,
        home: NodeName,
    }
    /// A home does not honour a bid of a b-thread.
    Refused = "refused", Own {
        bthread: Arc<str>,
        home: NodeName,
        reason: RefusalReason,
    }
    /// This home does not honour a bid of a b-thread of another node (G7): what `refused` is to the bidder.
    Denied = "denied", Own {
        node: NodeName,
        bthread: Arc<str>,
        reason: RefusalReason,
        /// The number of others that came with it and are not told one by one; none if it was alone.
        more: Option<u64>,
    }
    /// The home has restarted, or is coordinator no more, while a b-thread requested an event there. The event may have
    /// occurred or not, and is not asked for again before the b-thread's next synchronisation point (G4).
    Unknown = "unknown", Own {
        /// Its name.
        event: Arc<str>,
        bthread: Arc<str>,
        home: NodeName,
    }
    /// An event has occurred at the request of a b-thread that had moved on meanwhile.
    Orphan = "orphan", Own {
        /// Its name.
        event: Arc<str>,
        bthread: Arc<str>,
        home: NodeName,
    }
    /// Occurrences of a home are lost for good (G1).
    Gap = "gap", Own {
        home: NodeName,
        /// Number of the first.
        from: u64,
        /// Number of the last.
        to: u64,
    }
    /// A node is heard.
    PeerJoined = "peer_joined", Own {
        node: NodeName,
        /// Which of its lives this is.
        incarnation: u64,
    }
    /// A node has not been heard for its lease, or has restarted (G5).
    PeerLost = "peer_lost", Own {
        node: NodeName,
        /// Its b-threads whose blocks ended here with that, with blanks between.
        released: Arc<str>,
        /// Its b-threads whose blocks stay, with blanks between.
        held: Option<Arc<str>>,
    }
    /// This node has heard all decisions of its term (G8): told after they were, at the start and after each loss of
    /// the coordinator.
    InStep = "in_step", Own {
        term: u64,
        /// How many decisions there were.
        decided: u64,
        coordinator: NodeName,
    }
    /// A member of the roster is in another term: nothing can be decided until an operator brings both to one.
    OutOfStep = "out_of_step", Own {
        node: NodeName,
        /// Its term.
        term: u64,
    }
    /// An order of a new roster was not taken.
    RosterRefused = "roster_refused", Own {
        why: Arc<str>,
    }
    /// An event is requested here and blocked by a remote b-thread.
    Stalled = "stalled", Own {
        /// Its name.
        event: Arc<str>,
        /// Who blocks it, as `node#bthread`.
        by: Arc<str>,
    }
    /// An event is no longer stalled.
    Unstalled = "unstalled", Own {
        /// Its name.
        event: Arc<str>,
    }
    /// Another process has this node's name; told every few seconds while it goes on.
    DuplicateName = "duplicate_name", Own {
        /// The other's incarnation.
        incarnation: u64,
    }
    /// The disk does not take what must be kept; what depends on that does not happen, and all else does.
    DiskFails = "disk_fails", Own {
        /// The thing to be kept.
        what: Arc<str>,
        why: Arc<str>,
    }
    /// The disk takes it again.
    DiskWorks = "disk_works", Own {
        what: Arc<str>,
    }
    /// A b-thread requests an event whose home is not in the roster.
    Unroutable = "unroutable", Own {
        /// Its name.
        event: Arc<str>,
        bthread: Arc<str>,
    }
    /// An event whose home is elsewhere was handed in here as external.
    Misdirected = "misdirected", Own {
        /// Its name.
        event: Arc<str>,
    }
}

/// All facts of `node`.
pub fn all(node: &NodeName) -> EventSet {
    EventSet::any_of(FACTS.iter().map(|fact| EventSet::named(node.event_name(fact.name))))
}

/// [`Confirmed`] for one b-thread of `node`: what a b-thread waits for after it has stated its block.
pub fn confirmed(node: &NodeName, bthread: &str) -> EventSet {
    Confirmed::any_at(node).and(Confirmed::bthread(bthread))
}

/// [`BlockLapsed`] for one b-thread of `node`.
pub fn block_lapsed(node: &NodeName, bthread: &str) -> EventSet {
    BlockLapsed::any_at(node).and(BlockLapsed::bthread(bthread))
}
