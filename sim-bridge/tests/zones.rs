//! Vehicles keep out of what is known to be closed: on their way, around what they had not known of, and on the way
//! home.

use nalgebra::Vector3;
use skein_agent::pipeline::global::{Found, PathFinder, Task};
use skein_agent::pipeline::layers::Layers;
use skein_agent::{AgentConfig, GlobalPlanner, LocalPlanner, Parts, Planners};
use skein_planning::Path;
use skein_planning::airspace::KeepOut;
use skein_planning::global::astar::PlanError;
use skein_planning::map::ClearanceMap;
use skein_sim::cli::Controller;
use skein_sim::fly::Trial;
use skein_sim::scenario::Scenario;
use skein_sim::summary::Summary;

const BOUNDS: &str = "
vehicles = 1
cruise_speed_m_s = 3.0
time_limit_s = 120.0

[bounds]
min_m = [-25.0, -20.0, -1.0]
max_m = [25.0, 20.0, 12.0]
";

/// A wall that is not known leaves two ways around it; the shorter leads through a zone, as the straight way does.
const DETOUR: &str = "
[[vehicle]]
start_m = [-20.0, 0.0]
waypoints_m = [[20.0, 0.0, 3.0]]

[[airspace.no_fly]]
centre_m = [-8.0, 0.0]
radius_m = 3.0

[[obstacle]]
centre_m = [4.0, 1.0, 3.0]
box_m = [1.0, 12.0, 6.0]

[[airspace.no_fly]]
corners_m = [[0.0, -5.5], [9.0, -5.5], [9.0, -16.0], [0.0, -12.0]]

[[airspace.threat]]
centre_m = [13.0, 0.0]
radius_m = 5.0
";

/// Two legs lead around a zone, behind which the operator orders the return.
const RETURN: &str = "
[[vehicle]]
start_m = [-15.0, 0.0]
waypoints_m = [[-8.0, 14.0, 3.0], [15.0, 3.0, 3.0], [15.0, -10.0, 3.0]]

[[airspace.no_fly]]
corners_m = [[-6.0, -9.0], [6.0, -9.0], [6.0, 7.0], [3.0, 7.0], [3.0, -3.0], [-3.0, -3.0], [-3.0, 7.0], [-6.0, 7.0]]

[[order]]
at_s = 23.0
order = \"return\"
";

/// The vehicle takes off in a zone, and comes back.
const INSIDE: &str = "
[[vehicle]]
start_m = [-12.0, 2.0]
waypoints_m = [[5.0, 0.0, 3.0], [15.0, 0.0, 3.0]]

[[airspace.no_fly]]
centre_m = [-12.0, 0.0]
radius_m = 5.0

[[order]]
at_s = 16.0
order = \"return\"
";

/// From one arm of an L to the other: the straight way leads over its notch.
const NOTCH: &str = "
[[vehicle]]
start_m = [-15.0, -12.0]
waypoints_m = [[15.0, -12.0, 3.0], [-15.0, 14.0, 3.0]]

[[airspace.stay_inside]]
any_of = [{ corners_m = [[-20, -18], [20, -18], [20, -6], [-9, -6], [-9, 18], [-20, 18]] }]
";

/// The vehicle takes off outside of where it is to stay.
const OUTSIDE: &str = "
[[vehicle]]
start_m = [-12.0, 2.0]
waypoints_m = [[15.0, 0.0, 3.0]]

[[airspace.stay_inside]]
any_of = [{ centre_m = [15.0, 0.0], radius_m = 9.0 }]
";

struct Flight {
    summary: Summary,
    /// Where the vehicle was in the air, tick by tick, and how far from the nearest zone, metres; negative inside.
    track: Vec<(Vector3<f64>, f64)>,
}

impl Flight {
    fn least_room_m(&self) -> f64 {
        self.track.iter().map(|(_, room_m)| *room_m).fold(f64::INFINITY, f64::min)
    }
}

fn knowing(_: &mut AgentConfig) {}

fn unknowing(agent: &mut AgentConfig) {
    agent.airspace = Default::default();
}

/// Flies, once the vehicle's configuration has been changed.
fn fly(world: &str, planners: Planners, change: fn(&mut AgentConfig)) -> Flight {
    let mut scenario = Scenario::from_toml(&format!("{BOUNDS}{world}"), "zones.toml", None, 1).unwrap();
    scenario.planners = planners;
    watch(Trial::new(&scenario, Controller::Bp).with_agents(change), &scenario)
}

fn watch(trial: Trial<'_>, scenario: &Scenario) -> Flight {
    let zones = KeepOut::new(scenario.airspace.clone(), 0.0, 0.0);
    let mut track = Vec::new();
    let flown = trial.fly(&mut |swarm, _| {
        let vehicle = swarm.simulation().vehicle(0).filter(|vehicle| vehicle.airborne);
        track.extend(vehicle.map(|vehicle| {
            let position = vehicle.motion.position;
            (position, zones.room_m(&position))
        }));
    });
    Flight { summary: flown.unwrap().summary, track }
}

