//! The messages between nodes.
//!
//! Bids travel as *state*: a lost, repeated or overtaken record does no harm, because the newest one says all.
//! Occurrences travel as a numbered *stream* with a history behind it.

use std::sync::Arc;
use std::time::Duration;

use skein_bp::{Bound, Event, EventSet, Exceeded};

use crate::board::size_of_event;
use crate::name::NodeName;

/// Whom a message is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Recipient {
    Node(NodeName),
    /// Every node of the fleet.
    All,
}

/// Any message between nodes.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// The bids of a node's b-threads for events of one home; to that home.
    Bid(BidRecord),
    /// A home has taken in a record; to its sender.
    Ack(BidAck),
    /// An event has occurred at its home; to all, or to the one that asked for a repair.
    Occurrence(Occurrence),
    /// A node misses occurrences of a home; to that home.
    Repair(Repair),
    /// A node lives, and its stream has come this far; to all.
    Presence(Presence),
}

impl Message {
    pub fn sender(&self) -> &NodeName {
        match self {
            Self::Bid(bid) => &bid.node,
            Self::Ack(ack) => &ack.home,
            Self::Occurrence(occurrence) => &occurrence.home,
            Self::Repair(repair) => &repair.requester,
            Self::Presence(presence) => &presence.node,
        }
    }
}

/// The newest bids of one node's b-threads for the events of one home.
#[derive(Clone, Debug, PartialEq)]
pub struct BidRecord {
    pub node: NodeName,
    /// The bidder's incarnation: a durable counter that grows with each of its starts.
    pub incarnation: u64,
    /// Whom the record is for.
    pub home: NodeName,
    /// The incarnation of the home that the requests are meant for; none while it is not known.
    ///
    /// A home serves requests only if they are meant for its present life (G4); blocks hold in any.
    pub home_incarnation: Option<u64>,
    /// Number of this content, growing; a renewal repeats it.
    pub epoch: u64,
    /// When this copy was sent, on the bidder's clock; the acknowledgement returns it.
    pub sent_at: Duration,
    /// Highest number of the home's occurrences that the bidder had applied when this copy was sent.
    pub applied: u64,
    /// The term that the bidder is in, 0 without joint events. A home in a later term does not listen (G8).
    pub term: u64,
    /// Highest number of that term's decisions that the bidder had applied.
    pub decided: u64,
    /// The time for which the bids hold without renewal, in milliseconds.
    pub lease_ms: u64,
    /// One bid for each b-thread that requests or blocks something there.
    pub bids: Vec<RemoteBid>,
}

/// One b-thread's bid for the events of another node.
#[derive(Clone, Debug, PartialEq)]
pub struct RemoteBid {
    pub bthread: String,
    /// Its synchronisation point: grows each time the b-thread moves on, in one incarnation of its node.
    pub sync: u64,
    /// The events it requests, all of this home.
    pub requests: Vec<Event>,
    /// The events that it blocks; only the home's own count.
    pub block: EventSet,
    /// The synchronisation point since which it has blocked no less than that: `sync` or an earlier one. What an
    /// authority lifts stays lifted while the b-thread moves on with it.
    pub block_since: u64,
    /// Its priority under the `sync_priority` strategy.
    pub priority: Option<i32>,
    /// The fate of the block when the bidder is lost.
    pub on_loss: OnLoss,
}

impl BidRecord {
    /// Lets through what a record from another node may be. One that is too much does not count at all, so that its
    /// sender may rely on nothing in it.
    ///
    /// # Errors
    /// [`Exceeded`], which names the bound.
    pub fn check_bounds(&self) -> Result<(), Exceeded> {
        Bound::RecordBids.check(self.bids.len())?;
        let (mut requests, mut nodes) = (0, 0);
        for bid in &self.bids {
            Bound::NameBytes.check(bid.bthread.len())?;
            let extent = bid.block.extent();
            Bound::AskedDepth.check(extent.depth)?;
            requests += bid.requests.len();
            // A bid that blocks nothing has a set too.
            nodes += if bid.block == EventSet::None { 0 } else { extent.nodes };
        }
        Bound::RecordRequests.check(requests)?;
        Bound::RecordNodes.check(nodes)
    }
}

impl RemoteBid {
    /// Whether a home takes it in at this place, counted from 0, among its sender's bids there.
    pub fn is_within_quota(&self, place: usize) -> bool {
        place < Bound::HonouredBids.most() && self.requests.len() <= Bound::BidRequests.most()
    }
}

/// The fate of a block when its holder is lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnLoss {
    /// It lapses with the lease.
    #[default]
    Release,
    /// It stays until an authority lifts it; a home without durable store refuses it.
    Hold,
}

