//! Twenty vehicles plan routes to ten targets among mountains and threats, to arrive together (P3): the improved
//! particle swarm, alone and with tabu search, against the standard one, the one with constriction, and a reference
//! that is near the best there is.
//!
//! All swarms search in the same space, the coordinates of [`WAYPOINTS`] waypoints anywhere in the world; they begin
//! with the same particles, drawn evenly from it, may move as far at once, and spend as many evaluations of the same
//! cost, `Ns T = 30 x 50`. What P3 leaves open was chosen on seeds 1 to 150; the runs have the seeds from
//! [`FIRST_SEED`] on.

pub mod baseline;
pub mod scene;

use anyhow::Context as _;
use clap::Args;
use serde_json::{Value, json};
use skein_planning::airspace::Airspace;
use skein_swarm::particle_swarm::{Objective as _, Swarm};
use skein_swarm::route::{
    AnyAngleConfig, Effort, Plan, Planner, RouteCost, RouteProblem, any_angle, arrive_together, plan_in_turn,
};

use self::baseline::Baseline;
use crate::cpu_time;
use crate::figure::{Figure, Line, Style};
use crate::numbers::one_or_more;
use crate::quantile::quantile;
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::{runs, statistics};

const RUNS: usize = 150;
const VEHICLES: usize = 20;
/// Seed of the first run. Nothing was chosen by what comes of it or of those after it.
const FIRST_SEED: u64 = 10_001;
/// Inner waypoints of a route: in 2000 m one every 182 m, so that it can bend around the smallest zone, 200 m.
const WAYPOINTS: usize = 10;
/// Factor by which a vehicle may fly slower than at cruise to arrive together with others.
const SLOWEST: f64 = 2.0;
/// Feasibility is judged by samples of the terrain this far apart, metres.
const FINE_M: f64 = 2.0;
/// Runs of each variant of the baseline.
const VARIANT_RUNS: usize = 10;

