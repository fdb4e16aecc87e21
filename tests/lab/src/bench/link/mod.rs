//! Round trips between processes over real Zenoh on the loopback interface: plain, through our queues, and as events.
//!
//! The other processes are this program again, in a role of its own (see [`peer`]).

pub mod peer;

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{Ipv4Addr, TcpListener};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use clap::builder::RangedU64ValueParser;
use clap::{Args, ValueEnum as _};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde::Serialize;
use serde_json::json;
use skein_bp::script::{Op, Script};
use skein_bp::{BThread, Bid, Context, Event, Program, ProgramConfig};
use skein_dbp::{BidRecord, NodeName, facts};
use skein_sim::cli::Exit;
use skein_wire::event::{Advance, Declared as _, of_every_vehicle};
use skein_wire::{Key, Link as _};
use skein_zenoh::{ZenohLink, ZenohSession};

use self::peer::{
    GROUND, Member, PATIENCE, PAYLOAD, PING, Part, Role, Seen, TIME_TO_MEET, fleet, home, meet, microseconds,
    session,
};
use crate::numbers::seconds;
use crate::quantile::quantile;
use crate::task::Task;

/// Zenoh's threads as it comes.
const AS_IT_COMES: &str = "()";
/// The kinds take turns, so that a disturbance meets all alike.
const TURNS: usize = 20;
/// Between two blocks that are to be confirmed.
const REST: Duration = Duration::from_millis(7);

/// The median and the longest but one in a hundred.
#[derive(Debug, Clone, Copy, Serialize)]
struct Times {
    p50: f64,
    p99: f64,
}

impl Times {
    fn of(mut times: Vec<f64>) -> Self {
        times.sort_by(f64::total_cmp);
        Self { p50: quantile(&times, 0.5), p99: quantile(&times, 0.99) }
    }
}

#[derive(Args)]
pub struct Extent {
    /// Round trips of each kind.
    #[arg(long, value_name = "N", default_value_t = 4000)]
    round_trips: usize,
    /// Homes that confirm a block, each in a process of its own.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = RangedU64ValueParser::<usize>::new().range(2..))]
    homes: usize,
    /// Blocks that are confirmed.
    #[arg(long, value_name = "N", default_value_t = 500)]
    confirmations: usize,
    /// Time for which one process is stopped; more than a lease.
    #[arg(long = "stopped-s", value_name = "S", default_value = "5", value_parser = seconds)]
    stopped: Duration,
}

impl Task for Extent {
    const NAME: &'static str = "link";
    const ABOUT: &'static str =
        "Round trips between processes over Zenoh: plain, through the link's queues, and as events";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let [zenoh, shared, queued, event] = round_trips(self.round_trips)?;
        let SwarmSeen { confirm, before, during, others_lost } = swarm(self)?;
        let stopped = json!({
            "leases_lost": others_lost,
            "longest_superstep_us": during,
            "longest_superstep_before_us": before,
        });
        if as_json {
            let object = json!({
                "zenoh_rtt_us": zenoh,
                "zenoh_shared_rtt_us": shared,
                "queued_rtt_us": queued,
                "event_rtt_us": event,
                "ratio_p50": event.p50 / zenoh.p50,
                "ratio_event_shared_p50": event.p50 / shared.p50,
                "ratio_event_queued_p50": event.p50 / queued.p50,
                "homes": self.homes,
                "confirm_10_homes_us": confirm,
                "stopped": stopped,
            });
            println!("{object}");
            return Ok(Exit::Done);
        }
        let line = |what: &str, times: Times| {
            println!("{what:<32} median {:>7.0} us, p99 {:>7.0} us", times.p50, times.p99);
        };
        line("plain Zenoh, there and back", zenoh);
        line("the same on two threads, as ours", shared);
        line("through our queues", queued);
        line("request to resumed b-thread", event);
        println!(
            "an event takes {:.2} times plain Zenoh, {:.2} times Zenoh on two threads, {:.2} times our queues",
            event.p50 / zenoh.p50,
            event.p50 / shared.p50,
            event.p50 / queued.p50
        );
        line(&format!("a block confirmed by {} homes", self.homes), confirm);
        println!(
            "one of them stopped: {others_lost} leases lost among the others, longest superstep {during:.0} us (before: {before:.0} us)"
        );
        Ok(Exit::Done)
    }
}

