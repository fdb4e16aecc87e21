//! Missions into a scenario: who flies what, from where, and where each lands.

use nalgebra::Vector3;
use skein_agent::pipeline::perception::TALLEST_WINDOW_M;
use skein_agent::{Errand, PayloadCommand};
use skein_planning::airspace::KeepOut;
use skein_world::{Scene, VehicleModel};

use super::error::ScenarioError;
use super::layout::SPACING_M;
use super::placement::{REACH_M, clear_place, is_clear, way_is_clear};
use super::share::shared;
use super::{HULL_ROOM_M, SAME_PLACE_M, Scenario, VehiclePlan};
use crate::mission::write::Surroundings;
use crate::mission::{Ends, Mission, Payload, Waypoint};

/// Clearance of the straight line from a mission's own start or goal to the place a vehicle gets instead, in
/// metres.
const DETOUR_CLEARANCE_M: f64 = 1.0;
/// Distance of starts and goals from closed places, in metres: paths keep off them by less.
const OPEN_M: f64 = 1.5;
/// A mission may take so many times as long as its legs and stays, and so long for the rest, in seconds.
const TIME_TO_SPARE: f64 = 2.0;
const REST_S: f64 = 120.0;

/// Gives each vehicle its mission; a single one is flown by all in trail, and its surveys are shared.
///
/// In trail the vehicles stand 3 m behind one another before take-off, against the first leg's direction, and
/// land 3 m behind one another along the last leg, the first farthest. Places that are too near an obstacle,
/// the bounds or another vehicle's are moved to the nearest that are not, unless the mission is
/// [`exact`](Mission::exact), and noted. Bounds that nobody stated grow to hold the missions, and the time
/// limit to last for them.
///
/// # Errors
/// [`ScenarioError::MissionCount`] for several missions but fewer than vehicles; [`ScenarioError::NoRoom`].
pub fn apply_missions(scenario: &mut Scenario, missions: Vec<Mission>) -> Result<(), ScenarioError> {
    let vehicles = scenario.vehicles.len();
    let trail = missions.len() == 1;
    if !trail && missions.len() < vehicles {
        return Err(ScenarioError::MissionCount { missions: missions.len(), vehicles });
    }
    let own = match &missions[..] {
        [mission] => shared(mission, vehicles),
        _ => missions,
    };
    let assigned: Vec<&Mission> = own.iter().take(vehicles).collect();
    check_heights(&assigned)?;
    tune(scenario, &assigned);
    for (rank, (vehicle, mission)) in scenario.vehicles.iter_mut().zip(&assigned).enumerate() {
        let behind = if trail { rank as f64 * SPACING_M } else { 0.0 };
        let route: Vec<_> = mission.waypoints.iter().map(|w| w.position).collect();
        vehicle.start = mission.home - first_leg(mission) * behind;
        vehicle.waypoints = route;
        if let Some(model) = &mission.model {
            vehicle.model = VehicleModel::built_in(model)?;
        }
        let shares_goal = mission.waypoints.last().is_some_and(|last| last.scan.is_none());
        if mission.ends == Ends::Land
            && shares_goal
            && let Some(goal) = vehicle.waypoints.last_mut()
        {
            *goal -= last_leg(mission) * behind;
        }
    }
    set_errands(scenario, &assigned);
    scenario.include_routes();
    place_starts(scenario, &assigned)?;
    place_goals(scenario, &assigned)?;
    if assigned.iter().any(|mission| mission.exact) {
        keep_less(scenario);
    }
    for vehicle in &mut scenario.vehicles {
        let ahead = vehicle.waypoints.first().map_or(Vector3::x(), |first| first - vehicle.start);
        vehicle.yaw = ahead.y.atan2(ahead.x);
    }
    Ok(())
}

