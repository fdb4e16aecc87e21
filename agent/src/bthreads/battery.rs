//! Battery: home while there is energy for the way home; down at once when there is hardly any.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{
    self, BatteryCritical, BatteryLow, Declared as _, Goto, HandBack, Land, Landed, Return,
};

use crate::{me::Me, precedence};

/// Requests `return` on a low battery and `land` on a critical one, which nothing then delays.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Battery {
    me: Me,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Good,
    Low { why: String },
    GoingHome,
    Critical,
    GoingDown,
}

impl Battery {
    pub fn new(me: Me) -> Self {
        Self { me, phase: Phase::Good }
    }
}

impl BThread for Battery {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let critical = me.any::<(BatteryCritical, Landed)>();
        let low = Bid::new().priority(precedence::BATTERY_LOW);
        let emergency = Bid::new().priority(precedence::BATTERY_EMERGENCY).block(me.any::<(Return, Goto)>());
        Some(match &self.phase {
            Phase::Good => low.wait_for(me.any::<BatteryLow>()).wait_for(critical),
            Phase::Low { why } => {
                low.request(me.event(Return { why: why.as_str().into() })).wait_for(critical)
            }
            Phase::GoingHome => low.wait_for(critical),
            Phase::Critical => emergency
                .request(me.event(Land { why: "battery nearly empty".into() }))
                .wait_for(me.any::<Landed>()),
            // Given back by a pilot, it still has to land.
            Phase::GoingDown => emergency.wait_for(me.any::<(Landed, HandBack)>()),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.phase = match self.me.verb(event) {
            Some(BatteryLow::NAME) => {
                Phase::Low { why: event::why(event).unwrap_or("battery low").to_owned() }
            }
            Some(Return::NAME) => Phase::GoingHome,
            Some(BatteryCritical::NAME | HandBack::NAME) => Phase::Critical,
            Some(Land::NAME) => Phase::GoingDown,
            _ => Phase::Good,
        };
    }
}
