//! Localisation by lidar: time, drift and memory along a wood of trunks, or along a public recording.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::Args;
use nalgebra::{Isometry2, Isometry3, Translation3, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde_json::json;
use skein_sim::cli::Exit;
use skein_world::{Lidar, Obstacle, Scene, Surroundings, VehicleModel};

use crate::figure::{Figure, Line, Style};
use crate::quantile::quantile;
use crate::task::Task;

mod carmen;
mod run;

use self::run::{Errors, Look, Outcome};

/// Trunks for each square metre of the wood.
const TRUNKS_PER_M2: f64 = 0.03;
/// From a scan to the next in the wood, m: 3 m/s at ten scans a second.
const STEP_M: f64 = 0.3;
/// Recorded ranges from here on are no returns, m.
const RECORDED_RANGE_M: f64 = 30.0;
/// Noise of recorded ranges, m.
const RECORDED_SIGMA_M: f64 = 0.02;

#[derive(Args)]
pub struct Slams {
    /// A CARMEN log (.clf, .log) to follow instead of the wood.
    #[arg(long, value_name = "F")]
    log: Option<PathBuf>,
    /// Length of the way through the wood, m.
    #[arg(long, value_name = "M", default_value_t = 100.0)]
    length_m: f64,
    /// The seed of the wood, of the scanner's noise, and of errors of the reckoning.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Draws the map here, as SVG.
    #[arg(long, value_name = "F")]
    map: Option<PathBuf>,
}

impl Task for Slams {
    const NAME: &'static str = "slam";
    const ABOUT: &'static str =
        "Time, drift and memory of localisation by lidar, in a wood or along a CARMEN log";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let outcome = match &self.log {
            Some(log) => self.recorded(log)?,
            None => self.wood()?,
        };
        if let Some(path) = &self.map {
            let svg = figure(&outcome).to_svg()?;
            fs::write(path, svg).with_context(|| format!("cannot write {}", path.display()))?;
        }
        report(&outcome, as_json);
        Ok(Exit::Done)
    }
}

impl Slams {
    fn wood(&self) -> anyhow::Result<Outcome> {
        let scene = wood(self.length_m, self.seed);
        let model = VehicleModel::built_in("x500")?.lidar.context("the X500 has no lidar")?;
        let angles = [-std::f64::consts::PI, std::f64::consts::TAU / f64::from(model.rays)];
        let (max_range_m, sigma_m) = (model.range_m, model.sigma_m);
        let mut lidar = Lidar::new(model, self.seed, 0);
        let mut reckoning = Reckoning::new(self.seed);
        let steps = (self.length_m / STEP_M) as u32;
        let scans: Vec<_> = (0..=steps)
            .map(|step| {
                let along_m = f64::from(step) * STEP_M;
                let known = Isometry2::new(Vector2::new(along_m, 0.0), 0.2 * (along_m / 7.0).sin());
                let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), known.rotation.angle());
                let pose = Isometry3::from_parts(Translation3::new(along_m, 0.0, 3.0), turned);
                let surroundings = Surroundings { scene: &scene, hulls: &[], own: 0 };
                let scan = lidar.scan(std::time::Duration::ZERO, &pose, &surroundings);
                (scan.ranges_m, known, reckoning.after(&known))
            })
            .collect();
        Ok(run::run(scans.iter().map(|(ranges_m, known, odometry)| Look {
            ranges_m,
            angles,
            max_range_m,
            sigma_m,
            odometry: *odometry,
            known: *known,
        })))
    }

    fn recorded(&self, log: &Path) -> anyhow::Result<Outcome> {
        let name = log.display();
        let text = fs::read_to_string(log).with_context(|| format!("cannot read {name} as text"))?;
        let records = carmen::read(&text).with_context(|| format!("{name} is no CARMEN log"))?;
        anyhow::ensure!(!records.is_empty(), "{name} holds no scan: expected lines FLASER or ROBOTLASER1");
        // Corrected logs hold the solution in place of odometry.
        let is_corrected = records.iter().all(|record| record.pose == record.odometry);
        let mut reckoning = Reckoning::new(self.seed);
        let odometry: Vec<_> = records
            .iter()
            .map(|record| if is_corrected { reckoning.after(&record.pose) } else { record.odometry })
            .collect();
        Ok(run::run(records.iter().zip(odometry).map(|(record, odometry)| Look {
            ranges_m: &record.ranges_m,
            angles: record.angles,
            max_range_m: RECORDED_RANGE_M,
            sigma_m: RECORDED_SIGMA_M,
            odometry,
            known: record.pose,
        })))
    }
}