/// A home's answer to a record.
#[derive(Clone, Debug, PartialEq)]
pub struct BidAck {
    /// The home that answers.
    pub home: NodeName,
    pub home_incarnation: u64,
    pub node: NodeName,
    /// The bidder's incarnation.
    pub incarnation: u64,
    /// The content that was taken in.
    pub epoch: u64,
    /// `sent_at` of the copy that was taken in.
    pub sent_at: Duration,
    /// The number of the home's latest occurrence.
    pub latest_seq: u64,
    /// The bids, or parts of bids, that the home does not honour.
    pub refused: Vec<Refusal>,
}

/// A bid, or a part of one, that a home does not honour.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The b-thread whose bid it is.
    pub bthread: String,
    pub sync: u64,
    pub reason: RefusalReason,
}

skein_bp::words! {
    /// Why a home does not honour a bid.
    pub enum RefusalReason {
        /// For a reason that this version has no word for.
        Unspecified = "unspecified",
        /// It requests a safety event from afar, past the gateway (G6).
        Safety = "safety",
        /// It requests an event that has its home elsewhere.
        NotHome = "not_home",
        /// It asks to be held after its owner's loss, and this home has no durable store to keep it in.
        HoldUnsupported = "hold_unsupported",
        /// Its lease is longer than this home grants.
        LeaseTooLong = "lease_too_long",
        /// It requests an event by which this home tells facts about itself, see [`facts`](crate::facts).
        Reserved = "reserved",
        /// Its sender has no right to request this here (G7).
        MayNotRequest = "may_not_request",
        /// Its sender has no right to block all of this here (G7).
        MayNotBlock = "may_not_block",
        /// An authority has lifted the block since.
        Lifted = "lifted",
        /// It exceeds the number of bids or requests that one node may have here.
        Quota = "quota",
    }
}

impl RefusalReason {
    /// Whether a bid refused for this reason blocks nothing.
    pub fn voids_block(self) -> bool {
        matches!(
            self,
            Self::Unspecified
                | Self::HoldUnsupported
                | Self::LeaseTooLong
                | Self::MayNotBlock
                | Self::Lifted
                | Self::Quota
        )
    }
}

/// One request that an occurrence has served: at most once for each of these (G4).
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ServedRequest {
    /// The node that requested.
    pub node: NodeName,
    pub incarnation: u64,
    /// The b-thread that requested.
    pub bthread: String,
    pub sync: u64,
}

/// An event that has occurred at its home. It cannot be taken back, nor blocked by who hears of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Occurrence {
    pub home: NodeName,
    /// In which life of the home.
    pub incarnation: u64,
    /// Its number there: 1, 2, 3, ... without holes.
    pub seq: u64,
    /// For a joint event the term in which it was decided, and then the number counts the term's decisions (G8); else
    /// 0.
    pub term: u64,
    pub event: Event,
    pub requests_served: Vec<ServedRequest>,
    /// The b-threads that requested it, as the home names them: remote ones as `node#bthread`. For people.
    pub requested_by: Vec<Arc<str>>,
    /// Why this event and no other: its priority, and the requests that it went before. For people.
    pub choice: Option<Arc<str>>,
    /// When, on the home's clock; for display only.
    pub at: Duration,
}

impl Occurrence {
    /// About how many bytes it takes to keep.
    pub(crate) fn weight(&self) -> usize {
        let served =
            self.requests_served.iter().map(|request| size_of::<ServedRequest>() + request.bthread.len());
        let names = self.requested_by.iter().map(|name| size_of::<Arc<str>>() + name.len());
        size_of::<Self>() + size_of_event(&self.event) + served.chain(names).sum::<usize>()
    }
}

/// A wish to hear some occurrences again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Repair {
    pub home: NodeName,
    pub incarnation: u64,
    /// First number missed.
    pub from_seq: u64,
    /// Last number missed.
    pub to_seq: u64,
    /// The term whose decisions are missed; 0 for the home's other occurrences.
    pub term: u64,
    pub requester: NodeName,
}

/// A sign of life, from which others see also the loss of a stream's tail.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Presence {
    pub node: NodeName,
    pub incarnation: u64,
    /// The time for which it has been up. A node that was there before wants its stream from the start.
    pub up: Duration,
    /// The number of its latest occurrence, 0 before the first.
    pub latest_seq: u64,
    /// The number of the oldest occurrence that it can still repeat.
    pub oldest_seq: u64,
    /// Without a word for so long, it counts as lost; in milliseconds.
    pub lease_ms: u64,
    /// Its word on joint events; none if it takes part in none.
    pub joint: Option<JointWord>,
}

/// A node's word on joint events, in its sign of life (G8).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JointWord {
    pub term: u64,
    /// The coordinator: how many decisions the term has seen; a member: how many of them it has applied.
    pub decided: u64,
    /// A member: `up` of the coordinator's newest sign of life that it had heard.
    pub heard: Option<Duration>,
    /// The coordinator: whether it wants every member's word at once.
    pub asks: bool,
}
