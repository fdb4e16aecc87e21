//! Tasks for a whole swarm, flown: an area is seen, a formation kept, targets reached together.

use std::time::Duration;

use skein_agent::Outcome;
use skein_sim::fly::vehicle_name;
use skein_sim::scenario::Scenario;
use skein_tests::Lockstep;
use skein_wire::event::What;
use skein_wire::{NetworkConfig, Order, Who};

type Point = [f64; 3];

/// Where all vehicles are, ten times a second, until all have landed.
fn flown(scenario: &str) -> (Lockstep, Vec<Vec<Point>>) {
    flown_in(Lockstep::new(scenario, None, 1))
}

fn flown_in(mut lockstep: Lockstep) -> (Lockstep, Vec<Vec<Point>>) {
    let end = Duration::from_secs_f64(lockstep.scenario.time_limit_s);
    let mut poses = Vec::new();
    while lockstep.swarm.now() < end && !(lockstep.swarm.is_over() && lockstep.swarm.is_grounded()) {
        for _ in 0..25 {
            lockstep.step();
        }
        let world = lockstep.swarm.simulation();
        let vehicles = (0..world.vehicle_count()).map(|k| world.vehicle(k).unwrap().motion.position.into());
        poses.push(vehicles.collect());
    }
    let truth = lockstep.swarm.truth();
    assert_eq!((truth.collisions_obstacle, truth.collisions_vehicle), (0, 0));
    assert!(lockstep.swarm.outcomes().all(|outcome| outcome == Some(&Outcome::Complete)));
    (lockstep, poses)
}

