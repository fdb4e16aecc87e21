//! The potential in A*'s search (Wang 2023): what `U`, its gate, and the escape from local minima are worth.

use std::time::Duration;

use clap::Args;
use serde_json::json;
use skein_agent::pipeline::layers::Layers;
use skein_agent::{AgentConfig, Parts};
use skein_planning::global::PotentialConfig;
use skein_planning::local::escape::EscapeConfig;
use skein_sim::cli::Controller;
use skein_sim::fly::Trial;
use skein_sim::scenario::Scenario;
use skein_sim::summary::Summary;

use super::walkers;
use crate::numbers::one_or_more;
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::runs;
use crate::statistics::mean;

const RUNS: usize = 20;
const CORNER: &str = include_str!("corner.toml");
/// A vehicle that has not arrived by then has failed, s.
const TIME_LIMIT_S: f64 = 150.0;
/// Longer than any flight.
const NEVER: Duration = Duration::from_secs(1 << 30);

/// Makes a world of a seed.
type Make = fn(u64) -> anyhow::Result<Scenario>;

const WORLDS: [(&str, Make); 4] = [
    (CORNER_NAME, |seed| Ok(Scenario::from_toml(CORNER, "corner.toml", None, seed)?)),
    ("forest", |seed| Ok(Scenario::built_in("forest", Some(3), seed)?)),
    ("walkers", walkers::world),
    ("antipodal", |seed| Ok(Scenario::built_in("antipodal", None, seed)?)),
];
const CORNER_NAME: &str = "corner";

/// Which potential, and which escape.
type Settings = (PotentialConfig, EscapeConfig);

/// A change of the settings.
type Change = fn(Settings) -> Settings;

const VARIANTS: [(&str, Change); 7] = [
    (NOBODY, |(potential, escape)| (PotentialConfig { gain: 0.0, ..potential }, escape)),
    ("vehicles repel, as by default", |settings| settings),
    (EVERYTHING, |(potential, escape)| (everything(potential), escape)),
    ("everything, without the gate", |(potential, escape)| {
        (PotentialConfig { is_gated: false, ..everything(potential) }, escape)
    }),
    ("by default, minima told by the clock", |(potential, escape)| {
        (potential, EscapeConfig { balance: 0.0, ..escape })
    }),
    ("by default, without escape", |(potential, escape)| {
        (potential, EscapeConfig { balance: 0.0, window: NEVER, ..escape })
    }),
    ("everything, without escape", |(potential, escape)| {
        (everything(potential), EscapeConfig { balance: 0.0, window: NEVER, ..escape })
    }),
];
const NOBODY: &str = "A* alone";
const EVERYTHING: &str = "everything repels";

fn everything(potential: PotentialConfig) -> PotentialConfig {
    PotentialConfig { of_everything: true, ..potential }
}

#[derive(Args)]
pub struct PotentialFields {
    /// Worlds of each kind, whose seeds are 1 to N.
    #[arg(long, value_name = "N", default_value_t = RUNS, value_parser = one_or_more())]
    runs: usize,
}

impl Experiment for PotentialFields {
    const NAME: &'static str = "potential";
    const ABOUT: &'static str = "the potential in A*'s search, its gate, and the escape from local minima (Wang 2023): what each is worth";

