//! Measurements, and those that the state would give.

use std::time::Duration;

use nalgebra::{
    Matrix1, Matrix2, Matrix3, Matrix6, RowSVector, RowVector3, SMatrix, Vector1, Vector2, Vector3, Vector6,
};

use super::health::{Aid, Weighed};
use super::state::{ATTITUDE, FLOW_SCALE, POSITION, PRESSURE_OFFSET, RATE_BIAS, SIZE, State, VELOCITY};
use crate::fix::{PlanarFix, PoseFix};

/// Quantiles of chi-square at 99.9 %, for 1, 2, 3 and 6 degrees of freedom.
const ONE: f64 = 10.83;
const TWO: f64 = 13.82;
const THREE: f64 = 16.27;
const SIX: f64 = 22.46;
/// Beyond this tilt a beam along the body's axis says nothing of the height, as a cosine.
const LEAST_UPRIGHT: f64 = 0.7;
/// Nearer than this to the ground flow is no angle, m.
const LEAST_DISTANCE_M: f64 = 0.05;

/// Optical flow of the ground, without the vehicle's own turning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flow {
    /// The middle of the time over which it was measured.
    pub stamp: Duration,
    /// The vehicle's velocity forward and to the left, by its distance from the ground, rad/s.
    pub rate: Vector2<f64>,
    /// Standard deviation of each axis, rad/s.
    pub sigma_rad_s: f64,
    /// Distance along the body's axis to what is seen, m, and its standard deviation.
    pub distance_m: f64,
    pub distance_sigma_m: f64,
}

/// A distance to level ground below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    pub stamp: Duration,
    /// To the nearest within the cone, m.
    pub distance_m: f64,
    pub sigma_m: f64,
    /// Half of the cone's opening, rad: 0 for a beam.
    pub half_cone_rad: f64,
    /// Height of the ground in the world, m.
    pub ground_m: f64,
}

/// A fix by satellites.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Satellites {
    pub stamp: Duration,
    /// World ENU, m.
    pub position: Vector3<f64>,
    /// World ENU, m/s.
    pub velocity: Vector3<f64>,
    /// Standard deviations: horizontal and vertical, m, and of the velocity, m/s.
    pub horizontal_m: f64,
    pub vertical_m: f64,
    pub velocity_m_s: f64,
}

/// A height by air pressure, with an offset that nobody knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pressure {
    pub stamp: Duration,
    pub height_m: f64,
    pub sigma_m: f64,
}

/// The vehicle stands still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    pub stamp: Duration,
    /// Standard deviation of each axis of its velocity, m/s, and of its turning as the gyroscope tells it, rad/s.
    pub sigma_m_s: f64,
    pub sigma_rad_s: f64,
}

/// Where the nose points, as a compass tells it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heading {
    pub stamp: Duration,
    /// Counter-clockwise from east, rad.
    pub heading_rad: f64,
    pub sigma_rad: f64,
}

/// A measurement of any sensor.
#[allow(clippy::large_enum_variant)] // The largest is the usual one, and few are kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measurement {
    Markers(PoseFix),
    Lidar(PlanarFix),
    Satellites(Satellites),
    Flow(Flow),
    Range(Range),
    Pressure(Pressure),
    Rest(Rest),
    Heading(Heading),
}

type Jacobian<const ROWS: usize> = SMatrix<f64, ROWS, SIZE>;

impl Measurement {
    pub fn stamp(&self) -> Duration {
        match self {
            Self::Markers(fix) => fix.stamp,
            Self::Lidar(fix) => fix.stamp,
            Self::Satellites(fix) => fix.stamp,
            Self::Flow(flow) => flow.stamp,
            Self::Range(range) => range.stamp,
            Self::Pressure(pressure) => pressure.stamp,
            Self::Rest(rest) => rest.stamp,
            Self::Heading(heading) => heading.stamp,
        }
    }

    pub fn aid(&self) -> Aid {
        match self {
            Self::Markers(_) => Aid::Markers,
            Self::Lidar(_) => Aid::Lidar,
            Self::Satellites(_) => Aid::Satellites,
            Self::Flow(_) => Aid::Flow,
            Self::Range(_) => Aid::Range,
            Self::Pressure(_) => Aid::Pressure,
            Self::Rest(_) => Aid::Rest,
            Self::Heading(_) => Aid::Heading,
        }
    }

