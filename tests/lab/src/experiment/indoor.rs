//! Zhang 2019: a floor of markers, without satellites. A vehicle flies past the obstacles by what its camera, flow sensor
//! and inertial unit tell; its estimate is held against the truth.

use std::fmt::Write as _;

use clap::Args;
use nalgebra::Vector3;
use serde_json::json;
use skein_planning::map::VoxelIndex;
use skein_sim::cli::Controller;
use skein_sim::fly::{Swarm, Trial};
use skein_sim::scenario::Scenario;
use skein_sim::summary::Summary;

use super::dstar_grid::{BLOCKED, MARKERS, flying_route, marker};
use crate::figure::{Figure, Line, Style};
use crate::numbers::one_or_more;
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::runs;
use crate::statistics::mean;

const RUNS: usize = 20;
/// From marker to marker on the paper's floor and on that of the fleet, m.
const PITCH_M: f64 = 0.36;
const FLEET_PITCH_M: f64 = 0.72;
const HEIGHT_M: f64 = 1.2;
/// When the camera finds nothing, s.
const MISSED: [f64; 2] = [10.0, 13.0];
/// Time after that in which what has drifted still shows, s.
const AFTER_S: f64 = 0.5;
/// The ways of the fleet's other vehicles, by markers' numbers.
const OTHERS: [&[usize]; 3] = [&[91, 51, 11], &[100, 95], &[10, 40, 60]];

#[derive(Args)]
pub struct Indoor {
    /// Flights of each kind, whose seeds are 1 to N.
    #[arg(long, value_name = "N", default_value_t = RUNS, value_parser = one_or_more())]
    runs: usize,
}

impl Experiment for Indoor {
    const NAME: &'static str = "indoor";
    const ABOUT: &'static str = "a floor of markers without satellites: estimate, outage, fleet (Zhang 2019)";

    fn run(&self) -> anyhow::Result<Report> {
        let seeds: Vec<u64> = (1..=self.runs as u64).collect();
        let mut report = Report::default();
        report.number("runs", seeds.len());
        let route = floor(PITCH_M, 1, "");
        let missed = floor(PITCH_M, 1, &outage());
        let fleet = floor(FLEET_PITCH_M, 1 + OTHERS.len(), "");
        for (name, text) in [("route", &route), ("outage", &missed), ("fleet", &fleet)] {
            let flights = runs::in_turn(name, &seeds, |seed| fly(text, *seed))?;
            tell(&mut report, name, &flights);
            if let (true, Some(first)) = (name == "route", flights.first()) {
                report.figure("velocity", velocity(first));
                report.figure("way", way(first));
            }
        }
        Ok(report)
    }
}

/// Where a cell of the floor is, m.
fn place(cell: VoxelIndex, pitch_m: f64) -> [f64; 3] {
    [cell.x as f64 * pitch_m, cell.y as f64 * pitch_m, HEIGHT_M]
}

/// The scenario: a post in the middle of each blocked cell, and so many vehicles.
fn floor(pitch_m: f64, vehicles: usize, more: &str) -> String {
    let side_m = MARKERS as f64 * pitch_m;
    let mut text = format!(
        "name = \"indoor\"\nmodel = \"crazyflie-indoor\"\ncruise_speed_m_s = 0.6\ntakeoff_height_m = {HEIGHT_M}\n\
         margin_m = 0.1\ntime_limit_s = 120.0\n\
         [bounds]\nmin_m = [-1.5, -1.5, -0.5]\nmax_m = [{0}, {0}, 3.2]\n\
         [markers]\ncolumns = {MARKERS}\nrows = {MARKERS}\nside_m = 0.18\npitch_m = {pitch_m}\n{more}",
        side_m + 1.5
    );
    let others = OTHERS.map(|way| way.iter().map(|number| marker(*number)).collect());
    let ways = std::iter::once(flying_route()).chain(others);
    for way in ways.take(vehicles) {
        let mut places = way.iter().map(|cell| place(*cell, pitch_m));
        if let Some([x, y, _]) = places.next() {
            let ahead: Vec<_> = places.collect();
            let _ = write!(text, "[[vehicle]]\nstart_m = [{x}, {y}]\nwaypoints_m = {ahead:?}\n");
        }
    }
    for number in BLOCKED {
        let [x, y, _] = place(marker(number), pitch_m);
        let _ = write!(
            text,
            "[[obstacle]]\ncentre_m = [{x}, {y}, 1.0]\ncylinder = {{ radius_m = 0.06, height_m = 2.0 }}\n"
        );
    }
    text
}

/// The camera finds no markers for a while.
fn outage() -> String {
    let [from_s, to_s] = MISSED;
    format!("[[position_fault]]\nat_s = {from_s}\nfor_s = {}\nmarkers_missed = true\n", to_s - from_s)
}

/// The record of one flight; the first vehicle's in time.
struct Flight {
    summary: Summary,
    seen: Seen,
}

#[derive(Default)]
struct Seen {
    ticks: u32,
    beyond_3_sigma: u32,
    square_m2: f64,
    /// The greatest error while the camera finds nothing, m.
    drift_m: f64,
    /// The most by which an estimate moved in a tick beside its velocity, m.
    step_m: f64,
    last: Option<(f64, Vector3<f64>)>,
    track: Vec<TrackPoint>,
}

/// Time, s; position by belief and truth, m; speed east by belief, truth and flow alone, m/s.
type TrackPoint = (f64, [Vector3<f64>; 2], [Option<f64>; 3]);

