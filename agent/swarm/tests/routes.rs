//! Routes through a known airspace: what they cost, and how good those are that the planners find.

use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;
use skein_planning::airspace::{Airspace, Mountain, ThreatZone};
use skein_swarm::assignment::assign;
use skein_swarm::route::{
    Effort, Plan, Planner, RouteCost, RouteError, RouteProblem, Traffic, arrival_slots, arrive_together,
    plan_in_turn,
};

const UPPER: Vector3<f64> = Vector3::new(2000.0, 2000.0, 1000.0);
const WAYPOINTS: usize = 10;

fn empty() -> Airspace {
    Airspace { upper: UPPER, ..Airspace::default() }
}

fn mountains() -> Airspace {
    let mountain =
        |x, y, height_m| Mountain { centre: Vector2::new(x, y), height_m, slope_m: Vector2::repeat(200.0) };
    let threat = |x, y, radius_m| ThreatZone { centre: Vector2::new(x, y), radius_m };
    Airspace {
        mountains: vec![mountain(500.0, 1500.0, 400.0), mountain(500.0, 500.0, 200.0)],
        threats: vec![
            threat(1000.0, 1000.0, 400.0),
            threat(500.0, 1200.0, 200.0),
            threat(1500.0, 500.0, 200.0),
        ],
        ..empty()
    }
}

fn points<const N: usize>(points: [[f64; 3]; N]) -> Vec<Vector3<f64>> {
    points.map(Vector3::from).to_vec()
}

#[test]
fn a_level_route_high_in_empty_air_costs_its_length_and_time() {
    let found = RouteCost::default().assess(
        &points([[0.0, 0.0, 300.0], [300.0, 400.0, 300.0], [300.0, 900.0, 300.0]]),
        &empty(),
        &Traffic::default(),
    );
    assert_eq!((found.length_m, found.time_s, found.cost_m), (1000.0, 50.0, 1250.0));
    assert!(found.is_feasible());
}

#[test]
fn a_climb_takes_as_long_as_the_rate_of_climb_allows() {
    let way = points([[0.0, 0.0, 200.0], [300.0, 0.0, 600.0]]);
    let found = RouteCost::default().assess(&way, &empty(), &Traffic::default());
    assert_eq!((found.length_m, found.time_s), (500.0, 50.0), "400 m at 8 m/s");
}

#[test]
fn low_flight_costs_by_the_square_of_what_the_clearance_lacks() {
    let cost = RouteCost::default();
    let at = |height| {
        cost.assess(&points([[0.0, 0.0, height], [1000.0, 0.0, height]]), &empty(), &Traffic::default())
    };
    assert_eq!(at(100.0).height_m, 0.0);
    assert!((at(50.0).height_m - 250.0).abs() < 1e-9);
    assert!(at(50.0).is_feasible() && at(30.0).is_feasible());
    assert!((at(29.0).violation_m - 1000.0).abs() < 1e-9);
}

#[test]
fn repulsion_is_the_papers_and_counts_at_equal_times_only() {
    let cost = RouteCost::default();
    let eastward = points([[0.0, 1000.0, 500.0], [2000.0, 1000.0, 500.0]]);
    let aside = |y| points([[0.0, y, 500.0], [2000.0, y, 500.0]]);
    let against = points([[2000.0, 1040.0, 500.0], [1100.0, 1040.0, 500.0]]);
    let among = |other: &[Vector3<f64>]| {
        let mut traffic = Traffic::default();
        traffic.add(other, &cost);
        (cost.assess(&eastward, &empty(), &traffic), traffic.separation_m(&eastward, &cost))
    };
    let (found, separation_m) = among(&aside(1040.0));
    let closeness = 1.0 / 40.0 - 1.0 / 60.0;
    assert!((found.repulsion_m - 0.5 * 1e4 * closeness * closeness * 2000.0).abs() < 1e-6);
    assert_eq!(separation_m, 40.0);
    assert_eq!(among(&aside(1060.0)).0.repulsion_m, 0.0);
    assert!(!among(&aside(1010.0)).0.is_feasible());
    let (found, separation_m) = among(&against);
    assert!(found.repulsion_m > 0.0, "they pass each other");
    assert!((separation_m - 40.0).abs() < 1e-9, "{separation_m}");
}

#[test]
fn the_reserve_costs_and_what_is_beyond_the_endurance_is_not_feasible() {
    let way = points([[0.0, 0.0, 200.0], [2000.0, 0.0, 200.0]]);
    let with = |endurance_s| {
        let cost = RouteCost { endurance_s, ..RouteCost::default() };
        cost.assess(&way, &empty(), &Traffic::default())
    };
    assert_eq!(with(125.0).reserve_used, 0.0, "100 s are 80 %");
    assert!((with(1000.0 / 9.0).reserve_used - 0.25).abs() < 1e-9, "90 % are half of the reserve");
    assert!(with(100.0).is_feasible() && !with(99.0).is_feasible());
}

