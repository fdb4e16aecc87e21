//! Several sources of position side by side: the autopilot's estimate, markers, lidar, and between them inertia, flow
//! and range in a filter.
//!
//! The filter is corrected by the source that is flown, and the others are held against it. A source is found once
//! several measurements in a row have agreed, and lost when they stay away or disagree; which one is flown is for a
//! b-thread to decide. Corrections reach whoever flies [bit by bit](super::smooth).

use std::time::Duration;

use nalgebra::{Matrix2, Matrix3, Matrix6, UnitQuaternion, Vector3};
use skein_mav::{External, Landed, Measured, Stamped, Telemetry, axes};
use skein_positioning::ekf::{
    Aid, Ekf, Flow, Heading, Inertial, Measurement, Noise, Range, Rest, Satellites, Start,
};
use skein_positioning::lidar::{LevelScan, Prediction, Slam, SlamConfig, Sweep};
use skein_positioning::{PlanarFix, PoseFix};

use skein_wire::Scan;

use super::autopilot::Autopilot;
use super::dead_reckoning;
use super::estimate::{Attitude, Estimate, Motion};
use super::plausibility::Doubt;
use super::smooth::Smooth;
use super::source::{Positioning, Sensed, SourceNews};
use crate::config::PositionSource;

/// So many measurements in a row must agree before a source is found.
const FOUND_AFTER: u64 = 5;
/// A source that has been silent, or off, for so long is lost.
const LOST_AFTER: Duration = Duration::from_millis(700);
/// A source that is flown, or is the only one, and has been off for so long tells where the vehicle is after all.
const BELIEVED_AFTER: Duration = Duration::from_secs(3);
/// An inertial unit that has been silent for so long is one that nothing can be built on.
const FELT_WITHIN: Duration = Duration::from_millis(300);
/// The autopilot's estimate corrects the filter this often.
const SATELLITES_EVERY: Duration = Duration::from_millis(200);
const SATELLITES_M_S: f64 = 0.1;
/// A vehicle that stands does not move: standard deviations of its velocity, m/s, and of its turning, rad/s, and how
/// often that is said.
const REST_M_S: f64 = 0.02;
const REST_RAD_S: f64 = 0.01;
const REST_EVERY: Duration = Duration::from_millis(100);
/// The accuracy of a vehicle's place before take-off, m, and of its autopilot's attitude, rad.
const PLACED_M: f64 = 0.05;
const TILT_RAD: f64 = 0.02;
const HEADING_RAD: f64 = 0.05;
/// So long an autopilot tells its attitude before that is believed.
const SETTLES_FOR: Duration = Duration::from_secs(1);
/// Standard deviation of flow of full quality, rad/s, and the quality below which it is none.
const FLOW_RAD_S: f64 = 0.1;
const LEAST_QUALITY: f64 = 0.2;
/// A distance without an accuracy of its own has this one, m, and no distance a better one than this.
const RANGE_M: f64 = 0.03;
const BEST_RANGE_M: f64 = 0.01;
/// What no covariance of a fix tells: how well the clocks of camera, autopilot and agent are compared, s, and how well
/// sensors and markers are in their places, m.
const CLOCKS_S: f64 = 0.01;
const MOUNTED_M: f64 = 0.003;
/// Scans count from this height, m, and are this noisy, m.
const SCANS_ABOVE_M: f64 = 0.5;
const SCAN_SIGMA_M: f64 = 0.03;
/// A map is begun anew when its variance is greater than that of what flies by this, m².
const MAP_M2: f64 = 0.005;
/// A distance to the ground is that of flow for so long.
const RANGE_LASTS: Duration = Duration::from_millis(200);

/// The standing of one source.
#[derive(Clone, Debug)]
struct Source {
    source: PositionSource,
    is_found: bool,
}

