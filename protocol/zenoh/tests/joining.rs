//! Ways of joining: peer to peer, through a router that comes late, with certificates.

use std::time::{Duration, Instant};

use skein_wire::{Fleet, Key, Link as _, NodeName, State};
use skein_zenoh::{Mode, NetworkSettings, ZenohConfig, ZenohSession};

fn fleet() -> Fleet {
    Fleet::new("joining").unwrap()
}

fn name(text: &str) -> NodeName {
    NodeName::new(text).unwrap()
}

fn open(network: NetworkSettings) -> ZenohSession {
    ZenohSession::open(ZenohConfig::new(fleet(), network)).unwrap()
}

fn free_port() -> u16 {
    std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Whether what one says comes to the other within ten seconds.
fn speaks_to(one: &ZenohSession, other: &ZenohSession) -> bool {
    let mut from = one.link(&name("uav/1")).unwrap();
    let mut to = other.link(&name("uav/2")).unwrap();
    let key = Key::to_all::<State>(&fleet(), name("uav/1"));
    let deadline = Instant::now() + Duration::from_secs(10);
    while Instant::now() < deadline {
        from.put(&key, vec![1]);
        if to.poll().is_some() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    false
}

fn client_of(port: u16) -> NetworkSettings {
    NetworkSettings {
        mode: Mode::Client,
        listen: vec![],
        connect: vec![format!("tcp/127.0.0.1:{port}")],
        security: None,
    }
}

fn router_on(port: u16) -> NetworkSettings {
    NetworkSettings {
        mode: Mode::Router,
        listen: vec![format!("tcp/127.0.0.1:{port}")],
        connect: vec![],
        security: None,
    }
}

#[test]
fn clients_open_at_once_and_meet_when_their_router_comes_and_comes_again() {
    let port = free_port();
    let began = Instant::now();
    let (one, other) = (open(client_of(port)), open(client_of(port)));
    assert!(began.elapsed() < Duration::from_secs(5), "opening waits for the router");
    let router = open(router_on(port));
    assert!(speaks_to(&one, &other), "not through a router that comes late");
    drop(router);
    let _router = open(router_on(port));
    assert!(speaks_to(&one, &other), "not through a router that comes again");
}

#[test]
fn peers_meet_whom_they_are_told_of_and_nobody_else() {
    let known = open(NetworkSettings::default());
    let join = |others: &[&ZenohSession]| {
        let connect = others.iter().flat_map(|other| other.locators().to_vec()).collect();
        open(NetworkSettings::connected_to(connect))
    };
    let one = join(&[&known]);
    let other = join(&[&known]);
    let third = join(&[&known, &one, &other]);
    assert!(speaks_to(&one, &third) && speaks_to(&third, &other));
    assert_eq!(one.connected_peers(), 2, "it has connected to an address that was told it by another");
    drop(known);
    assert!(speaks_to(&one, &third), "the loss of the one cuts the others off");
}

#[test]
fn a_peer_listens_nowhere_but_where_it_is_told() {
    let session = open(NetworkSettings { listen: vec![], ..NetworkSettings::default() });
    assert!(session.locators().is_empty());
}
