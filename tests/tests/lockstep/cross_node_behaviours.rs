//! What b-threads of one node do to those of another, judged by how the vehicles move.

use std::collections::BTreeMap;
use std::time::Duration;

use skein_agent::Outcome;
use skein_bp::Event;
use skein_dbp::{NodeName, facts::PeerLost};
use skein_tests::Lockstep;
use skein_wire::event::{Declared as _, Enter, GiveWay, Landed, Leave, Passage, Takeoff, What};
use skein_wire::{Order, Who};

fn seconds(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds)
}

fn fastest_m_s(lockstep: &Lockstep) -> f64 {
    let vehicle = |index| lockstep.swarm.simulation().vehicle(index);
    let speeds = (0..lockstep.scenario.vehicles.len())
        .filter_map(vehicle)
        .map(|state| state.motion.velocity.xy().norm());
    speeds.fold(0.0, f64::max)
}

#[test]
fn vehicles_take_off_one_after_another_at_the_grounds_request() {
    let mut lockstep = Lockstep::new("open", None, 1);
    let mut launched = Vec::new();
    while launched.len() < 4 && lockstep.swarm.now() < seconds(60.0) {
        for selection in lockstep.step().selections {
            if selection.event.kind() == Takeoff::NAME {
                let airborne = lockstep.swarm.simulation().vehicle(launched.len().saturating_sub(1));
                assert!(
                    launched.is_empty() || airborne.is_some_and(|state| state.airborne),
                    "the one before is up"
                );
                assert!(selection.requested_by.iter().any(|bthread| bthread.starts_with("ground/main#")));
                launched.push(selection.home.to_string());
            }
        }
    }
    assert_eq!(launched, ["uav/1", "uav/2", "uav/3", "uav/4"]);
}

/// A scenario in which the operator says these things, on lines of their own.
fn with_orders(orders: &str) -> Lockstep {
    let vehicle =
        |n: i32| format!("[[vehicle]]\nstart_m = [0.0, {0}.0]\nwaypoints_m = [[40.0, {0}.0, 3.0]]\n", 4 * n);
    let text = format!(
        "name = \"row\"\ntime_limit_s = 200.0\n[bounds]\nmin_m = [-10.0, -10.0, -1.0]\nmax_m = [60.0, 30.0, 15.0]\n{}{orders}",
        (0..4).map(vehicle).collect::<String>()
    );
    Lockstep::from_text(&text)
}

const LAUNCH: &str = "[[order]]\nat_s = 12.0\norder = \"launch_together\"\n";

#[test]
fn a_joint_launch_takes_everyone_off_at_once_and_not_before_all_are_ready() {
    let mut lockstep = with_orders(LAUNCH);
    let (mut decided, mut taken_off) = (None, BTreeMap::new());
    while taken_off.len() < 4 && lockstep.swarm.now() < seconds(60.0) {
        for selection in lockstep.step().selections {
            match selection.event.name() {
                "swarm/launch" => decided = Some(selection.at),
                name if name.ends_with(Takeoff::NAME) => {
                    taken_off.insert(selection.home.to_string(), lockstep.swarm.now());
                }
                _ => {}
            }
        }
    }
    let decided = decided.unwrap();
    assert!(decided >= seconds(12.0) && taken_off.len() == 4, "{taken_off:?}");
    assert!(taken_off.values().all(|at| *at >= decided && *at < decided + seconds(0.5)), "{taken_off:?}");
    lockstep.run_until(seconds(120.0));
    assert!(lockstep.swarm.outcomes().all(|outcome| outcome == Some(&Outcome::Complete)));
    assert_eq!(lockstep.swarm.truth().collisions_vehicle, 0);
}

#[test]
fn a_joint_launch_waits_for_a_vehicle_that_is_out_of_reach() {
    let mut lockstep = with_orders(LAUNCH);
    lockstep.run_until(seconds(11.0));
    let away = lockstep.nodes[2].clone();
    lockstep.network.partition(&[&[away]]);
    lockstep.run_until(seconds(20.0));
    assert!((0..4).all(|index| !lockstep.swarm.simulation().vehicle(index).unwrap().airborne));
    lockstep.network.heal();
    lockstep.run_until(seconds(25.0));
    assert!((0..4).all(|index| lockstep.swarm.simulation().vehicle(index).unwrap().airborne));
}

