//! The processes that `link` talks to, and what both sides of it are made of.
//!
//! A peer lives until its standard input ends. Each line there ends a section of its measurements; when all is over it
//! prints what each section saw.

use std::io::BufRead as _;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};
use skein_bp::script::{Op, Script};
use skein_bp::{Bid, Program, ProgramConfig};
use skein_dbp::facts::{BlockLapsed, PeerLost};
use skein_dbp::{BidAck, Happened, Node, NodeConfig, NodeName};
use skein_sim::cli::Exit;
use skein_wire::event::{Declared as _, Enter, of_every_vehicle};
use skein_wire::{Fleet, Key, Link as _, NodeLink};
use skein_zenoh::{Bell, NetworkSettings, ZenohConfig, ZenohLink, ZenohSession};
use zenoh::Wait as _;
use zenoh::qos::CongestionControl;

use crate::task::Task;

/// The node that measures.
pub(super) const GROUND: &str = "ground/main";
/// The event that is requested of a home from afar.
pub(super) const PING: &str = "ping";
/// Keys of the round trip over plain Zenoh.
const ZENOH_PING: &str = "skein-bench/ping";
/// The way back.
const ZENOH_PONG: &str = "skein-bench/pong";
/// As long as a bid or an occurrence of one short event.
pub(super) const PAYLOAD: usize = 100;
/// Patience with a peer's first answer.
pub(super) const TIME_TO_MEET: Duration = Duration::from_secs(20);
/// An answer that takes longer counts as lost.
pub(super) const PATIENCE: Duration = Duration::from_secs(1);
/// A peer looks this often whether it is to end, if nothing comes.
const LOOK: Duration = Duration::from_millis(50);

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Role {
    /// Measures round trips over plain Zenoh: as many as its number in each section.
    ZenohAsk,
    /// Puts what it hears over plain Zenoh.
    ZenohEcho,
    /// Puts what it hears through a link's queues.
    Queues,
    /// Is a node of a fleet, and home to events.
    Node,
}

/// The observations of one node in one section.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Seen {
    /// Whom it lost, and which homes let go of its blocks.
    pub lost: Vec<String>,
    /// The longest that it took to take in what had come, go on, and hand over what it had to say.
    pub longest_superstep_us: f64,
}

/// A node over Zenoh, and the loop around it.
pub(super) struct Member {
    pub node: NodeLink,
    pub seen: Seen,
    link: ZenohLink,
    bell: Bell,
    began: Instant,
}

impl Member {
    /// A node of a fleet of the ground station and `homes` vehicles.
    pub fn new(
        session: &ZenohSession,
        name: &NodeName,
        homes: usize,
        program: Program,
    ) -> anyhow::Result<Self> {
        let roster = std::iter::once(NodeName::new(GROUND)).chain((1..=homes).map(home));
        let config = NodeConfig::new(name.clone(), 1, roster.collect::<Result<_, _>>()?);
        let link = session.link(name)?;
        Ok(Self {
            node: NodeLink::new(Node::new(config, program), fleet()?),
            seen: Seen::default(),
            bell: link.bell(),
            link,
            began: Instant::now(),
        })
    }

    pub fn up(&self) -> Duration {
        self.began.elapsed()
    }

    /// Waits until a message has come or the node's deadline has, goes on, and gives what has happened.
    pub fn go_on(&mut self) -> anyhow::Result<Vec<Happened>> {
        let due = self.node.node().next_deadline().saturating_sub(self.up());
        self.bell.wait(due.min(LOOK));
        let since = Instant::now();
        self.node.pump(self.up(), &mut self.link)?;
        let took_us = since.elapsed().as_secs_f64() * 1e6;
        self.seen.longest_superstep_us = self.seen.longest_superstep_us.max(took_us);
        let happened = self.node.node_mut().take_selections();
        for fact in happened.iter().filter(|fact| fact.home == *self.node.node().name()) {
            let lost = PeerLost::read(&fact.event).map(|lost| lost.node);
            let whom = lost.or_else(|| BlockLapsed::read(&fact.event).map(|lapsed| lapsed.home));
            self.seen.lost.extend(whom.map(|node| node.to_string()));
        }
        Ok(happened)
    }
}

/// The fleet of the benchmark.
pub(super) fn fleet() -> anyhow::Result<Fleet> {
    Ok(Fleet::new("bench")?)
}

/// The name of a vehicle, from 1.
pub(super) fn home(number: usize) -> Result<NodeName, skein_dbp::NodeNameError> {
    NodeName::new(&format!("uav/{number}"))
}

/// A session of ours that is connected to these, or that others connect to.
pub(super) fn session(connect: Vec<String>) -> anyhow::Result<ZenohSession> {
    Ok(ZenohSession::open(ZenohConfig::new(fleet()?, NetworkSettings::connected_to(connect)))?)
}

/// Zenoh as it comes, except that it looks for nobody by multicast.
fn plain_zenoh(listen: &[String], connect: &[String]) -> anyhow::Result<zenoh::Session> {
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("scouting/multicast/enabled", "false".to_owned()),
        ("listen/endpoints", format!("{listen:?}")),
        ("connect/endpoints", format!("{connect:?}")),
    ] {
        config.insert_json5(key, &value).map_err(anyhow::Error::from_boxed)?;
    }
    zenoh::open(config).wait().map_err(anyhow::Error::from_boxed)
}

