//! A move of a network.

use skein_bp::Event;

use crate::name::NodeName;

/// A sender and a receiver, or the holder of a lease and the home that grants it.
pub(super) type Pair = (NodeName, NodeName);

/// Something that happens to a node.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum Step {
    /// Its b-threads begin.
    Begin(NodeName),
    Arrival(Pair, Cargo),
    /// A message arrives, and will arrive again.
    Twice(Pair, Cargo),
    /// Nothing arrives between two nodes any more.
    Cut(Pair),
    /// It does again.
    Heal(Pair),
    /// The holder of a lease can no longer be sure of the home.
    HoldLapses(Pair),
    /// The home lets go of the holder's bids, while it still counts it as alive: a sign of life has come since.
    BidsLapse(Pair),
    /// The home lets go, and counts the holder as lost.
    LeaseLapses(Pair),
    GuardEnds(NodeName),
    /// The deadline of a b-thread passes.
    Deadline(NodeName, String),
    Restart(NodeName),
}

/// A message on a wire that may arrive next. With a record of bids or an acknowledgement at a place of the wire, those
/// before it count no more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Cargo {
    Record(usize),
    Ack(usize),
    Occurrence,
    Presence,
}

impl Step {
    /// The kind of move by which a deadline passes.
    pub(super) const DEADLINE: &str = "deadline";

    /// The move as it is shown to people.
    pub(super) fn shown(&self) -> Event {
        Event::new(match self {
            Self::Begin(node) => format!("{node} begins"),
            Self::Arrival(pair, cargo) => cargo.shown(pair),
            Self::Twice(pair, cargo) => format!("{} (and may again)", cargo.shown(pair)),
            Self::Cut((one, other)) => format!("{one} and {other} are cut off from one another"),
            Self::Heal((one, other)) => format!("{one} and {other} are joined again"),
            Self::HoldLapses((holder, home)) => format!("{holder} is no longer sure of {home}"),
            Self::BidsLapse((holder, home)) => format!("{home} lets go of what {holder} bids"),
            Self::LeaseLapses((holder, home)) => {
                format!("{home} lets go of what {holder} bids, and counts it as lost")
            }
            Self::GuardEnds(node) => format!("{node} has waited for the longest lease"),
            Self::Deadline(node, bthread) => format!("the deadline of {node}#{bthread} passes"),
            Self::Restart(node) => format!("{node} restarts"),
        })
    }

    /// The kind of move that it is.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::Begin(_) => "beginning",
            Self::Arrival(_, Cargo::Record(1..)) => "loss of older bids",
            Self::Arrival(_, Cargo::Ack(1..)) => "loss of older acknowledgements",
            Self::Arrival(..) => "arrival",
            Self::Twice(..) => "repetition",
            Self::Cut(_) => "partition",
            Self::Heal(_) => "end of a partition",
            Self::HoldLapses(_) | Self::BidsLapse(_) | Self::LeaseLapses(_) => "lapse",
            Self::GuardEnds(_) => "end of a guard",
            Self::Deadline(..) => Self::DEADLINE,
            Self::Restart(_) => "restart",
        }
    }

    /// The move that was due and has come about with this one. Whatever stays on its way arrives, partitions end, and
    /// time passes, sooner or later, unless something forestalls it.
    pub(super) fn due(&self) -> Option<Self> {
        match self {
            Self::Arrival(pair, cargo) | Self::Twice(pair, cargo) => {
                let any = match cargo {
                    Cargo::Record(_) => Cargo::Record(0),
                    Cargo::Ack(_) => Cargo::Ack(0),
                    Cargo::Occurrence | Cargo::Presence => *cargo,
                };
                Some(Self::Arrival(pair.clone(), any))
            }
            Self::Heal(_) | Self::GuardEnds(_) | Self::Deadline(..) => Some(self.clone()),
            // A lease need not lapse: its holder renews it.
            Self::HoldLapses(_) | Self::BidsLapse(_) | Self::LeaseLapses(_) => None,
            Self::Begin(_) | Self::Cut(_) | Self::Restart(_) => None,
        }
    }
}

impl Cargo {
    fn shown(self, (from, to): &Pair) -> String {
        match self {
            Self::Record(_) => format!("{to} takes in what {from} bids"),
            Self::Ack(_) => format!("{to} hears that {from} has taken in its bids"),
            Self::Occurrence => format!("{to} hears what occurred at {from}"),
            Self::Presence => format!("{to} hears that {from} lives"),
        }
    }
}