/// All sources of one vehicle.
#[derive(Debug)]
pub struct Fused {
    sources: Vec<Source>,
    flown: Option<PositionSource>,
    autopilot: Autopilot,
    ekf: Option<Ekf>,
    /// Since when the autopilot tells its attitude.
    heard: Option<Duration>,
    /// Where the vehicle was put before take-off, ENU, m; its height is the ground's.
    home: Vector3<f64>,
    range: Option<Stamped<f64>>,
    newest_markers: Option<PoseFix>,
    slam: Option<Slam>,
    /// Covariance east and north of the newest fix by lidar, m²: the errors of the map that all of them share.
    of_lidar: Matrix2<f64>,
    smooth: Smooth,
    /// All jumps of the filter's frame, m, and their number.
    frame: Vector3<f64>,
    resets: u8,
    jumped: Option<(Duration, f64)>,
    last: Estimate,
    satellites_at: Duration,
    rest_at: Duration,
    news: Vec<SourceNews>,
}

impl Fused {
    /// A vehicle with these sources, the preferred one first, that stands at `home`, ENU, m.
    #[must_use]
    pub fn new(sources: &[PositionSource], home: Vector3<f64>) -> Self {
        Self {
            sources: sources.iter().map(|source| Source { source: *source, is_found: false }).collect(),
            flown: sources.first().copied(),
            autopilot: Autopilot::default(),
            ekf: None,
            heard: None,
            home,
            range: None,
            newest_markers: None,
            slam: sources.contains(&PositionSource::Lidar).then(|| Slam::new(SlamConfig::default())),
            of_lidar: Matrix2::zeros(),
            smooth: Smooth::default(),
            frame: Vector3::zeros(),
            resets: 0,
            jumped: None,
            last: Estimate::default(),
            satellites_at: Duration::ZERO,
            rest_at: Duration::ZERO,
            news: Vec::new(),
        }
    }

    /// Begins to filter where the autopilot, or who put the vehicle there, says that it is.
    fn begin(&mut self, now: Duration, told: &Estimate, telemetry: &Telemetry) {
        let Some(attitude) = telemetry.attitude else { return };
        // A compass takes its time.
        if now < *self.heard.get_or_insert(now) + SETTLES_FOR {
            return;
        }
        let by_satellites = told.motion.filter(|_| telemetry.has_gps_fix == Some(true));
        let (position, velocity, position_sigma_m) = match by_satellites {
            Some(motion) => (motion.value.position, motion.value.velocity, motion.value.position_sigma_m()),
            None if telemetry.landed == Landed::OnGround => (self.home, Vector3::zeros(), PLACED_M),
            None => return,
        };
        self.ekf = Some(Ekf::new(
            Noise::SMALL,
            Start {
                stamp: now,
                position,
                position_sigma_m,
                velocity,
                velocity_sigma_m_s: SATELLITES_M_S,
                body_to_world: attitude.value,
                tilt_sigma_rad: TILT_RAD,
                heading_sigma_rad: HEADING_RAD,
            },
        ));
    }

    fn aid(source: PositionSource) -> Aid {
        match source {
            PositionSource::Autopilot => Aid::Satellites,
            PositionSource::Markers => Aid::Markers,
            PositionSource::Lidar => Aid::Lidar,
        }
    }

    /// Takes a measurement into the filter: fused, if it is none of a source that is not flown.
    fn take(&mut self, measured: Measurement) {
        let Some(ekf) = &mut self.ekf else { return };
        let aid = measured.aid();
        let is_source = self.sources.iter().any(|source| Self::aid(source.source) == aid);
        let is_flown = self.flown.is_some_and(|flown| Self::aid(flown) == aid);
        let before = ekf.state().position;
        ekf.measure(measured, is_flown || !is_source);
        self.smooth.absorb(&(ekf.state().position - before));
    }