#[test]
fn a_joint_abort_lands_everyone_and_who_was_away_when_he_is_back() {
    let mut lockstep = with_orders(&format!("{LAUNCH}[[order]]\nat_s = 23.0\norder = \"abort\"\n"));
    // The last word of a vehicle counts for a while, so that this is decided just after it was cut off.
    lockstep.run_until(seconds(22.9));
    let away = lockstep.nodes[2].clone();
    lockstep.network.partition(&[&[away]]);
    lockstep.run_until(seconds(26.0));
    let landing = |lockstep: &Lockstep, index: usize| {
        lockstep.swarm.simulation().vehicle(index).unwrap().motion.velocity.xy().norm() < 0.5
    };
    assert!([0, 1, 3].into_iter().all(|index| landing(&lockstep, index)));
    assert!(!landing(&lockstep, 2), "it has not heard of it");
    lockstep.network.heal();
    lockstep.run_until(seconds(45.0));
    assert!(lockstep.swarm.is_grounded());
    let short = lockstep.swarm.simulation().vehicle(2).unwrap().motion.position.x;
    assert!(short < 38.0, "it flew to its goal");
}

#[test]
fn a_hold_stops_everyone_and_a_resume_lets_them_arrive() {
    let mut lockstep = Lockstep::new("open", None, 1);
    lockstep.run_until(seconds(14.0));
    assert!(fastest_m_s(&lockstep) > 1.0, "they fly");
    lockstep.swarm.order(&Order::new(What::Hold, Who::All)).unwrap();
    lockstep.run_until(seconds(18.0));
    for _ in 0..500 {
        lockstep.step();
        assert!(fastest_m_s(&lockstep) < 0.6, "held, at {:?}", lockstep.swarm.now());
    }
    lockstep.swarm.order(&Order::new(What::Resume, Who::All)).unwrap();
    lockstep.run_until(seconds(120.0));
    assert!(lockstep.swarm.outcomes().all(|outcome| outcome == Some(&skein_agent::Outcome::Complete)));
}

#[test]
fn a_hold_lapses_with_the_ground_station_that_wanted_it() {
    let mut lockstep = Lockstep::new("open", None, 1);
    lockstep.run_until(seconds(14.0));
    lockstep.swarm.order(&Order::new(What::Hold, Who::All)).unwrap();
    lockstep.run_until(seconds(18.0));
    lockstep.network.leave(&lockstep.nodes[4]);
    lockstep.run_until(seconds(120.0));
    assert!(lockstep.swarm.outcomes().all(|outcome| outcome == Some(&skein_agent::Outcome::Complete)));
}

#[test]
fn an_order_to_land_brings_everyone_down_at_once() {
    let mut lockstep = Lockstep::new("forest", None, 2);
    lockstep.run_until(seconds(20.0));
    lockstep.swarm.order(&Order::new(What::Land, Who::All)).unwrap();
    lockstep.run_until(seconds(35.0));
    assert!(lockstep.swarm.is_grounded());
    assert_eq!(lockstep.swarm.truth().collisions_vehicle, 0);
}

#[test]
fn an_order_to_return_brings_a_vehicle_home() {
    let mut lockstep = Lockstep::new("open", None, 2);
    lockstep.run_until(seconds(8.0));
    lockstep.swarm.order(&Order::new(What::Return, Who::only(lockstep.nodes[0].clone()))).unwrap();
    lockstep.run_until(seconds(120.0));
    assert!(lockstep.swarm.is_grounded());
    let place = lockstep.swarm.simulation().vehicle(0).unwrap().motion.position;
    let home = lockstep.scenario.vehicles[0].start;
    assert!((place - home).xy().norm() < 1.0, "landed at {place}, home is {home}");
}

/// A wall with one opening, and three vehicles on either side that want to be on the other.
fn doorway(width_m: f64) -> Lockstep {
    let jamb = |side: f64| {
        let (centre, length) = (side * (width_m / 2.0 + 6.0), 12.0);
        format!("[[obstacle]]\ncentre_m = [0.0, {centre:.2}, 4.0]\nbox_m = [0.4, {length:.1}, 10.0]\n")
    };
    let vehicle = |n: i32| {
        let (x, y) = (if n < 3 { -9.0 } else { 9.0 }, f64::from(n % 3 - 1) * 3.0);
        format!("[[vehicle]]\nstart_m = [{x:.1}, {y:.1}]\nwaypoints_m = [[{:.1}, {y:.1}, 2.0]]\n", -x)
    };
    let world = "name = \"doorway\"\ncruise_speed_m_s = 1.5\ntime_limit_s = 300.0\n\
         [bounds]\nmin_m = [-14.0, -12.0, -1.0]\nmax_m = [14.0, 12.0, 9.0]\n";
    Lockstep::from_text(&format!(
        "{world}{}{}{}",
        jamb(1.0),
        jamb(-1.0),
        (0..6).map(vehicle).collect::<String>()
    ))
}

