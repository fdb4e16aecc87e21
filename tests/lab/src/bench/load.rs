//! Load on a swarm of processes while somebody measures: a member that sends garbage, scripts that are too deep.

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use skein_agent::config_file::Config;
use skein_bp::behaviour::Behaviours;
use skein_dbp::{BidRecord, NodeName, Occurrence, Presence};
use skein_sim::fly::{GROUND, vehicle_name};
use skein_wire::{Fleet, Key, Link as _, State};
use skein_zenoh::{ZenohConfig, ZenohLink, ZenohSession};

use crate::operator::Operator;

/// Garbage in a second, bytes.
const GARBAGE_PER_S: f64 = 10e6;
/// The longest message of garbage, bytes: several pieces for Zenoh, and beyond what is let through of any kind.
const LONGEST: usize = 300_000;
/// Levels of `and` in a script that is too deep.
const LEVELS: usize = 46;

/// One who adds to the load, a little at a time.
pub trait Load {
    /// Adds a little.
    ///
    /// # Errors
    /// It is not what was expected.
    fn add(&mut self) -> anyhow::Result<()>;
}

/// A thread that adds load until its end.
pub struct Beat {
    is_over: Arc<AtomicBool>,
    thread: JoinHandle<anyhow::Result<()>>,
}

impl Beat {
    /// Begins, with a load that is made on its own thread.
    pub fn of<L: Load>(load: impl FnOnce() -> anyhow::Result<L> + Send + 'static) -> Self {
        let is_over = Arc::new(AtomicBool::new(false));
        let ends = Arc::clone(&is_over);
        let thread = std::thread::spawn(move || {
            let mut load = load()?;
            while !ends.load(Ordering::Relaxed) {
                load.add()?;
            }
            Ok(())
        });
        Self { is_over, thread }
    }

    /// Ends it.
    ///
    /// # Errors
    /// Those of the load.
    pub fn end(self) -> anyhow::Result<()> {
        self.is_over.store(true, Ordering::Relaxed);
        self.thread.join().map_err(|_| anyhow::anyhow!("a load's thread has panicked"))?
    }
}

/// A member of the fleet that puts random bytes under each of its own keys.
pub struct Garbage {
    link: ZenohLink,
    keys: Vec<Key>,
    random: ChaCha8Rng,
    began: Instant,
    sent: Arc<AtomicU64>,
    // The link speaks through it.
    _session: ZenohSession,
}

impl Garbage {
    /// Joins as vehicle `index`, by the configuration that was written for it in `folder`; counts in `sent` the bytes
    /// that it sends.
    ///
    /// # Errors
    /// The configuration cannot be read, or Zenoh not be opened by it.
    pub fn join(folder: &Path, index: usize, sent: &Arc<AtomicU64>) -> anyhow::Result<Self> {
        let member = vehicle_name(index);
        let file = folder.join(format!("uav-{}.toml", index + 1));
        let config = Config::read(&file, &Behaviours::default())?;
        let known = config.known();
        let fleet = Fleet::new(&config.agent.fleet)?;
        let session = ZenohSession::open(ZenohConfig::new(fleet.clone(), config.network).of(&member, known))?;
        let link = session.link(&member)?;
        let others = (0..index).map(vehicle_name).chain([GROUND.clone()]);
        let bid = |home: NodeName| Key::to_one::<BidRecord>(&fleet, member.clone(), home);
        let mut keys: Vec<Key> = others.map(bid).collect();
        keys.extend([
            Key::to_all::<State>(&fleet, member.clone()),
            Key::to_all::<Presence>(&fleet, member.clone()),
            Key::to_all::<Occurrence>(&fleet, member.clone()),
        ]);
        let (random, began) = (ChaCha8Rng::seed_from_u64(1), Instant::now());
        Ok(Self { link, keys, random, began, sent: Arc::clone(sent), _session: session })
    }
}

impl Load for Garbage {
    fn add(&mut self) -> anyhow::Result<()> {
        let sent = self.sent.load(Ordering::Relaxed);
        if self.began.elapsed().as_secs_f64() * GARBAGE_PER_S < sent as f64 {
            // In step with the clock: there is nothing to wait for.
            std::thread::sleep(Duration::from_millis(1));
            return Ok(());
        }
        let mut bytes = vec![0; self.random.random_range(1..=LONGEST)];
        self.random.fill(&mut bytes[..]);
        self.sent.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        let key = &self.keys[self.random.random_range(0..self.keys.len())];
        self.link.put(key, bytes);
        Ok(())
    }
}

/// An operator who sends a script that is too deep, again as soon as it was refused.
pub struct DeepScripts {
    operator: Operator,
    script: Value,
    refused: Arc<AtomicUsize>,
}

impl DeepScripts {
    /// Connects to a console; counts what is refused.
    ///
    /// # Errors
    /// The console does not answer.
    pub fn new(console: SocketAddr, refused: &Arc<AtomicUsize>) -> anyhow::Result<Self> {
        let set =
            (0..LEVELS).fold(json!("uav/1/hold"), |inner, _| json!({ "and": [inner, { "prefix": "uav" }] }));
        let sync = json!({ "sync": { "wait": set } });
        let script = json!({ "script": { "name": "deep", "about": "Too deep.", "body": [sync] } });
        let operator = Operator::connect(console)?;
        Ok(Self { operator, script, refused: Arc::clone(refused) })
    }
}

impl Load for DeepScripts {
    fn add(&mut self) -> anyhow::Result<()> {
        let refusal = self.operator.load(&self.script)?;
        refusal.context("a script that nests `and` 46 deep was not refused")?;
        self.refused.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }
}
