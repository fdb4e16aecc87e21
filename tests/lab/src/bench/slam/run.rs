//! A lidar's scans through [`Slam`], beside the poses that are known for them.

use std::time::Duration;

use nalgebra::{Isometry2, Matrix3, Point2, UnitQuaternion, Vector2, Vector3};
use skein_positioning::lidar::{LevelScan, Prediction, Slam, SlamConfig, State, Sweep};

use crate::cpu_time;

/// One scan, and what else is known of its moment.
pub struct Look<'a> {
    pub ranges_m: &'a [f32],
    /// Direction of the first ray from the nose, and from a ray to the next, rad.
    pub angles: [f64; 2],
    pub max_range_m: f64,
    pub sigma_m: f64,
    /// Where dead reckoning says that the lidar is.
    pub odometry: Isometry2<f64>,
    /// Where it is, by whatever is held for true.
    pub known: Isometry2<f64>,
}

/// The result.
#[derive(Debug, Default)]
pub struct Outcome {
    pub scans: usize,
    pub fixes: usize,
    /// Steps of which the place was lost.
    pub lost: usize,
    pub loops: usize,
    pub key_frames: usize,
    pub bytes: usize,
    /// Each step's time of one processor, sorted, ms: levelling, matching, and what is done of closing loops.
    pub step_ms: Vec<f64>,
    /// The same of those steps in which no key frame was kept and nothing was searched for or solved.
    pub match_ms: Vec<f64>,
    pub known: Vec<Isometry2<f64>>,
    /// The poses told at the time of each scan.
    pub told: Vec<Isometry2<f64>>,
    pub reckoned: Vec<Isometry2<f64>>,
    /// Where key frames are in the end, with their returns, m.
    pub map: Vec<Vector2<f64>>,
    /// Fixes of which a part is off by more than three of its own sigmas, where the first pose is known for sure.
    pub beyond_3_sigma: usize,
}

/// How badly wheels or a filter without a fix reckon: a share of the way, and of the turn.
const RECKONING: (f64, f64) = (0.1, 0.1);

/// Runs all scans.
pub fn run<'a>(looks: impl Iterator<Item = Look<'a>>) -> Outcome {
    let mut slam = Slam::new(SlamConfig::default());
    let mut outcome = Outcome::default();
    let mut covariance = Matrix3::identity() * 1e-6;
    let mut shift = None;
    for look in looks {
        // The frame is that of the known poses from the first on.
        let shift = *shift.get_or_insert_with(|| look.known * look.odometry.inverse());
        let odometry = shift * look.odometry;
        if let Some(last) = outcome.reckoned.last() {
            covariance += grown(&(last.inverse() * odometry));
        }
        let prediction = prediction(&odometry, covariance);
        let sweep = Sweep {
            stamp: Duration::from_millis(100 * outcome.scans as u64),
            ranges_m: look.ranges_m,
            angle_min: look.angles[0],
            angle_step: look.angles[1],
            max_range_m: look.max_range_m,
            first_ray_s: 0.0,
            ray_step_s: 0.0,
            sigma_m: look.sigma_m,
        };
        let since = cpu_time::this_thread_or_nothing();
        let scan = LevelScan::new(&sweep, &prediction, |_| false);
        let fix = slam.step(&scan, &prediction);
        let took_ms = (cpu_time::this_thread_or_nothing() - since).as_secs_f64() * 1e3;
        outcome.step_ms.push(took_ms);
        if fix.is_some() && slam.health().is_plain {
            outcome.match_ms.push(took_ms);
        }
        outcome.scans += 1;
        outcome.lost += usize::from(slam.health().state == State::Lost);
        if let Some(fix) = fix {
            outcome.fixes += 1;
            let off = fix.position - look.known.translation.vector;
            let turned =
                look.known.rotation.rotation_to(&nalgebra::UnitComplex::new(fix.heading_rad)).angle();
            let sigmas = off.push(turned).component_div(&fix.covariance.diagonal().map(f64::sqrt));
            outcome.beyond_3_sigma += usize::from(sigmas.abs().max() > 3.0);
        }
        outcome.known.push(look.known);
        outcome.told.push(slam.pose().copied().unwrap_or(odometry));
        outcome.reckoned.push(odometry);
    }
    let health = slam.health();
    (outcome.loops, outcome.key_frames, outcome.bytes) = (health.loops, health.key_frames, health.bytes);
    outcome.step_ms.sort_by(f64::total_cmp);
    outcome.match_ms.sort_by(f64::total_cmp);
    for frame in slam.key_frames() {
        outcome.map.extend(frame.returns.iter().map(|one| (frame.pose * Point2::from(one.point)).coords));
    }
    outcome
}

