//! A vehicle that is told to land does not come down upon another, or into a zone.

use std::time::Duration;

use nalgebra::Vector3;
use skein_agent::Outcome;
use skein_mav::messages::{COMMAND_LONG_DATA, MavCmd};
use skein_mav::{Address, FrameWriter};
use skein_tests::Lockstep;
use skein_wire::event::What;
use skein_wire::{Destination, Order, Who};

/// Two vehicles 6 m apart: the first lands after 10 m, the second flies 40 m. And more of the scenario.
fn two(more: &str) -> Lockstep {
    Lockstep::from_text(&format!(
        "name = \"over\"\ntime_limit_s = 200.0\n[bounds]\nmin_m = [-10.0, -10.0, -1.0]\nmax_m = [50.0, 20.0, 15.0]\n\
         [[vehicle]]\nstart_m = [0.0, 0.0]\nwaypoints_m = [[10.0, 0.0, 3.0]]\n\
         [[vehicle]]\nstart_m = [0.0, 6.0]\nwaypoints_m = [[40.0, 6.0, 3.0]]\n{more}"
    ))
}

fn place(lockstep: &Lockstep, index: usize) -> Vector3<f64> {
    lockstep.swarm.simulation().vehicle(index).unwrap().motion.position
}

fn is_airborne(lockstep: &Lockstep, index: usize) -> bool {
    lockstep.swarm.simulation().vehicle(index).unwrap().airborne
}

fn step_until(lockstep: &mut Lockstep, what: &str, is_so: impl Fn(&Lockstep) -> bool) {
    let deadline = lockstep.swarm.now() + Duration::from_secs(60);
    while !is_so(lockstep) {
        assert!(lockstep.swarm.now() < deadline, "{what}");
        lockstep.step();
    }
}

/// Has the second vehicle hover above a place, and then land there. Returns where it is then.
fn land_above(lockstep: &mut Lockstep, [x, y]: [f64; 2]) -> Vector3<f64> {
    let second = || Who::only(lockstep.nodes[1].clone());
    let (go, land) =
        (Order::go_to(second(), Destination { x, y, z: Some(3.0) }), Order::new(What::Land, second()));
    lockstep.swarm.order(&go).unwrap();
    let above = Vector3::new(x, y, 3.0);
    step_until(lockstep, "it does not go there", |lockstep| {
        let motion = lockstep.swarm.simulation().vehicle(1).unwrap().motion;
        (motion.position - above).norm() < 0.5 && motion.velocity.norm() < 0.2
    });
    lockstep.swarm.order(&land).unwrap();
    step_until(lockstep, "it does not land", |lockstep| !is_airborne(lockstep, 1));
    place(lockstep, 1)
}

#[test]
fn told_to_land_above_one_that_has_landed_it_comes_down_beside_it() {
    let mut lockstep = two("");
    step_until(&mut lockstep, "the first does not fly", |lockstep| place(lockstep, 0).x > 9.0);
    step_until(&mut lockstep, "the first does not land", |lockstep| !is_airborne(lockstep, 0));
    let first = place(&lockstep, 0);
    let second = land_above(&mut lockstep, [first.x, first.y]);
    assert_eq!(lockstep.swarm.truth().collisions_vehicle, 0);
    let apart_m = (first - second).xy().norm();
    assert!((1.4..3.0).contains(&apart_m), "{first} and {second} are {apart_m} m apart");
}

/// The first vehicle is sent to where the second is to land, and hovers there when the second comes.
fn first_is_at_the_goal_of_the_second() -> Lockstep {
    let mut lockstep = two("");
    step_until(&mut lockstep, "the second does not fly", |lockstep| place(lockstep, 1).z > 2.5);
    let first = Who::only(lockstep.nodes[0].clone());
    let there = Destination { x: 40.0, y: 6.5, z: Some(3.0) };
    lockstep.swarm.order(&Order::new(What::Hold, Who::only(lockstep.nodes[1].clone()))).unwrap();
    lockstep.swarm.order(&Order::go_to(first, there)).unwrap();
    step_until(&mut lockstep, "the first does not go there", |lockstep| place(lockstep, 0).x > 39.5);
    lockstep.swarm.order(&Order::new(What::Resume, Who::only(lockstep.nodes[1].clone()))).unwrap();
    lockstep
}

fn task(lockstep: &Lockstep, index: usize) -> String {
    lockstep.swarm.agents().nth(index).unwrap().status(lockstep.swarm.now()).task
}

