//! `campaign hostile`: a member of the fleet that says whatever can be said, beside a swarm that flies in lockstep.

mod content;
mod cost;
mod flight;
mod mouth;
mod processes;
mod scripts;
mod story;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;
use skein_bp::Bound;
use skein_sim::cli::Exit;

use self::cost::Worst;
use self::flight::{Flown, Violation, fly};
use self::mouth::Said;
use self::story::{Rank, Story};
use crate::runs;
use crate::task::Task;

/// Flights that shrinking one story may take.
const MOST_TRIES: usize = 60;
/// Stories that are shrunk and told.
const TOLD: usize = 3;

#[derive(Args)]
pub struct Hostile {
    /// Seeds.
    #[arg(long, value_name = "N", default_value_t = 100)]
    seeds: u64,
    /// The first seed.
    #[arg(long, value_name = "S", default_value_t = 1)]
    from: u64,
    /// Flights at once; as many as this computer has processors if not given.
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// Fly without this bound, to see that the campaign notices; needs the cargo feature `mutants`.
    #[arg(long, value_name = "BOUND")]
    mutant: Option<String>,
    /// Tell violations as they are found, without looking for a shorter story.
    #[arg(long)]
    no_shrink: bool,
    /// End with the first violation.
    #[arg(long)]
    first: bool,
    /// Fly as processes over TLS instead, in real time and one flight after another: logs stay in this folder.
    #[arg(long, value_name = "DIR")]
    processes: Option<PathBuf>,
    /// With --processes, use network ports so much further up, beside another swarm on this computer.
    #[arg(long, value_name = "N", default_value_t = 6000)]
    port_offset: u16,
}

impl Task for Hostile {
    const NAME: &'static str = "hostile";
    const ABOUT: &'static str = "A member of the fleet says whatever can be said, beside a swarm in lockstep: nobody may do what it has no right to, and it costs no more than is stated";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let removed = self.mutant.as_deref().map(bound).transpose()?;
        let seeds: Vec<u64> = (self.from..self.from + self.seeds).collect();
        if let Some(folder) = &self.processes {
            return self.fly_processes(&seeds, folder, as_json);
        }
        let mut report = Report::default();
        // With --first, a few at a time.
        let at_once = if self.first { 4 } else { seeds.len().max(1) };
        for seeds in seeds.chunks(at_once) {
            let flown = runs::by_jobs(self.jobs, "flights", seeds, |seed| {
                let story = Story::of(*seed);
                Ok((fly_without(removed, &story)?, story))
            })?;
            flown.into_iter().for_each(|(flown, story)| report.take_in(flown, story));
            if self.first && !report.found.is_empty() {
                break;
            }
        }
        let told = if self.no_shrink { 0 } else { TOLD };
        for (story, violation) in report.found.iter_mut().take(told) {
            let kind = violation.kind.clone();
            *story = story.clone().shrink(MOST_TRIES, |story| {
                let found = fly_without(removed, story)?.violation;
                Ok(found.is_some_and(|found| found.kind == kind))
            })?;
            *violation = fly_without(removed, story)?.violation.unwrap_or_else(|| violation.clone());
        }
        report.print(as_json, self.mutant.as_deref());
        Ok(Exit::of(report.found.is_empty()))
    }
}

impl Hostile {
    fn fly_processes(&self, seeds: &[u64], folder: &Path, as_json: bool) -> anyhow::Result<Exit> {
        let fly = |story: &Story, name: &str| processes::fly(story, &folder.join(name), self.port_offset);
        let quiet = Story { habits: Vec::new(), rank: Rank::Vehicle, ..Story::of(self.from) };
        let quiet = fly(&quiet, "quiet")?;
        let mut trials = Vec::new();
        for seed in seeds {
            let story = Story { rank: Rank::Vehicle, ..Story::of(*seed) };
            let mut trial = fly(&story, &seed.to_string())?;
            trial.judge_growth(&quiet);
            let verdict =
                if trial.violations.is_empty() { "ok".to_owned() } else { trial.violations.join("; ") };
            eprintln!("seed {seed}: {verdict}");
            trials.push(trial);
        }
        let violations: usize = trials.iter().map(|trial| trial.violations.len()).sum();
        let growth_mb = trials.iter().map(|trial| trial.growth).max().unwrap_or(0) as f64 / 1e6;
        let tick_ms = trials.iter().map(|trial| trial.tick_ms).fold(0.0, f64::max);
        if as_json {
            let failing: Vec<_> = trials.iter().filter(|trial| !trial.violations.is_empty()).collect();
            let report = json!({
                "seeds": trials.len(), "violations": violations, "growth_mb": growth_mb, "tick_ms": tick_ms, "quiet": quiet, "failing_seeds": failing });
            println!("{report}");
        } else {
            println!(
                "{} flights, {violations} violations; a process grew by {growth_mb:.1} MB and used {tick_ms:.1} ms of a processor in each 20 ms, at most",
                trials.len()
            );
        }
        Ok(Exit::of(violations == 0))
    }
}

