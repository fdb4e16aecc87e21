//! Link loss: what a vehicle does when the ground station has been silent for long.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::facts::{PeerJoined, PeerLost};
use skein_wire::event::{
    Airborne, CommandFailed, Declared as _, FoundAirborne, Land, Landed, Return, Takeoff,
};

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

/// Applies the link-loss policy once a vehicle that has taken off has been without the ground for five seconds.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct LinkLoss {
    me: Me,
    ground: String,
    policy: LinkLossPolicy,
    /// Whether the ground is heard; until it has been, it is not there.
    is_linked: bool,
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
        Self { me, ground: ground.to_owned(), policy, is_linked: false, phase: Phase::Grounded }
    }

    fn note_link(&mut self, event: &Event) {
        let is_ground = |node: &str| node == self.ground;
        let joined = PeerJoined::read(event).is_some_and(|joined| is_ground(joined.node.as_str()));
        let lost = PeerLost::read(event).is_some_and(|lost| is_ground(lost.node.as_str()));
        self.is_linked = joined || self.is_linked && !lost;
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
        let link = me.any::<(PeerJoined, PeerLost)>();
        let over = me.any::<(Landed, CommandFailed)>();
        let bid = Bid::new().priority(precedence::LINK).wait_for(link);
        Some(match self.phase {
            // Found in the air, or handed over by a pilot, it had no `takeoff`.
            Phase::Grounded => bid.wait_for(me.any::<(Takeoff, Airborne, FoundAirborne)>()),
            Phase::Linked | Phase::Acted => bid.wait_for(over),
            Phase::Alone { until } => bid.wait_for(over).deadline(until),
            Phase::Acting => bid.wait_for(over).request(act),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        self.note_link(event);
        let alone = Phase::Alone { until: cx.now() + PATIENCE };
        self.phase = match (&self.phase, self.me.verb(event)) {
            (_, Some(Landed::NAME | CommandFailed::NAME)) => Phase::Grounded,
            (Phase::Grounded, Some(PeerJoined::NAME | PeerLost::NAME)) => Phase::Grounded,
            _ if self.is_linked => Phase::Linked,
            (Phase::Grounded | Phase::Linked, _) => alone,
            (Phase::Alone { .. }, None) => Phase::Acting,
            (Phase::Acting, Some(Return::NAME | Land::NAME)) => Phase::Acted,
            (phase, _) => phase.clone(),
        };
    }
}
