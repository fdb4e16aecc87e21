//! `campaign network`: every promise of the protocol, over generated programs and faults in memory.

use std::io::{IsTerminal as _, Write as _};

use serde_json::json;
use skein_promises::{Campaign, Failure, Report, Settings, campaign};

use crate::cli::NetworkCampaign;

/// How many failing stories are shrunk and told.
const TOLD: usize = 3;

/// Runs the campaign, and prints what came of it. Returns whether nothing was violated.
pub(super) fn run(args: &NetworkCampaign, as_json: bool) -> anyhow::Result<bool> {
    let settings = settings(args.breaks.as_deref())?;
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = args.jobs.unwrap_or(processors);
    let plan = Campaign { from: args.from, seeds: args.seeds, jobs, shrunk: TOLD, settings };
    let on_terminal = std::io::stderr().is_terminal();
    let report = campaign(&plan, &|done, failed| {
        if on_terminal {
            let mut stderr = std::io::stderr().lock();
            // Nobody misses a line of progress that cannot be written.
            let _ = write!(stderr, "\r{done} of {} seeds, {failed} failed", args.seeds);
            let _ = if done == args.seeds { writeln!(stderr) } else { stderr.flush() };
        }
    });
    if as_json {
        println!("{}", to_json(&report));
    } else {
        print(&report);
    }
    Ok(report.failures.is_empty())
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
            "`--break {promise}` needs a build that can break promises: cargo run --release --features mutants -- campaign network --break {promise}"
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
