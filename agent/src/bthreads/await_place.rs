//! Await place: a vehicle that is to land where another stays waits for that one, and lands beside it if that
//! lasts.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{Advance, Arrived, Declared as _, Goto, Land, Landed, PlaceFree, PlaceTaken};

use crate::{me::Me, precedence};

/// Time that a vehicle waits in all on the way to one waypoint, for one that stays.
pub const PATIENCE: Duration = Duration::from_secs(20);
/// The same, for one that is on its way elsewhere: it may wait for others itself.
pub const LONG_PATIENCE: Duration = Duration::from_secs(90);

/// Blocks `advance` while another vehicle has the place of the mission's leg; requests `land` once it has
/// waited for [`PATIENCE`] or [`LONG_PATIENCE`]. The way home is not waited on, nor is an operator's point: those end near the
/// place.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct AwaitPlace {
    me: Me,
    /// The rest of the patience with who stays.
    left: Duration,
    /// The same with who is on its way.
    left_with_leaving: Duration,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Free,
    Waiting { by: String, since: Duration, leaves: bool },
    GivingUp { by: String },
}

impl AwaitPlace {
    pub fn new(me: Me) -> Self {
        Self { me, left: PATIENCE, left_with_leaving: LONG_PATIENCE, phase: Phase::Free }
    }

    /// The rest of the patience with one that stays or leaves.
    fn left(&mut self, leaves: bool) -> &mut Duration {
        if leaves { &mut self.left_with_leaving } else { &mut self.left }
    }

    fn waits_for(&self, event: &Event, now: Duration) -> Phase {
        let Some(PlaceTaken { leg, by, leaves }) = PlaceTaken::read(event) else { return Phase::Free };
        match self.phase {
            Phase::Free | Phase::GivingUp { .. } if leg < 0 => Phase::Free,
            _ => Phase::Waiting { by: by.to_string(), since: now, leaves },
        }
    }
}

impl BThread for AwaitPlace {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::MISSION);
        let over = me.any::<(Goto, Arrived, Land, Landed)>();
        Some(match &self.phase {
            Phase::Free => bid.wait_for(me.any::<(PlaceTaken, Goto)>()),
            Phase::Waiting { since, leaves, .. } => bid
                .block(me.any::<Advance>())
                .wait_for(me.any::<(PlaceTaken, PlaceFree)>())
                .wait_for(over)
                .deadline(*since + if *leaves { self.left_with_leaving } else { self.left }),
            Phase::GivingUp { by } => {
                let why = format!("{by} stays where it was to land");
                bid.request(me.event(Land { why: why.as_str().into() })).wait_for(over)
            }
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        let verb = self.me.verb(event);
        let phase = match (&self.phase, verb) {
            (Phase::Waiting { by, .. }, None) => Phase::GivingUp { by: by.clone() },
            (_, Some(PlaceTaken::NAME)) => self.waits_for(event, cx.now()),
            _ => Phase::Free,
        };
        match (self.phase.clone(), verb) {
            (_, Some(Goto::NAME)) => (self.left, self.left_with_leaving) = (PATIENCE, LONG_PATIENCE),
            (Phase::Waiting { since, leaves, .. }, Some(PlaceFree::NAME | PlaceTaken::NAME)) => {
                let left = self.left(leaves);
                *left = left.saturating_sub(cx.now().saturating_sub(since));
            }
            _ => {}
        }
        self.phase = phase;
    }
}