fn grown(moved: &Isometry2<f64>) -> Matrix3<f64> {
    let place = (RECKONING.0 * moved.translation.vector.norm() + 0.005).powi(2);
    let turn = (RECKONING.1 * moved.rotation.angle().abs() + 0.002).powi(2);
    Matrix3::from_diagonal(&Vector3::new(place, place, turn))
}

fn prediction(pose: &Isometry2<f64>, covariance: Matrix3<f64>) -> Prediction {
    Prediction {
        position: pose.translation.vector.push(3.0),
        body_to_world: UnitQuaternion::from_euler_angles(0.0, 0.0, pose.rotation.angle()),
        velocity: Vector3::zeros(),
        turn_rate: Vector3::zeros(),
        covariance,
        ground_m: 0.0,
    }
}

/// Errors of poses beside those that are known.
#[derive(Debug, Clone, Copy)]
pub struct Errors {
    /// Root of the mean square distance, after the best rigid move of all, m.
    pub rms_m: f64,
    /// The longest such distance, m.
    pub max_m: f64,
    /// Mean error of the motion over about a metre, m and rad: what relations between poses are judged by
    /// (Kuemmerle 2009).
    pub relation: (f64, f64),
    /// Length of the known way, m.
    pub way_m: f64,
}

/// Compares two series of poses of the same length.
pub fn errors(known: &[Isometry2<f64>], told: &[Isometry2<f64>]) -> Errors {
    let move_all = best_move(known, told);
    let off = |(known, told): (&Isometry2<f64>, &Isometry2<f64>)| {
        (known.translation.vector - (move_all * told).translation.vector).norm()
    };
    let offs: Vec<f64> = known.iter().zip(told).map(off).collect();
    let mut relation = (0.0, 0.0);
    let (mut relations, mut way_m, mut last) = (0.0, 0.0, 0);
    for at in 1..known.len() {
        let moved = |poses: &[Isometry2<f64>], from: usize| poses[from].inverse() * poses[at];
        way_m += moved(known, at - 1).translation.vector.norm();
        if moved(known, last).translation.vector.norm() >= 1.0 {
            let error = moved(known, last).inverse() * moved(told, last);
            relation.0 += error.translation.vector.norm();
            relation.1 += error.rotation.angle().abs();
            (relations, last) = (relations + 1.0, at);
        }
    }
    let mean_square = offs.iter().map(|off| off * off).sum::<f64>() / offs.len().max(1) as f64;
    let relations = f64::max(relations, 1.0);
    Errors {
        rms_m: mean_square.sqrt(),
        max_m: offs.iter().copied().fold(0.0, f64::max),
        relation: (relation.0 / relations, relation.1 / relations),
        way_m,
    }
}

/// The rigid move of `told` that brings it nearest to `known` by places.
fn best_move(known: &[Isometry2<f64>], told: &[Isometry2<f64>]) -> Isometry2<f64> {
    let middle = |poses: &[Isometry2<f64>]| {
        poses.iter().map(|pose| pose.translation.vector).sum::<Vector2<f64>>() / poses.len().max(1) as f64
    };
    let (to, from) = (middle(known), middle(told));
    let (mut along, mut across) = (0.0, 0.0);
    for (known, told) in known.iter().zip(told) {
        let (known, told) = (known.translation.vector - to, told.translation.vector - from);
        along += told.dot(&known);
        across += told.perp(&known);
    }
    let rotation = nalgebra::UnitComplex::new(across.atan2(along));
    Isometry2::from_parts((to - rotation * from).into(), rotation)
}
