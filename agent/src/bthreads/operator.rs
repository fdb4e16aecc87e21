//! Operator: the one gateway through which remote orders reach the vehicle's safety events.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::vocabulary::{ADVANCE, HAND_BACK, HOLD, LAND, ORDER, RETURN};

use crate::{me::Me, precedence};

/// Turns `order {what}` into the vehicle's own `hold`, `land`, `return` or `hand_back`; `resume` ends a hold.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Operator {
    me: Me,
    pending: Option<Event>,
    holding: bool,
}

impl Operator {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        Self { me, pending: None, holding: false }
    }
}

impl BThread for Operator {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let mut bid = Bid::new().priority(precedence::LINK).wait_for(me.any(ORDER));
        if let Some(event) = &self.pending {
            bid = bid.request(event.clone());
        }
        if self.holding {
            bid = bid.block(me.any(ADVANCE));
        }
        Some(bid)
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        if !self.me.heard(event, ORDER) {
            self.pending = None;
            return;
        }
        let what = event.text("what").unwrap_or_default();
        let why = "ordered by the operator";
        self.pending = match what {
            "hold" => Some(self.me.because(HOLD, why)),
            "land" => Some(self.me.because(LAND, why)),
            "return" => Some(self.me.because(RETURN, why)),
            "hand_back" => Some(self.me.event(HAND_BACK)),
            _ => None,
        };
        self.holding = (self.holding && what != "resume") || what == "hold";
        // A vehicle that is sent home or down is no longer held.
        self.holding &= !matches!(what, "land" | "return");
    }
}
