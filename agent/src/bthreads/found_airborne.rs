//! Found airborne: an agent that starts while its vehicle flies holds until somebody with authority says otherwise.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{self, Advance, Declared as _, Goto, Hold, Homeward, Landed, OrderTaken, Takeoff};

use crate::{me::Me, precedence};

/// Requests `hold` and blocks take-off and the mission until an operator orders `resume` or `return`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct FoundAirborne {
    me: Me,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Unaware,
    Stopping,
    Holding,
}

impl FoundAirborne {
    pub fn new(me: Me) -> Self {
        Self { me, phase: Phase::Unaware }
    }
}

impl BThread for FoundAirborne {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::COLLISION);
        let mission = me.any::<(Takeoff, Goto, Advance, Homeward)>();
        Some(match self.phase {
            Phase::Unaware => bid.wait_for(me.any::<event::FoundAirborne>()),
            Phase::Stopping => {
                bid.request(me.event(Hold { why: "the agent started in the air".into() })).block(mission)
            }
            Phase::Holding => bid.wait_for(me.any::<(OrderTaken, Landed)>()).block(mission),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.phase = match self.me.verb(event) {
            Some(event::FoundAirborne::NAME) => Phase::Stopping,
            Some(OrderTaken::NAME) if !OrderTaken::read(event).is_some_and(|order| order.what.releases()) => {
                Phase::Holding
            }
            Some(Hold::NAME) => Phase::Holding,
            _ => Phase::Unaware,
        };
    }
}