/// Times in microseconds over plain Zenoh, over Zenoh on the threads that ours works on, through our queues, and as
/// events.
fn round_trips(count: usize) -> anyhow::Result<[Times; 4]> {
    let each = count.div_ceil(TURNS);
    let mut plain = Plain::start(each, Some(AS_IT_COMES))?;
    let mut shared = Plain::start(each, None)?;
    let mut queues = Queues::start()?;
    let mut events = Events::start()?;
    let mut times = [Vec::new(), Vec::new(), Vec::new(), Vec::new()];
    for _ in 0..TURNS {
        let [zenoh_us, shared_us, queued_us, event_us] = &mut times;
        // The first of each turn finds everything cold.
        zenoh_us.extend(plain.round_trips()?);
        shared_us.extend(shared.round_trips()?);
        queues.round_trip()?;
        for _ in 0..each {
            queued_us.push(queues.round_trip()?);
        }
        events.round_trip()?;
        for _ in 0..each {
            event_us.push(events.round_trip()?);
        }
    }
    Ok(times.map(Times::of))
}

/// A put, and a reply through a subscriber: between two other processes, whose Zenoh can be set up differently from
/// ours.
struct Plain {
    asks: Peer,
    _echoes: Peer,
}

impl Plain {
    fn start(count: usize, runtime: Option<&str>) -> anyhow::Result<Self> {
        let endpoint = free_endpoint()?;
        let mut asks = Peer::start_on(Role::ZenohAsk, count, 1, &endpoint, runtime)?;
        asks.hear()?;
        let echoes = Peer::start_on(Role::ZenohEcho, 1, 1, &endpoint, runtime)?;
        Ok(Self { asks, _echoes: echoes })
    }

    /// Microseconds of each of one turn.
    fn round_trips(&mut self) -> anyhow::Result<Vec<f64>> {
        self.asks.end_section()?;
        Ok(serde_json::from_str(&self.asks.hear()?)?)
    }
}

fn free_endpoint() -> anyhow::Result<String> {
    let port = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?.local_addr()?.port();
    Ok(format!("tcp/127.0.0.1:{port}"))
}

/// The same through the queues of links on both sides.
struct Queues {
    link: ZenohLink,
    there: Key,
    _peer: Peer,
}

impl Queues {
    fn start() -> anyhow::Result<Self> {
        let session = session(Vec::new())?;
        let me = NodeName::new(GROUND)?;
        let there = Key::to_one::<BidRecord>(&fleet()?, me.clone(), home(1)?);
        let peer = Peer::start(Role::Queues, 1, 1, locator(&session)?)?;
        let mut queues = Self { link: session.link(&me)?, there, _peer: peer };
        meet(|| Ok(queues.ask(Duration::from_millis(50))))?;
        Ok(queues)
    }

    fn ask(&mut self, patience: Duration) -> bool {
        self.link.put(&self.there, vec![0; PAYLOAD]);
        let (bell, deadline) = (self.link.bell(), Instant::now() + patience);
        while self.link.poll().is_none() {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            bell.wait(left);
        }
        true
    }

    fn round_trip(&mut self) -> anyhow::Result<f64> {
        while self.link.poll().is_some() {}
        let since = Instant::now();
        anyhow::ensure!(self.ask(PATIENCE), "a message through the queues was lost");
        Ok(microseconds(since))
    }
}

fn locator(session: &ZenohSession) -> anyhow::Result<&str> {
    Ok(session.locators().first().context("a session listens somewhere")?)
}

