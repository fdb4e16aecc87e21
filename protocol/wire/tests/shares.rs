//! Whatever one member sends, the others are heard, and a node takes no more of it than that member's share.

use std::time::Duration;

use skein_bp::{Bound, Event, EventSet, Program, ProgramConfig};
use skein_dbp::{BidRecord, Board, Message, Node, NodeConfig, OnLoss, RemoteBid};
use skein_wire::{
    Fleet, Key, Link as _, MemoryLink, Network, NetworkConfig, NodeLink, Payload, SenderStats, State,
};

use crate::swarm::name;

/// `uav/1`, and the links of the two other members and of a stranger.
struct Fixture {
    network: Network,
    node: NodeLink,
    link: MemoryLink,
    now: Duration,
}

impl Fixture {
    fn new() -> Self {
        let network = Network::new(NetworkConfig::default(), 1);
        let roster = vec![name("uav/2"), name("uav/3")];
        let node =
            Node::new(NodeConfig::new(name("uav/1"), 1, roster), Program::new(ProgramConfig::vehicle(1)));
        let link = network.join(&name("uav/1"));
        Self { node: NodeLink::new(node, fleet()).reading_boards(), network, link, now: Duration::ZERO }
    }

    fn tick(&mut self) {
        self.now += Duration::from_millis(20);
        self.network.advance(self.now);
        self.node.pump(self.now, &mut self.link).unwrap();
    }

    fn of(&self, sender: &str) -> SenderStats {
        let of = |(name, _): &(Option<&skein_wire::NodeName>, SenderStats)| {
            name.map_or("", |name| name.as_str()) == sender
        };
        self.node.senders().find(of).map(|(_, stats)| stats).unwrap_or_default()
    }
}

fn fleet() -> Fleet {
    Fleet::new("demo").unwrap()
}

fn state(sender: &str) -> (Key, Vec<u8>) {
    (Key::to_all::<State>(&fleet(), name(sender)), Payload::State(State::new(name(sender))).encode())
}

fn record(epoch: u64, block: EventSet) -> (Key, Vec<u8>) {
    let (node, home) = (name("uav/2"), name("uav/1"));
    let key = Key::to_one::<BidRecord>(&fleet(), node.clone(), home.clone());
    let bids = vec![RemoteBid {
        bthread: "hostile".into(),
        sync: 1,
        requests: vec![],
        block,
        block_since: 1,
        priority: None,
        on_loss: OnLoss::Release,
    }];
    let (home_incarnation, sent_at) = (Some(1), Duration::ZERO);
    let record = BidRecord {
        node,
        incarnation: 1,
        home,
        home_incarnation,
        epoch,
        sent_at,
        applied: 0,
        term: 0,
        decided: 0,
        lease_ms: 1000,
        bids,
    };
    (key, Payload::Message(Message::Bid(record)).encode())
}

#[test]
fn a_block_inside_46_intersections_is_passed_over_and_named() {
    let mut fixture = Fixture::new();
    let mut hostile = fixture.network.join(&name("uav/2"));
    let deep = (0..46).fold(EventSet::from("uav/*/advance"), |set, _| EventSet::And(vec![set]));
    let (key, bytes) = record(1, deep.clone());
    assert!(bytes.len() < 300, "{}", bytes.len());
    let error = Payload::decode(&bytes).unwrap_err().to_string();
    assert!(error.contains("47 levels") && error.contains("bound `set_depth`"), "{error}");
    hostile.put(&key, bytes);
    fixture.tick();
    assert_eq!(fixture.of("uav/2").undecodable, 1);
    // Shallow enough for a file, and too deep for a block that is to be kept.
    let deep = (0..13).fold(EventSet::from("uav/*/advance"), |set, _| EventSet::And(vec![set]));
    let error = Payload::decode(&record(1, deep).1).unwrap_err().to_string();
    assert!(error.contains("bound `asked_depth`"), "{error}");
}

#[test]
fn who_floods_is_read_up_to_its_share_and_the_others_are_heard() {
    let mut fixture = Fixture::new();
    let [mut hostile, mut honest, mut stranger] =
        ["uav/2", "uav/3", "uav/9"].map(|node| fixture.network.join(&name(node)));
    for tick in 1..=20 {
        for number in 0..1000 {
            let (key, bytes) = state("uav/2");
            hostile.put(&key, bytes);
            let (key, bytes) = state(&format!("uav/x{number}"));
            stranger.put(&key, bytes);
        }
        let (key, bytes) = state("uav/3");
        honest.put(&key, bytes);
        fixture.tick();
        assert!(fixture.of("uav/2").messages <= tick * 128, "{:?}", fixture.of("uav/2"));
    }
    (0..100).for_each(|_| fixture.tick());
    assert_eq!(
        fixture.of("uav/3"),
        SenderStats { messages: 20, bytes: fixture.of("uav/3").bytes, ..SenderStats::default() }
    );
    assert!(fixture.of("uav/2").dropped > 10_000 && fixture.of("").messages == 0);
    assert!(
        fixture.of("").strange > 10_000
            && fixture.node.take_states().iter().all(|state| state.node != name("uav/9"))
    );
}

