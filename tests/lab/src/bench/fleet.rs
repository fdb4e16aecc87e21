//! The cost of a node as the fleet grows: memory and messages, over the network in memory.
//!
//! Every vehicle asks leave to move ten times a second at its own home, claims a passage of its own from time to time
//! by a block at every other home, and tells its state ten times a second; the ground station launches them one after
//! another and holds them all for a while. Each size runs in a process of its own, so that its memory is its own.

use std::process::{Command, Stdio};
use std::time::Duration;

use anyhow::Context as _;
use clap::Args;
use serde::{Deserialize, Serialize};
use serde_json::json;
use skein_bp::{BThread, Bid, Context, Event, EventSet, Program, ProgramConfig};
use skein_dbp::{Node, NodeConfig, NodeName, facts};
use skein_sim::cli::Exit;
use skein_wire::event::{self, Declared as _, Enter, Takeoff, of, of_every_vehicle};
use skein_wire::{Fleet, Key, Link, MemoryLink, Network, NetworkConfig, NodeLink, State};

use crate::numbers::seconds;
use crate::task::Task;

/// A control loop's period.
const TICK: Duration = Duration::from_millis(20);
/// Between two states of a vehicle, and between two of its wishes to move.
const CYCLE: Duration = Duration::from_millis(100);
/// Between two claims of a vehicle.
const CLAIM_EVERY: Duration = Duration::from_secs(10);
/// Time that a vehicle is in its passage.
const PASSING: Duration = Duration::from_secs(2);
/// The swarm is held from the one to the other.
const HELD: (Duration, Duration) = (Duration::from_secs(10), Duration::from_secs(15));

/// The cost of one node of a fleet, on average.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Cost {
    nodes: usize,
    /// Memory that the process has taken for it, its share of the network in memory included.
    memory_bytes: f64,
    sent_messages_per_s: f64,
    sent_bytes_per_s: f64,
    received_messages_per_s: f64,
    received_bytes_per_s: f64,
    /// Events that its b-threads have seen happen, anywhere.
    events_per_s: f64,
}

#[derive(Args)]
pub struct Sizes {
    /// Sizes of the fleet, the ground station included.
    #[arg(long, value_name = "N", value_delimiter = ',', default_values_t = [2, 10, 50, 100])]
    nodes: Vec<usize>,
    /// Simulated time of each run.
    #[arg(long, value_name = "S", default_value = "30", value_parser = seconds)]
    seconds: Duration,
}

impl Task for Sizes {
    const NAME: &'static str = "fleet";
    const ABOUT: &'static str = "Memory and messages per node as a fleet grows, over the network in memory";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let costs = self.nodes.iter().map(|nodes| elsewhere(*nodes, self.seconds));
        let costs = costs.collect::<anyhow::Result<Vec<_>>>()?;
        if as_json {
            println!("{}", json!({ "simulated_s": self.seconds.as_secs_f64(), "per_node": costs }));
            return Ok(Exit::Done);
        }
        println!("| nodes | memory, kB | sent/s | sent, kB/s | received/s | received, kB/s | events/s |");
        println!("|---|---|---|---|---|---|---|");
        for cost in costs {
            println!(
                "| {} | {:.0} | {:.0} | {:.1} | {:.0} | {:.1} | {:.0} |",
                cost.nodes,
                cost.memory_bytes / 1e3,
                cost.sent_messages_per_s,
                cost.sent_bytes_per_s / 1e3,
                cost.received_messages_per_s,
                cost.received_bytes_per_s / 1e3,
                cost.events_per_s
            );
        }
        Ok(Exit::Done)
    }
}

fn elsewhere(nodes: usize, simulated: Duration) -> anyhow::Result<Cost> {
    let seconds = simulated.as_secs_f64().to_string();
    let output = Command::new(std::env::current_exe().context("where this program is")?)
        .args(["bench", OneSize::NAME, &nodes.to_string(), "--seconds", &seconds])
        .stderr(Stdio::inherit())
        .output()?;
    anyhow::ensure!(output.status.success(), "the run of {nodes} nodes has ended with {}", output.status);
    Ok(serde_json::from_slice(&output.stdout)?)
}

#[derive(Args)]
pub struct OneSize {
    /// Size of the fleet.
    nodes: usize,
    /// Simulated time.
    #[arg(long, value_name = "S", value_parser = seconds)]
    seconds: Duration,
}

impl Task for OneSize {
    const NAME: &'static str = "fleet-of";
    const ABOUT: &'static str = "One size of fleet, in this process; the cost as JSON";
    const HIDDEN: bool = true;

