//! Muster: nobody sets out before everybody is in the air.

use std::collections::BTreeSet;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::NodeName;
use skein_dbp::facts::PeerLost;
use skein_wire::event::{
    Advance, Airborne, Declared as _, Events as _, Failed, Heard, Situation, What, of_every_vehicle,
};

use crate::order::ordered_for_all;

/// Blocks `uav/*/advance` until every vehicle is in the air, or will not be.
///
/// Swarms whose vehicles swap places need it: the goal of one is where another still stands.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Muster {
    ground: NodeName,
    missing: BTreeSet<String>,
}

impl Muster {
    /// Waits for `vehicles`, at the ground station `ground`.
    pub fn new(ground: NodeName, vehicles: impl IntoIterator<Item = NodeName>) -> Self {
        Self { ground, missing: vehicles.into_iter().map(|vehicle| vehicle.to_string()).collect() }
    }
}

impl BThread for Muster {
    fn bid(&self) -> Option<Bid> {
        // Whoever is ordered home must be free to move.
        let called_off = ordered_for_all(&self.ground, What::those(What::brings_down));
        let arrived = of_every_vehicle::<(Airborne, Failed)>();
        let lost = PeerLost::any_at(&self.ground);
        (!self.missing.is_empty()).then(|| {
            let bid = Bid::new().block(of_every_vehicle::<Advance>()).interrupt(called_off);
            bid.wait_for(arrived).wait_for(lost).wait_for(Heard::any_at(&self.ground))
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        if let Some(heard) = Heard::read(event) {
            if heard.situation != Situation::Grounded {
                self.missing.remove(heard.vehicle.as_str());
            }
        } else if let Some(lost) = PeerLost::read(event) {
            self.missing.remove(lost.node.as_str());
        } else {
            self.missing.remove(event.home());
        }
    }
}
