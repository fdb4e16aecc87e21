//! Positioning: a vehicle that does not know where it is stops, and lands if that lasts.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{
    Advance, Declared as _, HandBack, Hold, Homeward, Land, Landed, PositionDoubted, PositionTrusted,
};

use crate::{me::Me, precedence};

/// A vehicle without a position holds for so long, and then lands where it is.
pub const HOLDS_FOR: Duration = Duration::from_secs(10);

/// Requests `hold` and blocks every way when the position is doubted; requests `land` after [`HOLDS_FOR`].
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Positioning {
    me: Me,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Sure,
    Stopping {
        why: String,
        until: Duration,
    },
    Holding {
        why: String,
        until: Duration,
    },
    Lost {
        why: String,
    },
    /// On the way down, which nobody delays; why its position is doubted, if it is.
    Down {
        why: Option<String>,
    },
}

impl Positioning {
    pub fn new(me: Me) -> Self {
        Self { me, phase: Phase::Sure }
    }
}

impl BThread for Positioning {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::COLLISION).wait_for(me.any::<(
            PositionDoubted,
            PositionTrusted,
            Land,
            Landed,
        )>());
        let stands = || bid.clone().block(me.any::<(Advance, Homeward)>());
        Some(match &self.phase {
            Phase::Sure => bid,
            Phase::Stopping { why, until } => {
                stands().request(me.event(Hold { why: why.as_str().into() })).deadline(*until)
            }
            Phase::Holding { until, .. } => stands().deadline(*until),
            Phase::Lost { why } => stands().request(me.event(Land { why: why.as_str().into() })),
            Phase::Down { .. } => bid.wait_for(me.any::<HandBack>()),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        let stops = |why| Phase::Stopping { why, until: cx.now() + HOLDS_FOR };
        let told = || PositionDoubted::read(event).map(|doubted| doubted.why.to_string()).unwrap_or_default();
        self.phase = match (self.me.verb(event), self.phase.clone()) {
            (Some(Landed::NAME), _) => Phase::Sure,
            (Some(PositionDoubted::NAME), Phase::Down { .. }) => Phase::Down { why: Some(told()) },
            (Some(PositionDoubted::NAME), _) => stops(told()),
            (Some(PositionTrusted::NAME), Phase::Down { .. }) => Phase::Down { why: None },
            (Some(PositionTrusted::NAME), _) => Phase::Sure,
            (Some(Land::NAME), Phase::Sure) => Phase::Down { why: None },
            (
                Some(Land::NAME),
                Phase::Stopping { why, .. } | Phase::Holding { why, .. } | Phase::Lost { why },
            ) => Phase::Down { why: Some(why) },
            (Some(HandBack::NAME), Phase::Down { why: Some(why) }) => stops(why),
            (Some(HandBack::NAME), Phase::Down { why: None }) => Phase::Sure,
            (Some(Hold::NAME), Phase::Stopping { why, until }) => Phase::Holding { why, until },
            (None, Phase::Stopping { why, .. } | Phase::Holding { why, .. }) => Phase::Lost { why },
            (_, phase) => phase,
        };
    }
}
