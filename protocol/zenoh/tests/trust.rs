//! What the holder of a certificate may say and hear, over real TLS: members, a member that is hostile, and others.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, Once};
use std::time::{Duration, Instant, SystemTime};

use rcgen::{CertificateParams, DnType, Issuer, KeyPair};
use skein_wire::{Fleet, Key, Link as _, NodeName, State};
use skein_zenoh::{
    Authority, Holder, Mode, NetworkSettings, Roster, Security, ZenohConfig, ZenohLink, ZenohSession,
};
use tempfile::TempDir;
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;
use zenoh::Wait as _;
use zenoh::sample::Locality;

const PATIENCE: Duration = Duration::from_secs(20);

fn fleet() -> Fleet {
    Fleet::new("trust").unwrap()
}

fn name(text: &str) -> NodeName {
    NodeName::new(text).unwrap()
}

fn await_that(what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < PATIENCE, "waited in vain until {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// A fleet of a ground station and two vehicles, with certificates.
struct Members {
    folder: TempDir,
    authority: Authority,
}

impl Members {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut authority = Authority::open(folder.path(), "trust", SystemTime::now()).unwrap();
        let holders = ["ground/main", "uav/1", "uav/2"].map(|node| Holder::here(name(node)));
        authority.issue(&holders, 30, false, SystemTime::now()).unwrap();
        Self { folder, authority }
    }

    fn with_relay(relay: &str) -> Self {
        let mut members = Self::new();
        let relay = Holder { relays: true, ..Holder::here(name(relay)) };
        members.authority.issue(&[relay], 30, false, SystemTime::now()).unwrap();
        members
    }

    fn security(&self, node: &str) -> Security {
        self.authority.security(&name(node))
    }

    fn settings(&self, node: &str, connect: &[String]) -> NetworkSettings {
        NetworkSettings {
            listen: vec!["tls/127.0.0.1:0".into()],
            connect: connect.to_vec(),
            security: Some(self.security(node)),
            ..NetworkSettings::default()
        }
    }

    fn open(&self, node: &str, connect: &[String]) -> ZenohSession {
        open(node, self.settings(node, connect))
    }

    /// A certificate of this fleet's authority in another's name, or in none, valid for so many days from now.
    fn forge(&self, file: &str, common_name: Option<&str>, days: i64) -> Security {
        let read = |file: &str| std::fs::read_to_string(self.folder.path().join(file)).unwrap();
        let authority_key = KeyPair::from_pem(&read("authority.key")).unwrap();
        let issuer = Issuer::from_ca_cert_pem(&read("authority.pem"), authority_key).unwrap();
        let params = member(common_name, days);
        let key = KeyPair::generate().unwrap();
        let security = self.security("uav/1");
        let certificate =
            save(self.folder.path(), &format!("{file}.pem"), &params.signed_by(&key, &issuer).unwrap().pem());
        Security {
            certificate,
            key: save(self.folder.path(), &format!("{file}.key"), &key.serialize_pem()),
            ..security
        }
    }
}

fn member(common_name: Option<&str>, days: i64) -> CertificateParams {
    let mut params = CertificateParams::new(vec!["127.0.0.1".into()]).unwrap();
    params.distinguished_name = rcgen::DistinguishedName::new();
    params.distinguished_name.push(DnType::OrganizationName, "Fleet");
    if let Some(common_name) = common_name {
        params.distinguished_name.push(DnType::CommonName, common_name);
    }
    params.not_after = time::OffsetDateTime::now_utc() + time::Duration::days(days);
    params
}

fn save(folder: &Path, file: &str, text: &str) -> PathBuf {
    let path = folder.join(file);
    std::fs::write(&path, text).unwrap();
    path
}

fn open(node: &str, network: NetworkSettings) -> ZenohSession {
    ZenohSession::open(ZenohConfig::new(fleet(), network).of(&name(node), [])).unwrap()
}

/// A program that is none of Skein's, and has a certificate: it says and asks whatever it likes.
struct Raw(zenoh::Session);

impl Raw {
    fn open(security: &Security, mode: &str, connect: &[String]) -> Self {
        Self::listening(security, mode, &[], connect)
    }