#[test]
fn through_a_doorway_nobody_flies_against_another_and_all_arrive() {
    for width_m in [1.3, 1.6, 2.0] {
        let mut lockstep = doorway(width_m);
        let mut holders: BTreeMap<NodeName, Vec<Place>> = BTreeMap::new();
        let mut most = 0;
        while !(lockstep.swarm.is_over() && lockstep.swarm.is_grounded()) {
            for selection in lockstep.step().selections {
                watch(&mut holders, &selection.home, &selection.event);
                assert!(!share_a_passage(&holders), "{width_m} m: {holders:?} at {:?}", lockstep.swarm.now());
            }
            most = most.max(holders.len());
            assert!(lockstep.swarm.now() < seconds(290.0), "{width_m} m: they do not get through");
        }
        let outcomes = lockstep.swarm.outcomes().flatten();
        assert_eq!(outcomes.filter(|outcome| **outcome == Outcome::Complete).count(), 6, "{width_m} m");
        let truth = lockstep.swarm.truth();
        assert_eq!((truth.collisions_obstacle, truth.collisions_vehicle), (0, 0), "{width_m} m");
        assert!(most > 1, "{width_m} m: those who go the same way follow one another");
    }
}

/// Three blind corridors of 1.5 m that meet, and a vehicle at the end of each of two, which wants to the end of the other.
const JUNCTION: &str = r#"
name = "junction"
cruise_speed_m_s = 1.5
takeoff_height_m = 1.5
time_limit_s = 200.0

[bounds]
min_m = [-8.0, -2.0, -1.0]
max_m = [8.0, 8.0, 9.0]

[[obstacle]]
centre_m = [0.0, -1.25, 4.0]
box_m = [15.0, 1.0, 10.0]

[[obstacle]]
centre_m = [-4.125, 4.25, 4.0]
box_m = [6.75, 7.0, 10.0]

[[obstacle]]
centre_m = [4.125, 4.25, 4.0]
box_m = [6.75, 7.0, 10.0]

[[obstacle]]
centre_m = [0.0, 7.25, 4.0]
box_m = [1.5, 1.0, 10.0]

[[obstacle]]
centre_m = [-7.25, 0.0, 4.0]
box_m = [0.5, 1.5, 10.0]

[[obstacle]]
centre_m = [7.25, 0.0, 4.0]
box_m = [0.5, 1.5, 10.0]

[[vehicle]]
start_m = [-6.0, 0.0]
waypoints_m = [[6.0, 0.0, 1.5]]

[[vehicle]]
start_m = [6.0, 0.0]
waypoints_m = [[-6.0, 0.0, 1.5]]
"#;

#[test]
fn two_that_meet_at_a_junction_of_blind_corridors_let_one_another_pass() {
    let mut lockstep = Lockstep::from_text(JUNCTION);
    while !(lockstep.swarm.is_over() && lockstep.swarm.is_grounded()) {
        lockstep.step();
        assert!(lockstep.swarm.now() < seconds(60.0), "they stand before one another");
    }
    let outcomes = lockstep.swarm.outcomes().flatten();
    assert_eq!(outcomes.filter(|outcome| **outcome == Outcome::Complete).count(), 2);
    let truth = lockstep.swarm.truth();
    assert_eq!((truth.collisions_obstacle, truth.collisions_vehicle), (0, 0));
}

/// A narrow place that a vehicle has entered: metres, and its heading in degrees.
type Place = [f64; 4];

fn near(one: &Place, other: &Place, near_m: f64) -> bool {
    (0..2).all(|axis| (one[axis] - other[axis]).abs() <= near_m) && (one[2] - other[2]).abs() <= 2.2
}

/// Whether two go through one place against one another, or across.
fn against(one: &Place, other: &Place) -> bool {
    let turn = ((one[3] - other[3] + 540.0).rem_euclid(360.0) - 180.0).abs();
    near(one, other, 1.2) && turn > 61.0
}