/// The planners that are compared.
const PLANNERS: [(&str, Plans); 4] = [
    ("standard", |problem, seed| Baseline::STANDARD.plan(problem, Effort::default(), seed)),
    ("constriction", |problem, seed| Baseline::CONSTRICTION.plan(problem, Effort::default(), seed)),
    ("onboard", |problem, seed| Planner::Onboard.plan(problem, Effort::default(), seed)),
    ("ground", |problem, seed| Planner::Ground.plan(problem, Effort::default(), seed)),
];
/// Plans with a seed.
type Plans = fn(&mut RouteProblem<'_>, u64) -> Plan;
const STANDARD: usize = 0;
const CONSTRICTION: usize = 1;
const ONBOARD: usize = 2;
const GROUND: usize = 3;

/// The routes of all vehicles by one planner.
struct Fleet {
    plans: Vec<Plan>,
    is_feasible: Vec<bool>,
    /// CPU time of each plan, ms.
    plan_ms: Vec<f64>,
}

struct Run {
    by_planner: Vec<Fleet>,
    reference: Fleet,
}

#[derive(Args)]
pub struct SwarmPlanning {
    /// Runs, each with a seed of its own.
    #[arg(long, value_name = "N", default_value_t = RUNS, value_parser = one_or_more())]
    runs: usize,
    /// Vehicles of a run.
    #[arg(long, value_name = "N", default_value_t = VEHICLES, value_parser = one_or_more())]
    vehicles: usize,
}

impl Experiment for SwarmPlanning {
    const NAME: &'static str = "swarm-planning";
    const ABOUT: &'static str =
        "twenty vehicles plan to ten targets among mountains and threats: particle swarms compared (P3)";

    fn run(&self) -> anyhow::Result<Report> {
        let Self { runs: count, vehicles } = *self;
        let airspace = scene::airspace();
        let seeds: Vec<u64> = (FIRST_SEED..).take(count).collect();
        let done = runs::in_turn("swarm-planning", &seeds, |seed| one_run(&airspace, vehicles, *seed))?;
        let mut report = Report::default();
        report.number("runs", count);
        report.number("vehicles", vehicles);
        report.number("first_seed", FIRST_SEED);
        let effort = Effort::default();
        report.number("evaluations", effort.particles * effort.generations);
        objectives(&done, &mut report);
        times(&done, &mut report);
        arrivals(&done, &mut report);
        variants(&airspace, vehicles, &seeds[..count.min(VARIANT_RUNS)], &done, &mut report)?;
        report.figure("convergence", convergence(&done));
        report.figure("map", map(&airspace, &done[0]));
        Ok(report)
    }
}

fn one_run(airspace: &Airspace, vehicles: usize, seed: u64) -> anyhow::Result<Run> {
    let fleet = |plan: &dyn Fn(&mut RouteProblem<'_>, u64) -> Option<Plan>| {
        plan_fleet(airspace, vehicles, WAYPOINTS, seed, plan)
    };
    let by_planner = PLANNERS
        .iter()
        .map(|(_, plan)| fleet(&|problem, seed| Some(plan(problem, seed))))
        .collect::<anyhow::Result<_>>()?;
    let reference = fleet(&|problem, _| any_angle(problem, &AnyAngleConfig::default()))?;
    Ok(Run { by_planner, reference })
}

/// Lets the vehicles of a run plan one after another. Each has a seed of its own, the same whoever plans.
fn plan_fleet(
    airspace: &Airspace,
    vehicles: usize,
    waypoints: usize,
    seed: u64,
    plan: &dyn Fn(&mut RouteProblem<'_>, u64) -> Option<Plan>,
) -> anyhow::Result<Fleet> {
    let ends = scene::ends(airspace, vehicles, seed).context("the vehicles cannot be assigned to targets")?;
    let cost = RouteCost::default();
    let fine = RouteCost { sample_m: FINE_M, ..cost };
    let (mut is_feasible, mut plan_ms) = (Vec::new(), Vec::new());
    let plans = plan_in_turn(airspace, cost, &ends, waypoints, |vehicle, problem| {
        let (plan, taken_ms) = cpu_time::measured_ms(|| plan(problem, 1000 * seed + vehicle as u64))?;
        let plan = plan.context("there is no feasible route")?;
        plan_ms.push(taken_ms);
        is_feasible.push(problem.weighed(fine).judge(&plan.route).is_feasible());
        anyhow::Ok(plan)
    })?;
    Ok(Fleet { plans, is_feasible, plan_ms })
}

impl Fleet {
    fn mean_cost_m(&self) -> f64 {
        mean(self.plans.iter().map(|plan| plan.assessment.cost_m))
    }

    fn mean_length_m(&self) -> f64 {
        mean(self.plans.iter().map(|plan| plan.assessment.length_m))
    }
}

fn objectives(done: &[Run], report: &mut Report) {
    let mut rows = Vec::new();
    let mut objective = serde_json::Map::new();
    let mut feasible = serde_json::Map::new();
    let names = PLANNERS.iter().map(|(name, _)| *name).chain(["reference"]);
    for (index, name) in names.enumerate() {
        let fleets = || done.iter().map(move |run| run.by_planner.get(index).unwrap_or(&run.reference));
        let cost_m = mean(fleets().map(Fleet::mean_cost_m));
        let length_m = mean(fleets().map(Fleet::mean_length_m));
        let feasible_share = share(fleets().flat_map(|fleet| fleet.is_feasible.iter().copied()));
        rows.push(vec![
            name.to_owned(),
            format!("{cost_m:.0}"),
            format!("{length_m:.0}"),
            format!("{:.2} %", feasible_share * 100.0),
        ]);
        objective.insert(name.to_owned(), json!({ "mean": cost_m, "length": length_m }));
        feasible.insert(name.to_owned(), feasible_share.into());
    }
    report.table("Mean of all vehicles and runs", &["", "objective (m)", "length (m)", "feasible"], rows);
    report.number("objective_m", objective);
    report.number("feasible", feasible);

    let below = |who: usize, whom: usize| -> Vec<f64> {
        let of = |run: &Run| 1.0 - run.by_planner[who].mean_cost_m() / run.by_planner[whom].mean_cost_m();
        done.iter().map(of).collect()
    };
    let above = |who: usize| {
        mean(done.iter().map(|run| run.by_planner[who].mean_cost_m() / run.reference.mean_cost_m() - 1.0))
    };
    for (who, name, suffix) in [(ONBOARD, "onboard", ""), (GROUND, "ground", "_ground")] {
        let (standard, constriction) = (below(who, STANDARD), below(who, CONSTRICTION));
        let (mean_standard, mean_constriction) =
            (mean(standard.iter().copied()), mean(constriction.iter().copied()));
        report.number(&format!("below_standard_pso{suffix}"), mean_standard);
        report.number(&format!("below_standard_pso{suffix}_runs"), distribution(standard));
        report.number(&format!("below_standard_pso{suffix}_among_feasible"), below_among_feasible(done, who));
        report.number(&format!("below_constriction_pso{suffix}"), mean_constriction);
        report.number(&format!("below_constriction_pso{suffix}_runs"), distribution(constriction));
        report.number(&format!("above_reference{suffix}"), above(who));
        report.goal(&format!("{name}: share below the standard swarm"), mean_standard, Bound::AtLeast(0.55));
        report.goal(&format!("{name}: share below constriction"), mean_constriction, Bound::AtLeast(0.01));
        report.goal(&format!("{name}: share above the reference"), above(who), Bound::AtMost(0.05));
    }
}

/// The same share over those vehicles only for which both the planner's and the standard swarm's route are feasible,
/// so that no weight of a violation has a part in it.
fn below_among_feasible(done: &[Run], who: usize) -> f64 {
    let (mut ours, mut theirs) = (0.0, 0.0);
    for run in done {
        let (who, standard) = (&run.by_planner[who], &run.by_planner[STANDARD]);
        for vehicle in 0..who.plans.len() {
            if who.is_feasible[vehicle] && standard.is_feasible[vehicle] {
                ours += who.plans[vehicle].assessment.cost_m;
                theirs += standard.plans[vehicle].assessment.cost_m;
            }
        }
    }
    1.0 - ours / theirs
}

fn times(done: &[Run], report: &mut Report) {
    let mut rows = Vec::new();
    for (who, name, field) in [
        (ONBOARD, "onboard", "plan_ms"),
        (GROUND, "ground", "plan_ms_ground"),
        (4, "reference", "plan_ms_reference"),
    ] {
        let fleets = done.iter().map(|run| run.by_planner.get(who).unwrap_or(&run.reference));
        let mut times: Vec<f64> = fleets.flat_map(|fleet| fleet.plan_ms.iter().copied()).collect();
        times.sort_by(f64::total_cmp);
        let (mean, p999, max) = (mean(times.iter().copied()), quantile(&times, 0.999), quantile(&times, 1.0));
        rows.push(vec![name.to_owned(), format!("{mean:.2}"), format!("{p999:.2}"), format!("{max:.2}")]);
        report.number(field, json!({ "mean": mean, "p999": p999, "max": max }));
        if who != 4 {
            report.goal(&format!("{name}: CPU time of a plan, mean (ms)"), mean, Bound::AtMost(5.0));
            report.goal(&format!("{name}: CPU time of a plan, p99.9 (ms)"), p999, Bound::AtMost(20.0));
        }
    }
    report.table("CPU time of a vehicle's plan (ms)", &["", "mean", "p99.9", "max"], rows);
}

fn arrivals(done: &[Run], report: &mut Report) {
    let mut spreads_s = Vec::new();
    let mut at_cruise_s = Vec::new();
    for run in done {
        let plans = &run.by_planner[ONBOARD].plans;
        let times_s: Vec<f64> = plans.iter().map(|plan| plan.assessment.time_s).collect();
        let arrival = arrive_together(&times_s, SLOWEST);
        spreads_s.push(arrival.spread_s);
        at_cruise_s.push(arrival.time_s - times_s.into_iter().fold(arrival.time_s, f64::min));
    }
    let most_s = spreads_s.iter().copied().fold(0.0, f64::max);
    report.number(
        "arrival_spread_s",
        json!({ "mean": mean(spreads_s.iter().copied()), "max": most_s, "all_at_cruise": mean(at_cruise_s) }),
    );
    report.goal("onboard: from the first to the last arrival, worst run (s)", most_s, Bound::AtMost(1.0));
}

/// How the figure depends on what P3 leaves open of the baseline: the speed bound, the number of waypoints, and where
/// the particles begin.
fn variants(
    airspace: &Airspace,
    vehicles: usize,
    seeds: &[u64],
    done: &[Run],
    report: &mut Report,
) -> anyhow::Result<()> {
    let mut cases = Vec::new();
    for waypoints in [5, WAYPOINTS] {
        for max_step in [0.02, 0.1, 0.25, 0.5, 1.0] {
            cases.push((waypoints, max_step, false));
        }
    }
    cases.push((WAYPOINTS, 0.5, true));
    let found = runs::in_turn("variants of the baseline", &cases, |(waypoints, max_step, on_the_way)| {
        let motion = Baseline { max_step: *max_step, ..Baseline::STANDARD };
        let standard = |problem: &mut RouteProblem<'_>, seed| {
            let centre = on_the_way.then(|| problem.space().centre().to_vec());
            let swarm = Swarm::new(problem.space(), motion, Effort::default().particles, seed)
                .starting_at(centre.as_deref());
            Some(Plan::by_swarm(problem, swarm, Effort::default()))
        };
        let onboard = |problem: &mut RouteProblem<'_>, seed| {
            Some(Planner::Onboard.plan(problem, Effort::default(), seed))
        };
        let costs_m = |plan: &dyn Fn(&mut RouteProblem<'_>, u64) -> Option<Plan>| -> anyhow::Result<f64> {
            let fleets = seeds.iter().map(|seed| plan_fleet(airspace, vehicles, *waypoints, *seed, plan));
            Ok(mean(fleets.collect::<anyhow::Result<Vec<_>>>()?.iter().map(Fleet::mean_cost_m)))
        };
        let onboard_m = if *waypoints == WAYPOINTS {
            mean(done.iter().take(seeds.len()).map(|run| run.by_planner[ONBOARD].mean_cost_m()))
        } else {
            costs_m(&onboard)?
        };
        let standard_m = costs_m(&standard)?;
        Ok((standard_m, onboard_m))
    })?;
    let mut rows = Vec::new();
    let mut values = Vec::new();
    for ((waypoints, max_step, on_the_way), (standard_m, onboard_m)) in cases.iter().zip(found) {
        let below = 1.0 - onboard_m / standard_m;
        rows.push(vec![
            waypoints.to_string(),
            max_step.to_string(),
            if *on_the_way { "one on the direct way" } else { "anywhere" }.to_owned(),
            format!("{standard_m:.0}"),
            format!("{onboard_m:.0}"),
            format!("{below:.3}"),
        ]);
        values.push(json!({
            "waypoints": waypoints, "max_step": max_step, "one_on_the_direct_way": on_the_way,
            "standard_m": standard_m, "onboard_m": onboard_m, "below": below,
        }));
    }
    report.table(
        &format!("Variants of the standard swarm, {} runs", seeds.len()),
        &["waypoints", "speed bound", "particles begin", "standard (m)", "onboard (m)", "share below"],
        rows,
    );
    report.number("standard_variants", Value::Array(values));
    Ok(())
}

