//! The simulator's ends, against what real autopilots sent and what their interfaces promise.

use std::f64::consts::FRAC_PI_2;
use std::time::Duration;

use mavlink::dialects::common::{
    HIL_ACTUATOR_CONTROLS_DATA, HIL_GPS_DATA, HIL_SENSOR_DATA, HilActuatorControlsFlags, MavMessage,
    MavModeFlag,
};
use nalgebra::{UnitQuaternion, Vector3};
use skein_mav::simulator::ardupilot::{Servos, answer};
use skein_mav::simulator::{Instruments, Motion, Px4Commands, Px4Link};
use skein_mav::{Address, Datum, FrameReader, FrameWriter};

/// The first that PX4 1.19 says on its simulator's link, and its first three answers, disarmed.
const PX4_BEGINS: [&str; 5] = [
    "fd1e00000001014c00000000e64200409c450000000000000000000000000000000000000000ff011904",
    "fd09000001010100000000000000000c0000039158",
    "fd5100000201015d000080de0f00000000000100000000000000000000000000000000000000000000000000000000000000\
     00000000000000000000000000000000000000000000000000000000000000000000000000000000013a64",
    "fd5100000301015d000020ee0f00000000000100000000000000000000000000000000000000000000000000000000000000\
     000000000000000000000000000000000000000000000000000000000000000000000000000000000160ca",
    "fd5100000401015d0000c0fd0f00000000000100000000000000000000000000000000000000000000000000000000000000\
     0000000000000000000000000000000000000000000000000000000000000000000000000000000001f66d",
];
/// The first packet of ArduCopter 4.6.2: all motors stand.
const ARDUCOPTER_BEGINS: &str =
    "1a48b00400000000e803e803e803e803e803e803e803e803e803e803e803e803e803e803e803e803";

