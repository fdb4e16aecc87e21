//! `skein-agent` with a b-thread that keeps the mission's thread busy, for tests of what control does
//! meanwhile.

use std::process::ExitCode;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use skein_agent::{Me, field};
use skein_bp::behaviour::{Behaviour, Host};
use skein_bp::{BThread, Bid, Context, Event, Program};
use skein_wire::event::Airborne;

fn main() -> ExitCode {
    skein_agent::main(|known| known.add::<Dawdle>())
}

/// Some time after take-off a b-thread does not come back for a while.
#[derive(Debug, Deserialize)]
struct Dawdle {
    /// So long after, in seconds.
    #[serde(deserialize_with = "field::positive")]
    after_s: f64,
    /// For how long, in seconds.
    #[serde(deserialize_with = "field::positive")]
    for_s: f64,
}

impl Behaviour for Dawdle {
    const NAME: &'static str = "dawdle";
    const NODES: &'static str = "uav/*";

    fn load(&self, host: &Host<'_>, program: &mut Program) {
        let seconds = |s| Duration::try_from_secs_f64(s).unwrap_or(Duration::MAX / 2);
        let (after, lasts) = (seconds(self.after_s), seconds(self.for_s));
        program.add(Self::NAME, Dawdling { me: Me::new(host.node), after, lasts, phase: Phase::Grounded });
    }
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Dawdling {
    me: Me,
    after: Duration,
    lasts: Duration,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Grounded,
    Flying { until: Duration },
    Done,
}

impl BThread for Dawdling {
    fn bid(&self) -> Option<Bid> {
        match self.phase {
            Phase::Grounded => Some(Bid::new().wait_for(self.me.any::<Airborne>())),
            Phase::Flying { until } => Some(Bid::new().deadline(until)),
            Phase::Done => None,
        }
    }

    fn resume(&mut self, _: &Event, cx: &mut Context) {
        self.phase = match self.phase {
            Phase::Grounded => Phase::Flying { until: cx.now() + self.after },
            Phase::Flying { .. } | Phase::Done => {
                std::thread::sleep(self.lasts);
                Phase::Done
            }
        };
    }
}
