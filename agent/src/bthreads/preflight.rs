//! Preflight: no take-off until every check passes.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::vocabulary::{READY, TAKEOFF, UNREADY};

use crate::{me::Me, precedence};

/// Blocks `takeoff` until the checks pass, and again when one fails.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Preflight {
    me: Me,
    ready: bool,
}

impl Preflight {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        Self { me, ready: false }
    }
}

impl BThread for Preflight {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().priority(precedence::COLLISION);
        Some(if self.ready {
            bid.wait_for(self.me.any(UNREADY))
        } else {
            bid.wait_for(self.me.any(READY)).block(self.me.any(TAKEOFF))
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.ready = self.me.heard(event, READY);
    }
}
