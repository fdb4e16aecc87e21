//! The planners of routes beside references that are near the best there is, and beside the swarms of P3.

use nalgebra::{Vector2, Vector3};
use skein_lab::experiment::swarm_planning::baseline::Baseline;
use skein_planning::airspace::{Airspace, Mountain, NoFlyZone, ThreatZone};
use skein_swarm::route::{
    AnyAngleConfig, Effort, Plan, Planner, RouteCost, RouteError, RouteProblem, Traffic, any_angle,
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

/// A zone from the ground to the top across the direct way: the shortest way around it is two tangents and an arc.
#[test]
fn a_way_around_a_cylinder_is_nearly_as_short_as_it_can_be() {
    let (radius_m, half_m) = (300.0_f64, 1000.0_f64);
    let zone = NoFlyZone { centre: Vector2::new(1000.0, 1000.0), radius_m, floor_m: 0.0, ceiling_m: 1000.0 };
    let airspace = Airspace { no_fly: vec![zone], ..empty() };
    let tangent_m = (half_m * half_m - radius_m * radius_m).sqrt();
    let shortest_m = 2.0 * tangent_m + radius_m * (std::f64::consts::PI - 2.0 * (radius_m / half_m).acos());
    let ends = (Vector3::new(0.0, 1000.0, 300.0), Vector3::new(2000.0, 1000.0, 300.0));
    let traffic = Traffic::default();
    let mut problem = RouteProblem::new(&airspace, &traffic, RouteCost::default(), ends, WAYPOINTS).unwrap();
    let best = any_angle(&problem, &AnyAngleConfig::default()).unwrap();
    assert!(best.assessment.is_feasible());
    assert!((shortest_m..1.01 * shortest_m).contains(&best.assessment.length_m), "{:?}", best.assessment);
    for planner in [Planner::Onboard, Planner::Ground] {
        let plan = planner.plan(&mut problem, Effort::default(), 4);
        assert!(plan.assessment.is_feasible(), "{planner:?}");
        assert!(
            (shortest_m..1.04 * shortest_m).contains(&plan.assessment.length_m),
            "{planner:?}: {:?}",
            plan.assessment
        );
    }
}

#[test]
fn in_empty_air_the_best_way_is_straight() {
    let (airspace, traffic) = (empty(), Traffic::default());
    let ends = (Vector3::new(13.0, 77.0, 150.0), Vector3::new(1991.0, 1203.0, 420.0));
    let problem = RouteProblem::new(&airspace, &traffic, RouteCost::default(), ends, WAYPOINTS).unwrap();
    let best = any_angle(&problem, &AnyAngleConfig::default()).unwrap();
    assert!((best.assessment.length_m - (ends.1 - ends.0).norm()).abs() < 1e-6);
}

#[test]
fn nobody_is_sent_where_there_is_no_way() {
    let wall = |y: f64| NoFlyZone {
        centre: Vector2::new(1000.0, 100.0 * y),
        radius_m: 100.0,
        floor_m: -1.0,
        ceiling_m: 1001.0,
    };
    let airspace = Airspace { no_fly: (0..=20).map(|k| wall(f64::from(k))).collect(), ..empty() };
    let traffic = Traffic::default();
    let ends = (Vector3::new(0.0, 1000.0, 300.0), Vector3::new(2000.0, 1000.0, 300.0));
    let problem = RouteProblem::new(&airspace, &traffic, RouteCost::default(), ends, WAYPOINTS).unwrap();
    assert_eq!(any_angle(&problem, &AnyAngleConfig::default()), None);
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

#[test]
fn the_improved_swarms_beat_the_others_and_come_near_the_reference() {
    let total = |plans: &[Plan]| plans.iter().map(|plan| plan.assessment.cost_m).sum::<f64>();
    let by = |planner: Planner| fleet(|problem, seed| planner.plan(problem, Effort::default(), seed));
    let baseline = |swarm: Baseline| fleet(|problem, seed| swarm.plan(problem, Effort::default(), seed));
    let reference = total(&fleet(|problem, _| any_angle(problem, &AnyAngleConfig::default()).unwrap()));
    let (standard, constriction) =
        (total(&baseline(Baseline::STANDARD)), total(&baseline(Baseline::CONSTRICTION)));
    for planner in [Planner::Onboard, Planner::Ground] {
        let plans = by(planner);
        assert!(plans.iter().all(|plan| plan.assessment.is_feasible()), "{planner:?}");
        let found = total(&plans);
        assert!(found < 0.45 * standard, "{planner:?}: {found}, standard {standard}");
        assert!(found < constriction, "{planner:?}: {found}, constriction {constriction}");
        assert!(found < 1.05 * reference, "{planner:?}: {found}, reference {reference}");
    }
}
