//! That all arrive, and that nobody comes near anybody on the way.

use super::places::Place;
use super::radio::{APART, Outcome, fly};

/// Steps in which all must have arrived: twice what the slowest of some hundred seeds took.
const MOST_STEPS: u32 = 160;

fn assert_all_arrive(seed: u64, outcome: &Outcome) {
    assert!(outcome.steps.is_some(), "seed {seed}: not all have arrived");
    assert!(outcome.closest >= APART.half_cells, "seed {seed}: {} half cells", outcome.closest);
}

#[test]
fn all_pass_through_mazes_of_narrow_corridors_in_both_directions() {
    for seed in 0..8 {
        assert_all_arrive(seed, &fly(&Place::maze(seed), MOST_STEPS));
    }
}

#[test]
fn knots_that_others_once_could_not_undo_come_undone() {
    // A way out behind those who cannot move; a goal in front of the only door; two that wait for one another to go
    // first.
    for seed in [1020, 1099, 1145] {
        assert_all_arrive(seed, &fly(&Place::maze(seed), MOST_STEPS));
    }
}

#[test]
fn all_cross_forests() {
    for seed in 0..6 {
        assert_all_arrive(seed, &fly(&Place::forest(seed), MOST_STEPS));
    }
}

#[test]
fn the_same_place_is_flown_the_same_way_again() {
    let place = Place::maze(3);
    assert_eq!(fly(&place, MOST_STEPS), fly(&place, MOST_STEPS));
}

#[test]
fn one_alone_takes_the_shortest_way() {
    let mut place = Place::maze(1);
    place.trips.truncate(1);
    let [start, goal] =
        <[_; 2]>::from(place.trips[0]).map(|point| place.roads.lattice().nearest(&point).unwrap());
    let shortest = place.roads.distances(goal).steps_from(&place.roads, &start).unwrap();
    // It sets out at step 1.
    assert_eq!(fly(&place, MOST_STEPS).steps, Some(u32::from(shortest) + 1));
}

#[test]
fn nobody_commits_to_more_way_than_radio_reaches() {
    // Words are said at most 0.14 s before a step of 0.56 s, by vehicles that lag 0.28 s behind their commands.
    let place = Place::forest(0);
    let reach_m = place.roads.lattice().reach_m(0.42 / 0.56);
    assert!(2.0 * reach_m + 0.4 < 3.0, "{reach_m} m");
}