/// A b-thread's request at another home, until the b-thread goes on and requests again.
struct Events {
    member: Member,
    _peer: Peer,
}

impl Events {
    fn start() -> anyhow::Result<Self> {
        let session = session(Vec::new())?;
        let mut program = Program::new(ProgramConfig::vehicle(1));
        let ask = Bid::new().request(home(1)?.event_name(PING));
        program.add("asker", Script::new(&[Op::forever([Op::Sync(ask)])])?);
        let peer = Peer::start(Role::Node, 1, 1, locator(&session)?)?;
        let mut events =
            Self { member: Member::new(&session, &NodeName::new(GROUND)?, 1, program)?, _peer: peer };
        meet(|| events.occurred())?;
        Ok(events)
    }

    fn occurred(&mut self) -> anyhow::Result<bool> {
        Ok(self.member.go_on()?.iter().any(|happened| happened.event.kind() == PING))
    }

    /// From one occurrence to the next: the resumed b-thread has requested again in the step that resumed it.
    fn round_trip(&mut self) -> anyhow::Result<f64> {
        let since = Instant::now();
        while !self.occurred()? {
            anyhow::ensure!(since.elapsed() < TIME_TO_MEET, "a requested event does not occur");
        }
        Ok(microseconds(since))
    }
}

/// The observations in a fleet of many processes.
struct SwarmSeen {
    confirm: Times,
    /// Longest superstep in microseconds, before and while one process was stopped.
    before: f64,
    during: f64,
    /// Leases that the others lost among themselves meanwhile.
    others_lost: usize,
}

/// A ground station here, and each of its homes in a process of its own; the last of them is stopped in the end.
fn swarm(extent: &Extent) -> anyhow::Result<SwarmSeen> {
    let session = session(Vec::new())?;
    let ground = NodeName::new(GROUND)?;
    let mut program = Program::new(ProgramConfig::vehicle(1));
    let confirm =
        Confirm { ground: ground.clone(), blocking: false, stated: Duration::ZERO, until: Duration::ZERO };
    program.add(CONFIRM, confirm);
    let mut member = Member::new(&session, &ground, extent.homes, program)?;
    let peers =
        (1..=extent.homes).map(|number| Peer::start(Role::Node, number, extent.homes, locator(&session)?));
    let mut peers = peers.collect::<anyhow::Result<Vec<_>>>()?;
    // The first few find nodes that have not met yet.
    let mut times_us = Vec::new();
    meet(|| {
        times_us.extend(confirmation(&mut member)?);
        Ok(times_us.len() >= 10)
    })?;
    times_us.clear();
    member.seen = Seen::default();
    peers.iter_mut().try_for_each(Peer::end_section)?;
    let deadline = Instant::now() + TIME_TO_MEET + (REST + PATIENCE) * extent.confirmations as u32;
    while times_us.len() < extent.confirmations {
        anyhow::ensure!(Instant::now() < deadline, "blocks are not confirmed");
        times_us.extend(confirmation(&mut member)?);
    }
    let before = std::mem::take(&mut member.seen);
    peers.iter_mut().try_for_each(Peer::end_section)?;

    let victim = peers.last().context("there are homes")?;
    victim.signal(Signal::SIGSTOP)?;
    let since = Instant::now();
    while since.elapsed() < extent.stopped {
        member.go_on()?;
    }
    let during = std::mem::take(&mut member.seen);
    let (_, awake) = peers.split_last_mut().context("there are homes")?;
    awake.iter_mut().try_for_each(Peer::end_section)?;
    // The section of each is over once it has looked.
    let since = Instant::now();
    while since.elapsed() < PATIENCE {
        member.go_on()?;
    }
    let victim = peers.pop().context("there are homes")?;
    let stopped = home(extent.homes)?;
    victim.signal(Signal::SIGCONT)?;

    let sections = peers.into_iter().map(Peer::end).collect::<anyhow::Result<Vec<_>>>()?;
    let longest = |own: &Seen, section: usize| {
        let others = sections.iter().filter_map(|seen| seen.get(section));
        others.chain([own]).map(|seen| seen.longest_superstep_us).fold(0.0, f64::max)
    };
    let lost = sections.iter().filter_map(|seen| seen.get(2)).chain([&during]).flat_map(|seen| &seen.lost);
    Ok(SwarmSeen {
        confirm: Times::of(times_us),
        before: longest(&before, 1),
        during: longest(&during, 2),
        others_lost: lost.filter(|whom| **whom != stopped.as_str()).count(),
    })
}

