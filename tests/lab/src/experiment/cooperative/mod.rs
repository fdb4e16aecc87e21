//! Ground and vehicles plan together in flight (P3): twenty vehicles fly to ten targets in P3's world, and the ground
//! plans for all, nobody does, the link is cut under way, or two vehicles are lost.
//!
//! The planners and the pace are those that fly: [`skein_ground::planning`], [`skein_agent::way_on`] and
//! [`skein_agent::arrival`]. The vehicles are points ([`flight`]), so that a run takes seconds; weights are P3's, without
//! energy and smoothness.

mod flight;

use anyhow::Context as _;
use clap::Args;
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::json;
use skein_agent::Envelope;
use skein_agent::way_on::WayOn;
use skein_dbp::NodeName;
use skein_ground::planning::{FleetProblem, Flyer as Planned, Other, Theatre, plan};
use skein_planning::airspace::Airspace;
use skein_swarm::route::{
    AnyAngleConfig, Craft, Effort, Plan, Planner, RouteCost, RouteProblem, Traffic, any_angle, plan_in_turn,
};
use skein_wire::Route;

use self::flight::{Flyer, STEP_S, step};
use super::swarm_planning::baseline::Baseline;
use super::swarm_planning::scene::{self, SPACING_M, TARGETS};
use crate::numbers::one_or_more;
use crate::quantile::quantile;
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::{cpu_time, runs, statistics};

const RUNS: usize = 100;
const VEHICLES: usize = 20;
const FIRST_SEED: u64 = 20_001;
/// Inner waypoints of a route that a vehicle plans.
const WAYPOINTS: usize = 10;
/// P3's vehicles; how they brake and how far apart they keep is chosen.
const ENVELOPE: Envelope = Envelope {
    cruise_m_s: 20.0,
    climb_m_s: 8.0,
    endurance_s: 600.0,
    brake_m_s2: 3.5,
    separation_m: 20.0,
    ..Envelope::DEFAULT
};
/// A vehicle that is silent for so long is lost for the ground, s.
const LOST_AFTER_S: f64 = 5.0;
/// A flight that lasts longer has failed, s.
const LONGEST_S: f64 = 600.0;
/// Runs for which the standard swarm plans too, with so many times the effort.
const CONVERGED: (usize, usize) = (5, 40);

/// The planners and the events of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Ground,
    Onboard,
    Cut,
    Lost,
}

const MODES: [(Mode, &str, f64); 4] = [
    (Mode::Ground, "ground", 1.0),
    (Mode::Onboard, "onboard", 1.0),
    (Mode::Cut, "link_cut", 3.0),
    (Mode::Lost, "two_lost", 3.0),
];

#[derive(Args)]
pub struct Cooperative {
    /// Runs, each with a seed of its own.
    #[arg(long, value_name = "N", default_value_t = RUNS, value_parser = one_or_more())]
    runs: usize,
    /// Vehicles of a run.
    #[arg(long, value_name = "N", default_value_t = VEHICLES, value_parser = one_or_more())]
    vehicles: usize,
}

/// One flight of all vehicles.
struct Flown {
    targets_reached: usize,
    spread_s: f64,
    cost_m: f64,
    least_separation_m: f64,
    /// CPU time of each plan on board, ms.
    onboard_ms: Vec<f64>,
    /// CPU time of each plan of the ground for all, ms.
    ground_ms: Vec<f64>,
}

struct Run {
    by_mode: Vec<Flown>,
    reference_m: f64,
    /// What the standard swarm and the one on board reach in the end, of the same routes.
    converged_m: Option<[f64; 2]>,
}

impl Experiment for Cooperative {
    const NAME: &'static str = "cooperative";
    const ABOUT: &'static str = "twenty vehicles plan together with the ground in flight, without it, and when vehicles are lost (P3)";

