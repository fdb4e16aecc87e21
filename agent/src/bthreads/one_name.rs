//! One name: a vehicle whose name another process has too goes nowhere, because nobody can tell which of them is meant.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::facts::DuplicateName;
use skein_wire::event::{Advance, Declared as _, Enter, Hold, OrderTaken, Takeoff, What};

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
    pub fn new(me: Me) -> Self {
        Self { me, phase: Phase::Unique }
    }
}

impl BThread for OneName {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::COLLISION);
        let moves = me.any::<(Takeoff, Advance, Enter)>();
        Some(match self.phase {
            Phase::Unique => bid.wait_for(me.any::<DuplicateName>()),
            Phase::Stopping => bid
                .request(me.event(Hold {
                    why: "another process has this vehicle's name; end one of them, then resume".into(),
                }))
                .block(moves),
            Phase::Holding => bid.wait_for(me.any::<OrderTaken>()).block(moves),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.phase = match self.phase {
            Phase::Unique => Phase::Stopping,
            Phase::Holding if OrderTaken::read(event).is_some_and(|order| order.what == What::Resume) => {
                Phase::Unique
            }
            Phase::Stopping | Phase::Holding => Phase::Holding,
        };
    }
}
