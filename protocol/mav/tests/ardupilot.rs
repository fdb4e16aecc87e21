//! The companion in front of an ArduPilot: other numbers, other habits, nothing of PX4's.

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::messages::{
    ATTITUDE_QUATERNION_DATA, COMMAND_LONG_DATA, GPS_GLOBAL_ORIGIN_DATA, HEARTBEAT_DATA,
    LOCAL_POSITION_NED_DATA, MavAutopilot, MavCmd, MavFrame, MavMessage, MavParamType, PARAM_VALUE_DATA,
    SET_POSITION_TARGET_LOCAL_NED_DATA,
};
use skein_mav::{
    Address, Command, Companion, CompanionConfig, Datum, FlightMode, FrameReader, FrameWriter, MavEvent,
    ParameterValue, SetPoint,
};

const NOW: Duration = Duration::from_millis(100);

/// What an autopilot says.
fn say(companion: &mut Companion, write: impl FnOnce(&mut FrameWriter)) {
    let mut writer = FrameWriter::new(Address::autopilot(1));
    write(&mut writer);
    companion.receive(NOW, &writer.take());
}

/// What the companion has to say.
fn hear(companion: &mut Companion) -> Vec<MavMessage> {
    let mut reader = FrameReader::default();
    reader.push(&companion.take_output());
    std::iter::from_fn(|| reader.next_frame()).map(|frame| frame.message).collect()
}

fn heartbeat(custom_mode: u32) -> HEARTBEAT_DATA {
    HEARTBEAT_DATA { custom_mode, autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA, ..Default::default() }
}

/// A companion that knows its ArduPilot: GUIDED, level, nose north, four metres up.
fn companion() -> Companion {
    let datum = Datum::from_degrees(-35.363_262, 149.165_237, 584.0);
    let mut companion = Companion::new(CompanionConfig::new(1, datum));
    let origin = datum.place();
    say(&mut companion, |writer| {
        writer.write(&heartbeat(4));
        writer.write(&GPS_GLOBAL_ORIGIN_DATA {
            latitude: origin.latitude_e7(),
            longitude: origin.longitude_e7(),
            altitude: origin.height_mm(),
            ..Default::default()
        });
        writer.write(&LOCAL_POSITION_NED_DATA { z: -4.0, ..Default::default() });
        writer.write(&ATTITUDE_QUATERNION_DATA { q1: 1.0, ..Default::default() });
    });
    companion
}

fn command(companion: &mut Companion, command: Command) -> COMMAND_LONG_DATA {
    companion.command(NOW, command);
    let said = hear(companion);
    match &said[..] {
        [MavMessage::COMMAND_LONG(message)] => message.clone(),
        other => panic!("{other:?}"),
    }
}

