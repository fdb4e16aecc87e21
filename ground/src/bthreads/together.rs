//! Together: asks for the joint launch and the joint abort that the operator has ordered.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::NodeName;
use skein_wire::vocabulary::{ABORT, LAUNCH, SWARM, event};

use crate::order::{ordered, ordered_for_all};

/// How long a joint launch is asked for: whoever ordered it does not look any more.
pub const LAUNCH_LASTS: Duration = Duration::from_secs(60);
/// What calls a joint launch off.
const CALLING_OFF: [&str; 3] = ["land", "return", "abort"];

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
    #[must_use]
    pub fn new(ground: NodeName) -> Self {
        Self { ground, phase: Phase::Unordered }
    }
}

impl BThread for Together {
    fn bid(&self) -> Option<Bid> {
        let abort = ordered(&self.ground, "abort");
        Some(match self.phase {
            Phase::Unordered => Bid::new().wait_for(ordered(&self.ground, "launch_together")).wait_for(abort),
            Phase::Launching { until } => CALLING_OFF
                .iter()
                .fold(Bid::new(), |bid, what| bid.wait_for(ordered_for_all(&self.ground, what)))
                .request(event(SWARM, LAUNCH))
                .deadline(until),
            Phase::Aborting => Bid::new().request(event(SWARM, ABORT)),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        self.phase = match (&self.phase, event.text("what")) {
            (_, Some("abort")) => Phase::Aborting,
            (Phase::Unordered, Some("launch_together")) => {
                Phase::Launching { until: cx.now() + LAUNCH_LASTS }
            }
            _ => Phase::Unordered,
        };
    }
}