fn convergence(done: &[Run]) -> Figure {
    let particles = Effort::default().particles;
    let generations = Effort::default().generations;
    let mut lines: Vec<Line> = PLANNERS
        .iter()
        .enumerate()
        .map(|(who, (name, _))| {
            let at = |generation: usize| {
                mean(
                    done.iter()
                        .flat_map(|run| &run.by_planner[who].plans)
                        .map(|plan| plan.convergence_m[generation]),
                )
            };
            let points = (0..generations).map(|k| (((k + 1) * particles) as f64, at(k))).collect();
            Line { name: (*name).to_owned(), style: Style::Solid, points }
        })
        .collect();
    let reference_m = mean(done.iter().map(|run| run.reference.mean_cost_m()));
    let points = vec![(0.0, reference_m), ((generations * particles) as f64, reference_m)];
    lines.push(Line { name: "reference".to_owned(), style: Style::Reference, points });
    Figure { x: "evaluations".to_owned(), y: "objective (m)".to_owned(), is_map: false, lines }
}

/// One run from above: threat zones, where the mountains are half as high as their peaks, and the routes.
fn map(airspace: &Airspace, run: &Run) -> Figure {
    let circle = |x: f64, y: f64, east_m: f64, north_m: f64| -> Vec<(f64, f64)> {
        (0..=72)
            .map(|k| (f64::from(k) * 5.0).to_radians().sin_cos())
            .map(|(sin, cos)| (x + east_m * cos, y + north_m * sin))
            .collect()
    };
    let threats = airspace.threats.iter().map(|zone| Line {
        name: String::new(),
        style: Style::Filled,
        points: circle(zone.centre.x, zone.centre.y, zone.radius_m, zone.radius_m),
    });
    let half = 2.0_f64.ln().sqrt();
    let mountains = airspace.mountains.iter().map(|mountain| Line {
        name: String::new(),
        style: Style::Reference,
        points: circle(
            mountain.centre.x,
            mountain.centre.y,
            mountain.slope_m.x * half,
            mountain.slope_m.y * half,
        ),
    });
    let routes = run.by_planner[ONBOARD].plans.iter().map(|plan| Line {
        name: String::new(),
        style: Style::Solid,
        points: plan.route.iter().map(|point| (point.x, point.y)).collect(),
    });
    let lines = threats.chain(mountains).chain(routes).collect();
    Figure { x: "east (m)".to_owned(), y: "north (m)".to_owned(), is_map: true, lines }
}

