//! Vector field histogram: dense cylinders that are not known before, at a speed that follows the scene (Xu 2023).

use clap::Args;
use nalgebra::Vector3;
use serde_json::json;
use skein_sim::cli::Controller;
use skein_sim::fly::Trial;
use skein_sim::scenario::Scenario;
use skein_sim::summary::Summary;
use skein_world::vehicle::GRAVITY_M_S2;
use skein_world::{RigidState, Shape, VehicleModel};

use crate::figure::{Figure, Line, Style};
use crate::numbers::one_or_more;
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::runs;
use crate::statistics::mean;

const SCENARIO: &str = include_str!("vfh.toml");
const RUNS: usize = 100;
/// The published speed where an obstacle is seen, m/s: what is compared with flies no faster anywhere.
const SLOW_M_S: f64 = 0.5;
/// In so many of the worlds it is flown.
const SLOW_RUNS: usize = 10;
/// The published bound on pitch, degrees.
const MOST_PITCH_DEG: f64 = 5.0;
/// The autopilot's mode in which it flies the planner's set-points.
const PLANNED_MODE: &str = "offboard";
/// Least speed-up.
const LEAST_RATIO: f64 = 2.0;

/// One flight, at every tick in the air.
struct Flight {
    summary: Summary,
    track: Vec<Moment>,
}

/// A moment of a flight.
struct Moment {
    time_s: f64,
    position: Vector3<f64>,
    speed_m_s: f64,
    /// The planner's set-points are flown: the autopilot takes off and lands by itself.
    planned: bool,
    /// Angle between the thrust and what would keep the velocity as it is.
    tilt_deg: f64,
}

impl Flight {
    fn most_tilt_deg(&self) -> f64 {
        let planned = self.track.iter().filter(|moment| moment.planned);
        planned.map(|moment| moment.tilt_deg).fold(0.0, f64::max)
    }

    fn top_speed_m_s(&self) -> f64 {
        self.track.iter().map(|moment| moment.speed_m_s).fold(0.0, f64::max)
    }
}

#[derive(Args)]
pub struct Vfh {
    /// Worlds, whose seeds are 1 to N.
    #[arg(long, value_name = "N", default_value_t = RUNS, value_parser = one_or_more())]
    runs: usize,
}

impl Experiment for Vfh {
    const NAME: &'static str = "vfh";
    const ABOUT: &'static str =
        "dense cylinders by vector field histogram, at a speed that follows the scene (Xu 2023)";

    fn run(&self) -> anyhow::Result<Report> {
        let seeds: Vec<u64> = (1..=self.runs as u64).collect();
        let flights = runs::in_turn("flights", &seeds, |seed| fly(&scenario(*seed)?))?;
        let slow = runs::in_turn("slow flights", &seeds[..seeds.len().min(SLOW_RUNS)], |seed| {
            let mut scenario = scenario(*seed)?;
            scenario.cruise_speed_m_s = SLOW_M_S;
            Ok(fly(&scenario)?.summary.flight_time_s.mean)
        })?;
        let mut report = Report::default();
        judge(&mut report, &flights, &slow);
        if let (Some(first), Some(seed)) = (flights.first(), seeds.first()) {
            report.figure("speed", profile(first));
            report.figure("map", map(first, &scenario(*seed)?));
        }
        Ok(report)
    }
}

fn scenario(seed: u64) -> anyhow::Result<Scenario> {
    Ok(Scenario::from_toml(SCENARIO, "vfh.toml", None, seed)?)
}

fn fly(scenario: &Scenario) -> anyhow::Result<Flight> {
    let mut track = Vec::new();
    let flown = Trial::new(scenario, Controller::Bp).fly(&mut |swarm, _| {
        let vehicle = swarm.simulation().vehicle(0).filter(|vehicle| vehicle.airborne);
        let model = scenario.vehicles.first().map(|plan| &plan.model);
        if let (Some(vehicle), Some(model)) = (vehicle, model) {
            let motion = &vehicle.motion;
            let mode = swarm.agents().next().map(|agent| agent.status(swarm.now()).mode);
            track.push(Moment {
                time_s: swarm.now().as_secs_f64(),
                position: motion.position,
                speed_m_s: motion.velocity.xy().norm(),
                planned: mode.as_deref() == Some(PLANNED_MODE),
                tilt_deg: tilt_from_trim_deg(motion, model),
            });
        }
    })?;
    Ok(Flight { summary: flown.summary, track })
}

/// How far the thrust leans from the direction that keeps a vehicle at its velocity, in still air, degrees. Pitch and
/// roll are parts of it, so neither is more.
fn tilt_from_trim_deg(motion: &RigidState, model: &VehicleModel) -> f64 {
    let velocity = motion.velocity;
    let drag = velocity * ((model.linear_drag + model.quadratic_drag * velocity.norm()) / model.mass_kg);
    let trim = drag + Vector3::new(0.0, 0.0, GRAVITY_M_S2);
    (motion.attitude * Vector3::z()).angle(&trim).to_degrees()
}