fn share_a_passage(holders: &BTreeMap<NodeName, Vec<Place>>) -> bool {
    let all: Vec<_> = holders.values().collect();
    (1..all.len()).any(|index| {
        let is_shared =
            |place: &Place| all[..index].iter().any(|held| held.iter().any(|other| against(place, other)));
        all[index].iter().any(is_shared)
    })
}

fn entered(event: &Event) -> Place {
    let Enter { x, y, z, heading } = Enter::read(event).unwrap();
    [x, y, z, heading.unwrap()]
}

fn announced(event: &Event) -> Vec<Place> {
    let way = Passage::read(event).unwrap().way.unwrap();
    let place = |text: &str| {
        let numbers: Vec<f64> = text.split(' ').map(|word| word.parse().unwrap()).collect();
        Place::try_from(numbers).unwrap()
    };
    way.split("; ").map(place).collect()
}

/// Takes in what a vehicle enters and leaves behind.
fn watch(holders: &mut BTreeMap<NodeName, Vec<Place>>, home: &NodeName, event: &Event) {
    match event.kind() {
        Enter::NAME => {
            // Entered another way, it is not flown through the former.
            let held = holders.entry(home.clone()).or_default();
            held.retain(|place| !against(place, &entered(event)));
            held.push(entered(event));
        }
        Passage::NAME => {
            let left = announced(event);
            let is_left = |place: &Place| left.iter().any(|other| near(place, other, 0.9));
            if let Some(held) = holders.get_mut(home) {
                held.retain(is_left);
            }
        }
        GiveWay::NAME | Leave::NAME | Landed::NAME => drop(holders.remove(home)),
        _ => {}
    }
}

/// Flies `window` and cuts the network of its first vehicle at `cut`, for `apart`. Nobody may ever share the passage.
/// Returns whether it had a claim when it was cut off, and how many others passed meanwhile.
fn cut_one_off_at_the_window(seed: u64, cut: Duration, apart: Duration) -> (bool, usize) {
    let mut lockstep = Lockstep::new("window", None, seed);
    let (alone, rest) = (lockstep.nodes[0].clone(), lockstep.nodes[1..].to_vec());
    let mut holders: BTreeMap<NodeName, Vec<Place>> = BTreeMap::new();
    let (mut had_claim, mut through_meanwhile) = (false, 0);
    while !(lockstep.swarm.is_over() && lockstep.swarm.is_grounded()) {
        let now = lockstep.swarm.now();
        let is_cut = now >= cut && now < cut + apart;
        if is_cut {
            lockstep.network.partition(&[std::slice::from_ref(&alone), &rest]);
        } else {
            lockstep.network.heal();
        }
        for selection in lockstep.step().selections {
            watch(&mut holders, &selection.home, &selection.event);
            match selection.event.kind() {
                Leave::NAME => {
                    through_meanwhile += usize::from(is_cut && selection.home != alone);
                }
                PeerLost::NAME => {
                    had_claim |= PeerLost::read(&selection.event)
                        .is_some_and(|lost| lost.node == alone && !lost.released.is_empty());
                }
                _ => {}
            }
            assert!(!share_a_passage(&holders), "seed {seed}: {holders:?} at {now:?}");
        }
        assert!(now < seconds(300.0), "seed {seed}: they do not get through");
    }
    let truth = lockstep.swarm.truth();
    assert_eq!((truth.collisions_obstacle, truth.collisions_vehicle), (0, 0), "seed {seed}");
    // One that hovers before the passage for a minute, unheard, may be in another's way.
    let arrived =
        lockstep.swarm.outcomes().flatten().filter(|outcome| **outcome == Outcome::Complete).count();
    assert!(arrived == rest.len() || apart > seconds(10.0), "seed {seed}: {arrived} arrived");
    (had_claim, through_meanwhile)
}

#[test]
fn a_vehicle_that_is_cut_off_shares_no_passage_and_closes_none() {
    let mut without_claim = 0;
    for seed in 1..=8 {
        let cut = seconds(3.0 + 2.3 * seed as f64);
        let (had_claim, passed) = cut_one_off_at_the_window(seed, cut, seconds(60.0));
        // One that was about to enter, or inside, is waited for.
        assert!(had_claim || passed > 0, "seed {seed}: one that is cut off stops all the others");
        without_claim += usize::from(!had_claim);
        cut_one_off_at_the_window(seed, cut, seconds(3.0));
    }
    assert!((1..8).contains(&without_claim), "{without_claim} of 8 were cut off without a claim");
}
