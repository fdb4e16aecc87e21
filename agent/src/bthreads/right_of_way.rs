//! Right of way: one vehicle at a time in a narrow passage, wherever the others' programs run.
//!
//! The vehicle blocks `enter` for everyone else around the passage, awaits confirmation from every home, and only
//! then requests its own `enter` (*block, await confirmation, act*). Two that claim at once block each other; the
//! one with the higher number then gives way. Nothing but this block keeps the others out, so it is held until the
//! passage lies behind.
//!
//! A vehicle that is lost confirms nothing, and must not close every passage for ever. It is done without while most of
//! the fleet is in reach, unless it had a claim when it was lost: to claim one since, it would have needed the
//! confirmation of those who have lost it. So on a cut network one side at most goes on, and whoever was inside is
//! waited for. Whoever has just heard another again first lets claims cross, for as long as it takes to repeat them.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::facts::{BlockLapsed, Confirmed, PeerJoined, PeerLost, Stalled};
use skein_wire::event::{
    Advance, Declared as _, Enter, Homeward, Landed, Leave, Passage, of, of_every_vehicle,
};

use crate::{me::Me, precedence};

/// The name under which this b-thread runs, as confirmations name it.
pub const NAME: &str = "right_of_way";
/// Two passages nearer than this, per axis, are one: vehicles see the same opening from different sides.
const SAME_PASSAGE_M: f64 = 3.0;
/// A vehicle that gave way claims again when it hears that another has left a passage, or after this long.
const PATIENCE: Duration = Duration::from_secs(2);
/// Claims that were made apart are known to both sides so many leases after they have met again: records are repeated
/// every tenth of one.
const MEETING_LEASES: f64 = 1.5;

/// Claims a passage, enters it when the claim is confirmed, and lets go behind it.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct RightOfWay {
    me: Me,
    /// The other vehicles and the ground station.
    others: BTreeMap<String, Other>,
    /// The time that claims take to cross.
    meeting: Duration,
    /// No claim counts before this.
    met: Duration,
    phase: Phase,
}

/// The knowledge of another node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
enum Other {
    /// Not heard yet: it cannot have claimed anything.
    Unheard,
    Alive,
    /// Lost without a claim.
    Lost,
    /// Lost with a claim: it may be in a passage.
    LostClaiming,
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
    /// The b-thread of vehicle `me`; `others` are the other vehicles and the ground station, `lease` is that of their
    /// bids.
    pub fn new<'a>(me: Me, others: impl IntoIterator<Item = &'a str>, lease: Duration) -> Self {
        let others = others.into_iter().map(|node| (node.to_owned(), Other::Unheard)).collect();
        let meeting = lease.mul_f64(MEETING_LEASES);
        Self { me, others, meeting, met: Duration::ZERO, phase: Phase::Clear }
    }

    /// `enter` into the same passage, of everyone else.
    fn others_enter(&self, passage: &Event) -> EventSet {
        of_every_vehicle::<Enter>().and(self.me.any::<Enter>().not()).and(around(passage))
    }

    /// The same, without those whose confirmation is not needed.
    fn claim(&self, passage: &Event) -> EventSet {
        let alive = 1 + self.others.values().filter(|other| **other == Other::Alive).count();
        if 2 * alive <= self.others.len() + 1 {
            return self.others_enter(passage);
        }
        let needed =
            self.others.iter().filter(|(_, other)| matches!(other, Other::Alive | Other::LostClaiming));
        EventSet::any_of(needed.map(|(node, _)| of::<Enter>(node))).and(around(passage))
    }

    /// Whether the vehicle `other` goes first when both claim: the lower number does.
    fn goes_before_me(&self, other: &str) -> bool {
        // Facts name a remote b-thread `node#bthread`.
        let node = other.split('#').next().unwrap_or_default();
        let rank = |node: &str| node.rsplit('/').next().and_then(|number| number.parse::<u32>().ok());
        (rank(node), node) < (rank(self.me.name()), self.me.name())
    }

    /// Takes in that another node is heard or lost.
    fn note(&mut self, event: &Event, now: Duration) {
        let (node, now_it_is) = if let Some(joined) = PeerJoined::read(event) {
            (joined.node, Other::Alive)
        } else if let Some(lost) = PeerLost::read(event) {
            let claimed = lost.released.split(' ').any(|bthread| bthread == NAME);
            (lost.node, if claimed { Other::LostClaiming } else { Other::Lost })
        } else {
            return;
        };
        let Some(other) = self.others.get_mut(node.as_str()) else { return };
        *other = now_it_is;
        if now_it_is == Other::Alive {
            self.met = now + self.meeting;
        }
    }

    /// A claim is made anew, or, where two sides have just met, a little later.
    fn claim_again(&self, passage: Event, now: Duration) -> Phase {
        if now < self.met {
            Phase::Yielding { passage, until: self.met }
        } else {
            Phase::Claiming { passage }
        }
    }
}

