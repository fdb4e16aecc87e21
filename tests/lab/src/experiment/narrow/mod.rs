//! Narrow places that nobody knows beforehand: corridors, bends, crossings, junctions, doors, dead ends and mazes of one
//! vehicle's width, through which several vehicles fly against one another.

mod central;
mod place;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use anyhow::Context as _;
use clap::Args;
use serde_json::{Value, json};
use skein_agent::bthreads::RIGHT_OF_WAY;
use skein_sim::cli::Controller;
use skein_sim::fly::Trial;
use skein_sim::scenario::Scenario;
use skein_sim::summary::{Outcome, Summary};

use self::central::Central;
use self::place::{CRUISE_M_S, Place, Shape, draw};
use crate::numbers::one_or_more;
use crate::quantile::quantile;
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::runs;

const RUNS: usize = 70;
/// Vehicles come no nearer to one another than this, from centre to centre, m.
const LEAST_SEPARATION_M: f64 = 0.8;
/// The time of all together over the longer of the central planner's and that of the slowest alone: of nearly all
/// missions, and of all.
const MOST_TIMES: [f64; 2] = [2.5, 4.0];
/// The slowest flies alone so often; the median counts.
const ALONE: u64 = 5;

#[derive(Args)]
pub struct Narrow {
    /// Missions, whose seeds are 1 to N.
    #[arg(long, value_name = "N", default_value_t = RUNS, value_parser = one_or_more())]
    runs: usize,
    /// Vehicles of a mission, at most.
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = one_or_more())]
    vehicles: usize,
    /// Share of the messages that is lost.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    loss: f64,
    /// Mean latency of messages, milliseconds; with a lease of 4 s.
    #[arg(long, value_name = "MS")]
    latency_ms: Option<f64>,
    /// Vehicles hear one another within so many metres; everywhere, if it is left out.
    #[arg(long, value_name = "M")]
    radio_range_m: Option<f64>,
    /// The seed of the first mission.
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    first_seed: u64,
    /// A folder for the missions' scenarios, as `skein-sim fly` reads them.
    #[arg(long, value_name = "DIR")]
    scenarios: Option<PathBuf>,
}

/// One mission that was flown.
#[derive(Debug, Clone)]
struct Flight {
    shape: Shape,
    is_solvable: bool,
    summary: Summary,
    /// Time of the longest flight over the longer of the central planner's and that of the slowest vehicle alone.
    times: f64,
    /// The central planner brought all to their goals.
    has_central: bool,
    /// The longest that a vehicle waited for right of way at a time, s.
    wait_s: f64,
}

impl Flight {
    fn arrived(&self) -> bool {
        self.summary.per_vehicle.iter().all(|vehicle| vehicle.outcome == Outcome::Arrived)
    }
}

impl Experiment for Narrow {
    const NAME: &'static str = "narrow";
    const ABOUT: &'static str =
        "vehicles against one another through narrow places that nobody knows beforehand";

    fn run(&self) -> anyhow::Result<Report> {
        let seeds: Vec<u64> = (self.first_seed..).take(self.runs).collect();
        let flights = runs::in_turn("narrow places", &seeds, |seed| self.fly(*seed))?;
        let mut report = Report::default();
        let all: Vec<&Flight> = flights.iter().collect();
        let (solvable, impossible): (Vec<&Flight>, Vec<&Flight>) =
            all.iter().partition(|flight| flight.is_solvable);
        let count = |flights: &[&Flight], is: fn(&Flight) -> bool| flights.iter().filter(|f| is(f)).count();
        let arrived = count(&solvable, Flight::arrived);
        let collisions: u64 =
            all.iter().map(|flight| flight.summary.collisions).map(|both| both.obstacle + both.vehicle).sum();
        let least = |of: fn(&Summary) -> Option<f64>| {
            all.iter().filter_map(|flight| of(&flight.summary)).fold(f64::INFINITY, f64::min)
        };
        let separation_m = least(|summary| summary.min_separation_m);
        let clearance_m = least(|summary| summary.min_clearance_m);
        let mut times: Vec<f64> =
            solvable.iter().filter(|flight| flight.arrived()).map(|flight| flight.times).collect();
        times.sort_by(f64::total_cmp);
        let [median, p95, max] = [0.5, 0.95, 1.0].map(|share| quantile(&times, share));
        let longest_s = all.iter().map(|flight| flight.wait_s).fold(0.0, f64::max);
        // A reason is an answer.
        let refused = |flight: &Flight| {
            flight
                .summary
                .per_vehicle
                .iter()
                .all(|vehicle| vehicle.outcome == Outcome::Arrived || vehicle.reason.is_some())
        };
        let rightly_refused = count(&impossible, refused);
        report.number("missions", all.len());
        report.number("arrived", arrived);
        report.number("impossible", impossible.len());
        report.number("rightly_refused", rightly_refused);
        report.number("collisions", collisions);
        report.number("min_separation_m", separation_m);
        report.number("min_clearance_m", clearance_m);
        report.number("time_ratio", json!({ "median": median, "p95": p95, "max": max }));
        report.number("solved_centrally", count(&all, |flight| flight.has_central));
        report.number("waits", json!({ "longest_s": longest_s }));
        let failed: Vec<_> = seeds
            .iter()
            .zip(&flights)
            .filter(|(_, flight)| flight.is_solvable && !flight.arrived())
            .map(|(seed, flight)| {
                json!({
                    "seed": seed,
                    "shape": flight.shape.name(),
                    "why": flight.summary.reason,
                    "longest_wait_s": flight.wait_s,
                })
            })
            .collect();
        report.number("not_arrived", failed);
        report.number("slowest", slowest(&seeds, &flights));
        report.goal(
            "solvable missions in which somebody did not arrive",
            (solvable.len() - arrived) as f64,
            Bound::Exactly(0.0),
        );
        report.goal("collisions", collisions as f64, Bound::Exactly(0.0));
        report.goal("least separation, m", separation_m, Bound::AtLeast(LEAST_SEPARATION_M));
        report.goal("time over the longer of central and alone, 95 %", p95, Bound::AtMost(MOST_TIMES[0]));
        report.goal("the same, most", max, Bound::AtMost(MOST_TIMES[1]));
        report.table("Narrow places", &["place", "missions", "arrived", "time ratio"], rows(&solvable));
        Ok(report)
    }
}

