//! One name: a vehicle whose name another process has too goes nowhere, because nobody can tell which of them is meant.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::facts::DUPLICATE_NAME;
use skein_wire::vocabulary::{ADVANCE, ENTER, HOLD, ORDER, TAKEOFF};

use crate::{me::Me, precedence};

/// Holds the vehicle from the moment another process speaks under its name until an operator orders `resume`.
///
/// The way home stays free: a battery does not wait for names.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct OneName {
    me: Me,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Unique,
    Stopping,
    Holding,
}

impl OneName {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        Self { me, phase: Phase::Unique }
    }
}

impl BThread for OneName {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::COLLISION);
        let moves = me.any_of(&[TAKEOFF, ADVANCE, ENTER]);
        Some(match self.phase {
            Phase::Unique => bid.wait_for(me.any(DUPLICATE_NAME)),
            Phase::Stopping => bid
                .request(
                    me.because(HOLD, "another process has this vehicle's name; end one of them, then resume"),
                )
                .block(moves),
            Phase::Holding => bid.wait_for(me.any(ORDER)).block(moves),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.phase = match self.phase {
            Phase::Unique => Phase::Stopping,
            Phase::Holding if event.text("what") == Some("resume") => Phase::Unique,
            Phase::Stopping | Phase::Holding => Phase::Holding,
        };
    }
}
