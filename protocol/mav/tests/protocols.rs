//! Commands, parameters, missions and telemetry between both ends, over links that lose datagrams.

use std::time::Duration;

use crate::lossy_link::{Pair, datum};
use nalgebra::Vector3;
use proptest::prelude::*;
use skein_mav::messages::{
    BATTERY_STATUS_DATA, COMMAND_LONG_DATA, MavCmd, MavFrame, MavParamType, PARAM_VALUE_DATA,
    SET_POSITION_TARGET_LOCAL_NED_DATA,
};
use skein_mav::{
    Address, AutopilotCommand, Command, CommandResult, Companion, CompanionConfig, FlightMode, FrameWriter,
    Landed, MavEvent, MissionError, MissionItem, ParameterValue, Request, SetPoint,
};

fn second() -> Duration {
    Duration::from_secs(1)
}

#[test]
fn telemetry_arrives_in_the_world_frame() {
    let mut pair = Pair::connected(0.0, 1);
    pair.run(second());
    let (sent, heard) = (pair.state.clone(), pair.companion.telemetry());
    let fresh = Duration::from_millis(100);
    assert!(heard.is_fresh(pair.now(), fresh));
    // The local origin is sent in steps of 1.1 cm.
    let position = heard.position.unwrap().value;
    assert!((position - sent.position.unwrap()).norm() < 0.02, "{position}");
    assert!((heard.velocity.unwrap().value - sent.velocity).norm() < 1e-5);
    assert!(heard.attitude.unwrap().value.angle_to(&sent.attitude) < 1e-5);
    assert!((heard.angular_rate.unwrap().value - sent.angular_rate).norm() < 1e-6);
    assert!((heard.home.unwrap() - sent.home.unwrap()).norm() < 0.02);
    let battery = heard.battery.unwrap().value;
    assert!((battery.fraction - 0.83).abs() < 1e-9 && (battery.voltage_v - 16.2).abs() < 1e-3);
    let [horizontal_m, vertical_m] = heard.position_sigma_m.unwrap().value;
    assert!((horizontal_m - 0.4).abs() < 1e-6 && (vertical_m - 0.7).abs() < 1e-6);
    assert_eq!(heard.has_gps_fix, Some(true));
    assert_eq!((heard.landed, heard.mode), (Landed::OnGround, FlightMode::Hold));
    assert!(heard.sensors_ok && heard.ready_to_arm && heard.connected && !heard.armed);
}

/// A companion that hears an autopilot tell these batteries, each by its id with its charge in per cent, one a second.
fn companion_told(batteries: &[(u8, i8)]) -> Companion {
    let mut autopilot = FrameWriter::new(Address { system_id: 3, component_id: 1 });
    let mut companion = Companion::new(CompanionConfig {
        system_id: 3,
        component_id: 191,
        datum: datum(),
        wants_measured: false,
        signing: None,
    });
    for (second, (id, battery_remaining)) in (0..).zip(batteries) {
        autopilot.write(&BATTERY_STATUS_DATA {
            id: *id,
            battery_remaining: *battery_remaining,
            voltages: [4000, 4000, 4000, 4000, u16::MAX, u16::MAX, u16::MAX, u16::MAX, u16::MAX, u16::MAX],
            ..Default::default()
        });
        companion.receive(Duration::from_secs(second), &autopilot.take());
    }
    companion
}

#[test]
fn of_several_batteries_the_worst_counts_as_of_when_all_were_known() {
    for (batteries, told) in [
        (&[][..], None),
        (&[(0, -1)], None),
        (&[(0, 80)], Some((0.8, 0))),
        (&[(0, 80), (1, 60)], Some((0.6, 0))),
        (&[(0, 80), (1, 60), (0, 79)], Some((0.6, 1))),
        (&[(0, 40), (1, 60), (1, 59), (0, 39)], Some((0.39, 2))),
        // Not known any more, of one: its last charge gets older.
        (&[(0, 80), (1, 60), (1, -1), (0, 79), (1, -1), (0, 78)], Some((0.6, 1))),
        (&[(0, 80), (0, 120), (0, -7)], Some((0.8, 0))),
        // One that never told its charge is no battery to wait for.
        (&[(0, 80), (1, -1), (0, 79)], Some((0.79, 2))),
    ] {
        let battery = companion_told(batteries).telemetry().battery;
        let heard = battery.map(|battery| (battery.value.fraction, battery.stamp.as_secs()));
        assert_eq!(heard, told, "{batteries:?}");
    }
}

