//! Orders from the shell through the console of a running station, plain and over TLS.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::Value;
use skein_bp::{Program, ProgramConfig};
use skein_dbp::{Node, NodeConfig, NodeName};
use skein_ground::console::{Console, ConsoleSecurity, Role};
use skein_ground::{GroundConfig, GroundCore};
use skein_wire::{Fleet, Network, NetworkConfig, NodeLink, State};

const TICK: Duration = Duration::from_millis(20);

/// A station with one vehicle that obeys nothing but blocks, and its console.
struct Station {
    url: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Vec<String>>>,
}

impl Station {
    fn start(security: Option<ConsoleSecurity>) -> Self {
        let console = Console::serve(([127, 0, 0, 1], 0).into(), security.as_ref(), || {}).unwrap();
        let (url, stop) = (console.url(), Arc::new(AtomicBool::new(false)));
        let thread = std::thread::spawn({
            let stop = stop.clone();
            move || serve(console, &stop)
        });
        Self { url, stop, thread: Some(thread) }
    }

    /// What the shell says to this.
    fn shell(&self, arguments: &[&str]) -> Output {
        let (command, rest) = arguments.split_first().unwrap();
        let mut shell = Command::new(env!("CARGO_BIN_EXE_skein-ground"));
        shell
            .args([command, "--console", &self.url, "--json"])
            .args(rest)
            .env_remove("USER")
            .output()
            .unwrap()
    }

    /// The station's `ordered` events, once it has ended.
    fn end(mut self) -> Vec<String> {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap()
    }
}

fn serve(mut console: Console, stop: &AtomicBool) -> Vec<String> {
    let (ground, vehicle) = ["ground/main", "uav/1"].map(|name| NodeName::new(name).unwrap()).into();
    let fleet = Fleet::new("test").unwrap();
    let network = Network::new(NetworkConfig::default(), 1);
    let config = GroundConfig {
        launch_on_order: true,
        ..GroundConfig::new(fleet.clone(), ground.clone(), vec![vehicle.clone()])
    };
    let mut station = GroundCore::new(config);
    let (mut station_link, mut link) = (network.join(&ground), network.join(&vehicle));
    let roster = vec![ground, vehicle.clone()];
    let program = Program::new(ProgramConfig::vehicle(1));
    let mut node = NodeLink::new(Node::new(NodeConfig::new(vehicle.clone(), 1, roster), program), fleet);
    let (began, mut ordered) = (Instant::now(), Vec::new());
    while !stop.load(Ordering::Relaxed) {
        let now = began.elapsed();
        network.advance(now);
        for wish in console.take_orders() {
            wish.carry_out(&mut station);
        }
        station.attend(console.present());
        station.tick(now, &mut station_link).unwrap();
        let happened = station.take_selections();
        let words = happened.iter().map(|happened| happened.event.to_string());
        ordered.extend(words.filter(|event| event.contains("/ordered")));
        console.publish(now, &station, &happened);
        node.pump(now, &mut link).unwrap();
        node.put_state(&State { time: now, ..State::new(vehicle.clone()) }, &mut link);
        std::thread::sleep(TICK);
    }
    ordered
}

fn said(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {output:?}"))
}

#[test]
fn an_order_from_the_shell_names_who_gave_it_and_says_who_has_heard_it() {
    let station = Station::start(None);
    let held = station.shell(&["hold", "uav/1", "--by", "Anna"]);
    assert!(held.status.success(), "{held:?}");
    let order = said(&held);
    assert_eq!((&order["by"], &order["answers"]["uav/1"]["state"]), (&"Anna".into(), &"acknowledged".into()));

    // Without a name it is the account that gives it, whatever the environment says.
    let unnamed = said(&station.shell(&["hold", "uav/1"]));
    let account = Command::new("id").arg("-un").output().unwrap();
    let account = String::from_utf8(account.stdout).unwrap().trim().to_owned();
    assert_eq!(unnamed["by"], account, "{unnamed}");
    let ordered = station.end();
    let are_named = ["Anna", &account].iter().zip(&ordered).all(|(name, order)| order.contains(name));
    assert!(ordered.len() == 2 && are_named, "{ordered:?}");
}

#[test]
fn the_shell_is_told_how_the_swarm_stands_and_what_a_route_is_wrong_by() {
    let station = Station::start(None);
    let told = said(&station.shell(&["status", "--by", "Anna"]));
    assert_eq!(told["vehicles"][0]["name"], "uav/1");
    let refused = station.shell(&["route", "-3,4 5,6,7", "--vehicle", "1", "--by", "Anna"]);
    assert_eq!(refused.status.code(), Some(2));
    let why = said(&refused)["error"].as_str().unwrap().to_owned();
    assert!(why.contains("point 1, `-3 4`"), "{why}");
    let stranger = station.shell(&["route", "-3,4,5", "--vehicle", "7", "--by", "Anna"]);
    assert!(said(&stranger)["error"].as_str().unwrap().contains("`uav/7` is no vehicle"), "{stranger:?}");
    assert!(station.end().is_empty(), "nothing was ordered");
}

