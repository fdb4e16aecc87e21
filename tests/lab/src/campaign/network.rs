//! `campaign network`: every promise of the protocol, over generated programs and faults in memory.

use std::io::{IsTerminal as _, Write as _};

use clap::Args;
use serde_json::json;
use skein_promises::{Campaign, Failure, Report, Settings, campaign};
use skein_sim::cli::Exit;

use crate::task::Task;

/// Failing stories that are shrunk and told.
const TOLD: usize = 3;

#[derive(Args)]
pub struct Network {
    /// Seeds.
    #[arg(long, value_name = "N", default_value_t = 100)]
    seeds: u64,
    /// The first seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    from: u64,
    /// Seeds at once; as many as this computer has processors if not given.
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// Let every node break this promise on purpose; needs the cargo feature `mutants`.
    #[arg(long = "break", value_name = "PROMISE", ignore_case = true,
        value_parser = ["G1", "G2", "G3", "G4", "G5", "G6", "G7", "G8", "G9"])]
    breaks: Option<String>,
}

impl Task for Network {
    const NAME: &'static str = "network";
    const ABOUT: &'static str = "Generated programs on 2 to 10 nodes in memory, in lockstep, under every fault a network and a process can have; every promise is checked at every step";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let settings = settings(self.breaks.as_deref())?;
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let jobs = self.jobs.unwrap_or(processors);
        let plan = Campaign { from: self.from, seeds: self.seeds, jobs, shrunk: TOLD, settings };
        let on_terminal = std::io::stderr().is_terminal();
        let report = campaign(&plan, &|done, failed| {
            if on_terminal {
                let mut stderr = std::io::stderr().lock();
                // Nobody misses a line of progress that cannot be written.
                let _ = write!(stderr, "\r{done} of {} seeds, {failed} failed", self.seeds);
                let _ = if done == self.seeds { writeln!(stderr) } else { stderr.flush() };
            }
        });
        if as_json {
            println!("{}", to_json(&report));
        } else {
            print(&report);
        }
        Ok(Exit::of(report.failures.is_empty()))
    }
}

#[cfg(feature = "mutants")]
fn settings(breaks: Option<&str>) -> anyhow::Result<Settings> {
    let named = |name: &str| {
        let mut all = skein_promises::Mutant::ALL.into_iter();
        all.find(|(promise, _)| promise.eq_ignore_ascii_case(name)).map(|(_, mutant)| mutant)
    };
    Ok(Settings { mutant: breaks.and_then(named), ..Settings::default() })
}

#[cfg(not(feature = "mutants"))]
fn settings(breaks: Option<&str>) -> anyhow::Result<Settings> {
    if let Some(promise) = breaks {
        anyhow::bail!(
            "`--break {promise}` needs a build that can break promises: cargo run --release -p skein-lab --features mutants -- campaign network --break {promise}"
        );
    }
    Ok(Settings::default())
}

fn to_json(report: &Report) -> serde_json::Value {
    let failing = report.failures.iter().map(|Failure { seed, violation, shrunk }| {
        json!({
            "seed": seed,
            "promise": violation.promise.to_string(),
            "at_s": violation.at.as_secs_f64(),
            "node": violation.node.as_str(),
            "what": violation.what,
            "story": shrunk.as_ref().map(ToString::to_string),
        })
    });
    let failing: Vec<_> = failing.collect();
    let faults: serde_json::Map<_, _> =
        report.faults.by_name().into_iter().map(|(kind, count)| (kind.to_owned(), count.into())).collect();
    json!({
        "seeds": report.seeds,
        "violations": report.failures.len(),
        "steps": report.steps,
        "events": report.occurrences,
        "least_events": report.least.map(|(events, _)| events),
        "least_sim_time_s": report.least.map(|(_, time)| time.as_secs_f64()),
        "faults": faults,
        "failing_seeds": failing,
    })
}

fn print(report: &Report) {
    for Failure { seed, violation, shrunk } in &report.failures {
        println!("seed {seed}: {violation}");
        if let Some(shrunk) = shrunk {
            println!("in short:\n{shrunk}");
        }
    }
    println!("{:<16} {:>12}", "seeds", report.seeds);
    println!("{:<16} {:>12}", "violations", report.failures.len());
    println!("{:<16} {:>12}", "steps judged", report.steps);
    println!("{:<16} {:>12}", "events", report.occurrences);
    for (kind, count) in report.faults.by_name() {
        println!("{kind:<16} {count:>12}");
    }
}