    fn listening(security: &Security, mode: &str, listen: &[String], connect: &[String]) -> Self {
        let mut config = zenoh::Config::default();
        for (key, value) in [
            ("mode", format!("{mode:?}")),
            ("scouting/multicast/enabled", "false".into()),
            ("listen/endpoints", format!("{listen:?}")),
            ("connect/endpoints", format!("{connect:?}")),
            ("connect/exit_on_failure", "false".into()),
            ("connect/timeout_ms", "0".into()),
            ("transport/link/tls/root_ca_certificate", format!("{:?}", security.authority)),
            ("transport/link/tls/connect_certificate", format!("{:?}", security.certificate)),
            ("transport/link/tls/connect_private_key", format!("{:?}", security.key)),
            ("transport/link/tls/listen_certificate", format!("{:?}", security.certificate)),
            ("transport/link/tls/listen_private_key", format!("{:?}", security.key)),
            ("transport/link/tls/enable_mtls", "true".into()),
        ] {
            config.insert_json5(key, &value).unwrap();
        }
        Self(zenoh::open(config).wait().unwrap())
    }

    fn put(&self, key: &str, payload: &str) {
        self.0.put(key, payload).allowed_destination(Locality::Remote).wait().unwrap();
    }

    /// The keys of all that it hears under a pattern.
    fn hear(&self, pattern: &str) -> Arc<Mutex<Vec<String>>> {
        let heard = Arc::new(Mutex::new(Vec::new()));
        let into = heard.clone();
        let hear =
            move |sample: zenoh::sample::Sample| into.lock().unwrap().push(sample.key_expr().to_string());
        self.0.declare_subscriber(pattern.to_owned()).callback(hear).background().wait().unwrap();
        heard
    }
}

/// Says one's state again and again until it is heard, and gives all keys that were heard until then.
fn heard_until(link: &mut ZenohLink, own: &str, mut say: impl FnMut()) -> Vec<String> {
    let mut heard = Vec::new();
    await_that("its own state is heard", || {
        say();
        heard.extend(std::iter::from_fn(|| link.poll()).map(|(key, _)| key.to_string()));
        heard.iter().any(|key| key == own)
    });
    heard
}

/// What was told of links that were refused, in all tests of this program.
fn told(words: &[&str]) {
    static TOLD: Mutex<Vec<String>> = Mutex::new(Vec::new());
    await_that(&format!("{words:?} is told"), || {
        let mut told = TOLD.lock().unwrap();
        told.extend(skein_zenoh::take_refusals());
        told.iter().any(|line| words.iter().all(|word| line.contains(word)))
    });
}

fn overhear() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| tracing_subscriber::registry().with(skein_zenoh::overhearing()).init());
}

#[test]
fn a_member_speaks_for_itself_and_for_nobody_else() {
    let members = Members::new();
    let vehicle = members.open("uav/2", &[]);
    let mut link = vehicle.link(&name("uav/2")).unwrap();
    for mode in ["peer", "client", "router"] {
        let raw = Raw::open(&members.security("uav/1"), mode, vehicle.locators());
        let own = "skein/trust/bid/uav/1/uav/2";
        let heard = heard_until(&mut link, own, || {
            for forged in [
                "skein/trust/bid/ground/main/uav/2",
                "skein/trust/state/ground/main",
                "skein/trust/presence/uav/2",
                "skein/trust/presence/uav/30",
                "skein/trust/occ/*/*",
            ] {
                raw.put(forged, "forged");
            }
            raw.put(own, "mine");
        });
        assert!(heard.iter().all(|key| key == own), "as a {mode} it was heard under {heard:?}");
    }
}

#[test]
fn who_speaks_as_another_is_named() {
    overhear();
    let members = Members::new();
    let vehicle = members.open("uav/2", &[]);
    let mut link = vehicle.link(&name("uav/2")).unwrap();
    let raw = Raw::open(&members.security("uav/1"), "peer", vehicle.locators());
    let _listening = raw.hear("skein/trust/scan/sim/world/uav/1");
    heard_until(&mut link, "skein/trust/state/uav/1", || {
        raw.put("skein/trust/state/ground/main", "forged");
        raw.put("skein/trust/state/uav/1", "mine");
    });
    told(&["uav/1, at 127.0.0.1, has tried to speak as ground/main: refused"]);
}

