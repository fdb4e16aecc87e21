//! PX4 and ArduCopter, software in the loop, beside the built-in autopilot on the same seeds: they keep apart, touch
//! nothing, and are not much slower.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use serde_json::json;
use skein_sim::autopilots::{Autopilots as Programs, make::Make};
use skein_sim::cli::Controller;
use skein_sim::fly::Trial;
use skein_sim::scenario::Scenario;
use skein_wire::event::{Airborne, Arrived, Declared as _};

use crate::numbers::one_or_more;
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::{runs, statistics};

/// Distance between centres that is promised, m.
const PROMISED_M: f64 = 1.4;
/// A crossing takes at most so many times as long as the built-in autopilot's.
const SLOWER_BY: f64 = 1.5;

/// A crossing that each make flies.
struct Crossing {
    name: &'static str,
    toml: &'static str,
    /// Whether its time is compared with the built-in autopilot's.
    is_timed: bool,
}

const CROSSINGS: [Crossing; 4] = [
    Crossing { name: "forest, 3", toml: "generator = \"forest\"\nvehicles = 3", is_timed: false },
    Crossing { name: "antipodal, 4", toml: "generator = \"antipodal\"\nvehicles = 4", is_timed: false },
    Crossing {
        name: "24 m swap, 3 m/s",
        toml: "generator = \"antipodal\"\nvehicles = 2\ncruise_speed_m_s = 3.0\n[antipodal]\nradius_m = 12.0",
        is_timed: true,
    },
    Crossing {
        name: "24 m swap, 5 m/s",
        toml: "generator = \"antipodal\"\nvehicles = 2\ncruise_speed_m_s = 5.0\n[antipodal]\nradius_m = 12.0",
        is_timed: true,
    },
];

struct Outcome {
    succeeded: bool,
    separation_m: Option<f64>,
    clearance_m: Option<f64>,
    /// From the last vehicle's take-off to the last one's arrival, s.
    crossing_s: f64,
    realtime_factor: f64,
}

#[derive(Args)]
pub struct Autopilots {
    /// Worlds, whose seeds are 1 to N.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = one_or_more())]
    runs: usize,
    /// PX4's program.
    #[arg(long, value_name = "PATH")]
    px4: Option<PathBuf>,
    /// ArduPilot's program `arducopter`.
    #[arg(long, value_name = "PATH")]
    ardupilot: Option<PathBuf>,
}

impl Experiment for Autopilots {
    const NAME: &'static str = "autopilots";
    const ABOUT: &'static str = "whether PX4 and ArduCopter cross as safely as the built-in autopilot";

    fn run(&self) -> anyhow::Result<Report> {
        let seeds = 1..=self.runs as u64;
        let flown = [Some(Make::BuiltIn), self.px4.as_ref().map(|_| Make::Px4)];
        let makes: Vec<_> =
            flown.into_iter().chain([self.ardupilot.as_ref().map(|_| Make::Ardupilot)]).flatten().collect();
        let mut report = Report::default();
        let (mut rows, mut crossings) = (Vec::new(), Vec::new());
        for crossing in &CROSSINGS {
            let mut built_in_s = None;
            for make in &makes {
                let cases: Vec<u64> = seeds.clone().collect();
                // Their ports are those of the first vehicles, so one flight at a time.
                let outcomes =
                    runs::by_jobs(Some(1), crossing.name, &cases, |seed| self.fly(crossing, *make, *seed))?;
                let succeeded = outcomes.iter().filter(|outcome| outcome.succeeded).count();
                let least = |of: fn(&Outcome) -> Option<f64>| {
                    outcomes.iter().filter_map(of).fold(f64::INFINITY, f64::min)
                };
                let separation_m = least(|outcome| outcome.separation_m);
                let clearance_m = least(|outcome| outcome.clearance_m);
                let mean =
                    |of: fn(&Outcome) -> f64| statistics::mean(&outcomes.iter().map(of).collect::<Vec<_>>());
                let (crossing_s, factor) =
                    (mean(|outcome| outcome.crossing_s), mean(|outcome| outcome.realtime_factor));
                let slower_by = crossing_s / *built_in_s.get_or_insert(crossing_s);
                let name = format!("{}, {make:?}", crossing.name);
                report.goal(
                    &format!("{name}: flights without a collision"),
                    succeeded as f64,
                    Bound::Exactly(outcomes.len() as f64),
                );
                report.goal(
                    &format!("{name}: least separation, m"),
                    separation_m,
                    Bound::AtLeast(PROMISED_M),
                );
                if crossing.is_timed {
                    let what = format!("{name}: times the built-in autopilot's time");
                    report.goal(&what, slower_by, Bound::AtMost(SLOWER_BY));
                }
                rows.push(vec![
                    name,
                    format!("{succeeded} of {}", outcomes.len()),
                    format!("{separation_m:.2} m"),
                    format!("{clearance_m:.2} m"),
                    format!("{crossing_s:.1} s"),
                    format!("{slower_by:.2}"),
                    format!("{factor:.1}"),
                ]);
                crossings.push(json!({
                    "crossing": crossing.name, "autopilot": format!("{make:?}"), "flights": outcomes.len(),
                    "succeeded": succeeded, "min_separation_m": finite(separation_m),
                    "min_clearance_m": finite(clearance_m), "crossing_s": crossing_s,
                    "times_built_in": slower_by, "realtime_factor": factor,
                }));
            }
        }
        report.number("runs", seeds.count());
        report.number("crossings", crossings);
        report.table(
            "Real autopilots",
            &["crossing", "succeeded", "apart", "from trunks", "time", "x built-in", "x real time"],
            rows,
        );
        Ok(report)
    }
}

impl Autopilots {
    fn fly(&self, crossing: &Crossing, make: Make, seed: u64) -> anyhow::Result<Outcome> {
        let mut scenario = Scenario::from_toml(crossing.toml, crossing.name, None, seed)?;
        let programs = Programs {
            autopilot: Some(make),
            px4: self.px4.clone(),
            ardupilot: self.ardupilot.clone(),
            ..Programs::default()
        };
        programs.assign(&mut scenario);
        let folder = tempfile::tempdir()?;
        let (mut last_up, mut last_there) = (Duration::ZERO, Duration::ZERO);
        let trial = Trial::new(&scenario, Controller::Bp).on(&programs, folder.path());
        let flown = trial.fly(&mut |swarm, selections| {
            for happened in selections {
                if Airborne::read(&happened.event).is_some() {
                    last_up = swarm.now();
                } else if Arrived::read(&happened.event).is_some() {
                    last_there = swarm.now();
                }
            }
        })?;
        let summary = flown.summary;
        Ok(Outcome {
            succeeded: summary.succeeded,
            separation_m: summary.min_separation_m,
            clearance_m: summary.min_clearance_m,
            crossing_s: last_there.saturating_sub(last_up).as_secs_f64(),
            realtime_factor: summary.realtime_factor,
        })
    }
}

/// JSON has no infinity: nothing came near.
fn finite(number: f64) -> Option<f64> {
    number.is_finite().then_some(number)
}
