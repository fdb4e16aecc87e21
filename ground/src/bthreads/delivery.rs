//! Brings the operator's orders to one vehicle's gateway.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::{NodeName, facts};
use skein_wire::vocabulary;

use crate::order::ordered_for;

/// Waits until something is ordered for a vehicle, and requests it at the vehicle's gateway until it is taken, or until
/// something else is ordered.
///
/// Each vehicle has its own, so that one out of reach keeps no other from obeying.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Delivery {
    ground: NodeName,
    vehicle: NodeName,
    order: Option<Event>,
}

impl Delivery {
    /// Brings the orders of the station `ground` to `vehicle`.
    #[must_use]
    pub fn new(ground: NodeName, vehicle: NodeName) -> Self {
        Self { ground, vehicle, order: None }
    }

    /// The name it runs under.
    #[must_use]
    pub fn name(vehicle: &NodeName) -> String {
        format!("orders for {vehicle}")
    }

    /// What is to be brought, if the order is not carried out by the station itself.
    fn to_bring(&self, ordered: &Event) -> Option<Event> {
        let what = ordered.text("what").filter(|what| !matches!(*what, "hold" | "launch"))?;
        let order = vocabulary::order(&self.vehicle, what);
        let place = ["x", "y", "z"].into_iter().filter_map(|axis| Some((axis, ordered.real(axis)?)));
        Some(place.fold(order, |order, (axis, coordinate)| order.with(axis, coordinate)))
    }

    /// The vehicle has restarted and may have taken the order or not. To repeat it does no harm.
    fn unknown(&self, order: &Event) -> EventSet {
        facts::of(&self.ground, facts::UNKNOWN).and(EventSet::field_is("event", order.name()))
    }
}

impl BThread for Delivery {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().wait_for(ordered_for(&self.ground, &self.vehicle));
        Some(match &self.order {
            Some(order) => bid.request(order.clone()).wait_for(self.unknown(order)),
            None => bid,
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        if event.kind() == "ordered" {
            // A launch is about others too and says nothing against what is on its way to this one.
            if event.text("what") != Some("launch") {
                self.order = self.to_bring(event);
            }
        } else if self.order.as_ref() == Some(event) {
            self.order = None;
        }
    }
}