fn set_point(companion: &mut Companion, wish: SetPoint) -> SET_POSITION_TARGET_LOCAL_NED_DATA {
    assert!(companion.set_point(NOW, wish));
    let said = hear(companion);
    match &said[..] {
        [MavMessage::SET_POSITION_TARGET_LOCAL_NED(message)] => message.clone(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn modes_have_arducopters_numbers() {
    let mut companion = companion();
    assert_eq!(companion.telemetry().mode, FlightMode::Offboard);
    for (wish, number) in
        [(Command::Offboard, 4.0), (Command::Return, 6.0), (Command::Land, 9.0), (Command::Hold, 17.0)]
    {
        let message = command(&mut companion, wish);
        assert_eq!(message.command, MavCmd::MAV_CMD_DO_SET_MODE);
        assert_eq!((message.param1, message.param2, message.param3), (1.0, number, 0.0), "{wish:?}");
    }
    for (number, mode) in [(6, FlightMode::Return), (9, FlightMode::Land), (0, FlightMode::Manual)] {
        say(&mut companion, |writer| writer.write(&heartbeat(number)));
        assert_eq!(companion.telemetry().mode, mode);
    }
}

#[test]
fn a_takeoff_counts_from_home_without_knowing_where_that_is() {
    let message = command(&mut companion(), Command::Takeoff { height_m: 3.0 });
    assert_eq!(message.command, MavCmd::MAV_CMD_NAV_TAKEOFF);
    assert_eq!((message.param4, message.param5, message.param6, message.param7), (0.0, 0.0, 0.0, 3.0));
}

#[test]
fn velocities_and_positions_have_the_masks_that_work() {
    let mut companion = companion();
    let yaw = Some(0.0);
    let message =
        set_point(&mut companion, SetPoint::Velocity { velocity: Vector3::new(1.0, 2.0, 0.5), yaw });
    // 3527 with the heading in use.
    assert_eq!(message.type_mask.bits(), 3527 & !1024);
    assert_eq!((message.vx, message.vy, message.vz), (2.0, 1.0, -0.5));
    assert_eq!(message.coordinate_frame, MavFrame::MAV_FRAME_LOCAL_NED);
    let position = Vector3::new(5.0, 6.0, 7.0);
    let message = set_point(&mut companion, SetPoint::Position { position, yaw });
    assert_eq!(message.type_mask.bits(), 3576 & !1024);
    assert!((Vector3::new(message.x, message.y, message.z) - Vector3::new(6.0, 5.0, -7.0)).norm() < 0.02);
}

#[test]
fn planar_wishes_become_full_velocities() {
    let mut companion = companion();
    for (z, climb) in [(5.0, 1.0), (3.5, -0.5), (50.0, 1.5), (-50.0, -1.5)] {
        let message = set_point(&mut companion, SetPoint::Planar { vx: 2.0, vy: 0.0, z, yaw: None });
        assert_eq!(message.type_mask.bits() & 0b111_111, 0b000_111, "all of the velocity and nothing else");
        assert_eq!((message.vx, message.vy), (0.0, 2.0));
        assert!((f64::from(message.vz) + climb).abs() < 0.02, "z {z}: {}", message.vz);
    }
}

#[test]
fn an_open_heading_is_kept_where_it_was() {
    let mut companion = companion();
    let stay = SetPoint::Velocity { velocity: Vector3::zeros(), yaw: None };
    let message = set_point(&mut companion, stay);
    assert_eq!(message.type_mask.bits() & 1024, 0);
    assert!(message.yaw.abs() < 1e-5, "north: {}", message.yaw);
    // A turn by a gust is not taken for a wish.
    say(&mut companion, |writer| {
        writer.write(&ATTITUDE_QUATERNION_DATA { q1: 0.9, q4: 0.4359, ..Default::default() });
    });
    assert!(set_point(&mut companion, stay).yaw.abs() < 1e-5);
}

#[test]
fn whole_parameters_are_cast_not_copied() {
    let mut companion = companion();
    companion.read_parameter("FS_GCS_ENABLE");
    companion.tick(NOW);
    say(&mut companion, |writer| {
        writer.write(&PARAM_VALUE_DATA {
            param_value: 5.0,
            param_id: "FS_GCS_ENABLE".into(),
            param_type: MavParamType::MAV_PARAM_TYPE_INT8,
            ..Default::default()
        });
    });
    let read = MavEvent::ParameterRead { name: "FS_GCS_ENABLE".into(), value: ParameterValue::Int(5) };
    assert!(std::iter::from_fn(|| companion.poll_event()).any(|event| event == read));
}

#[test]
fn every_message_is_asked_for() {
    let mut companion = companion();
    let mut asked = Vec::new();
    for second in 1..20 {
        let now = Duration::from_secs(second);
        let mut writer = FrameWriter::new(Address::autopilot(1));
        writer.write(&heartbeat(4));
        companion.receive(now, &writer.take());
        // Never answered: it is asked again and again, and each message gets its turn.
        for tick in 0..50 {
            companion.tick(now + tick * Duration::from_millis(20));
            for message in hear(&mut companion) {
                if let MavMessage::COMMAND_LONG(command) = message {
                    asked.push((command.command as u32, command.param1 as u32));
                }
            }
        }
    }
    for wanted in [(511, 32), (511, 31), (511, 245), (511, 1), (511, 147), (512, 242)] {
        assert!(asked.contains(&wanted), "{wanted:?} is not in {asked:?}");
    }
}
