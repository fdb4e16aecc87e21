//! Brings scripts to one vehicle, and takes them back.

use std::collections::VecDeque;
use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::NodeName;
use skein_dbp::facts::Unknown;
use skein_wire::event::{Declared as _, Events as _, Load, OrderGiven, Unload, What};

use super::GOING_LASTS;
use crate::order::{ordered, ordered_for};

/// Requests `load` and `unload` at one vehicle, in the order in which they were given, until each is taken in.
///
/// One that is not taken in for [`GOING_LASTS`] is not brought any more, and neither is one whose vehicle has restarted
/// meanwhile: whoever gave it is told so, and may give it again.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct ScriptDelivery {
    ground: NodeName,
    vehicle: NodeName,
    /// The requests to make, each with the time at which it ends.
    queue: VecDeque<(Event, Duration)>,
}

impl ScriptDelivery {
    /// Brings the scripts of the station `ground` to `vehicle`.
    pub fn new(ground: NodeName, vehicle: NodeName) -> Self {
        Self { ground, vehicle, queue: VecDeque::new() }
    }

    /// The name it runs under.
    pub fn name(vehicle: &NodeName) -> String {
        format!("scripts for {vehicle}")
    }

    fn to_bring(&self, ordered: &Event) -> Option<Event> {
        let OrderGiven { what, name, script, .. } = OrderGiven::read(ordered)?;
        match what {
            What::Load => Some(Load { name, script: script? }.at(&self.vehicle)),
            What::Unload => Some(Unload { name: name? }.at(&self.vehicle)),
            _ => None,
        }
    }
}

impl BThread for ScriptDelivery {
    fn bid(&self) -> Option<Bid> {
        let orders = ordered(&self.ground, What::those(What::is_about_script));
        let bid = Bid::new().wait_for(ordered_for(&self.ground, &self.vehicle).and(orders));
        let Some((event, until)) = self.queue.front() else { return Some(bid) };
        let unknown = Unknown::any_at(&self.ground).and(Unknown::event(event.name()));
        Some(bid.request(event.clone()).wait_for(unknown).deadline(*until))
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        match self.to_bring(event) {
            Some(script) => self.queue.push_back((script, cx.now() + GOING_LASTS)),
            // It is taken in, or has waited too long, or nobody knows.
            None => drop(self.queue.pop_front()),
        }
    }
}