#[test]
fn neither_the_straight_way_nor_a_detour_leads_through_a_zone() {
    let gentle = Planners { local: LocalPlanner::Vfh, ..Planners::default() };
    let repaired = Planners { global: GlobalPlanner::DstarLite, ..Planners::default() };
    for planners in [Planners::default(), gentle, repaired] {
        let flight = fly(DETOUR, planners, knowing);
        assert_eq!(flight.summary.reason, None, "{planners:?}");
        assert!(flight.least_room_m() > 0.25, "{planners:?}: the hull stays out, {}", flight.least_room_m());
    }
    assert!(
        fly(DETOUR, Planners::default(), unknowing).least_room_m() < -2.0,
        "without knowing it flies through"
    );
}

#[test]
fn the_way_home_leads_around_a_zone() {
    let flight = fly(RETURN, Planners::default(), knowing);
    assert!(flight.least_room_m() > 0.25, "{}", flight.least_room_m());
    let last = flight.track.last().unwrap().0;
    assert!((last.xy() - nalgebra::Vector2::new(-15.0, 0.0)).norm() < 1.0, "it is home: {last}");
    assert!(flight.track.iter().any(|(place, _)| place.x > 8.0), "it has been behind the zone");
    assert!(
        fly(RETURN, Planners::default(), unknowing).least_room_m() < -1.0,
        "without knowing it flies through"
    );
}

#[test]
fn who_stands_in_a_zone_leaves_it_by_the_shortest_way_and_lands_beside_it() {
    let flight = fly(INSIDE, Planners::default(), knowing);
    // From 3 m inside, and a metre of margin.
    let out = flight.track.iter().position(|(_, room_m)| *room_m > 0.0).unwrap();
    assert!((flight.track[out].0.xy() - flight.track[0].0.xy()).norm() < 4.0, "{}", flight.track[out].0);
    let clear = flight.track.iter().position(|(_, room_m)| *room_m > 0.5).unwrap();
    let back = flight.track[clear..].iter().map(|(_, room_m)| *room_m).fold(f64::INFINITY, f64::min);
    assert!(back > 0.25, "it does not come back into it: {back}");
    let (last, room_m) = flight.track.last().unwrap();
    assert!(*room_m < 3.0 && last.x < 0.0, "it lands next to it: {last}, {room_m} m away");
}

/// Goes straight to the waypoint, whatever the map knows of it.
#[derive(Debug)]
struct Straight;

impl PathFinder for Straight {
    fn begin(&mut self) {}

    fn advance(
        &mut self,
        task: &Task,
        _: &mut ClearanceMap,
        _: &mut usize,
    ) -> Option<Result<Found, PlanError>> {
        let path = Path::new(vec![task.start, task.goal]);
        path.map(|path| Ok(Found { path, clearance_m: None, is_level: false }))
    }
}

#[test]
fn who_follows_no_path_is_kept_out_by_the_filter() {
    let scenario = Scenario::from_toml(&format!("{BOUNDS}{DETOUR}"), "zones.toml", None, 1).unwrap();
    let flight = watch(
        Trial::new(&scenario, Controller::Bp).with_parts(|config| {
            let Parts { layers, mind, positioning } = Parts::of(config);
            Parts { layers: Layers { finder: Box::new(Straight), ..layers }, mind, positioning }
        }),
        &scenario,
    );
    assert!(flight.least_room_m() > 0.25, "the hull stays out, {}", flight.least_room_m());
    assert!(flight.least_room_m() < 3.0, "it does come near: {}", flight.least_room_m());
}

#[test]
fn a_leg_from_one_arm_of_a_fence_to_the_other_is_flown_round_inside() {
    let gentle = Planners { local: LocalPlanner::Vfh, ..Planners::default() };
    for planners in [Planners::default(), gentle] {
        let flight = fly(NOTCH, planners, knowing);
        assert_eq!(flight.summary.reason, None, "{planners:?}");
        assert!(flight.least_room_m() > 0.25, "{planners:?}: {}", flight.least_room_m());
    }
    assert!(fly(NOTCH, Planners::default(), unknowing).least_room_m() < -4.0, "else the way leads across");
}

#[test]
fn who_is_outside_of_where_it_is_to_stay_comes_back() {
    let flight = fly(OUTSIDE, Planners::default(), knowing);
    let why = flight.summary.reason.unwrap_or_default();
    assert!(why.contains("outside the geofence"), "{why}");
    let came_back = flight.track.iter().position(|(_, room_m)| *room_m > 1.0);
    let stays = came_back.is_some_and(|at| flight.track[at..].iter().all(|(_, room_m)| *room_m > 0.0));
    assert!(stays, "it lands where it may be: {:?}", flight.track.last());
}