    fn run(&self) -> anyhow::Result<Report> {
        let seeds = || 1..=self.runs as u64;
        let flights: Vec<_> = WORLDS
            .iter()
            .flat_map(|(_, make)| VARIANTS.iter().map(move |(_, settings)| (make, settings)))
            .flat_map(|(make, settings)| seeds().map(move |seed| (make, settings, seed)))
            .collect();
        let summaries =
            runs::in_turn("flights", &flights, |(make, settings, seed)| fly(&make(*seed)?, **settings))?;
        let mut report = Report::default();
        let mut variants = Vec::new();
        let mut of_variant = summaries.chunks(self.runs);
        for (world, _) in WORLDS {
            let mut rows = Vec::new();
            for ((variant, _), summaries) in VARIANTS.iter().zip(of_variant.by_ref()) {
                let found = Found::of(summaries);
                rows.push(found.row(variant));
                variants.push(found.json(world, variant));
                if world == CORNER_NAME && *variant == EVERYTHING {
                    let alone = variants.first().and_then(|alone| alone["clearance_m"].as_f64());
                    let more_m = found.clearance_m.unwrap_or(0.0) - alone.unwrap_or(0.0);
                    report.goal(
                        "by how much further from the corner everything repelling keeps than A* alone, m",
                        more_m,
                        Bound::AtLeast(0.2),
                    );
                }
            }
            report.table(
                &format!("`{world}`: times and clearances are means over the worlds"),
                &["", "succeeded", "collisions", "time, s", "clearance, m", "closest, m"],
                rows,
            );
        }
        report.number("worlds", self.runs);
        report.number("variants", variants);
        Ok(report)
    }
}

fn fly(scenario: &Scenario, settings: fn(Settings) -> Settings) -> anyhow::Result<Summary> {
    let mut scenario = scenario.clone();
    scenario.orders.clear();
    scenario.time_limit_s = TIME_LIMIT_S;
    let parts = move |config: &AgentConfig| {
        let layers = Layers::of(&config.envelope, config.fence, config.planners);
        let (potential, escape) = settings((layers.potential, layers.escape));
        Parts { layers: Layers { potential, escape, ..layers }, ..Parts::of(config) }
    };
    Ok(Trial::new(&scenario, Controller::Bp).with_parts(parts).fly(&mut |_, _| {})?.summary)
}

/// The results of one variant in one kind of world.
struct Found {
    worlds: usize,
    succeeded: usize,
    collisions: u64,
    /// Of the worlds that succeed; none if none does.
    time_s: Option<f64>,
    /// Mean over the worlds of the least clearance of a hull.
    clearance_m: Option<f64>,
    min_separation_m: Option<f64>,
}

impl Found {
    fn of(summaries: &[Summary]) -> Self {
        let mean_of = |values: Vec<f64>| (!values.is_empty()).then(|| mean(&values));
        let sound = summaries.iter().filter(|summary| summary.succeeded);
        Self {
            worlds: summaries.len(),
            succeeded: sound.clone().count(),
            collisions: summaries.iter().map(|it| it.collisions.obstacle + it.collisions.vehicle).sum(),
            time_s: mean_of(sound.map(|summary| summary.flight_time_s.mean).collect()),
            clearance_m: mean_of(summaries.iter().filter_map(|summary| summary.min_clearance_m).collect()),
            min_separation_m: summaries.iter().filter_map(|it| it.min_separation_m).reduce(f64::min),
        }
    }

    fn row(&self, variant: &str) -> Vec<String> {
        let number = |value: Option<f64>, digits: usize| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
        };
        vec![
            variant.to_owned(),
            format!("{} of {}", self.succeeded, self.worlds),
            self.collisions.to_string(),
            number(self.time_s, 1),
            number(self.clearance_m, 2),
            number(self.min_separation_m, 2),
        ]
    }

    fn json(&self, world: &str, variant: &str) -> serde_json::Value {
        json!({
            "world": world, "variant": variant, "worlds": self.worlds, "succeeded": self.succeeded,
            "collisions": self.collisions, "flight_time_s": self.time_s, "clearance_m": self.clearance_m,
            "min_separation_m": self.min_separation_m,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_everything_repels_a_corner_is_passed_further_away() {
        let corner = WORLDS[0].1(1).expect("it is sound");
        let clearance_m = |variant: &str| {
            let (_, settings) = VARIANTS.iter().find(|(name, _)| *name == variant).expect("it is flown");
            let summary = fly(&corner, *settings).expect("it can be flown");
            assert!(summary.succeeded, "{variant}: {:?}", summary.reason);
            summary.min_clearance_m.expect("there is a wall")
        };
        assert!(clearance_m(EVERYTHING) > clearance_m(NOBODY) + 0.2);
    }
}
