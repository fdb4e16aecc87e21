//! Whatever a node is told, it neither fails nor believes what the teller has no say in.

use std::time::Duration;

use proptest::prelude::*;
use skein_bp::script::{Op, Script};
use skein_bp::{Bid, Event, EventSet, Program, ProgramConfig};
use skein_dbp::{
    BidAck, BidRecord, JointWord, Message, Node, NodeConfig, NodeName, Occurrence, OnLoss, Presence,
    Recipient, RemoteBid, Repair, Roster, ServedRequest,
};

fn name(text: &str) -> NodeName {
    NodeName::new(text).unwrap()
}

/// `uav/1`, which flies, lands and holds `uav/2`.
fn node() -> Node {
    node_with(None)
}

/// A node, of a fleet that decides together under this coordinator.
fn node_with(coordinator: Option<&str>) -> Node {
    let mut program = Program::new(ProgramConfig::vehicle(1));
    let ask = Bid::new().request("uav/2/a").block("uav/*/b");
    program.add("ask", Script::new(&[Op::forever([Op::Sync(ask)])]).unwrap());
    let wait = Bid::new().wait_for(EventSet::All).priority(1);
    program.add("listen", Script::new(&[Op::forever([Op::Sync(wait)])]).unwrap());
    let config = NodeConfig {
        safety: EventSet::from("uav/1/land"),
        joint: coordinator
            .map(|coordinator| Roster::first(name(coordinator), ["uav/1", "uav/2", "uav/3"].map(name))),
        durable: coordinator.is_some(),
        ..NodeConfig::new(name("uav/1"), 3, vec![name("uav/2"), name("uav/3")])
    };
    let mut node = Node::new(config, program);
    node.step(Duration::ZERO).unwrap();
    node
}

fn occurrence(home: &str, seq: u64, event: &str) -> Message {
    let (home, event) = (name(home), Event::new(event));
    Message::Occurrence(Occurrence {
        home,
        incarnation: 1,
        seq,
        term: 0,
        event,
        requests_served: vec![],
        requested_by: Vec::new(),
        choice: None,
        at: Duration::ZERO,
    })
}

fn presence(node: &str, latest_seq: u64) -> Message {
    let up = Duration::ZERO;
    Message::Presence(Presence {
        node: name(node),
        incarnation: 1,
        up,
        latest_seq,
        oldest_seq: 1,
        lease_ms: 1000,
        joint: None,
    })
}

/// The names of what has happened, but for the node's own facts.
fn heard(node: &mut Node) -> Vec<String> {
    node.step(Duration::from_millis(20)).unwrap();
    let happened = node.take_selections().into_iter().filter(|happened| happened.home != name("uav/1"));
    happened.map(|happened| happened.event.name().into()).collect()
}

#[test]
fn a_home_cannot_speak_for_another_one() {
    let mut node = node();
    node.handle(Duration::ZERO, presence("uav/2", 0));
    for (seq, event) in [(1, "uav/1/land"), (2, "uav/3/step"), (3, "tick"), (4, "uav/2/step")] {
        node.handle(Duration::ZERO, occurrence("uav/2", seq, event));
    }
    assert_eq!(heard(&mut node), ["uav/2/step"]);
}

#[test]
fn strangers_and_lives_that_are_over_are_not_heard() {
    let mut node = node();
    node.handle(Duration::ZERO, presence("uav/9", 0));
    node.handle(Duration::ZERO, occurrence("uav/9", 1, "uav/9/step"));
    node.handle(Duration::ZERO, presence("uav/2", 0));
    let young = Presence {
        node: name("uav/3"),
        incarnation: 7,
        up: Duration::ZERO,
        latest_seq: 0,
        oldest_seq: 1,
        lease_ms: 1000,
        joint: None,
    };
    node.handle(Duration::ZERO, Message::Presence(young));
    node.handle(Duration::ZERO, occurrence("uav/3", 1, "uav/3/step"));
    assert_eq!(heard(&mut node), Vec::<String>::new());
    assert_eq!(node.stats().ignored, 3);
}

fn sign_of_life(node: &str, incarnation: u64) -> Message {
    let Message::Presence(presence) = presence(node, 0) else { unreachable!() };
    Message::Presence(Presence { incarnation, ..presence })
}

