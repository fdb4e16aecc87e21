//! Preflight: no take-off until every check passes, and none of a vehicle that has taken off.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::vocabulary::{COMMAND_FAILED, LANDED, READY, TAKEOFF, UNREADY};

use crate::{me::Me, precedence};

/// Blocks `takeoff` until the checks pass, again when one fails, and from one take-off until it is over.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Preflight {
    me: Me,
    ready: bool,
    /// Whether it has taken off, and has neither landed nor been refused to.
    off: bool,
}

impl Preflight {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        Self { me, ready: false, off: false }
    }
}

impl BThread for Preflight {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::COLLISION).wait_for(me.any_of(&[READY, UNREADY]));
        Some(match (self.off, self.ready) {
            (true, _) => bid.wait_for(me.any_of(&[LANDED, COMMAND_FAILED])).block(me.any(TAKEOFF)),
            (false, true) => bid.wait_for(me.any(TAKEOFF)),
            (false, false) => bid.block(me.any(TAKEOFF)),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        match self.me.verb(event) {
            Some(TAKEOFF) => self.off = true,
            Some(LANDED | COMMAND_FAILED) => self.off = false,
            verb => self.ready = verb == Some(READY),
        }
    }
}