    fn run(&self) -> anyhow::Result<Report> {
        let seeds: Vec<u64> = (FIRST_SEED..).take(self.runs).collect();
        let done = runs::in_turn("cooperative", &seeds, |seed| one_run(self.vehicles, *seed))?;
        let mut report = Report::default();
        report.number("runs", self.runs);
        report.number("vehicles", self.vehicles);
        report.number("first_seed", FIRST_SEED);
        flights(&done, &mut report);
        plan_times(&done, &mut report);
        converged(&done, &mut report);
        Ok(report)
    }
}

fn one_run(vehicles: usize, seed: u64) -> anyhow::Result<Run> {
    let world = World::new(vehicles, seed)?;
    let by_mode = MODES.iter().map(|(mode, ..)| world.fly(*mode)).collect::<anyhow::Result<_>>()?;
    let best = |_: usize, problem: &mut RouteProblem<'_>| {
        any_angle(problem, &AnyAngleConfig::default()).context("there is no feasible route")
    };
    let reference_m =
        world.total_m(&plan_in_turn(&world.airspace, world.cost, &world.ends, WAYPOINTS, best)?);
    let converged_m = (seed < FIRST_SEED + CONVERGED.0 as u64).then(|| world.converged_m()).transpose()?;
    Ok(Run { by_mode, reference_m, converged_m })
}

/// P3's world with its vehicles.
struct World {
    seed: u64,
    airspace: Airspace,
    craft: Craft,
    cost: RouteCost,
    /// Where each vehicle sets out, and where it is to arrive.
    ends: Vec<(Vector3<f64>, Vector3<f64>)>,
}

impl World {
    fn new(vehicles: usize, seed: u64) -> anyhow::Result<Self> {
        let airspace = scene::airspace();
        let craft = Craft {
            cruise_m_s: ENVELOPE.cruise_m_s,
            climb_m_s: ENVELOPE.climb_m_s,
            endurance_s: ENVELOPE.endurance_s,
            separation_m: ENVELOPE.separation_m,
            spacing_m: SPACING_M,
            clearance_m: 30.0,
            margin_m: 0.0,
            energy_weight: 0.0,
            turn_weight: 0.0,
        };
        let ends =
            scene::ends(&airspace, vehicles, seed).context("the vehicles cannot be assigned to targets")?;
        Ok(Self { seed, cost: craft.cost(1.0), airspace, craft, ends })
    }

    /// What these routes cost, each among those before it, metres.
    fn total_m(&self, plans: &[Plan]) -> f64 {
        plans.iter().map(|plan| plan.assessment.cost_m).sum()
    }

    fn fly(&self, mode: Mode) -> anyhow::Result<Flown> {
        let mut flight = Flight {
            world: self,
            flyers: self.ends.iter().map(|(start, _)| Flyer::new(*start)).collect(),
            now_s: 0.0,
            onboard_ms: Vec::new(),
            ground_ms: Vec::new(),
            least_separation_m: f64::INFINITY,
        };
        if mode == Mode::Onboard {
            flight.plan_each()?
        } else {
            flight.plan_all()?
        }
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 0xC007);
        let longest_s = flight.longest_s();
        let mut moment = || longest_s * rng.random_range(0.1..0.8);
        match mode {
            Mode::Ground | Mode::Onboard => {}
            Mode::Cut => {
                flight.until(moment());
                flight.go_on_alone()?;
            }
            Mode::Lost => {
                let mut times_s = [moment(), moment()];
                times_s.sort_by(f64::total_cmp);
                let count = flight.flyers.len();
                let first = rng.random_range(0..count);
                let second = (first + rng.random_range(1..count.max(2))) % count;
                flight.lose([first, second], times_s)?;
            }
        }
        flight.until(LONGEST_S);
        Ok(flight.over())
    }

    /// What the standard swarm reaches with much more effort, and the one on board with its own.
    fn converged_m(&self) -> anyhow::Result<[f64; 2]> {
        let effort = Effort::default();
        let long = Effort { generations: effort.generations * CONVERGED.1, ..effort };
        let all = |plan: &dyn Fn(&mut RouteProblem<'_>, u64) -> Plan| {
            let with_seed = |vehicle: usize, problem: &mut RouteProblem<'_>| {
                anyhow::Ok(plan(problem, 1000 * self.seed + vehicle as u64))
            };
            plan_in_turn(&self.airspace, self.cost, &self.ends, WAYPOINTS, with_seed)
        };
        let standard = all(&|problem, seed| Baseline::STANDARD.plan(problem, long, seed))?;
        let onboard = all(&|problem, seed| Planner::Onboard.plan(problem, effort, seed))?;
        Ok([self.total_m(&standard), self.total_m(&onboard)])
    }
}

