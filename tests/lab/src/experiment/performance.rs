//! Performance: the navigator of b-threads against one sequential loop around the same planners, in the same random
//! worlds (Wang 2023, the second experiment).

use clap::Args;
use serde_json::{Value, json};
use skein_sim::cli::Controller;
use skein_sim::fly::Trial;
use skein_sim::scenario::Scenario;

use crate::cpu_time;
use crate::figure::{Figure, Line, Style};
use crate::numbers::one_or_more;
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::runs;
use crate::statistics::{confidence_95, mean};

const SCENARIO: &str = include_str!("performance.toml");
const RUNS: usize = 500;
/// Most that b-threads may cost, in per cent of what the sequential loop needs, with 95 % confidence.
const MOST_COST_PERCENT: f64 = 1.0;

/// The published figures of a navigator.
struct Published {
    navigation_s: f64,
    simulation_s: f64,
    cpu_percent: f64,
    odometry_m: f64,
    succeeded: usize,
}

const PUBLISHED: [Published; 2] = [
    Published {
        navigation_s: 40.89,
        simulation_s: 42.63,
        cpu_percent: 92.75,
        odometry_m: 72.63,
        succeeded: 482,
    },
    Published {
        navigation_s: 43.29,
        simulation_s: 46.78,
        cpu_percent: 85.89,
        odometry_m: 98.74,
        succeeded: 476,
    },
];
const PUBLISHED_RUNS: usize = 500;

#[derive(Debug, Clone, Copy)]
struct Flight {
    succeeded: bool,
    /// From take-off to landing.
    navigation_s: f64,
    /// From when the program was started.
    simulation_s: f64,
    /// Of one processor, in real time: the agent alone.
    cpu_percent: f64,
    /// The same with world, autopilot and ground station.
    whole_cpu_percent: f64,
    odometry_m: f64,
}

#[derive(Args)]
pub struct Performance {
    /// Worlds, whose seeds are 1 to N.
    #[arg(long, value_name = "N", default_value_t = RUNS, value_parser = one_or_more())]
    runs: usize,
    /// Size of the swarm.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = one_or_more())]
    vehicles: usize,
}

impl Experiment for Performance {
    const NAME: &'static str = "performance";
    const ABOUT: &'static str =
        "b-threads against one sequential loop in 500 random worlds (Wang 2023, table 2)";

    fn run(&self) -> anyhow::Result<Report> {
        let seeds: Vec<u64> = (1..=self.runs as u64).collect();
        let pairs = runs::in_turn("pairs", &seeds, |seed| {
            let scenario = Scenario::from_toml(SCENARIO, "performance.toml", Some(self.vehicles), *seed)?;
            Ok([fly(&scenario, Controller::Bp)?, fly(&scenario, Controller::Sequential)?])
        })?;
        let mut report = Report::default();
        compare(&mut report, &pairs);
        Ok(report)
    }
}

fn fly(scenario: &Scenario, controller: Controller) -> anyhow::Result<Flight> {
    let began = cpu_time::this_thread()?;
    let trial = Trial::new(scenario, controller).timed_by(cpu_time::this_thread_or_nothing);
    let flown = trial.fly(&mut |_, _| {})?;
    let whole_cpu = cpu_time::this_thread()?.saturating_sub(began);
    let summary = flown.summary;
    Ok(Flight {
        succeeded: summary.succeeded,
        navigation_s: summary.flight_time_s.mean,
        simulation_s: summary.sim_time_s,
        cpu_percent: 100.0 * flown.agents_time.as_secs_f64() / summary.sim_time_s,
        whole_cpu_percent: 100.0 * whole_cpu.as_secs_f64() / summary.sim_time_s,
        odometry_m: summary.path_length_m.mean,
    })
}