#[derive(Args)]
pub struct Part {
    #[arg(value_enum)]
    role: Role,
    /// The endpoint at which the one who measures listens.
    connect: String,
    /// Its number among the homes, from 1.
    number: usize,
    homes: usize,
}

impl Task for Part {
    const NAME: &'static str = "link-peer";
    const ABOUT: &'static str = "A process that `link` talks to";
    const HIDDEN: bool = true;

    fn run(&self, _: bool) -> anyhow::Result<Exit> {
        let sections = sections();
        let Self { role, number, homes, .. } = *self;
        let connect = vec![self.connect.clone()];
        match role {
            Role::ZenohAsk => ask_over_zenoh(number, &connect, &sections),
            Role::ZenohEcho => echo_over_zenoh(&connect, &sections),
            Role::Queues => echo_through_queues(connect, &sections),
            Role::Node => be_a_node(number, homes, connect, &sections),
        }?;
        Ok(Exit::Done)
    }
}

/// A message for each line of standard input; gone when that ends.
fn sections() -> Receiver<()> {
    let (section, sections) = channel();
    std::thread::spawn(move || {
        for _ in std::io::stdin().lock().lines().map_while(Result::ok) {
            if section.send(()).is_err() {
                return;
            }
        }
    });
    sections
}

/// Tries until the peer is there.
pub(super) fn meet(mut answered: impl FnMut() -> anyhow::Result<bool>) -> anyhow::Result<()> {
    let deadline = Instant::now() + TIME_TO_MEET;
    while !answered()? {
        anyhow::ensure!(Instant::now() < deadline, "a peer does not answer");
    }
    Ok(())
}

pub(super) fn microseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e6
}

/// Says when it listens, and then for each section, in a line, how many microseconds its round trips took.
fn ask_over_zenoh(count: usize, listen: &[String], sections: &Receiver<()>) -> anyhow::Result<()> {
    let session = plain_zenoh(listen, &[])?;
    let replies = session.declare_subscriber(ZENOH_PONG).wait().map_err(anyhow::Error::from_boxed)?;
    let ask = |patience: Duration| {
        let put = session.put(ZENOH_PING, vec![0; PAYLOAD]).congestion_control(CongestionControl::Drop);
        put.wait().map_err(anyhow::Error::from_boxed)?;
        replies.recv_timeout(patience).map_err(anyhow::Error::from_boxed)
    };
    let round_trip = || {
        // An answer that came too late is no answer to the next.
        while let Ok(Some(_)) = replies.try_recv() {}
        let since = Instant::now();
        ask(PATIENCE)?.context("a message over plain Zenoh was lost")?;
        Ok(microseconds(since))
    };
    println!();
    meet(|| Ok(ask(LOOK)?.is_some()))?;
    while sections.recv().is_ok() {
        // The first finds everything cold.
        round_trip()?;
        let times = (0..count).map(|_| round_trip()).collect::<anyhow::Result<Vec<f64>>>()?;
        println!("{}", serde_json::to_string(&times)?);
    }
    Ok(())
}

fn echo_over_zenoh(connect: &[String], sections: &Receiver<()>) -> anyhow::Result<()> {
    let session = plain_zenoh(&[], connect)?;
    let echo = session.clone();
    let subscriber = session.declare_subscriber(ZENOH_PING).callback(move |sample| {
        let back = echo.put(ZENOH_PONG, sample.payload().clone()).congestion_control(CongestionControl::Drop);
        if let Err(error) = back.wait() {
            tracing::warn!("no way back: {error}");
        }
    });
    let _subscriber = subscriber.wait().map_err(anyhow::Error::from_boxed)?;
    while sections.recv().is_ok() {}
    Ok(())
}

/// Acknowledgements in the place of bids: the same keys that nodes use.
fn echo_through_queues(connect: Vec<String>, sections: &Receiver<()>) -> anyhow::Result<()> {
    let me = home(1)?;
    let mut link = session(connect)?.link(&me)?;
    let back = Key::to_one::<BidAck>(&fleet()?, me, NodeName::new(GROUND)?);
    let bell = link.bell();
    while sections.try_recv() != Err(TryRecvError::Disconnected) {
        bell.wait(LOOK);
        while let Some((_, payload)) = link.poll() {
            link.put(&back, payload);
        }
    }
    Ok(())
}

/// A vehicle that keeps everyone's `enter` back and is kept from nothing.
fn be_a_node(
    number: usize,
    homes: usize,
    connect: Vec<String>,
    sections: &Receiver<()>,
) -> anyhow::Result<()> {
    let mut program = Program::new(ProgramConfig::vehicle(number as u64));
    program.add("guard", Script::new(&[Op::Sync(Bid::new().block(of_every_vehicle::<Enter>()))])?);
    let mut member = Member::new(&session(connect)?, &home(number)?, homes, program)?;
    let mut seen = Vec::new();
    loop {
        member.go_on()?;
        match sections.try_recv() {
            Ok(()) => seen.push(std::mem::take(&mut member.seen)),
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => break,
        }
    }
    println!("{}", serde_json::to_string(&seen)?);
    Ok(())
}
