//! What an operator may order.

use std::fmt;

use serde::{Deserialize, Serialize};
use skein_bp::{Event, EventSet};
use skein_dbp::NodeName;

/// Whom an order is for.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Who {
    /// Every vehicle of the roster.
    All,
    /// One vehicle.
    Vehicle(NodeName),
}

/// An operator's order.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Order {
    /// Stay where you are until resumed.
    Hold(Who),
    /// Go on.
    Resume(Who),
    /// Land where you are.
    Land(Who),
    /// Fly home and land there.
    Return(Who),
    /// Fly again by yourself: the pilot has let go.
    HandBack(Who),
}

impl Order {
    /// The order as one word: `hold`, `resume`, `land`, `return` or `hand_back`.
    #[must_use]
    pub fn what(&self) -> &'static str {
        match self {
            Self::Hold(_) => "hold",
            Self::Resume(_) => "resume",
            Self::Land(_) => "land",
            Self::Return(_) => "return",
            Self::HandBack(_) => "hand_back",
        }
    }

    /// Whom it is for.
    #[must_use]
    pub fn who(&self) -> &Who {
        match self {
            Self::Hold(who)
            | Self::Resume(who)
            | Self::Land(who)
            | Self::Return(who)
            | Self::HandBack(who) => who,
        }
    }

    /// The order as an event of the ground station: `ground/main/ordered{what: "hold", who: "all"}`.
    #[must_use]
    pub fn event(&self, ground: &NodeName) -> Event {
        Event::new(ground.event_name(ORDERED)).with("what", self.what()).with("who", self.who().to_string())
    }
}

/// What the operator has ordered becomes an event of this name.
const ORDERED: &str = "ordered";

/// The events of the ground station by which `what` is ordered, for anyone.
#[must_use]
pub fn ordered(ground: &NodeName, what: &str) -> EventSet {
    EventSet::named(ground.event_name(ORDERED)).and(EventSet::field_is("what", what))
}

/// Those among them that are for the whole swarm.
#[must_use]
pub fn ordered_for_all(ground: &NodeName, what: &str) -> EventSet {
    ordered(ground, what).and(EventSet::field_is("who", ALL))
}

/// Those among them that are for `vehicle`, alone or with all.
#[must_use]
pub fn ordered_for(ground: &NodeName, what: &str, vehicle: &NodeName) -> EventSet {
    let who = EventSet::field_is("who", ALL).or(EventSet::field_is("who", vehicle.as_str()));
    ordered(ground, what).and(who)
}

/// How an event names all vehicles.
const ALL: &str = "all";

impl Who {
    /// Reads whom an `ordered` event is for.
    #[must_use]
    pub fn of(event: &Event) -> Option<Self> {
        match event.text("who")? {
            ALL => Some(Self::All),
            name => NodeName::new(name).ok().map(Self::Vehicle),
        }
    }
}

impl fmt::Display for Who {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.write_str(ALL),
            Self::Vehicle(name) => name.fmt(f),
        }
    }
}
