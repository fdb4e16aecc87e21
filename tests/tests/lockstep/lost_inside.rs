//! A vehicle whose agent dies in a corridor: those who want to come through it go around, or end in bounded time and
//! name it.

use std::time::Duration;

use skein_agent::Outcome;
use skein_tests::Lockstep;

/// A corridor of 1.5 m from west to east between two rooms, and a block north of it.
fn scenario(block_m: [f64; 2]) -> String {
    let [from, to] = block_m;
    format!(
        r#"
cruise_speed_m_s = 1.5
time_limit_s = 600.0
[bounds]
min_m = [-16.0, -13.0, -1.0]
max_m = [16.0, 13.0, 9.0]
[[obstacle]]
centre_m = [0.0, {}, 4.0]
box_m = [14.0, {}, 10.0]
[[obstacle]]
centre_m = [0.0, -7.0, 4.0]
box_m = [14.0, 12.5, 10.0]
[[vehicle]]
start_m = [-11.0, 2.0]
waypoints_m = [[11.0, -2.0, 2.0]]
[[vehicle]]
start_m = [11.0, 3.0]
waypoints_m = [[-11.0, -2.0, 2.0]]
"#,
        (from + to) / 2.0,
        to - from
    )
}

/// The outcome of the second vehicle, and when, s, when the first one's agent dies in the middle of the corridor.
fn outcome_of_the_other(block_m: [f64; 2]) -> (Option<Outcome>, f64) {
    let mut lockstep = Lockstep::from_text(&scenario(block_m));
    let mut is_dead = false;
    let end = Duration::from_secs(400);
    while lockstep.swarm.now() < end && lockstep.swarm.outcomes().nth(1).unwrap().is_none() {
        lockstep.step();
        let position = lockstep.swarm.simulation().vehicle(0).unwrap().motion.position;
        if !is_dead && position.x > -1.0 {
            is_dead = true;
            lockstep.swarm.kill_agent(0);
        }
    }
    let truth = lockstep.swarm.truth();
    assert!(is_dead);
    assert_eq!((truth.collisions_obstacle, truth.collisions_vehicle), (0, 0));
    (lockstep.swarm.outcomes().nth(1).unwrap().cloned(), lockstep.swarm.now().as_secs_f64())
}

#[test]
fn who_can_goes_around_one_that_is_lost_in_a_corridor() {
    let (outcome, at_s) = outcome_of_the_other([0.75, 6.0]);
    assert_eq!(outcome, Some(Outcome::Complete), "at {at_s} s");
}

#[test]
fn who_cannot_says_who_is_lost_there_in_bounded_time() {
    let (outcome, at_s) = outcome_of_the_other([0.75, 13.0]);
    let why = format!("{outcome:?}");
    assert!(why.contains("uav/1"), "{why} at {at_s} s");
}
