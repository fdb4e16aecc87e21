//! A Zenoh session behind its queue.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::Duration;

use skein_wire::{Fleet, Key, NodeName};
use zenoh::Wait;
use zenoh::internal::runtime::ZRuntime;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::CongestionControl;
use zenoh::sample::{Locality, SampleKind};

use crate::config::{Mode, ZenohConfig};
use crate::error::ZenohError;
use crate::inbox::Inbox;
use crate::link::ZenohLink;
use crate::links;
use crate::queue::{Asked, Command, Entry, Put, Queue, ZenohStats, queue};

/// Opening is tried so often when the port that was free has been taken meanwhile.
const OPENING_TRIES: usize = 8;
/// So many keys have a publisher; messages under others travel all the same.
const MOST_PUBLISHERS: usize = 1024;
/// A client looks for its router this often.
const TRY_AGAIN: Duration = Duration::from_millis(200);
/// Longer payloads, in bytes, may travel in fragments, for which Zenoh waits up to 50 ms where there is no room; for
/// whole messages it waits a millisecond, and not again before there is room.
const MOST_WHOLE: usize = 32 << 10;

/// As it comes, Zenoh accepts, reads, routes and sends on threads of their own, so that a message wakes one thread
/// which finds it and another which reads it. Here two threads do all of that, and a message wakes one.
const SHARED: &str = "ZENOH_RUNTIME='(acc: (handover: rx), net: (handover: rx), tx: (handover: rx))'";

/// Lets all of Zenoh's work in this process be done by the same two threads, unless the environment says otherwise
/// (`ZENOH_RUNTIME`): messages come and go faster.
///
/// For the first line of `main`: Zenoh looks at the environment when the first session opens, and no other thread may
/// run while it is changed.
pub fn share_threads() {
    // It is one line, which can be read.
    let _ = dotenvy::from_read(SHARED.as_bytes());
}

/// A session that any number of links of one process share. Cloning gives another handle to the same session, which
/// closes with its last handle or link.
///
/// All of Zenoh is done on its own threads: whoever puts a message hands it to a bounded queue and never waits,
/// whatever the network does. The task behind the queue runs where Zenoh sends, so that a message wakes one thread on
/// its way out, not two.
#[derive(Clone, Debug)]
pub struct ZenohSession(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    fleet: Fleet,
    locators: Vec<String>,
    incoming_capacity: usize,
    /// Commands are carried out at once.
    waits: bool,
    next_port: AtomicU64,
    entry: Arc<Entry>,
}

impl ZenohSession {
    /// Opens a session.
    ///
    /// That it opens does not mean that it is connected: see [`connected_peers`](Self::connected_peers). A client whose
    /// router is not there yet opens all the same, and what it puts until then is dropped.
    ///
    /// # Errors
    /// [`ZenohError`] when an endpoint is none, cannot be listened on, or could reach others without security.
    pub fn open(config: ZenohConfig) -> Result<Self, ZenohError> {
        let (senders, mut queue) = queue(config.outgoing_capacity);
        let (answer, opened) = sync_channel(1);
        let thread = std::thread::Builder::new().name("zenoh session".into()).spawn({
            let config = config.clone();
            move || {
                let opened = match config.network.mode {
                    Mode::Client => await_router(&config, &mut queue, &answer),
                    Mode::Peer | Mode::Router => {
                        open_at_once(&config, &answer).map(|session| (session, Vec::new()))
                    }
                };
                if let Some((session, waited)) = opened {
                    let served = ZRuntime::TX.spawn(serve(session, waited, queue));
                    // Its panic, if any, has been reported where it happened.
                    let _ = ZRuntime::TX.block_on(served);
                }
            }
        });
        let thread = thread.map_err(|_| ZenohError::ThreadGone)?;
        let locators = opened.recv().map_err(|_| ZenohError::ThreadGone)??;
        Ok(Self(Arc::new(Shared {
            fleet: config.fleet,
            locators,
            incoming_capacity: config.incoming_capacity.max(1),
            waits: config.network.mode != Mode::Client,
            next_port: AtomicU64::new(0),
            entry: Arc::new(Entry::new(senders, thread)),
        })))
    }

    /// A link for `node`, which hears from now on. Two links of one name are two nodes that share it.
    pub fn link(&self, node: &NodeName) -> Result<ZenohLink, ZenohError> {
        self.listen(Key::subscriptions(&self.0.fleet, node))
    }

    /// A link that hears what is put under keys of these patterns: a sensor's scans, a world's scene.
    pub fn listen(&self, patterns: Vec<String>) -> Result<ZenohLink, ZenohError> {
        self.listen_with(patterns, Inbox::new(self.0.incoming_capacity))
    }

