//! Link loss: what a vehicle does when the ground station has been silent for long.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::facts::{PEER_JOINED, PEER_LOST};
use skein_wire::vocabulary::{AIRBORNE, LAND, LANDED, RETURN};

use crate::{me::Me, precedence};

/// How long the ground may be silent before the vehicle acts on it.
const PATIENCE: Duration = Duration::from_secs(5);

/// What a vehicle does without its ground station.
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
    #[must_use]
    pub fn new(me: Me, ground: &str, policy: LinkLossPolicy) -> Self {
        Self { me, ground: ground.to_owned(), policy, phase: Phase::Grounded }
    }
}

impl BThread for LinkLoss {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let verb = match self.policy {
            LinkLossPolicy::Continue => return None,
            LinkLossPolicy::Return => RETURN,
            LinkLossPolicy::Land => LAND,
        };
        let bid = Bid::new().priority(precedence::LINK);
        Some(match self.phase {
            Phase::Grounded => bid.wait_for(me.any(AIRBORNE)),
            Phase::Linked => bid.wait_for(me.any_of(&[PEER_LOST, LANDED])),
            Phase::Alone { until } => bid.wait_for(me.any_of(&[PEER_JOINED, LANDED])).deadline(until),
            Phase::Acting => {
                bid.request(me.because(verb, "ground station lost")).wait_for(me.any(PEER_JOINED))
            }
            Phase::Acted => bid.wait_for(me.any_of(&[LANDED, PEER_JOINED])),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        let about_ground = event.text("node") == Some(self.ground.as_str());
        self.phase = match (&self.phase, self.me.verb(event)) {
            (Phase::Linked, Some(PEER_LOST)) if about_ground => Phase::Alone { until: cx.now() + PATIENCE },
            (_, Some(LANDED)) => Phase::Grounded,
            (Phase::Grounded, _) => Phase::Linked,
            (_, Some(PEER_JOINED)) if about_ground => Phase::Linked,
            (Phase::Alone { .. }, None) => Phase::Acting,
            (Phase::Acting, Some(RETURN | LAND)) => Phase::Acted,
            (phase, _) => phase.clone(),
        };
    }
}
