//! The built-in autopilot flies: over MAVLink, with noisy instruments, on the real dynamics.

use crate::flight::{Flight, at, velocity, x500};
use nalgebra::Vector3;
use skein_mav::messages::{COMMAND_LONG_DATA, MANUAL_CONTROL_DATA, MavCmd, MavFrame};
use skein_mav::{
    Address, Command, CommandResult, FlightMode, FrameWriter, Landed, MavEvent, MissionItem, ParameterValue,
    SetPoint,
};
use skein_world::{VehicleModel, WindConfig};

fn crazyflie() -> VehicleModel {
    VehicleModel::built_in("crazyflie").unwrap()
}

/// A ground station with a pilot.
fn station(message: impl FnOnce(&mut FrameWriter)) -> Vec<u8> {
    let mut writer = FrameWriter::new(Address { system_id: 255, component_id: 190 });
    message(&mut writer);
    writer.take()
}

fn pilot_takes_over() -> Vec<u8> {
    station(|writer| {
        writer.write(&COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_DO_SET_MODE,
            param1: 1.0,
            param2: 3.0, // POSCTL
            target_system: 1,
            target_component: 1,
            ..Default::default()
        });
    })
}

#[test]
fn arming_waits_for_the_estimator_and_says_so() {
    let mut flight = Flight::new(x500(), 1, WindConfig::default());
    flight.until("telemetry", 2.0, |flight| {
        flight.telemetry().home_height_m.is_some() || flight.telemetry().connected
    });
    flight.command(Command::Arm);
    flight.run(0.2);
    assert!(flight.events.contains(&MavEvent::CommandAcked {
        command: Command::Arm,
        result: CommandResult::TemporarilyRejected
    }));
    assert!(flight.has_text("Arming denied"), "{:?}", flight.events);
    flight.until("ready to arm", 4.0, |flight| flight.telemetry().ready_to_arm);
    flight.command(Command::Arm);
    flight.until("armed", 1.0, |flight| flight.telemetry().armed);
}

#[test]
fn takes_off_to_its_height_and_holds_there() {
    for (model, height) in [(x500(), 3.0), (crazyflie(), 1.0)] {
        let mut flight = Flight::ready(model, 7);
        let start = flight.truth().motion.position;
        flight.take_off(height);
        flight.run(3.0);
        let mut worst: f64 = 0.0;
        for _ in 0..500 {
            flight.tick();
            let away = flight.truth().motion.position - (start + at(0.0, 0.0, height));
            worst = worst.max(away.norm());
        }
        assert!(worst < 0.35, "{worst}");
    }
}

#[test]
fn estimates_where_it_is() {
    let mut flight = Flight::offboard(x500(), 3);
    let mut worst = [0.0_f64; 3];
    for round in 0..40 {
        let angle = f64::from(round) * 0.8;
        flight.set_point = Some(velocity(2.5 * angle.cos(), 2.5 * angle.sin(), 0.0));
        for _ in 0..25 {
            flight.tick();
            let (truth, heard) = (flight.truth().motion, flight.telemetry());
            let errors = [
                (heard.position.unwrap().value - truth.position).norm(),
                (heard.velocity.unwrap().value - truth.velocity).norm(),
                heard.attitude.unwrap().value.angle_to(&truth.attitude),
            ];
            for (worst, error) in worst.iter_mut().zip(errors) {
                *worst = worst.max(error);
            }
        }
    }
    let [position, speed, angle] = worst;
    assert!(position < 0.2 && speed < 0.25 && angle < 0.06, "{worst:?}");
}

#[test]
fn velocity_set_points_are_followed_crisply() {
    let mut flight = Flight::offboard(x500(), 5);
    flight.run(1.0);
    flight.set_point = Some(velocity(1.0, 0.0, 0.0));
    let mut risen = None;
    let mut fastest: f64 = 0.0;
    for tick in 0..100 {
        flight.tick();
        let speed = flight.truth().motion.velocity.x;
        fastest = fastest.max(speed);
        if speed > 0.63 && risen.is_none() {
            risen = Some(f64::from(tick + 1) * 0.02);
        }
    }
    let risen = risen.unwrap();
    assert!(risen < 0.6, "63 % after {risen} s");
    assert!(fastest < 1.25, "overshoot to {fastest} m/s");
    flight.run(1.0);
    let velocity = flight.truth().motion.velocity;
    assert!((velocity - at(1.0, 0.0, 0.0)).norm() < 0.15, "{velocity}");
}

