//! Brings scripts to one vehicle, and takes them back.

use std::collections::VecDeque;
use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::{NodeName, facts};
use skein_wire::vocabulary::{self, LOAD, UNLOAD};

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
    /// What is to be requested, and until when.
    queue: VecDeque<(Event, Duration)>,
}

impl ScriptDelivery {
    /// Brings the scripts of the station `ground` to `vehicle`.
    #[must_use]
    pub fn new(ground: NodeName, vehicle: NodeName) -> Self {
        Self { ground, vehicle, queue: VecDeque::new() }
    }

    /// The name it runs under.
    #[must_use]
    pub fn name(vehicle: &NodeName) -> String {
        format!("scripts for {vehicle}")
    }

    fn to_bring(&self, ordered: &Event) -> Option<Event> {
        let verb = [LOAD, UNLOAD].into_iter().find(|verb| ordered.text("what") == Some(*verb))?;
        let data = ["name", "script"].into_iter().filter_map(|key| Some((key, ordered.text(key)?)));
        Some(data.fold(vocabulary::event(&self.vehicle, verb), |event, (key, text)| event.with(key, text)))
    }
}

impl BThread for ScriptDelivery {
    fn bid(&self) -> Option<Bid> {
        let orders = EventSet::any_of([LOAD, UNLOAD].map(|what| ordered(&self.ground, what)));
        let bid = Bid::new().wait_for(ordered_for(&self.ground, &self.vehicle).and(orders));
        let Some((event, until)) = self.queue.front() else { return Some(bid) };
        let unknown = facts::of(&self.ground, facts::UNKNOWN).and(EventSet::field_is("event", event.name()));
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