impl Seen {
    fn look(&mut self, swarm: &Swarm, index: usize) {
        let now = swarm.now();
        let agent = swarm.agents().nth(index).map(|agent| *agent.estimate());
        let (Some(estimate), Some(truth)) = (agent, swarm.simulation().vehicle(index)) else { return };
        let (Some(motion), Some((position, attitude))) = (estimate.motion, estimate.pose_at(now)) else {
            return;
        };
        if !truth.airborne {
            return;
        }
        let error = position - truth.motion.position;
        let at_s = now.as_secs_f64();
        self.ticks += 1;
        let is_beyond = |axis: usize| error[axis].abs() > 3.0 * motion.value.axis_sigma_m(axis);
        self.beyond_3_sigma += u32::from((0..3).any(is_beyond));
        self.square_m2 += error.norm_squared();
        if (MISSED[0]..MISSED[1] + AFTER_S).contains(&at_s) {
            self.drift_m = self.drift_m.max(error.norm());
        }
        if index > 0 {
            return;
        }
        if let Some((before_s, before)) = self.last.replace((at_s, position)) {
            let moved = position - before - motion.value.velocity * (at_s - before_s);
            self.step_m = self.step_m.max(moved.norm());
        }
        let readings = swarm.simulation().readings(index);
        let flow = readings.and_then(|readings| readings.flow).filter(|flow| flow.quality > 0.0);
        let by_flow = flow.map(|flow| {
            let body = Vector3::new(flow.rate.x, flow.rate.y, 0.0) * truth.motion.position.z;
            (attitude * body).x
        });
        let speeds = [Some(motion.value.velocity.x), Some(truth.motion.velocity.x), by_flow];
        self.track.push((at_s, [position, truth.motion.position], speeds));
    }

    fn rms_m(&self) -> f64 {
        (self.square_m2 / f64::from(self.ticks.max(1))).sqrt()
    }

    /// The share of ticks in which the error of every axis is inside 3 sigma.
    fn inside(&self) -> f64 {
        1.0 - f64::from(self.beyond_3_sigma) / f64::from(self.ticks.max(1))
    }
}

fn fly(text: &str, seed: u64) -> anyhow::Result<Flight> {
    let scenario = Scenario::from_toml(text, "indoor.toml", None, seed)?;
    let mut seen = Seen::default();
    let count = scenario.vehicles.len();
    let flown = Trial::new(&scenario, Controller::Bp)
        .fly(&mut |swarm, _| (0..count).for_each(|index| seen.look(swarm, index)))?;
    Ok(Flight { summary: flown.summary, seen })
}

fn tell(report: &mut Report, name: &str, flights: &[Flight]) {
    let greatest = |of: fn(&Seen) -> f64| flights.iter().map(|flight| of(&flight.seen)).fold(0.0, f64::max);
    let arrived = flights.iter().filter(|flight| flight.summary.succeeded).count();
    let collisions = |flight: &Flight| flight.summary.collisions.obstacle + flight.summary.collisions.vehicle;
    let collided: u64 = flights.iter().map(collisions).sum();
    let inside = flights.iter().map(|flight| flight.seen.inside()).fold(1.0, f64::min);
    let (rms_m, drift_m, step_m) =
        (greatest(Seen::rms_m), greatest(|seen| seen.drift_m), greatest(|seen| seen.step_m));
    let factor = mean(&flights.iter().map(|flight| flight.summary.realtime_factor).collect::<Vec<_>>());
    report.number(
        name,
        json!({
            "arrived": arrived,
            "collisions": collided,
            "worst_rms_m": rms_m,
            "least_inside_3_sigma": inside,
            "worst_drift_m": (name == "outage").then_some(drift_m),
            "worst_step_m": step_m,
            "realtime_factor": factor,
        }),
    );
    report.goal(
        &format!("{name}: flights that arrive"),
        arrived as f64,
        Bound::Exactly(flights.len() as f64),
    );
    report.goal(&format!("{name}: collisions"), collided as f64, Bound::Exactly(0.0));
    report.goal(&format!("{name}: least share inside 3 sigma"), inside, Bound::AtLeast(0.99));
    report.goal(&format!("{name}: greatest step of the estimate in a tick, m"), step_m, Bound::AtMost(0.05));
    match name {
        "outage" => {
            report.goal("outage: greatest drift without markers for 3 s, m", drift_m, Bound::AtMost(0.1));
        }
        "route" => {
            report.goal("route: greatest RMS of estimate against truth, m", rms_m, Bound::AtMost(0.03));
        }
        _ => {}
    }
}

/// The estimate's velocity beside what flow alone tells (Zhang 2019, fig. 12).
fn velocity(flight: &Flight) -> Figure {
    let line = |name: &str, which: usize, style| Line {
        name: name.to_owned(),
        style,
        points: flight
            .seen
            .track
            .iter()
            .filter_map(|(at_s, _, speeds)| Some((*at_s, speeds[which]?)))
            .collect(),
    };
    Figure {
        x: "time, s".to_owned(),
        y: "velocity east, m/s".to_owned(),
        is_map: false,
        lines: vec![
            line("flow alone", 2, Style::Solid),
            line("truth", 1, Style::Reference),
            line("estimate", 0, Style::Solid),
        ],
    }
}

fn way(flight: &Flight) -> Figure {
    let line = |name: &str, which: usize, style| Line {
        name: name.to_owned(),
        style,
        points: flight.seen.track.iter().map(|(_, places, _)| (places[which].x, places[which].y)).collect(),
    };
    Figure {
        x: "east, m".to_owned(),
        y: "north, m".to_owned(),
        is_map: true,
        lines: vec![line("truth", 1, Style::Reference), line("estimate", 0, Style::Solid)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_flies_past_the_obstacles_by_markers_and_without_them_for_three_seconds() {
        let report = Indoor { runs: 1 }.run().expect("it can be flown");
        assert!(report.is_reached(), "{report}");
    }
}
