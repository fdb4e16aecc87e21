//! Many seeds, on several threads, and what came of them.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::promise::Violation;
use crate::run::{Settings, run};
use crate::shrink::{Shrunk, shrink};
use crate::story::{Faults, Story};

#[derive(Clone, Copy, Debug)]
pub struct Campaign {
    /// The first seed.
    pub from: u64,
    pub seeds: u64,
    /// Threads.
    pub jobs: usize,
    /// Failing stories that are shrunk.
    pub shrunk: usize,
    pub settings: Settings,
}

#[derive(Clone, Debug, Default)]
pub struct Report {
    pub seeds: u64,
    /// Steps of nodes, each of which was judged.
    pub steps: u64,
    /// Events, each counted at its home.
    pub occurrences: u64,
    /// The fewest occurrences, and the least simulated time, of any seed that broke nothing.
    pub least: Option<(u64, std::time::Duration)>,
    /// The faults that were injected.
    pub faults: Faults,
    /// The seeds that broke a promise, in order.
    pub failures: Vec<Failure>,
}

/// A seed that breaks a promise.
#[derive(Clone, Debug)]
pub struct Failure {
    pub seed: u64,
    pub violation: Violation,
    /// The same in short, for the first few.
    pub shrunk: Option<Shrunk>,
}

/// Runs a campaign. `progress` is called after each seed with how many are done and how many have failed.
#[must_use]
pub fn campaign(campaign: &Campaign, progress: &(dyn Fn(u64, usize) + Sync)) -> Report {
    let next = AtomicU64::new(0);
    let report = Mutex::new(Report::default());
    std::thread::scope(|scope| {
        for _ in 0..campaign.jobs.max(1) {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= campaign.seeds {
                        return;
                    }
                    let seed = campaign.from.wrapping_add(number);
                    let outcome = run(&Story::invent(seed), &campaign.settings);
                    let mut report = report.lock().unwrap_or_else(PoisonError::into_inner);
                    report.seeds += 1;
                    report.steps += outcome.steps;
                    report.occurrences += outcome.occurrences;
                    report.faults += outcome.faults;
                    match outcome.violation {
                        Some(violation) => report.failures.push(Failure { seed, violation, shrunk: None }),
                        None => {
                            let (events, time) =
                                report.least.unwrap_or((outcome.occurrences, outcome.simulated));
                            report.least =
                                Some((events.min(outcome.occurrences), time.min(outcome.simulated)));
                        }
                    }
                    progress(report.seeds, report.failures.len());
                }
            });
        }
    });
    let mut report = report.into_inner().unwrap_or_else(PoisonError::into_inner);
    report.failures.sort_by_key(|failure| failure.seed);
    for failure in report.failures.iter_mut().take(campaign.shrunk) {
        let story = Story::invent(failure.seed);
        failure.shrunk = Some(shrink(&story, &failure.violation, &campaign.settings));
    }
    report
}
