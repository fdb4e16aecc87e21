//! Several ground stations at one autopilot: each is told what is so.

#![allow(deprecated)] // Stations still send what is.

use std::time::Duration;

use crate::lossy_link::{Pair, datum};
use nalgebra::Vector3;
use skein_mav::messages::{
    LOG_REQUEST_LIST_DATA, MISSION_ACK_DATA, MISSION_CLEAR_ALL_DATA, MISSION_COUNT_DATA, MISSION_ITEM_DATA,
    MISSION_ITEM_INT_DATA, MISSION_REQUEST_INT_DATA, MISSION_REQUEST_LIST_DATA, MavCmd, MavFrame, MavMessage,
    MavMissionResult, MavMissionType, PING_DATA,
};
use skein_mav::{Address, Endpoint, FrameReader, FrameWriter, MissionItem, Request};

use MavMissionResult::{
    MAV_MISSION_ACCEPTED as ACCEPTED, MAV_MISSION_DENIED as DENIED,
    MAV_MISSION_OPERATION_CANCELLED as CANCELLED, MAV_MISSION_UNSUPPORTED as UNSUPPORTED,
};
use MavMissionType::{
    MAV_MISSION_TYPE_ALL as ALL, MAV_MISSION_TYPE_FENCE as FENCE, MAV_MISSION_TYPE_MISSION as MISSION,
    MAV_MISSION_TYPE_RALLY as RALLY,
};

/// A station, and the autopilot that it talks to.
struct Station {
    writer: FrameWriter,
    id: u8,
}

impl Station {
    fn new(id: u8) -> Self {
        Self { writer: FrameWriter::new(Address { system_id: id, component_id: 190 }), id }
    }

    /// The autopilot's answers to a message.
    fn say<D: mavlink::MessageData>(&mut self, autopilot: &mut Endpoint, message: &D) -> Vec<MavMessage> {
        self.writer.write(message);
        autopilot.receive(Duration::from_secs(1), &self.writer.take());
        let mut reader = FrameReader::default();
        reader.push(&autopilot.take_output());
        std::iter::from_fn(|| reader.next_frame()).map(|frame| frame.message).collect()
    }

    fn count(&mut self, autopilot: &mut Endpoint, kind: MavMissionType, count: u16) -> Vec<Told> {
        let message = MISSION_COUNT_DATA {
            count,
            target_system: 3,
            target_component: 1,
            mission_type: kind,
            opaque_id: 0,
        };
        told(self.say(autopilot, &message))
    }

    fn item(&mut self, autopilot: &mut Endpoint, kind: MavMissionType, seq: u16) -> Vec<Told> {
        let message = MISSION_ITEM_INT_DATA {
            seq,
            target_system: 3,
            target_component: 1,
            command: MavCmd::MAV_CMD_NAV_WAYPOINT,
            frame: MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
            x: 473_000_000 + i32::from(seq),
            y: 85_000_000,
            z: 5.0,
            mission_type: kind,
            ..Default::default()
        };
        told(self.say(autopilot, &message))
    }

    fn clear(&mut self, autopilot: &mut Endpoint, kind: MavMissionType) -> Vec<Told> {
        let message = MISSION_CLEAR_ALL_DATA { target_system: 3, target_component: 1, mission_type: kind };
        told(self.say(autopilot, &message))
    }

    fn upload(&mut self, autopilot: &mut Endpoint, kind: MavMissionType, count: u16) -> Vec<Told> {
        let mut answers = self.count(autopilot, kind, count);
        while let [Told::Asked(id, _, seq)] = answers[..]
            && id == self.id
        {
            answers = self.item(autopilot, kind, seq);
        }
        answers
    }

    /// The items that it reads back.
    fn read_back(&mut self, autopilot: &mut Endpoint, kind: MavMissionType) -> Vec<i32> {
        let (target_system, target_component, mission_type) = (3, 1, kind);
        let list = MISSION_REQUEST_LIST_DATA { target_system, target_component, mission_type };
        let answers = self.say(autopilot, &list);
        let [MavMessage::MISSION_COUNT(count)] = &answers[..] else { panic!("a count: {answers:?}") };
        assert_eq!(count.mission_type, kind);
        let mut read = |seq| {
            let ask = MISSION_REQUEST_INT_DATA { seq, target_system, target_component, mission_type };
            let answers = self.say(autopilot, &ask);
            let [MavMessage::MISSION_ITEM_INT(item)] = &answers[..] else { panic!("an item: {answers:?}") };
            assert_eq!((item.seq, item.mission_type), (seq, kind));
            item.x - 473_000_000
        };
        (0..count.count).map(&mut read).collect()
    }
}

/// An acknowledgement or a request of the mission protocol, and whom it is for.
#[derive(Debug, PartialEq)]
enum Told {
    Ended(u8, MavMissionType, MavMissionResult),
    Asked(u8, MavMissionType, u16),
}

fn told(messages: Vec<MavMessage>) -> Vec<Told> {
    let read = |message| match message {
        MavMessage::MISSION_ACK(ack) => Some(Told::Ended(ack.target_system, ack.mission_type, ack.mavtype)),
        MavMessage::MISSION_REQUEST_INT(ask) => {
            Some(Told::Asked(ask.target_system, ask.mission_type, ask.seq))
        }
        _ => None,
    };
    messages.into_iter().filter_map(read).collect()
}

fn autopilot() -> Endpoint {
    Pair::new(0.0, 1).endpoint
}