#[test]
fn a_launch_from_the_shell_is_confirmed() {
    let station = Station::start(None);
    // Once it has acknowledged something, the station knows the vehicle.
    assert!(station.shell(&["hold", "uav/1", "--by", "Anna"]).status.success());
    let unconfirmed = station.shell(&["launch", "--by", "Anna"]);
    assert_eq!(unconfirmed.status.code(), Some(2));
    assert!(said(&unconfirmed)["error"].as_str().unwrap().contains("--yes"));
    let launched = station.shell(&["launch", "--by", "Anna", "--yes"]);
    let order = said(&launched);
    assert_eq!((&order["what"], &order["vehicles"][0]["name"]), (&"launch".into(), &"uav/1".into()));
    let ordered = station.end();
    assert_eq!(ordered.iter().filter(|event| event.contains("\"launch\"")).count(), 1, "{ordered:?}");
}

#[test]
fn over_tls_a_certificate_says_who_one_is_and_what_one_may() {
    let folder = tempfile::tempdir().unwrap();
    let [ours, theirs] = [0, 1].map(|number| Authority::new(folder.path(), number));
    let (certificate, key) = ours.issue("ground/main;1");
    let roles = [("Anna;2", Role::Operator), ("Sam;1", Role::Safety), ("Olga;1", Role::Observer)];
    let roles: BTreeMap<_, _> = roles.map(|(name, role)| (name.to_owned(), role)).into();
    let authority = ours.file.clone();
    let station = Station::start(Some(ConsoleSecurity { authority, certificate, key, roles }));
    assert!(station.url.starts_with("https://"));

    let shell = |by: &Authority, name: &str, arguments: &[&str]| {
        let (certificate, key) = by.issue(name);
        let files = [&ours.file, &certificate, &key].map(|file| file.to_str().unwrap().to_owned());
        let with = ["--authority", &files[0], "--certificate", &files[1], "--key", &files[2]];
        let output = station.shell(&[arguments, &with].concat());
        (output.status.code().unwrap(), said(&output))
    };
    let refused = |(code, said): (i32, Value), why: &str| {
        let error = said["error"].as_str().unwrap_or_default();
        assert!(code == 2 && error.contains(why), "{code} {said}: expected {why:?}");
    };
    let (code, order) = shell(&ours, "Anna;2", &["hold", "uav/1"]);
    assert_eq!((code, &order["by"]), (0, &"Anna".into()), "{order}");
    let (code, order) = shell(&ours, "Sam;1", &["hold", "uav/1"]);
    assert_eq!((code, &order["by"]), (0, &"Sam".into()), "{order}");
    refused(shell(&ours, "Sam;1", &["take", "uav/1"]), "beyond your role, safety");
    refused(shell(&ours, "Olga;1", &["hold", "uav/1"]), "beyond your role, observer");
    refused(
        shell(&ours, "Anna;2", &["hold", "uav/1", "--by", "Ben"]),
        "your certificate says that you are Anna",
    );
    refused(shell(&ours, "Anna;1", &["hold", "uav/1"]), "has no role here");
    refused(shell(&ours, "uav/1;1", &["hold", "uav/1"]), "has no role here");
    // Of another authority, or none: there is no connection.
    assert_eq!(shell(&theirs, "Anna;2", &["hold", "uav/1"]).0, 2);
    let plain = station.url.replace("https", "http");
    let bare = Command::new(env!("CARGO_BIN_EXE_skein-ground"))
        .args(["hold", "uav/1", "--by", "Anna", "--console", &plain])
        .output()
        .unwrap();
    assert_eq!(bare.status.code(), Some(2), "{bare:?}");
    assert_eq!(station.end().len(), 2, "two holds were allowed");
}

/// An authority, and the certificates that it issues, as files.
struct Authority {
    folder: PathBuf,
    file: PathBuf,
    issuer: rcgen::Issuer<'static, rcgen::KeyPair>,
}

impl Authority {
    fn new(folder: &Path, number: usize) -> Self {
        let folder = folder.join(number.to_string());
        std::fs::create_dir(&folder).unwrap();
        let key = rcgen::KeyPair::generate().unwrap();
        let mut authority = rcgen::CertificateParams::new(vec![]).unwrap();
        authority.is_ca = rcgen::IsCa::Ca(rcgen::BasicConstraints::Unconstrained);
        let file = folder.join("authority.pem");
        std::fs::write(&file, authority.self_signed(&key).unwrap().pem()).unwrap();
        Self { folder, file, issuer: rcgen::Issuer::new(authority, key) }
    }

    fn issue(&self, common_name: &str) -> (PathBuf, PathBuf) {
        use rcgen::ExtendedKeyUsagePurpose::{ClientAuth, ServerAuth};
        let key = rcgen::KeyPair::generate().unwrap();
        let mut member = rcgen::CertificateParams::new(vec!["localhost".into(), "127.0.0.1".into()]).unwrap();
        member.distinguished_name = rcgen::DistinguishedName::new();
        member.distinguished_name.push(rcgen::DnType::CommonName, common_name);
        member.extended_key_usages = vec![ServerAuth, ClientAuth];
        let certificate = member.signed_by(&key, &self.issuer).unwrap();
        let file =
            |extension: &str| self.folder.join(common_name.replace('/', "-")).with_extension(extension);
        std::fs::write(file("pem"), certificate.pem()).unwrap();
        std::fs::write(file("key"), key.serialize_pem()).unwrap();
        (file("pem"), file("key"))
    }
}
