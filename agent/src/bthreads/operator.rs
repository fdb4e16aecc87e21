//! Operator: the one gateway through which remote orders reach the vehicle's safety events.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::vocabulary::{ADVANCE, HAND_BACK, HOLD, LAND, ORDER, RETURN};

use crate::{me::Me, precedence};

/// Turns `order {what}` into the vehicle's own `hold`, `land`, `return` or `hand_back`; `resume` and `goto` end a hold.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Operator {
    me: Me,
    /// Until they can happen: what a pilot keeps from happening waits for the vehicle to be handed back.
    pending: Vec<Event>,
    holding: bool,
}

impl Operator {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        Self { me, pending: Vec::new(), holding: false }
    }
}

impl BThread for Operator {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let mut bid = Bid::new().priority(precedence::LINK).wait_for(me.any(ORDER));
        if self.holding {
            // Whoever sends the vehicle home or down, it is no longer held.
            bid = bid.block(me.any(ADVANCE)).wait_for(me.any_of(&[RETURN, LAND]));
        }
        Some(self.pending.iter().fold(bid, |bid, event| bid.request(event.clone())))
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        if !self.me.heard(event, ORDER) {
            self.pending.retain(|pending| pending != event);
            self.holding &= self.me.heard(event, HOLD);
            return;
        }
        let what = event.text("what").unwrap_or_default();
        let why = "ordered by the operator";
        let event = match what {
            "hold" => Some(self.me.because(HOLD, why)),
            "land" => Some(self.me.because(LAND, why)),
            "return" => Some(self.me.because(RETURN, why)),
            "hand_back" => Some(self.me.event(HAND_BACK)),
            _ => None,
        };
        if what != "hand_back" {
            self.pending.clear();
        }
        self.pending.extend(event);
        self.holding = (self.holding && !matches!(what, "resume" | "goto")) || what == "hold";
    }
}
