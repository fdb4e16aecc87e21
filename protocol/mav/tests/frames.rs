//! Frames survive the wire, and nothing on the wire survives as a frame that is not one.

use mavlink::{MavlinkVersion, MessageData};
use proptest::prelude::*;
use skein_mav::messages::{
    COMMAND_ACK_DATA, HEARTBEAT_DATA, LOCAL_POSITION_NED_DATA, MavAutopilot, MavCmd, MavMessage, MavModeFlag,
    MavResult, MavType,
};
use skein_mav::{Address, FrameReader, FrameWriter};

const SENDER: Address = Address { system_id: 7, component_id: 191 };

fn position(time_boot_ms: u32, x: f32) -> LOCAL_POSITION_NED_DATA {
    LOCAL_POSITION_NED_DATA { time_boot_ms, x, ..Default::default() }
}

fn frame(message: &LOCAL_POSITION_NED_DATA) -> Vec<u8> {
    let mut writer = FrameWriter::new(SENDER);
    writer.write(message);
    writer.take()
}

fn read_all(reader: &mut FrameReader) -> Vec<MavMessage> {
    std::iter::from_fn(|| reader.next_frame()).map(|frame| frame.message).collect()
}

/// A MAVLink 1 heartbeat of a ground station, as pymavlink writes it.
const HEARTBEAT_V1: [u8; 17] = [0xfe, 9, 0, 255, 190, 0, 0, 0, 0, 0, 6, 8, 0, 0, 3, 0, 0];

/// The same with its checksum filled in (X.25 over all but the marker, then the message's extra byte 50).
fn heartbeat_v1() -> Vec<u8> {
    let mut bytes = HEARTBEAT_V1.to_vec();
    let mut crc = 0xffff_u16;
    for byte in bytes[1..15].iter().chain(&[50]) {
        let mut low = byte ^ (crc & 0xff) as u8;
        low ^= low << 4;
        let low = u16::from(low);
        crc = (crc >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4);
    }
    bytes[15..].copy_from_slice(&crc.to_le_bytes());
    bytes
}

#[test]
fn both_versions_of_the_protocol_are_read() {
    let mut writer = FrameWriter::new(SENDER);
    writer.write(&HEARTBEAT_DATA::default());
    let mut reader = FrameReader::default();
    reader.push(&heartbeat_v1());
    reader.push(&writer.take());
    let first = reader.next_frame().unwrap();
    assert_eq!((first.sender.system_id, first.sender.component_id), (255, 190));
    assert!(matches!(first.message, MavMessage::HEARTBEAT(_)));
    assert_eq!(reader.next_frame().unwrap().sender, SENDER);
    assert_eq!(reader.bad_bytes(), 0);
}

#[test]
fn sequence_numbers_count_up_and_wrap() {
    let mut writer = FrameWriter::new(SENDER);
    for _ in 0..257 {
        writer.write(&HEARTBEAT_DATA::default());
    }
    let mut reader = FrameReader::default();
    reader.push(&writer.take());
    let sequence: Vec<u8> = std::iter::from_fn(|| reader.next_frame()).map(|frame| frame.sequence).collect();
    assert_eq!(sequence[..3], [0, 1, 2]);
    assert_eq!(sequence[254..], [254, 255, 0]);
}

#[test]
fn a_flipped_bit_anywhere_costs_the_frame_and_not_the_next() {
    let [first, second] = [position(1, 2.5), position(2, -7.25)];
    let bytes = frame(&first);
    for bit in 0..bytes.len() * 8 {
        let mut damaged = bytes.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        let mut reader = FrameReader::default();
        reader.push(&damaged);
        for _ in 0..10 {
            // A damaged length may make the reader wait for bytes that are not its own; they come.
            reader.push(&frame(&second));
        }
        let messages = read_all(&mut reader);
        assert!(messages.contains(&MavMessage::LOCAL_POSITION_NED(second.clone())), "bit {bit}");
        assert!(!messages.contains(&MavMessage::LOCAL_POSITION_NED(first.clone())), "bit {bit}");
        assert!(reader.bad_bytes() > 0, "bit {bit}");
    }
}

