//! The campaign without the simulator around it: seeds, the first of them, and how many failing stories are shrunk,
//! as in `cargo run --release -p skein-promises --example campaign -- 1000 1 3`.

#![allow(clippy::expect_used)] // An example ends when it is used wrongly.

use std::time::Instant;

use skein_promises::{Campaign, Settings, campaign};

fn main() {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse().expect("a number"));
    let (seeds, from) = (numbers.next().unwrap_or(100), numbers.next().unwrap_or(1));
    let shrunk = usize::try_from(numbers.next().unwrap_or(1)).expect("few");
    let began = Instant::now();
    let report =
        campaign(&Campaign { from, seeds, jobs: 2, shrunk, settings: Settings::default() }, &|_, _| {});
    for failure in &report.failures {
        println!("seed {}: {}", failure.seed, failure.violation);
    }
    for shrunk in report.failures.iter().filter_map(|failure| failure.shrunk.as_ref()) {
        println!("{shrunk}");
    }
    println!(
        "{} steps, {} occurrences, at least {:?} in a seed",
        report.steps, report.occurrences, report.least
    );
    println!("{:?}", report.faults);
    println!("{:.1} s for {} seeds on 2 threads", began.elapsed().as_secs_f64(), report.seeds);
}