    /// Weighs it against a state of its time, and corrects that if it is to be fused and noise explains it. `None` if
    /// it makes no sense.
    pub(super) fn apply(&self, state: &mut State, is_fused: bool) -> Option<Weighed> {
        match self {
            Self::Markers(fix) => markers(fix, state, is_fused),
            Self::Lidar(fix) => lidar(fix, state, is_fused),
            Self::Satellites(fix) => satellites(fix, state, is_fused),
            Self::Flow(flow) => flow_of(flow, state, is_fused),
            Self::Range(range) => range_of(range, state, is_fused),
            Self::Pressure(pressure) => pressure_of(pressure, state, is_fused),
            Self::Rest(rest) => rest_of(rest, state, is_fused),
            Self::Heading(heading) => heading_of(heading, state, is_fused),
        }
    }
}

fn markers(fix: &PoseFix, state: &mut State, is_fused: bool) -> Option<Weighed> {
    let mut innovation = Vector6::zeros();
    innovation.fixed_rows_mut::<3>(0).copy_from(&(fix.position - state.position));
    let turn = (state.body_to_world.inverse() * fix.body_to_world).scaled_axis();
    innovation.fixed_rows_mut::<3>(3).copy_from(&turn);
    let mut jacobian = Jacobian::<6>::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, POSITION).fill_with_identity();
    jacobian.fixed_view_mut::<3, 3>(3, ATTITUDE).fill_with_identity();
    state.correct(&innovation, &jacobian, &fix.covariance, SIX, is_fused)
}

fn lidar(fix: &PlanarFix, state: &mut State, is_fused: bool) -> Option<Weighed> {
    let (turn, across) = turn_to(fix.heading_rad, state);
    let off = fix.position - state.position.xy();
    let innovation = Vector3::new(off.x, off.y, turn);
    let mut jacobian = Jacobian::<3>::zeros();
    jacobian.fixed_view_mut::<2, 2>(0, POSITION).fill_with_identity();
    jacobian.fixed_view_mut::<1, 3>(2, ATTITUDE).copy_from(&across);
    state.correct(&innovation, &jacobian, &fix.covariance, THREE, is_fused)
}

/// By how much the nose is to turn to this heading, rad, and how its heading changes with a small turn of the body.
fn turn_to(heading_rad: f64, state: &State) -> (f64, RowVector3<f64>) {
    let rotation = state.body_to_world.to_rotation_matrix().into_inner();
    let nose = rotation.column(0);
    let turn = heading_rad - nose.y.atan2(nose.x);
    // The nose moves by `-R [x]x` of a small turn; the heading by that across the nose.
    let moved = -rotation * Vector3::x().cross_matrix();
    let across = (moved.row(1) * nose.x - moved.row(0) * nose.y) / (nose.x * nose.x + nose.y * nose.y);
    (turn.sin().atan2(turn.cos()), across)
}

fn heading_of(heading: &Heading, state: &mut State, is_fused: bool) -> Option<Weighed> {
    let (turn, across) = turn_to(heading.heading_rad, state);
    let mut jacobian = RowSVector::<f64, SIZE>::zeros();
    jacobian.fixed_view_mut::<1, 3>(0, ATTITUDE).copy_from(&across);
    let noise = Matrix1::new(heading.sigma_rad * heading.sigma_rad);
    state.correct(&Vector1::new(turn), &jacobian, &noise, ONE, is_fused)
}

fn satellites(fix: &Satellites, state: &mut State, is_fused: bool) -> Option<Weighed> {
    let mut innovation = Vector6::zeros();
    innovation.fixed_rows_mut::<3>(0).copy_from(&(fix.position - state.position));
    innovation.fixed_rows_mut::<3>(3).copy_from(&(fix.velocity - state.velocity));
    let mut jacobian = Jacobian::<6>::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, POSITION).fill_with_identity();
    jacobian.fixed_view_mut::<3, 3>(3, VELOCITY).fill_with_identity();
    let (level, up, speed) = (fix.horizontal_m, fix.vertical_m, fix.velocity_m_s);
    let sigmas = Vector6::new(level, level, up, speed, speed, speed);
    let noise = Matrix6::from_diagonal(&sigmas.map(|sigma| sigma * sigma));
    state.correct(&innovation, &jacobian, &noise, SIX, is_fused)
}