/// Where starts and goals are exactly where a mission puts them, vehicles keep no more than those are apart;
/// but some room between hulls.
fn keep_less(scenario: &mut Scenario) {
    let vehicles = &scenario.vehicles;
    let pairs =
        || vehicles.iter().enumerate().flat_map(|(k, one)| vehicles[..k].iter().map(move |two| (one, two)));
    let apart = |(one, two): (&VehiclePlan, &VehiclePlan)| {
        let places = [
            (one.start, two.start),
            (one.goal(), two.goal()),
            (one.goal(), two.start),
            (two.goal(), one.start),
        ];
        let distances = places.map(|(a, b)| (a - b).xy().norm()).into_iter();
        let least_m = distances.filter(|distance| *distance > SAME_PLACE_M).fold(f64::INFINITY, f64::min);
        let hulls_m = one.model.hull_radius_m + two.model.hull_radius_m;
        least_m.max(hulls_m + HULL_ROOM_M) / one.model.hull_radius_m.max(two.model.hull_radius_m)
    };
    scenario.separation_hulls = pairs().map(apart).fold(scenario.separation_hulls, f64::min);
}

/// Refuses heights that no vehicle's map spans, from where it takes off.
fn check_heights(missions: &[&Mission]) -> Result<(), ScenarioError> {
    let highest = missions.iter().flat_map(|mission| &mission.waypoints).map(|w| w.position.z);
    let highest_m = highest.fold(0.0, f64::max);
    if highest_m > TALLEST_WINDOW_M {
        return Err(ScenarioError::TooHigh { highest_m, limit_m: TALLEST_WINDOW_M });
    }
    Ok(())
}

/// Take-off height: the lowest that any mission asks for. Cruise speed: the fastest. Each leg has its own
/// below that.
fn tune(scenario: &mut Scenario, missions: &[&Mission]) {
    let lowest = missions.iter().filter_map(|m| m.takeoff_height_m).min_by(f64::total_cmp);
    scenario.takeoff_height_m = lowest.unwrap_or(scenario.takeoff_height_m);
}

/// Stays, speeds and commands on the way of each vehicle.
fn set_errands(scenario: &mut Scenario, missions: &[&Mission]) {
    let usual_m_s = scenario.cruise_speed_m_s;
    let speeds = missions.iter().flat_map(|mission| &mission.waypoints);
    let fastest_m_s = speeds.map(|w| w.speed_m_s.unwrap_or(usual_m_s)).fold(0.0, f64::max);
    if fastest_m_s > 0.0 {
        scenario.cruise_speed_m_s = fastest_m_s;
    }
    for (index, (vehicle, mission)) in scenario.vehicles.iter_mut().zip(missions).enumerate() {
        vehicle.errands = errands(mission, usual_m_s, fastest_m_s);
        let most_m_s = vehicle.model.max_speed_m_s;
        let asked_m_s = mission.waypoints.iter().filter_map(|w| w.speed_m_s).fold(0.0, f64::max);
        if asked_m_s > most_m_s {
            let number = index + 1;
            scenario.notes.push(format!(
                "vehicle {number}: its mission asks for {asked_m_s} m/s, it flies at most {most_m_s} m/s"
            ));
        }
    }
    let longest_s = missions.iter().map(|mission| lasts_s(mission, usual_m_s)).fold(0.0, f64::max);
    scenario.time_limit_s = scenario.time_limit_s.max(longest_s * TIME_TO_SPARE + REST_S);
}

/// What is done before each waypoint and before the landing, where something is.
fn errands(mission: &Mission, usual_m_s: f64, fastest_m_s: f64) -> Vec<Errand> {
    let waypoints = &mission.waypoints;
    let errand = |before: usize| {
        let stay_s = before.checked_sub(1).map_or(mission.delay_s, |at| waypoints[at].hold_s);
        // The way home is flown as the last leg was.
        let speed_m_s = waypoints.get(before).or(waypoints.last()).and_then(|w| w.speed_m_s);
        let speed_m_s = Some(speed_m_s.unwrap_or(usual_m_s)).filter(|speed| *speed < fastest_m_s);
        let payload = waypoints.get(before).map_or(&mission.last_payload, |waypoint| &waypoint.payload);
        Errand { before, stay_s, speed_m_s, payload: payload.iter().filter_map(command).collect() }
    };
    let is_one = |errand: &Errand| *errand != Errand { before: errand.before, ..Errand::default() };
    (0..=waypoints.len()).map(errand).filter(is_one).collect()
}

