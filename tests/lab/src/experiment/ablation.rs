//! Ablation: each layer of the pipeline is left out in turn, to see what it contributes.

use std::time::Duration;

use clap::Args;
use serde_json::json;
use skein_agent::pipeline::global::{self, AstarFinder, PathFinder, Task, path_finder};
use skein_agent::pipeline::layers::Layers;
use skein_agent::pipeline::local::Apf;
use skein_agent::pipeline::safety_filter::{Kept, VelocityFilter};
use skein_agent::pipeline::surroundings::Surroundings;
use skein_agent::{AgentConfig, Envelope, GlobalPlanner, Parts, Planners};
use skein_planning::Path;
use skein_planning::global::astar::PlanError;
use skein_planning::local::{apf::ApfConfig, escape::EscapeConfig};
use skein_planning::map::ClearanceMap;
use skein_planning::passage::PassageConfig;
use skein_planning::separation::{Motion, Neighbour, RepulsionConfig};
use skein_sim::cli::Controller;
use skein_sim::fly::Trial;
use skein_sim::scenario::Scenario;
use skein_sim::summary::Summary;

use crate::numbers::one_or_more;
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::runs;
use crate::statistics::mean;

/// Worlds of the first scenario.
const RUNS: usize = 50;
/// In forests vehicles fly side by side, so others show what keeps them apart: in one all meet in the middle, in one
/// all want through the same window. A number beside each says how many times fewer worlds of it are flown, for these
/// differ little.
const SCENARIOS: [(&str, usize); 3] = [("forest", 1), ("antipodal", 5), ("window", 5)];
/// A vehicle that has not arrived by then has failed, s: three times what one needs.
const TIME_LIMIT_S: f64 = 120.0;

/// Builds an agent's pipeline.
type Build = fn(&AgentConfig) -> Layers;

const VARIANTS: [(&str, Build); 8] = [
    (ALL, all),
    ("D* Lite in place of A*", |config| Layers {
        finder: path_finder(GlobalPlanner::DstarLite),
        ..all(config)
    }),
    ("without global path", |config| Layers { finder: Box::new(Straight::default()), ..all(config) }),
    ("without local avoidance", |config| {
        let field = ApfConfig { repulsive_gain: 0.0, ..ApfConfig::default() };
        Layers { follower: Box::new(Apf::with_field(&config.envelope, field)), ..all(config) }
    }),
    ("without repulsion", |config| {
        let repulsion = RepulsionConfig { influence_m: 0.0, ..RepulsionConfig::default() };
        Layers { repulsion, ..all(config) }
    }),
    ("without safety filter", |config| Layers { filter: Box::new(Unfiltered), ..all(config) }),
    ("without escape", |config| {
        let escape = EscapeConfig { window: NEVER, ..EscapeConfig::default() };
        Layers { escape, ..all(config) }
    }),
    ("without right of way", |config| {
        let passages = PassageConfig { width_m: 0.0, ..PassageConfig::default() };
        Layers { passages, ..all(config) }
    }),
];
const ALL: &str = "all layers";
/// Longer than any flight.
const NEVER: Duration = Duration::from_secs(1 << 30);

fn all(config: &AgentConfig) -> Layers {
    Layers::of(&config.envelope, config.fence, Planners::default())
}

/// Goes straight to the waypoint, whatever the map knows of it.
#[derive(Debug, Default)]
struct Straight(AstarFinder);

impl PathFinder for Straight {
    fn begin(&mut self) {
        self.0.begin();
    }

    fn advance(
        &mut self,
        task: &Task,
        map: &mut ClearanceMap,
        allowance: &mut usize,
    ) -> Option<Result<global::Found, PlanError>> {
        match Path::new(vec![task.start, task.goal]) {
            Some(path) => Some(Ok(global::Found { path, clearance_m: None, is_level: false })),
            None => self.0.advance(task, map, allowance),
        }
    }
}

/// Flies every velocity as it is desired.
#[derive(Debug)]
struct Unfiltered;

impl VelocityFilter for Unfiltered {
    fn handle(&mut self, _: &Envelope) {}

    fn keep_apart(&mut self, _: Duration, request: Motion, _: &[Neighbour], _: &Surroundings<'_>) -> Kept {
        Kept { velocity: request.desired, evades: false }
    }
}

#[derive(Args)]
pub struct Ablation {
    /// Worlds, whose seeds are 1 to N.
    #[arg(long, value_name = "N", default_value_t = RUNS, value_parser = one_or_more())]
    runs: usize,
    /// Size of the swarm; the scenario's own if not given.
    #[arg(long, value_name = "N", value_parser = one_or_more())]
    vehicles: Option<usize>,
}

impl Experiment for Ablation {
    const NAME: &'static str = "ablation";
    const ABOUT: &'static str =
        "what each layer of the pipeline contributes: forests, a crossing and a window without it";