#[test]
fn a_member_hears_what_is_for_it_and_asks_nothing() {
    let members = Members::with_relay("relay/1");
    let relay = open("relay/1", NetworkSettings { mode: Mode::Router, ..members.settings("relay/1", &[]) });
    let mut ground = members.open("ground/main", relay.locators()).link(&name("ground/main")).unwrap();
    let curious = Raw::open(&members.security("uav/1"), "client", relay.locators());
    let heard =
        ["**", "skein/**", "skein/trust/bid/*/*/uav/2", "skein/trust/*/*/*/**"].map(|it| curious.hear(it));
    let allowed = curious.hear("skein/trust/state/*/*");
    let queryable = Raw::open(&members.security("uav/2"), "client", relay.locators());
    let asked = Arc::new(Mutex::new(0));
    let count = asked.clone();
    let answer = move |query: zenoh::query::Query| {
        *count.lock().unwrap() += 1;
        query.reply(query.key_expr().clone(), "yes").wait().unwrap();
    };
    queryable.0.declare_queryable("skein/trust/state/uav/2").callback(answer).background().wait().unwrap();
    let _token = queryable.0.liveliness().declare_token("skein/trust/state/uav/2").wait().unwrap();
    await_that("its own state is heard", || {
        for recipient in [None, Some("uav/2")] {
            let key = match recipient {
                None => Key::to_all::<State>(&fleet(), name("ground/main")),
                Some(node) => format!("skein/trust/bid/ground/main/{node}").parse().unwrap(),
            };
            ground.put(&key, vec![1]);
        }
        !allowed.lock().unwrap().is_empty()
    });
    for heard in heard {
        let heard = heard.lock().unwrap();
        assert!(!heard.iter().any(|key| key.contains("/bid/")), "{heard:?}");
    }
    let replies = curious.0.get("skein/trust/**").wait().unwrap();
    assert_eq!(replies.into_iter().filter(|reply| reply.result().is_ok()).count(), 0);
    let alive = curious.0.liveliness().get("skein/trust/**").wait().unwrap();
    assert_eq!(alive.into_iter().filter(|reply| reply.result().is_ok()).count(), 0);
    assert_eq!(*asked.lock().unwrap(), 0);
}

#[test]
fn a_relay_is_believed_what_it_passes_on_of_members_alone() {
    let members = Members::with_relay("relay/1");
    let relay = open("relay/1", NetworkSettings { mode: Mode::Router, ..members.settings("relay/1", &[]) });
    let client = |node: &str| {
        let settings = NetworkSettings {
            mode: Mode::Client,
            listen: vec![],
            ..members.settings(node, relay.locators())
        };
        open(node, settings)
    };
    let (ground, vehicle) = (client("ground/main"), client("uav/2"));
    let mut to = vehicle.link(&name("uav/2")).unwrap();
    let mut from = ground.link(&name("ground/main")).unwrap();
    let own = "skein/trust/bid/ground/main/uav/2";
    heard_until(&mut to, own, || from.put(&own.parse().unwrap(), vec![1]));
    // What it relays comes under the name of whoever has said it; who is no member has said nothing.
    let forger = Raw::open(&members.security("relay/1"), "router", relay.locators());
    let heard = heard_until(&mut to, "skein/trust/state/uav/1", || {
        forger.put("skein/trust/state/uav/77", "invented");
        forger.put("skein/trust/state/uav/1", "a relay can say this");
    });
    assert!(!heard.iter().any(|key| key.contains("uav/77")), "{heard:?}");
}

