//! A network in memory, for lockstep runs and for injecting faults.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use skein_dbp::NodeName;

use crate::key::Key;
use crate::link::Link;

/// The faults and delays of a network. Probabilities are from 0 to 1, for each message and receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetworkConfig {
    /// Least and greatest time that a message takes, drawn evenly.
    pub latency: (Duration, Duration),
    /// Probability that a message is lost.
    pub loss: f64,
    /// Probability that it arrives twice.
    pub duplicate: f64,
    /// Probability that it may overtake others, or be overtaken; the rest stays in order between two nodes.
    pub reorder: f64,
    /// Two nodes that have a place hear one another within so many metres; everywhere, if there is no range.
    pub range_m: Option<f64>,
}

impl Default for NetworkConfig {
    /// A good network: a tenth to half a millisecond, no fault.
    fn default() -> Self {
        Self {
            latency: (Duration::from_micros(100), Duration::from_micros(500)),
            loss: 0.0,
            duplicate: 0.0,
            reorder: 0.0,
            range_m: None,
        }
    }
}

/// Counts of the messages that a network has carried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NetworkStats {
    /// Messages put by all nodes.
    pub messages: u64,
    /// Bytes of keys and payloads put by all nodes.
    pub bytes: u64,
    /// Messages handed to receivers.
    pub delivered: u64,
    /// Messages lost by chance or for lack of a way.
    pub lost: u64,
    /// Messages that arrive twice.
    pub duplicated: u64,
    /// Messages that overtake one that was put before them.
    pub overtaking: u64,
}

/// A network in memory with seeded latency, loss, duplication, reordering and partition.
///
/// Equal seeds and equal calls give equal deliveries. Time stands still between calls of [`advance`](Self::advance).
///
/// ```
/// use std::time::Duration;
/// use skein_wire::{Fleet, Key, Link, Network, NetworkConfig, NodeName, State};
/// let (one, two) = (NodeName::new("uav/1")?, NodeName::new("uav/2")?);
/// let network = Network::new(NetworkConfig::default(), 7);
/// let (mut a, mut b) = (network.join(&one), network.join(&two));
/// let key = Key::to_all::<State>(&Fleet::new("demo")?, one);
/// a.put(&key, vec![1, 2, 3]);
/// assert_eq!(b.poll(), None);
/// network.advance(Duration::from_millis(1));
/// assert_eq!(b.poll(), Some((key, vec![1, 2, 3])));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Network(Arc<Mutex<Air>>);

/// One node's end of a [`Network`].
#[derive(Debug)]
pub struct MemoryLink {
    port: u64,
    network: Network,
}

#[derive(Debug)]
struct Air {
    config: NetworkConfig,
    rng: ChaCha8Rng,
    now: Duration,
    next_port: u64,
    next_message: u64,
    ports: BTreeMap<u64, Port>,
    /// Group of each node that a partition named; the others are a group of their own.
    groups: BTreeMap<NodeName, usize>,
    /// Where nodes are, m.
    places: BTreeMap<NodeName, [f64; 3]>,
    stats: NetworkStats,
}

/// A message on its way; receivers share the payload.
type Letter = (Key, Arc<[u8]>);

#[derive(Debug)]
struct Port {
    node: NodeName,
    /// By time of arrival, then by order of sending.
    arriving: BTreeMap<(Duration, u64), Letter>,
    /// Latest ordered arrival from each port.
    in_order_until: BTreeMap<u64, Duration>,
}

impl Network {
    /// A network of these habits, all chance drawn from `seed`.
    pub fn new(config: NetworkConfig, seed: u64) -> Self {
        Self(Arc::new(Mutex::new(Air {
            config,
            rng: ChaCha8Rng::seed_from_u64(seed),
            now: Duration::ZERO,
            next_port: 0,
            next_message: 0,
            ports: BTreeMap::new(),
            groups: BTreeMap::new(),
            places: BTreeMap::new(),
            stats: NetworkStats::default(),
        })))
    }

    /// Connects a node. Two links of one name are two nodes that share it.
    pub fn join(&self, node: &NodeName) -> MemoryLink {
        let mut air = self.lock();
        let port = air.next_port;
        air.next_port += 1;
        air.ports.insert(
            port,
            Port { node: node.clone(), arriving: BTreeMap::new(), in_order_until: BTreeMap::new() },
        );
        MemoryLink { port, network: self.clone() }
    }

    /// Takes every link of that name off the network, as a crash does: what was on the way to it is lost.
    pub fn leave(&self, node: &NodeName) {
        self.lock().ports.retain(|_, port| port.node != *node);
    }

    /// Moves time on to `now`; it never goes back.
    pub fn advance(&self, now: Duration) {
        let mut air = self.lock();
        air.now = air.now.max(now);
    }