fn compare(report: &mut Report, pairs: &[[Flight; 2]]) {
    let succeeded = [0, 1].map(|side| pairs.iter().filter(|pair| pair[side].succeeded).count());
    let both: Vec<&[Flight; 2]> =
        pairs.iter().filter(|pair| pair.iter().all(|flight| flight.succeeded)).collect();
    type Of = fn(&Flight) -> f64;
    type Theirs = fn(&Published) -> f64;
    let figures: [(&str, &str, Of, Theirs); 5] = [
        ("navigation_time_s", "navigation time, s", |f| f.navigation_s, |p| p.navigation_s),
        ("simulation_time_s", "simulation time, s", |f| f.simulation_s, |p| p.simulation_s),
        ("cpu_percent", "CPU share of the agent, %", |f| f.cpu_percent, |p| p.cpu_percent),
        ("whole_cpu_percent", "CPU share with the world, %", |f| f.whole_cpu_percent, |p| p.cpu_percent),
        ("odometry_m", "odometry, m", |f| f.odometry_m, |p| p.odometry_m),
    ];
    let mut rows = Vec::new();
    for (name, title, of, theirs) in figures {
        let [bp, sequential] = [0, 1].map(|side| both.iter().map(|pair| of(&pair[side])).collect::<Vec<_>>());
        let differences: Vec<f64> = bp.iter().zip(&sequential).map(|(bp, other)| bp - other).collect();
        let percent = confidence_95(&differences).map(|bound| 100.0 * bound / mean(&sequential));
        report.number(
            name,
            json!({
                "bp": mean(&bp), "sequential": mean(&sequential),
                "difference_percent_95": percent.to_vec(),
                "published_bp": theirs(&PUBLISHED[0]), "published_sequential": theirs(&PUBLISHED[1]),
            }),
        );
        rows.push(vec![
            title.to_owned(),
            format!("{:.2}", mean(&bp)),
            format!("{:.2}", mean(&sequential)),
            format!("{:+.2} to {:+.2} %", percent[0], percent[1]),
            format!("{:.2}", theirs(&PUBLISHED[0])),
            format!("{:.2}", theirs(&PUBLISHED[1])),
        ]);
        if matches!(name, "navigation_time_s" | "odometry_m") {
            let what = format!("{title}: 95 % bound on BP less sequential, %");
            report.goal(&what, percent[1], Bound::AtMost(MOST_COST_PERCENT));
            report.figure(name, scatter(title, &sequential, &bp));
        }
    }
    rows.push(
        ["succeeded".to_owned()]
            .into_iter()
            .chain(succeeded.map(|count| format!("{count} of {}", pairs.len())))
            .chain([String::new()])
            .chain(PUBLISHED.iter().map(|p| format!("{} of {PUBLISHED_RUNS}", p.succeeded)))
            .collect(),
    );
    let same = |[bp, sequential]: &&[Flight; 2]| {
        (bp.navigation_s, bp.odometry_m) == (sequential.navigation_s, sequential.odometry_m)
    };
    report.number("runs", pairs.len());
    report.number("pairs_flown_alike", pairs.iter().filter(same).count());
    report.number("succeeded", json!({ "bp": succeeded[0], "sequential": succeeded[1] }));
    report.number(
        "failed_seeds_bp",
        pairs
            .iter()
            .zip(1..)
            .filter(|(pair, _)| !pair[0].succeeded)
            .map(|(_, seed)| Value::from(seed))
            .collect::<Vec<_>>(),
    );
    report.goal("runs that succeed with b-threads", succeeded[0] as f64, Bound::Exactly(pairs.len() as f64));
    report.table(
        "Performance (Wang 2023, table 2): means of the runs in which both succeed",
        &["", "BP", "sequential", "difference, 95 %", "published BP", "published without"],
        rows,
    );
}

/// Each pair as a point, with the line on which both are equal.
fn scatter(title: &str, sequential: &[f64], bp: &[f64]) -> Figure {
    let points: Vec<(f64, f64)> = sequential.iter().copied().zip(bp.iter().copied()).collect();
    let low = sequential.iter().chain(bp).copied().fold(f64::INFINITY, f64::min);
    let high = sequential.iter().chain(bp).copied().fold(f64::NEG_INFINITY, f64::max);
    let equal = vec![(low, low), (high, high)];
    Figure {
        x: format!("sequential: {title}"),
        y: format!("BP: {title}"),
        is_map: false,
        lines: vec![
            Line { name: "equal".to_owned(), style: Style::Reference, points: equal },
            Line { name: "one world".to_owned(), style: Style::Points, points },
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flight(navigation_s: f64, succeeded: bool) -> Flight {
        Flight {
            succeeded,
            navigation_s,
            simulation_s: navigation_s + 1.0,
            cpu_percent: 1.0,
            whole_cpu_percent: 5.0,
            odometry_m: 70.0,
        }
    }

    #[test]
    fn both_navigators_cross_the_same_worlds() {
        let report = Performance { runs: 2, vehicles: 1 }.run().expect("it can be run");
        let json = report.to_json();
        assert_eq!(json["succeeded"], json!({ "bp": 2, "sequential": 2 }));
        for of in ["bp", "sequential"] {
            let odometry_m = json["odometry_m"][of].as_f64().expect("a number");
            assert!((66.0..90.0).contains(&odometry_m), "{of}: {odometry_m} m");
        }
    }

    #[test]
    fn a_navigator_that_is_slower_or_fails_misses_the_goal() {
        let judged = |bp: &[Flight]| {
            let pairs: Vec<_> = bp.iter().map(|bp| [*bp, flight(40.0, true)]).collect();
            let mut report = Report::default();
            compare(&mut report, &pairs);
            report.is_reached()
        };
        let even = [flight(39.9, true), flight(40.1, true), flight(40.0, true), flight(40.0, true)];
        assert!(judged(&even));
        assert!(!judged(&even.map(|it| flight(it.navigation_s + 0.5, true))));
        assert!(!judged(&[even[0], even[1], even[2], flight(40.0, false)]));
    }
}