/// The events about the same passage.
pub fn around(passage: &Event) -> EventSet {
    let [min, max] =
        [-SAME_PASSAGE_M, SAME_PASSAGE_M].map(|margin| centre(passage).map(|coordinate| coordinate + margin));
    EventSet::region(min, max)
}

pub fn entering(me: &Me, passage: &Event) -> Event {
    let [x, y, z] = centre(passage);
    me.event(Enter { x, y, z })
}

fn centre(passage: &Event) -> [f64; 3] {
    Passage::read(passage).map_or([0.0; 3], |Passage { x, y, z }| [x, y, z])
}

impl BThread for RightOfWay {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::COLLISION).wait_for(me.any::<(PeerJoined, PeerLost)>());
        let gone = me.any::<(Leave, Landed)>();
        Some(match &self.phase {
            Phase::Clear => bid.wait_for(me.any::<Passage>()),
            Phase::Claiming { passage } => bid
                .block(self.claim(passage))
                .block(me.any::<(Advance, Homeward)>())
                .wait_for(me.any::<Confirmed>())
                .wait_for(gone),
            Phase::Entering { passage } => bid
                .request(entering(me, passage))
                .block(self.claim(passage))
                .block(me.any::<(Advance, Homeward)>())
                .wait_for(me.any::<(Stalled, BlockLapsed)>())
                .wait_for(gone),
            Phase::Yielding { until, .. } => bid
                .block(me.any::<(Advance, Homeward)>())
                .wait_for(of_every_vehicle::<Leave>())
                .deadline(*until)
                .wait_for(gone),
            // Whoever comes back meanwhile stays out too.
            Phase::Inside { passage } => bid.block(self.others_enter(passage)).wait_for(gone),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        let (now, verb) = (cx.now(), self.me.verb(event));
        let fleet_changed = matches!(verb, Some(PeerJoined::NAME | PeerLost::NAME));
        if fleet_changed {
            self.note(event, now);
        }
        let confirmed = Confirmed::read(event).is_some_and(|fact| &*fact.bthread == NAME);
        let lapsed = BlockLapsed::read(event).is_some_and(|fact| &*fact.bthread == NAME);
        self.phase = match (self.phase.clone(), verb) {
            (_, Some(Leave::NAME | Landed::NAME)) => Phase::Clear,
            (Phase::Claiming { passage } | Phase::Entering { passage }, _) if fleet_changed => {
                self.claim_again(passage, now)
            }
            (phase, _) if fleet_changed => phase,
            (Phase::Clear, _) => self.claim_again(event.clone(), now),
            (Phase::Claiming { passage }, _) if confirmed => Phase::Entering { passage },
            (Phase::Entering { passage }, Some(Enter::NAME)) => Phase::Inside { passage },
            (Phase::Entering { passage }, _) if lapsed => Phase::Claiming { passage },
            (Phase::Entering { passage }, _)
                if Stalled::read(event).is_some_and(|stalled| {
                    stalled.event.ends_with(Enter::NAME) && self.goes_before_me(&stalled.by)
                }) =>
            {
                Phase::Yielding { passage, until: now + PATIENCE }
            }
            (Phase::Yielding { passage, until }, None) if self.met <= until => {
                self.met = Duration::ZERO;
                Phase::Claiming { passage }
            }
            // Time is up, or a vehicle that is not this one has left.
            (Phase::Yielding { passage, .. }, None) => self.claim_again(passage, now),
            (phase, _) => phase,
        };
    }
}
