//! Instructions: what the mission tells the control loop to do, from the events that were selected.

use nalgebra::Vector3;
use skein_bp::Event;
use skein_wire::event::{
    Advance, Declared as _, FlyBy, Goto, HandBack, Hold, Homeward, Land, Landed, MakeWay, OrderTaken, Plan,
    PlanReason, Takeoff,
};

use crate::bthreads::HOME_LEG;
use crate::config::PositionSource;
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
    /// Use it to make way for who was said to need it.
    MakeWay,
    /// Fly by this source of position, or by none but inertia and flow.
    FlyBy(Option<PositionSource>),
    /// The flight is over.
    EndFlight,
}

/// A place to fly to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    pub leg: i64,
    /// World ENU, m.
    pub target: Vector3<f64>,
    pub lands: bool,
    /// Whether it is where the way home ends.
    pub is_home: bool,
    /// Time from there to the end of the mission at cruise speed, s; none if the mission does not lead there.
    pub beyond_s: Option<f64>,
}

impl Instruction {
    pub fn of(me: &Me, event: &Event) -> Option<Self> {
        Some(match me.verb(event)? {
            Takeoff::NAME => Self::TakeOff,
            Land::NAME => Self::Land,
            Hold::NAME => Self::Hold,
            HandBack::NAME => Self::TakeBack,
            OrderTaken::NAME if OrderTaken::read(event)?.what.releases() => Self::Resume,
            Goto::NAME => Self::GoTo(Goto::read(event)?.into()),
            Plan::NAME => Self::Plan { is_stuck: Plan::read(event)?.why == PlanReason::Stuck },
            Advance::NAME | Homeward::NAME => Self::GrantLeave,
            MakeWay::NAME => Self::MakeWay,
            FlyBy::NAME => Self::FlyBy(PositionSource::named(&FlyBy::read(event)?.source)),
            Landed::NAME => Self::EndFlight,
            _ => return None,
        })
    }
}

impl From<Goto> for Waypoint {
    fn from(Goto { leg, lands, x, y, z }: Goto) -> Self {
        Self { leg, target: Vector3::new(x, y, z), lands, is_home: leg == HOME_LEG, beyond_s: None }
    }
}
