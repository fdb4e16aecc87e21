//! Instructions: what the mission tells the control loop to do, from the events that were selected.

use nalgebra::Vector3;
use skein_bp::Event;
use skein_wire::vocabulary::{ADVANCE, GOTO, HAND_BACK, HOLD, HOMEWARD, LAND, LANDED, ORDER, PLAN, TAKEOFF};

use crate::bthreads::HOME_LEG;
use crate::me::Me;

/// Something to be done on the vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Instruction {
    TakeOff,
    Land,
    /// Hold a vehicle that was found in the air.
    Hold,
    /// Take the vehicle back from whoever has it.
    TakeBack,
    /// Fly on with a vehicle that was found in the air.
    Resume,
    /// Take this as the waypoint to plan to.
    GoTo(Waypoint),
    /// Plan a path to the waypoint; around neighbours that stand still, if nothing else has helped.
    Plan {
        is_stuck: bool,
    },
    /// Leave to move for one navigation cycle.
    GrantLeave,
    /// The flight is over.
    EndFlight,
}

/// A place to fly to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    pub leg: i64,
    /// World ENU, m.
    pub target: Vector3<f64>,
    /// Whether the vehicle lands there.
    pub lands: bool,
    /// Whether it is where the way home ends.
    pub is_home: bool,
}

impl Instruction {
    /// The instruction in an event of vehicle `me`, if there is one.
    #[must_use]
    pub fn of(me: &Me, event: &Event) -> Option<Self> {
        Some(match me.verb(event)? {
            TAKEOFF => Self::TakeOff,
            LAND => Self::Land,
            HOLD => Self::Hold,
            HAND_BACK => Self::TakeBack,
            ORDER if matches!(event.text("what"), Some("resume" | "return")) => Self::Resume,
            GOTO => Self::GoTo(Waypoint::of(event)?),
            PLAN => Self::Plan { is_stuck: event.text("why") == Some("stuck") },
            ADVANCE | HOMEWARD => Self::GrantLeave,
            LANDED => Self::EndFlight,
            _ => return None,
        })
    }
}

impl Waypoint {
    fn of(goto: &Event) -> Option<Self> {
        let leg = goto.int("leg")?;
        let target = Vector3::new(goto.real("x")?, goto.real("y")?, goto.real("z")?);
        let lands = goto.bool("lands").unwrap_or(true);
        Some(Self { leg, target, lands, is_home: leg == HOME_LEG })
    }
}
