//! Signed links: what is not signed by the other end does not count, and nothing counts twice.

use std::time::Duration;

use mavlink::MavlinkVersion;
use proptest::prelude::*;
use skein_mav::messages::{HEARTBEAT_DATA, MavAutopilot, MavMessage, MavModeFlag, SYSTEM_TIME_DATA};
use skein_mav::{
    Address, Companion, CompanionConfig, Datum, FrameReader, FrameWriter, Refused, Signing, SigningKey,
    SigningTime,
};

/// As pymavlink 2.4 signs a heartbeat and a SYSTEM_TIME of 1/1, on link 3 with the key of the passphrase, at
/// 37 000 000 000 000 units and the next.
const BY_PYMAVLINK: &str = "fd09010000010100000000000600020c5104034d91030050dbbba62187276cfc8072\
                            fd0a01000101010200000000000000000000e8036e25030150dbbba62104c59f905104";
const PASSPHRASE: &str = "swarm of geese";
const THEN: u64 = 37_000_000_000_000;
/// The longest time that a new sender may be behind, in units of 10 µs.
const MINUTE: u64 = 6_000_000;

fn signing(began: u64) -> Signing {
    Signing {
        key: SigningKey::of_passphrase(PASSPHRASE),
        link_id: 3,
        refuses_unsigned: true,
        began: SigningTime::of_units(began),
    }
}

fn heartbeat() -> HEARTBEAT_DATA {
    HEARTBEAT_DATA {
        custom_mode: 6 << 16,
        autopilot: MavAutopilot::MAV_AUTOPILOT_PX4,
        base_mode: MavModeFlag::from_bits_retain(81),
        mavlink_version: 3,
        ..Default::default()
    }
}

fn by_pymavlink() -> Vec<u8> {
    let digits = BY_PYMAVLINK.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).unwrap());
    digits.map(|pair| u8::from_str_radix(pair, 16).unwrap()).collect()
}

fn messages(reader: &mut FrameReader, bytes: &[u8]) -> usize {
    reader.push(bytes);
    std::iter::from_fn(|| reader.next_frame()).count()
}

#[test]
fn frames_that_another_program_signed_are_read_once_and_never_again() {
    let mut reader = FrameReader::signed(&signing(THEN));
    assert_eq!(messages(&mut reader, &by_pymavlink()), 2);
    assert_eq!(reader.newest_signing_time().units(), THEN + 1);
    assert_eq!(messages(&mut reader, &by_pymavlink()), 0);
    assert_eq!(reader.refused(), Refused { old: 2, ..Refused::default() });
}

#[test]
fn frames_are_signed_as_another_program_signs_them() {
    let mut writer = FrameWriter::new(Address { system_id: 1, component_id: 1 }).signed(&signing(THEN));
    let mut reader = FrameReader::default();
    reader.push(&by_pymavlink());
    let Some(MavMessage::HEARTBEAT(first)) = reader.next_frame().map(|frame| frame.message) else { panic!() };
    writer.write(&first);
    writer.write(&SYSTEM_TIME_DATA { time_unix_usec: 0, time_boot_ms: 1000 });
    assert_eq!(writer.take(), by_pymavlink());
}

#[test]
fn a_sender_that_is_new_may_be_a_minute_behind_and_no_more() {
    for (behind, heard) in [(MINUTE, 2), (MINUTE + 2, 0)] {
        assert_eq!(messages(&mut FrameReader::signed(&signing(THEN + behind)), &by_pymavlink()), heard);
    }
}

#[test]
fn unsigned_frames_count_only_where_that_is_allowed() {
    for (version, refuses_unsigned, heard) in [
        (MavlinkVersion::V1, true, 0),
        (MavlinkVersion::V2, true, 0),
        (MavlinkVersion::V1, false, 1),
        (MavlinkVersion::V2, false, 1),
    ] {
        let mut reader = FrameReader::signed(&Signing { refuses_unsigned, ..signing(THEN) });
        let mut writer = FrameWriter::new(Address::autopilot(1));
        writer.speak(version);
        writer.write(&heartbeat());
        assert_eq!(messages(&mut reader, &writer.take()), heard, "{version:?}");
        assert_eq!(reader.refused().unsigned, 1 - heard as u64);
    }
}

#[test]
fn keys_are_read_from_bytes_and_digits_and_never_shown() {
    let bytes: Vec<u8> = (0..32).map(|byte| byte * 7).collect();
    let digits: String = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    let key = SigningKey::of_file(&bytes).unwrap();
    assert_eq!(SigningKey::of_file(format!(" {digits}\n").as_bytes()), Some(key));
    for wrong in [&bytes[1..], digits.replace("1C", "1G").as_bytes(), b"", &[b'a'; 63]] {
        assert_eq!(SigningKey::of_file(wrong), None);
    }
    assert_eq!(format!("{key:?}"), "SigningKey(secret)");
}