    fn instrument(&mut self, reading: &Stamped<Measured>) {
        let stamp = reading.stamp;
        match reading.value {
            Measured::Inertial(felt) => {
                if let Some(ekf) = &mut self.ekf {
                    ekf.feel(Inertial { stamp, rate: felt.rate, force: felt.force });
                }
            }
            Measured::Flow(flow) if flow.quality >= LEAST_QUALITY => {
                let recent = self.range.filter(|range| range.age(stamp) < RANGE_LASTS);
                let Some(distance_m) = flow.distance_m.or(recent.map(|range| range.value)) else { return };
                self.take(Measurement::Flow(Flow {
                    stamp: stamp.saturating_sub(flow.over / 2),
                    rate: flow.rate,
                    sigma_rad_s: FLOW_RAD_S / flow.quality,
                    distance_m,
                    distance_sigma_m: RANGE_M,
                }));
            }
            Measured::Distance(distance) => {
                self.range = Some(Stamped { stamp, value: distance.distance_m });
                self.take(Measurement::Range(Range {
                    stamp,
                    distance_m: distance.distance_m,
                    sigma_m: distance.sigma_m.unwrap_or(RANGE_M).max(BEST_RANGE_M),
                    half_cone_rad: distance.half_cone_rad,
                    ground_m: self.home.z,
                }));
            }
            Measured::Flow(_) => {}
        }
    }

    /// The autopilot's own word: its position by satellites, that the vehicle stands, and its heading, which is
    /// its compass's as long as it does not fly by what it is told.
    fn hear(&mut self, now: Duration, told: &Estimate, telemetry: &Telemetry) {
        if telemetry.landed == Landed::OnGround && !telemetry.armed && now >= self.rest_at + REST_EVERY {
            self.rest_at = now;
            self.take(Measurement::Rest(Rest { stamp: now, sigma_m_s: REST_M_S, sigma_rad_s: REST_RAD_S }));
        }
        let sound = told.motion.filter(|_| telemetry.has_gps_fix == Some(true) && told.doubt.is_none());
        if let Some(motion) = sound.filter(|motion| motion.stamp >= self.satellites_at + SATELLITES_EVERY) {
            self.satellites_at = motion.stamp;
            self.compass(telemetry);
            self.take(Measurement::Satellites(Satellites {
                stamp: motion.stamp,
                position: motion.value.position,
                velocity: motion.value.velocity,
                horizontal_m: motion.value.axis_sigma_m(0).max(motion.value.axis_sigma_m(1)),
                vertical_m: motion.value.axis_sigma_m(2),
                velocity_m_s: SATELLITES_M_S,
            }));
        }
    }

    /// Where the vehicle is believed to be when a scan was taken; none on the ground, from where there is little to
    /// see.
    fn prediction(&self, stamp: Duration) -> Option<Prediction> {
        let state = self.ekf.as_ref()?.state();
        let lead_s = stamp.as_secs_f64() - state.stamp.as_secs_f64();
        let position = state.position + state.velocity * lead_s;
        let covariance = state.covariance();
        let mut planar = Matrix3::zeros();
        planar.fixed_view_mut::<2, 2>(0, 0).copy_from(&covariance.fixed_view::<2, 2>(0, 0));
        planar[(2, 2)] = covariance[(8, 8)];
        (position.z > self.home.z + SCANS_ABOVE_M && lead_s.abs() < 0.5).then(|| Prediction {
            position,
            body_to_world: state.body_to_world * UnitQuaternion::from_scaled_axis(state.rate * lead_s),
            velocity: state.velocity,
            turn_rate: state.rate,
            covariance: planar,
            ground_m: self.home.z,
        })
    }

    fn compass(&mut self, telemetry: &Telemetry) {
        if let Some(attitude) = telemetry.attitude {
            self.take(Measurement::Heading(Heading {
                stamp: attitude.stamp,
                heading_rad: axes::yaw(&attitude.value),
                sigma_rad: HEADING_RAD,
            }));
        }
    }

    /// Begins a new map where the old one is less sure of the world than what flies the vehicle is.
    fn map_anew(&mut self, fix: &PlanarFix, prediction: &Prediction) {
        let variance = |covariance: &Matrix3<f64>| covariance[(0, 0)] + covariance[(1, 1)];
        let worse = variance(&fix.covariance) > 4.0 * variance(&prediction.covariance) + MAP_M2;
        if self.flown == Some(PositionSource::Autopilot) && worse {
            self.slam = Some(Slam::new(SlamConfig::default()));
        }
    }

