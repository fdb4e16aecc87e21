//! Vector field histogram: dense cylinders that are not known before, at a speed that follows the scene (Xu 2023).

mod published;

use clap::Args;
use nalgebra::Vector3;
use serde_json::json;
use skein_agent::pipeline::layers::Layers;
use skein_agent::{AgentConfig, LocalPlanner, Parts};
use skein_sim::cli::Controller;
use skein_sim::fly::Trial;
use skein_sim::scenario::Scenario;
use skein_sim::summary::Summary;
use skein_world::vehicle::GRAVITY_M_S2;
use skein_world::{RigidState, Shape, VehicleModel};

use self::published::{Published, SLOW_M_S};
use crate::figure::{Figure, Line, Style};
use crate::numbers::one_or_more;
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::runs;
use crate::statistics::mean;

const SCENARIO: &str = include_str!("vfh.toml");
const RUNS: usize = 100;
/// In so many of the worlds the published speed is flown.
const PUBLISHED_RUNS: usize = 10;
/// An empty field, crossed by each local planner in turn.
const FIELD: &str = include_str!("vfh-field.toml");
const FIELD_RUNS: usize = 20;
/// The longest that crossing it may take, s.
const FIELD_S: [(LocalPlanner, &str, f64); 2] =
    [(LocalPlanner::Apf, "apf", 39.0), (LocalPlanner::Vfh, "vfh", 52.0)];
/// The published bound on pitch, degrees.
const MOST_PITCH_DEG: f64 = 5.0;
/// The autopilot's mode in which it flies the planner's set-points.
const PLANNED_MODE: &str = "offboard";
/// Least speed-up.
const LEAST_RATIO: f64 = 1.5;

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
        let first = |runs: usize| &seeds[..seeds.len().min(runs)];
        let flights = runs::in_turn("flights", &seeds, |seed| fly(&scenario(*seed)?))?;
        let published = runs::in_turn("at the published speed", first(PUBLISHED_RUNS), |seed| {
            fly_as_published(&scenario(*seed)?)
        })?;
        let mut report = Report::default();
        judge(&mut report, &flights, &published);
        for (planner, name, most_s) in FIELD_S {
            let crossings =
                runs::in_turn("over an empty field", first(FIELD_RUNS), |seed| fly(&field(planner, *seed)?))?;
            judge_field(&mut report, &crossings, name, most_s);
        }
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

/// The empty field, with this local planner.
fn field(planner: LocalPlanner, seed: u64) -> anyhow::Result<Scenario> {
    let mut scenario = Scenario::from_toml(FIELD, "vfh-field.toml", None, seed)?;
    scenario.planners.local = planner;
    Ok(scenario)
}

fn fly(scenario: &Scenario) -> anyhow::Result<Flight> {
    track(scenario, Trial::new(scenario, Controller::Bp))
}

fn fly_as_published(scenario: &Scenario) -> anyhow::Result<Flight> {
    let layers = |config: &AgentConfig| Layers {
        follower: Box::new(Published::new(&config.envelope)),
        ..Layers::of(&config.envelope, config.fence, config.planners)
    };
    let parts = move |config: &AgentConfig| Parts { layers: layers(config), ..Parts::of(config) };
    track(scenario, Trial::new(scenario, Controller::Bp).with_parts(parts))
}

