//! Feasibility: with b-threads loaded the vehicle navigates, with or without obstacles; without them its program runs
//! all the same, and it stays where it is (Wang 2023, the first experiment).

use std::time::Duration;

use clap::Args;
use serde_json::json;
use skein_sim::cli::Controller;
use skein_sim::fly::{Swarm, Trial};
use skein_sim::scenario::Scenario;

use crate::numbers::one_or_more;
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::{runs, statistics};

const RUNS: usize = 5;
/// Patience with a vehicle that does nothing, s: twice as long as one that flies needs.
const PATIENCE_S: f64 = 90.0;
/// A program whose word is older than this does not run.
const SILENT: Duration = Duration::from_millis(500);

/// One of the four cases, with what was published of it.
struct Case {
    loaded: bool,
    obstacles: bool,
    navigates: bool,
}

const CASES: [Case; 4] = [
    Case { loaded: true, obstacles: true, navigates: true },
    Case { loaded: true, obstacles: false, navigates: true },
    Case { loaded: false, obstacles: true, navigates: false },
    Case { loaded: false, obstacles: false, navigates: false },
];

struct Outcome {
    /// The vehicles' programs ran from the beginning to the end.
    ran: bool,
    /// Every vehicle reached its goal, without a collision.
    navigated: bool,
    path_length_m: f64,
}

#[derive(Args)]
pub struct Feasibility {
    /// Worlds, whose seeds are 1 to N.
    #[arg(long, value_name = "N", default_value_t = RUNS, value_parser = one_or_more())]
    runs: usize,
    /// Size of the swarm.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = one_or_more())]
    vehicles: usize,
}

impl Experiment for Feasibility {
    const NAME: &'static str = "feasibility";
    const ABOUT: &'static str =
        "whether it navigates: b-threads loaded or not, obstacles or none (Wang 2023, table 1)";

    fn run(&self) -> anyhow::Result<Report> {
        let seeds = 1..=self.runs as u64;
        let flights: Vec<_> =
            CASES.iter().flat_map(|case| seeds.clone().map(move |seed| (case, seed))).collect();
        let outcomes = runs::in_turn("flights", &flights, |(case, seed)| fly(case, self.vehicles, *seed))?;
        let mut report = Report::default();
        let mut rows = Vec::new();
        let mut cases = Vec::new();
        for (case, outcomes) in CASES.iter().zip(outcomes.chunks(seeds.clone().count())) {
            let ran = outcomes.iter().filter(|outcome| outcome.ran).count();
            let navigated = outcomes.iter().filter(|outcome| outcome.navigated).count();
            let lengths: Vec<f64> = outcomes.iter().map(|outcome| outcome.path_length_m).collect();
            let path_length_m = statistics::mean(&lengths);
            let loaded = if case.loaded { "loaded" } else { "not loaded" };
            let obstacles = if case.obstacles { "obstacles" } else { "no obstacles" };
            let all = outcomes.len();
            rows.push(vec![
                loaded.to_owned(),
                obstacles.to_owned(),
                verdict(ran, all),
                verdict(navigated, all),
                format!("{path_length_m:.1} m"),
            ]);
            cases.push(json!({
                "b_threads": case.loaded, "obstacles": case.obstacles, "runs": all,
                "program_runs": ran, "navigates": navigated, "path_length_m": path_length_m,
            }));
            let what = |what| format!("b-threads {loaded}, {obstacles}: runs in which {what}");
            report.goal(&what("the program runs"), ran as f64, Bound::Exactly(all as f64));
            let expected = if case.navigates { all } else { 0 };
            report.goal(&what("the vehicle navigates"), navigated as f64, Bound::Exactly(expected as f64));
        }
        report.number("runs", seeds.count());
        report.number("cases", cases);
        report.table(
            "Feasibility (Wang 2023, table 1)",
            &["b-threads", "world", "program runs", "navigates", "flown"],
            rows,
        );
        Ok(report)
    }
}

fn verdict(of: usize, all: usize) -> String {
    match of {
        0 => "\u{2717}".to_owned(),
        of if of == all => "\u{2713}".to_owned(),
        of => format!("{of} of {all}"),
    }
}

fn fly(case: &Case, vehicles: usize, seed: u64) -> anyhow::Result<Outcome> {
    let world = if case.obstacles { "forest" } else { "open" };
    let mut scenario = Scenario::built_in(world, Some(vehicles), seed)?;
    scenario.orders.clear();
    scenario.time_limit_s = PATIENCE_S;
    let controller = if case.loaded { Controller::Bp } else { Controller::None };
    let mut silence = Silence::default();
    let flown = Trial::new(&scenario, controller).fly(&mut |swarm, _| silence.watch(swarm))?;
    Ok(Outcome {
        ran: silence.longest.is_some_and(|longest| longest < SILENT),
        navigated: flown.summary.succeeded,
        path_length_m: flown.summary.path_length_m.mean,
    })
}

/// The time for which the ground station has heard nothing of a vehicle's program, since all had first been heard.
#[derive(Default)]
struct Silence {
    longest: Option<Duration>,
}

impl Silence {
    fn watch(&mut self, swarm: &Swarm) {
        let age = |time: Duration| swarm.now().saturating_sub(time);
        let ages = swarm.ground().roster().map(|(_, state)| state.map(|state| age(state.time)));
        if let Some(oldest) = ages.collect::<Option<Vec<_>>>().and_then(|ages| ages.into_iter().max()) {
            self.longest = self.longest.max(Some(oldest));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_runs_in_all_four_cases_and_navigates_with_b_threads_only() {
        let report = Feasibility { runs: 1, vehicles: 1 }.run().expect("it can be run");
        let json = report.to_json();
        let ticks = |field: &str| {
            CASES.iter().enumerate().map(|(n, _)| json["cases"][n][field].clone()).collect::<Vec<_>>()
        };
        assert_eq!(ticks("program_runs"), [1, 1, 1, 1]);
        assert_eq!(ticks("navigates"), [1, 1, 0, 0]);
        assert!(report.is_reached());
    }
}
