//! Navigation control: asks leave to move, one navigation cycle at a time.
//!
//! Whoever blocks `advance`, here or on another node, holds the vehicle: without fresh leave the pipeline hovers.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{Advance, Ahead, Arrived, Declared as _, Goto, Homeward, Land, Landed, Planned};

use crate::bthreads::HOME_LEG;
use crate::{me::Me, precedence};

/// The length of a leave to move: one navigation cycle.
pub const CYCLE: Duration = Duration::from_millis(100);

/// Requests `advance`, or on the way home `homeward`, once in each navigation cycle while there is a path to follow.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Navigation {
    me: Me,
    homeward: bool,
    /// Where leave to move leads, as long as somebody wants to know.
    ahead: Option<Event>,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Idle,
    Asking,
    Moving { until: Duration },
}

impl Navigation {
    pub fn new(me: Me) -> Self {
        Self { me, homeward: false, ahead: None, phase: Phase::Idle }
    }

    /// The leave that is asked for: with the place where it leads, so that whoever minds only some places can say so.
    fn leave(&self) -> Event {
        if self.homeward {
            return self.me.event(Homeward);
        }
        let place = self.ahead.iter().flat_map(Event::data);
        place.fold(self.me.event(Advance::ANYWHERE), |leave, (axis, coordinate)| {
            leave.with(axis, coordinate.clone())
        })
    }
}

impl BThread for Navigation {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::MISSION).wait_for(me.any::<Ahead>());
        let no_path_left = me.any::<(Arrived, Goto, Land, Landed)>();
        Some(match self.phase {
            Phase::Idle => bid.wait_for(me.any::<Planned>()),
            Phase::Asking => bid.request(self.leave()).wait_for(no_path_left),
            Phase::Moving { until } => bid.wait_for(no_path_left).deadline(until),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        match self.me.verb(event) {
            Some(Ahead::NAME) => {
                self.ahead = Some(event.clone());
                return;
            }
            Some(Planned::NAME) => {
                self.homeward = Planned::read(event).is_some_and(|path| path.leg == HOME_LEG);
                self.ahead = None;
            }
            _ => {}
        }
        self.phase = match self.me.verb(event) {
            Some(Planned::NAME) | None => Phase::Asking,
            Some(Advance::NAME | Homeward::NAME) => Phase::Moving { until: cx.now() + CYCLE },
            _ => Phase::Idle,
        };
    }
}
