//! The links that this process has, or had refused: whose, and why.
//!
//! Zenoh says in its log alone why an encrypted link failed, and whose certificate a link has in its events. Both are
//! turned into one line for each cause here. It is the process's, as its log is.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use skein_wire::{Key, NodeName};
use tracing::field::{Field, Visit};
use tracing::level_filters::LevelFilter;
use tracing_subscriber::Layer;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::Context;

use crate::roster::Roster;

/// A member that is linked and has not been heard for so long is told of.
const PATIENCE: Duration = Duration::from_secs(5);
/// Of so many causes it is remembered that they have been told; later ones are passed over.
const MOST_TOLD: usize = 256;

/// Where Zenoh says whom it has kept from doing what, and how.
const ACCESS: &str = "zenoh::net::routing::interceptor::access_control";
const DENIED: &str = " is unauthorized to Put (ingress) on ";

static LINKS: Mutex<Links> = Mutex::new(Links::new());

/// The known state of this process's links.
struct Links {
    roster: Option<(NodeName, Roster)>,
    /// The links, each by the address of its far end.
    linked: BTreeMap<String, Link>,
    told: BTreeSet<String>,
    untold: Vec<String>,
}

/// A link to a member.
struct Link {
    /// The identifier of the session there.
    session: String,
    node: NodeName,
    since: Instant,
}

fn links() -> MutexGuard<'static, Links> {
    LINKS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// This process opens a secured session as `node`.
pub(crate) fn open(node: &NodeName, roster: &Roster) {
    links().roster = Some((node.clone(), roster.clone()));
}

/// A link has come up: `far` is the other end's address, `session` the identifier of the session there, `common_name`
/// that of its certificate.
pub(crate) fn up(far: &str, session: &str, common_name: Option<&str>) {
    let mut links = links();
    let Some((_, roster)) = &links.roster else { return };
    match roster.holder(common_name).cloned() {
        Ok(node) => {
            let link = Link { session: session.into(), node, since: Instant::now() };
            links.linked.insert(far.into(), link);
        }
        Err(why) => links.tell(format!("refused whatever comes from {}: {why}", host(far))),
    }
}

/// A link has ended.
pub(crate) fn down(far: &str) {
    links().linked.remove(far);
}

/// Tells of those members who are linked, and of whom nothing has been heard since: `heard` gives how long ago that
/// was, and none for one of whom nothing is to be heard.
pub(crate) fn note_silent(heard: impl Fn(&NodeName) -> Option<Option<Duration>>) {
    let mut links = links();
    let is_silent = |link: &Link| {
        let up = link.since.elapsed();
        up >= PATIENCE && heard(&link.node).is_some_and(|age| age.is_none_or(|age| age > up))
    };
    let silent: BTreeSet<NodeName> =
        links.linked.values().filter(|link| is_silent(link)).map(|link| link.node.clone()).collect();
    for node in silent {
        links.tell(format!(
            "{node} is linked and says nothing here: it may not take this node's certificate, and its log says why"
        ));
    }
}

/// News since the last call, each once.
pub fn take() -> Vec<String> {
    std::mem::take(&mut links().untold)
}

impl Links {
    const fn new() -> Self {
        Self { roster: None, linked: BTreeMap::new(), told: BTreeSet::new(), untold: Vec::new() }
    }

    fn tell(&mut self, line: String) {
        if self.told.len() < MOST_TOLD && self.told.insert(line.clone()) {
            self.untold.push(line);
        }
    }

    /// Takes in a line of Zenoh's log.
    fn overhear(&mut self, line: &str) {
        if let Some((who, key)) = line.split_once(DENIED) {
            self.overhear_denied(who, key);
            return;
        }
        if let Some((endpoint, error)) =
            line.split_once("nable to connect to ").map(|(_, rest)| endpoint(rest))
        {
            if let Some(cause) = after(error, "received fatal alert: ") {
                self.tell(format!("{endpoint} refuses this node's certificate: {}", alert(cause)));
            } else if let Some(cause) = after(error, "invalid peer certificate: ") {
                self.tell(format!("refused the link to {endpoint}: {}", fault(cause)));
            }
        } else if let Some(cause) = after(line, "invalid peer certificate: ") {
            let missing = self.missing();
            self.tell(format!("refused a link: {}; {missing}", fault(cause)));
        } else if line.contains("peer sent no certificates") {
            let missing = self.missing();
            self.tell(format!("refused a link: the other end has no certificate; {missing}"));
        } else if let Some(cause) = after(line, "received fatal alert: ") {
            let missing = self.missing();
            self.tell(format!("somebody refuses this node's certificate: {}; {missing}", alert(cause)));
        }
    }

