//! MAVLink, at the ends of vehicles' programs, of autopilots, of other stations and of simulators.

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::simulator::{Px4Link, ardupilot::Servos};
use skein_mav::{
    Address, Command, Companion, CompanionConfig, Datum, FrameReader, SetPoint, Signing, SigningKey,
    SigningTime, Station,
};
use skein_world::{
    PositionErrors, Scene, Simulation, SimulationConfig, VehicleModel, VehicleSetup, WindConfig,
};

use crate::target::{Allowed, Reached, Target};

pub const TARGET: Target =
    Target { name: "mavlink", allowed: Allowed { bytes: 512 << 10, per_byte: 1000 }, read, seeds };

const TICK: Duration = Duration::from_millis(20);

fn datum() -> Datum {
    Datum::from_degrees(47.397742, 8.545594, 488.0)
}

fn read(input: &[u8]) -> Reached {
    let frames = frames(&[input]);
    let (front, back) = input.split_at(input.len() / 2);
    assert_eq!(frames, self::frames(&[front, back]), "the pieces in which bytes come change what is read");
    refuse_without_key(input);
    hear_as_companion(input);
    hear_as_autopilot(input);
    Station::of(1).hear(input);
    let mut link = Px4Link::new(datum());
    link.receive(input);
    while let Some(commands) = link.next_commands() {
        assert!(commands.motors.iter().all(|share| (0.0..=1.0).contains(share)));
    }
    let servos = Servos::read(input);
    if let Some(servos) = servos {
        assert!(servos.throttle.iter().all(|share| (0.0..=1.0).contains(share)));
    }
    match frames.is_empty() && servos.is_none() {
        true => Reached::Refused,
        false => Reached::read(frames.iter().any(|(sender, ..)| sender.component_id == 42)),
    }
}

/// Of each frame its sender, its number, and its message's.
fn frames(pieces: &[&[u8]]) -> Vec<(Address, u8, String)> {
    let mut reader = FrameReader::default();
    let mut frames = Vec::new();
    for piece in pieces {
        reader.push(piece);
        while let Some(frame) = reader.next_frame() {
            frames.push((frame.sender, frame.sequence, format!("{:?}", frame.message)));
        }
    }
    frames
}

/// A signed link hears nothing of who has not its key.
fn refuse_without_key(input: &[u8]) {
    let key = SigningKey::of_passphrase("nobody else has it");
    let mut reader = FrameReader::signed(&Signing {
        key,
        link_id: 0,
        refuses_unsigned: true,
        began: SigningTime::default(),
    });
    reader.push(input);
    assert_eq!(reader.next_frame(), None);
}

fn hear_as_companion(input: &[u8]) {
    let mut companion = Companion::new(CompanionConfig::new(1, datum()));
    let half = input.len() / 2;
    for (number, piece) in [&input[..half], &input[half..], input].into_iter().enumerate() {
        let now = TICK * (1 + number as u32);
        companion.receive(now, piece);
        companion.tick(now);
        companion.set_point(now, SetPoint::Velocity { velocity: Vector3::x(), yaw: None });
        while companion.poll_event().is_some() {}
    }
    companion.take_output();
}

fn a_world() -> Simulation {
    Simulation::new(SimulationConfig {
        scene: Scene::new("empty", Vec::new()),
        vehicles: vec![VehicleSetup {
            model: VehicleModel::built_in("x500").expect("it is built in"),
            position: Vector3::zeros(),
            yaw: 0.0,
            system_id: 1,
            position_errors: PositionErrors::default(),
        }],
        seed: 1,
        wind: WindConfig::default(),
    })
}

/// The built-in autopilot, on the ground.
fn hear_as_autopilot(input: &[u8]) {
    let mut world = a_world();
    world.step();
    world.send(0, input);
    (0..4).for_each(|_| world.step());
    let state = world.vehicle(0).expect("there is one");
    assert!(state.motion.position.iter().all(|part| part.is_finite()));
    world.receive(0);
}

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let mut world = a_world();
    let mut companion = Companion::new(CompanionConfig::new(1, datum()));
    let (mut said, mut heard) = (Vec::new(), Vec::new());
    for number in 1..60 {
        let now = TICK * number;
        companion.tick(now);
        if number == 40 {
            companion.command(now, Command::Arm);
            companion.read_parameter("MPC_XY_VEL_MAX");
        }
        if number > 40 {
            companion.set_point(now, SetPoint::Velocity { velocity: Vector3::x(), yaw: Some(0.5) });
        }
        let out = companion.take_output();
        world.send(0, &out);
        said.extend(out);
        (0..5).for_each(|_| world.step());
        let answer = world.receive(0);
        companion.receive(now, &answer);
        heard.extend(answer);
    }
    said.truncate(1500);
    heard.truncate(1500);
    let mut servos = vec![0; 40];
    servos[..2].copy_from_slice(&18_458_u16.to_le_bytes());
    servos[8..10].copy_from_slice(&1500_u16.to_le_bytes());
    vec![("companion", said), ("autopilot", heard), ("servos", servos)]
}
