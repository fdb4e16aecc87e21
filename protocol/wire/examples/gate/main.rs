//! A gate that takes one vehicle at a time: `cargo run --release -p skein-wire --example gate`.
//!
//! Flies the naive rule and the guarded ones over a hostile network and prints how often two vehicles were inside; a
//! number as argument says how many seeds, 1000 unless given. [docs/guide.md](../../../../docs/guide.md) explains it.

mod contest;
mod fleet;
mod guarded;
mod lost_holder;
mod naive;
mod one_way;
mod trip;

use std::error::Error;
use std::process::ExitCode;

use contest::{Rule, Tally, fly_all};
use guarded::Care;
use lost_holder::Story;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let seeds = arguments.next().map_or(Ok(1000), |seeds| seeds.parse());
    let (Ok(seeds), None) = (seeds, arguments.next()) else {
        eprintln!("usage: gate [SEEDS]");
        return ExitCode::from(2);
    };
    match report(seeds) {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::FAILURE
        }
    }
}

/// The rules, and how the table names them.
const RULES: [(&str, Rule); 4] = [
    ("look, enter", Rule::Naive),
    ("block, enter", Rule::Guarded(Care::Hasty)),
    ("block, await confirmation, enter", Rule::Guarded(Care::ForALease)),
    ("the same, held when lost", Rule::Guarded(Care::ForGood)),
];

fn report(seeds: u64) -> Result<(), Box<dyn Error>> {
    println!("{:<32} {:>20} {:>28}", format!("{seeds} seeds"), "all in reach", "one cut off for a while");
    println!("{:<32} {:>10} {:>9} {:>18} {:>9}", "", "entries", "shared", "entries", "shared");
    for (name, rule) in RULES {
        let tallies = [fly_all(rule, false, 0..seeds)?, fly_all(rule, true, 0..seeds)?];
        println!("{}", row(name, tallies));
    }
    println!("\n{}", stories()?);
    Ok(())
}

fn row(name: &str, [whole, cut]: [Tally; 2]) -> String {
    let Tally { entries, shared, .. } = whole;
    format!("{name:<32} {entries:>10} {shared:>9} {:>18} {:>9}", cut.entries, cut.shared)
}

/// What becomes of the gate when its holder is lost, and when its direction is changed.
fn stories() -> Result<String, Box<dyn Error>> {
    let Story { lost, back, lifted } = lost_holder::fly(1)?;
    let flown = one_way::fly(&["north", "south", "east"], 1)?;
    let ways: Vec<String> = flown
        .chunk_by(|one, next| one == next)
        .map(|entries| format!("{} {}", entries.len(), entries[0]))
        .collect();
    Ok([
        format!("a vehicle is lost inside: {lost} entries in 10 s"),
        format!("it starts again:          {back} entries in 10 s"),
        format!("its block is lifted:      {lifted} entries in 10 s"),
        format!("the gate turns twice:     {} entries", ways.join(", ")),
    ]
    .join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const GUIDE: &str = include_str!("../../../../docs/guide.md");

    #[test]
    fn who_looks_and_enters_meets_another_inside() {
        let tally = fly_all(Rule::Naive, false, 0..100).unwrap();
        assert!(tally.shared > 100, "{tally:?}");
    }

    #[test]
    fn who_blocks_and_does_not_wait_meets_another_inside() {
        let tally = fly_all(Rule::Guarded(Care::Hasty), false, 0..100).unwrap();
        assert!(tally.shared > 10, "{tally:?}");
    }

    #[test]
    fn who_awaits_confirmation_never_does() {
        let (name, rule) = RULES[3];
        let tallies = [false, true].map(|cut| fly_all(rule, cut, 0..1000).unwrap());
        for tally in tallies {
            assert!(tally.entries > 5000, "they hardly fly: {tally:?}");
            assert_eq!(tally.shared, 0, "{tally:?}");
        }
        assert!(GUIDE.contains(&row(name, tallies)), "{}", row(name, tallies));
    }

    #[test]
    fn the_guide_shows_how_the_stories_end() {
        assert!(GUIDE.contains(&stories().unwrap()), "{}", stories().unwrap());
    }
}