fn distance(one: &Point, other: &Point) -> f64 {
    (0..3).map(|axis| (one[axis] - other[axis]).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn every_place_of_a_surveyed_field_is_seen() {
    let (_, poses) = flown("survey");
    for (x, y) in
        (0..30).flat_map(|x| (0..15).map(move |y| (f64::from(x) * 2.0 + 1.0, f64::from(y) * 2.0 + 1.0)))
    {
        let nearest_m = poses
            .iter()
            .flatten()
            .filter(|at| at[2] > 2.0)
            .map(|at| distance(at, &[x, y, at[2]]))
            .fold(f64::INFINITY, f64::min);
        assert!(nearest_m < 3.0 + 0.5, "({x}, {y}) is seen from {nearest_m} m, half a swath is 3 m");
    }
}

/// Four vehicles see a field in the form of a comb with two teeth missing; one gap is closed, and so is a
/// round place in the field.
const COMB: &str = r#"
name = "comb"
vehicles = 4
time_limit_s = 300.0
[coverage]
area_m = [[0, 0], [75, 0], [75, 36], [60, 36], [60, 16], [45, 16], [45, 30], [30, 30], [30, 14], [16, 14], [16, 40], [0, 40]]
swath_m = 5.0
height_m = 3.0
[[airspace.no_fly]]
corners_m = [[18.0, 16.0], [28.0, 16.0], [28.0, 60.0], [18.0, 60.0]]
[[airspace.no_fly]]
centre_m = [38.0, 6.0]
radius_m = 2.0
"#;

/// Whether a place is over the comb, by so many metres.
fn is_over_the_comb(x: f64, y: f64, by_m: f64) -> bool {
    let height_m = match x {
        x if x < 16.0 - by_m => 40.0,
        x if x < 30.0 + by_m => 14.0,
        x if x < 45.0 - by_m => 30.0,
        x if x < 60.0 + by_m => 16.0,
        _ => 36.0,
    };
    x > by_m && x < 75.0 - by_m && y > by_m && y < height_m - by_m
}

#[test]
fn a_field_with_notches_is_seen_from_above_itself_and_all_are_done_at_the_same_time() {
    let (_, poses) = flown_in(Lockstep::from_text(COMB));
    let at_work = |at: &&Point| at[2] > 2.0;
    for at in poses.iter().flatten().filter(at_work) {
        assert!(is_over_the_comb(at[0], at[1], 0.0), "{at:?} is not over the field");
        assert!((at[0] - 38.0).hypot(at[1] - 6.0) > 2.0, "{at:?} is in the round zone");
    }
    let places = (0..75).flat_map(|x| (0..40).map(move |y| (f64::from(x) + 0.5, f64::from(y) + 0.5)));
    let open = places.filter(|(x, y)| is_over_the_comb(*x, *y, 0.0) && (x - 38.0).hypot(y - 6.0) > 2.0);
    let open: Vec<_> = open.collect();
    let is_seen = |(x, y): &&(f64, f64)| {
        poses.iter().flatten().filter(at_work).any(|at| (at[0] - x).hypot(at[1] - y) <= 2.5)
    };
    let share = open.iter().filter(is_seen).count() as f64 / open.len() as f64;
    assert!(share > 0.97, "{share} of the field is seen");
    let landed_s = |vehicle: usize| poses.iter().rposition(|at| at[vehicle][2] > 2.0).unwrap() as f64 / 10.0;
    let times_s: Vec<f64> = (0..4).map(landed_s).collect();
    let last_s = times_s.iter().copied().fold(0.0, f64::max);
    assert!(times_s.iter().all(|time_s| *time_s > 0.95 * last_s), "{times_s:?}");
}

#[test]
fn geese_keep_their_places_from_their_start_to_their_goals() {
    let (lockstep, poses) = flown("geese");
    let vehicles = &lockstep.scenario.vehicles;
    let is_there =
        |at: &[Point]| at.iter().zip(vehicles).any(|(at, plan)| distance(at, &plan.goal().into()) < 1.0);
    let set_out = poses.iter().position(|at| at[0][0] > 1.0).unwrap();
    let arrived = poses.iter().position(|at| is_there(at)).unwrap();
    assert!(arrived > set_out + 100, "they are on their way for ten seconds and more");
    for at in &poses[set_out..arrived] {
        for (own, plan) in at.iter().zip(vehicles) {
            let place = (0..3).map(|axis| at[0][axis] + plan.start[axis] - vehicles[0].start[axis]);
            let place: Vec<f64> = place.collect();
            let off_m = distance(own, &[place[0], place[1], place[2]]);
            // The last of a side follows three others, each as far behind the one before as both need to stop.
            assert!(off_m < 1.2, "{off_m} m from its place");
        }
    }
}

/// When each of these vehicles arrives, in seconds.
fn arrivals_s(
    scenario: &Scenario,
    poses: &[Vec<Point>],
    vehicles: impl IntoIterator<Item = usize>,
) -> Vec<f64> {
    let arrival_s = |vehicle: usize| {
        let goal = scenario.vehicles[vehicle].goal().into();
        poses.iter().position(|at| distance(&at[vehicle], &goal) < 1.0).unwrap() as f64 / 10.0
    };
    vehicles.into_iter().map(arrival_s).collect()
}

fn spread_s(times_s: &[f64]) -> f64 {
    let first_s = times_s.iter().copied().fold(f64::INFINITY, f64::min);
    times_s.iter().copied().fold(0.0, f64::max) - first_s
}

#[test]
fn targets_behind_threats_are_reached_together() {
    let (lockstep, poses) = flown("valley");
    let times_s = arrivals_s(&lockstep.scenario, &poses, 0..10);
    assert!(spread_s(&times_s) < 1.0, "{times_s:?}");
    for at in poses.iter().flatten() {
        for (x, y, radius_m) in [(50.0, 50.0, 20.0), (25.0, 60.0, 10.0)] {
            assert!(distance(at, &[x, y, 0.0]) > radius_m, "{at:?} is in a threat zone");
        }
        assert!(distance(at, &[75.0, 25.0, at[2]]) > 10.0, "{at:?} is where nobody may fly");
    }
}

/// The vehicle of this number, from 0, is held for ten seconds from then on.
fn holding(mut scenario: Scenario, vehicle: usize, from_s: f64) -> Scenario {
    let given = |at_s, what| (at_s, Order::new(what, Who::only(vehicle_name(vehicle))));
    scenario.orders.extend([given(from_s, What::Hold), given(from_s + 10.0, What::Resume)]);
    scenario
}

/// When this vehicle has flown this share of its way by itself, in seconds.
fn flown_s(poses: &[Vec<Point>], vehicle: usize, share: f64) -> f64 {
    let way_m: Vec<f64> = poses
        .windows(2)
        .scan(0.0, |way_m, at| {
            *way_m += distance(&at[0][vehicle], &at[1][vehicle]);
            Some(*way_m)
        })
        .collect();
    let whole_m = way_m.last().unwrap();
    way_m.iter().position(|way_m| *way_m >= share * whole_m).unwrap() as f64 / 10.0
}

#[test]
fn who_is_held_on_the_way_is_waited_for_and_all_arrive_together() {
    let (lockstep, alone) = flown("valley");
    for (vehicle, share) in [(0, 0.3), (4, 0.65), (7, 0.79), (2, 0.79)] {
        // Before it lands, which is no part of the way.
        let unheld_s = arrivals_s(&lockstep.scenario, &alone, [vehicle])[0];
        let from_s = flown_s(&alone[..(unheld_s * 10.0) as usize], vehicle, share);
        let scenario = Scenario::built_in("valley", None, 1).unwrap();
        let (held, poses) = flown_in(Lockstep::of(holding(scenario, vehicle, from_s)));
        let times_s = arrivals_s(&held.scenario, &poses, 0..10);
        assert!(spread_s(&times_s) < 1.0, "{vehicle} held from {from_s} s on: {times_s:?}");
        assert!(times_s[vehicle] > unheld_s + 3.0, "it was held: {times_s:?}, not {unheld_s}");
    }
}

#[test]
fn without_the_ground_and_over_a_network_that_loses_messages_they_arrive_together() {
    let mut lockstep = Lockstep::new("valley", None, 1);
    lockstep.network.set_config(NetworkConfig { loss: 0.2, ..NetworkConfig::default() });
    lockstep.run_until(Duration::from_secs(40));
    let ground = lockstep.nodes[10].clone();
    lockstep.network.leave(&ground);
    let (lockstep, poses) = flown_in(lockstep);
    let times_s = arrivals_s(&lockstep.scenario, &poses, 0..10);
    assert!(
        times_s.iter().all(|time_s| *time_s > 1.0),
        "the ground leaves while all are on the way: {times_s:?}"
    );
    assert!(spread_s(&times_s) < 1.0, "{times_s:?}");
}

#[test]
fn who_is_lost_on_the_way_is_not_waited_for() {
    let (unlost, alone) = flown("valley");
    let mut lockstep = Lockstep::new("valley", None, 1);
    lockstep.run_until(Duration::from_secs_f64(flown_s(&alone, 0, 0.4)));
    let lost = lockstep.nodes[0].clone();
    lockstep.network.leave(&lost);
    let before_s = lockstep.swarm.now().as_secs_f64();
    let (lockstep, poses) = flown_in(lockstep);
    let times_s = arrivals_s(&lockstep.scenario, &poses, 1..10);
    assert!(spread_s(&times_s) < 1.0, "{times_s:?}");
    let last_s = before_s + times_s[0];
    let with_all_s = arrivals_s(&unlost.scenario, &alone, [1])[0];
    assert!(last_s < with_all_s + 1.0, "at {last_s} s, and at {with_all_s} s with the one that was lost");
}
