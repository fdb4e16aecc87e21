//! Link loss: what a vehicle does when the ground station has been silent for long.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::facts::{PeerJoined, PeerLost};
use skein_wire::event::{Airborne, Declared as _, Land, Landed, Return};

use crate::{me::Me, precedence};

/// The vehicle acts once the ground has been silent for this long.
const PATIENCE: Duration = Duration::from_secs(5);

/// The policy of a vehicle without its ground station.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LinkLossPolicy {
    /// Flies its mission to the end.
    #[default]
    Continue,
    /// Flies home and lands.
    Return,
    /// Lands where it is.
    Land,
}

/// Applies the link-loss policy once the ground has been lost for five seconds.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct LinkLoss {
    me: Me,
    ground: String,
    policy: LinkLossPolicy,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Grounded,
    Linked,
    Alone { until: Duration },
    Acting,
    Acted,
}

impl LinkLoss {
    /// The b-thread of vehicle `me`, whose ground station is the node `ground`.
    pub fn new(me: Me, ground: &str, policy: LinkLossPolicy) -> Self {
        Self { me, ground: ground.to_owned(), policy, phase: Phase::Grounded }
    }
}

impl BThread for LinkLoss {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let why = "ground station lost".into();
        let act = match self.policy {
            LinkLossPolicy::Continue => return None,
            LinkLossPolicy::Return => me.event(Return { why }),
            LinkLossPolicy::Land => me.event(Land { why }),
        };
        let bid = Bid::new().priority(precedence::LINK);
        Some(match self.phase {
            Phase::Grounded => bid.wait_for(me.any::<Airborne>()),
            Phase::Linked => bid.wait_for(me.any::<(PeerLost, Landed)>()),
            Phase::Alone { until } => bid.wait_for(me.any::<(PeerJoined, Landed)>()).deadline(until),
            Phase::Acting => bid.request(act).wait_for(me.any::<PeerJoined>()),
            Phase::Acted => bid.wait_for(me.any::<(Landed, PeerJoined)>()),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        let joined = PeerJoined::read(event).is_some_and(|joined| joined.node.as_str() == self.ground);
        let lost = PeerLost::read(event).is_some_and(|lost| lost.node.as_str() == self.ground);
        self.phase = match (&self.phase, self.me.verb(event)) {
            (Phase::Linked, _) if lost => Phase::Alone { until: cx.now() + PATIENCE },
            (_, Some(Landed::NAME)) => Phase::Grounded,
            (Phase::Grounded, _) => Phase::Linked,
            _ if joined => Phase::Linked,
            (Phase::Alone { .. }, None) => Phase::Acting,
            (Phase::Acting, Some(Return::NAME | Land::NAME)) => Phase::Acted,
            (phase, _) => phase.clone(),
        };
    }
}
