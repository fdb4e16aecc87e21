//! Together: asks for the joint launch and the joint abort that the operator has ordered.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::NodeName;
use skein_wire::event::{Abort, Declared as _, Launch, OrderGiven, SWARM, What};

use crate::order::{ordered, ordered_for_all};

/// A joint launch is asked for so long; then whoever ordered it does not look any more.
pub const LAUNCH_LASTS: Duration = Duration::from_secs(60);

/// Requests `swarm/launch` until everybody takes off, which those that are not ready keep back, or `swarm/abort`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Together {
    ground: NodeName,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Unordered,
    Launching { until: Duration },
    Aborting,
}

impl Together {
    /// The b-thread of the ground station `ground`.
    pub fn new(ground: NodeName) -> Self {
        Self { ground, phase: Phase::Unordered }
    }
}

impl BThread for Together {
    fn bid(&self) -> Option<Bid> {
        let abort = ordered(&self.ground, [What::Abort]);
        Some(match self.phase {
            Phase::Unordered => {
                Bid::new().wait_for(ordered(&self.ground, [What::LaunchTogether])).wait_for(abort)
            }
            Phase::Launching { until } => Bid::new()
                .wait_for(ordered_for_all(&self.ground, What::those(What::calls_launch_off)))
                .request(Launch.at(SWARM))
                .deadline(until),
            Phase::Aborting => Bid::new().request(Abort.at(SWARM)),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        self.phase = match (&self.phase, OrderGiven::read(event).map(|order| order.what)) {
            (_, Some(What::Abort)) => Phase::Aborting,
            (Phase::Unordered, Some(What::LaunchTogether)) => {
                Phase::Launching { until: cx.now() + LAUNCH_LASTS }
            }
            _ => Phase::Unordered,
        };
    }
}
