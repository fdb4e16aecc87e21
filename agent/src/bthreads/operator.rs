//! Operator: the one gateway through which remote orders reach the vehicle's safety events.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{Advance, Declared as _, HandBack, Hold, Land, OrderTaken, Return, What};

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
    pub fn new(me: Me) -> Self {
        Self { me, pending: Vec::new(), holding: false }
    }
}

impl BThread for Operator {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let mut bid = Bid::new().priority(precedence::LINK).wait_for(me.any::<OrderTaken>());
        if self.holding {
            // Whoever sends the vehicle home or down, it is no longer held.
            bid = bid.block(me.any::<Advance>()).wait_for(me.any::<(Return, Land)>());
        }
        Some(self.pending.iter().fold(bid, |bid, event| bid.request(event.clone())))
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        if !self.me.heard::<OrderTaken>(event) {
            self.pending.retain(|pending| pending != event);
            self.holding &= self.me.heard::<Hold>(event);
            return;
        }
        let what = OrderTaken::read(event).map(|order| order.what);
        let why = || "ordered by the operator".into();
        let event = match what {
            Some(What::Hold) => Some(self.me.event(Hold { why: why() })),
            Some(What::Land) => Some(self.me.event(Land { why: why() })),
            Some(What::Return) => Some(self.me.event(Return { why: why() })),
            Some(What::HandBack) => Some(self.me.event(HandBack)),
            _ => None,
        };
        if what != Some(What::HandBack) {
            self.pending.clear();
        }
        self.pending.extend(event);
        self.holding =
            (self.holding && !matches!(what, Some(What::Resume | What::GoTo))) || what == Some(What::Hold);
    }
}
