//! Two sessions over TCP on the loopback interface: what holds in memory holds over Zenoh.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, Program, ProgramConfig};
use skein_dbp::{Happened, Node, NodeConfig, NodeName, Occurrence};
use skein_wire::{Fleet, Key, Link, NodeLink, Payload, State};
use skein_zenoh::{NetworkSettings, ZenohConfig, ZenohError, ZenohLink, ZenohSession};

/// States one bid until one of its events happens.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Once(Option<Bid>);

impl BThread for Once {
    fn bid(&self) -> Option<Bid> {
        self.0.clone()
    }

    fn resume(&mut self, _: &Event, _: &mut Context) {
        self.0 = None;
    }
}

fn fleet() -> Fleet {
    Fleet::new("test").unwrap()
}

fn config(connect: Vec<String>) -> ZenohConfig {
    ZenohConfig::new(fleet(), NetworkSettings::connected_to(connect))
}

fn name(text: &str) -> NodeName {
    NodeName::new(text).unwrap()
}

/// Two sessions, the second connected to the first.
fn sessions() -> (ZenohSession, ZenohSession) {
    let first = ZenohSession::open(config(Vec::new())).unwrap();
    let connect = first.locators().to_vec();
    let second = ZenohSession::open(config(connect)).unwrap();
    wait_until("the sessions are connected", || {
        first.connected_peers() == 1 && second.connected_peers() == 1
    });
    (first, second)
}