fn command(payload: &Payload) -> Option<PayloadCommand> {
    let command = u16::try_from(payload.command).ok()?;
    Some(PayloadCommand { command, params: payload.params })
}

/// The duration of a mission's legs and stays, in seconds.
fn lasts_s(mission: &Mission, usual_m_s: f64) -> f64 {
    let places = std::iter::once(mission.home).chain(mission.waypoints.iter().map(|w| w.position));
    let legs = mission
        .waypoints
        .iter()
        .zip(places)
        .map(|(to, from)| (to.position - from).norm() / to.speed_m_s.unwrap_or(usual_m_s) + to.hold_s);
    let last = mission.waypoints.last();
    let back_s = last.map_or(0.0, |w| (w.position - mission.home).norm() / w.speed_m_s.unwrap_or(usual_m_s));
    legs.sum::<f64>() + back_s + mission.delay_s
}

impl Scenario {
    /// The mission that a vehicle flies, as a plan says it.
    pub fn mission_of(&self, vehicle: &VehiclePlan) -> Mission {
        let errand = |before: usize| vehicle.errands.iter().find(|errand| errand.before == before);
        let stay_s = |before: usize| errand(before).map_or(0.0, |errand| errand.stay_s);
        let told = |before: usize| {
            let commands = errand(before).map(|errand| &errand.payload[..]).unwrap_or_default();
            commands.iter().map(|one| Payload { command: one.command.into(), params: one.params }).collect()
        };
        let cruise_m_s = self.cruise_speed_m_s.min(vehicle.model.max_speed_m_s);
        let waypoint = |(index, position): (usize, &Vector3<f64>)| Waypoint {
            position: *position,
            hold_s: stay_s(index + 1),
            speed_m_s: Some(errand(index).and_then(|errand| errand.speed_m_s).unwrap_or(cruise_m_s)),
            payload: told(index),
            scan: None,
        };
        let returns = (vehicle.goal() - vehicle.start).xy().norm() < SAME_PLACE_M;
        let count = vehicle.waypoints.len();
        let flown = if returns { count.saturating_sub(1) } else { count };
        Mission {
            home: vehicle.start,
            waypoints: vehicle.waypoints.iter().take(flown).enumerate().map(waypoint).collect(),
            ends: if returns && flown > 0 { Ends::Return } else { Ends::Land },
            takeoff_height_m: Some(self.takeoff_height_m),
            delay_s: stay_s(0),
            last_payload: told(flown),
            ..Mission::default()
        }
    }

    /// Where on earth it is flown, within what, and where else vehicles may land.
    pub fn surroundings(&self) -> Surroundings<'_> {
        Surroundings { datum: self.scene.datum(), airspace: &self.airspace, rally: &self.rally }
    }
}

/// Whether the geofence and other zones leave a place free, with some room.
fn is_open(scenario: &Scenario) -> impl Fn(&Vector3<f64>) -> bool + use<> {
    let zones = KeepOut::new(scenario.airspace.clone(), OPEN_M, 0.0);
    move |place| zones.room_m(place) >= 0.0
}

/// Where a vehicle whose mission ends with a return lands: the nearest of its start and the rally points that
/// no other vehicle has.
fn returns_to(start: Vector3<f64>, from: Vector3<f64>, free: &mut Vec<Vector3<f64>>) -> Vector3<f64> {
    let away_m = |place: &Vector3<f64>| (place - from).xy().norm();
    let nearest = free.iter().enumerate().min_by(|a, b| away_m(a.1).total_cmp(&away_m(b.1)));
    match nearest.filter(|(_, place)| away_m(place) < away_m(&start)).map(|(index, _)| index) {
        Some(index) => free.swap_remove(index),
        None => start,
    }
}

