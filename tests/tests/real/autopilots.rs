//! Real autopilots in the simulated world, where `SKEIN_PX4` and `SKEIN_ARDUPILOT` name their programs.

use std::path::PathBuf;
use std::time::Duration;

use skein_agent::Outcome;
use skein_dbp::Happened;
use skein_mav::messages::{HEARTBEAT_DATA, MavMessage, MavModeFlag};
use skein_mav::{Address, Command, DIALECTS, Dialect, FlightMode, FrameReader, FrameWriter};
use skein_sim::autopilots::{Autopilots, Companions, make::Make};
use skein_sim::cli::{Network, Setup};
use skein_sim::processes::Processes;
use skein_sim::scenario::Scenario;
use skein_tests::{Lockstep, flight, fly};
use skein_wire::event::{Airborne, Declared as _, What};
use skein_wire::{Order, Who};

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

/// The world here, and each node in a process of its own, in real time.
fn flies_as_processes(autopilots: &Autopilots, port_offset: u16) {
    let _turn = turn();
    let folder = tempfile::tempdir().unwrap();
    let mut scenario = Scenario::built_in("antipodal", Some(2), 1).unwrap();
    autopilots.assign(&mut scenario);
    let setup = Setup { network: Network::Peer, launch_on_order: false, port_offset, secure: false };
    let mut swarm = Processes::prepare(&scenario, folder.path(), setup, autopilots).unwrap();
    swarm.start_all().unwrap();
    while !swarm.world().is_over() {
        swarm.step();
        assert_eq!(swarm.ended(), None);
        let world = swarm.world();
        let is_late = world.simulation().now() > seconds(scenario.time_limit_s);
        assert!(!is_late, "{:?}", [0, 1].map(|index| world.heard(index)));
    }
    let account = swarm.world().account();
    assert!(account.outcomes.iter().all(|outcome| *outcome == Some(Outcome::Complete)));
    let truth = swarm.world().simulation().truth();
    assert_eq!((truth.collisions_obstacle, truth.collisions_vehicle), (0, 0));
    swarm.end();
}

#[test]
fn px4s_fly_with_agents_in_processes_of_their_own() {
    let Some(px4) = program("SKEIN_PX4") else { return };
    let autopilots = Autopilots { autopilot: Some(Make::Px4), px4: Some(px4), ..Autopilots::default() };
    flies_as_processes(&autopilots, 0);
}

#[test]
fn arducopters_fly_with_agents_in_processes_of_their_own() {
    let Some(ardupilot) = program("SKEIN_ARDUPILOT") else { return };
    let autopilots =
        Autopilots { autopilot: Some(Make::Ardupilot), ardupilot: Some(ardupilot), ..Autopilots::default() };
    flies_as_processes(&autopilots, 4900);
}

/// Two vehicles that swap places, of which the first is watched.
struct Watched {
    lockstep: Lockstep,
    reader: FrameReader,
    /// The newest heartbeat of its autopilot.
    heartbeat: Option<HEARTBEAT_DATA>,
    lifted_off: Option<Duration>,
    airborne: Option<Duration>,
    _folder: tempfile::TempDir,
}

impl Watched {
    fn on(autopilots: &Autopilots) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut scenario = Scenario::built_in("antipodal", Some(2), 1).unwrap();
        autopilots.assign(&mut scenario);
        let mut lockstep = Lockstep::of(scenario.clone());
        lockstep
            .swarm
            .seat(|simulation| autopilots.seat(simulation, &scenario, folder.path(), Companions::Here))
            .unwrap();
        let (reader, heartbeat, lifted_off, airborne) = (FrameReader::default(), None, None, None);
        Self { lockstep, reader, heartbeat, lifted_off, airborne, _folder: folder }
    }

    fn step(&mut self) -> Duration {
        let happenings = self.lockstep.step();
        let now = self.lockstep.swarm.now();
        self.reader.push(&happenings.mavlink[0]);
        while let Some(frame) = self.reader.next_frame() {
            if let (MavMessage::HEARTBEAT(heartbeat), 1) = (frame.message, frame.sender.component_id) {
                self.heartbeat = Some(heartbeat);
            }
        }
        let is_first = |happened: &&Happened| happened.home == self.lockstep.nodes[0];
        let mut own = happenings.selections.iter().filter(is_first);
        let is_airborne = own.any(|happened| Airborne::read(&happened.event).is_some());
        self.airborne = self.airborne.or(is_airborne.then_some(now));
        self.lifted_off = self.lifted_off.or(self.is_up().then_some(now));
        assert!(now < Duration::from_secs(400), "it goes on for ever");
        now
    }

    fn is_up(&self) -> bool {
        self.lockstep.swarm.simulation().vehicle(0).unwrap().airborne
    }

    fn dialect(&self) -> Option<&'static dyn Dialect> {
        let heartbeat = self.heartbeat.as_ref()?;
        DIALECTS.into_iter().find(|dialect| dialect.is_spoken_by(heartbeat))
    }

    fn mode(&self) -> FlightMode {
        let mode = self.dialect().zip(self.heartbeat.as_ref());
        mode.map_or(FlightMode::default(), |(dialect, heartbeat)| dialect.mode(heartbeat.custom_mode))
    }

    fn is_armed(&self) -> bool {
        let armed = MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
        self.heartbeat.as_ref().is_some_and(|heartbeat| heartbeat.base_mode.contains(armed))
    }

    /// A pilot's station holds the vehicle.
    fn hold(&mut self) {
        let mut message = self.dialect().unwrap().encode(Command::Hold, None).unwrap();
        (message.target_system, message.target_component) = (1, 1);
        let mut station = FrameWriter::new(Address { system_id: 255, component_id: 190 });
        station.write(&message);
        self.lockstep.swarm.send_mavlink(0, &station.take());
    }
}