#[test]
fn who_comes_to_a_goal_where_another_hovers_waits_for_it_by_name_and_then_lands_beside_it() {
    let mut lockstep = first_is_at_the_goal_of_the_second();
    step_until(&mut lockstep, "it does not say for whom it waits", |lockstep| {
        task(lockstep, 1) == "leg 1 of 1, waiting beside it: uav/1 is there"
    });
    let began = lockstep.swarm.now();
    step_until(&mut lockstep, "it hovers for ever", |lockstep| !is_airborne(lockstep, 1));
    assert!(lockstep.swarm.now() - began < Duration::from_secs(45));
    let why = "uav/1 stays where it was to land";
    step_until(&mut lockstep, "it does not say why", |lockstep| {
        lockstep.swarm.outcomes().nth(1).unwrap() == Some(&Outcome::Failed(why.to_owned()))
    });
    let off_m = (place(&lockstep, 1) - Vector3::new(40.0, 6.0, 0.0)).xy().norm();
    assert!((0.9..4.0).contains(&off_m), "it lands {off_m} m from its goal");
    assert!(lockstep.swarm.truth().min_separation_m.unwrap() > 1.3, "{:?}", lockstep.swarm.truth());
}

#[test]
fn who_waits_for_a_goal_lands_there_once_it_is_free() {
    let mut lockstep = first_is_at_the_goal_of_the_second();
    step_until(&mut lockstep, "it does not wait", |lockstep| task(lockstep, 1).contains("uav/1 is there"));
    lockstep.swarm.order(&Order::new(What::Resume, Who::only(lockstep.nodes[0].clone()))).unwrap();
    step_until(&mut lockstep, "it does not arrive", |lockstep| {
        lockstep.swarm.outcomes().nth(1).unwrap() == Some(&Outcome::Complete)
    });
    let off_m = (place(&lockstep, 1) - Vector3::new(40.0, 6.0, 0.0)).xy().norm();
    assert!(off_m < 0.7, "it lands {off_m} m from its goal");
}

#[test]
fn who_comes_to_a_goal_where_another_has_landed_lands_beside_it() {
    let mut lockstep = first_is_at_the_goal_of_the_second();
    lockstep.swarm.order(&Order::new(What::Land, Who::only(lockstep.nodes[0].clone()))).unwrap();
    step_until(&mut lockstep, "it does not land", |lockstep| !is_airborne(lockstep, 1));
    let apart_m = (place(&lockstep, 1) - place(&lockstep, 0)).xy().norm();
    assert!((1.4..4.0).contains(&apart_m), "{apart_m} m");
    assert!(lockstep.swarm.truth().min_separation_m.unwrap() > 1.3, "{:?}", lockstep.swarm.truth());
}

#[test]
fn told_to_land_at_full_speed_it_does_not_come_to_a_stop_above_one_that_has_landed() {
    for before_m in [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0] {
        let mut lockstep = two("");
        step_until(&mut lockstep, "the first does not fly", |lockstep| place(lockstep, 0).x > 9.0);
        step_until(&mut lockstep, "the first does not land", |lockstep| !is_airborne(lockstep, 0));
        let (first, second) = (place(&lockstep, 0), Who::only(lockstep.nodes[1].clone()));
        // From where it hovers 12 m further on, back over the one that stands.
        let go = |x| Order::go_to(second.clone(), Destination { x, y: first.y, z: Some(3.0) });
        lockstep.swarm.order(&go(first.x + 12.0)).unwrap();
        step_until(&mut lockstep, "it does not go there", |lockstep| {
            (place(lockstep, 1) - first).xy().norm() > 11.5 && place(lockstep, 1).x > first.x
        });
        lockstep.swarm.order(&go(first.x - 8.0)).unwrap();
        step_until(&mut lockstep, "it does not come back", |lockstep| {
            place(lockstep, 1).x < first.x + before_m
        });
        lockstep.swarm.order(&Order::new(What::Land, second)).unwrap();
        step_until(&mut lockstep, "it does not land", |lockstep| !is_airborne(lockstep, 1));
        let apart_m = (first - place(&lockstep, 1)).xy().norm();
        assert_eq!(lockstep.swarm.truth().collisions_vehicle, 0, "told {before_m} m before");
        assert!(apart_m > 1.4, "told {before_m} m before, it stands {apart_m} m away");
    }
}

#[test]
fn told_to_land_above_a_zone_it_comes_down_outside() {
    let zone =
        "[[airspace.no_fly]]\ncentre_m = [20.0, 6.0]\nradius_m = 1.5\nfloor_m = 0.0\nceiling_m = 1.5\n";
    let mut lockstep = two(zone);
    step_until(&mut lockstep, "the second does not fly", |lockstep| place(lockstep, 1).x > 9.0);
    let second = land_above(&mut lockstep, [20.0, 6.0]);
    let off_m = (second - Vector3::new(20.0, 6.0, 0.0)).xy().norm();
    assert!((1.5..5.0).contains(&off_m), "it is {off_m} m from the middle");
}

#[test]
fn over_free_ground_it_comes_down_where_it_is() {
    let mut lockstep = two("");
    step_until(&mut lockstep, "the second does not fly", |lockstep| place(lockstep, 1).x > 9.0);
    let second = land_above(&mut lockstep, [20.0, 6.0]);
    assert!((second - Vector3::new(20.0, 6.0, 0.0)).xy().norm() < 0.5, "{second}");
}

