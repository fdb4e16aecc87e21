//! Scripts on flying vehicles, judged by how the vehicles move.

use std::time::Duration;

use skein_agent::Outcome;
use skein_bp::script::{Argument, Assignment, ScriptFile};
use skein_ground::{Answer, to_send};
use skein_sim::scenario::Scenario;
use skein_tests::Lockstep;
use skein_wire::{NetworkConfig, Order, SentScript, Who};

/// Files that a scenario names are those of the agent.
const BESIDE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../agent/scripts/test.toml");
const CURFEW: &str = include_str!("../../../agent/scripts/curfew.toml");

fn scenario(text: &str, seed: u64) -> Scenario {
    Scenario::from_toml(text, BESIDE, None, seed).unwrap()
}

fn seconds(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds)
}

fn position(lockstep: &Lockstep, index: usize) -> [f64; 3] {
    lockstep.swarm.simulation().vehicle(index).unwrap().motion.position.into()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Steps until the mission is over, and lets `look` look ten times a second.
fn fly(lockstep: &mut Lockstep, limit: Duration, mut look: impl FnMut(&mut Lockstep)) {
    let mut due = Duration::ZERO;
    while !(lockstep.swarm.is_over() && lockstep.swarm.is_grounded()) {
        lockstep.step();
        assert!(lockstep.swarm.now() < limit, "it is not over after {limit:?}");
        if lockstep.swarm.now() >= due {
            due += seconds(0.1);
            look(lockstep);
        }
    }
    let truth = lockstep.swarm.truth();
    assert_eq!((truth.collisions_obstacle, truth.collisions_vehicle), (0, 0));
    assert!(lockstep.swarm.outcomes().all(|outcome| outcome == Some(&Outcome::Complete)));
}

#[test]
fn a_patrol_goes_round_its_points_until_the_battery_is_down_to_its_level() {
    let text = r#"
        [[vehicle]]
        start_m = [0.0, 0.0]
        waypoints_m = [[0.0, -15.0, 3.0]]
        [[script]]
        file = "patrol.toml"
        with = { route = [[12.0, 0.0, 3.0], [12.0, 12.0, 3.0], [0.0, 12.0, 3.0]], min_percent = 95 }"#;
    let points = [[12.0, 0.0, 3.0], [12.0, 12.0, 3.0], [0.0, 12.0, 3.0]];
    let mut lockstep = Lockstep::of(scenario(text, 1));
    let (mut visited, mut left_with) = (Vec::new(), 1.0);
    fly(&mut lockstep, seconds(600.0), |lockstep| {
        let here = position(lockstep, 0);
        let near = points.iter().position(|point| distance(here, *point) < 1.2);
        if let Some(near) = near.filter(|near| visited.last() != Some(near)) {
            visited.push(near);
        }
        let agent = lockstep.swarm.agents().next().unwrap();
        if agent.scripts().next().is_some() {
            left_with = agent.status(lockstep.swarm.now()).battery;
        }
    });
    assert!(visited.len() >= 4, "{visited:?}");
    assert!(visited.iter().enumerate().all(|(index, visited)| index % 3 == *visited), "{visited:?}");
    assert!((0.93..=0.96).contains(&left_with), "it left with {left_with}");
}

const THROUGH: &str = r#"
    time_limit_s = 200.0
    [[vehicle]]
    start_m = [-25.0, 0.0]
    waypoints_m = [[25.0, 0.0, 3.0]]"#;

fn in_the_middle([x, y, _]: [f64; 3]) -> bool {
    x.abs() < 5.0 && y.abs() < 30.0
}

#[test]
fn a_curfew_keeps_a_vehicle_out_of_a_region_until_it_is_over() {
    let script = r#"
        [[script]]
        file = "curfew.toml"
        with = { min = [-5, -30, -10], max = [5, 30, 30], for_s = 60 }"#;
    for (text, is_kept_out) in [(format!("{THROUGH}{script}"), true), (THROUGH.to_owned(), false)] {
        let mut lockstep = Lockstep::of(scenario(&text, 2));
        let (mut entered, mut waited_s) = (None, 0.0);
        fly(&mut lockstep, seconds(200.0), |lockstep| {
            let here = position(lockstep, 0);
            if in_the_middle(here) {
                entered.get_or_insert(lockstep.swarm.now());
            } else if (-11.0..-5.0).contains(&here[0]) {
                waited_s += 0.1;
            }
        });
        let entered = entered.unwrap();
        assert_eq!(entered >= seconds(60.0), is_kept_out, "it flew in at {entered:?}");
        assert_eq!(waited_s > 20.0, is_kept_out, "it waited {waited_s} s near the region");
    }
}

fn curfew(for_s: f64) -> SentScript {
    let with = [
        ("min", Argument::Point([-5.0, -30.0, -10.0])),
        ("max", Argument::Point([5.0, 30.0, 30.0])),
        ("for_s", Argument::Number(for_s)),
    ];
    let script = ScriptFile::parse("curfew.toml", CURFEW).unwrap();
    let with = with.map(|(name, value)| (name.to_owned(), value)).into();
    to_send(&Assignment { script, with, called: None }).unwrap()
}

#[test]
fn a_script_reaches_a_flying_vehicle_over_a_bad_network_and_is_taken_back() {
    let mut lockstep = Lockstep::of(scenario(THROUGH, 3));
    lockstep.network.set_config(NetworkConfig {
        loss: 0.3,
        duplicate: 0.1,
        reorder: 0.1,
        ..NetworkConfig::default()
    });
    let vehicle = lockstep.nodes[0].clone();
    let who = || Who::only(vehicle.clone());
    let answer = |lockstep: &Lockstep, id: u64| {
        let record = lockstep.swarm.ground().orders().find(|record| record.id == id).unwrap();
        record.answers[&vehicle].clone()
    };
    lockstep.run_until(seconds(8.0));
    let sent = lockstep.swarm.order(&Order::load(who(), curfew(3600.0))).unwrap();
    lockstep.run_until(seconds(10.0));
    assert!(matches!(answer(&lockstep, sent), Answer::Acknowledged(_)), "{:?}", answer(&lockstep, sent));
    let again = lockstep.swarm.order(&Order::load(who(), curfew(1800.0))).unwrap();
    lockstep.run_until(seconds(60.0));
    assert!(matches!(answer(&lockstep, again), Answer::Refused(why) if why.contains("withdraw it first")));
    let state = lockstep.swarm.ground().roster().next().unwrap().1.unwrap();
    assert_eq!(state.scripts, ["curfew"]);
    assert!(position(&lockstep, 0)[0] < -5.0, "it is kept out");
    let back = lockstep.swarm.order(&Order::unload(who(), "curfew")).unwrap();
    let never_there = lockstep.swarm.order(&Order::unload(who(), "patrol")).unwrap();
    fly(&mut lockstep, seconds(120.0), |_| {});
    assert!(matches!(answer(&lockstep, back), Answer::Acknowledged(_)));
    assert!(
        matches!(answer(&lockstep, never_there), Answer::Refused(why) if why.contains("no script of this name"))
    );
    assert!(position(&lockstep, 0)[0] > 20.0);
}

/// A wall with one gate, and two vehicles on one side of it that both have to pass four times; the second is nearer.
fn gate(scripts: &str) -> Scenario {
    let walls = [(-9.5, "left"), (9.5, "right")].map(|(y, name)| {
        format!("[[obstacle]]\nname = \"{name}\"\ncentre_m = [0.0, {y}, 4.0]\nbox_m = [0.4, 16.0, 8.0]\n")
    });
    let vehicle = |x: f64, y: f64| {
        let to = |x: f64| format!("[{x:.1}, {y:.1}, 3.0]");
        let way = [14.0, -14.0, 14.0, -14.0].map(to).join(", ");
        format!("[[vehicle]]\nstart_m = [{x:.1}, {y:.1}]\nwaypoints_m = [{way}]\n")
    };
    let text = format!(
        "cruise_speed_m_s = 2.0\n[bounds]\nmin_m = [-22.0, -17.0, -1.0]\nmax_m = [22.0, 17.0, 7.5]\n{}{}{}{}{scripts}",
        walls[0],
        walls[1],
        vehicle(-18.0, -5.0),
        vehicle(-10.0, 5.0)
    );
    scenario(&text, 4)
}

/// Who passes the gate, in order.
fn passages(mut lockstep: Lockstep) -> Vec<usize> {
    let mut passed = Vec::new();
    let mut sides = [false; 2];
    fly(&mut lockstep, seconds(600.0), |lockstep| {
        for (index, was_east) in sides.iter_mut().enumerate() {
            let is_east = position(lockstep, index)[0] > 0.0;
            if is_east != std::mem::replace(was_east, is_east) {
                passed.push(index + 1);
            }
        }
    });
    passed
}

#[test]
fn two_vehicles_alternate_at_a_gate() {
    let script = |vehicle: usize, other: usize, goes_first: usize| {
        format!(
            "[[script]]\nfile = \"alternate.toml\"\nvehicles = [{vehicle}]\nwith = {{ other = \"uav/{other}\", \
             min = [-4, -6, -5], max = [4, 6, 20], goes_first = {goes_first} }}\n"
        )
    };
    let scripts = script(1, 2, 1) + &script(2, 1, 0);
    assert_eq!(passages(Lockstep::of(gate(&scripts))), [1, 2, 1, 2, 1, 2, 1, 2]);
    let left_alone = passages(Lockstep::of(gate("")));
    assert_eq!(left_alone.len(), 8);
    assert_eq!(left_alone[0], 2, "the nearer one passes first by itself");
}

#[test]
fn a_vehicle_follows_another_at_a_distance_until_that_lands() {
    let text = r#"
        cruise_speed_m_s = 2.0
        [[vehicle]]
        start_m = [-4.0, 0.0]
        waypoints_m = [[-4.0, -10.0, 3.0]]
        [[vehicle]]
        start_m = [0.0, 0.0]
        waypoints_m = [[30.0, 0.0, 3.0], [30.0, 30.0, 3.0], [0.0, 30.0, 3.0]]
        [[script]]
        file = "follow.toml"
        vehicles = [1]
        with = { leader = "uav/2", distance_m = 8 }"#;
    let mut lockstep = Lockstep::of(scenario(text, 5));
    let mut distances = Vec::new();
    let mut corner_m = f64::INFINITY;
    fly(&mut lockstep, seconds(300.0), |lockstep| {
        let (follower, leader) = (position(lockstep, 0), position(lockstep, 1));
        corner_m = corner_m.min(distance(follower, [30.0, 30.0, 3.0]));
        // Once both are on their way, and until the leader comes down.
        if leader[1] > 2.0 && distance(leader, [0.0, 30.0, leader[2]]) > 2.0 {
            distances.push(distance(leader, follower));
        }
    });
    let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
    let farthest = distances.iter().copied().fold(0.0, f64::max);
    assert!(distances.len() > 250, "{} looks", distances.len());
    assert!(nearest > 4.0 && farthest < 14.0, "it kept {nearest} to {farthest} m");
    assert!(corner_m < 6.0, "it flew the leader's way, {corner_m} m from its corner");
    let landed = position(&lockstep, 0);
    assert!(distance(landed, [-4.0, -10.0, 0.0]) < 1.5, "then its own: {landed:?}");
}
