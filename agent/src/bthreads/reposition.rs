//! Reposition: flies to where an operator points, and hovers there until the mission is resumed.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::vocabulary::{
    AIRBORNE, DECLINED, FOUND_AIRBORNE, GOTO, LAND, LANDED, ORDER, RETURN, TAKEOFF,
};

use crate::{me::Me, precedence};

/// The leg number of an operator's point.
pub const OPERATOR_LEG: i64 = -2;
/// How long the vehicle's other b-threads may keep it from setting out before the order is declined.
const PATIENCE: Duration = Duration::from_secs(2);

/// Answers `order {what: "goto", x, y, z}` with a `goto` of its own, or says why not.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Reposition {
    me: Me,
    standing: Standing,
    task: Task,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
enum Standing {
    Grounded,
    Free,
    /// On the way down or home, from which no order leads away.
    Bound,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Task {
    Nothing,
    Turning { to: Event, until: Duration },
    Declining { why: String },
}

impl Reposition {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        Self { me, standing: Standing::Grounded, task: Task::Nothing }
    }

    /// The `goto` that an order asks for.
    fn goto(&self, order: &Event) -> Option<Event> {
        let [x, y, z] = ["x", "y", "z"].map(|axis| order.real(axis));
        let goto = self.me.event(GOTO).with("leg", OPERATOR_LEG).with("lands", false);
        Some(goto.with("x", x?).with("y", y?).with("z", z?))
    }

    fn answer(&self, order: &Event, now: Duration) -> Task {
        let declining = |why: &str| Task::Declining { why: why.to_owned() };
        match (self.standing, self.goto(order)) {
            (Standing::Free, Some(to)) => Task::Turning { to, until: now + PATIENCE },
            (Standing::Free, None) => declining("it names no point"),
            _ => declining("it is not free to go: on the ground, landing or returning"),
        }
    }
}

impl BThread for Reposition {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::LINK).wait_for(me.any_of(match self.standing {
            Standing::Grounded => &[ORDER, AIRBORNE, LAND, RETURN],
            Standing::Free => &[ORDER, LAND, RETURN, LANDED],
            Standing::Bound => &[ORDER, LANDED, TAKEOFF, FOUND_AIRBORNE],
        }));
        Some(match &self.task {
            Task::Nothing => bid,
            Task::Turning { to, until } => bid.request(to.clone()).deadline(*until),
            Task::Declining { why } => bid.request(me.because(DECLINED, why).with("what", "goto")),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        let is_goto = event.text("what") == Some("goto");
        self.task = match (&self.task, self.me.verb(event)) {
            (_, Some(ORDER)) if is_goto => self.answer(event, cx.now()),
            // Another order takes the place of this one.
            (Task::Declining { why }, Some(ORDER)) => Task::Declining { why: why.clone() },
            (Task::Turning { .. }, None) => {
                Task::Declining { why: "the vehicle blocks it: outside the geofence, or held".into() }
            }
            _ => Task::Nothing,
        };
        self.standing = match self.me.verb(event) {
            Some(AIRBORNE) => Standing::Free,
            Some(LAND | RETURN) => Standing::Bound,
            Some(LANDED | TAKEOFF | FOUND_AIRBORNE) => Standing::Grounded,
            _ => self.standing,
        };
    }
}