fn bytes(hex: &str) -> Vec<u8> {
    (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
}

fn datum() -> Datum {
    Datum::from_degrees(47.397742, 8.545594, 488.0)
}

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn answers(link: &mut Px4Link) -> Vec<Px4Commands> {
    std::iter::from_fn(|| link.next_commands()).collect()
}

#[test]
fn what_px4_says_at_first_is_understood_in_whatever_pieces_it_comes() {
    let stream: Vec<u8> = PX4_BEGINS.iter().flat_map(|frame| bytes(frame)).collect();
    let disarmed = |at| Px4Commands { at, motors: [0.0; 4] };
    for piece in [1, 7, stream.len()] {
        let mut link = Px4Link::new(datum());
        let mut heard = Vec::new();
        for piece in stream.chunks(piece) {
            link.receive(piece);
            heard.extend(answers(&mut link));
        }
        // PX4's clock is a second ahead of the run's.
        assert_eq!(heard, [disarmed(ms(40)), disarmed(ms(44)), disarmed(ms(48))]);
    }
}

#[test]
fn motors_turn_only_when_px4_is_armed_and_by_shares() {
    let answer = |mode, controls: [f32; 5]| {
        let mut writer = FrameWriter::new(Address { system_id: 1, component_id: 1 });
        let flags = HilActuatorControlsFlags::HIL_ACTUATOR_CONTROLS_FLAGS_LOCKSTEP;
        let mut all = [0.0; 16];
        all[..5].copy_from_slice(&controls);
        writer.write(&HIL_ACTUATOR_CONTROLS_DATA { time_usec: 1_020_000, flags, controls: all, mode });
        let mut link = Px4Link::new(datum());
        link.receive(&writer.take());
        answers(&mut link)
    };
    let controls = [0.25, 0.5, -0.1, f32::NAN, 0.9];
    let armed = MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
    assert_eq!(answer(armed, controls), [Px4Commands { at: ms(20), motors: [0.25, 0.5, 0.0, 0.0] }]);
    let disarmed = MavModeFlag::MAV_MODE_FLAG_HIL_ENABLED;
    assert_eq!(answer(disarmed, controls)[0].motors, [0.0; 4]);
}

fn told(instruments: &Instruments) -> (HIL_SENSOR_DATA, Option<HIL_GPS_DATA>) {
    let mut link = Px4Link::new(datum());
    link.sense(ms(8), instruments);
    let mut reader = FrameReader::default();
    reader.push(&link.take_output());
    let frames: Vec<_> = std::iter::from_fn(|| reader.next_frame()).map(|frame| frame.message).collect();
    let sensor = frames.iter().find_map(|message| match message {
        MavMessage::HIL_SENSOR(data) => Some(data.clone()),
        _ => None,
    });
    let fix = frames.iter().find_map(|message| match message {
        MavMessage::HIL_GPS(data) => Some(data.clone()),
        _ => None,
    });
    (sensor.unwrap(), fix)
}

#[test]
fn px4_is_told_of_instruments_in_its_axes_and_which_are_new() {
    let quiet = Instruments {
        angular_rate: Vector3::new(0.1, 0.2, 0.3),
        specific_force: Vector3::new(1.0, 2.0, 9.81),
        magnetic_field: None,
        pressure_height_m: None,
        satellite: None,
    };
    let (sensor, fix) = told(&quiet);
    assert_eq!(sensor.time_usec, 1_008_000);
    assert_eq!([sensor.xgyro, sensor.ygyro, sensor.zgyro], [0.1, -0.2, -0.3]);
    assert_eq!([sensor.xacc, sensor.yacc, sensor.zacc], [1.0, -2.0, -9.81]);
    assert_eq!((sensor.fields_updated.bits(), fix), (0x3f, None));

    let full = Instruments {
        magnetic_field: Some(Vector3::new(0.21, 0.01, -0.42)),
        pressure_height_m: Some(12.0),
        satellite: Some([Vector3::new(100.0, 0.0, 20.0), Vector3::new(3.0, 4.0, 1.0)]),
        ..quiet
    };
    let (sensor, fix) = told(&full);
    assert_eq!(sensor.fields_updated.bits(), 0x3f | 0x1c0 | 0x1a00);
    assert_eq!([sensor.xmag, sensor.ymag, sensor.zmag], [0.21, -0.01, 0.42]);
    assert_eq!(sensor.pressure_alt, 500.0);
    // The standard atmosphere at 500 m.
    assert!((sensor.abs_pressure - 954.6).abs() < 0.2, "{}", sensor.abs_pressure);
    let fix = fix.unwrap();
    assert_eq!((fix.lat, fix.alt, fix.fix_type), (473_977_420, 508_001, 3));
    // 100 m to the east.
    assert!((f64::from(fix.lon - 85_455_940) * 1e-7 - 0.001_324).abs() < 1e-5, "{}", fix.lon);
    assert_eq!((fix.vn, fix.ve, fix.vd, fix.vel), (400, 300, -100, 500));
    assert_eq!(fix.cog, 3687);
}

#[test]
fn arducopters_packets_are_read_and_others_are_not() {
    let first = bytes(ARDUCOPTER_BEGINS);
    assert_eq!(Servos::read(&first), Some(Servos { frame: 0, throttle: [0.0; 4] }));
    let mut running = first.clone();
    running[4] = 7;
    running[8..16].copy_from_slice(&[0xdc, 5, 0xd0, 7, 0xe8, 3, 0, 0]);
    assert_eq!(Servos::read(&running), Some(Servos { frame: 7, throttle: [0.5, 1.0, 0.0, 0.0] }));
    assert_eq!(Servos::read(&first[..39]), None);
    let mut other = first;
    other[0] += 1;
    assert_eq!(Servos::read(&other), None);
}

#[test]
fn arducopter_is_told_of_motion_in_its_axes_in_one_line_without_blanks() {
    let motion = Motion {
        position: Vector3::new(1.0, 2.0, 3.0),
        velocity: Vector3::new(4.0, 5.0, 6.0),
        // Nose to the north.
        attitude: UnitQuaternion::from_euler_angles(0.0, 0.0, FRAC_PI_2),
        angular_rate: Vector3::new(0.1, 0.2, 0.3),
        specific_force: Vector3::new(0.0, 1.0, 9.81),
    };
    let line = answer(ms(1500), &motion, 16.0);
    assert!(line.ends_with("}\n") && !line.contains(' '), "{line}");
    let told: serde_json::Value = serde_json::from_str(&line).unwrap();
    assert_eq!(told["timestamp"], 1.5);
    assert_eq!(told["position"], serde_json::json!([2.0, 1.0, -3.0]));
    assert_eq!(told["velocity"], serde_json::json!([5.0, 4.0, -6.0]));
    assert_eq!(told["imu"]["gyro"], serde_json::json!([0.1, -0.2, -0.3]));
    assert_eq!(told["imu"]["accel_body"], serde_json::json!([0.0, -1.0, -9.81]));
    assert!((told["quaternion"][0].as_f64().unwrap() - 1.0).abs() < 1e-9, "{line}");
    assert_eq!((&told["battery"]["voltage"], &told["no_time_sync"]), (&16.0.into(), &1.into()));
}
