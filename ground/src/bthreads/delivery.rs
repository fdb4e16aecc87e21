//! Brings the operator's orders to one vehicle's gateway.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::NodeName;
use skein_dbp::facts::Unknown;
use skein_wire::event::{Declared as _, Events as _, OrderGiven, Overruled};

use crate::order::ordered_for;

/// An order that sets a vehicle going is not brought any more after this long: whoever gave it does not look any more.
pub const GOING_LASTS: Duration = Duration::from_secs(10);

/// Waits until something is ordered for a vehicle, and requests it at the vehicle's gateway until it is taken, or until
/// something else is ordered.
///
/// Each vehicle has its own, so that one out of reach keeps no other from obeying.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Delivery {
    ground: NodeName,
    vehicle: NodeName,
    order: Option<Event>,
    /// Until when, if it is not to be brought at any time.
    until: Option<Duration>,
}

impl Delivery {
    /// Brings the orders of the station `ground` to `vehicle`.
    pub fn new(ground: NodeName, vehicle: NodeName) -> Self {
        Self { ground, vehicle, order: None, until: None }
    }

    /// The name it runs under.
    pub fn name(vehicle: &NodeName) -> String {
        format!("orders for {vehicle}")
    }

    /// Somebody else holds the vehicle, which heeds no other.
    fn overruled(&self) -> EventSet {
        Overruled::any_at(&self.ground).and(Overruled::vehicle(&self.vehicle))
    }

    /// The vehicle has restarted and may have taken the order or not. To repeat it does no harm if it brings it down.
    fn unknown(&self, order: &Event) -> EventSet {
        Unknown::any_at(&self.ground).and(Unknown::event(order.name()))
    }
}

impl BThread for Delivery {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().wait_for(ordered_for(&self.ground, &self.vehicle));
        let Some(order) = &self.order else { return Some(bid) };
        let bid = bid.request(order.clone()).wait_for(self.unknown(order)).wait_for(self.overruled());
        Some(match self.until {
            Some(until) => bid.deadline(until),
            None => bid,
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        if let Some(given) = OrderGiven::read(event) {
            // A launch is about others too, and a script stands beside: neither says anything against what is on its
            // way.
            if !given.what.is_beside_flight() {
                self.until = given.what.sets_going().then(|| cx.now() + GOING_LASTS);
                self.order = given.brought_to(&self.vehicle);
            }
        } else if self.order.as_ref() == Some(event) || self.until.is_some() {
            // It is taken, or has waited too long, or another holds the vehicle, or its vehicle begins a life of which its operator knows nothing.
            self.order = None;
        }
    }
}