/// A flight as it goes on.
struct Flight<'a> {
    world: &'a World,
    flyers: Vec<Flyer>,
    now_s: f64,
    onboard_ms: Vec<f64>,
    ground_ms: Vec<f64>,
    least_separation_m: f64,
}

fn node(index: usize) -> anyhow::Result<NodeName> {
    Ok(NodeName::new(&format!("uav/{}", index + 1))?)
}

impl Flight<'_> {
    fn until(&mut self, time_s: f64) {
        while self.now_s < time_s && self.flyers.iter().any(Flyer::flies) {
            self.now_s += STEP_S;
            let least_m = step(&mut self.flyers, &ENVELOPE, self.now_s);
            self.least_separation_m = self.least_separation_m.min(least_m);
        }
    }

    fn longest_s(&self) -> f64 {
        self.flyers
            .iter()
            .map(|flyer| skein_agent::arrival::to_go_s(flyer.way(), &ENVELOPE))
            .fold(0.0, f64::max)
    }

    /// The problem of the ground, for those who fly.
    fn problem(&self, targets: Vec<Vector3<f64>>, one_to_each: bool) -> anyhow::Result<FleetProblem> {
        let space = (self.world.airspace.lower, self.world.airspace.upper);
        let mut problem = FleetProblem {
            theatre: Theatre::new(self.world.airspace.clone(), space, self.world.craft)?,
            flyers: Vec::new(),
            others: Vec::new(),
            targets,
            one_to_each,
            seed: 1000 * self.world.seed,
        };
        for (index, flyer) in
            self.flyers.iter().enumerate().filter(|(_, flyer)| flyer.flies() || self.now_s == 0.0)
        {
            let battery = 1.0 - self.now_s / ENVELOPE.endurance_s;
            let stops = flyer.stops();
            problem.flyers.push(Planned { node: node(index)?, position: flyer.at, battery, stops });
            problem.others.push(Other { node: node(index)?, way: flyer.way() });
        }
        Ok(problem)
    }

    /// The ground plans for everybody.
    fn plan_all(&mut self) -> anyhow::Result<()> {
        let problem = self.problem(TARGETS.map(Vector3::from).to_vec(), false)?;
        self.send(&problem)
    }

    /// Sends everybody what the ground plans for them.
    fn send(&mut self, problem: &FleetProblem) -> anyhow::Result<()> {
        let (planned, taken_ms) = cpu_time::measured_ms(|| plan(problem))?;
        self.ground_ms.push(taken_ms);
        for journey in planned?.journeys {
            let index =
                (0..self.flyers.len()).find(|index| node(*index).is_ok_and(|node| node == journey.node));
            let flyer =
                index.and_then(|index| self.flyers.get_mut(index)).context("a stranger is planned for")?;
            let stops: Vec<_> = journey.stops.iter().map(|stop| stop - 1).collect();
            flyer.send(journey.route.into_iter().skip(1), &stops);
        }
        Ok(())
    }

    /// Every vehicle plans for itself, among the routes that it has heard of by then.
    fn plan_each(&mut self) -> anyhow::Result<()> {
        let mut traffic = Traffic::default();
        for (index, (start, goal)) in self.world.ends.iter().enumerate() {
            let World { airspace, cost, seed, .. } = self.world;
            let mut problem = RouteProblem::new(airspace, &traffic, *cost, (*start, *goal), WAYPOINTS)?;
            let seed = 1000 * seed + index as u64;
            let search = || Planner::Onboard.plan(&mut problem, Effort::default(), seed);
            let (found, taken_ms) = cpu_time::measured_ms(search)?;
            self.onboard_ms.push(taken_ms);
            traffic.add(&found.route, cost);
            let stop = found.route.len() - 2;
            self.flyers[index].send(found.route.into_iter().skip(1), &[stop]);
        }
        Ok(())
    }

    /// The ground is gone: every vehicle looks for a better way by itself, among the routes that it has last heard of.
    fn go_on_alone(&mut self) -> anyhow::Result<()> {
        let heard: Vec<_> = self.flyers.iter().map(Flyer::way).collect();
        for index in 0..self.flyers.len() {
            if !self.flyers[index].flies() {
                continue;
            }
            let mut traffic = Traffic::default();
            for (_, way) in heard.iter().enumerate().filter(|(other, _)| *other != index) {
                traffic.add(way, &self.world.cost);
            }
            let alone =
                WayOn::through(self.world.airspace.clone(), traffic, self.world.cost, self.world.seed);
            let flyer = &mut self.flyers[index];
            let stops: Vec<_> = flyer
                .ahead
                .iter()
                .enumerate()
                .filter(|(_, (_, is_stop))| *is_stop)
                .map(|(at, _)| at)
                .collect();
            let points = flyer.ahead.iter().map(|(point, _)| (*point).into()).collect();
            let route = Route::new(points)?.with_targets(&stops);
            let (better, taken_ms) = cpu_time::measured_ms(|| alone.better(&route, 0, flyer.at))?;
            self.onboard_ms.push(taken_ms);
            if let Some(better) = better {
                let stops: Vec<_> = better.targets().map(|(at, _)| at).collect();
                flyer.send(better.points().iter().map(|point| Vector3::from(*point)), &stops);
            }
        }
        Ok(())
    }

    /// Two vehicles vanish, and the ground sends others where they were to be.
    fn lose(&mut self, who: [usize; 2], times_s: [f64; 2]) -> anyhow::Result<()> {
        for (index, time_s) in who.into_iter().zip(times_s) {
            self.until(time_s);
            let stops = self.flyers[index].stops();
            self.flyers[index].is_lost = true;
            self.until(self.now_s + LOST_AFTER_S);
            if !stops.is_empty() {
                let problem = self.problem(stops, true)?;
                self.send(&problem)?;
            }
        }
        Ok(())
    }

    fn over(self) -> Flown {
        let there = |target: &[f64; 3]| {
            let mut visited = self.flyers.iter().flat_map(|flyer| &flyer.visited);
            visited.any(|place| (place - Vector3::from(*target)).norm() <= SPACING_M)
        };
        let arrivals_s: Vec<f64> = self.flyers.iter().filter_map(|flyer| flyer.arrived_s).collect();
        let last_s = arrivals_s.iter().copied().fold(0.0, f64::max);
        let first_s = arrivals_s.iter().copied().fold(last_s, f64::min);
        let late = self.flyers.iter().any(Flyer::flies);
        let mut traffic = Traffic::default();
        let mut cost_m = 0.0;
        for flyer in &self.flyers {
            cost_m += self.world.cost.assess(&flyer.flown, &self.world.airspace, &traffic).cost_m;
            traffic.add(&flyer.flown, &self.world.cost);
        }
        Flown {
            targets_reached: TARGETS.iter().filter(|target| there(target)).count(),
            spread_s: if late { f64::INFINITY } else { last_s - first_s },
            cost_m,
            least_separation_m: self.least_separation_m,
            onboard_ms: self.onboard_ms,
            ground_ms: self.ground_ms,
        }
    }
}