/// The agent of the first is killed at each of these moments after its motors began to run, s.
fn lands_without_its_agent(autopilots: &Autopilots, moments_s: &[f64]) {
    let _turn = turn();
    for moment_s in moments_s {
        let mut flight = Watched::on(autopilots);
        let mut armed = None;
        while armed.is_none_or(|armed| flight.lockstep.swarm.now() < armed + seconds(*moment_s)) {
            let now = flight.step();
            armed = armed.or(flight.is_armed().then_some(now));
        }
        flight.lockstep.swarm.kill_agent(0);
        let killed = flight.lockstep.swarm.now();
        let mut goes_down = None;
        let down = loop {
            let since = flight.step() - killed;
            let is_down = !flight.is_armed() && !flight.is_up();
            if is_down || matches!(flight.mode(), FlightMode::Land | FlightMode::Return) {
                goes_down.get_or_insert(since);
            }
            if is_down || since > seconds(120.0) {
                break since;
            }
        };
        let make = autopilots.autopilot;
        println!(
            "{make:?} killed after {moment_s} s: comes down after {goes_down:?}, disarmed after {down:?}"
        );
        assert!(goes_down.is_some_and(|after| after <= seconds(6.0)), "{make:?}: {goes_down:?}");
        assert!(down <= seconds(120.0), "{make:?} is still armed, in mode {}", flight.mode());
        let truth = flight.lockstep.swarm.truth();
        assert_eq!((truth.collisions_obstacle, truth.collisions_vehicle), (0, 0));
    }
}

/// A phase of a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Climb,
    Way,
    /// After an order to return.
    Return,
    Landing,
}

/// A pilot holds the first vehicle so long after each phase began.
fn a_pilot_gets_it_at_once(autopilots: &Autopilots) {
    let _turn = turn();
    let climb = [0.2, 0.4, 0.6].map(|after_s| (Phase::Climb, after_s));
    let way = [1.0, 3.0, 5.0].map(|after_s| (Phase::Way, after_s));
    let home = [0.5, 1.5, 2.5].map(|after_s| (Phase::Return, after_s));
    let landing = [0.3, 0.8, 1.3].map(|after_s| (Phase::Landing, after_s));
    for (phase, after_s) in [climb, way, home, landing].concat() {
        let mut flight = Watched::on(autopilots);
        let (mut began, mut ordered) = (None, false);
        while began.is_none_or(|began| flight.lockstep.swarm.now() < began + seconds(after_s)) {
            let now = flight.step();
            if phase == Phase::Return && !ordered && flight.airborne.is_some_and(|up| now > up + seconds(4.0))
            {
                ordered = true;
                let home = Order::new(What::Return, Who::These(vec![flight.lockstep.nodes[0].clone()]));
                flight.lockstep.swarm.order(&home).unwrap();
                began = Some(now);
            }
            began = began.or(match phase {
                Phase::Climb => flight.lifted_off,
                Phase::Way => flight.airborne,
                Phase::Return => None,
                Phase::Landing => (flight.mode() == FlightMode::Land).then_some(now),
            });
        }
        flight.hold();
        let taken = flight.lockstep.swarm.now();
        let mut holds_since = None;
        while flight.lockstep.swarm.now() < taken + seconds(6.0) {
            let now = flight.step();
            if flight.mode() == FlightMode::Hold {
                holds_since.get_or_insert(now - taken);
            } else {
                assert_eq!(holds_since, None, "{phase:?}: it is taken back, to {}", flight.mode());
            }
        }
        let agent = flight.lockstep.swarm.agents().next().unwrap();
        let last = agent.last_set_point().map(|(at, ..)| at.saturating_sub(taken));
        let make = autopilots.autopilot;
        println!(
            "{make:?} {phase:?} {after_s} s: holds after {holds_since:?}, last set-point after {last:?}"
        );
        assert!(holds_since.is_some(), "{make:?} {phase:?}: {}", flight.mode());
        assert!(last.is_none_or(|last| last <= seconds(0.2)), "{make:?} {phase:?}: {last:?}");
    }
}

fn seconds(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds)
}

/// Before it has left the ground, in the climb, on the way, and near the other.
const MOMENTS_S: [f64; 8] = [0.2, 1.0, 2.0, 3.0, 6.0, 8.0, 10.0, 12.0];

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

#[test]
fn a_pilot_gets_a_built_in_autopilot_at_once_in_every_phase() {
    a_pilot_gets_it_at_once(&Autopilots::default());
}

#[test]
fn a_pilot_gets_a_px4_at_once_in_every_phase() {
    let Some(px4) = program("SKEIN_PX4") else { return };
    a_pilot_gets_it_at_once(&Autopilots {
        autopilot: Some(Make::Px4),
        px4: Some(px4),
        ..Autopilots::default()
    });
}

#[test]
fn a_pilot_gets_an_arducopter_at_once_in_every_phase() {
    let Some(ardupilot) = program("SKEIN_ARDUPILOT") else { return };
    let autopilots =
        Autopilots { autopilot: Some(Make::Ardupilot), ardupilot: Some(ardupilot), ..Autopilots::default() };
    a_pilot_gets_it_at_once(&autopilots);
}
