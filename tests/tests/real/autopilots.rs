//! Real autopilots in the simulated world, where `SKEIN_PX4` and `SKEIN_ARDUPILOT` name their programs.

use std::path::PathBuf;
use std::time::Duration;

use skein_dbp::Happened;
use skein_mav::messages::{HEARTBEAT_DATA, MavMessage, MavModeFlag};
use skein_mav::{DIALECTS, FlightMode, FrameReader};
use skein_sim::autopilots::{Autopilots, make::Make};
use skein_sim::scenario::Scenario;
use skein_tests::{Lockstep, flight, fly};
use skein_wire::event::{Airborne, Declared as _};

use crate::turn::turn;

/// The program that a variable names; says that the test is left out without one.
fn program(variable: &str) -> Option<PathBuf> {
    let named = std::env::var_os(variable).map(PathBuf::from);
    if named.is_none() {
        skein_tests::skipped(&format!("{variable}, the path of that autopilot's program"));
    }
    named
}

fn flies(scenario: &str, vehicles: usize, autopilots: Autopilots) {
    let _turn = turn();
    let mut flight = flight(scenario, 1);
    flight.world.overrides.vehicles = Some(vehicles);
    flight.autopilots = autopilots;
    let summary = fly(flight);
    assert!(summary.succeeded, "{:?}", summary.reason);
    assert_eq!((summary.collisions.obstacle, summary.collisions.vehicle), (0, 0));
    assert!(summary.min_separation_m.is_some_and(|apart_m| apart_m >= 1.4), "{:?}", summary.min_separation_m);
    assert_eq!(summary.trace_hash, None, "such a run does not replay");
}

#[test]
fn px4s_swap_places_across_a_circle() {
    let Some(px4) = program("SKEIN_PX4") else { return };
    flies("antipodal", 4, Autopilots { autopilot: Some(Make::Px4), px4: Some(px4), ..Autopilots::default() });
}

#[test]
fn arducopters_swap_places_across_a_circle() {
    let Some(ardupilot) = program("SKEIN_ARDUPILOT") else { return };
    let autopilots =
        Autopilots { autopilot: Some(Make::Ardupilot), ardupilot: Some(ardupilot), ..Autopilots::default() };
    flies("antipodal", 4, autopilots);
}

/// Two vehicles on their way; the agent of the first is killed at each of these moments after it began to fly it.
fn lands_without_its_agent(autopilots: &Autopilots, moments_s: &[f64]) {
    let _turn = turn();
    for moment_s in moments_s {
        let folder = tempfile::tempdir().unwrap();
        let mut scenario = Scenario::built_in("antipodal", Some(2), 1).unwrap();
        autopilots.assign(&mut scenario);
        let mut lockstep = Lockstep::of(scenario.clone());
        lockstep.swarm.seat(|simulation| autopilots.seat(simulation, &scenario, folder.path())).unwrap();
        let (mut reader, mut heard) = (FrameReader::default(), None);
        let (mut up, mut killed, mut goes_down) = (None, None, None);
        let told = loop {
            let happenings = lockstep.step();
            let now = lockstep.swarm.now();
            reader.push(&happenings.mavlink[0]);
            while let Some(frame) = reader.next_frame() {
                if let (MavMessage::HEARTBEAT(heartbeat), 1) = (frame.message, frame.sender.component_id) {
                    heard = Some(heartbeat);
                }
            }
            let is_up = lockstep.swarm.simulation().vehicle(0).unwrap().airborne;
            let is_first = |happened: &Happened| happened.home == lockstep.nodes[0];
            let mut own = happenings.selections.iter().filter(|happened| is_first(happened));
            up = up.or(own.any(|happened| Airborne::read(&happened.event).is_some()).then_some(now));
            if killed.is_none() && up.is_some_and(|up| now >= up + Duration::from_secs_f64(*moment_s)) {
                lockstep.swarm.kill_agent(0);
                killed = Some(now);
            }
            let since_s = killed.map_or(0.0, |killed| (now - killed).as_secs_f64());
            let (mode, armed) = heard.as_ref().map_or((FlightMode::default(), false), read);
            if since_s > 0.0 && matches!(mode, FlightMode::Land | FlightMode::Return) {
                goes_down.get_or_insert(since_s);
            }
            if since_s > 120.0 || (since_s > 0.0 && !armed && !is_up) {
                break format!(
                    "{:?}, {moment_s} s: {mode}, {since_s:.0} s later, armed: {armed}",
                    autopilots.autopilot
                );
            }
            assert!(now < Duration::from_secs(400), "it never took off");
        };
        println!("{told}, on its way down after {goes_down:?} s");
        assert!(goes_down.is_some_and(|after_s| after_s <= 6.0), "{told}: {goes_down:?}");
        assert!(told.ends_with("armed: false"), "{told}");
        let truth = lockstep.swarm.truth();
        assert_eq!((truth.collisions_obstacle, truth.collisions_vehicle), (0, 0), "{told}");
    }
}

/// The mode of a heartbeat, and whether the motors may turn.
fn read(heartbeat: &HEARTBEAT_DATA) -> (FlightMode, bool) {
    let dialect = DIALECTS.into_iter().find(|dialect| dialect.is_spoken_by(heartbeat));
    let mode = dialect.map_or(FlightMode::default(), |dialect| dialect.mode(heartbeat.custom_mode));
    (mode, heartbeat.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED))
}

/// At once, on the way, and near the other.
const MOMENTS_S: [f64; 5] = [0.1, 3.0, 5.0, 7.0, 9.0];

#[test]
fn a_built_in_autopilot_whose_agent_is_killed_lands() {
    lands_without_its_agent(&Autopilots::default(), &MOMENTS_S);
}

#[test]
fn a_px4_whose_agent_is_killed_lands() {
    let Some(px4) = program("SKEIN_PX4") else { return };
    let autopilots = Autopilots { autopilot: Some(Make::Px4), px4: Some(px4), ..Autopilots::default() };
    lands_without_its_agent(&autopilots, &MOMENTS_S);
}

#[test]
fn an_arducopter_whose_agent_is_killed_lands() {
    let Some(ardupilot) = program("SKEIN_ARDUPILOT") else { return };
    let autopilots =
        Autopilots { autopilot: Some(Make::Ardupilot), ardupilot: Some(ardupilot), ..Autopilots::default() };
    lands_without_its_agent(&autopilots, &MOMENTS_S);
}