/// Dead reckoning that errs by 5 % of the way and of the turn, and a little more.
struct Reckoning {
    random: ChaCha8Rng,
    last: Option<[Isometry2<f64>; 2]>,
}

impl Reckoning {
    fn new(seed: u64) -> Self {
        Self { random: ChaCha8Rng::seed_from_u64(seed), last: None }
    }

    /// Where it is reckoned to be, after a move to `known`.
    fn after(&mut self, known: &Isometry2<f64>) -> Isometry2<f64> {
        let Some([last, reckoned]) = self.last else {
            self.last = Some([*known; 2]);
            return *known;
        };
        let moved = last.inverse() * known;
        // Uniform between the ends, so its sigma is three fifths of them.
        let mut off = |most: f64| self.random.random_range(-most..=most);
        let (way_m, turn_rad) = (moved.translation.vector.norm(), moved.rotation.angle().abs());
        let place_m = 0.09 * way_m + 0.003;
        let wrong = Isometry2::new(Vector2::new(off(place_m), off(place_m)), off(0.09 * turn_rad + 0.002));
        let reckoned = reckoned * moved * wrong;
        self.last = Some([*known, reckoned]);
        reckoned
    }
}

/// Trunks of 0.2 to 0.5 m about a lane along the x axis.
fn wood(length_m: f64, seed: u64) -> Scene {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let count = (TRUNKS_PER_M2 * (length_m + 40.0) * 50.0) as usize;
    let mut trunk = |name: usize| {
        let radius = random.random_range(0.2..0.5);
        let [x, y]: [f64; 2] =
            [random.random_range(-20.0..length_m + 20.0), random.random_range(-25.0..25.0)];
        (y.abs() > 1.5 + radius).then(|| Obstacle::trunk(format!("trunk {name}"), x, y, radius, 8.0))
    };
    Scene::new("wood", (0..count).filter_map(&mut trunk).collect())
}

fn figure(outcome: &Outcome) -> Figure {
    let places = |poses: &[Isometry2<f64>]| {
        poses.iter().map(|pose| (pose.translation.x, pose.translation.y)).collect::<Vec<_>>()
    };
    let line = |name: &str, style, points| Line { name: name.to_owned(), style, points };
    Figure {
        x: "east (m)".to_owned(),
        y: "north (m)".to_owned(),
        is_map: true,
        lines: vec![
            line("known", Style::Reference, places(&outcome.known)),
            line("map", Style::Points, outcome.map.iter().map(|place| (place.x, place.y)).collect()),
            line("told", Style::Solid, places(&outcome.told)),
        ],
    }
}

fn report(outcome: &Outcome, as_json: bool) {
    let [p50, p99, max] = [0.5, 0.99, 1.0].map(|share| quantile(&outcome.step_ms, share));
    let [match_p50, match_p99] = [0.5, 0.99].map(|share| quantile(&outcome.match_ms, share));
    let slam = run::errors(&outcome.known, &outcome.told);
    let reckoned = run::errors(&outcome.known, &outcome.reckoned);
    if as_json {
        println!(
            "{}",
            json!({
                "scans": outcome.scans, "fixes": outcome.fixes, "lost": outcome.lost,
                "beyond_3_sigma": outcome.beyond_3_sigma, "loops": outcome.loops,
                "key_frames": outcome.key_frames, "bytes": outcome.bytes,
                "match_ms": {"p50": match_p50, "p99": match_p99},
                "step_ms": {"p50": p50, "p99": p99, "max": max},
                "way_m": slam.way_m, "slam": errors(&slam), "reckoning": errors(&reckoned),
            })
        );
        return;
    }
    println!("{} scans, {} fixes, lost for {}", outcome.scans, outcome.fixes, outcome.lost);
    println!("{} key frames, {} loops, {} kB", outcome.key_frames, outcome.loops, outcome.bytes / 1000);
    println!(
        "a match: {match_p50:.2} ms, p99 {match_p99:.2}; a step: {p50:.2} ms, p99 {p99:.2}, max {max:.2}"
    );
    for (name, errors) in [("lidar", slam), ("reckoning", reckoned)] {
        let Errors { rms_m, max_m, relation, way_m } = errors;
        println!(
            "{name}: {rms_m:.3} m RMS, {max_m:.3} m at most on {way_m:.0} m; over a metre {:.3} m",
            relation.0
        );
    }
}

fn errors(errors: &Errors) -> serde_json::Value {
    json!({
        "rms_m": errors.rms_m, "max_m": errors.max_m, "m_per_m": errors.rms_m / errors.way_m.max(1.0),
        "relation_m": errors.relation.0, "relation_rad": errors.relation.1,
    })
}