#[test]
fn a_huge_incarnation_or_term_locks_nobody_out() {
    let mut node = node_with(Some("uav/1"));
    for (peer, before) in [("uav/2", None), ("uav/3", Some(7))] {
        before.into_iter().for_each(|life| node.handle(Duration::ZERO, sign_of_life(peer, life)));
        node.handle(Duration::ZERO, sign_of_life(peer, u64::MAX));
        node.handle(Duration::ZERO, sign_of_life(peer, 8));
        let known = node.peers().find(|(name, _)| name.as_str() == peer).unwrap().1;
        assert_eq!((known.incarnation, known.alive), (Some(8), true), "{peer}");
    }
    let first = Roster::first(name("uav/1"), ["uav/2", "uav/3"].map(name));
    for (term, taken) in [(i64::MAX.unsigned_abs(), false), (2, true)] {
        node.enqueue(Roster { term, ..first.clone() }.order(&name("uav/1")));
        node.step(Duration::from_millis(20)).unwrap();
        assert_eq!(node.roster().unwrap().term == term, taken, "term {term}");
    }
}

#[test]
fn who_speaks_in_a_life_before_the_last_is_told_and_learns_which_one_that_was() {
    let mut node = node();
    node.handle(Duration::ZERO, sign_of_life("uav/2", 57));
    node.take_outgoing();
    let mut told = Vec::new();
    for tick in 0..100 {
        node.handle(Duration::from_millis(20 * tick), sign_of_life("uav/2", 1));
        told.extend(node.take_outgoing());
    }
    let [(Recipient::Node(to), Message::Repair(told))] = &told[..] else { panic!("{told:?}") };
    assert_eq!((to.as_str(), told.home.as_str(), told.incarnation), ("uav/2", "uav/2", 57));

    // The other end: here the life is the third.
    let asked = |requester: &str, incarnation| {
        let (home, requester) = (name("uav/1"), name(requester));
        Message::Repair(Repair { home, incarnation, from_seq: 1, to_seq: 1, term: 0, requester })
    };
    for (requester, life, known) in [
        ("uav/2", 2, None),
        ("uav/9", 57, None),
        ("uav/2", u64::MAX, None),
        ("uav/2", 57, Some(57)),
        ("uav/3", 9, Some(57)),
    ] {
        node.handle(Duration::from_secs(3), asked(requester, life));
        assert_eq!(node.outlived().map(|(_, life)| life), known, "{requester} of life {life}");
    }
}

#[test]
fn an_acknowledgement_of_what_was_never_sent_confirms_nothing() {
    let mut node = node();
    for home in ["uav/2", "uav/3"] {
        node.handle(Duration::ZERO, presence(home, 0));
        for (epoch, sent_at) in [(99, Duration::ZERO), (1, Duration::from_secs(99))] {
            node.handle(
                Duration::ZERO,
                Message::Ack(BidAck {
                    home: name(home),
                    home_incarnation: 1,
                    node: name("uav/1"),
                    incarnation: 3,
                    epoch,
                    sent_at,
                    latest_seq: 0,
                    refused: vec![],
                }),
            );
        }
    }
    node.step(Duration::from_millis(20)).unwrap();
    assert!(node.take_selections().iter().all(|happened| happened.event.name() != "uav/1/confirmed"));
}