#[test]
fn messages_that_are_too_long_for_their_kind_are_not_read() {
    let mut fixture = Fixture::new();
    let mut hostile = fixture.network.join(&name("uav/2"));
    let (key, _) = record(1, EventSet::None);
    (0..2).for_each(|_| hostile.put(&key, vec![0; 400_000]));
    fixture.tick();
    assert_eq!((fixture.of("uav/2").oversized, fixture.of("uav/2").messages), (2, 0));
}

#[test]
fn of_a_member_s_boards_the_newest_waits_and_of_a_stranger_s_none() {
    let mut fixture = Fixture::new();
    for sender in ["uav/2", "uav/9"] {
        let mut link = fixture.network.join(&name(sender));
        for at in 1..50 {
            let board = Board::new(name(sender), 1, Duration::from_secs(at), vec![]);
            link.put(&Key::to_all::<Board>(&fleet(), name(sender)), Payload::Board(board).encode());
        }
    }
    fixture.tick();
    let boards: Vec<_> = fixture.node.take_boards().into_iter().map(|board| (board.node, board.at)).collect();
    assert_eq!(boards, [(name("uav/2"), Duration::from_secs(49))]);
}

#[test]
fn what_others_would_not_take_in_is_not_said() {
    // An event that no decoder lets through would be a hole in this node's stream for ever.
    let long = Event::new("uav/1/x").with("a", "y".repeat(40_000)).with("b", "z".repeat(40_000));
    let served =
        skein_dbp::ServedRequest { node: name("uav/2"), incarnation: 1, bthread: "b".into(), sync: 1 };
    let occurrence = skein_dbp::Occurrence {
        home: name("uav/1"),
        incarnation: 1,
        seq: 1,
        term: 0,
        event: long,
        requests_served: vec![served; 1000],
        requested_by: vec!["x".repeat(900).into(); 1000],
        choice: None,
        at: Duration::ZERO,
    };
    let bytes = Payload::Message(Message::Occurrence(occurrence)).encode();
    let Ok(Payload::Message(Message::Occurrence(read))) = Payload::decode(&bytes) else {
        panic!("it is not read")
    };
    assert!(read.event.text("a").unwrap().len() <= Bound::EventBytes.stated());
    assert!(bytes.len() <= Key::to_all::<skein_dbp::Occurrence>(&fleet(), name("uav/1")).most_bytes());
}

#[test]
fn a_place_beyond_the_world_is_none_and_long_words_are_cut() {
    let mut far = State::new(name("uav/2"));
    far.position.x = 2e6;
    let mut far_ahead = State::new(name("uav/2"));
    far_ahead.path = vec![[0.0, -1e300, 0.0].into()];
    for far in [far, far_ahead] {
        let error = Payload::decode(&Payload::State(far).encode()).unwrap_err().to_string();
        assert!(error.contains("bound `place_m`"), "{error}");
    }
    let mut wordy = State::new(name("uav/2"));
    wordy.task = "é".repeat(5000);
    (wordy.holder, wordy.asked_by) = (wordy.task.clone(), wordy.task.clone());
    (wordy.radius_m, wordy.position_sigma_m) = (1e6, 1e6);
    wordy.velocity = [1e300, 0.0, -1e300].into();
    let Ok(Payload::State(mut read)) = Payload::decode(&Payload::State(wordy).encode()) else {
        panic!("it is not read")
    };
    assert!(read.bring_to_what_is_believed() && !State::new(name("uav/2")).bring_to_what_is_believed());
    assert_eq!((read.radius_m, read.position_sigma_m), (5.0, 4.0));
    let mut lost = State { position_sigma_m: 100.0, ..State::new(name("uav/2")) };
    assert!(!lost.bring_to_what_is_believed() && lost.position_sigma_m == 4.0, "it has no satellites yet");
    assert!((read.velocity.norm() - 50.0).abs() < 1e-9, "{}", read.velocity);
    for text in [&read.task, &read.holder, &read.asked_by] {
        assert!(text.len() <= Bound::TextBytes.stated() && text.ends_with('…'));
    }
}