#[test]
fn speed_and_tilt_stay_within_the_vehicle() {
    let mut flight = Flight::offboard(x500(), 5);
    let model = x500();
    for wish in [velocity(50.0, 0.0, 0.0), velocity(-50.0, 0.0, 0.0), velocity(0.0, 50.0, 3.0)] {
        flight.set_point = Some(wish);
        for _ in 0..200 {
            flight.tick();
            let motion = flight.truth().motion;
            let tilt = (motion.attitude * Vector3::z()).z.acos();
            assert!(tilt < model.max_tilt_rad + 0.15, "tilt {tilt}");
            assert!(motion.velocity.xy().norm() < model.max_speed_m_s * 1.1);
        }
    }
}

#[test]
fn planar_set_points_keep_the_height() {
    let mut flight = Flight::offboard(x500(), 11);
    flight.set_point = Some(SetPoint::Planar { vx: 2.0, vy: 1.0, z: 4.0, yaw: None });
    flight.run(4.0);
    for _ in 0..200 {
        flight.tick();
        let motion = flight.truth().motion;
        assert!((motion.position.z - 4.0).abs() < 0.25, "{}", motion.position);
        assert!((motion.velocity.xy() - at(2.0, 1.0, 0.0).xy()).norm() < 0.3);
    }
}

#[test]
fn position_set_points_are_reached_without_overshoot_and_with_their_heading() {
    let mut flight = Flight::offboard(x500(), 13);
    let goal = at(12.0, 4.0, 5.0);
    flight.set_point = Some(SetPoint::Position { position: goal, yaw: Some(-2.0) });
    let way = (goal - flight.truth().motion.position).normalize();
    let mut beyond: f64 = 0.0;
    for _ in 0..500 {
        flight.tick();
        beyond = beyond.max((flight.truth().motion.position - goal).dot(&way));
    }
    assert!(beyond < 0.4, "{beyond} m too far");
    let motion = flight.truth().motion;
    assert!((motion.position - goal).norm() < 0.25, "{}", motion.position);
    let (_, _, yaw) = motion.attitude.euler_angles();
    assert!((yaw + 2.0).abs() < 0.1, "{yaw}");
}

#[test]
fn offboard_is_refused_without_a_stream_of_set_points() {
    let mut flight = Flight::airborne(x500(), 1);
    flight.command(Command::Offboard);
    flight.run(0.5);
    assert!(flight.has_text("no stream of set-points"));
    assert_eq!(flight.telemetry().mode, FlightMode::Hold);
    // One set-point is no stream.
    flight.set_point = Some(velocity(0.0, 0.0, 0.0));
    flight.tick();
    flight.set_point = None;
    flight.command(Command::Offboard);
    flight.run(0.5);
    assert_eq!(flight.telemetry().mode, FlightMode::Hold);
}

#[test]
fn lost_set_points_end_in_a_hold_and_then_a_landing_within_two_seconds() {
    let mut flight = Flight::offboard(x500(), 1);
    flight.set_point = Some(velocity(2.0, 0.0, 0.0));
    flight.run(2.0);
    flight.set_point = None;
    let to_hold = flight.until_mode(FlightMode::Hold);
    assert!((0.4..0.8).contains(&to_hold), "hold after {to_hold} s");
    assert!(flight.has_text("set-points lost"));
    let to_land = flight.until_mode(FlightMode::Land);
    assert!(to_hold + to_land < 2.0, "landing after {} s", to_hold + to_land);
    flight.until_landed(15.0);
    assert!(!flight.truth().crashed);
}

#[test]
fn the_action_after_lost_set_points_is_a_parameter() {
    let mut flight = Flight::offboard(x500(), 1);
    flight.companion.write_parameter("COM_OBL_RC_ACT", ParameterValue::Int(3));
    flight.run(0.5);
    flight.set_point = None;
    flight.run(2.0);
    assert_eq!(flight.telemetry().mode, FlightMode::Return);
}

#[test]
fn lands_softly_and_disarms() {
    let mut flight = Flight::airborne(x500(), 2);
    let over = flight.truth().motion.position;
    flight.command(Command::Land);
    flight.until_mode(FlightMode::Land);
    let mut fastest_near_ground: f64 = 0.0;
    while flight.telemetry().landed != Landed::OnGround {
        flight.tick();
        let motion = flight.truth().motion;
        if motion.position.z < 0.6 {
            fastest_near_ground = fastest_near_ground.max(-motion.velocity.z);
        }
    }
    assert!(fastest_near_ground < 1.0, "{fastest_near_ground} m/s");
    flight.until_landed(3.0);
    let motion = flight.truth().motion;
    assert!((motion.position - over).xy().norm() < 0.4);
    assert!(!flight.truth().crashed && !flight.truth().airborne);
}

