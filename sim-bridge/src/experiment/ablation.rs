//! Ablation: each layer of the pipeline is left out in turn, to see what it contributes.

use serde_json::json;
use skein_agent::Layer;

use super::statistics::mean;
use super::{Bound, Options, Report, runs};
use crate::cli::Controller;
use crate::fly::Trial;
use crate::scenario::Scenario;
use crate::summary::Summary;

const RUNS: usize = 50;
const VEHICLES: usize = 8;
/// Who has not arrived after this has failed, s: three times what a vehicle needs.
const TIME_LIMIT_S: f64 = 120.0;

const VARIANTS: [(&str, Option<Layer>); 7] = [
    ("all layers", None),
    ("without global path", Some(Layer::GlobalPath)),
    ("without local avoidance", Some(Layer::LocalAvoidance)),
    ("without repulsion", Some(Layer::Repulsion)),
    ("without safety filter", Some(Layer::SafetyFilter)),
    ("without escape", Some(Layer::Escape)),
    ("without right of way", Some(Layer::RightOfWay)),
];

pub(super) fn run(options: &Options) -> anyhow::Result<Report> {
    let worlds = options.runs.unwrap_or(RUNS);
    let vehicles = options.vehicles.unwrap_or(VEHICLES);
    let seeds = 1..=worlds as u64;
    let flights: Vec<(Option<Layer>, u64)> =
        VARIANTS.iter().flat_map(|(_, without)| seeds.clone().map(|seed| (*without, seed))).collect();
    let summaries = runs::in_turn("flights", &flights, |(without, seed)| {
        let mut scenario = Scenario::built_in("forest", Some(vehicles), *seed)?;
        scenario.orders.clear();
        scenario.time_limit_s = TIME_LIMIT_S;
        let trial = Trial::new(&scenario, Controller::Bp);
        Ok(trial.with_agents(|agent| agent.planners.without = *without).fly(&mut |_, _| {})?.summary)
    })?;
    let mut report = Report::default();
    report.number("worlds", worlds);
    report.number("vehicles", vehicles);
    let mut rows = Vec::new();
    let mut variants = Vec::new();
    for ((name, without), summaries) in VARIANTS.iter().zip(summaries.chunks(worlds)) {
        let found = Found::of(summaries);
        if without.is_none() {
            let what = "worlds that all layers together bring everyone through";
            report.goal(what, found.succeeded as f64, Bound::Exactly(worlds as f64));
        }
        rows.push(found.row(name));
        variants.push(found.json(name));
    }
    report.number("variants", variants);
    report.table(
        "What each layer contributes: time and distance are means over the worlds that succeed",
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
    Ok(report)
}

/// What came of one variant.
struct Found {
    worlds: usize,
    succeeded: usize,
    hit_obstacles: u64,
    hit_vehicles: u64,
    time_s: f64,
    distance_m: f64,
    min_separation_m: f64,
    min_clearance_m: f64,
}

impl Found {
    fn of(summaries: &[Summary]) -> Self {
        let sound: Vec<&Summary> = summaries.iter().filter(|summary| summary.succeeded).collect();
        let of = |value: fn(&Summary) -> f64| mean(&sound.iter().map(|s| value(s)).collect::<Vec<_>>());
        let least = |value: fn(&Summary) -> Option<f64>| {
            summaries.iter().filter_map(value).fold(f64::INFINITY, f64::min)
        };
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
        vec![
            name.to_owned(),
            format!("{} of {}", self.succeeded, self.worlds),
            self.hit_obstacles.to_string(),
            self.hit_vehicles.to_string(),
            format!("{:.1}", self.time_s),
            format!("{:.1}", self.distance_m),
            format!("{:.2}", self.min_separation_m),
            format!("{:.2}", self.min_clearance_m),
        ]
    }

    fn json(&self, name: &str) -> serde_json::Value {
        json!({
            "variant": name, "worlds": self.worlds, "succeeded": self.succeeded,
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
    fn every_layer_is_left_out_once() {
        let options = Options { runs: Some(1), vehicles: Some(2), ..Options::default() };
        let json = run(&options).expect("it can be flown").to_json();
        assert_eq!(json["variants"].as_array().map(Vec::len), Some(VARIANTS.len()));
        assert_eq!(json["variants"][0]["succeeded"], 1);
        let distance_m = |variant: usize| json["variants"][variant]["path_length_m"].as_f64();
        assert!(distance_m(0) != distance_m(2), "without local avoidance another way is flown");
    }
}