fn flights(done: &[Run], report: &mut Report) {
    let mut rows = Vec::new();
    for (index, (mode, name, most_spread_s)) in MODES.into_iter().enumerate() {
        let flown = || done.iter().map(move |run| &run.by_mode[index]);
        let targets = flown().map(|flown| flown.targets_reached).min().unwrap_or_default();
        let spreads_s: Vec<f64> = flown().map(|flown| flown.spread_s).collect();
        let most_s = spreads_s.iter().copied().fold(0.0, f64::max);
        let ratios: Vec<f64> = done.iter().map(|run| run.by_mode[index].cost_m / run.reference_m).collect();
        let ratio = statistics::mean(&ratios);
        let least_m = flown().map(|flown| flown.least_separation_m).fold(f64::INFINITY, f64::min);
        rows.push(vec![
            name.replace('_', " "),
            format!("{targets}"),
            format!("{most_s:.2}"),
            format!("{ratio:.3}"),
            format!("{least_m:.1}"),
        ]);
        report.number(
            name,
            json!({
                "targets_reached": targets,
                "spread_s": { "mean": statistics::mean(&spreads_s), "max": most_s },
                "cost_to_reference": { "mean": ratio, "max": ratios.iter().copied().fold(0.0, f64::max) },
                "least_separation_m": least_m,
            }),
        );
        let count = TARGETS.len() as f64;
        report.goal(&format!("{name}: targets reached, worst run"), targets as f64, Bound::AtLeast(count));
        report.goal(
            &format!("{name}: first to last arrival, worst run (s)"),
            most_s,
            Bound::AtMost(most_spread_s),
        );
        report.goal(&format!("{name}: least separation (m)"), least_m, Bound::AtLeast(ENVELOPE.separation_m));
        // Whoever stands in for another flies two ways.
        if mode != Mode::Lost {
            report.goal(&format!("{name}: cost to the reference"), ratio, Bound::AtMost(1.05));
        }
    }
    let head = ["", "targets", "spread, worst (s)", "cost / reference", "least separation (m)"];
    report.table("Flights, all vehicles", &head, rows);
}

