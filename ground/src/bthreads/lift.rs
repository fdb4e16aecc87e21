//! Lift: ends at one vehicle a zone that no station states any more.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::{Lift, NodeName};
use skein_wire::event::Declared as _;

use super::ZoneBlock;

/// Requests `lift` at one vehicle, of a zone that a former life of the station has left there, for a while.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct LiftZone {
    request: Event,
    until: Duration,
    done: bool,
}

impl LiftZone {
    /// Lifts the zone of this name, which `of` has drawn, at `vehicle`; asks until then.
    pub fn new(of: &NodeName, zone: &str, vehicle: &NodeName, until: Duration) -> Self {
        let lift = Lift { node: of.clone(), bthread: ZoneBlock::name(zone).into() };
        Self { request: lift.at(vehicle), until, done: false }
    }

    /// The name it runs under.
    pub fn name(zone: &str, vehicle: &NodeName) -> String {
        format!("lift {zone} at {vehicle}")
    }
}

impl BThread for LiftZone {
    fn bid(&self) -> Option<Bid> {
        (!self.done).then(|| Bid::new().request(self.request.clone()).deadline(self.until))
    }

    fn resume(&mut self, _: &Event, _: &mut Context) {
        self.done = true;
    }
}
