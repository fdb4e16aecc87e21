//! A vehicle's state, as its neighbours and the ground see it.

use std::time::Duration;

use nalgebra::Vector3;
use skein_dbp::NodeName;

/// A vehicle's state. World frame ENU, SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    pub node: NodeName,
    pub incarnation: u64,
    /// When the position was measured, on the vehicle's clock.
    pub time: Duration,
    /// Position, metres.
    pub position: Vector3<f64>,
    /// Velocity, metres per second.
    pub velocity: Vector3<f64>,
    /// Heading, radians, counter-clockwise from east.
    pub yaw_rad: f64,
    /// Standard deviation of the position in each axis, metres.
    pub position_sigma_m: f64,
    /// Radius of the sphere that holds the vehicle, metres.
    pub radius_m: f64,
    /// The autopilot's mode.
    pub mode: String,
    /// Whether the motors are armed.
    pub armed: bool,
    /// Share of the battery's energy left, 0 to 1.
    pub battery: f64,
    /// What the vehicle is about.
    pub task: String,
    /// What it waits for, empty if for nothing.
    pub waiting_for: String,
    /// Points of the planned path, metres, for display; only the first [`State::MAX_PATH`] travel.
    pub path: Vec<Vector3<f64>>,
    /// How far its mission is.
    pub mission: MissionState,
    /// The names of the scripts that run on it; only the first [`State::MAX_SCRIPTS`] travel.
    pub scripts: Vec<String>,
    /// The last word of one other vehicle, each in turn: from it that one learns how long messages take.
    pub echo: Option<Echo>,
}

/// A state that was heard, told back.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Echo {
    pub node: NodeName,
    pub incarnation: u64,
    /// Its time, on the clock of that node.
    pub time: Duration,
    /// Time from its arrival until it was told back.
    pub held: Duration,
}

/// How far a vehicle's mission is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MissionState {
    #[default]
    UnderWay,
    /// It did what it was sent for, and stands on the ground.
    Complete,
    /// It did not, and stands on the ground; its task says why.
    Failed,
}

impl State {
    /// How many points of a path travel.
    pub const MAX_PATH: usize = 32;
    /// How many names of scripts travel.
    pub const MAX_SCRIPTS: usize = 8;

    /// A vehicle that stands disarmed at the origin with a full battery: a start to fill in.
    #[must_use]
    pub fn new(node: NodeName) -> Self {
        Self {
            node,
            incarnation: 0,
            time: Duration::ZERO,
            position: Vector3::zeros(),
            velocity: Vector3::zeros(),
            yaw_rad: 0.0,
            position_sigma_m: 0.0,
            radius_m: 0.25,
            mode: String::new(),
            armed: false,
            battery: 1.0,
            task: String::new(),
            waiting_for: String::new(),
            path: Vec::new(),
            mission: MissionState::default(),
            scripts: Vec::new(),
            echo: None,
        }
    }
}
