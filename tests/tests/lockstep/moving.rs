//! Something that moves, and tells nobody, fills the only door, or one of two.

use std::time::Duration;

use skein_agent::Outcome;
use skein_tests::Lockstep;

/// A cart comes along a wall, and stands in the door in it; the other way leads around the wall's southern end.
const DOOR: &str = r#"
cruise_speed_m_s = 2.0
takeoff_height_m = 1.2

[bounds]
min_m = [-16.0, -14.0, -1.0]
max_m = [16.0, 14.0, 6.0]

[[vehicle]]
start_m = [-9.0, 0.0]
waypoints_m = [[9.0, 0.0, 1.2]]

[[obstacle]]
centre_m = [0.0, 7.5, 3.0]
box_m = [0.4, 13.0, 6.0]

[[obstacle]]
name = "southern wall"
centre_m = [0.0, -5.0, 3.0]
box_m = [0.4, 8.0, 6.0]

[[obstacle]]
name = "cart"
centre_m = [-3.0, 8.0, 1.0]
cylinder = { radius_m = 0.5, height_m = 5.0 }
waypoints_m = [[-2.0, 0.0, 1.0], [0.0, 0.0, 1.0], [4.0, 4.0, 1.0]]
speed_m_s = 1.2
waits_s = [0.0, 4.5, 0.0]
"#;
const WAITS_FOR: &str = "something that moves to leave its way";

struct Flown {
    outcome: Option<Outcome>,
    /// For how long it said that it waits, s.
    waited_s: f64,
    /// Where it crossed the wall, m north.
    crossed_at_m: Option<f64>,
    ended_s: f64,
}

fn fly(text: &str) -> Flown {
    let mut lockstep = Lockstep::from_text(text);
    let (mut waited_s, mut crossed_at_m) = (0.0, None);
    while lockstep.swarm.now() < Duration::from_secs(250)
        && !(lockstep.swarm.is_over() && lockstep.swarm.is_grounded())
    {
        for _ in 0..25 {
            lockstep.step();
        }
        let now = lockstep.swarm.now();
        let place = lockstep.swarm.simulation().vehicle(0).unwrap().motion.position;
        let status = lockstep.swarm.agents().next().unwrap().status(now);
        waited_s += if status.waiting_for == WAITS_FOR { 0.1 } else { 0.0 };
        if place.x > 0.0 {
            crossed_at_m.get_or_insert(place.y);
        }
    }
    assert_eq!(lockstep.swarm.truth().collisions_obstacle, 0);
    let outcome = lockstep.swarm.outcomes().next().unwrap().cloned();
    Flown { outcome, waited_s, crossed_at_m, ended_s: lockstep.swarm.now().as_secs_f64() }
}

#[test]
fn a_door_that_a_cart_fills_is_waited_for() {
    let flown = fly(DOOR);
    assert_eq!(flown.outcome, Some(Outcome::Complete));
    assert!((2.0..9.5).contains(&flown.waited_s), "{} s", flown.waited_s);
    assert!(flown.crossed_at_m.is_some_and(|y| y.abs() < 1.0), "through the door: {:?}", flown.crossed_at_m);
}

#[test]
fn a_cart_that_stays_is_gone_around_after_ten_seconds() {
    let flown = fly(&DOOR.replace("waits_s = [0.0, 4.5, 0.0]", "waits_s = [0.0, 300.0, 0.0]"));
    assert_eq!(flown.outcome, Some(Outcome::Complete));
    assert!((8.0..12.0).contains(&flown.waited_s), "{} s", flown.waited_s);
    assert!(flown.crossed_at_m.is_some_and(|y| y < -9.0), "around the wall: {:?}", flown.crossed_at_m);
}

#[test]
fn where_there_is_no_way_around_it_lands_and_says_why() {
    let closed = DOOR
        .replace("waits_s = [0.0, 4.5, 0.0]", "waits_s = [0.0, 300.0, 0.0]")
        .replace("centre_m = [0.0, -5.0, 3.0]", "centre_m = [0.0, -7.5, 3.0]")
        .replace("box_m = [0.4, 8.0, 6.0]", "box_m = [0.4, 13.0, 6.0]")
        // Nor is there one over it.
        .replace("height_m = 5.0", "height_m = 14.0");
    let flown = fly(&closed);
    assert!(matches!(flown.outcome, Some(Outcome::Failed(_))), "{:?}", flown.outcome);
    assert!(flown.ended_s < 150.0, "{} s", flown.ended_s);
}