/// The bound of this name, in a build that can take it away.
fn bound(word: &str) -> anyhow::Result<Bound> {
    let known = || Bound::ALL.iter().map(|bound| bound.word()).collect::<Vec<_>>().join(", ");
    let bound = Bound::ALL.iter().find(|bound| bound.word() == word);
    let bound = bound
        .ok_or_else(|| anyhow::anyhow!("--mutant {word}: no such bound; expected one of {}", known()))?;
    anyhow::ensure!(
        cfg!(feature = "mutants"),
        "`--mutant {word}` needs a build that can take bounds away: cargo run --release -p skein-lab --features mutants -- campaign hostile --mutant {word}"
    );
    Ok(*bound)
}

#[cfg(feature = "mutants")]
fn fly_without(removed: Option<Bound>, story: &Story) -> anyhow::Result<Flown> {
    let _removed = removed.map(Bound::remove);
    fly(story)
}

#[cfg(not(feature = "mutants"))]
fn fly_without(_: Option<Bound>, story: &Story) -> anyhow::Result<Flown> {
    fly(story)
}

#[derive(Default)]
struct Report {
    seeds: u64,
    said: Said,
    worst: Worst,
    min_separation_m: Option<f64>,
    longest_s: f64,
    found: Vec<(Story, Violation)>,
}

impl Report {
    fn take_in(&mut self, flown: Flown, story: Story) {
        self.seeds += 1;
        self.said.messages += flown.said.messages;
        self.said.bytes += flown.said.bytes;
        self.said.decoded += flown.said.decoded;
        for (name, counted) in flown.worst {
            cost::note(
                &mut self.worst,
                name,
                counted.most,
                usize::try_from(counted.stated).unwrap_or(usize::MAX),
            );
        }
        let least = [self.min_separation_m, flown.min_separation_m].into_iter().flatten().reduce(f64::min);
        self.min_separation_m = least;
        self.longest_s = self.longest_s.max(flown.end.as_secs_f64());
        self.found.extend(flown.violation.map(|violation| (story, violation)));
    }

    fn decoded_share(&self) -> f64 {
        self.said.decoded as f64 / self.said.messages.max(1) as f64
    }

    fn print(&self, as_json: bool, mutant: Option<&str>) {
        if as_json {
            println!("{}", self.to_json(mutant));
            return;
        }
        for (story, violation) in &self.found {
            println!("{violation}\n  {story}");
        }
        println!("{:<22} {:>12}", "seeds", self.seeds);
        println!("{:<22} {:>12}", "violations", self.found.len());
        println!("{:<22} {:>12}", "messages", self.said.messages);
        println!("{:<22} {:>12.3}", "decoded share", self.decoded_share());
        for (name, counted) in &self.worst {
            println!("{name:<22} {:>12} of {}", counted.most, counted.stated);
        }
    }

    fn to_json(&self, mutant: Option<&str>) -> serde_json::Value {
        let worst: BTreeMap<&str, _> = self
            .worst
            .iter()
            .map(|(name, counted)| (*name, json!({ "most": counted.most, "stated": counted.stated })))
            .collect();
        let failing: Vec<_> = self
            .found
            .iter()
            .map(|(story, violation)| {
                json!({
                    "seed": story.seed,
                    "kind": violation.kind,
                    "at_s": violation.at.as_secs_f64(),
                    "node": violation.node.as_str(),
                    "what": violation.what,
                    "story": story.to_string(),
                })
            })
            .collect();
        json!({
            "seeds": self.seeds,
            "violations": self.found.len(),
            "messages": self.said.messages,
            "bytes": self.said.bytes,
            "decoded_share": self.decoded_share(),
            "worst_per_bound": worst,
            "min_separation_m": self.min_separation_m,
            "longest_flight_s": self.longest_s,
            "mutant": mutant,
            "failing_seeds": failing,
        })
    }
}
