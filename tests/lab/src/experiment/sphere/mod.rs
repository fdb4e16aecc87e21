//! `sphere`: all vehicles start on a sphere and fly through its middle to the other side (the `Sphere` example of
//! RVO2-3D, van den Berg 2011): the crowd in which separation shows what it can do.
//!
//! Vehicles are points that fly what the repulsion and the safety filter make of "straight to the goal", no more: the
//! two that fly on vehicles, with the example's size, speed and time step. They change their velocity by no more than
//! [`ACCEL_M_S2`] allows; those of the peer take on any velocity at once, as in the example.

#[cfg(feature = "peers")]
mod dodgy;
mod grid;

use clap::Args;
use nalgebra::Vector3;
use serde_json::{Value, json};
use skein_planning::local::apf::limited;
use skein_planning::separation::{FilterConfig, Motion, Neighbour, RepulsionConfig, filter, repulsion};

use self::grid::Grid;
use crate::cpu_time;
use crate::figure::{Figure, Line, Style};
use crate::numbers::one_or_more;
use crate::report::{Bound, Report};
use crate::reported::Experiment;

/// Vehicles, if none are asked for, and the radius of their sphere, metres. More vehicles have as much of the sphere
/// each.
const PUBLISHED: (usize, f64) = (100, 35.0);
/// Vehicles of the larger sphere that is flown beside it.
const MANY: usize = 1000;
/// Radius of a vehicle, metres.
const HULL_M: f64 = 1.5;
/// Distance that must be kept, centre to centre, metres.
const SEPARATION_M: f64 = 2.0 * HULL_M;
/// Asked for beyond it, metres: what the filter's formulas leave out is of second order in the time step.
const MARGIN_M: f64 = 0.01;
/// Fastest flight, m/s.
const SPEED_M_S: f64 = 2.0;
/// Time step, seconds.
const STEP_S: f64 = 0.125;
/// Most by which a vehicle of ours changes its velocity, m/s2.
const ACCEL_M_S2: f64 = 2.5;
/// Slower than the straight way by this factor, a flight has failed.
const PATIENCE: f64 = 10.0;
/// Times of the peer that ours may take.
const MOST_TIME_RATIO: f64 = 1.25;
/// Ways that a figure shows.
const WAYS_SHOWN: usize = 12;

/// A vehicle on its way.
#[derive(Debug, Clone, PartialEq)]
struct Vehicle {
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    goal: Vector3<f64>,
}

impl Vehicle {
    /// Straight to the goal, and to rest there.
    fn preferred(&self) -> Vector3<f64> {
        let offset = self.goal - self.position;
        let distance_m = offset.norm();
        if distance_m > SPEED_M_S { offset * (SPEED_M_S / distance_m) } else { offset }
    }

    fn has_arrived(&self) -> bool {
        (self.goal - self.position).norm() < HULL_M
    }
}

/// Decides each vehicle's next velocity.
trait Avoidance {
    fn velocities(&self, vehicles: &[Vehicle]) -> Vec<Vector3<f64>>;
}

/// Skein's: each vehicle by itself, from what it knows of those near it.
struct Ours {
    filter: FilterConfig,
    repulsion: RepulsionConfig,
    /// Further away nobody matters, metres.
    reach_m: f64,
}

impl Ours {
    fn new() -> Self {
        let filter = FilterConfig {
            separation_m: SEPARATION_M + MARGIN_M,
            max_speed_m_s: SPEED_M_S,
            decel_m_s2: ACCEL_M_S2,
            latency_s: STEP_S,
            hull_radius_m: HULL_M,
            vertical_stretch: 1.0,
            ..FilterConfig::default()
        };
        let repulsion = RepulsionConfig {
            influence_m: 2.0 * SEPARATION_M,
            keep_right_full_m: SEPARATION_M + 1.0,
            vertical_stretch: 1.0,
            ..RepulsionConfig::default()
        };
        Self { filter, repulsion, reach_m: filter.reach_m().max(repulsion.influence_m) }
    }
}