    /// When the next message arrives, if one is on its way.
    pub fn next_arrival(&self) -> Option<Duration> {
        self.lock().ports.values().filter_map(|port| port.arriving.keys().next()).map(|(at, _)| *at).min()
    }

    /// Changes the network's habits for messages put from now on.
    pub fn set_config(&self, config: NetworkConfig) {
        self.lock().config = config;
    }

    /// From now on, messages pass only inside each group; nodes that no group names are one group more.
    pub fn partition(&self, groups: &[&[NodeName]]) {
        self.lock().groups = groups
            .iter()
            .enumerate()
            .flat_map(|(index, group)| group.iter().map(move |node| (node.clone(), index)))
            .collect();
    }

    /// Ends a partition.
    pub fn heal(&self) {
        self.lock().groups.clear();
    }

    /// Places a node, m: what has none reaches everyone, whatever the range.
    pub fn place(&self, node: &NodeName, place: [f64; 3]) {
        self.lock().places.insert(node.clone(), place);
    }

    pub fn stats(&self) -> NetworkStats {
        self.lock().stats
    }

    /// A poisoned lock is taken all the same: each call leaves the network sound.
    fn lock(&self) -> MutexGuard<'_, Air> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl MemoryLink {
    /// When the next message arrives at this end, if one is on its way.
    pub fn next_arrival(&self) -> Option<Duration> {
        let air = self.network.lock();
        air.ports.get(&self.port)?.arriving.keys().next().map(|(at, _)| *at)
    }
}

impl Link for MemoryLink {
    fn put(&mut self, key: &Key, payload: Vec<u8>) {
        self.network.lock().put(self.port, key, payload.into());
    }

    fn poll(&mut self) -> Option<(Key, Vec<u8>)> {
        self.network.lock().poll(self.port)
    }
}

impl Air {
    fn put(&mut self, from: u64, key: &Key, payload: Arc<[u8]>) {
        let Some(sender) = self.ports.get(&from).map(|port| port.node.clone()) else { return };
        self.stats.messages += 1;
        self.stats.bytes += (key.to_string().len() + payload.len()) as u64;
        let receivers: Vec<u64> = self
            .ports
            .iter()
            .filter(|(id, port)| **id != from && key.recipient().is_none_or(|to| *to == port.node))
            .map(|(id, _)| *id)
            .collect();
        for to in receivers {
            let reachable = self.ports.get(&to).is_some_and(|port| self.reaches(&sender, &port.node));
            // The same draws whether or not there is a way, so that a partition changes nothing else.
            let lost = self.rng.random::<f64>() < self.config.loss;
            let copies = 1 + u64::from(self.rng.random::<f64>() < self.config.duplicate);
            for copy in 0..copies {
                let (arrival, overtakes) = self.draw_arrival(from, to);
                if !reachable || lost {
                    continue;
                }
                self.stats.duplicated += copy;
                self.stats.overtaking += u64::from(overtakes);
                let message = self.next_message;
                self.next_message += 1;
                if let Some(port) = self.ports.get_mut(&to) {
                    port.arriving.insert((arrival, message), (key.clone(), payload.clone()));
                }
            }
            if !reachable || lost {
                self.stats.lost += 1;
            }
        }
    }

    fn reaches(&self, from: &NodeName, to: &NodeName) -> bool {
        let is_in_range = |range_m: f64| match (self.places.get(from), self.places.get(to)) {
            (Some(from), Some(to)) => {
                let squared: f64 = from.iter().zip(to).map(|(from, to)| (from - to).powi(2)).sum();
                squared <= range_m * range_m
            }
            _ => true,
        };
        self.groups.get(from) == self.groups.get(to) && self.config.range_m.is_none_or(is_in_range)
    }

    /// When a message put now arrives, and whether it overtakes others.
    fn draw_arrival(&mut self, from: u64, to: u64) -> (Duration, bool) {
        let (least, greatest) = self.config.latency;
        let arrival = self.now + least + greatest.saturating_sub(least).mul_f64(self.rng.random::<f64>());
        let may_overtake = self.rng.random::<f64>() < self.config.reorder;
        let Some(port) = self.ports.get_mut(&to) else { return (arrival, false) };
        let until = port.in_order_until.entry(from).or_default();
        if may_overtake {
            return (arrival, arrival < *until);
        }
        *until = arrival.max(*until);
        (*until, false)
    }

    fn poll(&mut self, at: u64) -> Option<(Key, Vec<u8>)> {
        let now = self.now;
        let first = self.ports.get_mut(&at)?.arriving.first_entry()?;
        if first.key().0 > now {
            return None;
        }
        let (key, payload) = first.remove();
        self.stats.delivered += 1;
        Some((key, payload.to_vec()))
    }
}