fn place_starts(scenario: &mut Scenario, missions: &[&Mission]) -> Result<(), ScenarioError> {
    let height = scenario.takeoff_height_m;
    let (mut taken, open) = (Vec::new(), is_open(scenario));
    for (i, mission) in missions.iter().enumerate() {
        let Some(wanted) = scenario.vehicles.get(i).map(|v| v.start) else { continue };
        let anchor = Vector3::new(mission.home.x, mission.home.y, height);
        let place = if mission.exact {
            wanted
        } else {
            find(&scenario.scene, &wanted, &anchor, height, &taken, &open)
                .ok_or_else(|| no_room(i, "start", wanted))?
        };
        scenario.move_start(i, place);
        taken.push(place);
    }
    Ok(())
}

fn place_goals(scenario: &mut Scenario, missions: &[&Mission]) -> Result<(), ScenarioError> {
    let (mut taken, open) = (Vec::new(), is_open(scenario));
    let mut free = scenario.rally.clone();
    for (i, mission) in missions.iter().enumerate() {
        let Some(vehicle) = scenario.vehicles.get_mut(i) else { continue };
        if mission.ends == Ends::Return {
            let height = vehicle.waypoints.last().map_or(scenario.takeoff_height_m, |last| last.z);
            let from = vehicle.waypoints.last().copied().unwrap_or(vehicle.start);
            let end = returns_to(vehicle.start, from, &mut free);
            vehicle.waypoints.push(Vector3::new(end.x, end.y, height));
            continue;
        }
        let wanted = vehicle.goal();
        let anchor = mission.waypoints.last().map_or(wanted, |last| last.position);
        let place = if mission.exact {
            wanted
        } else {
            let is_off_starts = |place: &Vector3<f64>| scenario.is_off_starts(i, place) && open(place);
            find(&scenario.scene, &wanted, &anchor, wanted.z, &taken, is_off_starts)
                .ok_or_else(|| no_room(i, "goal", wanted))?
        };
        scenario.move_goal(i, place);
        taken.push(place);
    }
    Ok(())
}

/// A clear place near `wanted` that `accepts` likes, from which `anchor` is in plain sight if there is such a
/// one.
fn find(
    scene: &Scene,
    wanted: &Vector3<f64>,
    anchor: &Vector3<f64>,
    height_m: f64,
    taken: &[Vector3<f64>],
    accepts: impl Fn(&Vector3<f64>) -> bool,
) -> Option<Vector3<f64>> {
    let in_sight = |place: &Vector3<f64>| {
        let above = Vector3::new(place.x, place.y, height_m);
        way_is_clear(scene, &above, anchor, DETOUR_CLEARANCE_M)
    };
    let clear = |place: &Vector3<f64>| is_clear(scene, place, height_m) && accepts(place);
    clear_place(wanted, taken, |p| clear(p) && in_sight(p)).or_else(|| clear_place(wanted, taken, clear))
}

fn no_room(index: usize, what: &'static str, near: Vector3<f64>) -> ScenarioError {
    ScenarioError::NoRoom { vehicle: index + 1, what, near, reach_m: REACH_M }
}

/// Direction over ground from home to the first waypoint away from it; east where there is none.
fn first_leg(mission: &Mission) -> Vector3<f64> {
    let places = mission.waypoints.iter().map(|w| w.position);
    places.map(|place| level(place - mission.home)).find(|d| *d != Vector3::zeros()).unwrap_or(Vector3::x())
}

/// Direction over ground in which the goal is reached; that of the first leg where there is no other.
fn last_leg(mission: &Mission) -> Vector3<f64> {
    let goal = mission.waypoints.last().map_or(mission.home, |last| last.position);
    let before = mission.waypoints.iter().rev().skip(1).map(|w| w.position).chain([mission.home]);
    before.map(|place| level(goal - place)).find(|d| *d != Vector3::zeros()).unwrap_or(Vector3::x())
}

/// Unit vector over ground; zero for a way of less than a decimetre.
fn level(way: Vector3<f64>) -> Vector3<f64> {
    let ground = Vector3::new(way.x, way.y, 0.0);
    if ground.norm() < 0.1 { Vector3::zeros() } else { ground.normalize() }
}
