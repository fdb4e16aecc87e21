//! The accuracy of a position, its age, and where it counts from.

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::messages::{GPS_RAW_INT_DATA, GpsFixType, HEARTBEAT_DATA, MavAutopilot};
use skein_mav::{Address, Companion, CompanionConfig, FrameWriter};

use crate::lossy_link::{Pair, datum};

/// ArduPilot's `EKF_STATUS_REPORT` (system 3): with a position it stands by, without one, and with fixes that contradict
/// it.
const STANDS_BY: [u8; 34] = [
    253, 22, 0, 0, 0, 3, 1, 193, 0, 0, 205, 204, 204, 61, 205, 204, 76, 62, 205, 204, 76, 61, 10, 215, 163,
    60, 0, 0, 0, 0, 63, 3, 252, 236,
];
const STANDS_STILL: [u8; 33] = [
    253, 21, 0, 0, 0, 3, 1, 193, 0, 0, 205, 204, 204, 61, 205, 204, 76, 62, 205, 204, 76, 61, 10, 215, 163,
    60, 0, 0, 0, 0, 167, 236, 62,
];
const CONTRADICTED: [u8; 34] = [
    253, 22, 0, 0, 0, 3, 1, 193, 0, 0, 205, 204, 204, 61, 154, 153, 217, 63, 205, 204, 76, 61, 10, 215, 163,
    60, 0, 0, 0, 0, 63, 3, 14, 46,
];

fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// A receiver's word: accuracies in millimetres.
fn fix(h_acc: u32, v_acc: u32) -> Vec<u8> {
    let mut writer = FrameWriter::new(Address::autopilot(3));
    let fix_type = GpsFixType::GPS_FIX_TYPE_3D_FIX;
    writer.write(&GPS_RAW_INT_DATA { fix_type, h_acc, v_acc, ..Default::default() });
    writer.take()
}

#[test]
fn an_estimator_without_an_accuracy_has_its_receivers_if_it_stands_by_its_position() {
    let mut companion = Companion::new(CompanionConfig::new(3, datum()));
    let sigma_m = |companion: &Companion| companion.telemetry().position_sigma_m.map(|sigma| sigma.value);
    companion.receive(ms(0), &fix(300, 500));
    assert_eq!(sigma_m(&companion), None, "what the estimator makes of it is not known yet");
    companion.receive(ms(10), &STANDS_BY);
    companion.receive(ms(20), &fix(300, 500));
    assert_eq!(sigma_m(&companion), Some([0.3, 0.5]));
    for closed in [&STANDS_STILL[..], &CONTRADICTED] {
        companion.receive(ms(30), closed);
        companion.receive(ms(40), &fix(300, 500));
        assert!(sigma_m(&companion).unwrap()[0] > 50.0, "it does not stand by any position");
        companion.receive(ms(50), &STANDS_BY);
        companion.receive(ms(60), &fix(0, 0));
        assert!(sigma_m(&companion).unwrap()[0] > 50.0, "the receiver tells nothing");
        companion.receive(ms(70), &fix(400, 600));
        assert_eq!(sigma_m(&companion), Some([0.4, 0.6]));
    }
}

#[test]
fn each_make_is_asked_for_the_message_that_it_has() {
    for (autopilot, expected) in
        [(MavAutopilot::MAV_AUTOPILOT_PX4, 230), (MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA, 193)]
    {
        let mut companion = Companion::new(CompanionConfig::new(3, datum()));
        let mut reader = skein_mav::FrameReader::default();
        let mut asked = Vec::new();
        for tick in 0..1000 {
            let now = ms(20 * tick);
            let mut writer = FrameWriter::new(Address::autopilot(3));
            writer.write(&HEARTBEAT_DATA { autopilot, ..Default::default() });
            companion.receive(now, &writer.take());
            companion.tick(now);
            reader.push(&companion.take_output());
            while let Some(frame) = reader.next_frame() {
                if let skein_mav::messages::MavMessage::COMMAND_LONG(command) = frame.message {
                    asked.push(command.param1 as u32);
                }
            }
        }
        assert!(asked.contains(&expected), "{asked:?}");
        assert_eq!(asked.contains(&193), expected == 193);
    }
}

#[test]
fn a_position_is_known_to_be_late() {
    let mut pair = Pair::connected(0.0, 1);
    let age = |pair: &Pair| pair.companion.telemetry().position_age.unwrap();
    assert!(age(&pair) < ms(50), "{:?}", age(&pair));
    pair.late = ms(450);
    pair.run(ms(1000));
    assert!(age(&pair) > ms(400) && age(&pair) < ms(500), "{:?}", age(&pair));
}

#[test]
fn a_position_that_is_told_again_is_as_old_as_it_was() {
    let mut pair = Pair::connected(0.0, 1);
    pair.is_frozen = true;
    pair.run(ms(1000));
    let position = pair.companion.telemetry().position.unwrap();
    assert!(position.age(pair.now()) > ms(900), "{:?}", position.age(pair.now()));
    pair.is_frozen = false;
    pair.run(ms(100));
    assert!(pair.companion.telemetry().position.unwrap().age(pair.now()) < ms(50));
}

#[test]
fn a_clock_that_begins_anew_is_noticed_and_the_age_is_known_again() {
    let mut pair = Pair::connected(0.0, 1);
    assert_eq!(pair.companion.telemetry().restarts, 0);
    pair.endpoint.restart_clock(pair.now());
    pair.run(ms(1000));
    let telemetry = pair.companion.telemetry();
    assert_eq!(telemetry.restarts, 1);
    assert!(telemetry.position.unwrap().age(pair.now()) < ms(50));
    assert!(telemetry.position_age.unwrap() < ms(50));
}

#[test]
fn a_moved_origin_moves_no_position() {
    let mut pair = Pair::connected(0.0, 1);
    let before = pair.companion.telemetry().position.unwrap().value;
    pair.endpoint.move_origin(Vector3::new(30.0, -40.0, 2.0));
    pair.run(ms(1000));
    let telemetry = pair.companion.telemetry();
    assert!((telemetry.position.unwrap().value - before).norm() < 0.03);
}