    /// Finds out which sources have come and gone.
    fn review(&mut self, now: Duration) {
        let Some(ekf) = &self.ekf else { return };
        for source in &mut self.sources {
            let aid = ekf.health().of(Self::aid(source.source));
            let age = aid.measured.map(|at| now.saturating_sub(at));
            let off = aid.off_since.map(|since| now.saturating_sub(since));
            let lost = match (age, off) {
                (None, _) => Some("nothing was heard of it".to_owned()),
                (Some(age), _) if age > LOST_AFTER => Some(format!("silent for {:.1} s", age.as_secs_f64())),
                (_, Some(off)) if off > LOST_AFTER => {
                    Some(format!("off by more than its noise explains for {:.1} s", off.as_secs_f64()))
                }
                _ => None,
            };
            if source.is_found && lost.is_some() {
                source.is_found = false;
                self.news.push(SourceNews { source: source.source, lost });
            } else if !source.is_found && lost.is_none() && aid.fits >= FOUND_AFTER {
                source.is_found = true;
                self.news.push(SourceNews { source: source.source, lost: None });
            }
        }
    }

    /// Markers that have been off for long, while nothing else tells where the vehicle is, are right after all.
    fn believe_markers(&mut self, now: Duration) {
        let Some(ekf) = &mut self.ekf else { return };
        let others = self.sources.iter().any(|source| source.is_found);
        let off = ekf.health().of(Aid::Markers).off_since.map(|since| now.saturating_sub(since));
        let newest = self.newest_markers.filter(|fix| now.saturating_sub(fix.stamp) < LOST_AFTER);
        let Some(fix) = newest.filter(|_| !others && off.is_some_and(|off| off > BELIEVED_AFTER)) else {
            return;
        };
        let state = ekf.state();
        let by = fix.position - state.position;
        let sigma_m = fix.covariance.fixed_view::<3, 3>(0, 0).diagonal().map(f64::sqrt).norm();
        *ekf = Ekf::new(
            Noise::SMALL,
            Start {
                stamp: state.stamp,
                position: fix.position,
                position_sigma_m: sigma_m.max(PLACED_M),
                velocity: Vector3::zeros(),
                velocity_sigma_m_s: 1.0,
                body_to_world: fix.body_to_world,
                tilt_sigma_rad: TILT_RAD,
                heading_sigma_rad: HEADING_RAD,
            },
        );
        self.smooth.absorb(&by);
    }

    /// The filter's estimate, with what is still to be made up for.
    fn filtered(&self) -> Option<(Stamped<Motion>, Stamped<Attitude>)> {
        let state = self.ekf.as_ref()?.state();
        let offset = self.smooth.offset();
        let covariance = state.covariance();
        let mut of_motion: Matrix6<f64> = covariance.fixed_view::<6, 6>(0, 0).into();
        let mut place = of_motion.fixed_view_mut::<3, 3>(0, 0);
        place += offset * offset.transpose()
            + state.velocity * state.velocity.transpose() * (CLOCKS_S * CLOCKS_S)
            + Matrix3::from_diagonal_element(MOUNTED_M * MOUNTED_M);
        if self.flown != Some(PositionSource::Markers) {
            let mut level = of_motion.fixed_view_mut::<2, 2>(0, 0);
            level += self.of_lidar;
        }
        let motion =
            Motion { position: state.position + offset, velocity: state.velocity, covariance: of_motion };
        let attitude = Attitude {
            body_to_world: state.body_to_world,
            rate: state.rate,
            covariance: covariance.fixed_view::<3, 3>(6, 6).into(),
        };
        Some((Stamped { stamp: state.stamp, value: motion }, Stamped { stamp: state.stamp, value: attitude }))
    }

    /// When the filter was last corrected by a source of position, or the vehicle stood.
    fn last_sure(&self) -> Duration {
        let health = self.ekf.as_ref().map(Ekf::health);
        let fused = |source: &Source| health?.of(Self::aid(source.source)).fused;
        self.sources.iter().filter_map(fused).fold(self.rest_at, Duration::max)
    }