proptest! {
    #[test]
    fn frames_come_back_whatever_pieces_they_arrive_in(
        values in prop::collection::vec((any::<u32>(), -1e6..1e6_f32), 1..20),
        cuts in prop::collection::vec(1..40_usize, 1..60),
    ) {
        let sent: Vec<_> = values.iter().map(|(time, x)| position(*time, *x)).collect();
        let mut writer = FrameWriter::new(SENDER);
        sent.iter().for_each(|message| writer.write(message));
        let bytes = writer.take();
        let mut reader = FrameReader::default();
        let mut received = Vec::new();
        let mut rest = bytes.as_slice();
        for cut in cuts.iter().cycle() {
            let (piece, later) = rest.split_at(rest.len().min(*cut));
            reader.push(piece);
            received.extend(read_all(&mut reader));
            rest = later;
            if rest.is_empty() {
                break;
            }
        }
        let sent: Vec<_> = sent.into_iter().map(MavMessage::LOCAL_POSITION_NED).collect();
        prop_assert_eq!(received, sent);
        prop_assert_eq!(reader.bad_bytes(), 0);
    }

    #[test]
    fn random_bytes_never_panic_and_are_counted(
        pieces in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..200), 0..20),
    ) {
        let mut reader = FrameReader::default();
        let mut total = 0;
        for piece in &pieces {
            reader.push(piece);
            total += piece.len() as u64;
            while reader.next_frame().is_some() {}
        }
        prop_assert!(reader.bad_bytes() <= total);
    }

    #[test]
    fn a_frame_is_found_behind_garbage_without_markers(
        garbage in prop::collection::vec(any::<u8>().prop_filter("marker", |it| *it < 0xfd), 0..300),
        x in -1e6..1e6_f32,
    ) {
        let message = position(9, x);
        let mut reader = FrameReader::default();
        reader.push(&garbage);
        reader.push(&frame(&message));
        prop_assert_eq!(read_all(&mut reader), vec![MavMessage::LOCAL_POSITION_NED(message)]);
        prop_assert_eq!(reader.bad_bytes(), garbage.len() as u64);
    }

    #[test]
    fn markers_in_garbage_delay_a_stream_but_do_not_stop_it(
        garbage in prop::collection::vec(prop_oneof![Just(0xfd_u8), Just(0xfe_u8), any::<u8>()], 0..300),
    ) {
        let mut reader = FrameReader::default();
        reader.push(&garbage);
        for time in 0..40 {
            reader.push(&frame(&position(time, 1.0)));
        }
        // A marker may claim up to 280 bytes that are not its own, which is 14 of these frames.
        prop_assert!(read_all(&mut reader).len() >= 26);
    }
}

/// The frame with this payload byte changed, and its checksum made right again.
fn with_byte<D: MessageData>(message: &D, at: usize, byte: u8) -> Vec<u8> {
    let mut writer = FrameWriter::new(SENDER);
    writer.write(message);
    let mut bytes = writer.take();
    bytes[10 + at] = byte;
    let end = bytes.len() - 2;
    let crc = mavlink::calculate_crc(&bytes[1..end], D::EXTRA_CRC);
    bytes[end..].copy_from_slice(&crc.to_le_bytes());
    bytes
}

#[test]
fn a_number_newer_than_its_enumeration_costs_the_field_and_not_the_frame() {
    let heartbeat = HEARTBEAT_DATA {
        custom_mode: 250 << 8,
        mavtype: MavType::MAV_TYPE_QUADROTOR,
        autopilot: MavAutopilot::MAV_AUTOPILOT_PX4,
        mavlink_version: 3,
        ..Default::default()
    };
    let mut reader = FrameReader::default();
    // The type lies behind four bytes of custom mode, one of which has the same value.
    reader.push(&with_byte(&heartbeat, 4, 250));
    let expected = HEARTBEAT_DATA { mavtype: MavType::MAV_TYPE_GENERIC, ..heartbeat };
    assert_eq!(read_all(&mut reader), [MavMessage::HEARTBEAT(expected)]);
    assert_eq!(reader.unknown_messages(), 0);
}

#[test]
fn an_answer_that_is_newer_than_the_dialect_is_none() {
    let ack = COMMAND_ACK_DATA {
        command: MavCmd::MAV_CMD_COMPONENT_ARM_DISARM,
        result: MavResult::MAV_RESULT_FAILED,
        target_system: 1,
        ..Default::default()
    };
    let mut reader = FrameReader::default();
    reader.push(&with_byte(&ack, 2, 200));
    assert_eq!(read_all(&mut reader), [], "0 would be `accepted`");
    assert_eq!(reader.unknown_messages(), 1);
}

#[test]
fn a_writer_can_speak_mavlink_1() {
    let mut writer = FrameWriter::new(Address { system_id: 255, component_id: 190 });
    writer.speak(MavlinkVersion::V1);
    writer.write(&HEARTBEAT_DATA {
        mavtype: MavType::MAV_TYPE_GCS,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        base_mode: MavModeFlag::empty(),
        mavlink_version: 3,
        ..Default::default()
    });
    assert_eq!(writer.take(), heartbeat_v1());
}