fn distribution(mut values: Vec<f64>) -> Value {
    values.sort_by(f64::total_cmp);
    let [min, p5, median, p95, max] = [0.0, 0.05, 0.5, 0.95, 1.0].map(|share| quantile(&values, share));
    json!({ "min": min, "p5": p5, "median": median, "p95": p95, "max": max })
}

fn share(cases: impl Iterator<Item = bool>) -> f64 {
    mean(cases.map(|is_so| if is_so { 1.0 } else { 0.0 }))
}

fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    statistics::mean(&values.into_iter().collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A report without the times it took.
    fn untimed(report: &Report) -> Value {
        let mut json = report.to_json();
        if let Some(fields) = json.as_object_mut() {
            fields.retain(|name, _| !name.starts_with("plan_ms") && name != "goals" && name != "reached");
        }
        json
    }

    #[test]
    fn a_small_run_reaches_what_a_large_one_must_and_is_the_same_again() {
        let experiment = SwarmPlanning { runs: 1, vehicles: 6 };
        let report = experiment.run().unwrap();
        let json = report.to_json();
        let goals = json["goals"].as_array().unwrap();
        // How long it takes is not for a test of the development profile to judge.
        let untimed_goals = goals.iter().filter(|goal| !goal["what"].as_str().unwrap().contains("CPU"));
        assert!(untimed_goals.clone().count() >= 7);
        for goal in untimed_goals {
            assert_eq!(goal["reached"], true, "{goal}");
        }
        assert!(json["below_standard_pso"].as_f64().unwrap() < 1.0);
        for field in ["mean", "p999", "max"] {
            assert!(json["plan_ms"][field].as_f64().unwrap() > 0.0);
        }
        assert_eq!(untimed(&report), untimed(&experiment.run().unwrap()));
    }
}