/// The missions that took longest beside their reference, for whoever wants to see why.
fn slowest(seeds: &[u64], flights: &[Flight]) -> Vec<Value> {
    let mut slow: Vec<_> =
        seeds.iter().zip(flights).filter(|(_, flight)| flight.times > MOST_TIMES[0]).collect();
    slow.sort_by(|a, b| b.1.times.total_cmp(&a.1.times));
    let row = |(seed, flight): &(&u64, &Flight)| {
        json!({
            "seed": seed,
            "shape": flight.shape.name(),
            "times": flight.times,
            "longest_wait_s": flight.wait_s,
        })
    };
    slow.iter().take(20).map(row).collect()
}

fn rows(flights: &[&Flight]) -> Vec<Vec<String>> {
    let mut by_shape: BTreeMap<Shape, Vec<&Flight>> = BTreeMap::new();
    flights.iter().for_each(|flight| by_shape.entry(flight.shape).or_default().push(flight));
    let row = |(shape, flights): (Shape, Vec<&Flight>)| {
        let arrived: Vec<f64> =
            flights.iter().filter(|flight| flight.arrived()).map(|flight| flight.times).collect();
        let most = arrived.iter().copied().fold(0.0, f64::max);
        vec![
            shape.name().to_owned(),
            flights.len().to_string(),
            arrived.len().to_string(),
            format!("at most {most:.1}"),
        ]
    };
    by_shape.into_iter().map(row).collect()
}

impl Narrow {
    fn fly(&self, seed: u64) -> anyhow::Result<Flight> {
        let shape = Shape::of(seed);
        let place = draw(shape, self.vehicles, seed);
        let (summary, wait_s) = fly(&self.scenario(&place, seed)?)?;
        let (alone_s, central_s) = reference_s(&place, seed)?;
        let times = summary.flight_time_s.max / central_s.unwrap_or(0.0).max(alone_s).max(1.0);
        let has_central = central_s.is_some();
        Ok(Flight { shape, is_solvable: place.is_solvable, summary, times, has_central, wait_s })
    }

    fn scenario(&self, place: &Place, seed: u64) -> anyhow::Result<Scenario> {
        let mut network = format!("[network]\nloss = {:?}\n", self.loss);
        if let Some(latency_ms) = self.latency_ms {
            let _ = write!(network, "latency_ms = {latency_ms:?}\nlease_ms = 4000\n");
        }
        if let Some(range_m) = self.radio_range_m {
            let _ = writeln!(network, "radio_range_m = {range_m:?}");
        }
        let name = format!("{}-{seed}.toml", place.shape.name().replace(' ', "-"));
        let text = place.scenario(place.routes(), &network);
        if let Some(folder) = &self.scenarios {
            let file = folder.join(&name);
            let written = fs::create_dir_all(folder).and_then(|()| fs::write(&file, &text));
            written.with_context(|| format!("{} cannot be written", file.display()))?;
        }
        Ok(Scenario::from_toml(&text, &name, None, seed)?)
    }
}

/// The time of the slowest vehicle alone in the same unknown world, and that of the central planner, up and down
/// included, if it brings all to their goals, s.
fn reference_s(place: &Place, seed: u64) -> anyhow::Result<(f64, Option<f64>)> {
    let central = Central::new(place, CRUISE_M_S)?;
    let [from, to] = place.routes().get(central.longest()).copied().context("nobody flies")?;
    let alone_s = |to, seed| {
        let text = place.scenario(&[[from, to]], "");
        anyhow::Ok(fly(&Scenario::from_toml(&text, "alone.toml", None, seed)?)?.0.flight_time_s.max)
    };
    let mut alone = (0..ALONE).map(|k| alone_s(to, seed + k)).collect::<anyhow::Result<Vec<_>>>()?;
    alone.sort_by(f64::total_cmp);
    let up_and_down_s = alone_s(from, seed)?;
    Ok((quantile(&alone, 0.5), central.time_s().map(|time_s| time_s + up_and_down_s)))
}

/// Flies, and measures the longest wait for right of way, s.
fn fly(scenario: &Scenario) -> anyhow::Result<(Summary, f64)> {
    let mut since: BTreeMap<usize, f64> = BTreeMap::new();
    let mut longest_s = 0.0_f64;
    let summary = Trial::new(scenario, Controller::Bp)
        .fly(&mut |swarm, _| {
            let now_s = swarm.now().as_secs_f64();
            for (index, agent) in swarm.agents().enumerate() {
                if agent.status(swarm.now()).waiting_for.contains(RIGHT_OF_WAY) {
                    longest_s = longest_s.max(now_s - *since.entry(index).or_insert(now_s));
                } else {
                    since.remove(&index);
                }
            }
        })?
        .summary;
    Ok((summary, longest_s))
}
