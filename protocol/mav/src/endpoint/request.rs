//! Requests of stations to an autopilot.

use mavlink::dialects::common::MavCmd;
use nalgebra::Vector3;

use crate::address::Address;
use crate::external::External;
use crate::mode::FlightMode;
use crate::set_point::SetPoint;

/// A command to the vehicle. Positions and heights are in the world's ENU frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AutopilotCommand {
    /// Let the motors turn.
    Arm {
        /// Without the checks.
        force: bool,
    },
    /// Stop the motors.
    Disarm {
        /// Even in the air.
        force: bool,
    },
    /// Climb straight up.
    Takeoff {
        /// World height to climb to, m; `None` for the autopilot's own.
        z_m: Option<f64>,
    },
    /// Change the flight mode.
    SetMode(FlightMode),
    /// Fly to a place and stay there.
    GoTo { position: Vector3<f64> },
    /// Fly this fast in the modes in which the autopilot chooses the speed itself.
    SetSpeed {
        /// Ground speed, m/s.
        speed_m_s: f64,
    },
    SetHome {
        /// In m; `None` for here.
        position: Option<Vector3<f64>>,
    },
    /// Continue the mission with this item, counted from 0.
    SetMissionItem(u16),
}

/// The right and duty to answer one command.
#[derive(Debug, PartialEq)]
pub struct Ticket {
    pub(super) from: Address,
    pub(super) command: MavCmd,
    /// Some messages of old ask for something and expect no acknowledgement.
    pub(super) acknowledged: bool,
}

/// Something a station asks of the autopilot.
#[derive(Debug, PartialEq)]
pub enum Request {
    /// A command, to be answered through [`Endpoint::answer`](crate::Endpoint::answer).
    Command {
        /// To answer with.
        ticket: Ticket,
        command: AutopilotCommand,
        from: Address,
    },
    /// A set-point.
    SetPoint { set_point: SetPoint, from: Address },
    /// An estimate of the vehicle's motion, to fly by where there is nothing better.
    External(Box<External>),
    /// A pilot's sticks, each -1..1.
    Sticks {
        forward: f64,
        left: f64,
        up: f64,
        /// Counter-clockwise from above.
        turn_left: f64,
    },
    /// A station set a parameter; the table has its value.
    ParameterChanged { name: &'static str },
    /// The mission was replaced or cleared.
    MissionChanged,
    /// There is another geofence, or there are other rally points.
    PlacesChanged,
}