#[test]
fn a_mission_a_fence_and_rally_points_are_kept_apart_and_given_back() {
    let (mut autopilot, mut station) = (autopilot(), Station::new(250));
    for (kind, count) in [(MISSION, 4), (FENCE, 3), (RALLY, 1)] {
        assert_eq!(station.upload(&mut autopilot, kind, count), [Told::Ended(250, kind, ACCEPTED)]);
    }
    let mut changes = std::iter::from_fn(|| autopilot.next_request());
    assert!(matches!(changes.next(), Some(Request::MissionChanged)));
    assert!(changes.all(|change| matches!(change, Request::PlacesChanged)));
    assert_eq!(station.read_back(&mut autopilot, MISSION), [0, 1, 2, 3]);
    assert_eq!(station.read_back(&mut autopilot, FENCE), [0, 1, 2]);
    assert_eq!(station.read_back(&mut autopilot, RALLY), [0]);
    assert_eq!(station.clear(&mut autopilot, FENCE), [Told::Ended(250, FENCE, ACCEPTED)]);
    assert!(station.read_back(&mut autopilot, FENCE).is_empty());
    assert_eq!(station.read_back(&mut autopilot, MISSION).len(), 4);
    assert_eq!(station.clear(&mut autopilot, ALL), [Told::Ended(250, ALL, ACCEPTED)]);
    assert!(autopilot.mission().is_empty() && autopilot.rally_points().is_empty());
}

#[test]
fn a_fence_that_is_none_is_refused_and_the_old_one_stays() {
    let (mut autopilot, mut station) = (autopilot(), Station::new(250));
    station.upload(&mut autopilot, FENCE, 3);
    assert_eq!(station.upload(&mut autopilot, FENCE, 2), [Told::Ended(250, FENCE, UNSUPPORTED)]);
    assert_eq!(station.read_back(&mut autopilot, FENCE).len(), 3);
}

#[test]
fn while_one_uploads_another_neither_clears_nor_uploads() {
    let (mut autopilot, mut one, mut other) = (autopilot(), Station::new(250), Station::new(251));
    assert_eq!(one.count(&mut autopilot, MISSION, 2), [Told::Asked(250, MISSION, 0)]);
    assert_eq!(other.clear(&mut autopilot, MISSION), [Told::Ended(251, MISSION, DENIED)]);
    assert_eq!(other.clear(&mut autopilot, ALL), [Told::Ended(251, ALL, DENIED)]);
    assert_eq!(other.count(&mut autopilot, FENCE, 3), [Told::Ended(251, FENCE, DENIED)]);
    assert_eq!(other.item(&mut autopilot, MISSION, 0), [], "its items are nobody's");
    assert_eq!(one.item(&mut autopilot, MISSION, 0), [Told::Asked(250, MISSION, 1)]);
    assert_eq!(one.item(&mut autopilot, MISSION, 1), [Told::Ended(250, MISSION, ACCEPTED)]);
    assert_eq!(other.read_back(&mut autopilot, MISSION), [0, 1]);
    assert_eq!(other.clear(&mut autopilot, MISSION), [Told::Ended(251, MISSION, ACCEPTED)]);
}

#[test]
fn who_clears_in_its_own_upload_is_told_that_this_is_over() {
    let (mut autopilot, mut station) = (autopilot(), Station::new(250));
    station.count(&mut autopilot, MISSION, 2);
    let answers = station.clear(&mut autopilot, MISSION);
    assert_eq!(answers, [Told::Ended(250, MISSION, CANCELLED), Told::Ended(250, MISSION, ACCEPTED)]);
    station.count(&mut autopilot, MISSION, 2);
    let gives_up =
        MISSION_ACK_DATA { target_system: 3, target_component: 1, mavtype: CANCELLED, ..Default::default() };
    station.say(&mut autopilot, &gives_up);
    let mut other = Station::new(251);
    assert_eq!(other.upload(&mut autopilot, MISSION, 1), [Told::Ended(251, MISSION, ACCEPTED)]);
}

#[test]
fn items_in_degrees_are_read_as_well() {
    let (mut autopilot, mut station) = (autopilot(), Station::new(250));
    station.count(&mut autopilot, MISSION, 1);
    let place = Vector3::new(30.0, 40.0, 6.0);
    let at = datum().to_geodetic(&place);
    let item = MISSION_ITEM_DATA {
        target_system: 3,
        target_component: 1,
        command: MavCmd::MAV_CMD_NAV_WAYPOINT,
        frame: MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
        x: at.latitude_rad.to_degrees() as f32,
        y: at.longitude_rad.to_degrees() as f32,
        z: 6.0,
        ..Default::default()
    };
    assert_eq!(told(station.say(&mut autopilot, &item)), [Told::Ended(250, MISSION, ACCEPTED)]);
    let read: &MissionItem = &autopilot.mission()[0];
    assert!((read.position(&datum(), datum().height_m).unwrap() - place).norm() < 2.0, "as exact as a float");
}

#[test]
fn a_ping_and_the_list_of_logs_are_answered() {
    let (mut autopilot, mut station) = (autopilot(), Station::new(250));
    let ping = PING_DATA { time_usec: 7, seq: 9, ..Default::default() };
    let answers = station.say(&mut autopilot, &ping);
    assert!(matches!(
        &answers[..],
        [MavMessage::PING(PING_DATA { time_usec: 7, seq: 9, target_system: 250, .. })]
    ));
    let logs = LOG_REQUEST_LIST_DATA { target_system: 3, target_component: 1, ..Default::default() };
    let answers = station.say(&mut autopilot, &logs);
    assert!(matches!(&answers[..], [MavMessage::LOG_ENTRY(entry)] if entry.num_logs == 0));
}
