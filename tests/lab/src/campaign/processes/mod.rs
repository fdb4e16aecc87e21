//! Runs of processes, a few at a time, and what came of them.

mod cable;
pub mod trial;

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use serde_json::json;
use skein_sim::cli::{Exit, Network};

use self::trial::{Fault, Trial};
use crate::task::Task;

#[derive(Args)]
pub struct Campaign {
    /// Runs of each fault.
    #[arg(long, value_name = "N", default_value_t = 10)]
    seeds: u64,
    /// Only these faults.
    #[arg(long = "fault", value_name = "FAULT", value_enum)]
    faults: Vec<Fault>,
    /// Runs at once.
    #[arg(long, value_name = "N", default_value_t = 2)]
    jobs: u16,
    /// Folder for configurations, logs and recordings.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Use network ports so much further up, beside another swarm on this computer.
    #[arg(long, value_name = "N", default_value_t = 3000)]
    port_offset: u16,
    /// The way in which the processes are joined.
    #[arg(long, value_enum, default_value_t = Network::Peer)]
    network: Network,
}

impl Task for Campaign {
    const NAME: &'static str = "processes";
    const ABOUT: &'static str =
        "A swarm as processes over Zenoh, in real time, with a fault at a random moment of each flight";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let faults = if self.faults.is_empty() { Fault::ALL.as_slice() } else { &self.faults };
        let trials: Vec<(Fault, u64)> =
            (1..=self.seeds).flat_map(|seed| faults.iter().map(move |fault| (*fault, seed))).collect();
        let results = self.run_all(&trials)?;
        let mut by_fault: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
        for trial in &results {
            let (runs, violations) = by_fault.entry(trial.fault.name()).or_default();
            *runs += 1;
            *violations += trial.violations.len();
        }
        let violations: usize = results.iter().map(|trial| trial.violations.len()).sum();
        if as_json {
            let failing: Vec<_> = results
                .iter()
                .filter(|trial| !trial.violations.is_empty())
                .map(|trial| json!({ "fault": trial.fault.name(), "seed": trial.seed, "at_s": trial.at_s, "violations": trial.violations }))
                .collect();
            let faults: BTreeMap<_, _> = by_fault
                .iter()
                .map(|(fault, (runs, violations))| (fault, json!({ "runs": runs, "violations": violations })))
                .collect();
            println!(
                "{}",
                json!({ "seeds": self.seeds, "violations": violations, "faults": faults, "failing_seeds": failing })
            );
        } else {
            for (fault, (runs, violations)) in by_fault {
                println!("{fault:<16} {runs:>3} runs, {violations} violations");
            }
        }
        Ok(Exit::of(violations == 0))
    }
}

impl Campaign {
    /// A few at a time, each with ports of its own.
    fn run_all(&self, trials: &[(Fault, u64)]) -> anyhow::Result<Vec<Trial>> {
        let temporary = || std::env::temp_dir().join("skein-campaign");
        let folder = self.out.clone().unwrap_or_else(temporary);
        let next = std::sync::atomic::AtomicUsize::new(0);
        let work = |job: u16| -> anyhow::Result<Vec<Trial>> {
            let mut done = Vec::new();
            while let Some((fault, seed)) =
                trials.get(next.fetch_add(1, std::sync::atomic::Ordering::Relaxed))
            {
                let folder = folder.join(format!("{}-{seed}", fault.name()));
                let trial = trial::run(*fault, *seed, &folder, self.port_offset + 300 * job, self.network)?;
                let verdict =
                    if trial.violations.is_empty() { "ok".to_owned() } else { trial.violations.join("; ") };
                eprintln!("{} seed {seed}, at {:.1} s: {verdict}", fault.name(), trial.at_s);
                done.push(trial);
            }
            Ok(done)
        };
        std::thread::scope(|scope| {
            let workers: Vec<_> = (0..self.jobs.max(1)).map(|job| scope.spawn(move || work(job))).collect();
            let mut all = Vec::new();
            for worker in workers {
                all.extend(worker.join().map_err(|_| anyhow::anyhow!("a run has panicked"))??);
            }
            Ok(all)
        })
    }
}