#[test]
fn streams_come_at_the_rate_asked_for() {
    let mut pair = Pair::connected(0.0, 1);
    let mut stamps = Vec::new();
    for _ in 0..50 {
        pair.step();
        stamps.push(pair.companion.telemetry().position.unwrap().stamp);
    }
    stamps.dedup();
    assert!(stamps.len() >= 49, "{} of 50", stamps.len());
}

#[test]
fn a_slow_station_does_not_slow_the_companion_down() {
    let mut pair = Pair::connected(0.0, 1);
    let mut station = FrameWriter::new(Address { system_id: 255, component_id: 190 });
    station.write(&COMMAND_LONG_DATA {
        command: MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL,
        param1: 32.0,
        param2: 1e6,
        target_system: 3,
        target_component: 1,
        ..Default::default()
    });
    pair.endpoint.receive(pair.now(), &station.take());
    pair.run(second());
    let age = pair.companion.telemetry().position.unwrap().age(pair.now());
    assert!(age <= Duration::from_millis(20), "{age:?}");
}

#[test]
fn changes_of_mode_and_arming_are_told_at_once() {
    let mut pair = Pair::connected(0.0, 1);
    pair.state.mode = FlightMode::Land;
    pair.state.armed = true;
    pair.step();
    assert!(pair.events.contains(&MavEvent::ModeChanged { from: FlightMode::Hold, to: FlightMode::Land }));
    assert!(pair.events.contains(&MavEvent::ArmedChanged { armed: true }));
}

#[test]
fn a_lost_heartbeat_is_noticed_and_so_is_its_return() {
    let mut pair = Pair::connected(0.0, 1);
    pair.loss = 1.0;
    pair.run_until(|event| *event == MavEvent::HeartbeatLost);
    assert!(!pair.companion.telemetry().connected);
    pair.loss = 0.0;
    pair.run_until(|event| *event == MavEvent::HeartbeatRegained);
}

#[test]
fn commands_arrive_with_their_meaning() {
    let mut pair = Pair::connected(0.0, 1);
    let home_z = pair.state.home.unwrap().z;
    let now = pair.now();
    for command in [Command::Arm, Command::Takeoff { height_m: 3.0 }, Command::Offboard, Command::Disarm] {
        pair.companion.command(now, command);
        pair.run(Duration::from_millis(100));
        let acked = MavEvent::CommandAcked { command, result: CommandResult::Accepted };
        assert!(pair.events.contains(&acked), "{command:?}: {:?}", pair.events);
    }
    let [arm, takeoff, offboard, disarm] = pair.commands[..] else {
        panic!("{:?}", pair.commands);
    };
    assert_eq!(arm, AutopilotCommand::Arm { force: false });
    assert_eq!(offboard, AutopilotCommand::SetMode(FlightMode::Offboard));
    assert_eq!(disarm, AutopilotCommand::Disarm { force: false });
    let AutopilotCommand::Takeoff { z_m: Some(z) } = takeoff else {
        panic!("{takeoff:?}");
    };
    assert!((z - (home_z + 3.0)).abs() < 0.01, "{z}");
}

#[test]
fn a_refusal_is_told_with_its_kind() {
    let mut pair = Pair::connected(0.0, 1);
    pair.result = CommandResult::TemporarilyRejected;
    pair.companion.command(pair.now(), Command::Arm);
    pair.run(second());
    assert!(pair.events.contains(&MavEvent::CommandAcked {
        command: Command::Arm,
        result: CommandResult::TemporarilyRejected
    }));
}

