//! No promise is broken, over a fixed set of seeds in which every kind of fault occurs.

use std::time::Duration;

use skein_promises::{Campaign, Report, Settings, Story, campaign, run};

const SEEDS: u64 = 200;

fn all_seeds() -> Report {
    campaign(
        &Campaign { from: 1, seeds: SEEDS, jobs: 2, shrunk: 1, settings: Settings::default() },
        &|_, _| {},
    )
}

#[test]
fn every_promise_is_kept_under_every_kind_of_fault() {
    let report = all_seeds();
    let told: Vec<String> = report
        .failures
        .iter()
        .filter_map(|failure| failure.shrunk.as_ref())
        .map(ToString::to_string)
        .collect();
    assert!(report.failures.is_empty(), "{:?}\n{}", report.failures, told.join("\n"));
    let (occurrences, simulated) = report.least.unwrap();
    assert!(occurrences >= 500 && simulated >= Duration::from_secs(60), "the least was {:?}", report.least);
    for (kind, count) in report.faults.by_name() {
        assert!(count > 0, "no fault of the kind `{kind}`");
    }
}

#[test]
fn a_seed_gives_the_same_run_again() {
    let settings = Settings::default().telling(500);
    for seed in [3, 14, 15] {
        let story = Story::invent(seed);
        assert_eq!(run(&story, &settings), run(&story, &settings), "seed {seed}");
    }
}

#[test]
fn a_story_can_be_read() {
    let story = Story::invent(9);
    let text = story.to_string();
    for cast in &story.casts {
        assert!(text.contains(cast.name.as_str()));
        assert!(cast.roles.iter().all(|(name, role)| text.contains(&format!("{name} {role}"))));
    }
    assert!(text.lines().count() > story.casts.len() + story.faults.len());
}