#[test]
fn hold_stops_a_fast_vehicle_in_its_braking_distance() {
    let mut flight = Flight::offboard(x500(), 2);
    flight.set_point = Some(velocity(4.0, 0.0, 0.0));
    flight.run(4.0);
    let begun = flight.truth().motion.position;
    flight.command(Command::Hold);
    flight.run(5.0);
    let motion = flight.truth().motion;
    let way = (motion.position - begun).x;
    assert!(motion.velocity.norm() < 0.2, "{}", motion.velocity);
    assert!((1.5..5.5).contains(&way), "stopped after {way} m");
}

#[test]
fn returns_home_high_and_lands_there() {
    let mut flight = Flight::offboard(x500(), 4);
    let home = at(2.0, -3.0, 0.15);
    flight.set_point = Some(velocity(3.0, 2.0, 0.0));
    flight.run(5.0);
    flight.companion.write_parameter("RTL_RETURN_ALT", ParameterValue::Real(6.0));
    flight.run(0.2);
    flight.command(Command::Return);
    flight.until_mode(FlightMode::Return);
    flight.until("height", 8.0, |flight| flight.truth().motion.position.z > 5.8);
    flight.until_landed(30.0);
    let motion = flight.truth().motion;
    assert!((motion.position - home).norm() < 0.5, "{}", motion.position);
}

#[test]
fn disarming_in_flight_is_refused() {
    let mut flight = Flight::airborne(x500(), 1);
    flight.command(Command::Disarm);
    flight.run(0.5);
    assert!(flight.has_text("not landed"));
    assert!(flight.telemetry().armed && flight.truth().airborne);
}

#[test]
fn armed_without_a_takeoff_it_disarms_by_itself() {
    let mut flight = Flight::ready(x500(), 1);
    flight.command(Command::Arm);
    flight.until("armed", 1.0, |flight| flight.telemetry().armed);
    let waited = flight.until("disarmed", 12.0, |flight| !flight.telemetry().armed);
    assert!((9.0..11.0).contains(&waited), "{waited} s");
    assert!(!flight.truth().airborne);
}

#[test]
fn a_pilot_takes_over_from_offboard_and_flies_by_sticks() {
    let mut flight = Flight::offboard(x500(), 1);
    flight.set_point = Some(velocity(1.0, 0.0, 0.0));
    flight.run(1.0);
    flight.simulation.send(0, &pilot_takes_over());
    flight.until_mode(FlightMode::Manual);
    // The companion's set-points go on and are ignored; with no sticks the vehicle stays.
    flight.run(3.0);
    let speed = flight.truth().motion.velocity.norm();
    assert!(speed < 0.2, "{speed} m/s");
    // Full forward: along the nose, which points to 0.5 rad.
    for _ in 0..150 {
        let sticks = station(|writer| {
            writer.write(&MANUAL_CONTROL_DATA { target: 1, x: 500, z: 500, ..Default::default() });
        });
        flight.simulation.send(0, &sticks);
        flight.tick();
    }
    let velocity = flight.truth().motion.velocity;
    assert!(velocity.norm() > 1.5, "{velocity}");
    assert!((velocity.y.atan2(velocity.x) - 0.5).abs() < 0.1, "{velocity}");
    // Sticks lost: by default it returns.
    flight.run(2.0);
    assert_eq!(flight.telemetry().mode, FlightMode::Return);
}

#[test]
fn leaving_the_fence_stops_the_vehicle() {
    let mut flight = Flight::airborne(x500(), 1);
    flight.companion.write_parameter("GF_MAX_HOR_DIST", ParameterValue::Real(8.0));
    flight.set_point = Some(velocity(3.0, 0.0, 0.0));
    flight.run(0.5);
    flight.command(Command::Offboard);
    flight.run(8.0);
    assert!(flight.has_text("Geofence left"));
    assert_eq!(flight.telemetry().mode, FlightMode::Hold);
    let away = flight.truth().motion.position - at(2.0, -3.0, 0.0);
    assert!(away.xy().norm() < 11.0, "{away}");
}