#[test]
fn a_record_that_asks_for_too_much_is_cut_down_and_the_rest_is_told() {
    let mut node = node();
    node.handle(Duration::ZERO, presence("uav/2", 0));
    let bid = |bthread: String, event: &str| RemoteBid {
        bthread,
        sync: 1,
        requests: vec![Event::new(event)],
        block: EventSet::All,
        block_since: 1,
        priority: None,
        on_loss: OnLoss::Release,
    };
    let mut bids: Vec<_> = (0..300).map(|n| bid(format!("b{n}"), "uav/1/x")).collect();
    bids[0] = bid("b0".into(), "uav/1/land");
    bids[1] = bid("b1".into(), "uav/3/x");
    bids[2] = RemoteBid { on_loss: OnLoss::Hold, ..bid("b2".into(), "uav/1/x") };
    let record = BidRecord {
        node: name("uav/2"),
        incarnation: 1,
        home: name("uav/1"),
        home_incarnation: Some(3),
        epoch: 1,
        sent_at: Duration::ZERO,
        applied: 0,
        term: 0,
        decided: 0,
        lease_ms: 1000,
        bids,
    };
    node.handle(Duration::ZERO, Message::Bid(record));
    let acks: Vec<_> = node
        .take_outgoing()
        .into_iter()
        .filter_map(|(to, message)| match message {
            Message::Ack(ack) if to == Recipient::Node(name("uav/2")) => Some(ack),
            _ => None,
        })
        .collect();
    assert_eq!(acks.len(), 1);
    let reasons: Vec<_> =
        acks[0].refused.iter().map(|refusal| (&*refusal.bthread, refusal.reason.word())).collect();
    assert_eq!(reasons[..3], [("b0", "safety"), ("b1", "not_home"), ("b2", "hold_unsupported")]);
    assert_eq!(reasons.len(), 3 + 300 - 256);
    assert!(reasons[3..].iter().all(|(_, reason)| *reason == "quota"));
}

fn any_name() -> impl Strategy<Value = NodeName> {
    prop::sample::select(vec!["uav/1", "uav/2", "uav/3", "uav/9"]).prop_map(name)
}

fn any_event() -> impl Strategy<Value = Event> {
    let names = ["uav/1/a", "uav/1/land", "uav/2/a", "uav/3/a", "swarm/a", "tick", "uav/9/a"];
    prop::sample::select(names.to_vec()).prop_map(Event::new)
}

prop_compose! {
    fn any_message()(
        (a, b) in (any_name(), any_name()), which in 0..5, event in any_event(), incarnation in 0..4_u64,
        (n, m, far) in (1..6_u64, 0..6_u64, prop::sample::select(vec![1, 5, u64::MAX / 2])),
        (term, asks) in (0..3_u64, any::<bool>()), at in 0..3000_u64, known in prop::option::of(2..5_u64), lease_ms in prop::sample::select(vec![0, 1000, u64::MAX]),
    ) -> Message {
        let at = Duration::from_millis(at);
        let served = ServedRequest { node: b.clone(), incarnation: 3, bthread: "ask".into(), sync: n };
        let bid = RemoteBid {
            bthread: "x".into(), sync: n, requests: vec![event.clone()], block: EventSet::from("uav/1/*"), block_since: m,
            priority: Some(9), on_loss: if asks { OnLoss::Hold } else { OnLoss::Release },
        };
        match which {
            0 => Message::Bid(BidRecord {
                node: a, incarnation, home: b, home_incarnation: known, epoch: n, sent_at: at, applied: m, term, decided: far, lease_ms, bids: vec![bid],
            }),
            1 => Message::Ack(BidAck {
                home: a, home_incarnation: incarnation, node: b, incarnation: 3, epoch: n, sent_at: at, latest_seq: far, refused: vec![],
            }),
            2 => Message::Occurrence(Occurrence { home: a, incarnation, seq: n.max(far / 2), term, event, requests_served: vec![served], requested_by: Vec::new(), choice: None, at }),
            3 => Message::Repair(Repair { home: a, incarnation: 3, from_seq: m, to_seq: far, term, requester: b }),
            _ => Message::Presence(Presence { node: a, incarnation, up: at, latest_seq: far, oldest_seq: n, lease_ms,
                joint: (term > 0).then_some(JointWord { term, decided: n, heard: known.map(Duration::from_secs), asks }),
            }),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_sequence_of_messages_makes_a_node_fail(
        coordinator in prop::sample::select(vec![None, Some("uav/1"), Some("uav/2")]), messages in prop::collection::vec((any_message(), 0..400_u64), 0..60),
    ) {
        let mut node = node_with(coordinator);
        let mut now = Duration::ZERO;
        for (message, pause_ms) in messages {
            node.handle(now, message);
            prop_assert!(node.next_deadline() >= Duration::ZERO);
            now += Duration::from_millis(pause_ms);
            node.step(now).unwrap();
            node.take_unsaved();
            node.take_outgoing();
            for happened in node.take_selections() {
                prop_assert!(happened.event.name() != "uav/1/land", "a safety event was requested or claimed from afar");
            }
        }
    }
}
