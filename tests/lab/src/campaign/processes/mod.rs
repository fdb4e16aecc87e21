//! Runs of processes, a few at a time, and what came of them.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::json;

use super::processes::{self, Fault, Trial};
use crate::cli;

/// Runs each fault with each seed, and prints what came of it. Returns whether nothing was violated.
pub(super) fn run(
    seeds: u64,
    faults: &[Fault],
    jobs: u16,
    out: Option<&Path>,
    port_offset: u16,
    network: cli::Network,
    as_json: bool,
) -> anyhow::Result<bool> {
    let faults = if faults.is_empty() { Fault::ALL.to_vec() } else { faults.to_vec() };
    let trials: Vec<(Fault, u64)> =
        (1..=seeds).flat_map(|seed| faults.iter().map(move |fault| (*fault, seed))).collect();
    let folder = out.map_or_else(|| std::env::temp_dir().join("skein-campaign"), Path::to_path_buf);
    let results = run_all(&trials, jobs, &folder, port_offset, network)?;
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
            json!({ "seeds": seeds, "violations": violations, "faults": faults, "failing_seeds": failing })
        );
    } else {
        for (fault, (runs, violations)) in by_fault {
            println!("{fault:<16} {runs:>3} runs, {violations} violations");
        }
    }
    Ok(violations == 0)
}

/// A few at a time, each with ports of its own.
fn run_all(
    trials: &[(Fault, u64)],
    jobs: u16,
    folder: &Path,
    port_offset: u16,
    network: cli::Network,
) -> anyhow::Result<Vec<Trial>> {
    let next = std::sync::atomic::AtomicUsize::new(0);
    let work = |job: u16| -> anyhow::Result<Vec<Trial>> {
        let mut done = Vec::new();
        while let Some((fault, seed)) = trials.get(next.fetch_add(1, std::sync::atomic::Ordering::Relaxed)) {
            let folder = folder.join(format!("{}-{seed}", fault.name()));
            let trial = processes::run(*fault, *seed, &folder, port_offset + 300 * job, network)?;
            let verdict =
                if trial.violations.is_empty() { "ok".to_owned() } else { trial.violations.join("; ") };
            eprintln!("{} seed {seed}, at {:.1} s: {verdict}", fault.name(), trial.at_s);
            done.push(trial);
        }
        Ok(done)
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..jobs.max(1)).map(|job| scope.spawn(move || work(job))).collect();
        let mut all = Vec::new();
        for worker in workers {
            all.extend(worker.join().map_err(|_| anyhow::anyhow!("a run has panicked"))??);
        }
        Ok(all)
    })
}