    /// A session, `who`, has been kept from putting something under `key`.
    fn overhear_denied(&mut self, who: &str, key: &str) {
        let Ok(key) = key.parse::<Key>() else { return };
        let is_it = |session: &str| who.split_whitespace().any(|word| word == session);
        let found = self.linked.iter().find(|(_, link)| is_it(&link.session));
        let Some((far, Link { node, .. })) = found else { return };
        // What is for itself it has named to listen to it.
        if key.sender() != node && key.recipient() != Some(node) {
            let line = format!("{node}, at {}, has tried to speak as {}: refused", host(far), key.sender());
            self.tell(line);
        }
    }

    /// Who could be at the other end of a link that has failed before it could be known.
    fn missing(&self) -> String {
        let Some((own, roster)) = &self.roster else { return "nobody is known here".into() };
        let linked: BTreeSet<&NodeName> = self.linked.values().map(|link| &link.node).collect();
        let members = roster.members().map(|(node, _)| node);
        let missing: Vec<&str> =
            members.filter(|node| *node != own && !linked.contains(node)).map(NodeName::as_str).collect();
        match missing.is_empty() {
            true => "all members of the roster are linked".into(),
            false => format!("of the roster, these are not linked: {}", missing.join(", ")),
        }
    }
}

/// An address without its port, which is another each time.
fn host(far: &str) -> &str {
    far.rsplit_once(':').map_or(far, |(host, _)| host)
}

/// The endpoint at the start of the rest of a line, and the error after it.
fn endpoint(rest: &str) -> (&str, &str) {
    let rest = rest.strip_prefix("configured peer ").unwrap_or(rest);
    rest.split_once("! ").unwrap_or((rest, rest))
}

fn after<'a>(text: &'a str, words: &str) -> Option<&'a str> {
    text.split_once(words).map(|(_, after)| after)
}

/// The fault that rustls found in the other end's certificate, in plain words.
fn fault(cause: &str) -> String {
    let words = [
        (&["xpired"][..], "the other end's certificate has expired, or this computer's clock is wrong"),
        (
            &["not valid yet", "NotValidYet"],
            "the other end's certificate is not valid yet, or this computer's clock is wrong",
        ),
        (
            &["UnknownIssuer", "BadSignature", "CaUsedAsEndEntity"],
            "the other end's certificate is not of this fleet's authority",
        ),
        (&["not valid for name", "NotValidForName"], "the other end's certificate is for another host"),
    ];
    plain(cause, &words).map_or_else(
        || format!("the other end's certificate is not sound ({})", first_words(cause)),
        Into::into,
    )
}

/// The fault that the other end found in this node's certificate.
fn alert(cause: &str) -> String {
    let words = [
        (&["CertificateExpired", "expired"][..], "it has expired, or is not valid yet, by the clock there"),
        (&["UnknownCA", "unknown_ca", "DecryptError"], "it is not of the authority that counts there"),
        (&["CertificateRequired"], "there is none"),
    ];
    plain(cause, &words).map_or_else(|| format!("it is not sound there ({})", first_words(cause)), Into::into)
}

fn plain(cause: &str, words: &[(&[&str], &'static str)]) -> Option<&'static str> {
    words.iter().find(|(hints, _)| hints.iter().any(|hint| cause.contains(hint))).map(|(_, plain)| *plain)
}

/// Without what differs from one time to the next.
fn first_words(cause: &str) -> &str {
    cause.split([':', ';', '.', ' ']).next().unwrap_or_default()
}

/// Listens to Zenoh's log for links that have failed. It belongs to the program's subscriber.
pub fn overhearing<S: tracing::Subscriber + for<'a> tracing_subscriber::registry::LookupSpan<'a>>()
-> impl Layer<S> {
    let targets = Targets::new()
        .with_target("zenoh_link_tls", LevelFilter::WARN)
        .with_target("zenoh::net::runtime::orchestrator", LevelFilter::DEBUG)
        .with_target(ACCESS, LevelFilter::TRACE);
    Overhearing.with_filter(targets)
}

struct Overhearing;

impl<S: tracing::Subscriber> Layer<S> for Overhearing {
    fn on_event(&self, event: &tracing::Event<'_>, _: Context<'_, S>) {
        let mut line = Line(String::new());
        event.record(&mut line);
        links().overhear(&line.0);
    }
}

struct Line(String);

impl Visit for Line {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        if field.name() == "message" {
            let _ = write!(self.0, "{value:?}");
        }
    }
}