impl Avoidance for Ours {
    fn velocities(&self, vehicles: &[Vehicle]) -> Vec<Vector3<f64>> {
        let positions: Vec<_> = vehicles.iter().map(|vehicle| vehicle.position).collect();
        let grid = Grid::new(&positions, self.reach_m);
        let mut neighbours = Vec::new();
        let velocities = vehicles.iter().enumerate().map(|(at, vehicle)| {
            neighbours.clear();
            let near = grid.within(&vehicle.position, self.reach_m).filter(|other| *other != at);
            neighbours.extend(near.filter_map(|other| Some(neighbour(other, vehicles.get(other)?))));
            let wanted = vehicle.preferred();
            let push = repulsion(&vehicle.position, &wanted, &neighbours, &self.repulsion);
            let motion = Motion {
                position: vehicle.position,
                velocity: vehicle.velocity,
                acceleration: Vector3::zeros(),
                sigma_m: 0.0,
                desired: limited(wanted + push, SPEED_M_S),
                planar: false,
            };
            let safe = filter(&motion, &neighbours, &[], &self.filter).velocity;
            vehicle.velocity + limited(safe - vehicle.velocity, ACCEL_M_S2 * STEP_S)
        });
        velocities.collect()
    }
}

fn neighbour(at: usize, vehicle: &Vehicle) -> Neighbour {
    Neighbour {
        id: u32::try_from(at).unwrap_or(u32::MAX),
        position: vehicle.position,
        velocity: vehicle.velocity,
        sigma_m: 0.0,
        age_s: 0.0,
        radius_m: HULL_M,
        cooperative: true,
    }
}

#[derive(Debug, Clone, Default)]
struct Flight {
    arrived: usize,
    /// Until all were at their goals, or the patience was over, seconds.
    time_s: f64,
    min_separation_m: f64,
    /// Steps at whose end, or on the way to it, somebody was nearer to another than is allowed.
    steps_too_near: usize,
    steps: usize,
    /// CPU time of the avoidance alone, with the search for neighbours, milliseconds.
    step_ms: f64,
    /// The least distance after each step, metres.
    separation_m: Vec<(f64, f64)>,
    /// The tracks of some of the vehicles, seen from above, metres.
    ways: Vec<Vec<(f64, f64)>>,
}

impl Flight {
    fn to_json(&self) -> Value {
        json!({
            "arrived": self.arrived,
            "time_s": self.time_s,
            "min_separation_m": self.min_separation_m,
            "steps": self.steps,
            "steps_too_near": self.steps_too_near,
            "step_ms": self.step_ms,
        })
    }
}

/// Vehicles spread evenly over a sphere (on a spiral by the golden angle, Swinbank and Purser 2006) that stands 5 m
/// above the ground, each with its goal opposite.
fn on_sphere(count: usize, radius_m: f64) -> Vec<Vehicle> {
    let golden_rad = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let centre = Vector3::new(0.0, 0.0, radius_m + 5.0);
    let vehicle = |at: usize| {
        let height = 1.0 - (2.0 * at as f64 + 1.0) / count as f64;
        let (sin, cos) = (golden_rad * at as f64).sin_cos();
        let across = (1.0 - height * height).sqrt();
        let offset = Vector3::new(across * cos, across * sin, height) * radius_m;
        Vehicle { position: centre + offset, velocity: Vector3::zeros(), goal: centre - offset }
    };
    (0..count).map(vehicle).collect()
}

/// Flies until all are at their goals at once.
fn fly(mut vehicles: Vec<Vehicle>, avoidance: &dyn Avoidance) -> anyhow::Result<Flight> {
    let straight_s =
        vehicles.iter().map(|one| (one.goal - one.position).norm() / SPEED_M_S).fold(0.0, f64::max);
    let mut flight = Flight { min_separation_m: f64::INFINITY, ..Flight::default() };
    flight.ways = vec![Vec::new(); WAYS_SHOWN.min(vehicles.len())];
    let shown_every = vehicles.len().div_ceil(WAYS_SHOWN).max(1);
    let mut cpu_s = 0.0;
    while flight.arrived < vehicles.len() && flight.time_s < PATIENCE * straight_s {
        let since = cpu_time::this_thread()?;
        let velocities = avoidance.velocities(&vehicles);
        cpu_s += (cpu_time::this_thread()? - since).as_secs_f64();
        for (vehicle, velocity) in vehicles.iter_mut().zip(velocities) {
            vehicle.velocity = velocity;
        }
        let nearest_m = least_distance_in_step(&vehicles);
        for vehicle in &mut vehicles {
            vehicle.position += vehicle.velocity * STEP_S;
        }
        flight.steps += 1;
        flight.time_s += STEP_S;
        flight.steps_too_near += usize::from(nearest_m < SEPARATION_M);
        flight.min_separation_m = flight.min_separation_m.min(nearest_m);
        flight.separation_m.push((flight.time_s, nearest_m));
        for (way, vehicle) in flight.ways.iter_mut().zip(vehicles.iter().step_by(shown_every)) {
            way.push((vehicle.position.x, vehicle.position.y));
        }
        flight.arrived = vehicles.iter().filter(|vehicle| vehicle.has_arrived()).count();
    }
    flight.step_ms = 1e3 * cpu_s / flight.steps.max(1) as f64;
    Ok(flight)
}

