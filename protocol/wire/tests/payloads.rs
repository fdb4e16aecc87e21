//! Messages survive the way over the wire, and nothing that arrives can do harm.

use std::time::Duration;

use proptest::prelude::*;
use prost::Message as _;
use skein_bp::{Event, EventSet, Pattern};
use skein_dbp::{
    BidAck, BidRecord, JointWord, Message, Occurrence, OnLoss, Presence, Refusal, RefusalReason, RemoteBid,
    Repair, ServedRequest,
};
use skein_wire::{Check, CheckState, DecodeError, Echo, NodeName, Payload, Readiness, State, VERSION, proto};

fn node_name() -> impl Strategy<Value = NodeName> {
    "[a-z]{1,8}/[a-z0-9_.-]{1,8}".prop_map(|name| NodeName::new(&name).unwrap())
}

fn event() -> impl Strategy<Value = Event> {
    let data = (any::<bool>(), any::<i64>(), any::<f64>(), ".{0,8}");
    ("[a-z]{1,5}/[0-9]{1,2}/[a-z]{1,8}", data).prop_map(|(name, (flag, int, real, text))| {
        Event::new(name).with("flag", flag).with("int", int).with("real", real).with("text", text)
    })
}

fn event_set() -> impl Strategy<Value = EventSet> {
    let leaf = prop_oneof![
        Just(EventSet::None),
        Just(EventSet::All),
        event().prop_map(EventSet::Exactly),
        "[a-z*]{1,3}/[a-z*]{1,3}".prop_map(|text| EventSet::Named(Pattern::new(text))),
        "[a-z*]{1,3}/[a-z*]{1,3}".prop_map(|text| EventSet::Named(Pattern::literal(text))),
        "[a-z/]{0,6}".prop_map(EventSet::prefix),
        // A border of -0 is one of 0: they hold the same numbers.
        (any::<f64>(), any::<f64>()).prop_map(|(min, max)| EventSet::field_range("z", min + 0.0, max + 0.0)),
        any::<i64>().prop_map(|value| EventSet::field_is("n", value)),
        any::<[f64; 3]>()
            .prop_map(|corner| corner.map(|x| x + 0.0))
            .prop_map(|corner| EventSet::region(corner, corner)),
    ];
    leaf.prop_recursive(4, 24, 4, |set| {
        prop_oneof![
            set.clone().prop_map(|set| EventSet::Not(Box::new(set))),
            prop::collection::vec(set.clone(), 0..4).prop_map(EventSet::And),
            prop::collection::vec(set, 0..4).prop_map(EventSet::Or),
        ]
    })
}

prop_compose! {
    fn remote_bid()(
        bthread in "[a-z ]{0,9}", sync in 1..u64::MAX / 2, requests in prop::collection::vec(event(), 0..3),
        block in event_set(), earlier in 0..u64::MAX, priority in any::<Option<i32>>(), hold in any::<bool>(),
    ) -> RemoteBid {
        // A set that surely holds nothing travels as none at all.
        let block = if block.is_none() { EventSet::None } else { block };
        let block_since = sync.saturating_sub(earlier);
        RemoteBid { bthread, sync, requests, block, block_since, priority, on_loss: if hold { OnLoss::Hold } else { OnLoss::Release } }
    }
}