fn judge(report: &mut Report, flights: &[Flight], slow: &[f64]) {
    let summaries = || flights.iter().map(|flight| &flight.summary);
    let collisions: u64 = summaries().map(|s| s.collisions.obstacle + s.collisions.vehicle).sum();
    let succeeded = summaries().filter(|summary| summary.succeeded).count();
    let times: Vec<f64> = summaries().map(|summary| summary.flight_time_s.mean).collect();
    let ratio = mean(slow) / mean(&times[..slow.len()]);
    let ways: Vec<f64> = summaries().map(|summary| summary.path_length_m.mean).collect();
    let most_tilt_deg = flights.iter().map(Flight::most_tilt_deg).fold(0.0, f64::max);
    let top: Vec<f64> = flights.iter().map(Flight::top_speed_m_s).collect();
    let clearance_m = summaries().filter_map(|s| s.min_clearance_m).fold(f64::INFINITY, f64::min);
    report.number("runs", flights.len());
    report.number("succeeded", succeeded);
    report.number("collisions", collisions);
    report.number("flight_time_s", mean(&times));
    report.number("slow_flight_time_s", json!({ "runs": slow.len(), "mean": mean(slow) }));
    report.number("path_length_m", mean(&ways));
    report.number("top_speed_m_s", mean(&top));
    report.number("most_tilt_from_trim_deg", most_tilt_deg);
    report.number("min_clearance_m", clearance_m);
    report.number("times_faster", ratio);
    let rows = [
        ("flight time, s", mean(&times), mean(slow)),
        ("mean speed, m/s", mean(&ways) / mean(&times), mean(&ways) / mean(slow)),
        ("top speed, m/s", mean(&top), SLOW_M_S),
    ];
    report.table(
        "Dense cylinders (Xu 2023)",
        &["", "speed that follows the scene", "at most 0.5 m/s"],
        rows.map(|(what, ours, slow)| vec![what.to_owned(), format!("{ours:.2}"), format!("{slow:.2}")]),
    );
    report.goal("runs that succeed", succeeded as f64, Bound::Exactly(flights.len() as f64));
    report.goal("collisions", collisions as f64, Bound::Exactly(0.0));
    report.goal("most tilt from trim, degrees", most_tilt_deg, Bound::AtMost(MOST_PITCH_DEG));
    report.goal("times faster than at most 0.5 m/s", ratio, Bound::AtLeast(LEAST_RATIO));
}

fn profile(flight: &Flight) -> Figure {
    let line = |name: &str, of: fn(&Moment) -> f64| Line {
        name: name.to_owned(),
        style: Style::Solid,
        points: flight.track.iter().map(|moment| (moment.time_s, of(moment))).collect(),
    };
    let ends = [flight.track.first(), flight.track.last()].into_iter().flatten();
    Figure {
        x: "time, s".to_owned(),
        y: "speed, m/s; tilt, degrees; height, m".to_owned(),
        is_map: false,
        lines: vec![
            line("speed", |moment| moment.speed_m_s),
            line("tilt from trim", |moment| moment.tilt_deg),
            line("height", |moment| moment.position.z),
            Line {
                name: "0.5 m/s".to_owned(),
                style: Style::Reference,
                points: ends.map(|moment| (moment.time_s, SLOW_M_S)).collect(),
            },
        ],
    }
}

fn map(flight: &Flight, scenario: &Scenario) -> Figure {
    let trunks = scenario.scene.obstacles().iter().filter_map(|obstacle| {
        let Shape::Cylinder { radius, .. } = obstacle.shape else { return None };
        let centre = obstacle.pose.translation.vector;
        let bark = (0..16).map(|k| f64::from(k) * std::f64::consts::TAU / 16.0);
        let points = bark.map(|a| (centre.x + radius * a.cos(), centre.y + radius * a.sin())).collect();
        Some(Line { name: String::new(), style: Style::Filled, points })
    });
    let flown = flight.track.iter().map(|moment| (moment.position.x, moment.position.y)).collect();
    let flown = Line { name: "flown".to_owned(), style: Style::Solid, points: flown };
    Figure {
        x: "east, m".to_owned(),
        y: "north, m".to_owned(),
        is_map: true,
        lines: trunks.chain([flown]).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cylinders_are_crossed_gently() {
        let flight = fly(&scenario(1).expect("a sound scenario")).expect("it can be flown");
        assert_eq!(flight.summary.reason, None);
        assert!(flight.most_tilt_deg() <= MOST_PITCH_DEG, "{}", flight.most_tilt_deg());
        assert!(flight.top_speed_m_s() > 2.0, "{}", flight.top_speed_m_s());
        let mut report = Report::default();
        judge(&mut report, &[flight], &[1.0]);
        assert!(!report.is_reached(), "to fly as slowly takes longer than a second");
    }

    #[test]
    fn a_hovering_vehicle_is_trimmed_and_one_that_leans_is_not() {
        let model = VehicleModel::built_in("x500").expect("a built-in model");
        let at = |pitch_deg: f64| RigidState {
            position: Vector3::zeros(),
            velocity: Vector3::zeros(),
            attitude: nalgebra::UnitQuaternion::from_euler_angles(0.0, f64::to_radians(pitch_deg), 0.0),
            angular_rate: Vector3::zeros(),
        };
        assert!(tilt_from_trim_deg(&at(0.0), &model) < 1e-6);
        assert!((tilt_from_trim_deg(&at(4.0), &model) - 4.0).abs() < 1e-6);
    }
}
