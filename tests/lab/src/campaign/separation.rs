//! `campaign separation`: swarms that hear one another late and not always, in lockstep; nobody may touch anybody, or
//! anything.

use std::ops::RangeInclusive;

use clap::Args;
use serde::Serialize;
use serde_json::json;
use skein_sim::cli::{Controller, Exit};
use skein_sim::fly::Trial;
use skein_sim::scenario::{Network, Scenario};
use skein_sim::summary::Summary;

use crate::runs;
use crate::task::Task;

/// One flight of the campaign.
#[derive(Debug, Clone, Serialize)]
struct Run {
    scenario: String,
    seed: u64,
    collisions: u64,
    min_separation_m: Option<f64>,
    min_clearance_m: Option<f64>,
    arrived: bool,
    reason: Option<String>,
}

impl Run {
    fn of(summary: Summary) -> Self {
        Self {
            collisions: summary.collisions.vehicle + summary.collisions.obstacle,
            min_separation_m: summary.min_separation_m,
            min_clearance_m: summary.min_clearance_m,
            arrived: summary.succeeded,
            reason: summary.reason,
            scenario: summary.scenario,
            seed: summary.seed,
        }
    }
}

#[derive(Args)]
pub struct Separation {
    /// Seeds of each scenario.
    #[arg(long, value_name = "N", default_value_t = 200)]
    seeds: u64,
    /// The first seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    from: u64,
    /// Built-in scenarios.
    #[arg(long = "scenario", value_name = "NAME", default_values_t = ["antipodal".to_owned(), "forest".to_owned()])]
    scenarios: Vec<String>,
    /// Size of the swarm.
    #[arg(long, value_name = "N", default_value_t = 16)]
    vehicles: usize,
    /// Mean time that a message takes; each takes from half to one and a half of it.
    #[arg(long, value_name = "MS", default_value_t = 300.0, value_parser = within(0.0..=60_000.0))]
    latency_ms: f64,
    /// Share of messages that are lost.
    #[arg(long, value_name = "SHARE", default_value_t = 0.3, value_parser = share)]
    loss: f64,
    /// Lease of bids that are not renewed: several times as long as a message takes there and back.
    #[arg(long, value_name = "MS", default_value_t = 4000.0, value_parser = within(100.0..=10_000.0))]
    lease_ms: f64,
    /// Flights at once; as many as this computer has processors if not given.
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
}

impl Task for Separation {
    const NAME: &'static str = "separation";
    const ABOUT: &'static str = "Whole swarms in lockstep whose vehicles hear one another late and not always: nobody may touch anything";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let runs = fly_all(self)?;
        let collided: Vec<&Run> = runs.iter().filter(|run| run.collisions > 0).collect();
        let late: Vec<&Run> = runs.iter().filter(|run| run.collisions == 0 && !run.arrived).collect();
        let least = |of: fn(&Run) -> Option<f64>| runs.iter().filter_map(of).reduce(f64::min);
        let separation_m = least(|run| run.min_separation_m);
        let clearance_m = least(|run| run.min_clearance_m);
        if as_json {
            let object = json!({
                "runs": runs.len(),
                "vehicles": self.vehicles,
                "latency_ms": self.latency_ms,
                "loss": self.loss,
                "lease_ms": self.lease_ms,
                "collisions": collided.iter().map(|run| run.collisions).sum::<u64>(),
                "arrived": runs.iter().filter(|run| run.arrived).count(),
                "min_separation_m": separation_m,
                "min_clearance_m": clearance_m,
                "collided": collided,
                "not_arrived": late,
            });
            println!("{object}");
        } else {
            for Run { scenario, seed, reason, .. } in collided.iter().chain(&late) {
                println!("{scenario}, seed {seed}: {}", reason.as_deref().unwrap_or_default());
            }
            let metres =
                |length: Option<f64>| length.map_or("-".to_owned(), |length| format!("{length:.3} m"));
            println!("{:<20} {:>10}", "flights", runs.len());
            println!("{:<20} {:>10}", "with a collision", collided.len());
            println!("{:<20} {:>10}", "all arrived", runs.iter().filter(|run| run.arrived).count());
            println!("{:<20} {:>10}", "least separation", metres(separation_m));
            println!("{:<20} {:>10}", "least clearance", metres(clearance_m));
        }
        Ok(Exit::of(collided.is_empty()))
    }
}

/// Every scenario with every seed, in that order whichever ends first.
fn fly_all(args: &Separation) -> anyhow::Result<Vec<Run>> {
    let seeds = args.from..args.from + args.seeds;
    let scenarios = args.scenarios.iter();
    let flights: Vec<(&str, u64)> =
        scenarios.flat_map(|name| seeds.clone().map(move |seed| (name.as_str(), seed))).collect();
    runs::by_jobs(args.jobs, "flights", &flights, |(scenario, seed)| fly_one(args, scenario, *seed))
}

fn fly_one(args: &Separation, scenario: &str, seed: u64) -> anyhow::Result<Run> {
    let mut scenario = Scenario::built_in(scenario, Some(args.vehicles), seed)?;
    let Separation { latency_ms, loss, lease_ms, .. } = *args;
    scenario.network = Network { latency_ms, loss, lease_ms, ..Network::default() };
    scenario.validate()?;
    Ok(Run::of(Trial::new(&scenario, Controller::Bp).fly(&mut |_, _| {})?.summary))
}

fn within(range: RangeInclusive<f64>) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| match text.parse() {
        Ok(number) if range.contains(&number) => Ok(number),
        _ => Err(format!("expected a number from {} to {}", range.start(), range.end())),
    }
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(number) if (0.0..1.0).contains(&number) => Ok(number),
        _ => Err("expected a number from 0 to below 1".to_owned()),
    }
}