prop_compose! {
    fn message()(
        (a, b) in (node_name(), node_name()), which in 0..5, incarnation in any::<u64>(), known in any::<Option<u64>>(),
        (n, m) in (1..u64::MAX / 2, 1..u64::MAX / 2), at in any::<u64>().prop_map(Duration::from_nanos),
        bids in prop::collection::vec(remote_bid(), 0..4), event in event(),
    ) -> Message {
        let request = ServedRequest { node: b.clone(), incarnation, bthread: "x".into(), sync: m };
        let refusal = Refusal { bthread: "x".into(), sync: n, reason: RefusalReason::Quota };
        match which {
            0 => Message::Bid(BidRecord {
                node: a, incarnation, home: b, home_incarnation: known, epoch: n, sent_at: at, applied: m, term: n, decided: m, lease_ms: 1000, bids,
            }),
            1 => Message::Ack(BidAck {
                home: a, home_incarnation: incarnation, node: b, incarnation, epoch: n, sent_at: at, latest_seq: m,
                refused: vec![refusal],
            }),
            2 => Message::Occurrence(Occurrence { home: a, incarnation, seq: n, term: m, event, requests_served: vec![request], requested_by: vec!["mission".into()], choice: Some("priority 10".into()), at }),
            3 => Message::Repair(Repair { home: a, incarnation, from_seq: n, to_seq: m, term: n, requester: b }),
            _ => Message::Presence(Presence { node: a, incarnation, up: at, latest_seq: n, oldest_seq: m, lease_ms: 1000,
                joint: known.map(|ns| JointWord { term: n, decided: m, heard: Some(Duration::from_nanos(ns)), asks: incarnation % 2 == 0 }),
            }),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_message_survives_the_way_over_the_wire(message in message()) {
        let payload = Payload::Message(message);
        let back = Payload::decode(&payload.encode()).unwrap();
        // Through text, because a NaN differs from itself.
        prop_assert_eq!(format!("{back:?}"), format!("{payload:?}"));
    }

    #[test]
    fn any_bytes_are_a_message_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = Payload::decode(&bytes);
    }

    #[test]
    fn a_damaged_message_is_a_message_or_an_error(message in message(), at in any::<prop::sample::Index>(), byte in any::<u8>()) {
        let mut bytes = Payload::Message(message).encode();
        let at = at.index(bytes.len());
        bytes[at] = byte;
        let _ = Payload::decode(&bytes);
        let _ = Payload::decode(&bytes[..at]);
    }
}

fn state() -> State {
    State {
        battery: 0.5,
        mode: "offboard".into(),
        path: vec![Default::default(); 40],
        holder: "Anna".into(),
        asked_by: "Ben".into(),
        echo: Some(Echo {
            node: NodeName::new("uav/2").unwrap(),
            incarnation: 3,
            time: Duration::from_millis(1500),
            held: Duration::from_millis(20),
        }),
        ..State::new(NodeName::new("uav/1").unwrap())
    }
}

fn encoded(change: impl FnOnce(&mut proto::State)) -> Vec<u8> {
    let mut inner = proto::State::from(&state());
    change(&mut inner);
    proto::Packet { version: VERSION, body: Some(proto::packet::Body::State(inner)) }.encode_to_vec()
}

#[test]
fn a_long_path_is_cut_for_the_way() {
    let Payload::State(back) = Payload::decode(&Payload::State(state()).encode()).unwrap() else {
        panic!("not a state")
    };
    assert_eq!(back.path.len(), State::MAX_PATH);
    assert_eq!(back.mode, "offboard");
    assert_eq!(back.echo, state().echo);
}

#[test]
fn impossible_states_are_refused_with_the_field_at_fault() {
    type Change = fn(&mut proto::State);
    let cases: [(&str, Change); 6] = [
        ("State.battery", |state| state.battery = 1.5),
        ("State.battery", |state| state.battery = f64::NAN),
        ("State.position", |state| state.position = None),
        ("State.velocity", |state| state.velocity = Some(proto::Vec3 { x: f64::INFINITY, y: 0.0, z: 0.0 })),
        ("State.radius_m", |state| state.radius_m = -1.0),
        ("State.node", |state| state.node = "uav".into()),
    ];
    for (field, change) in cases {
        let error = Payload::decode(&encoded(change)).unwrap_err().to_string();
        assert!(error.contains(field), "{error} does not name {field}");
    }
}

#[test]
fn versions_and_lengths_are_checked() {
    let packet = |version| proto::Packet { version, body: None }.encode_to_vec();
    assert_eq!(Payload::decode(&packet(0)), Err(DecodeError::Version { given: 0 }));
    assert_eq!(Payload::decode(&packet(VERSION + 1)), Err(DecodeError::Version { given: VERSION + 1 }));
    assert_eq!(Payload::decode(&packet(VERSION)), Err(DecodeError::Missing { field: "Packet.body" }));
    assert!(matches!(Payload::decode(&vec![0; 2 << 20]), Err(DecodeError::TooLong { .. })));
}

#[test]
fn fields_of_a_later_version_are_passed_over() {
    let mut bytes = Payload::State(state()).encode();
    // Field 1000 of the packet, a text.
    bytes.extend([0xc2, 0x3e, 3, b'n', b'e', b'w']);
    assert!(Payload::decode(&bytes).is_ok());
}

#[test]
fn a_bottomless_set_is_refused() {
    let mut set = proto::EventSet { form: Some(proto::event_set::Form::All(proto::event_set::Unit {})) };
    for _ in 0..500 {
        set = proto::EventSet { form: Some(proto::event_set::Form::Not(Box::new(set))) };
    }
    let bid = proto::RemoteBid { bthread: "x".into(), sync: 1, block: Some(set), ..Default::default() };
    let record = proto::BidRecord {
        node: "uav/1".into(),
        home: "uav/2".into(),
        epoch: 1,
        bids: vec![bid],
        ..Default::default()
    };
    let bytes =
        proto::Packet { version: VERSION, body: Some(proto::packet::Body::Bid(record)) }.encode_to_vec();
    assert!(matches!(Payload::decode(&bytes), Err(DecodeError::Protobuf(_))));
}

#[test]
fn the_descriptor_set_holds_the_trace_schema() {
    let text = String::from_utf8_lossy(skein_wire::FILE_DESCRIPTOR_SET);
    assert!(text.contains("TraceEvent") && text.contains("skein.proto"));
}

fn readiness() -> Readiness {
    let check = |state| Check {
        name: "home".into(),
        state,
        value: "stands 12 m west of its home".into(),
        advice: "carry it to its pad".into(),
    };
    Readiness {
        node: NodeName::new("uav/1").unwrap(),
        incarnation: 3,
        home: [1.0, -2.0, 0.5],
        datum: [47.397742, 8.545594, 488.0],
        checks: [CheckState::Passes, CheckState::Fails, CheckState::Waits].map(check).into(),
        mission: vec![[10.0, 0.0, 3.0], [20.0, -4.5, 6.0]],
    }
}

#[test]
fn checks_survive_the_way_over_the_wire_and_those_that_do_not_pass_are_told() {
    let payload = Payload::Readiness(readiness());
    assert_eq!(Payload::decode(&payload.encode()), Ok(payload));
    let faults: Vec<_> = readiness().faults().map(|check| check.state).collect();
    assert_eq!(faults, [CheckState::Fails, CheckState::Waits]);
    assert!(!readiness().is_ready());
}

#[test]
fn impossible_checks_are_refused_with_the_field_at_fault() {
    type Change = fn(&mut proto::Readiness);
    let cases: [(&str, Change); 6] = [
        ("Readiness.home", |said| said.home = Some(proto::Vec3 { x: f64::NAN, y: 0.0, z: 0.0 })),
        ("Readiness.datum", |said| {
            said.datum = Some(proto::Datum { latitude_deg: 91.0, longitude_deg: 0.0, height_m: 0.0 });
        }),
        ("Readiness.datum", |said| said.datum = None),
        ("Readiness.checks", |said| said.checks = vec![proto::Check::default(); 65]),
        ("Readiness.mission", |said| said.mission = vec![proto::Vec3::default(); 65]),
        ("Readiness.mission", |said| said.mission = vec![proto::Vec3 { x: f64::INFINITY, y: 0.0, z: 0.0 }]),
    ];
    for (field, change) in cases {
        let mut inner = proto::Readiness::from(&readiness());
        change(&mut inner);
        let body = Some(proto::packet::Body::Readiness(inner));
        let bytes = proto::Packet { version: VERSION, body }.encode_to_vec();
        let error = Payload::decode(&bytes).unwrap_err().to_string();
        assert!(error.contains(field), "{error} does not name {field}");
    }
}