/// The least distance of any two while they fly straight on for a step: not at its ends only.
fn least_distance_in_step(vehicles: &[Vehicle]) -> f64 {
    let positions: Vec<_> = vehicles.iter().map(|vehicle| vehicle.position).collect();
    let reach_m = 2.0 * SEPARATION_M;
    let grid = Grid::new(&positions, reach_m);
    let mut least_m = reach_m;
    for (at, one) in vehicles.iter().enumerate() {
        for other in grid.within(&one.position, reach_m).filter(|other| *other > at) {
            let Some(other) = vehicles.get(other) else { continue };
            let (offset, drift) = (other.position - one.position, other.velocity - one.velocity);
            let nearest_s = -offset.dot(&drift) / drift.norm_squared();
            let nearest_s = if nearest_s.is_finite() { nearest_s.clamp(0.0, STEP_S) } else { 0.0 };
            least_m = least_m.min((offset + drift * nearest_s).norm());
        }
    }
    least_m
}

/// A size of sphere, flown by ours and by the peer.
struct Both {
    vehicles: usize,
    radius_m: f64,
    ours: Flight,
    theirs: Option<Flight>,
}

fn fly_both(vehicles: usize) -> anyhow::Result<Both> {
    let (published, radius_m) = PUBLISHED;
    let radius_m = radius_m * (vehicles as f64 / published as f64).sqrt();
    eprintln!("{vehicles} vehicles on a sphere of {radius_m:.0} m");
    let ours = fly(on_sphere(vehicles, radius_m), &Ours::new())?;
    Ok(Both { vehicles, radius_m, ours, theirs: fly_peer(vehicles, radius_m)? })
}

#[cfg(feature = "peers")]
fn fly_peer(vehicles: usize, radius_m: f64) -> anyhow::Result<Option<Flight>> {
    fly(on_sphere(vehicles, radius_m), &dodgy::Dodgy).map(Some)
}

#[cfg(not(feature = "peers"))]
fn fly_peer(_: usize, _: f64) -> anyhow::Result<Option<Flight>> {
    Ok(None)
}

impl Both {
    fn to_json(&self) -> Value {
        let mut object = self.ours.to_json();
        object["vehicles"] = self.vehicles.into();
        object["radius_m"] = self.radius_m.into();
        if let Some(theirs) = &self.theirs {
            object["peers"] = json!({ "dodgy_3d": theirs.to_json() });
            object["time_ratio"] = (self.ours.time_s / theirs.time_s).into();
            object["step_ratio"] = (self.ours.step_ms / theirs.step_ms).into();
        }
        object
    }

    fn rows(&self) -> Vec<Vec<String>> {
        let row = |name: &str, flight: &Flight| {
            vec![
                self.vehicles.to_string(),
                name.to_owned(),
                flight.arrived.to_string(),
                format!("{:.1}", flight.time_s),
                format!("{:.4}", flight.min_separation_m),
                format!("{} of {}", flight.steps_too_near, flight.steps),
                format!("{:.3}", flight.step_ms),
            ]
        };
        let theirs = self.theirs.iter().map(|theirs| row("dodgy_3d (ORCA)", theirs));
        std::iter::once(row("skein", &self.ours)).chain(theirs).collect()
    }
}

#[derive(Args)]
pub struct Sphere {
    /// Vehicles; the published hundred, and a thousand besides, if not given.
    #[arg(long, value_name = "N", value_parser = one_or_more())]
    vehicles: Option<usize>,
}

impl Experiment for Sphere {
    const NAME: &'static str = "sphere";
    const ABOUT: &'static str = "a hundred vehicles through the middle of a sphere, beside ORCA";

