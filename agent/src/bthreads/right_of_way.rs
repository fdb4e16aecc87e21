//! Right of way: one vehicle at a time in a narrow passage, wherever the others' programs run.
//!
//! The vehicle blocks `enter` for everyone else around the passage, awaits confirmation from every home, and only
//! then requests its own `enter` (*block, await confirmation, act*). Two that claim at once block each other; the
//! one with the higher number then gives way. Nothing but this block keeps the others out, so it is held until the
//! passage lies behind.

use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::facts::{BLOCK_LAPSED, CONFIRMED, STALLED};
use skein_wire::vocabulary::{ADVANCE, ENTER, HOMEWARD, LANDED, LEAVE, PASSAGE, of_every_vehicle};

use crate::{me::Me, precedence};

/// The name under which this b-thread runs, as confirmations name it.
pub const NAME: &str = "right_of_way";
/// Two passages nearer than this, per axis, are one: vehicles see the same opening from different sides.
const SAME_PASSAGE_M: f64 = 3.0;
/// A vehicle that gave way claims again when it hears that another has left a passage, or after this long.
const PATIENCE: Duration = Duration::from_secs(2);

/// Claims a passage, enters it when the claim is confirmed, and lets go behind it.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct RightOfWay {
    me: Me,
    phase: Phase,
}

/// `passage` is the event that announced it, with the centre in `x`, `y`, `z`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Clear,
    Claiming { passage: Event },
    Entering { passage: Event },
    Yielding { passage: Event, until: Duration },
    Inside { passage: Event },
}

impl RightOfWay {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        Self { me, phase: Phase::Clear }
    }

    /// Everyone else's `enter` into the same passage.
    fn others_enter(&self, passage: &Event) -> EventSet {
        let [min, max] = [-SAME_PASSAGE_M, SAME_PASSAGE_M]
            .map(|margin| centre(passage).map(|coordinate| coordinate + margin));
        EventSet::And(vec![
            of_every_vehicle(ENTER),
            EventSet::Not(Box::new(self.me.any(ENTER))),
            EventSet::region(min, max),
        ])
    }

    fn enter(&self, passage: &Event) -> Event {
        let [x, y, z] = centre(passage);
        self.me.event(ENTER).with("x", x).with("y", y).with("z", z)
    }

    /// Whether the vehicle `other` goes first when both claim: the lower number does.
    fn goes_before_me(&self, other: &str) -> bool {
        // Facts name a remote b-thread `node#bthread`.
        let node = other.split('#').next().unwrap_or_default();
        let rank = |node: &str| node.rsplit('/').next().and_then(|number| number.parse::<u32>().ok());
        (rank(node), node) < (rank(self.me.name()), self.me.name())
    }
}

fn centre(passage: &Event) -> [f64; 3] {
    ["x", "y", "z"].map(|axis| passage.real(axis).unwrap_or_default())
}

impl BThread for RightOfWay {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::COLLISION);
        let gone = me.any_of(&[LEAVE, LANDED]);
        Some(match &self.phase {
            Phase::Clear => bid.wait_for(me.any(PASSAGE)),
            Phase::Claiming { passage } => bid
                .block(self.others_enter(passage))
                .block(me.any_of(&[ADVANCE, HOMEWARD]))
                .wait_for(me.any(CONFIRMED))
                .wait_for(gone),
            Phase::Entering { passage } => bid
                .request(self.enter(passage))
                .block(self.others_enter(passage))
                .block(me.any_of(&[ADVANCE, HOMEWARD]))
                .wait_for(me.any_of(&[STALLED, BLOCK_LAPSED]))
                .wait_for(gone),
            Phase::Yielding { until, .. } => bid
                .block(me.any_of(&[ADVANCE, HOMEWARD]))
                .wait_for(of_every_vehicle(LEAVE))
                .deadline(*until)
                .wait_for(gone),
            Phase::Inside { passage } => bid.block(self.others_enter(passage)).wait_for(gone),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        let verb = self.me.verb(event);
        self.phase = match (self.phase.clone(), verb) {
            (_, Some(LEAVE | LANDED)) => Phase::Clear,
            (Phase::Clear, _) => Phase::Claiming { passage: event.clone() },
            (Phase::Claiming { passage }, Some(CONFIRMED)) if event.text("bthread") == Some(NAME) => {
                Phase::Entering { passage }
            }
            (Phase::Entering { passage }, Some(ENTER)) => Phase::Inside { passage },
            (Phase::Entering { passage }, Some(BLOCK_LAPSED)) if event.text("bthread") == Some(NAME) => {
                Phase::Claiming { passage }
            }
            (Phase::Entering { passage }, Some(STALLED))
                if event.text("event").is_some_and(|stalled| stalled.ends_with(ENTER))
                    && self.goes_before_me(event.text("by").unwrap_or_default()) =>
            {
                Phase::Yielding { passage, until: cx.now() + PATIENCE }
            }
            // Time is up, or a vehicle that is not this one has left.
            (Phase::Yielding { passage, .. }, None) => Phase::Claiming { passage },
            (phase, _) => phase,
        };
    }
}
