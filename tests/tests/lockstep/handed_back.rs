//! A vehicle that is handed back above its map or outside its fence comes back in by itself, and says so.

use std::time::Duration;

use nalgebra::Vector3;
use skein_agent::Outcome;
use skein_mav::messages::{COMMAND_LONG_DATA, MANUAL_CONTROL_DATA, MavCmd};
use skein_mav::{Address, FrameWriter};
use skein_sim::fly;
use skein_tests::Lockstep;
use skein_wire::event::{FoundAirborne, PathBlocked, WayBack, What};
use skein_wire::{Order, Who};

/// One vehicle that flies 60 m east.
const FIELD: &str = "time_limit_s = 300.0\n[bounds]\nmin_m = [-10.0, -10.0, -1.0]\nmax_m = [70.0, 10.0, 60.0]\n\
    [[vehicle]]\nstart_m = [0.0, 0.0]\nwaypoints_m = [[60.0, 0.0, 3.0]]\n";

/// The bytes of what a pilot's station says to this vehicle.
fn station(message: impl FnOnce(&mut FrameWriter)) -> Vec<u8> {
    let mut writer = FrameWriter::new(Address { system_id: 255, component_id: 190 });
    message(&mut writer);
    writer.take()
}

/// PX4's numbers of flight modes: the main one, and its part.
fn mode(main: f32, sub: f32) -> Vec<u8> {
    station(|writer| {
        writer.write(&COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_DO_SET_MODE,
            param1: 1.0,
            param2: main,
            param3: sub,
            target_system: 1,
            target_component: 1,
            ..Default::default()
        });
    })
}

const POSITION: (f32, f32) = (3.0, 0.0);
const HOLD: (f32, f32) = (4.0, 3.0);

struct Flight {
    lockstep: Lockstep,
    /// All that was selected, with when.
    events: Vec<(Duration, skein_bp::Event)>,
    steps: u64,
}

impl Flight {
    fn of(scenario: &str) -> Self {
        Self { lockstep: Lockstep::from_text(scenario), events: Vec::new(), steps: 0 }
    }

    fn place(&self) -> Vector3<f64> {
        self.lockstep.swarm.simulation().vehicle(0).unwrap().motion.position
    }

    fn step(&mut self) {
        let now = self.lockstep.swarm.now();
        let happened = self.lockstep.step().selections;
        self.events.extend(happened.into_iter().map(|happened| (now, happened.event)));
        self.steps += 1;
    }

    fn until(&mut self, what: &str, is_so: impl Fn(&Self) -> bool) {
        let deadline = self.lockstep.swarm.now() + Duration::from_secs(120);
        while !is_so(self) {
            assert!(self.lockstep.swarm.now() < deadline, "{what}: at {}", self.place());
            self.step();
        }
    }

    /// The sticks of a pilot who wants this velocity, 1 is as much as they give; ENU.
    fn sticks(&mut self, wanted: Vector3<f64>) {
        let attitude = self.lockstep.swarm.simulation().vehicle(0).unwrap().motion.attitude;
        let (_, _, yaw) = attitude.euler_angles();
        let body = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), -yaw) * wanted;
        let axis = |value: f64| (value.clamp(-1.0, 1.0) * 1000.0) as i16;
        let message = MANUAL_CONTROL_DATA {
            target: 1,
            x: axis(body.x),
            y: axis(-body.y),
            z: 500 + axis(body.z) / 2,
            ..Default::default()
        };
        self.lockstep.swarm.send_mavlink(0, &station(|writer| writer.write(&message)));
    }

    /// On its way, a pilot takes the vehicle, brings it to `to` and lets go of the sticks.
    fn is_flown_to(&mut self, to: Vector3<f64>) {
        self.until("it does not fly", |flight| flight.place().x > 20.0);
        self.lockstep.swarm.send_mavlink(0, &mode(POSITION.0, POSITION.1));
        let end = self.lockstep.swarm.now() + Duration::from_secs(120);
        while (self.place() - to).norm() > 0.7 {
            assert!(self.lockstep.swarm.now() < end, "the pilot is at {}", self.place());
            if self.steps.is_multiple_of(10) {
                self.sticks((to - self.place()) * 0.3);
            }
            self.step();
        }
        self.rests(2.0);
    }

    fn rests(&mut self, seconds: f64) {
        let end = self.lockstep.swarm.now() + Duration::from_secs_f64(seconds);
        while self.lockstep.swarm.now() < end {
            if self.steps.is_multiple_of(10) {
                self.sticks(Vector3::zeros());
            }
            self.step();
        }
    }

    fn order(&mut self, what: What) {
        self.lockstep.swarm.order(&Order::new(what, Who::All)).unwrap();
    }

    /// It is handed back, in the pilot's hand until the agent has it.
    fn is_handed_back(&mut self) -> Duration {
        self.order(What::HandBack);
        let at = self.lockstep.swarm.now();
        self.rests(1.5);
        at
    }

    fn ends(&mut self) -> Option<Outcome> {
        self.until("it does not land", |flight| {
            flight.lockstep.swarm.is_over() && flight.lockstep.swarm.is_grounded()
        });
        self.lockstep.swarm.outcomes().next().unwrap().cloned()
    }

    fn told_since<T: skein_wire::event::Declared>(&self, since: Duration) -> Vec<T> {
        let told = self.events.iter().filter(|(at, _)| *at >= since);
        told.filter_map(|(_, event)| T::read(event)).collect()
    }

    /// It has told that it goes back straight, where from, and that no path was blocked.
    fn has_told(&self, since: Duration, why: &str) {
        let back: Vec<WayBack> = self.told_since(since);
        assert!(back.first().is_some_and(|back| back.why.contains(why)), "{back:?}");
        let blocked = self.told_since::<PathBlocked>(since).len();
        assert!(blocked < 3, "`path_blocked` {blocked} times");
    }

    fn collisions(&self) -> u32 {
        self.lockstep.swarm.truth().collisions_obstacle
    }
}

