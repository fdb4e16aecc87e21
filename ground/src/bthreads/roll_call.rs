//! Roll call: who is there to be launched, and whose turn it is.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::NodeName;
use skein_wire::event::{Declared as _, Heard, Later, OrderGiven, Situation, Turn, What, of};

use crate::order::ordered;

/// Vehicles that are there wait so long for one that goes before them, from the first word of any.
const COURTESY: Duration = Duration::from_secs(2);

/// Offers `turn` for each vehicle that has been heard of on the ground, in the order in which they are to take off. Who
/// launches them blocks `turn` while it is busy, and answers `later` for one that did not take off.
///
/// It is a b-thread of its own so that one who has just been heard does not disturb the request for another's take-off.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct RollCall {
    ground: NodeName,
    /// The vehicles that have yet to fly.
    waiting: VecDeque<NodeName>,
    /// Those of them that have been heard of.
    present: BTreeSet<NodeName>,
    /// Until when only the first one may have its turn; none before anybody is there, or once that is over.
    courtesy: Option<Duration>,
    begun: bool,
}

impl RollCall {
    /// Calls `vehicles`, in this order.
    pub fn new(ground: NodeName, vehicles: Vec<NodeName>) -> Self {
        Self { ground, waiting: vehicles.into(), present: BTreeSet::new(), courtesy: None, begun: false }
    }
}

impl BThread for RollCall {
    fn bid(&self) -> Option<Bid> {
        // Who is ordered down by name stays down.
        let grounded = ordered(&self.ground, What::those(What::brings_down));
        let bid = Bid::new()
            .wait_for(of::<Heard>(&self.ground))
            .wait_for(of::<Later>(&self.ground))
            .wait_for(grounded);
        let among = if self.courtesy.is_some() { 1 } else { self.waiting.len() };
        let next = self.waiting.iter().take(among).find(|vehicle| self.present.contains(*vehicle));
        let bid = match self.courtesy {
            Some(until) => bid.deadline(until),
            None => bid,
        };
        Some(match next {
            Some(vehicle) => bid.request(Turn { vehicle: vehicle.clone() }.at(&self.ground)),
            None => bid,
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        if let Some(order) = OrderGiven::read(event) {
            self.waiting.retain(|vehicle| *order.who != *vehicle.as_str());
            return;
        }
        let (heard, later, turn) = (Heard::read(event), Later::read(event), Turn::read(event));
        let found = heard.as_ref().map(|heard| &heard.vehicle);
        let about =
            found.or(later.as_ref().map(|later| &later.vehicle)).or(turn.as_ref().map(|turn| &turn.vehicle));
        let Some(vehicle) = about.cloned() else {
            self.courtesy = None;
            return;
        };
        if !std::mem::replace(&mut self.begun, true) {
            self.courtesy = Some(cx.now() + COURTESY);
        }
        if heard.is_some_and(|heard| heard.situation == Situation::Grounded) {
            self.present.insert(vehicle);
        } else if later.is_some() {
            self.waiting.push_back(vehicle);
        } else {
            self.waiting.retain(|waiting| *waiting != vehicle);
        }
    }
}