fn plan_times(done: &[Run], report: &mut Report) {
    let all = |of: fn(&Flown) -> &Vec<f64>| -> Vec<f64> {
        let mut times_ms: Vec<f64> =
            done.iter().flat_map(|run| &run.by_mode).flat_map(|flown| of(flown).iter().copied()).collect();
        times_ms.sort_by(f64::total_cmp);
        times_ms
    };
    let onboard = all(|flown| &flown.onboard_ms);
    let ground = all(|flown| &flown.ground_ms);
    let mean_ms = statistics::mean(&onboard);
    let (p999_ms, most_ms) = (quantile(&onboard, 0.999), quantile(&ground, 1.0));
    report.number("plan_ms", json!({ "mean": mean_ms, "p999": p999_ms, "max": quantile(&onboard, 1.0) }));
    let ground_ms = json!({ "mean": statistics::mean(&ground), "max": most_ms });
    report.number("plan_ms_ground", ground_ms);
    report.goal("onboard: CPU time of a plan, mean (ms)", mean_ms, Bound::AtMost(5.0));
    report.goal("onboard: CPU time of a plan, p99.9 (ms)", p999_ms, Bound::AtMost(20.0));
    report.goal("ground: CPU time of a plan for all, worst (ms)", most_ms, Bound::AtMost(1000.0));
}

fn converged(done: &[Run], report: &mut Report) {
    let pairs: Vec<_> = done.iter().filter_map(|run| Some((run.converged_m?, run.reference_m))).collect();
    let mean = |planner: usize| {
        let shares: Vec<_> = pairs.iter().map(|(costs, reference)| costs[planner] / reference).collect();
        statistics::mean(&shares)
    };
    let (standard, onboard) = (mean(0), mean(1));
    report.number(
        "standard_pso_converged",
        json!({ "runs": pairs.len(), "times_the_effort": CONVERGED.1, "cost_to_reference": standard,
            "onboard_to_reference": onboard, "onboard_below_it": 1.0 - onboard / standard }),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_fleet_reaches_what_a_large_one_must_in_every_mode() {
        let world = World::new(4, FIRST_SEED).unwrap();
        for (mode, name, most_s) in MODES {
            let flown = world.fly(mode).unwrap();
            let targets = if mode == Mode::Onboard { 4 } else { TARGETS.len() };
            assert_eq!(flown.targets_reached, targets, "{name}");
            assert!(flown.spread_s <= most_s, "{name}: {} s", flown.spread_s);
            assert!(
                flown.least_separation_m >= ENVELOPE.separation_m,
                "{name}: {} m",
                flown.least_separation_m
            );
        }
    }
}