#[test]
fn who_is_not_of_the_roster_counts_for_nothing_and_the_others_go_on() {
    overhear();
    let members = Members::new();
    let [ground, vehicle] = ["ground/main", "uav/2"].map(|node| members.open(node, &[]));
    let joined = members.open("uav/1", &[ground.locators(), vehicle.locators()].concat());
    let (mut to, mut from) = (vehicle.link(&name("uav/2")).unwrap(), joined.link(&name("uav/1")).unwrap());
    let own = Key::to_all::<State>(&fleet(), name("uav/1"));
    heard_until(&mut to, &own.to_string(), || from.put(&own, vec![1]));
    for (file, common_name, words) in [
        ("nameless", None, "no common name"),
        ("stranger", Some("uav/9;1"), "whom the roster does not name"),
        ("later", Some("uav/1;7"), "renew"),
    ] {
        let raw = Raw::open(&members.forge(file, common_name, 30), "peer", vehicle.locators());
        let spied = raw.hear("skein/trust/state/*/*");
        for _ in 0..50 {
            raw.put("skein/trust/state/uav/1", "forged");
            raw.put("skein/trust/state/uav/9", "forged");
        }
        told(&["refused", words]);
        let heard = heard_until(&mut to, &own.to_string(), || from.put(&own, vec![7]));
        assert!(heard.iter().all(|key| *key == own.to_string()), "{file}: {heard:?}");
        assert!(spied.lock().unwrap().is_empty(), "{file} hears {spied:?}");
    }
}

#[test]
fn an_expired_certificate_and_a_foreign_one_are_refused_with_words_at_both_ends() {
    overhear();
    let members = Members::new();
    let vehicle = members.open("uav/2", &[]);
    let strangers = Members::new();
    for (security, here, there) in [
        (members.forge("late", Some("uav/1;1"), -1), "has expired", "it has expired"),
        (
            Security { authority: members.security("uav/1").authority, ..strangers.security("uav/1") },
            "not of this fleet's authority",
            "it is not of the authority that counts there",
        ),
    ] {
        let raw = Raw::open(&security, "peer", vehicle.locators());
        told(&["refused a link", here]);
        told(&[&vehicle.locators()[0], "refuses this node's certificate", there]);
        drop(raw);
    }
    // Where the other end is the one that listens.
    let late = members.forge("late", Some("uav/1;1"), -1);
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let endpoint = format!("tls/127.0.0.1:{port}");
    let _raw = Raw::listening(&late, "peer", std::slice::from_ref(&endpoint), &[]);
    let _ground = members.open("ground/main", std::slice::from_ref(&endpoint));
    told(&["refused the link to", &endpoint, "has expired"]);
    assert_eq!(vehicle.connected_peers(), 0);
}

#[test]
fn a_renewed_certificate_counts_and_the_old_one_and_a_revoked_one_no_more() {
    let mut members = Members::new();
    let old = members.forge("old", Some("uav/1;1"), 30);
    members.authority.issue(&[Holder::here(name("uav/1"))], 30, true, SystemTime::now()).unwrap();
    let vehicle = members.open("uav/2", &[]);
    let mut link = vehicle.link(&name("uav/2")).unwrap();
    let own = "skein/trust/bid/uav/1/uav/2";
    let (late, renewed) = (Raw::open(&old, "peer", vehicle.locators()), members.security("uav/1"));
    let renewed = Raw::open(&renewed, "peer", vehicle.locators());
    await_that("both are there", || vehicle.connected_peers() == 2);
    heard_until(&mut link, own, || renewed.put(own, "renewed"));
    drop(renewed);
    while link.poll().is_some() {}
    let ground = Raw::open(&members.security("ground/main"), "peer", vehicle.locators());
    let control = "skein/trust/bid/ground/main/uav/2";
    let heard = heard_until(&mut link, control, || {
        late.put(own, "old");
        ground.put(control, "there");
    });
    assert!(!heard.iter().any(|key| key == own), "{heard:?}");

    // Whoever is taken out of the roster has no certificate that counts.
    let roster = members.folder.path().join("roster.toml");
    let text = std::fs::read_to_string(&roster).unwrap();
    std::fs::write(&roster, text.replace("\"uav/1\" = 2\n", "")).unwrap();
    assert!(Roster::read(&roster).unwrap().members().all(|(node, _)| node.as_str() != "uav/1"));
    let error =
        ZenohSession::open(ZenohConfig::new(fleet(), members.settings("uav/1", &[])).of(&name("uav/1"), []));
    assert!(error.unwrap_err().to_string().contains("whom the roster does not name"));
}
