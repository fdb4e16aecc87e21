//! The ground plans for the fleet in flight, and vehicles fly what it has planned.

use std::time::Duration;

use nalgebra::Vector3;
use skein_agent::Outcome;
use skein_ground::Answer;
use skein_ground::planning::{FleetPlan, plan};
use skein_tests::Lockstep;
use skein_wire::{Order, Route, Who};

/// Five that fly east, to arrive together; a threat stands on their way to the targets, and a hill.
const FIELD: &str = "time_limit_s = 180.0\narrive_together = true\n\
    [bounds]\nmin_m = [-10.0, -40.0, -1.0]\nmax_m = [100.0, 40.0, 30.0]\n\
    [[airspace.threat]]\ncentre_m = [45.0, 0.0]\nradius_m = 14.0\n\
    [[airspace.mountain]]\ncentre_m = [60.0, 25.0]\nheight_m = 9.0\nslope_m = [6.0, 6.0]\n\
    [[vehicle]]\nstart_m = [0.0, -20.0]\nwaypoints_m = [[25.0, -20.0, 4.0]]\n\
    [[vehicle]]\nstart_m = [0.0, -10.0]\nwaypoints_m = [[25.0, -10.0, 4.0]]\n\
    [[vehicle]]\nstart_m = [0.0, 0.0]\nwaypoints_m = [[25.0, 0.0, 4.0]]\n\
    [[vehicle]]\nstart_m = [0.0, 10.0]\nwaypoints_m = [[25.0, 10.0, 4.0]]\n\
    [[vehicle]]\nstart_m = [0.0, 20.0]\nwaypoints_m = [[25.0, 20.0, 4.0]]\n";
const TARGETS: [[f64; 3]; 2] = [[90.0, -10.0, 6.0], [90.0, 15.0, 6.0]];

/// They are on their way, and are sent what the ground plans for them.
fn sent() -> (Lockstep, FleetPlan) {
    let mut lockstep = Lockstep::from_text(FIELD);
    let place =
        |lockstep: &Lockstep, index| lockstep.swarm.simulation().vehicle(index).unwrap().motion.position;
    while (0..5).any(|index| place(&lockstep, index).x < 3.0) {
        assert!(lockstep.swarm.now() < Duration::from_secs(60), "they do not set out");
        lockstep.step();
    }
    let targets = TARGETS.map(Vector3::from).to_vec();
    let planned = plan(&lockstep.swarm.ground().survey(&Who::All, targets).unwrap()).unwrap();
    for journey in &planned.journeys {
        let route = Order::route(journey.node.clone(), journey.sent().unwrap());
        lockstep.swarm.order(&route).unwrap();
    }
    (lockstep, planned)
}

#[test]
fn what_the_ground_plans_in_flight_is_acknowledged_and_all_targets_are_reached_together() {
    let (mut lockstep, planned) = sent();
    assert_eq!((planned.journeys.len(), planned.encounters.len()), (5, 0), "{planned:?}");
    lockstep.run_until(lockstep.swarm.now() + Duration::from_secs(1));
    let orders = lockstep.swarm.ground().orders();
    let answers: Vec<_> = orders.flat_map(|order| order.answers.values()).collect();
    assert!(answers.iter().all(|answer| matches!(answer, Answer::Acknowledged(_))), "{answers:?}");
    let mut arrivals_s = vec![None; 5];
    while arrivals_s.iter().any(Option::is_none) {
        assert!(lockstep.swarm.now() < Duration::from_secs(170), "{arrivals_s:?}");
        lockstep.step();
        for (index, journey) in planned.journeys.iter().enumerate() {
            let at = lockstep.swarm.simulation().vehicle(index).unwrap().motion.position;
            assert!((at - Vector3::new(45.0, 0.0, 0.0)).norm() > 14.0, "{at} is in the threat");
            if (at - journey.route.last().unwrap()).norm() < 1.0 {
                arrivals_s[index].get_or_insert(lockstep.swarm.now().as_secs_f64());
            }
        }
    }
    let times_s: Vec<f64> = arrivals_s.into_iter().flatten().collect();
    let (first_s, last_s) =
        times_s.iter().fold((f64::MAX, 0.0_f64), |(low, high), t| (low.min(*t), high.max(*t)));
    assert!(last_s - first_s < 1.0, "{times_s:?}");
    for number in 0..2 {
        assert!(planned.journeys.iter().any(|journey| journey.targets == [number]));
    }
}

#[test]
fn what_a_vehicle_that_is_lost_was_to_visit_is_visited_by_another() {
    let (mut lockstep, planned) = sent();
    lockstep.run_until(lockstep.swarm.now() + Duration::from_secs(3));
    let lost = &planned.journeys[0];
    let place: Vector3<f64> = *lost.route.last().unwrap();
    lockstep.swarm.kill_agent(0);
    let mut nearest_m = f64::INFINITY;
    while lockstep.swarm.outcomes().skip(1).any(|outcome| outcome.is_none()) {
        assert!(lockstep.swarm.now() < Duration::from_secs(175), "they do not end their missions");
        lockstep.step();
        for index in 1..5 {
            let at = lockstep.swarm.simulation().vehicle(index).unwrap().motion.position;
            nearest_m = nearest_m.min((at - place).norm());
        }
    }
    assert!(nearest_m < 1.0, "nobody comes nearer than {nearest_m} m");
    assert!(lockstep.swarm.outcomes().skip(1).all(|outcome| outcome == Some(&Outcome::Complete)));
}

#[test]
fn who_loses_the_ground_finds_a_better_way_by_itself() {
    let (mut lockstep, _) = sent();
    let detour = Route::new(vec![[20.0, -38.0, 6.0], [90.0, -38.0, 6.0], [90.0, -14.0, 6.0]]).unwrap();
    lockstep.swarm.order(&Order::route(lockstep.nodes[0].clone(), detour.with_targets(&[2]))).unwrap();
    lockstep.run_until(lockstep.swarm.now() + Duration::from_secs(1));
    let task =
        |lockstep: &Lockstep| lockstep.swarm.agents().next().unwrap().status(lockstep.swarm.now()).task;
    assert!(task(&lockstep).ends_with("of the route by ground main"), "{}", task(&lockstep));
    let ground = lockstep.nodes[5].clone();
    lockstep.network.leave(&ground);
    lockstep.run_until(lockstep.swarm.now() + Duration::from_secs(3));
    assert!(task(&lockstep).ends_with("of the route by uav/1"), "{}", task(&lockstep));
}
