//! Reposition: flies to where an operator points, and hovers there until the mission is resumed.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{
    Airborne, Declared as _, Declined, FoundAirborne, Goto, Land, Landed, OrderTaken, Return, Takeoff, What,
};

use crate::{me::Me, precedence};

/// The leg number of an operator's point.
pub const OPERATOR_LEG: i64 = -2;
/// The vehicle's other b-threads may keep it from setting out for so long before the order is declined.
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
    pub fn new(me: Me) -> Self {
        Self { me, standing: Standing::Grounded, task: Task::Nothing }
    }

    fn goto(&self, order: &OrderTaken) -> Option<Event> {
        let [x, y, z] = order.place()?;
        Some(self.me.event(Goto { leg: OPERATOR_LEG, lands: false, x, y, z }))
    }

    fn answer(&self, order: &OrderTaken, now: Duration) -> Task {
        let declining = |why: &str| Task::Declining { why: why.to_owned() };
        match (self.standing, self.goto(order)) {
            (Standing::Free, Some(to)) => Task::Turning { to, until: now + PATIENCE },
            (Standing::Free, None) => declining("it names no point"),
            _ => declining("it is not free to go: on the ground, climbing, landing or returning"),
        }
    }
}

impl BThread for Reposition {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::LINK).wait_for(match self.standing {
            Standing::Grounded => me.any::<(OrderTaken, Airborne, Land, Return)>(),
            Standing::Free => me.any::<(OrderTaken, Land, Return, Landed)>(),
            Standing::Bound => me.any::<(OrderTaken, Landed, Takeoff, FoundAirborne)>(),
        });
        Some(match &self.task {
            Task::Nothing => bid,
            Task::Turning { to, until } => bid.request(to.clone()).deadline(*until),
            Task::Declining { why } => {
                bid.request(me.event(Declined { what: What::GoTo, why: why.as_str().into() }))
            }
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        let goto = self.me.read::<OrderTaken>(event).filter(|order| order.what == What::GoTo);
        self.task = match (goto, &self.task, self.me.verb(event)) {
            (Some(order), ..) => self.answer(&order, cx.now()),
            // Another order takes the place of this one.
            (None, Task::Declining { why }, Some(OrderTaken::NAME)) => Task::Declining { why: why.clone() },
            (None, Task::Turning { .. }, None) => {
                Task::Declining { why: "the vehicle blocks it: outside the geofence, or held".into() }
            }
            _ => Task::Nothing,
        };
        self.standing = match self.me.verb(event) {
            Some(Airborne::NAME) => Standing::Free,
            Some(Land::NAME | Return::NAME) => Standing::Bound,
            Some(Landed::NAME | Takeoff::NAME | FoundAirborne::NAME) => Standing::Grounded,
            _ => self.standing,
        };
    }
}