#[test]
fn a_route_from_outside_is_refused() {
    let (airspace, traffic) = (empty(), Traffic::default());
    let outside = Vector3::new(-1.0, 0.0, 0.0);
    let found = RouteProblem::new(&airspace, &traffic, RouteCost::default(), (outside, UPPER), 5);
    assert_eq!(found.err(), Some(RouteError::Outside { which: "start", point: outside }));
    let found = RouteProblem::new(&airspace, &traffic, RouteCost::default(), (Vector3::zeros(), UPPER), 0);
    assert!(matches!(found, Err(RouteError::Space(_))));
}

/// Six vehicles, side by side, to two targets and among one another.
fn fleet(planner: impl Fn(&mut RouteProblem<'_>, u64) -> Plan) -> Vec<Plan> {
    let lane = |k: usize| {
        let y = 150.0 + 330.0 * k as f64;
        (Vector3::new(0.0, y, 100.0), Vector3::new(2000.0, 500.0 + 60.0 * k as f64, 400.0))
    };
    let ends: Vec<_> = (0..6).map(lane).collect();
    let plan =
        |vehicle, problem: &mut RouteProblem<'_>| Ok::<_, RouteError>(planner(problem, vehicle as u64));
    plan_in_turn(&mountains(), RouteCost::default(), &ends, WAYPOINTS, plan).unwrap()
}

/// Where a vehicle is, so many seconds after it set out along a route whose legs it flies so many times slower than
/// at cruise.
fn flown(route: &[Vector3<f64>], slowed: f64, mut seconds: f64, cost: &RouteCost) -> Vector3<f64> {
    for leg in route.windows(2) {
        let way = leg[1] - leg[0];
        let leg_s = (way.norm() / cost.cruise_m_s).max(way.z.abs() / cost.climb_m_s) * slowed;
        if seconds < leg_s {
            return leg[0] + way * (seconds / leg_s);
        }
        seconds -= leg_s;
    }
    route[route.len() - 1]
}

#[test]
fn vehicles_assigned_to_targets_get_there_together_and_apart() {
    let (airspace, cost) = (mountains(), RouteCost::default());
    let starts: Vec<_> = (0..6).map(|k| Vector3::new(0.0, 100.0 + 330.0 * f64::from(k), 120.0)).collect();
    let targets =
        [[2000.0, 300.0, 300.0], [2000.0, 1000.0, 500.0], [2000.0, 2000.0, 400.0]].map(Vector3::from);
    let west = |target: &Vector3<f64>| Vector3::new(0.0, target.y, target.z);
    let slots: Vec<_> =
        targets.iter().flat_map(|target| arrival_slots(target, &west(target), 2, 60.0, &airspace)).collect();
    let distance_m = |start: &Vector3<f64>| slots.iter().map(|slot| (slot - start).norm()).collect();
    let taken = assign(&starts.iter().map(distance_m).collect::<Vec<_>>()).unwrap();
    let ends: Vec<_> = starts.iter().zip(&taken).map(|(start, slot)| (*start, slots[*slot])).collect();
    let plans = plan_in_turn(&airspace, cost, &ends, WAYPOINTS, |vehicle, problem| {
        Ok::<_, RouteError>(Planner::Ground.plan(problem, Effort::default(), vehicle as u64))
    })
    .unwrap();

    let times_s: Vec<_> = plans.iter().map(|plan| plan.assessment.time_s).collect();
    let arrival = arrive_together(&times_s, 2.0);
    let at = |seconds: f64| -> Vec<_> {
        let paced = plans.iter().zip(&arrival.slowed);
        paced.map(|(plan, slowed)| flown(&plan.route, *slowed, seconds, &cost)).collect()
    };
    for (place, (_, goal)) in at(arrival.time_s + 1e-6).iter().zip(&ends) {
        assert!((place - goal).norm() < 1e-3, "{place} is not {goal}");
    }
    for (place, (_, goal)) in at(arrival.time_s - 1.0).iter().zip(&ends) {
        assert!((place - goal).norm() > 1.0, "too early at {goal}");
    }
    for tenth in 0..=(10.0 * arrival.time_s) as usize {
        let places = at(tenth as f64 / 10.0);
        for (k, one) in places.iter().enumerate() {
            for other in &places[..k] {
                assert!((one - other).norm() >= cost.least_separation_m, "{one} and {other}");
            }
        }
    }
}

#[test]
fn plans_converge_and_a_seed_gives_one_plan() {
    let by = |seed| {
        fleet(move |problem, _| {
            Planner::Onboard.plan(problem, Effort { particles: 10, generations: 9 }, seed)
        })
    };
    let plans = by(5);
    assert_eq!(plans, by(5));
    assert_ne!(plans, by(6));
    for plan in plans {
        assert_eq!(plan.convergence_m.len(), 9);
        assert!(plan.convergence_m.is_sorted_by(|before, after| before >= after));
        assert_eq!(plan.convergence_m.last(), Some(&plan.assessment.cost_m));
    }
}

proptest! {
    #[test]
    fn no_route_is_cheaper_than_the_straight_way_in_empty_air(
        ways in prop::collection::vec((0.0..2000.0_f64, 0.0..2000.0_f64, 0.0..1000.0_f64), 2..8),
    ) {
        let route: Vec<_> = ways.into_iter().map(|(x, y, z)| Vector3::new(x, y, z)).collect();
        let cost = RouteCost::default();
        let found = cost.assess(&route, &mountains(), &Traffic::default());
        let direct_m = (route[route.len() - 1] - route[0]).norm();
        prop_assert!(found.cost_m >= 1.25 * direct_m - 1e-9);
    }

    #[test]
    fn a_route_flown_the_other_way_costs_the_same(
        ways in prop::collection::vec((0.0..2000.0_f64, 0.0..2000.0_f64, 0.0..1000.0_f64), 2..8),
    ) {
        let mut route: Vec<_> = ways.into_iter().map(|(x, y, z)| Vector3::new(x, y, z)).collect();
        let cost = RouteCost { sample_m: 5.0, ..RouteCost::default() };
        let there = cost.assess(&route, &mountains(), &Traffic::default());
        route.reverse();
        let back = cost.assess(&route, &mountains(), &Traffic::default());
        prop_assert!((there.cost_m - back.cost_m).abs() < 1e-6 * there.cost_m);
    }
}

#[test]
fn energy_and_turns_cost_what_they_weigh_and_nothing_as_published() {
    let route = points([[0.0, 0.0, 200.0], [100.0, 0.0, 200.0], [100.0, 100.0, 240.0]]);
    let published = RouteCost::default();
    let assess = |cost: RouteCost| cost.assess(&route, &empty(), &Traffic::default());
    let (time_s, share) = (5.0 + 107.703_296 / 20.0, 1.0 / 600.0);
    let plain = assess(published);
    assert!((plain.energy - (time_s + 40.0 / 5.0) * share).abs() < 1e-9, "{plain:?}");
    assert!((plain.turning - 1.0).abs() < 1e-9, "a right angle seen from above");
    let weighed = assess(RouteCost { energy_weight_m: 600.0, smoothness_weight_m: 7.0, ..published });
    assert!((weighed.cost_m - plain.cost_m - 600.0 * plain.energy - 7.0).abs() < 1e-9);
}

#[test]
fn a_route_stays_inside_of_what_is_to_be_stayed_inside_of() {
    use skein_planning::airspace::{Area, StayInside};
    let yard = Area::round(Vector2::new(1000.0, 1000.0), 900.0);
    let airspace = Airspace { stay_inside: vec![StayInside { any_of: vec![yard] }], ..empty() };
    let ends = (Vector3::new(300.0, 1000.0, 100.0), Vector3::new(2000.0, 1000.0, 100.0));
    let traffic = Traffic::default();
    let problem = RouteProblem::new(&airspace, &traffic, RouteCost::default(), ends, 3).unwrap();
    let out = problem.judge(&[ends.0, ends.1]);
    assert!((out.violation_m - 100.0).abs() < 20.0, "it leaves at 1900 m: {out:?}");
    assert!(problem.judge(&[ends.0, Vector3::new(1800.0, 1000.0, 100.0)]).is_feasible());
}

#[test]
fn a_coarse_lattice_within_its_effort_finds_a_way_that_is_not_much_dearer_than_a_fine_one() {
    use skein_swarm::route::{AnyAngleConfig, any_angle};
    let (airspace, traffic) = (mountains(), Traffic::default());
    let ends = (Vector3::new(0.0, 950.0, 120.0), Vector3::new(2000.0, 1000.0, 580.0));
    let problem = RouteProblem::new(&airspace, &traffic, RouteCost::default(), ends, WAYPOINTS).unwrap();
    let coarse = any_angle(&problem, &AnyAngleConfig::within(&airspace, 3000, 1000)).unwrap();
    let fine = any_angle(&problem, &AnyAngleConfig::default()).unwrap();
    assert!(coarse.assessment.is_feasible());
    assert!(coarse.assessment.cost_m < 1.05 * fine.assessment.cost_m, "{coarse:?} beside {fine:?}");
}
