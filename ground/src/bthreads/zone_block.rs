//! Zone block: what is drawn on the map, as a block that outlives the station.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::NodeName;
use skein_wire::Zone;
use skein_wire::event::{Declared as _, Drawn, Erased, Events as _};

/// Blocks that vehicles disregard a zone, from when it is drawn until it is removed. Vehicles keep the block on disk,
/// whatever becomes of the station.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct ZoneBlock {
    ground: NodeName,
    name: String,
    block: EventSet,
}

impl ZoneBlock {
    /// The b-thread of the station `ground` for this zone; named [`name`](Self::name).
    pub fn new(ground: NodeName, zone: &Zone) -> Self {
        Self { ground, name: zone.name().to_owned(), block: zone.block() }
    }

    /// The name it runs under.
    pub fn name(zone: &str) -> String {
        format!("zone {zone}")
    }
}

impl BThread for ZoneBlock {
    fn bid(&self) -> Option<Bid> {
        let drawn_anew = Drawn::any_at(&self.ground).and(Drawn::name(self.name.as_str()));
        let erased = Erased::any_at(&self.ground).and(Erased::name(self.name.as_str()));
        Some(Bid::new().block(self.block.clone()).hold_when_lost().wait_for(drawn_anew).interrupt(erased))
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        if let Some(Ok(zone)) = Drawn::read(event).map(|drawn| drawn.zone.parse::<Zone>()) {
            self.block = zone.block();
        }
    }
}