fn wait_until(what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < Duration::from_secs(20), "waited in vain until {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

struct Member {
    node: NodeLink,
    link: ZenohLink,
    start: Instant,
    happened: Vec<Happened>,
}

impl Member {
    fn new(node: &str, session: &ZenohSession, bthreads: &[(&str, Bid)]) -> Self {
        let roster = vec![name("uav/1"), name("ground/main")];
        let mut program = Program::new(ProgramConfig::vehicle(1));
        for (bthread, bid) in bthreads {
            program.add(*bthread, Once(Some(bid.clone())));
        }
        let node_link = NodeLink::new(Node::new(NodeConfig::new(name(node), 1, roster), program), fleet());
        Self {
            node: node_link,
            link: session.link(&name(node)).unwrap(),
            start: Instant::now(),
            happened: Vec::new(),
        }
    }

    fn pump(&mut self) {
        self.node.pump(self.start.elapsed(), &mut self.link).unwrap();
        self.happened.extend(self.node.node_mut().take_selections());
    }

    fn saw(&self, event: &str) -> bool {
        self.happened.iter().any(|happened| happened.event.name() == event)
    }
}

/// A remote request is served and a remote block confirmed, over the links that the two members have.
fn exchange(ground: &ZenohSession, vehicle: &ZenohSession) {
    let request = Bid::new().request("uav/1/takeoff");
    let block = Bid::new().block("uav/*/advance").wait_for("ground/main/never");
    let mut ground = Member::new("ground/main", ground, &[("launch", request), ("hold", block)]);
    let advance = Bid::new().wait_for("uav/1/never");
    let mut vehicle = Member::new("uav/1", vehicle, &[("fly", advance)]);
    wait_until("take-off is heard of and the hold confirmed", || {
        ground.pump();
        vehicle.pump();
        ground.saw("uav/1/takeoff") && ground.saw("ground/main/confirmed")
    });
    assert!(vehicle.saw("uav/1/takeoff"));
    let explanation = vehicle.node.node().explain("uav/1/advance");
    assert_eq!(explanation.remote.len(), 1, "{explanation}");

    // Held from afar, and freed when the holder is gone.
    vehicle.node.node_mut().program_mut().add("go", Once(Some(Bid::new().request("uav/1/advance"))));
    let held = Instant::now();
    while held.elapsed() < Duration::from_millis(600) {
        ground.pump();
        vehicle.pump();
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(!vehicle.saw("uav/1/advance"), "it advanced under a confirmed block");
    assert!(vehicle.saw("uav/1/stalled"));
    drop(ground);
    wait_until("the block lapses", || {
        vehicle.pump();
        vehicle.saw("uav/1/advance")
    });
    assert!(vehicle.saw("uav/1/peer_lost"));
}

#[test]
fn two_processes_worth_of_nodes_request_and_block_across_tcp() {
    let (first, second) = sessions();
    exchange(&first, &second);
}

#[test]
fn nodes_of_one_session_hear_one_another_and_not_themselves() {
    let session = ZenohSession::open(config(Vec::new())).unwrap();
    let mut one = session.link(&name("uav/1")).unwrap();
    let state = Payload::State(State::new(name("uav/1"))).encode();
    let key = Key::to_all::<State>(&fleet(), name("uav/1"));
    // Alone in the session it is heard by nobody, and from then on by who joins.
    one.put(&key, vec![1]);
    wait_until("the first is put", || session.stats().messages == 1);
    let mut two = session.link(&name("uav/2")).unwrap();
    one.put(&key, state.clone());
    let mut heard = None;
    wait_until("the state arrives", || {
        heard = two.poll();
        heard.is_some()
    });
    assert_eq!(heard, Some((key, state)));
    assert_eq!(one.poll(), None);
    drop((one, two));
    exchange(&session, &session);
}

#[test]
fn another_fleet_is_not_heard() {
    let (first, second) = sessions();
    let mut link = first.link(&name("uav/1")).unwrap();
    let mut other = second.link(&name("uav/2")).unwrap();
    other.put(&Key::to_all::<State>(&Fleet::new("other").unwrap(), name("uav/2")), vec![1]);
    let key = Key::to_all::<State>(&fleet(), name("uav/2"));
    // The first message after connecting may come before the subscription is known.
    let mut heard = None;
    wait_until("the own fleet is heard", || {
        other.put(&key, vec![2]);
        heard = link.poll();
        heard.is_some()
    });
    assert_eq!(heard.unwrap().1, vec![2]);
}

#[test]
fn putting_never_waits_and_what_does_not_fit_is_counted() {
    let config = ZenohConfig { outgoing_capacity: 8, ..config(Vec::new()) };
    let session = ZenohSession::open(config).unwrap();
    let mut link = session.link(&name("uav/1")).unwrap();
    let key = Key::to_all::<State>(&fleet(), name("uav/1"));
    let start = Instant::now();
    for _ in 0..20_000 {
        link.put(&key, vec![0; 64]);
    }
    assert!(start.elapsed() < Duration::from_secs(2), "putting waited");
    let stats = session.stats();
    assert!(stats.dropped > 0 && stats.messages + stats.dropped <= 20_000, "{stats:?}");
}

#[test]
fn a_long_message_arrives_whole() {
    let (first, second) = sessions();
    let mut link = first.link(&name("uav/1")).unwrap();
    let mut other = second.link(&name("uav/2")).unwrap();
    let key = Key::to_all::<Occurrence>(&fleet(), name("uav/2"));
    let long: Vec<u8> = (0..key.most_bytes()).map(|n| n as u8).collect();
    let mut heard = None;
    wait_until("it is heard", || {
        other.put(&key, long.clone());
        std::thread::sleep(Duration::from_millis(20));
        heard = link.poll();
        heard.is_some()
    });
    assert_eq!(heard, Some((key, long)));
}

#[test]
fn messages_under_ever_new_keys_arrive() {
    let (first, second) = sessions();
    let mut link = first.link(&name("uav/0")).unwrap();
    let mut other = second.link(&name("uav/1")).unwrap();
    let mut missing: BTreeSet<Key> =
        (1..=1200).map(|n| Key::to_all::<State>(&fleet(), name(&format!("uav/{n}")))).collect();
    // What comes before the subscription is known, or does not fit, is lost and put again.
    wait_until("something under each key is heard", || {
        missing.iter().take(64).for_each(|key| other.put(key, vec![7]));
        std::thread::sleep(Duration::from_millis(5));
        while let Some((key, _)) = link.poll() {
            missing.remove(&key);
        }
        missing.is_empty()
    });
}

#[test]
fn links_that_are_not_loopback_are_refused() {
    for (listen, connect) in [("tcp/0.0.0.0:0", None), ("tcp/127.0.0.1:0", Some("tcp/192.0.2.1:7447"))] {
        let network = NetworkSettings {
            listen: vec![listen.into()],
            connect: connect.into_iter().map(Into::into).collect(),
            ..NetworkSettings::default()
        };
        let config = ZenohConfig::new(fleet(), network);
        assert!(matches!(ZenohSession::open(config), Err(ZenohError::NotLoopback { .. })));
    }
}

#[test]
fn a_port_in_use_is_an_error_that_names_it() {
    let first = ZenohSession::open(config(Vec::new())).unwrap();
    let network = NetworkSettings { listen: first.locators().to_vec(), ..NetworkSettings::default() };
    let error = ZenohSession::open(ZenohConfig::new(fleet(), network)).unwrap_err();
    assert!(error.to_string().contains(&first.locators()[0]), "{error}");
}
