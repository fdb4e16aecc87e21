//! Pilot: once somebody else flies the vehicle, its agent requests nothing until it is handed back.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{HandBack, MOTION, PilotTook, Slept};

use crate::{me::Me, precedence};

/// Blocks every movement, from a pilot's mode change or from waking up with a vehicle that somebody else had to look
/// after meanwhile, until an operator hands the vehicle back.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Pilot {
    me: Me,
    has_control: bool,
}

impl Pilot {
    pub fn new(me: Me) -> Self {
        Self { me, has_control: false }
    }
}

impl BThread for Pilot {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().priority(precedence::PILOT);
        Some(if self.has_control {
            bid.wait_for(self.me.any::<HandBack>()).block(self.me.any_in(MOTION))
        } else {
            bid.wait_for(self.me.any::<(PilotTook, Slept)>())
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.has_control = !self.me.heard::<HandBack>(event);
    }
}