    fn run(&self, _: bool) -> anyhow::Result<Exit> {
        let Self { nodes, seconds: simulated } = *self;
        anyhow::ensure!(nodes >= 2 && !simulated.is_zero(), "a fleet has two nodes at least, and some time");
        let before = memory_bytes()?;
        let mut members = fleet(nodes)?;
        let mut now = Duration::ZERO;
        while now < simulated {
            members.network.advance(now);
            for member in &mut members.nodes {
                member.go_on(now)?;
            }
            now += TICK;
        }
        let memory = memory_bytes()?.saturating_sub(before);
        let sum = |of: fn(&Member) -> u64| members.nodes.iter().map(of).sum::<u64>() as f64 / nodes as f64;
        let rate = |of: fn(&Member) -> u64| sum(of) / simulated.as_secs_f64();
        let cost = Cost {
            nodes,
            memory_bytes: memory as f64 / nodes as f64,
            sent_messages_per_s: rate(|member| member.link.sent.messages),
            sent_bytes_per_s: rate(|member| member.link.sent.bytes),
            received_messages_per_s: rate(|member| member.link.received.messages),
            received_bytes_per_s: rate(|member| member.link.received.bytes),
            events_per_s: rate(|member| member.events),
        };
        println!("{}", serde_json::to_string(&cost)?);
        Ok(Exit::Done)
    }
}

/// The memory of this process that is backed by no file.
fn memory_bytes() -> anyhow::Result<u64> {
    let file = "/proc/self/status";
    let status = std::fs::read_to_string(file).with_context(|| format!("{file} tells a process's memory"))?;
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:"));
    let kibibytes = line.and_then(|line| line.trim().strip_suffix("kB")).map(str::trim);
    Ok(kibibytes.with_context(|| format!("{file} has no RssAnon"))?.parse::<u64>()? * 1024)
}

/// The members of a fleet and what joins them.
struct Members {
    network: Network,
    nodes: Vec<Member>,
}

/// A ground station and vehicles.
fn fleet(nodes: usize) -> anyhow::Result<Members> {
    let network = Network::new(NetworkConfig::default(), 1);
    let fleet = Fleet::new("bench")?;
    let ground = NodeName::new("ground/main")?;
    let vehicles = (1..nodes).map(|n| NodeName::new(&format!("uav/{n}"))).collect::<Result<Vec<_>, _>>()?;
    let roster: Vec<NodeName> = std::iter::once(&ground).chain(&vehicles).cloned().collect();
    let member = |name: &NodeName, program| {
        let node = Node::new(NodeConfig::new(name.clone(), 1, roster.clone()), program);
        let link =
            Counted { link: network.join(name), sent: Traffic::default(), received: Traffic::default() };
        Member { node: NodeLink::new(node, fleet.clone()), link, next_state: Duration::ZERO, events: 0 }
    };
    let mut station = Program::new(ProgramConfig::vehicle(0));
    station.add("launch", Launch { vehicles: vehicles.clone(), asked: 0 });
    station.add("hold", Hold(Held::NotYet));
    let mut nodes = vec![member(&ground, station)];
    for (n, me) in (1_u32..).zip(&vehicles) {
        let mut program = Program::new(ProgramConfig::vehicle(n.into()));
        program.add("preflight", Preflight { me: me.clone(), ready: false });
        program.add("advance", Advance { me: me.clone(), due: CYCLE, asking: false });
        // Not all at once.
        let first = CLAIM_EVERY * n / u32::try_from(vehicles.len()).unwrap_or(u32::MAX);
        program.add(CLAIM, Claim { me: me.clone(), passage: n, phase: Phase::Away { until: first } });
        program.add("watch", Watch);
        nodes.push(member(me, program));
    }
    Ok(Members { network, nodes })
}

struct Member {
    node: NodeLink,
    link: Counted,
    next_state: Duration,
    events: u64,
}

impl Member {
    fn go_on(&mut self, now: Duration) -> anyhow::Result<()> {
        self.node.pump(now, &mut self.link)?;
        self.node.take_states();
        self.events += self.node.node_mut().take_selections().len() as u64;
        let me = self.node.node().name();
        if me.as_str() != "ground/main" && now >= self.next_state {
            self.next_state += CYCLE;
            let state = State { time: now, ..State::new(me.clone()) };
            self.node.put_state(&state, &mut self.link);
        }
        Ok(())
    }
}

/// A link and what has passed through it.
struct Counted {
    link: MemoryLink,
    sent: Traffic,
    received: Traffic,
}