fn track(scenario: &Scenario, trial: Trial<'_>) -> anyhow::Result<Flight> {
    let mut track = Vec::new();
    let flown = trial.fly(&mut |swarm, _| {
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

fn judge(report: &mut Report, flights: &[Flight], published: &[Flight]) {
    let slow = &times(published);
    let summaries = || flights.iter().map(|flight| &flight.summary);
    let collisions: u64 = summaries().map(|s| s.collisions.obstacle + s.collisions.vehicle).sum();
    let succeeded = summaries().filter(|summary| summary.succeeded).count();
    let times = times(flights);
    let ratio = mean(slow) / mean(&times[..slow.len()]);
    let ways = lengths(flights);
    let most_tilt_deg = flights.iter().map(Flight::most_tilt_deg).fold(0.0, f64::max);
    let top = tops(flights);
    let clearance_m = summaries().filter_map(|s| s.min_clearance_m).fold(f64::INFINITY, f64::min);
    report.number("runs", flights.len());
    report.number("succeeded", succeeded);
    report.number("collisions", collisions);
    report.number("flight_time_s", mean(&times));
    report.number("published_flight_time_s", json!({ "runs": slow.len(), "mean": mean(slow) }));
    report.number("hard_brakes", hard_brakes(flights));
    report.number("path_length_m", mean(&ways));
    report.number("top_speed_m_s", mean(&top));
    report.number("most_tilt_from_trim_deg", most_tilt_deg);
    report.number("min_clearance_m", clearance_m);
    report.number("times_faster", ratio);
    let rows = [
        ("flight time, s", mean(&times), mean(slow)),
        ("mean speed, m/s", mean(&ways) / mean(&times), mean(&lengths(published)) / mean(slow)),
        ("top speed, m/s", mean(&top), mean(&tops(published))),
    ];
    report.table(
        "Dense cylinders (Xu 2023)",
        &["", "speed that follows the scene", "as published"],
        rows.map(|(what, ours, slow)| vec![what.to_owned(), format!("{ours:.2}"), format!("{slow:.2}")]),
    );
    report.goal("runs that succeed", succeeded as f64, Bound::Exactly(flights.len() as f64));
    report.goal("collisions", collisions as f64, Bound::Exactly(0.0));
    report.goal("most tilt from trim, degrees", most_tilt_deg, Bound::AtMost(MOST_PITCH_DEG));
    report.goal("times faster than as published", ratio, Bound::AtLeast(LEAST_RATIO));
}

/// Judges the crossings of the empty field by one local planner.
fn judge_field(report: &mut Report, crossings: &[Flight], name: &str, most_s: f64) {
    let longest_s = times(crossings).into_iter().fold(0.0, f64::max);
    let tilt_deg = crossings.iter().map(Flight::most_tilt_deg).fold(0.0, f64::max);
    let failed = crossings.iter().filter(|crossing| !crossing.summary.succeeded).count();
    report.number(
        &format!("field_{name}"),
        json!({ "runs": crossings.len(), "failed": failed, "longest_s": longest_s, "most_tilt_from_trim_deg": tilt_deg }),
    );
    report.goal(&format!("longest over 150 m of field by {name}, s"), longest_s, Bound::AtMost(most_s));
    report.goal(&format!("crossings of the field by {name} that fail"), failed as f64, Bound::Exactly(0.0));
    if name == "vfh" {
        report.goal("most tilt from trim over the field, degrees", tilt_deg, Bound::AtMost(MOST_PITCH_DEG));
    }
}

fn times(flights: &[Flight]) -> Vec<f64> {
    flights.iter().map(|flight| flight.summary.flight_time_s.mean).collect()
}

fn lengths(flights: &[Flight]) -> Vec<f64> {
    flights.iter().map(|flight| flight.summary.path_length_m.mean).collect()
}

fn tops(flights: &[Flight]) -> Vec<f64> {
    flights.iter().map(Flight::top_speed_m_s).collect()
}

/// Stops that the safety filter asked for beyond 5 degrees of tilt, of all flights.
fn hard_brakes(flights: &[Flight]) -> u64 {
    flights.iter().flat_map(|flight| &flight.summary.per_vehicle).map(|vehicle| vehicle.hard_brakes).sum()
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
        let as_published =
            fly_as_published(&scenario(1).expect("a sound scenario")).expect("it can be flown");
        judge(&mut report, &[flight], &[as_published]);
        assert!(report.is_reached());
        let same = fly(&scenario(1).expect("a sound scenario")).expect("it can be flown");
        let mut report = Report::default();
        judge(&mut report, std::slice::from_ref(&same), std::slice::from_ref(&same));
        assert!(!report.is_reached(), "it is not faster than itself");
    }

    #[test]
    fn an_empty_field_is_crossed_without_a_stop() {
        for (planner, name, most_s) in FIELD_S {
            let crossing = fly(&field(planner, 1).expect("a sound scenario")).expect("it can be flown");
            let mut report = Report::default();
            let cruise = crossing.track.iter().filter(|moment| (-45.0..45.0).contains(&moment.position.x));
            let slowest_m_s = cruise.map(|moment| moment.speed_m_s).fold(f64::INFINITY, f64::min);
            assert!(slowest_m_s > 4.0, "{name}: {slowest_m_s}");
            judge_field(&mut report, &[crossing], name, most_s);
            assert!(report.is_reached(), "{name}");
        }
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
