//! A node that breaks a promise on purpose is caught, and the story of it is short.

#![cfg(feature = "mutants")]

use skein_promises::{Campaign, Mutant, Settings, Story, campaign, run, shrink};

/// So many seeds have to suffice ...
const SEEDS: u64 = 200;
/// ... but most mutants need few.
const AT_ONCE: u64 = 10;

/// The first seed whose run breaks the promise that `mutant` is named for.
fn first_caught(name: &str, mutant: Mutant) -> Option<u64> {
    (0..SEEDS / AT_ONCE).find_map(|part| {
        let settings = Settings { mutant: Some(mutant), ..Settings::default() };
        let part = Campaign { from: 1 + part * AT_ONCE, seeds: AT_ONCE, jobs: 2, shrunk: 0, settings };
        let report = campaign(&part, &|_, _| {});
        let named = |promise: &skein_promises::Promise| promise.to_string() == name;
        report.failures.iter().find(|failure| named(&failure.violation.promise)).map(|failure| failure.seed)
    })
}

#[test]
fn each_promise_that_is_broken_is_missed() {
    let caught: Vec<(&str, Option<u64>)> =
        Mutant::ALL.into_iter().map(|(name, mutant)| (name, first_caught(name, mutant))).collect();
    println!("{caught:?}");
    assert!(caught.iter().all(|(_, seed)| seed.is_some()), "not caught: {caught:?}");
}

#[test]
fn a_failing_story_is_shrunk_to_a_short_one_that_fails_alike() {
    let seed = first_caught("G1", Mutant::G1).unwrap();
    let settings = Settings { mutant: Some(Mutant::G1), ..Settings::default() };
    let story = Story::invent(seed);
    let violation = run(&story, &settings).violation.unwrap();
    let shrunk = shrink(&story, &violation, &settings);
    assert_eq!(shrunk.violation.promise, violation.promise);
    assert!(shrunk.story.casts.len() <= 2, "{shrunk}");
    let roles: usize = shrunk.story.casts.iter().map(|cast| cast.roles.len()).sum();
    assert!(roles <= 2 && shrunk.story.faults.len() <= 1, "{shrunk}");
    assert!(shrunk.to_string().lines().count() < 40, "{shrunk}");
}