    /// The same, but of the messages under one key only the newest waits: one who says much takes nobody's
    /// place.
    pub fn listen_to_newest(&self, patterns: Vec<String>) -> Result<ZenohLink, ZenohError> {
        self.listen_with(patterns, Inbox::of_newest(self.0.incoming_capacity))
    }

    fn listen_with(&self, patterns: Vec<String>, inbox: Inbox) -> Result<ZenohLink, ZenohError> {
        let port = self.0.next_port.fetch_add(1, Ordering::Relaxed);
        let inbox = Arc::new(inbox);
        let (answer, joined) = sync_channel(1);
        self.0.entry.ask(Command::Join { port, patterns, inbox: inbox.clone(), answer })?;
        // A client joins once its router is there.
        if self.0.waits {
            joined.recv().map_err(|_| ZenohError::ThreadGone)??;
        }
        Ok(ZenohLink::new(self.0.entry.clone(), port, inbox))
    }

    /// The endpoints of this session, for others to connect to.
    pub fn locators(&self) -> &[String] {
        &self.0.locators
    }

    /// To how many other sessions this one is connected now.
    pub fn connected_peers(&self) -> usize {
        let (answer, peers) = sync_channel(1);
        self.0.entry.ask(Command::CountPeers { answer }).ok().and_then(|()| peers.recv().ok()).unwrap_or(0)
    }

    pub fn stats(&self) -> ZenohStats {
        self.0.entry.stats()
    }
}

fn open(config: &ZenohConfig) -> Result<(zenoh::Session, Vec<String>), ZenohError> {
    let mut tries = if config.network.chooses_port() { OPENING_TRIES } else { 1 };
    loop {
        let (zenoh_config, listen) = config.to_zenoh()?;
        tries -= 1;
        match zenoh::open(zenoh_config).wait() {
            Ok(session) => {
                if config.network.security.is_some() {
                    watch_links(&session);
                }
                return Ok((session, listen));
            }
            Err(_) if tries > 0 => {}
            Err(cause) => return Err(ZenohError::Open { listen, cause }),
        }
    }
}

/// Has it noted whose links come and go.
fn watch_links(session: &zenoh::Session) {
    let noted = |event: zenoh::session::LinkEvent| {
        let far = event.link().dst().address();
        match event.kind() {
            SampleKind::Put => {
                links::up(far.as_str(), &event.link().zid().to_string(), event.link().auth_identifier());
            }
            SampleKind::Delete => links::down(far.as_str()),
        }
    };
    let info = session.info();
    let listener = info.link_events_listener().history(true).callback(noted).background();
    if let Err(error) = listener.wait() {
        tracing::warn!("whose links come and go is not noted: {error}");
    }
}

/// Opens a session, or says why not.
fn open_at_once(
    config: &ZenohConfig,
    answer: &SyncSender<Result<Vec<String>, ZenohError>>,
) -> Option<zenoh::Session> {
    let (session, outcome) = match open(config) {
        Ok((session, locators)) => (Some(session), Ok(locators)),
        Err(error) => (None, Err(error)),
    };
    answer.send(outcome).ok().and(session)
}

/// Waits for a client's router, with what is asked for meanwhile: without it there is no session yet, and what is to
/// be put is dropped. None if nobody asks any more.
fn await_router(
    config: &ZenohConfig,
    queue: &mut Queue,
    answer: &SyncSender<Result<Vec<String>, ZenohError>>,
) -> Option<(zenoh::Session, Vec<Command>)> {
    // What is wrong with the configuration is said at once; a router that is not there is not wrong.
    let checked = config.to_zenoh().map(|(_, listen)| listen);
    answer.send(checked).ok()?;
    let mut waiting = Vec::new();
    loop {
        match open(config) {
            Ok((session, _)) => return Some((session, waiting)),
            Err(error) => tracing::debug!("the router is not there yet: {error}"),
        }
        let until_nobody_asks = async {
            while let Some(asked) = queue.next().await {
                match asked {
                    Asked::Put(_) => drop(queue.counters.dropped.fetch_add(1, Ordering::Relaxed)),
                    Asked::Command(Command::CountPeers { answer }) => drop(answer.send(0)),
                    Asked::Command(command) => waiting.push(command),
                }
            }
        };
        let ended = ZRuntime::TX.block_on(async { tokio::time::timeout(TRY_AGAIN, until_nobody_asks).await });
        if ended.is_ok() {
            return None;
        }
    }
}