#[test]
fn a_command_without_an_autopilot_is_refused_here() {
    let mut pair = Pair::new(0.0, 1);
    pair.companion.command(Duration::ZERO, Command::Arm);
    assert_eq!(
        pair.companion.poll_event(),
        Some(MavEvent::CommandAcked { command: Command::Arm, result: CommandResult::NoAutopilot })
    );
}

#[test]
fn a_dead_link_times_a_command_out_after_five_sends() {
    let mut pair = Pair::connected(0.0, 1);
    pair.loss = 1.0;
    pair.companion.command(pair.now(), Command::Arm);
    let start = pair.now();
    pair.run_until(|event| *event == MavEvent::CommandTimedOut { command: Command::Arm });
    let waited = pair.now() - start;
    assert!(waited >= second() && waited < 4 * second(), "{waited:?}");
    assert!(pair.commands.is_empty());
}

#[test]
fn a_lost_acknowledgement_does_not_repeat_the_command() {
    // The command is obeyed once, however often it has to be repeated for its acknowledgement.
    for seed in 0..50 {
        let mut pair = Pair::connected(0.5, seed);
        pair.companion.command(pair.now(), Command::Arm);
        pair.run_until(|event| {
            matches!(event, MavEvent::CommandAcked { .. } | MavEvent::CommandTimedOut { .. })
        });
        pair.run(3 * second());
        assert!(pair.commands.len() <= 1, "seed {seed}: {:?}", pair.commands);
    }
}

#[test]
fn a_newer_mode_command_overtakes_an_unanswered_one() {
    let mut pair = Pair::connected(0.0, 1);
    pair.loss = 1.0;
    pair.companion.command(pair.now(), Command::Offboard);
    pair.step();
    pair.loss = 0.0;
    pair.companion.command(pair.now(), Command::Land);
    pair.step();
    // It does not wait for the retry of the first, and the first is not sent again.
    assert_eq!(pair.commands, [AutopilotCommand::SetMode(FlightMode::Land)]);
    pair.run(2 * second());
    assert!(
        pair.events.contains(&MavEvent::CommandAcked {
            command: Command::Offboard,
            result: CommandResult::Cancelled
        })
    );
    assert!(
        pair.events
            .contains(&MavEvent::CommandAcked { command: Command::Land, result: CommandResult::Accepted })
    );
    assert!(pair.commands.iter().all(|it| *it == AutopilotCommand::SetMode(FlightMode::Land)));
}