#[test]
fn a_critical_battery_brings_the_vehicle_home_and_an_empty_one_down() {
    // So small a battery that it is empty within seconds.
    let mut model = x500();
    model.battery.capacity_wh = 2.0;
    let mut flight = Flight::ready(model, 1);
    flight.take_off(6.0);
    flight.set_point = Some(velocity(2.0, 0.0, 0.0));
    flight.run(0.3);
    flight.command(Command::Offboard);
    flight.until("warning", 40.0, |flight| flight.has_text("Battery is low"));
    flight.until("return", 40.0, |flight| flight.telemetry().mode == FlightMode::Return);
    assert!(flight.has_text("Battery is critical"));
    flight.until("landing", 20.0, |flight| flight.telemetry().mode == FlightMode::Land);
}

#[test]
fn flies_an_uploaded_mission_and_lands_at_its_end() {
    let mut flight = Flight::ready(x500(), 21);
    let datum = *flight.simulation.scene().datum();
    let waypoints = [at(8.0, 0.0, 4.0), at(8.0, 8.0, 5.0)];
    let mut items: Vec<MissionItem> =
        waypoints.iter().map(|position| MissionItem::waypoint(&datum, position, 1.0)).collect();
    items.push(MissionItem {
        command: MavCmd::MAV_CMD_NAV_LAND,
        frame: MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
        z: 0.0,
        ..MissionItem::waypoint(&datum, &at(4.0, 8.0, 0.0), 0.0)
    });
    flight.companion.upload_mission(items);
    flight.until("upload", 3.0, |flight| flight.events.contains(&MavEvent::MissionUploaded));
    flight.command(Command::Arm);
    flight.run(0.3);
    flight.command(Command::StartMission);
    flight.until_mode(FlightMode::Mission);
    for (number, waypoint) in waypoints.iter().enumerate() {
        flight.until(&format!("waypoint {number}"), 25.0, |flight| {
            (flight.truth().motion.position - waypoint).norm() < 0.7
        });
    }
    flight.until_landed(30.0);
    let motion = flight.truth().motion;
    assert!((motion.position - at(4.0, 8.0, 0.15)).norm() < 0.7, "{}", motion.position);
}

#[test]
fn a_mission_with_an_item_it_cannot_fly_is_refused() {
    let mut flight = Flight::ready(x500(), 21);
    let datum = *flight.simulation.scene().datum();
    flight.companion.upload_mission(vec![MissionItem {
        command: MavCmd::MAV_CMD_NAV_FOLLOW,
        ..MissionItem::waypoint(&datum, &at(8.0, 0.0, 4.0), 1.0)
    }]);
    flight.until("refusal", 3.0, |flight| {
        flight.events.iter().any(|event| matches!(event, MavEvent::MissionFailed { .. }))
    });
}

#[test]
fn steady_wind_is_leant_against() {
    let wind = WindConfig { mean: at(4.0, 0.0, 0.0), ..WindConfig::default() };
    let mut flight = Flight::new(x500(), 9, wind);
    flight.until("ready to arm", 10.0, |flight| flight.telemetry().ready_to_arm);
    let start = flight.truth().motion.position;
    flight.take_off(3.0);
    flight.run(6.0);
    let away = flight.truth().motion.position - start;
    assert!(away.xy().norm() < 0.4, "{away}");
}

#[test]
fn flights_with_one_seed_are_equal_bit_for_bit() {
    let fly = |seed| {
        let mut flight = Flight::offboard(x500(), seed);
        flight.set_point = Some(velocity(1.5, -1.0, 0.2));
        flight.run(3.0);
        flight.truth().motion
    };
    assert_eq!(fly(8), fly(8));
    assert_ne!(fly(8), fly(9));
}

#[test]
fn random_bytes_do_not_bring_it_down() {
    use proptest::strategy::{Strategy, ValueTree};
    use proptest::test_runner::TestRunner;
    let mut flight = Flight::airborne(x500(), 6);
    let mut runner = TestRunner::deterministic();
    let strategy = proptest::collection::vec(proptest::num::u8::ANY, 0..300);
    for _ in 0..200 {
        let noise = strategy.new_tree(&mut runner).unwrap().current();
        flight.simulation.send(0, &noise);
        flight.tick();
    }
    assert_eq!(flight.telemetry().mode, FlightMode::Hold);
    assert!(flight.truth().airborne);
}