/// The life of a session, until the last handle is gone. First it does what has `waited`.
async fn serve(session: zenoh::Session, waited: Vec<Command>, mut queue: Queue) {
    let mut subscribers: BTreeMap<u64, Vec<Subscriber<()>>> = BTreeMap::new();
    let mut publishers =
        Publishers { session: &session, destination: Locality::Remote, declared: BTreeMap::new() };
    let mut waited = waited.into_iter();
    loop {
        let asked = match waited.next() {
            Some(command) => Some(Asked::Command(command)),
            None => queue.next().await,
        };
        match asked {
            Some(Asked::Put(Put { port, key, payload })) => {
                let key = key.to_string();
                queue.counters.messages.fetch_add(1, Ordering::Relaxed);
                queue.counters.bytes.fetch_add((key.len() + payload.len()) as u64, Ordering::Relaxed);
                if let Err(error) = publishers.put(key, payload, port) {
                    queue.counters.failed.fetch_add(1, Ordering::Relaxed);
                    tracing::debug!("Zenoh did not put: {error}");
                }
            }
            Some(Asked::Command(Command::Join { port, patterns, inbox, answer })) => {
                let joined: Result<Vec<_>, _> =
                    patterns.into_iter().map(|pattern| subscribe(&session, port, pattern, &inbox)).collect();
                let outcome = joined.map(|joined| drop(subscribers.insert(port, joined)));
                publishers.reach(subscribers.len());
                // Who asked may have given up waiting.
                let _ = answer.send(outcome);
            }
            Some(Asked::Command(Command::Leave { port })) => {
                subscribers.remove(&port);
                publishers.reach(subscribers.len());
            }
            Some(Asked::Command(Command::CountPeers { answer })) => {
                let info = session.info();
                let _ = answer.send(info.peers_zid().await.count() + info.routers_zid().await.count());
            }
            None => break,
        }
    }
    drop((subscribers, publishers));
    if let Err(error) = session.close().await {
        tracing::debug!("Zenoh did not close in order: {error}");
    }
}

/// A publisher for each key that has been put, so that Zenoh finds out once, and not with each message, who hears it.
struct Publishers<'a> {
    session: &'a zenoh::Session,
    /// Everybody, if this session has listeners of its own; else only other sessions.
    destination: Locality,
    declared: BTreeMap<String, Publisher<'a>>,
}

impl Publishers<'_> {
    /// From now on the session has so many links. A single one is not told what it has put itself.
    fn reach(&mut self, links: usize) {
        let destination = if links > 1 { Locality::Any } else { Locality::Remote };
        if std::mem::replace(&mut self.destination, destination) != destination {
            self.declared.clear();
        }
    }

    /// Puts what the link at `port` says. Meanwhile Zenoh's other tasks leave this thread, if it may take long.
    fn put(&mut self, key: String, payload: Vec<u8>, port: u64) -> zenoh::Result<()> {
        if payload.len() > MOST_WHOLE {
            return tokio::task::block_in_place(|| self.put_now(key, payload, port));
        }
        self.put_now(key, payload, port)
    }

    fn put_now(&mut self, key: String, payload: Vec<u8>, port: u64) -> zenoh::Result<()> {
        if self.declared.len() < MOST_PUBLISHERS && !self.declared.contains_key(&key) {
            let publisher = self.session.declare_publisher(key.clone());
            let publisher = publisher.allowed_destination(self.destination);
            let publisher = publisher.congestion_control(CongestionControl::Drop).wait()?;
            self.declared.insert(key.clone(), publisher);
        }
        // Nobody else here means nobody who could hear what was his own.
        let mark = (self.destination == Locality::Any).then(|| mark(self.session, port));
        match self.declared.get(&key) {
            Some(publisher) => publisher.put(payload).attachment(mark).wait(),
            None => {
                let put = self.session.put(key, payload).congestion_control(CongestionControl::Drop);
                put.allowed_destination(self.destination).attachment(mark).wait()
            }
        }
    }
}

/// Tells a link's own messages from those of all others, in other sessions too.
fn mark(session: &zenoh::Session, port: u64) -> Vec<u8> {
    let mut mark = session.zid().to_le_bytes().to_vec();
    mark.extend(port.to_le_bytes());
    mark
}

fn subscribe(
    session: &zenoh::Session,
    port: u64,
    pattern: String,
    inbox: &Arc<Inbox>,
) -> Result<Subscriber<()>, ZenohError> {
    let (own, inbox) = (mark(session, port), inbox.clone());
    let heard = move |sample: zenoh::sample::Sample| {
        if sample.attachment().is_none_or(|mark| *mark.to_bytes() != *own) {
            let payload = sample.payload();
            inbox.push(sample.key_expr().as_str(), payload.len(), || payload.to_bytes().into_owned());
        }
    };
    session
        .declare_subscriber(pattern.clone())
        .callback(heard)
        .wait()
        .map_err(|cause| ZenohError::Subscribe { pattern, cause })
}
