//! Preflight: no take-off until every check passes, and none of a vehicle that has taken off.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{CommandFailed, Declared as _, Landed, Ready, Takeoff, Unready};

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
    pub fn new(me: Me) -> Self {
        Self { me, ready: false, off: false }
    }
}

impl BThread for Preflight {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::COLLISION).wait_for(me.any::<(Ready, Unready)>());
        Some(match (self.off, self.ready) {
            (true, _) => bid.wait_for(me.any::<(Landed, CommandFailed)>()).block(me.any::<Takeoff>()),
            (false, true) => bid.wait_for(me.any::<Takeoff>()),
            (false, false) => bid.block(me.any::<Takeoff>()),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        match self.me.verb(event) {
            Some(Takeoff::NAME) => self.off = true,
            Some(Landed::NAME | CommandFailed::NAME) => self.off = false,
            verb => self.ready = verb == Some(Ready::NAME),
        }
    }
}
