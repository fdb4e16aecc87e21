//! A vehicle's state, as its neighbours and the ground see it, on `state/<node>`.

use std::time::Duration;

use nalgebra::Vector3;
use skein_bp::Bound;
use skein_dbp::NodeName;

use super::field::{
    Result, at_most, finite, node, not_negative, ns, out_of_range, place, required, same_variants, text,
    vector, words,
};
use super::record::{Addressee, Kind, Record};
use crate::decode_error::DecodeError;
use crate::event::Right;
use crate::proto;
use crate::zone::Zone;

/// A vehicle's state. World frame ENU, SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    pub node: NodeName,
    pub incarnation: u64,
    /// When the position was measured, on the vehicle's clock.
    pub time: Duration,
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
    pub armed: bool,
    /// Share of the battery's energy left, 0 to 1.
    pub battery: f64,
    /// Its task, for people.
    pub task: String,
    /// Its reason to wait; empty if it does not.
    pub waiting_for: String,
    /// Points of the way ahead, metres, along which others make way; only the first [`State::MAX_PATH`] travel.
    pub path: Vec<Vector3<f64>>,
    pub mission: MissionState,
    /// The names of the scripts that run on it; only the first [`State::MAX_SCRIPTS`] travel.
    pub scripts: Vec<String>,
    /// The names of the zones that it has regard for, because somebody has drawn them; only the first
    /// [`State::MAX_ZONES`] travel.
    pub zones: Vec<String>,
    /// The person or program whose orders it takes; empty while nobody holds it.
    pub holder: String,
    /// The person or program that asks the holder for it; empty if nobody does.
    pub asked_by: String,
    /// Its right to go first where there is room for one.
    pub right: Right,
    /// Time that it still has to fly to the end of its mission at its cruise speed, s: while it flies there, to arrive
    /// together with others.
    pub to_go_s: Option<f64>,
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

/// The progress of a vehicle's mission.
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
    /// So many points of a path travel.
    pub const MAX_PATH: usize = 32;
    /// So many names of scripts travel.
    pub const MAX_SCRIPTS: usize = 8;

    /// So many names of zones travel.
    pub const MAX_ZONES: usize = 2 * Zone::MOST;

    /// A vehicle that stands disarmed at the origin with a full battery: a start to fill in.
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
            zones: Vec::new(),
            holder: String::new(),
            asked_by: String::new(),
            right: Right::Free,
            to_go_s: None,
            echo: None,
        }
    }
}

impl State {
    /// Brings radius, position error and speed down to the most that a neighbour is believed; says whether radius or
    /// speed was beyond. Who does not know its place yet says so rightly.
    pub fn bring_to_what_is_believed(&mut self) -> bool {
        let before = (self.radius_m, self.velocity);
        self.radius_m = self.radius_m.min(Bound::RadiusMetres.most_real());
        self.position_sigma_m = self.position_sigma_m.min(Bound::SigmaMetres.most_real());
        // A number near the largest has a length beyond all numbers.
        let fastest = Bound::SpeedMetresPerSecond.most_real();
        self.velocity = self.velocity.map(|speed| speed.clamp(-fastest, fastest)).cap_magnitude(fastest);
        before != (self.radius_m, self.velocity)
    }
}

impl Record for State {
    const KIND: Kind =
        Kind { word: "state", addressee: Addressee::All, every_node_listens: true, bytes: Bound::StateBytes };

    fn sender(&self) -> Option<&NodeName> {
        Some(&self.node)
    }
}

same_variants!(Right, proto::Right: Free, Inside, Cornered);
same_variants!(MissionState, proto::Mission: UnderWay, Complete, Failed);

impl From<&State> for proto::State {
    fn from(state: &State) -> Self {
        Self {
            node: text(&state.node),
            incarnation: state.incarnation,
            time_ns: ns(state.time),
            position: Some((&state.position).into()),
            velocity: Some((&state.velocity).into()),
            yaw_rad: state.yaw_rad,
            position_sigma_m: state.position_sigma_m,
            radius_m: state.radius_m,
            mode: words(&state.mode),
            armed: state.armed,
            battery: state.battery,
            task: words(&state.task),
            waiting_for: words(&state.waiting_for),
            path: state.path.iter().take(State::MAX_PATH).map(Into::into).collect(),
            mission: proto::Mission::from(state.mission).into(),
            scripts: state.scripts.iter().take(State::MAX_SCRIPTS).cloned().collect(),
            zones: state.zones.iter().take(State::MAX_ZONES).cloned().collect(),
            holder: words(&state.holder),
            asked_by: words(&state.asked_by),
            right: proto::Right::from(state.right).into(),
            to_go_s: state.to_go_s,
            echo: state.echo.as_ref().map(|echo| proto::Echo {
                node: text(&echo.node),
                incarnation: echo.incarnation,
                time_ns: ns(echo.time),
                held_ns: ns(echo.held),
            }),
        }
    }
}

impl TryFrom<proto::State> for State {
    type Error = DecodeError;

    fn try_from(state: proto::State) -> Result<Self> {
        at_most("State.path", state.path.len(), Self::MAX_PATH, "at most 32 points")?;
        at_most("State.scripts", state.scripts.len(), Self::MAX_SCRIPTS, "at most 8 names")?;
        at_most("State.zones", state.zones.len(), Self::MAX_ZONES, "at most 64 names")?;
        if !(0.0..=1.0).contains(&state.battery) {
            return Err(out_of_range("State.battery", state.battery, "a share from 0 to 1"));
        }
        Ok(Self {
            node: node("State.node", &state.node)?,
            incarnation: state.incarnation,
            time: Duration::from_nanos(state.time_ns),
            position: place("State.position", &required("State.position", state.position)?)?,
            velocity: vector("State.velocity", &required("State.velocity", state.velocity)?)?,
            yaw_rad: finite("State.yaw_rad", state.yaw_rad)?,
            position_sigma_m: not_negative("State.position_sigma_m", state.position_sigma_m)?,
            radius_m: not_negative("State.radius_m", state.radius_m)?,
            mode: words(state.mode),
            armed: state.armed,
            battery: state.battery,
            task: words(state.task),
            waiting_for: words(state.waiting_for),
            path: state.path.iter().map(|point| place("State.path", point)).collect::<Result<_>>()?,
            // In a word of a later version, it is not over as far as this one can tell.
            mission: proto::Mission::try_from(state.mission).unwrap_or_default().into(),
            scripts: state.scripts.into_iter().map(words).collect(),
            zones: state.zones.into_iter().map(words).collect(),
            holder: words(state.holder),
            asked_by: words(state.asked_by),
            right: proto::Right::try_from(state.right).unwrap_or_default().into(),
            to_go_s: state.to_go_s.map(|to_go_s| not_negative("State.to_go_s", to_go_s)).transpose()?,
            echo: state.echo.map(Echo::try_from).transpose()?,
        })
    }
}

impl TryFrom<proto::Echo> for Echo {
    type Error = DecodeError;

    fn try_from(echo: proto::Echo) -> Result<Self> {
        Ok(Self {
            node: node("Echo.node", &echo.node)?,
            incarnation: echo.incarnation,
            time: Duration::from_nanos(echo.time_ns),
            held: Duration::from_nanos(echo.held_ns),
        })
    }
}
