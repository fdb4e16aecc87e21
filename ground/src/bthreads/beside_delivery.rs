//! Brings to one vehicle what stands beside its flight: scripts, routes, and who holds it.

use std::collections::VecDeque;
use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::NodeName;
use skein_dbp::facts::Unknown;
use skein_wire::event::{Declared as _, Events as _, OrderGiven, What};

use super::GOING_LASTS;
use crate::order::{ordered, ordered_for};

/// Requests `load` and `unload`, or `order` with a route, or `handover`, at one vehicle, in the order in which they were
/// given, until each is taken in. Each kind has a b-thread of its own, so that none waits for another.
///
/// One that is not taken in for [`GOING_LASTS`] is not brought any more, and neither is one whose vehicle has restarted
/// meanwhile: whoever gave it is told so, and may give it again.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct BesideDelivery {
    ground: NodeName,
    vehicle: NodeName,
    what: Vec<What>,
    /// The requests to make, each with the time at which it ends.
    queue: VecDeque<(Event, Duration)>,
}

impl BesideDelivery {
    /// Brings the scripts of the station `ground` to `vehicle`; named [`name_for_scripts`](Self::name_for_scripts).
    pub fn of_scripts(ground: NodeName, vehicle: NodeName) -> Self {
        Self::new(ground, vehicle, What::is_about_script)
    }

    /// Brings routes to `vehicle`; named [`name_for_routes`](Self::name_for_routes).
    pub fn of_routes(ground: NodeName, vehicle: NodeName) -> Self {
        Self::new(ground, vehicle, |what| what == What::Route)
    }

    /// Brings to `vehicle` who holds it; named [`name_for_handovers`](Self::name_for_handovers).
    pub fn of_handovers(ground: NodeName, vehicle: NodeName) -> Self {
        Self::new(ground, vehicle, What::is_handover)
    }

    fn new(ground: NodeName, vehicle: NodeName, brings: fn(What) -> bool) -> Self {
        Self { ground, vehicle, what: What::those(brings).collect(), queue: VecDeque::new() }
    }

    /// The name it runs under.
    pub fn name_for_scripts(vehicle: &NodeName) -> String {
        format!("scripts for {vehicle}")
    }

    /// The name it runs under.
    pub fn name_for_routes(vehicle: &NodeName) -> String {
        format!("routes for {vehicle}")
    }

    /// The name it runs under.
    pub fn name_for_handovers(vehicle: &NodeName) -> String {
        format!("handovers for {vehicle}")
    }
}

impl BThread for BesideDelivery {
    fn bid(&self) -> Option<Bid> {
        let orders = ordered(&self.ground, self.what.iter().copied());
        let bid = Bid::new().wait_for(ordered_for(&self.ground, &self.vehicle).and(orders));
        let Some((event, until)) = self.queue.front() else { return Some(bid) };
        let unknown = Unknown::any_at(&self.ground).and(Unknown::event(event.name()));
        Some(bid.request(event.clone()).wait_for(unknown).deadline(*until))
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        match OrderGiven::read(event).and_then(|given| given.brought_to(&self.vehicle)) {
            Some(script) => self.queue.push_back((script, cx.now() + GOING_LASTS)),
            // It is taken in, or has waited too long, or nobody knows.
            None => drop(self.queue.pop_front()),
        }
    }
}
