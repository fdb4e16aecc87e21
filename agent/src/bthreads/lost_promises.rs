//! Lost promises: an agent that does not know what it has promised in a former life stands, or holds, until
//! somebody with authority says otherwise.

use std::sync::Arc;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{Advance, Goto, Hold, Homeward, OrderTaken, Takeoff};

use crate::{me::Me, precedence};

/// Requests `hold`, and blocks take-off and the mission until an operator orders `resume` or `return`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct LostPromises {
    me: Me,
    why: Arc<str>,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Telling,
    Holding,
    Released,
}

impl LostPromises {
    /// The promises are lost, and this is why.
    pub fn new(me: Me, why: &str) -> Self {
        Self { me, why: format!("its promises are lost: {why}").into(), phase: Phase::Telling }
    }
}

impl BThread for LostPromises {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::COLLISION).wait_for(me.any::<OrderTaken>());
        let bid = bid.block(me.any::<(Takeoff, Goto, Advance, Homeward)>());
        match self.phase {
            Phase::Telling => Some(bid.request(me.event(Hold { why: self.why.clone() }))),
            Phase::Holding => Some(bid),
            Phase::Released => None,
        }
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        let order = self.me.read::<OrderTaken>(event);
        self.phase = match order {
            Some(order) if order.what.releases() => Phase::Released,
            Some(_) if self.phase == Phase::Telling => Phase::Telling,
            _ => Phase::Holding,
        };
    }
}
