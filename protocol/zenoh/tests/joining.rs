//! Ways of joining: peer to peer, through a router that comes late, with certificates.

use std::time::{Duration, Instant};

use skein_wire::{Fleet, Key, Link as _, NodeName, State};
use skein_zenoh::{Mode, NetworkSettings, Security, ZenohConfig, ZenohSession};

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
fn peers_that_know_one_in_common_meet() {
    let known = open(NetworkSettings::default());
    let join = || open(NetworkSettings::connected_to(known.locators().to_vec()));
    let (one, other) = (join(), join());
    assert!(speaks_to(&one, &other));
    drop(known);
    assert!(speaks_to(&one, &other), "the loss of the one cuts the others off");
}

#[test]
fn a_peer_listens_nowhere_but_where_it_is_told() {
    let session = open(NetworkSettings { listen: vec![], ..NetworkSettings::default() });
    assert!(session.locators().is_empty());
}

/// An authority's certificate and a member's with its key, as files.
fn certificates(folder: &std::path::Path) -> Security {
    use rcgen::{BasicConstraints, CertificateParams, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair};
    let authority_key = KeyPair::generate().unwrap();
    let mut authority = CertificateParams::new(vec![]).unwrap();
    authority.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    let authority_certificate = authority.self_signed(&authority_key).unwrap();
    let issuer = Issuer::new(authority, authority_key);
    let key = KeyPair::generate().unwrap();
    let mut member = CertificateParams::new(vec!["localhost".into(), "127.0.0.1".into()]).unwrap();
    member.extended_key_usages =
        vec![ExtendedKeyUsagePurpose::ServerAuth, ExtendedKeyUsagePurpose::ClientAuth];
    let certificate = member.signed_by(&key, &issuer).unwrap();
    let save = |file: &str, text: String| {
        let path = folder.join(file);
        std::fs::write(&path, text).unwrap();
        path
    };
    Security {
        authority: save("authority.pem", authority_certificate.pem()),
        certificate: save("member.pem", certificate.pem()),
        key: save("member.key", key.serialize_pem()),
    }
}

#[test]
fn members_of_one_authority_meet_and_others_do_not() {
    let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let [ours, theirs] = [0, 1].map(|authority| certificates(folders[authority].path()));
    let secured = |security: &Security, connect: Vec<String>| NetworkSettings {
        listen: vec!["tls/localhost:0".into()],
        connect,
        security: Some(security.clone()),
        ..NetworkSettings::default()
    };
    let one = open(secured(&ours, vec![]));
    let other = open(secured(&ours, one.locators().to_vec()));
    assert!(speaks_to(&other, &one));
    let stranger = open(secured(&theirs, one.locators().to_vec()));
    let deadline = Instant::now() + Duration::from_secs(2);
    while Instant::now() < deadline {
        assert_eq!(stranger.connected_peers(), 0, "a stranger is let in");
        std::thread::sleep(Duration::from_millis(50));
    }
}