#[test]
fn times_count_from_2015_and_end_at_48_bits() {
    assert_eq!(SigningTime::of_clock(Duration::ZERO).units(), 0);
    assert_eq!(SigningTime::of_clock(Duration::from_secs(1_420_070_401)).units(), 100_000);
    let last = SigningTime::of_units(u64::MAX);
    assert_eq!((last.units(), last.after(Duration::MAX)), ((1 << 48) - 1, last));
}

/// A companion of the vehicle that `autopilot` speaks for, one second after it has heard it.
fn companion_that_heard(autopilot: &mut FrameWriter, began: u64) -> Companion {
    let datum = Datum::from_degrees(47.4, 8.5, 488.0);
    let mut companion =
        Companion::new(CompanionConfig { signing: Some(signing(began)), ..CompanionConfig::new(1, datum) });
    autopilot.write(&heartbeat());
    companion.receive(Duration::ZERO, &autopilot.take());
    companion.tick(Duration::from_secs(1));
    companion
}

#[test]
fn a_companion_hears_and_answers_a_signed_autopilot_whose_clock_is_ahead() {
    let autopilot = FrameWriter::new(Address::autopilot(1));
    let mut companion = companion_that_heard(&mut autopilot.signed(&signing(THEN + 100 * MINUTE)), THEN);
    assert!(companion.telemetry().connected);
    // An autopilot that has been told this time refuses what is older.
    let mut reader = FrameReader::signed(&signing(THEN + 101 * MINUTE));
    assert!(messages(&mut reader, &companion.take_output()) > 0);
    assert_eq!(reader.refused(), Refused::default());
}

#[test]
fn a_companion_that_must_not_does_not_hear_an_autopilot_without_the_key_and_says_so() {
    let autopilot = FrameWriter::new(Address::autopilot(1));
    let wrong = Signing { key: SigningKey::of_passphrase("another"), ..signing(THEN) };
    for (mut autopilot, refused) in [
        (autopilot.clone(), Refused { unsigned: 1, ..Refused::default() }),
        (autopilot.signed(&wrong), Refused { wrong: 1, ..Refused::default() }),
    ] {
        let companion = companion_that_heard(&mut autopilot, THEN);
        assert!(companion.telemetry().last_heartbeat.is_none());
        assert_eq!(companion.telemetry().refused, refused);
    }
}

#[test]
fn a_signed_link_never_falls_back_to_mavlink_1() {
    let mut autopilot = FrameWriter::new(Address::autopilot(1));
    autopilot.speak(MavlinkVersion::V1);
    let allows = Signing { refuses_unsigned: false, ..signing(THEN) };
    let datum = Datum::from_degrees(47.4, 8.5, 488.0);
    let mut companion =
        Companion::new(CompanionConfig { signing: Some(allows), ..CompanionConfig::new(1, datum) });
    for second in 0..6 {
        autopilot.write(&heartbeat());
        companion.receive(Duration::from_secs(second), &autopilot.take());
        companion.tick(Duration::from_secs(second));
        let mut reader = FrameReader::signed(&signing(THEN));
        assert!(messages(&mut reader, &companion.take_output()) > 0);
        assert_eq!(reader.refused(), Refused::default());
    }
    assert!(companion.telemetry().knows_mavlink_1_only);
}

proptest! {
    #[test]
    fn a_frame_of_which_one_bit_is_changed_is_not_heard(bit in 0..(34_usize * 8)) {
        let mut bytes = by_pymavlink();
        bytes.truncate(34);
        bytes[bit / 8] ^= 1 << (bit % 8);
        prop_assert_eq!(messages(&mut FrameReader::signed(&signing(THEN)), &bytes), 0);
    }

    #[test]
    fn each_frame_of_a_writer_is_newer_than_the_last(pauses in prop::collection::vec(0_u64..3, 1..50)) {
        let mut writer = FrameWriter::new(Address::autopilot(1)).signed(&signing(THEN));
        let mut reader = FrameReader::signed(&signing(THEN));
        let mut time = SigningTime::of_units(THEN);
        for pause in pauses {
            time = time.after(Duration::from_micros(10 * pause));
            writer.not_before(time);
            writer.write(&heartbeat());
            prop_assert_eq!(messages(&mut reader, &writer.take()), 1);
            prop_assert!(reader.newest_signing_time() >= time);
        }
    }
}