#[test]
fn set_points_keep_their_axes() {
    let mut pair = Pair::connected(0.0, 1);
    let wishes = [
        SetPoint::Velocity { velocity: Vector3::new(1.0, -2.0, 0.5), yaw: Some(0.7) },
        SetPoint::Planar { vx: 0.25, vy: 1.5, z: 3.0, yaw: None },
        SetPoint::Position { position: Vector3::new(20.0, 5.0, 4.0), yaw: Some(-3.0) },
    ];
    for wish in wishes {
        assert!(pair.companion.set_point(pair.now(), wish));
        pair.step();
        let Some(Request::SetPoint { set_point, from }) = pair.other_requests.pop() else {
            panic!("no set-point");
        };
        assert_eq!((from.system_id, from.component_id), (3, 191));
        match (wish, set_point) {
            (SetPoint::Velocity { velocity: a, .. }, SetPoint::Velocity { velocity: b, .. })
            | (SetPoint::Position { position: a, .. }, SetPoint::Position { position: b, .. }) => {
                assert!((a - b).norm() < 0.02, "{a} {b}");
            }
            (SetPoint::Planar { vx, vy, z, .. }, SetPoint::Planar { vx: bx, vy: by, z: bz, .. }) => {
                assert!((vx - bx).abs() < 1e-6 && (vy - by).abs() < 1e-6 && (z - bz).abs() < 0.02);
            }
            other => panic!("{other:?}"),
        }
        match (wish.yaw(), set_point.yaw()) {
            (Some(a), Some(b)) => assert!((a - b).abs() < 1e-5),
            (None, None) => {}
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn a_set_point_with_a_hole_in_it_is_not_sent() {
    let mut pair = Pair::connected(0.0, 1);
    pair.companion.take_output();
    let broken = SetPoint::Velocity { velocity: Vector3::new(f64::NAN, 0.0, 0.0), yaw: None };
    assert!(!pair.companion.set_point(pair.now(), broken));
    assert!(pair.companion.take_output().is_empty());
}

#[test]
fn a_set_point_with_foreign_axes_is_not_taken() {
    let mut pair = Pair::connected(0.0, 1);
    let mut station = FrameWriter::new(Address { system_id: 3, component_id: 191 });
    station.write(&SET_POSITION_TARGET_LOCAL_NED_DATA {
        target_system: 3,
        target_component: 1,
        coordinate_frame: MavFrame::MAV_FRAME_BODY_FRD,
        ..Default::default()
    });
    pair.endpoint.receive(pair.now(), &station.take());
    pair.step();
    assert!(pair.other_requests.is_empty());
}

#[test]
fn parameters_are_read_and_written_by_name() {
    let mut pair = Pair::connected(0.0, 1);
    pair.companion.read_parameter("COM_OBL_RC_ACT");
    pair.companion.write_parameter("COM_OF_LOSS_T", ParameterValue::Real(1.5));
    pair.run(second());
    assert!(
        pair.events.contains(&MavEvent::ParameterRead {
            name: "COM_OBL_RC_ACT".into(),
            value: ParameterValue::Int(4)
        })
    );
    assert!(pair.events.contains(&MavEvent::ParameterRead {
        name: "COM_OF_LOSS_T".into(),
        value: ParameterValue::Real(1.5)
    }));
    assert_eq!(pair.endpoint.parameters().get("COM_OF_LOSS_T"), Some(1.5));
    assert!(pair.other_requests.contains(&Request::ParameterChanged { name: "COM_OF_LOSS_T" }));
}

#[test]
fn a_parameter_out_of_range_keeps_its_value_and_says_why() {
    let mut pair = Pair::connected(0.0, 1);
    pair.companion.write_parameter("MPC_XY_VEL_MAX", ParameterValue::Real(99.0));
    pair.run(second());
    assert!(pair.events.contains(&MavEvent::ParameterRead {
        name: "MPC_XY_VEL_MAX".into(),
        value: ParameterValue::Real(8.0)
    }));
    let told = |event: &MavEvent| matches!(event, MavEvent::Text(text) if text.text.contains("0 to 10"));
    assert!(pair.events.iter().any(told), "{:?}", pair.events);
}

#[test]
fn a_parameter_that_somebody_else_has_set_is_told_too() {
    let mut pair = Pair::connected(0.0, 1);
    let mut autopilot = FrameWriter::new(Address { system_id: 3, component_id: 1 });
    autopilot.write(&PARAM_VALUE_DATA {
        param_id: "COM_OF_LOSS_T".into(),
        param_value: 9.0,
        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        ..Default::default()
    });
    pair.companion.receive(pair.now(), &autopilot.take());
    pair.step();
    assert!(pair.events.contains(&MavEvent::ParameterRead {
        name: "COM_OF_LOSS_T".into(),
        value: ParameterValue::Real(9.0)
    }));
}

#[test]
fn a_parameter_that_is_not_there_is_reported_missing() {
    let mut pair = Pair::connected(0.0, 1);
    pair.companion.read_parameter("NO_SUCH");
    pair.companion.read_parameter("A_NAME_LONGER_THAN_SIXTEEN");
    for name in ["NO_SUCH", "A_NAME_LONGER_THAN_SIXTEEN"] {
        pair.run_until(|event| *event == MavEvent::ParameterMissing { name: name.into() });
    }
}

fn route(items: usize) -> Vec<MissionItem> {
    (0..items)
        .map(|index| {
            let position = Vector3::new(index as f64, -2.0 * index as f64, 5.0);
            MissionItem {
                // NaN would not compare equal.
                params: [index as f32, 0.5, 0.0, 90.0],
                z: 12.0,
                frame: MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
                ..MissionItem::waypoint(&datum(), &position, 0.0)
            }
        })
        .collect()
}

#[test]
fn a_waypoint_comes_back_to_its_place() {
    let position = Vector3::new(120.0, -35.0, 8.0);
    let item = MissionItem::waypoint(&datum(), &position, 2.0);
    assert!((item.position(&datum(), 0.0).unwrap() - position).norm() < 0.02);
    let mut relative = item;
    relative.frame = MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT;
    relative.z = 8.0;
    let home_height = 488.0;
    assert!((relative.position(&datum(), home_height).unwrap() - position).norm() < 0.02);
}

#[test]
fn an_item_that_cannot_be_flown_refuses_the_whole_mission() {
    let mut pair = Pair::connected(0.0, 1);
    let mut items = route(3);
    pair.companion.upload_mission(items.clone());
    pair.run_until(|event| *event == MavEvent::MissionUploaded);
    items[1].z = 1000.0;
    pair.companion.upload_mission(items);
    pair.run_until(|event| matches!(event, MavEvent::MissionFailed { error: MissionError::Refused(_) }));
    assert_eq!(pair.endpoint.mission(), route(3), "the old one stays in force");
}

#[test]
fn an_empty_mission_clears_and_is_read_back_empty() {
    let mut pair = Pair::connected(0.0, 1);
    pair.companion.upload_mission(route(2));
    pair.run_until(|event| *event == MavEvent::MissionUploaded);
    pair.events.clear();
    pair.companion.upload_mission(Vec::new());
    pair.run_until(|event| *event == MavEvent::MissionUploaded);
    assert!(pair.endpoint.mission().is_empty());
    pair.companion.download_mission();
    pair.run_until(|event| *event == MavEvent::MissionReceived { items: Vec::new() });
}

#[test]
fn a_transfer_over_a_dead_link_fails() {
    let mut pair = Pair::connected(0.0, 1);
    pair.companion.upload_mission(route(5));
    pair.step();
    pair.loss = 1.0;
    // Transfers stand still while the autopilot is away and go on when it is back, or fail.
    pair.run_until(|event| matches!(event, MavEvent::MissionFailed { .. } | MavEvent::HeartbeatLost));
    assert!(pair.endpoint.mission().is_empty());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn a_mission_survives_loss_both_ways(items in 0..25_usize, seed: u64, loss in 0.0..0.35_f64) {
        let mut pair = Pair::connected(loss, seed);
        pair.companion.upload_mission(route(items));
        pair.run_until(|event| *event == MavEvent::MissionUploaded);
        prop_assert_eq!(pair.endpoint.mission(), route(items));
        pair.companion.download_mission();
        pair.run_until(|event| *event == MavEvent::MissionReceived { items: route(items) });
    }

    #[test]
    fn parameters_survive_loss(seed: u64, loss in 0.0..0.3_f64) {
        let mut pair = Pair::connected(loss, seed);
        pair.companion.write_parameter("COM_OBL_RC_ACT", ParameterValue::Int(3));
        let done = pair.run_until(|event| matches!(
            event,
            MavEvent::ParameterRead { .. } | MavEvent::ParameterMissing { .. }
        ));
        if let MavEvent::ParameterRead { value, .. } = done {
            prop_assert_eq!(value, ParameterValue::Int(3));
            prop_assert_eq!(pair.endpoint.parameters().get("COM_OBL_RC_ACT"), Some(3.0));
        }
    }

    #[test]
    fn both_ends_shrug_off_random_bytes(
        noise in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..100), 1..30),
    ) {
        let mut pair = Pair::connected(0.0, 1);
        for bytes in &noise {
            pair.companion.receive(pair.now(), bytes);
            pair.endpoint.receive(pair.now(), bytes);
            pair.step();
        }
        pair.companion.command(pair.now(), Command::Arm);
        pair.run(2 * second());
        let acked = pair.events.iter().any(|event| matches!(event, MavEvent::CommandAcked { .. }));
        prop_assert!(acked);
    }
}
