//! Operator: the one gateway through which remote orders reach the vehicle's safety events.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{
    Advance, Complete, Declared as _, Declined, Failed, HandBack, Hold, Land, OrderTaken, Return, Text, What,
};

use crate::{me::Me, precedence};

/// Turns `order {what}` into the vehicle's own `hold`, `land`, `return` or `hand_back`; `resume` and `goto` end a hold.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Operator {
    me: Me,
    /// Until they can happen: what a pilot keeps from happening waits for the vehicle to be handed back.
    pending: Vec<Event>,
    holding: bool,
    /// Its mission is over: there is nothing left to go on with.
    is_over: bool,
}

impl Operator {
    pub fn new(me: Me) -> Self {
        Self { me, pending: Vec::new(), holding: false, is_over: false }
    }

    /// The vehicle's own action then, if there is one.
    fn own(&self, what: What, by: &str) -> Option<Event> {
        let why: Text = format!("ordered by {by}").into();
        Some(match what {
            What::Hold => self.me.event(Hold { why }),
            What::Land => self.me.event(Land { why }),
            What::Return => self.me.event(Return { why }),
            What::HandBack => self.me.event(HandBack),
            What::Resume if self.is_over => self
                .me
                .event(Declined { what, why: "its mission is over, and it stands on the ground".into() }),
            _ => return None,
        })
    }

    /// The answer to an order that names nobody, which no b-thread heeds.
    fn decline(&self, order: &Event) -> Option<Event> {
        let what = What::of_word(order.text("what")?)?;
        let why = "it names nobody: set `by` to the name of the person or program that gives it";
        order.text("by").is_none().then(|| self.me.event(Declined { what, why: why.into() }))
    }
}

impl BThread for Operator {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let mut bid = Bid::new().priority(precedence::LINK).wait_for(me.any::<OrderTaken>());
        if !self.is_over {
            bid = bid.wait_for(me.any::<(Complete, Failed)>());
        }
        if self.holding {
            // Whoever sends the vehicle home or down, it is no longer held.
            bid = bid.block(me.any::<Advance>()).wait_for(me.any::<(Return, Land)>());
        }
        Some(self.pending.iter().fold(bid, |bid, event| bid.request(event.clone())))
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        if matches!(self.me.verb(event), Some(Complete::NAME | Failed::NAME)) {
            self.is_over = true;
            return;
        }
        if !self.me.heard::<OrderTaken>(event) {
            self.pending.retain(|pending| pending != event);
            self.holding &= self.me.heard::<Hold>(event) || self.me.heard::<Declined>(event);
            return;
        }
        let Some(OrderTaken { what, by, .. }) = OrderTaken::read(event) else {
            self.pending.extend(self.decline(event));
            return;
        };
        let event = self.own(what, &by);
        if what != What::HandBack {
            self.pending.clear();
        }
        self.pending.extend(event);
        self.holding = (self.holding && !matches!(what, What::Resume | What::GoTo)) || what == What::Hold;
    }
}
