//! A behaviour of one's own: vehicles dwell at each waypoint. [docs/first-behaviour.md](../../../docs/first-behaviour.md)
//! explains it.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use skein_agent::bthreads::{HOME_LEG, OPERATOR_LEG};
use skein_agent::verify::Requirement;
use skein_agent::{Me, field, precedence};
use skein_bp::behaviour::{Behaviour, Behaviours, Host, Model};
use skein_bp::catalogue::Declaration;
use skein_bp::{BThread, Bid, Context, Event, EventSet, Program};
use skein_wire::event::{Arrived, Events, Goto, Land, Landed, Return};

/// Adds the behaviours of this crate to a program.
pub fn behaviours(known: &mut Behaviours) {
    known.add::<Dwell>();
}

/// Dwells at each waypoint but the last, where the vehicle lands.
#[derive(Debug, Deserialize)]
pub struct Dwell {
    /// How long, in seconds.
    #[serde(deserialize_with = "field::positive")]
    for_s: f64,
}

skein_bp::events! {
    /// The events of this crate.
    pub const EVENTS;

    /// The vehicle has dwelt at a waypoint, and flies on.
    Dwelt = "dwelt", Own {
        /// The number of the waypoint, from 0.
        leg: i64,
    }
}

impl Behaviour for Dwell {
    const NAME: &'static str = "dwell";
    const NODES: &'static str = "uav/*";
    const EVENTS: &'static [Declaration] = EVENTS;

    fn load(&self, host: &Host<'_>, program: &mut Program) {
        let lasts = Duration::try_from_secs_f64(self.for_s).unwrap_or(Duration::MAX / 2);
        program.add(Self::NAME, Dwelling { me: Me::new(host.node), lasts, phase: Phase::Flying });
    }

    fn model(&self, host: &Host<'_>, model: &mut Model<'_>) {
        let me = Me::new(host.node);
        let rule = "between arriving and having dwelt, the mission does not go on";
        let (onward, here) = (of_mission::<Goto>(&me), of_mission::<Arrived>(&me));
        let left = Dwelt::any_at(host.node).or(elsewhere(&me));
        model.require(rule, Requirement::absence(rule, onward, here, left));
    }
}

/// The events of this type about waypoints of the mission, whose numbers begin at 0.
fn of_mission<E: Events>(me: &Me) -> EventSet {
    me.any::<E>().and(EventSet::field_range("leg", 0.0, f64::MAX))
}

/// What leads a vehicle elsewhere: to an operator's point, home, or down.
fn elsewhere(me: &Me) -> EventSet {
    let away = Goto::leg(OPERATOR_LEG).or(Goto::leg(HOME_LEG));
    me.any::<Goto>().and(away).or(me.any::<(Return, Land, Landed)>())
}

/// Blocks the mission's next `goto` for a while after each `arrived`, then tells that it has.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Dwelling {
    me: Me,
    lasts: Duration,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Flying,
    There { leg: i64, until: Duration },
    Over { leg: i64 },
}

impl BThread for Dwelling {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().priority(precedence::MISSION);
        let stays = || bid.clone().block(of_mission::<Goto>(&self.me)).wait_for(elsewhere(&self.me));
        Some(match self.phase {
            Phase::Flying => bid.wait_for(of_mission::<Arrived>(&self.me)),
            Phase::There { until, .. } => stays().deadline(until),
            Phase::Over { leg } => stays().request(self.me.event(Dwelt { leg })),
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        self.phase = match (&self.phase, event.int("leg"), self.me.verb(event)) {
            (Phase::Flying, Some(leg), _) => Phase::There { leg, until: cx.now() + self.lasts },
            // The deadline has passed.
            (Phase::There { leg, .. }, _, None) => Phase::Over { leg: *leg },
            _ => Phase::Flying,
        };
    }
}