/// Messages, and the bytes of their keys and payloads.
#[derive(Default)]
struct Traffic {
    messages: u64,
    bytes: u64,
}

impl Traffic {
    fn count(&mut self, key: &Key, payload: &[u8]) {
        self.messages += 1;
        self.bytes += (key.to_string().len() + payload.len()) as u64;
    }
}

impl Link for Counted {
    fn put(&mut self, key: &Key, payload: Vec<u8>) {
        self.sent.count(key, &payload);
        self.link.put(key, payload);
    }

    fn poll(&mut self) -> Option<(Key, Vec<u8>)> {
        let (key, payload) = self.link.poll()?;
        self.received.count(&key, &payload);
        Some((key, payload))
    }
}

/// Asks one vehicle after another to take off.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Launch {
    vehicles: Vec<NodeName>,
    asked: usize,
}

impl BThread for Launch {
    fn bid(&self) -> Option<Bid> {
        self.vehicles.get(self.asked).map(|vehicle| Bid::new().request(Takeoff.at(vehicle)))
    }

    fn resume(&mut self, _: &Event, _: &mut Context) {
        self.asked += 1;
    }
}

/// Blocks `advance` of all vehicles for a while.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Hold(Held);

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Held {
    NotYet,
    Now,
    NoMore,
}

impl BThread for Hold {
    fn bid(&self) -> Option<Bid> {
        match self.0 {
            Held::NotYet => Some(Bid::new().deadline(HELD.0)),
            Held::Now => Some(Bid::new().block(of_every_vehicle::<event::Advance>()).deadline(HELD.1)),
            Held::NoMore => None,
        }
    }

    fn resume(&mut self, _: &Event, _: &mut Context) {
        self.0 = if self.0 == Held::NotYet { Held::Now } else { Held::NoMore };
    }
}

/// Blocks the vehicle's own take-off until its checks pass.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Preflight {
    me: NodeName,
    ready: bool,
}

impl BThread for Preflight {
    fn bid(&self) -> Option<Bid> {
        let checked = Bid::new().block(of::<Takeoff>(&self.me)).deadline(CYCLE);
        (!self.ready).then_some(checked)
    }

    fn resume(&mut self, _: &Event, _: &mut Context) {
        self.ready = true;
    }
}

/// Asks leave to move once in every cycle.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Advance {
    me: NodeName,
    due: Duration,
    asking: bool,
}

impl BThread for Advance {
    fn bid(&self) -> Option<Bid> {
        Some(match self.asking {
            true => Bid::new().request(event::Advance::ANYWHERE.at(&self.me)),
            false => Bid::new().deadline(self.due),
        })
    }

    fn resume(&mut self, _: &Event, cx: &mut Context) {
        self.asking = !self.asking;
        self.due = cx.now() + CYCLE;
    }
}

const CLAIM: &str = "claim";

/// Takes the right of way through a passage: blocks everyone else's `enter` there, awaits confirmation, enters, leaves.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Claim {
    me: NodeName,
    passage: u32,
    phase: Phase,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Away { until: Duration },
    Claiming,
    Entering,
    Inside { until: Duration },
}

impl BThread for Claim {
    fn bid(&self) -> Option<Bid> {
        let others = of_every_vehicle::<Enter>().and(of::<Enter>(&self.me).not());
        let claim = Bid::new().block(others.and(EventSet::field_is("passage", self.passage)));
        Some(match self.phase {
            Phase::Away { until } => Bid::new().deadline(until),
            Phase::Claiming => claim.wait_for(facts::confirmed(&self.me, CLAIM)),
            Phase::Entering => {
                claim.request(Event::new(self.me.event_name(Enter::NAME)).with("passage", self.passage))
            }
            Phase::Inside { until } => claim.deadline(until),
        })
    }

    fn resume(&mut self, _: &Event, cx: &mut Context) {
        self.phase = match self.phase {
            Phase::Away { .. } => Phase::Claiming,
            Phase::Claiming => Phase::Entering,
            Phase::Entering => Phase::Inside { until: cx.now() + PASSING },
            Phase::Inside { .. } => Phase::Away { until: cx.now() + CLAIM_EVERY - PASSING },
        };
    }
}

/// Takes note of who enters where.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Watch;

impl BThread for Watch {
    fn bid(&self) -> Option<Bid> {
        Some(Bid::new().wait_for(of_every_vehicle::<Enter>()))
    }

    fn resume(&mut self, _: &Event, _: &mut Context) {}
}
