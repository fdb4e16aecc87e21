//! What instruments measure reaches the companion, and its estimate the autopilot.

#![expect(deprecated)]

use std::time::Duration;

use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector2, Vector3};
use skein_mav::messages::{HEARTBEAT_DATA, MavAutopilot, MavMessage};
use skein_mav::{
    Address, Companion, CompanionConfig, Datum, Distance, Endpoint, EndpointConfig, External, Flow,
    FrameReader, FrameWriter, Inertial, Measured, ParameterTable, Request,
};

fn datum() -> Datum {
    Datum::from_degrees(47.4, 8.5, 400.0)
}

fn endpoint() -> Endpoint {
    Endpoint::new(EndpointConfig {
        system_id: 1,
        datum: datum(),
        parameters: ParameterTable::new(Vec::new()),
        accepts_item: |_| true,
        accepts_fence: |_| true,
        accepts_rally: |_| true,
    })
}

/// A companion that has heard the heartbeat of an autopilot of this make.
fn companion(autopilot: MavAutopilot) -> Companion {
    let config = CompanionConfig { wants_measured: true, ..CompanionConfig::new(1, datum()) };
    let mut companion = Companion::new(config);
    let mut heart = FrameWriter::new(Address::autopilot(1));
    heart.write(&HEARTBEAT_DATA { autopilot, ..Default::default() });
    companion.receive(Duration::ZERO, &heart.take());
    companion.tick(Duration::ZERO);
    companion
}

fn estimate() -> External {
    let mut motion_covariance = Matrix6::from_diagonal(&[0.01, 0.02, 0.03, 0.004, 0.005, 0.006].into());
    (motion_covariance[(0, 1)], motion_covariance[(1, 0)]) = (0.005, 0.005);
    External {
        position: Vector3::new(3.0, -4.0, 1.5),
        velocity: Vector3::new(0.5, 0.2, -0.1),
        attitude: UnitQuaternion::from_euler_angles(0.1, -0.2, 2.0),
        rate: Vector3::new(0.01, -0.02, 0.3),
        motion_covariance,
        attitude_covariance: Matrix3::from_diagonal(&[1e-4, 2e-4, 3e-4].into()),
        resets: 7,
    }
}

#[test]
fn an_estimate_arrives_with_its_covariance_as_it_was_given() {
    let (mut companion, mut endpoint) = (companion(MavAutopilot::MAV_AUTOPILOT_PX4), endpoint());
    assert!(companion.external(Duration::from_millis(20), &estimate()));
    endpoint.receive(Duration::from_millis(24), &companion.take_output());
    let requests: Vec<_> = std::iter::from_fn(|| endpoint.next_request()).collect();
    let [Request::External(heard)] = &requests[..] else { panic!("an estimate: {requests:?}") };
    assert!((heard.position - estimate().position).norm() < 1e-5);
    assert!((heard.velocity - estimate().velocity).norm() < 1e-6);
    assert!(heard.attitude.angle_to(&estimate().attitude) < 1e-6);
    assert!((heard.rate - estimate().rate).norm() < 1e-6);
    assert!((heard.motion_covariance - estimate().motion_covariance).norm() < 1e-6);
    assert!((heard.attitude_covariance - estimate().attitude_covariance).norm() < 1e-9);
    assert_eq!(heard.resets, 7);
    let senseless = External { velocity: Vector3::repeat(f64::NAN), ..estimate() };
    assert!(!companion.external(Duration::from_millis(40), &senseless));
}

#[test]
fn an_autopilot_without_an_origin_is_told_where_it_is_and_ardupilot_hears_vision_estimates() {
    let mut companion = companion(MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA);
    let mut reader = FrameReader::default();
    for tick in 0..100 {
        assert!(companion.external(Duration::from_millis(20 * tick), &estimate()));
    }
    reader.push(&companion.take_output());
    let messages: Vec<_> = std::iter::from_fn(|| reader.next_frame()).map(|frame| frame.message).collect();
    let count = |wanted: fn(&MavMessage) -> bool| messages.iter().filter(|message| wanted(message)).count();
    assert_eq!(count(|message| matches!(message, MavMessage::SET_GPS_GLOBAL_ORIGIN(_))), 2);
    assert_eq!(count(|message| matches!(message, MavMessage::VISION_SPEED_ESTIMATE(_))), 100);
    let place = messages.iter().find_map(|message| match message {
        MavMessage::VISION_POSITION_ESTIMATE(place) => Some(place),
        _ => None,
    });
    // North-east-down.
    let place = place.unwrap();
    assert!((place.x + 4.0).abs() < 1e-5 && (place.y - 3.0).abs() < 1e-5 && (place.z + 1.5).abs() < 1e-5);
    assert!((place.covariance[0] - 0.02).abs() < 1e-6 && (place.covariance[6] - 0.01).abs() < 1e-6);
}

#[test]
fn readings_arrive_as_they_were_measured_and_inertia_as_the_mean() {
    let (mut companion, mut endpoint) = (companion(MavAutopilot::MAV_AUTOPILOT_PX4), endpoint());
    let flow = Flow {
        rate: Vector2::new(0.4, -0.3),
        over: Duration::from_millis(20),
        quality: 0.8,
        distance_m: Some(1.25),
    };
    let distance =
        Distance { distance_m: 1.25, least_m: 0.1, most_m: 4.0, sigma_m: Some(0.02), half_cone_rad: 0.25 };
    let turns = Vector3::new(0.2, -0.1, 0.5);
    let mut now = Duration::ZERO;
    let mut heard = Vec::new();
    for step in 0..2500_u32 {
        now += Duration::from_millis(4);
        let force = Vector3::new(f64::from(step % 2), 0.0, 9.8);
        endpoint.measure(now, &Measured::Inertial(Inertial { rate: turns, force }));
        if step % 10 == 0 {
            endpoint.measure(now, &Measured::Flow(flow));
            endpoint.measure(now, &Measured::Distance(distance));
        }
        endpoint.report(now, &crate::lossy_link::standing());
        endpoint.receive(now, &companion.take_output());
        companion.receive(now, &endpoint.take_output());
        companion.tick(now);
        heard.extend(companion.take_measured());
    }
    let late = heard.iter().filter(|reading| reading.stamp > Duration::from_secs(8));
    let mut counts = [0; 3];
    for reading in late {
        match reading.value {
            Measured::Inertial(inertial) => {
                counts[0] += 1;
                assert!((inertial.rate - turns).norm() < 1e-6 && (inertial.force.x - 0.5).abs() < 1e-6);
            }
            Measured::Flow(heard) => {
                counts[1] += 1;
                assert!((heard.rate - flow.rate).norm() < 1e-5, "without the turning: {heard:?}");
                assert_eq!((heard.over, heard.distance_m), (flow.over, flow.distance_m));
            }
            Measured::Distance(heard) => {
                counts[2] += 1;
                assert_eq!((heard.distance_m, heard.sigma_m), (1.25, Some(0.02)));
            }
        }
    }
    assert_eq!(counts, [250, 50, 50]);
}