#[test]
fn handed_back_above_its_map_it_comes_straight_down_and_goes_on() {
    let mut flight = Flight::of(FIELD);
    let above = Vector3::new(22.0, 2.0, 34.0);
    flight.is_flown_to(above);
    let since = flight.is_handed_back();
    let from = flight.place();
    flight.until("it does not come down", |flight| {
        let off_m = (flight.place() - from).xy().norm();
        assert!(off_m < 1.0 || flight.place().z < 9.0, "it leaves its column: {}", flight.place());
        flight.place().z < 5.0
    });
    assert_eq!(flight.ends(), Some(Outcome::Complete));
    flight.has_told(since, "above its map");
    assert!((flight.place() - Vector3::new(60.0, 0.0, 0.0)).xy().norm() < 1.0, "{}", flight.place());
    assert_eq!(flight.collisions(), 0);
}

#[test]
fn handed_back_outside_its_fence_it_goes_back_in_and_home() {
    let mut flight = Flight::of(FIELD);
    flight.is_flown_to(Vector3::new(25.0, 30.0, 4.0));
    let since = flight.is_handed_back();
    let before = flight.collisions();
    flight.until("it does not go back in", |flight| {
        assert!((3.0..5.0).contains(&flight.place().z), "{}", flight.place());
        flight.place().y < 9.8
    });
    assert!((flight.place().x - 25.0).abs() < 1.0, "not by the nearest place: {}", flight.place());
    flight.ends();
    flight.has_told(since, "outside its fence");
    assert!(flight.place().xy().norm() < 1.0, "{}", flight.place());
    assert_eq!(flight.collisions(), before);
}

#[test]
fn what_stands_between_it_and_its_fence_it_goes_around() {
    let mut flight =
        Flight::of(&format!("{FIELD}[[obstacle]]\ncentre_m = [25.0, 18.0, 4.0]\nbox_m = [6.0, 1.0, 10.0]\n"));
    // The pilot goes around it.
    flight.is_flown_to(Vector3::new(40.0, 10.0, 4.0));
    flight.rests(0.5);
    let out = Vector3::new(40.0, 30.0, 4.0);
    let at = |flight: &Flight, to: Vector3<f64>| (flight.place() - to).norm() < 0.7;
    for to in [out, Vector3::new(25.0, 30.0, 4.0)] {
        while !at(&flight, to) {
            if flight.steps.is_multiple_of(10) {
                flight.sticks((to - flight.place()) * 0.3);
            }
            flight.step();
        }
    }
    flight.rests(2.0);
    let since = flight.is_handed_back();
    let before = flight.collisions();
    flight.ends();
    flight.has_told(since, "outside its fence");
    assert!(flight.place().xy().norm() < 1.0, "{}", flight.place());
    assert_eq!(flight.collisions(), before);
}

#[test]
fn handed_back_above_and_outside_it_goes_in_before_it_comes_down() {
    let mut flight = Flight::of(FIELD);
    flight.is_flown_to(Vector3::new(25.0, 22.0, 25.0));
    let since = flight.is_handed_back();
    flight.until("it does not go back in", |flight| {
        assert!(flight.place().y < 10.0 || flight.place().z > 23.0, "{}", flight.place());
        flight.place().z < 6.0
    });
    flight.ends();
    flight.has_told(since, "outside its fence and");
}

#[test]
fn an_agent_that_starts_above_its_map_holds_and_when_ordered_comes_straight_down() {
    let mut flight = Flight::of(FIELD);
    flight.is_flown_to(Vector3::new(22.0, 0.0, 34.0));
    let name = flight.lockstep.nodes[0].clone();
    flight.lockstep.swarm.kill_agent(0);
    flight.lockstep.swarm.send_mavlink(0, &mode(HOLD.0, HOLD.1));
    flight.rests(3.0);
    let config = fly::agent_configs(&flight.lockstep.scenario).remove(0);
    flight.lockstep.network.leave(&name);
    let link = Box::new(flight.lockstep.network.join(&name));
    let config = skein_agent::AgentConfig { incarnation: 2, ..config };
    let started = flight.lockstep.swarm.now();
    flight.lockstep.swarm.restart_agent(0, config, link).unwrap();
    flight.rests(10.0);
    assert_eq!(flight.told_since::<FoundAirborne>(started).len(), 1);
    assert!(flight.place().z > 33.0, "it does not hold: {}", flight.place());
    let from = flight.place();
    flight.order(What::Resume);
    flight.until("it does not come down", |flight| {
        assert!((flight.place() - from).xy().norm() < 1.0 || flight.place().z < 9.0, "{}", flight.place());
        flight.place().z < 5.0
    });
    flight.has_told(started, "above its map");
    assert_eq!(flight.ends(), Some(Outcome::Complete));
}