    fn run(&self) -> anyhow::Result<Report> {
        let mut flights = Vec::new();
        for (scenario, fewer) in SCENARIOS {
            for (_, layers) in VARIANTS {
                flights.extend((1..=self.runs.div_ceil(fewer) as u64).map(|seed| (scenario, layers, seed)));
            }
        }
        let summaries = runs::in_turn("flights", &flights, |(scenario, layers, seed)| {
            let mut scenario = Scenario::built_in(scenario, self.vehicles, *seed)?;
            scenario.orders.clear();
            scenario.time_limit_s = TIME_LIMIT_S;
            let trial = Trial::new(&scenario, Controller::Bp);
            let layers = *layers;
            let trial = trial.with_parts(move |config| Parts { layers: layers(config), ..Parts::of(config) });
            Ok(trial.fly(&mut |_, _| {})?.summary)
        })?;
        let mut report = Report::default();
        let mut rest = summaries.as_slice();
        let mut variants = Vec::new();
        for (scenario, fewer) in SCENARIOS {
            let worlds = self.runs.div_ceil(fewer);
            let mut rows = Vec::new();
            for (name, _) in VARIANTS {
                let (summaries, others) = rest.split_at(worlds);
                rest = others;
                let found = Found::of(summaries);
                if name == ALL {
                    let what =
                        format!("worlds of `{scenario}` that all layers together bring everyone through");
                    report.goal(&what, found.succeeded as f64, Bound::Exactly(worlds as f64));
                }
                rows.push(found.row(name));
                variants.push(found.json(scenario, name));
            }
            report.table(
                &format!(
                    "What each layer contributes in `{scenario}`: time and distance are means over the worlds that succeed"
                ),
                &[
                    "",
                    "succeeded",
                    "hit obstacles",
                    "hit vehicles",
                    "time, s",
                    "distance, m",
                    "closest, m",
                    "clearance, m",
                ],
                rows,
            );
        }
        report.number("variants", variants);
        Ok(report)
    }
}

/// The results of one variant.
struct Found {
    worlds: usize,
    succeeded: usize,
    hit_obstacles: u64,
    hit_vehicles: u64,
    /// None if no world succeeds.
    time_s: Option<f64>,
    distance_m: Option<f64>,
    /// None if nobody, or nothing, is ever near.
    min_separation_m: Option<f64>,
    min_clearance_m: Option<f64>,
}

impl Found {
    fn of(summaries: &[Summary]) -> Self {
        let sound: Vec<&Summary> = summaries.iter().filter(|summary| summary.succeeded).collect();
        let of = |value: fn(&Summary) -> f64| {
            let values: Vec<f64> = sound.iter().map(|summary| value(summary)).collect();
            (!values.is_empty()).then(|| mean(&values))
        };
        let least = |value: fn(&Summary) -> Option<f64>| summaries.iter().filter_map(value).reduce(f64::min);
        Self {
            worlds: summaries.len(),
            succeeded: sound.len(),
            hit_obstacles: summaries.iter().map(|summary| summary.collisions.obstacle).sum(),
            hit_vehicles: summaries.iter().map(|summary| summary.collisions.vehicle).sum(),
            time_s: of(|summary| summary.flight_time_s.mean),
            distance_m: of(|summary| summary.path_length_m.mean),
            min_separation_m: least(|summary| summary.min_separation_m),
            min_clearance_m: least(|summary| summary.min_clearance_m),
        }
    }

    fn row(&self, name: &str) -> Vec<String> {
        let number = |value: Option<f64>, digits: usize| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
        };
        vec![
            name.to_owned(),
            format!("{} of {}", self.succeeded, self.worlds),
            self.hit_obstacles.to_string(),
            self.hit_vehicles.to_string(),
            number(self.time_s, 1),
            number(self.distance_m, 1),
            number(self.min_separation_m, 2),
            number(self.min_clearance_m, 2),
        ]
    }

    fn json(&self, scenario: &str, name: &str) -> serde_json::Value {
        json!({
            "scenario": scenario, "variant": name, "worlds": self.worlds, "succeeded": self.succeeded,
            "collisions": { "obstacle": self.hit_obstacles, "vehicle": self.hit_vehicles },
            "flight_time_s": self.time_s, "path_length_m": self.distance_m,
            "min_separation_m": self.min_separation_m, "min_clearance_m": self.min_clearance_m,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_layer_is_left_out_once_in_every_scenario() {
        let json = Ablation { runs: 1, vehicles: Some(2) }.run().expect("it can be flown").to_json();
        let variants = json["variants"].as_array().expect("a list");
        assert_eq!(variants.len(), VARIANTS.len() * SCENARIOS.len());
        for (place, (scenario, _)) in SCENARIOS.iter().enumerate() {
            let whole = &variants[place * VARIANTS.len()];
            assert_eq!((whole["scenario"].as_str(), whole["succeeded"].as_u64()), (Some(*scenario), Some(1)));
        }
        assert_eq!(variants[1]["succeeded"].as_u64(), Some(1), "D* Lite brings them through the forest too");
        let distance_m = |variant: usize| json["variants"][variant]["path_length_m"].as_f64();
        assert!(distance_m(0) != distance_m(1), "its ways are others than those of A*");
        assert!(distance_m(0) != distance_m(3), "without local avoidance another way is flown");
        assert_eq!(distance_m(2), None, "without a path nobody arrives, and there is no mean of nothing");
    }
}