/// Lets the fleet go on once; the microseconds that a block took, if it has just been confirmed.
fn confirmation(member: &mut Member) -> anyhow::Result<Option<f64>> {
    let confirmed = member.go_on()?.iter().any(|happened| happened.event.kind() == facts::Confirmed::NAME);
    let state = member.node.node().program().state_of::<Confirm>(CONFIRM);
    let took = state.map(|confirm| (member.up() - confirm.stated).as_secs_f64() * 1e6);
    Ok(took.filter(|_| confirmed))
}

const CONFIRM: &str = "confirm";

/// Blocks `advance` everywhere until that is confirmed, rests, and blocks again.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Confirm {
    ground: NodeName,
    blocking: bool,
    /// Time of the last block.
    stated: Duration,
    until: Duration,
}

impl BThread for Confirm {
    fn bid(&self) -> Option<Bid> {
        Some(match self.blocking {
            true => Bid::new()
                .block(of_every_vehicle::<Advance>())
                .wait_for(facts::confirmed(&self.ground, CONFIRM)),
            false => Bid::new().deadline(self.until),
        })
    }

    fn resume(&mut self, _: &Event, cx: &mut Context) {
        self.blocking = !self.blocking;
        match self.blocking {
            true => self.stated = cx.now(),
            false => self.until = cx.now() + REST,
        }
    }
}

/// A process in a role. It ends with this.
struct Peer {
    child: Child,
    sections: Option<ChildStdin>,
    said: BufReader<ChildStdout>,
}

impl Peer {
    fn start(role: Role, number: usize, homes: usize, connect: &str) -> anyhow::Result<Self> {
        Self::start_on(role, number, homes, connect, None)
    }

    /// A process whose Zenoh works on the threads that `runtime` says.
    fn start_on(
        role: Role,
        number: usize,
        homes: usize,
        endpoint: &str,
        runtime: Option<&str>,
    ) -> anyhow::Result<Self> {
        let role = role.to_possible_value().context("every role has a name")?;
        let mut command = Command::new(std::env::current_exe().context("where this program is")?);
        command.envs(runtime.map(|runtime| ("ZENOH_RUNTIME", runtime)));
        command.args(["bench", Part::NAME, role.get_name(), endpoint]);
        command.args([number, homes].map(|n| n.to_string()));
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let sections = child.stdin.take();
        let said = BufReader::new(child.stdout.take().context("its output is read")?);
        Ok(Self { child, sections, said })
    }

    /// The next line that it says.
    fn hear(&mut self) -> anyhow::Result<String> {
        let mut line = String::new();
        anyhow::ensure!(self.said.read_line(&mut line)? > 0, "a peer has ended");
        Ok(line)
    }

    fn signal(&self, signal: Signal) -> anyhow::Result<()> {
        Ok(kill(Pid::from_raw(i32::try_from(self.child.id())?), signal)?)
    }

    fn end_section(&mut self) -> anyhow::Result<()> {
        let sections = self.sections.as_mut().context("it has not been ended")?;
        sections.write_all(b"\n")?;
        Ok(sections.flush()?)
    }

    /// Ends it, and returns its observations in each section.
    fn end(mut self) -> anyhow::Result<Vec<Seen>> {
        self.sections = None;
        let mut said = String::new();
        self.said.read_to_string(&mut said)?;
        serde_json::from_str(&said).context("a peer has ended without a report")
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
