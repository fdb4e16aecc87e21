//! Hold: no vehicle moves on while its `advance` is blocked from here.

use std::collections::BTreeSet;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::NodeName;
use skein_wire::event::{Advance, Declared as _, OrderGiven, What, of, of_every_vehicle};

use crate::order::ordered;

/// Blocks `advance` of the vehicles that are to hold, from an order to hold until another order.
///
/// The block has a lease: a ground station that falls silent does not hold the swarm for ever. Once it is sure
/// everywhere, the station's fact `confirmed` names this b-thread.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Hold {
    ground: NodeName,
    vehicles: Vec<NodeName>,
    held: BTreeSet<NodeName>,
}

impl Hold {
    /// The name that this b-thread runs under: the core asks by it whose block is confirmed.
    pub const NAME: &'static str = "hold";

    /// The b-thread of the ground station `ground` for its `vehicles`.
    pub fn new(ground: NodeName, vehicles: Vec<NodeName>) -> Self {
        Self { ground, vehicles, held: BTreeSet::new() }
    }

    fn block(&self) -> EventSet {
        if self.held.len() == self.vehicles.len() {
            of_every_vehicle::<Advance>()
        } else {
            EventSet::any_of(self.held.iter().map(of::<Advance>))
        }
    }
}

impl BThread for Hold {
    fn bid(&self) -> Option<Bid> {
        let orders = What::those(|what| what == What::Hold || what.ends_hold());
        let bid = Bid::new().wait_for(ordered(&self.ground, orders));
        Some(if self.held.is_empty() { bid } else { bid.block(self.block()) })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        let Some(order) = OrderGiven::read(event) else { return };
        if order.what == What::Hold {
            self.held.extend(self.vehicles.iter().filter(|vehicle| order.is_for(vehicle)).cloned());
        } else {
            self.held.retain(|vehicle| !order.is_for(vehicle));
        }
    }
}