/// What a pilot's ground station says to take the vehicle over.
fn pilot_takes_over(target_system: u8) -> Vec<u8> {
    let mut writer = FrameWriter::new(Address { system_id: 255, component_id: 190 });
    writer.write(&COMMAND_LONG_DATA {
        command: MavCmd::MAV_CMD_DO_SET_MODE,
        param1: 1.0,
        param2: 3.0, // POSCTL
        target_system,
        target_component: 1,
        ..Default::default()
    });
    writer.take()
}

#[test]
fn a_pilot_who_takes_over_on_the_way_to_where_it_would_land_has_it() {
    let mut lockstep = two("");
    step_until(&mut lockstep, "the first does not fly", |lockstep| place(lockstep, 0).x > 9.0);
    step_until(&mut lockstep, "the first does not land", |lockstep| !is_airborne(lockstep, 0));
    let first = place(&lockstep, 0);
    let second = || Who::only(lockstep.nodes[1].clone());
    let above = Destination { x: first.x, y: first.y, z: Some(3.0) };
    let (go, land) = (Order::go_to(second(), above), Order::new(What::Land, second()));
    lockstep.swarm.order(&go).unwrap();
    let off_m = |lockstep: &Lockstep| (place(lockstep, 1) - first).xy().norm();
    step_until(&mut lockstep, "it does not go there", |lockstep| off_m(lockstep) < 0.1);
    lockstep.swarm.order(&land).unwrap();
    step_until(&mut lockstep, "it does not go aside", |lockstep| off_m(lockstep) > 0.4);
    assert!(place(&lockstep, 1).z > 2.5, "it does not come down yet");
    lockstep.swarm.send_mavlink(1, &pilot_takes_over(2));
    let commands = |lockstep: &Lockstep| lockstep.swarm.agents().nth(1).unwrap().set_points().commands;
    let (taken, mut last) = (lockstep.swarm.now(), commands(&lockstep));
    while lockstep.swarm.now() < taken + Duration::from_secs(25) {
        lockstep.step();
        if lockstep.swarm.now() < taken + Duration::from_secs(2) {
            last = commands(&lockstep);
        }
    }
    assert_eq!(commands(&lockstep), last, "the agent goes on commanding");
    assert!(is_airborne(&lockstep, 1) && place(&lockstep, 1).z > 2.0, "{}", place(&lockstep, 1));
}

/// A vehicle whose home is under a bridge's deck that reaches from `low_m` to `high_m`, 12 by 6 m, comes back at 3 m. On
/// its way out it flew to `out_m`. Returns where it lands.
fn comes_home_under_a_deck([low_m, high_m]: [f64; 2], out_m: f64) -> Vector3<f64> {
    let mut lockstep = Lockstep::from_text(&format!(
        "name = \"bridge\"\ntakeoff_height_m = 1.2\n\
         [[obstacle]]\nname = \"deck\"\ncentre_m = [0.0, 0.0, {}]\nbox_m = [12.0, 6.0, {}]\n\
         [[vehicle]]\nstart_m = [0.0, 0.0]\nwaypoints_m = [[20.0, 0.0, {out_m}], [40.0, 0.0, 3.0]]\n",
        (low_m + high_m) / 2.0,
        high_m - low_m
    ));
    step_until(&mut lockstep, "it does not fly", |lockstep| place(lockstep, 0).x > 18.0);
    lockstep.swarm.order(&Order::new(What::Return, Who::All)).unwrap();
    step_until(&mut lockstep, "it does not land", |lockstep| !is_airborne(lockstep, 0));
    assert_eq!(lockstep.swarm.truth().collisions_obstacle, 0, "it meets the deck");
    place(&lockstep, 0)
}

#[test]
fn a_vehicle_that_comes_home_above_a_deck_lands_beside_it() {
    for (deck, out_m) in [([2.0, 2.2], 3.0), ([2.0, 2.6], 1.2), ([2.0, 2.7], 3.0)] {
        let place = comes_home_under_a_deck(deck, out_m);
        assert!(place.z < 0.5, "{deck:?}: it stands on the deck, at {place}");
        assert!(place.x.abs() > 6.2 || place.y.abs() > 3.2, "{deck:?}: it is under the deck, at {place}");
    }
}

#[test]
fn a_home_whose_height_is_inside_a_deck_is_left_for_a_place_beside_it() {
    let place = comes_home_under_a_deck([2.6, 3.4], 4.5);
    assert!(place.z < 0.5, "{place}");
}

#[test]
fn a_vehicle_under_a_deck_does_not_climb_through_it() {
    let place = comes_home_under_a_deck([2.0, 2.4], 6.0);
    assert!(place.z < 0.5, "{place}");
}