    /// Why the filter's estimate is none to fly by.
    fn doubt(&self, now: Duration) -> Option<Doubt> {
        let state = self.ekf.as_ref()?.state();
        if now.saturating_sub(state.stamp) > FELT_WITHIN {
            return Some(Doubt::Unfelt);
        }
        let [east_m, north_m, _] = state.position_sigma_m();
        if dead_reckoning::is_over(now, self.last_sure(), east_m.max(north_m)) {
            return Some(Doubt::Alone);
        }
        self.jumped.filter(|(at, _)| now < *at + BELIEVED_AFTER).map(|(_, by_m)| Doubt::Jumped(by_m))
    }

    fn fly_by_filter(&mut self, now: Duration) -> Estimate {
        if let Some(jump) = self.smooth.go_on(now) {
            self.frame += jump;
            self.resets = self.resets.wrapping_add(1);
            self.jumped = Some((now, jump.norm()));
        }
        let (motion, attitude) = self.filtered().unzip();
        Estimate { motion, attitude, frame: self.frame, doubt: self.doubt(now), shock: None }
    }
}

impl Positioning for Fused {
    fn estimate(&mut self, now: Duration, telemetry: &Telemetry) -> Estimate {
        let told = self.autopilot.estimate(now, telemetry);
        match self.ekf {
            None => self.begin(now, &told, telemetry),
            Some(_) => self.hear(now, &told, telemetry),
        }
        self.review(now);
        self.believe_markers(now);
        self.last = match self.flown {
            Some(PositionSource::Autopilot) => {
                // As long as it flies, the filter follows it; from there it takes over without a step.
                self.smooth = Smooth::default();
                Estimate { frame: told.frame + self.frame, ..told }
            }
            _ => {
                let estimate = self.fly_by_filter(now);
                Estimate { frame: estimate.frame + told.frame, ..estimate }
            }
        };
        self.last
    }

    fn sense(&mut self, _now: Duration, sensed: &Sensed) {
        match sensed {
            Sensed::Instrument(reading) => self.instrument(reading),
            Sensed::Markers(fix) => {
                self.newest_markers = Some(*fix);
                self.take(Measurement::Markers(*fix));
            }
        }
    }

    fn scan(&mut self, scan: &Scan) {
        let Some(prediction) = self.prediction(scan.stamp) else { return };
        let Some(slam) = &mut self.slam else { return };
        let sweep = Sweep {
            stamp: scan.stamp,
            ranges_m: &scan.ranges_m,
            angle_min: scan.angle_min,
            angle_step: scan.angle_step,
            max_range_m: scan.max_range_m,
            first_ray_s: 0.0,
            ray_step_s: 0.0,
            sigma_m: SCAN_SIGMA_M,
        };
        let level = LevelScan::new(&sweep, &prediction, |_| false);
        if let Some(fix) = slam.step(&level, &prediction) {
            self.of_lidar = slam.shared().fixed_view::<2, 2>(0, 0).into();
            self.take(Measurement::Lidar(fix));
            self.map_anew(&fix, &prediction);
        }
    }

    fn wants_measured(&self) -> bool {
        true
    }

    fn fly_by(&mut self, source: Option<PositionSource>) {
        if self.flown == source {
            return;
        }
        // Whoever flies goes on from where it was.
        if let (Some(PositionSource::Autopilot), Some(motion), Some(ekf)) =
            (self.flown, self.last.motion, &self.ekf)
        {
            self.smooth.absorb(&(ekf.state().position - motion.value.position));
        }
        self.flown = source;
    }

    fn take_news(&mut self) -> Vec<SourceNews> {
        std::mem::take(&mut self.news)
    }

    fn external(&self, now: Duration) -> Option<External> {
        if self.flown == Some(PositionSource::Autopilot) {
            return None;
        }
        let (position, attitude) = self.last.pose_at(now)?;
        let (motion, lies) = (self.last.motion?, self.last.attitude?);
        (now.saturating_sub(motion.stamp) < FELT_WITHIN).then_some(External {
            position,
            velocity: motion.value.velocity,
            attitude,
            rate: lies.value.rate,
            motion_covariance: motion.value.covariance,
            attitude_covariance: lies.value.covariance,
            resets: self.resets,
        })
    }
}