    fn run(&self) -> anyhow::Result<Report> {
        let first = fly_both(self.vehicles.unwrap_or(PUBLISHED.0))?;
        let many = if self.vehicles.is_none() { Some(fly_both(MANY)?) } else { None };
        let mut report = Report::default();
        if let Value::Object(numbers) = first.to_json() {
            numbers.into_iter().for_each(|(name, value)| report.number(&name, value));
        }
        report.number("acceleration_limit_m_s2", ACCEL_M_S2);
        if let Some(many) = &many {
            report.number("many", many.to_json());
        }
        report.table(
            "Through the middle of a sphere",
            &[
                "vehicles",
                "",
                "arrived",
                "time (s)",
                "least distance (m)",
                "steps too near",
                "CPU of a step (ms)",
            ],
            first.rows().into_iter().chain(many.iter().flat_map(Both::rows)),
        );
        report.goal("arrived", first.ours.arrived as f64, Bound::Exactly(first.vehicles as f64));
        report.goal("least distance (m)", first.ours.min_separation_m, Bound::AtLeast(SEPARATION_M));
        match &first.theirs {
            Some(theirs) => {
                let time = first.ours.time_s / theirs.time_s;
                report.goal("time over dodgy_3d's", time, Bound::AtMost(MOST_TIME_RATIO));
                let step = first.ours.step_ms / theirs.step_ms;
                report.goal("CPU time of a step over dodgy_3d's", step, Bound::AtMost(1.0));
            }
            None => {
                eprintln!("no comparison: the cargo feature `peers` builds it in");
            }
        }
        report.figure("sphere-separation", separation_figure(&first));
        report.figure("sphere-ways", ways_figure(&first));
        Ok(report)
    }
}

fn separation_figure(both: &Both) -> Figure {
    let line = |name: &str, style, flight: &Flight| Line {
        name: name.to_owned(),
        style,
        points: flight.separation_m.clone(),
    };
    let end_s = both.ours.time_s.max(both.theirs.as_ref().map_or(0.0, |theirs| theirs.time_s));
    let allowed = Line {
        name: "hulls touch".to_owned(),
        style: Style::Reference,
        points: vec![(0.0, SEPARATION_M), (end_s, SEPARATION_M)],
    };
    let ours = line("skein", Style::Solid, &both.ours);
    let theirs = both.theirs.iter().map(|theirs| line("dodgy_3d (ORCA)", Style::Solid, theirs));
    Figure {
        x: "time (s)".to_owned(),
        y: "least distance, centre to centre (m)".to_owned(),
        is_map: false,
        lines: [ours, allowed].into_iter().chain(theirs).collect(),
    }
}

fn ways_figure(both: &Both) -> Figure {
    let way =
        |points: &Vec<(f64, f64)>| Line { name: String::new(), style: Style::Solid, points: points.clone() };
    Figure {
        x: "east (m)".to_owned(),
        y: "north (m)".to_owned(),
        is_map: true,
        lines: both.ours.ways.iter().map(way).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vehicles_of_any_number_pass_the_middle_and_keep_their_distance() {
        for (count, radius_m) in [(2, 10.0), (30, 19.0)] {
            let flight = fly(on_sphere(count, radius_m), &Ours::new()).expect("CPU time can be read");
            assert_eq!(flight.arrived, count);
            assert!(flight.min_separation_m >= SEPARATION_M, "{count}: {}", flight.min_separation_m);
            assert!(flight.min_separation_m < 2.0 * SEPARATION_M, "{count}: they met");
        }
    }

    #[test]
    fn goals_lie_opposite_and_starts_apart() {
        let vehicles = on_sphere(100, 35.0);
        let centre = Vector3::new(0.0, 0.0, 40.0);
        assert!(vehicles.iter().all(|one| ((one.position + one.goal) / 2.0 - centre).norm() < 1e-9));
        assert_eq!(least_distance_in_step(&vehicles), 2.0 * SEPARATION_M, "none nearer than is looked");
    }

    #[test]
    fn who_passes_between_two_steps_is_noticed() {
        let vehicle = |x: f64, speed: f64| Vehicle {
            position: Vector3::new(x, 0.0, 0.0),
            velocity: Vector3::new(speed, 0.0, 0.0),
            goal: Vector3::zeros(),
        };
        let passing = [vehicle(-0.1, 2.0), vehicle(0.1, -2.0)];
        assert!(least_distance_in_step(&passing) < 1e-9);
    }
}
