//! A Zenoh session behind a bounded queue.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use skein_wire::{Fleet, Key, NodeName};
use zenoh::Wait;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::CongestionControl;

use crate::inbox::Inbox;
use crate::{Mode, ZenohConfig, ZenohError, ZenohLink};

/// How often opening is tried when the port that was free has been taken meanwhile.
const OPENING_TRIES: usize = 8;
/// How many keys have a publisher; what is put under others travels all the same.
const MOST_PUBLISHERS: usize = 1024;
/// A client looks for its router this often.
const TRY_AGAIN: Duration = Duration::from_millis(200);

/// A session that any number of links of one process share. Cloning gives another handle to the same session, which
/// closes with its last handle or link.
///
/// All of Zenoh is done on a thread of the session's own: whoever puts a message hands it to a bounded queue and never
/// waits, whatever the network does.
#[derive(Clone, Debug)]
pub struct ZenohSession(Arc<Shared>);

/// What has passed through a session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ZenohStats {
    /// Messages put.
    pub messages: u64,
    /// Bytes of keys and payloads put.
    pub bytes: u64,
    /// Messages dropped because the queue was full.
    pub dropped: u64,
    /// Messages that Zenoh refused.
    pub failed: u64,
}

#[derive(Debug)]
struct Shared {
    fleet: Fleet,
    locators: Vec<String>,
    incoming_capacity: usize,
    /// Whether commands are carried out at once.
    waits: bool,
    next_port: AtomicU64,
    counters: Arc<Counters>,
    /// Gone only while the session closes.
    commands: Option<SyncSender<Command>>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

#[derive(Debug, Default)]
struct Counters {
    messages: AtomicU64,
    bytes: AtomicU64,
    dropped: AtomicU64,
    failed: AtomicU64,
}

/// What the session's thread is asked to do.
enum Command {
    Put { port: u64, key: Key, payload: Vec<u8> },
    Join { port: u64, patterns: Vec<String>, inbox: Arc<Inbox>, answer: SyncSender<Result<(), ZenohError>> },
    Leave { port: u64 },
    CountPeers { answer: SyncSender<usize> },
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
        let counters = Arc::new(Counters::default());
        let (commands, queue) = sync_channel(config.outgoing_capacity.max(1));
        let (answer, opened) = sync_channel(1);
        let thread = std::thread::Builder::new().name("zenoh session".into()).spawn({
            let (config, counters) = (config.clone(), counters.clone());
            move || match config.network.mode {
                Mode::Client => await_router(&config, &queue, &counters, &answer),
                Mode::Peer | Mode::Router => match open(&config) {
                    Ok((session, locators)) => {
                        if answer.send(Ok(locators)).is_ok() {
                            serve(&session, Vec::new(), &queue, &counters);
                        }
                    }
                    Err(error) => drop(answer.send(Err(error))),
                },
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
            counters,
            commands: Some(commands),
            thread: Mutex::new(Some(thread)),
        })))
    }

    /// A link for `node`, which hears from now on. Two links of one name are two nodes that share it.
    ///
    /// # Errors
    /// [`ZenohError::Subscribe`] when Zenoh does not let it listen.
    pub fn link(&self, node: &NodeName) -> Result<ZenohLink, ZenohError> {
        self.listen(Key::subscriptions(&self.0.fleet, node))
    }

    /// A link that hears what is put under keys of these patterns: a sensor's scans, a world's scene.
    ///
    /// # Errors
    /// [`ZenohError::Subscribe`] names the pattern at fault.
    pub fn listen(&self, patterns: Vec<String>) -> Result<ZenohLink, ZenohError> {
        let port = self.0.next_port.fetch_add(1, Ordering::Relaxed);
        let inbox = Arc::new(Inbox::new(self.0.incoming_capacity));
        let (answer, joined) = sync_channel(1);
        self.ask(Command::Join { port, patterns, inbox: inbox.clone(), answer })?;
        // A client joins once its router is there.
        if self.0.waits {
            joined.recv().map_err(|_| ZenohError::ThreadGone)??;
        }
        Ok(ZenohLink::new(self.clone(), port, inbox))
    }

    /// Where others can connect to this session.
    #[must_use]
    pub fn locators(&self) -> &[String] {
        &self.0.locators
    }

    /// To how many other sessions this one is connected now.
    #[must_use]
    pub fn connected_peers(&self) -> usize {
        let (answer, peers) = sync_channel(1);
        self.ask(Command::CountPeers { answer }).ok().and_then(|()| peers.recv().ok()).unwrap_or(0)
    }

    /// What has passed through.
    #[must_use]
    pub fn stats(&self) -> ZenohStats {
        let Counters { messages, bytes, dropped, failed } = &*self.0.counters;
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        ZenohStats {
            messages: read(messages),
            bytes: read(bytes),
            dropped: read(dropped),
            failed: read(failed),
        }
    }

    /// Hands a message over for sending, or drops it when too many wait.
    pub(crate) fn put(&self, port: u64, key: &Key, payload: Vec<u8>) {
        let command = Command::Put { port, key: key.clone(), payload };
        let taken = self.0.commands.as_ref().map(|commands| commands.try_send(command));
        if !matches!(taken, Some(Ok(()))) {
            self.0.counters.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Ends a link. When the queue is full its subscriptions stay until the session closes, and fill nothing but the
    /// link's own bounded inbox.
    pub(crate) fn leave(&self, port: u64) {
        if let Some(commands) = &self.0.commands {
            match commands.try_send(Command::Leave { port }) {
                Ok(()) | Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {}
            }
        }
    }

    /// Waits for room in the queue: for use outside control loops.
    fn ask(&self, command: Command) -> Result<(), ZenohError> {
        let commands = self.0.commands.as_ref().ok_or(ZenohError::ThreadGone)?;
        commands.send(command).map_err(|_| ZenohError::ThreadGone)
    }
}

impl Drop for Shared {
    /// Ends the thread, which sends what still waits and closes the session.
    fn drop(&mut self) {
        self.commands = None;
        if let Some(thread) = self.thread.get_mut().ok().and_then(Option::take) {
            // Its panic, if any, has been reported where it happened.
            let _ = thread.join();
        }
    }
}

fn open(config: &ZenohConfig) -> Result<(zenoh::Session, Vec<String>), ZenohError> {
    let mut tries = if config.network.chooses_port() { OPENING_TRIES } else { 1 };
    loop {
        let (zenoh_config, listen) = config.network.to_zenoh()?;
        tries -= 1;
        match zenoh::open(zenoh_config).wait() {
            Ok(session) => return Ok((session, listen)),
            Err(_) if tries > 0 => {}
            Err(source) => return Err(ZenohError::Open { listen, source }),
        }
    }
}

/// The life of a client's thread: without its router it has no session yet, and drops what it is to put.
fn await_router(
    config: &ZenohConfig,
    queue: &Receiver<Command>,
    counters: &Counters,
    answer: &SyncSender<Result<Vec<String>, ZenohError>>,
) {
    // What is wrong with the configuration is said at once; a router that is not there is not wrong.
    let checked = config.network.to_zenoh().map(|(_, listen)| listen);
    if answer.send(checked).is_err() {
        return;
    }
    let mut waiting = Vec::new();
    loop {
        match open(config) {
            Ok((session, _)) => return serve(&session, waiting, queue, counters),
            Err(error) => tracing::debug!("the router is not there yet: {error}"),
        }
        let again = Instant::now() + TRY_AGAIN;
        loop {
            match queue.recv_timeout(again.saturating_duration_since(Instant::now())) {
                Ok(Command::Put { .. }) => drop(counters.dropped.fetch_add(1, Ordering::Relaxed)),
                Ok(Command::CountPeers { answer }) => drop(answer.send(0)),
                Ok(command) => waiting.push(command),
                Err(RecvTimeoutError::Timeout) => break,
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }
}

/// The life of the session's thread, until the last handle is gone. First it does what has `waited`.
fn serve(session: &zenoh::Session, waited: Vec<Command>, queue: &Receiver<Command>, counters: &Counters) {
    let mut subscribers: BTreeMap<u64, Vec<Subscriber<()>>> = BTreeMap::new();
    let mut publishers = Publishers { session, declared: BTreeMap::new() };
    for command in waited.into_iter().chain(queue.iter()) {
        match command {
            Command::Put { port, key, payload } => {
                let key = key.to_string();
                counters.messages.fetch_add(1, Ordering::Relaxed);
                counters.bytes.fetch_add((key.len() + payload.len()) as u64, Ordering::Relaxed);
                if let Err(error) = publishers.put(key, payload, mark(session, port)) {
                    counters.failed.fetch_add(1, Ordering::Relaxed);
                    tracing::debug!("Zenoh did not put: {error}");
                }
            }
            Command::Join { port, patterns, inbox, answer } => {
                let joined: Result<Vec<_>, _> =
                    patterns.into_iter().map(|pattern| subscribe(session, port, pattern, &inbox)).collect();
                let outcome = joined.map(|joined| drop(subscribers.insert(port, joined)));
                // Who asked may have given up waiting.
                let _ = answer.send(outcome);
            }
            Command::Leave { port } => drop(subscribers.remove(&port)),
            Command::CountPeers { answer } => {
                let _ = answer.send(session.info().peers_zid().wait().count());
            }
        }
    }
    drop((subscribers, publishers));
    if let Err(error) = session.close().wait() {
        tracing::debug!("Zenoh did not close in order: {error}");
    }
}

/// A publisher for each key that has been put, so that Zenoh finds out once, and not with each message, who hears it.
struct Publishers<'a> {
    session: &'a zenoh::Session,
    declared: BTreeMap<String, Publisher<'a>>,
}

impl Publishers<'_> {
    fn put(&mut self, key: String, payload: Vec<u8>, mark: Vec<u8>) -> zenoh::Result<()> {
        if self.declared.len() < MOST_PUBLISHERS && !self.declared.contains_key(&key) {
            let publisher = self.session.declare_publisher(key.clone());
            let publisher = publisher.congestion_control(CongestionControl::Drop).wait()?;
            self.declared.insert(key.clone(), publisher);
        }
        match self.declared.get(&key) {
            Some(publisher) => publisher.put(payload).attachment(mark).wait(),
            None => {
                let put = self.session.put(key, payload).congestion_control(CongestionControl::Drop);
                put.attachment(mark).wait()
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
        .map_err(|source| ZenohError::Subscribe { pattern, source })
}
