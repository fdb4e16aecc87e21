//! MAVLink without I/O: frames, set-points, commands, mission and parameter protocols, at both ends of the
//! link.
//!
//! - [`Companion`] is the end of a vehicle's program. It flies PX4, ArduPilot and Skein's built-in autopilot.
//!   What they do differently is a [`Dialect`], chosen by the heartbeat from the list [`DIALECTS`].
//! - [`Endpoint`] is the end of an autopilot: what Skein's built-in one is reached through.
//! - [`Station`] is somebody else on the same line, whose orders take the vehicle over.
//! - [`FrameReader`] and [`FrameWriter`] are the packets under both.
//! - [`Datum`] and the [`axes`] are the only place where north-east-down and forward-right-down exist. All
//!   that enters and leaves this crate is ENU about one datum, with bodies FLU.
//!
//! Nothing here reads a clock or a socket: time is the run's `now`, and bytes are passed in and taken out.
//!
//! ```
//! use std::time::Duration;
//! use skein_mav::{Companion, CompanionConfig, Datum, SetPoint};
//!
//! let datum = Datum::from_degrees(47.397742, 8.545594, 488.0);
//! let mut companion = Companion::new(CompanionConfig::new(1, datum));
//! let now = Duration::from_millis(20);
//! companion.receive(now, b"bytes from a socket");
//! companion.tick(now);
//! let velocity = nalgebra::Vector3::new(1.0, 0.0, 0.0);
//! companion.set_point(now, SetPoint::Velocity { velocity, yaw: None });
//! let bytes_for_the_socket = companion.take_output();
//! # assert!(!bytes_for_the_socket.is_empty());
//! ```

// MAVLink marks messages and frames as superseded that deployed autopilots and ground stations still send.
#![expect(deprecated)]

mod address;
pub mod axes;
mod command;
mod companion;
mod dialect;
mod dialects;
mod ekf_status;
mod endpoint;
mod event;
mod external;
mod failsafe;
mod frame;
mod geodesy;
mod handling;
mod measured;
mod mission;
mod mode;
mod parameter;
mod patience;
mod set_point;
mod signing;
pub mod simulator;
mod station;
mod telemetry;
mod unparsed;

pub use address::Address;
pub use command::{Command, CommandResult};
pub use companion::{Companion, CompanionConfig};
pub use dialect::Dialect;
pub use dialects::{ARDUPILOT, DIALECTS, px4};
pub use endpoint::{
    AutopilotCommand, Endpoint, EndpointConfig, Parameter, ParameterError, ParameterTable, Request, Ticket,
    VehicleState,
};
pub use event::MavEvent;
pub use external::External;
pub use failsafe::Failsafe;
pub use frame::{Frame, FrameReader, FrameWriter};
pub use geodesy::{Datum, Geodetic, LocalFrame};
pub use handling::Handling;
pub use mavlink::dialects::common as messages;
pub use measured::{Distance, Flow, Inertial, Measured};
pub use mission::{MAX_ITEMS, MissionError, MissionItem};
pub use mode::FlightMode;
pub use parameter::{ParameterEncoding, ParameterValue};
pub use set_point::SetPoint;
pub use signing::{Refused, Signing, SigningKey, SigningTime};
pub use station::Station;
pub use telemetry::{Battery, HEARTBEAT_TIMEOUT, Landed, Severity, Stamped, Telemetry, Text};