fn flow_of(flow: &Flow, state: &mut State, is_fused: bool) -> Option<Weighed> {
    if flow.distance_m < LEAST_DISTANCE_M {
        return None;
    }
    let to_body = state.body_to_world.inverse().to_rotation_matrix().into_inner();
    let velocity = to_body * state.velocity;
    let by_distance = (1.0 + state.flow_scale) / flow.distance_m;
    let expected = velocity.xy() * by_distance;
    let mut jacobian = Jacobian::<2>::zeros();
    let by_velocity: Matrix3<f64> = to_body * by_distance;
    let by_attitude: Matrix3<f64> = velocity.cross_matrix() * by_distance;
    jacobian.fixed_view_mut::<2, 3>(0, VELOCITY).copy_from(&by_velocity.fixed_rows::<2>(0));
    jacobian.fixed_view_mut::<2, 3>(0, ATTITUDE).copy_from(&by_attitude.fixed_rows::<2>(0));
    jacobian.fixed_view_mut::<2, 1>(0, FLOW_SCALE).copy_from(&(velocity.xy() / flow.distance_m));
    let by_range = flow.distance_sigma_m / flow.distance_m;
    let noise = Matrix2::from_diagonal_element(flow.sigma_rad_s * flow.sigma_rad_s)
        + expected * expected.transpose() * (by_range * by_range);
    state.correct(&(flow.rate - expected), &jacobian, &noise, TWO, is_fused)
}

fn range_of(range: &Range, state: &mut State, is_fused: bool) -> Option<Weighed> {
    let rotation = state.body_to_world.to_rotation_matrix().into_inner();
    let upright = rotation[(2, 2)];
    if upright < LEAST_UPRIGHT || range.distance_m <= 0.0 {
        return None;
    }
    // A cone sees the ground straight below as long as that is in it.
    let tilt = (upright.min(1.0).acos() - range.half_cone_rad).max(0.0);
    let height_m = state.position.z - range.ground_m;
    let expected = height_m / tilt.cos();
    let mut jacobian = RowSVector::<f64, SIZE>::zeros();
    jacobian[POSITION + 2] = 1.0 / tilt.cos();
    if tilt > 0.0 {
        let by_turn = -rotation.row(2) * Vector3::z().cross_matrix();
        let by_upright = -expected * tilt.tan() / (1.0 - upright * upright).sqrt();
        jacobian.fixed_view_mut::<1, 3>(0, ATTITUDE).copy_from(&(by_turn * by_upright));
    }
    let noise = Matrix1::new(range.sigma_m * range.sigma_m);
    state.correct(&Vector1::new(range.distance_m - expected), &jacobian, &noise, ONE, is_fused)
}

fn pressure_of(pressure: &Pressure, state: &mut State, is_fused: bool) -> Option<Weighed> {
    let expected = state.position.z + state.pressure_offset_m;
    let mut jacobian = RowSVector::<f64, SIZE>::zeros();
    jacobian[POSITION + 2] = 1.0;
    jacobian[PRESSURE_OFFSET] = 1.0;
    let noise = Matrix1::new(pressure.sigma_m * pressure.sigma_m);
    state.correct(&Vector1::new(pressure.height_m - expected), &jacobian, &noise, ONE, is_fused)
}

fn rest_of(rest: &Rest, state: &mut State, is_fused: bool) -> Option<Weighed> {
    // What the gyroscope tells of a vehicle that does not turn is its bias.
    let mut innovation = Vector6::zeros();
    innovation.fixed_rows_mut::<3>(0).copy_from(&-state.velocity);
    innovation.fixed_rows_mut::<3>(3).copy_from(&state.rate);
    let mut jacobian = Jacobian::<6>::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, VELOCITY).fill_with_identity();
    jacobian.fixed_view_mut::<3, 3>(3, RATE_BIAS).fill_with_identity();
    let (speed, rate) = (rest.sigma_m_s, rest.sigma_rad_s);
    let sigmas = Vector6::new(speed, speed, speed, rate, rate, rate);
    let noise = Matrix6::from_diagonal(&sigmas.map(|sigma| sigma * sigma));
    state.correct(&innovation, &jacobian, &noise, SIX, is_fused)
}
