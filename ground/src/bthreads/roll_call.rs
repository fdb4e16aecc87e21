//! Roll call: who is there to be launched, and whose turn it is.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::NodeName;

use super::heard::{self, Situation};
use crate::order::ordered;

/// `<ground>/turn {vehicle}`: it is this vehicle's turn to take off.
const TURN: &str = "turn";
/// `<ground>/later {vehicle}`: it does not take off now; others go first.
const LATER: &str = "later";
/// How long those that are there wait for one that was to go before them, from the first word of any.
const COURTESY: Duration = Duration::from_secs(2);

/// Offers `turn` for each vehicle that has been heard of on the ground, in the order in which they are to take off. Who
/// launches them blocks `turn` while it is busy, and answers `later` for one that did not take off.
///
/// It is a b-thread of its own so that one who has just been heard does not disturb the request for another's take-off.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct RollCall {
    ground: NodeName,
    /// Who has yet to fly.
    waiting: VecDeque<NodeName>,
    /// Those of them that have been heard of.
    present: BTreeSet<NodeName>,
    /// Until when only the first one may have its turn; none before anybody is there, or once that is over.
    courtesy: Option<Duration>,
    begun: bool,
}

/// All turns at the station `ground`.
#[must_use]
pub fn turns(ground: &NodeName) -> EventSet {
    EventSet::named(ground.event_name(TURN))
}

/// Says that `vehicle` is to have another turn, after the others.
#[must_use]
pub fn later(ground: &NodeName, vehicle: &NodeName) -> Event {
    Event::new(ground.event_name(LATER)).with("vehicle", vehicle.as_str())
}

/// The vehicle that an event of the roll call is about.
#[must_use]
pub fn vehicle_of(event: &Event) -> Option<NodeName> {
    event.text("vehicle").and_then(|name| NodeName::new(name).ok())
}

impl RollCall {
    /// Calls `vehicles`, in this order.
    #[must_use]
    pub fn new(ground: NodeName, vehicles: Vec<NodeName>) -> Self {
        Self { ground, waiting: vehicles.into(), present: BTreeSet::new(), courtesy: None, begun: false }
    }
}

impl BThread for RollCall {
    fn bid(&self) -> Option<Bid> {
        let laters = EventSet::named(self.ground.event_name(LATER));
        // Who is ordered down by name stays down.
        let grounded = EventSet::any_of(["land", "return"].map(|what| ordered(&self.ground, what)));
        let bid = Bid::new().wait_for(heard::of(&self.ground)).wait_for(laters).wait_for(grounded);
        let among = if self.courtesy.is_some() { 1 } else { self.waiting.len() };
        let next = self.waiting.iter().take(among).find(|vehicle| self.present.contains(*vehicle));
        let bid = match self.courtesy {
            Some(until) => bid.deadline(until),
            None => bid,
        };
        Some(match next {
            Some(vehicle) => {
                bid.request(Event::new(self.ground.event_name(TURN)).with("vehicle", vehicle.as_str()))
            }
            None => bid,
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        if event.text("what").is_some() {
            self.waiting.retain(|vehicle| event.text("who") != Some(vehicle.as_str()));
            return;
        }
        let Some(vehicle) = vehicle_of(event) else {
            self.courtesy = None;
            return;
        };
        if !std::mem::replace(&mut self.begun, true) {
            self.courtesy = Some(cx.now() + COURTESY);
        }
        match (event.kind(), heard::read(event)) {
            (_, Some((_, Situation::Grounded))) => drop(self.present.insert(vehicle)),
            (LATER, _) => self.waiting.push_back(vehicle),
            _ => self.waiting.retain(|waiting| *waiting != vehicle),
        }
    }
}
