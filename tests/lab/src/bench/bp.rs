//! Behavioural programs: how many events a second of one processor's time gives, beside BPpy's on the same programs,
//! and how many states a second are verified.

use std::io::Write as _;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use clap::Args;
use serde::{Deserialize, Serialize};
use serde_json::json;
use skein_bp::script::{Op, Script};
use skein_bp::verify::{Inspection, Verifier};
use skein_bp::{Bid, EventSet, Program, ProgramConfig};
use skein_sim::cli::Exit;

use crate::cpu_time;
use crate::numbers::seconds;
use crate::quantile::median;
use crate::task::Task;

/// The same programs on BPpy, for a Python that has it.
const PEER: &str = include_str!("bp_peer.py");
/// The Python that runs them, if it is not `python3`.
const PYTHON: &str = "SKEIN_PYTHON";
/// Events between two looks at the clock.
const BATCH: u32 = 100;

/// One figure for each program, in events per second of CPU time.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Figures<T> {
    /// Two taps that want to run for ever, and a b-thread that makes them take turns.
    hot_cold: T,
    /// The same beside 100 b-threads that wait for events which never come.
    idle_100: T,
    /// The same beside 1000.
    idle_1000: T,
    /// A b-thread that requests an event for ever, and 1000 that each of them wakes.
    woken_1000: T,
}

impl<T> Figures<T> {
    fn map<U>(self, mut to: impl FnMut(T) -> U) -> Figures<U> {
        let Self { hot_cold, idle_100, idle_1000, woken_1000 } = self;
        Figures {
            hot_cold: to(hot_cold),
            idle_100: to(idle_100),
            idle_1000: to(idle_1000),
            woken_1000: to(woken_1000),
        }
    }
}

#[derive(Args)]
pub struct Bp {
    /// Runs of each program; the median counts.
    #[arg(long, value_name = "N", default_value_t = 5)]
    repetitions: usize,
    /// CPU time of each run.
    #[arg(long, value_name = "S", default_value = "0.5", value_parser = seconds)]
    seconds: Duration,
    /// Diners in the state space that the verifier explores.
    #[arg(long, value_name = "N", default_value_t = 12)]
    philosophers: usize,
}

impl Task for Bp {
    const NAME: &'static str = "bp";
    const ABOUT: &'static str =
        "Behavioural programs on one processor, beside the same on BPpy where Python has it";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let Self { repetitions, seconds: cpu_time, philosophers } = *self;
        let ours = measure(repetitions, cpu_time)?;
        let verified = verify(philosophers)?;
        let theirs = match measure_peer(repetitions, cpu_time) {
            Ok(theirs) => Some(theirs),
            Err(why) => {
                eprintln!(
                    "skein-lab: no comparison: {why:#}; `python3 -m pip install bppy` provides it, {PYTHON} names another interpreter"
                );
                None
            }
        };
        let ratio = |of: fn(&Figures<f64>) -> f64| theirs.as_ref().map(|theirs| of(&ours) / of(theirs));
        let lost = 1.0 - ours.idle_1000 / ours.hot_cold;
        if as_json {
            let object = json!({
                "hot_cold_events_per_s": ours.hot_cold,
                "idle_100_events_per_s": ours.idle_100,
                "idle_1000_events_per_s": ours.idle_1000,
                "woken_1000_events_per_s": ours.woken_1000,
                "lost_to_1000_idle": lost,
                "philosophers": philosophers,
                "verified_states": verified.states,
                "verify_states_per_s": verified.states as f64 / verified.time_s,
                "verify_states_per_cpu_s": verified.states as f64 / verified.cpu_time_s,
                "bppy_events_per_s": theirs,
                "ratio_hot_cold": ratio(|figures| figures.hot_cold),
                "ratio_idle_100": ratio(|figures| figures.idle_100),
                "ratio_idle_1000": ratio(|figures| figures.idle_1000),
                "ratio_woken_1000": ratio(|figures| figures.woken_1000),
            });
            println!("{object}");
            return Ok(Exit::Done);
        }
        type Pick = fn(&Figures<f64>) -> f64;
        let rows: [(&str, Pick); 4] = [
            ("hot and cold", |figures| figures.hot_cold),
            ("with 100 idle", |figures| figures.idle_100),
            ("with 1000 idle", |figures| figures.idle_1000),
            ("1000 woken by each", |figures| figures.woken_1000),
        ];
        for (name, of) in rows {
            let beside = match (&theirs, ratio(of)) {
                (Some(theirs), Some(ratio)) => format!(", {ratio:.0} times BPpy's {:.0}", of(theirs)),
                _ => String::new(),
            };
            println!("{name:<20} {:>10.0} events per CPU second{beside}", of(&ours));
        }
        println!("1000 idle b-threads cost {:.1} %", lost * 100.0);
        println!(
            "{philosophers} dining philosophers: {} states verified, {:.0} a second",
            verified.states,
            verified.states as f64 / verified.time_s
        );
        Ok(Exit::Done)
    }
}

/// The median of several runs of each program, one after another so that a disturbance meets all alike.
fn measure(repetitions: usize, cpu_time: Duration) -> anyhow::Result<Figures<f64>> {
    let mut runs = Figures { hot_cold: vec![], idle_100: vec![], idle_1000: vec![], woken_1000: vec![] };
    for _ in 0..repetitions {
        runs.hot_cold.push(events_per_s(hot_cold(0)?, cpu_time)?);
        runs.idle_100.push(events_per_s(hot_cold(100)?, cpu_time)?);
        runs.idle_1000.push(events_per_s(hot_cold(1000)?, cpu_time)?);
        runs.woken_1000.push(events_per_s(woken(1000)?, cpu_time)?);
    }
    Ok(runs.map(median))
}

/// The same on BPpy.
fn measure_peer(repetitions: usize, cpu_time: Duration) -> anyhow::Result<Figures<f64>> {
    let python = std::env::var_os(PYTHON).unwrap_or_else(|| "python3".into());
    let mut peer = Command::new(&python)
        .args(["-", &repetitions.to_string(), &cpu_time.as_secs_f64().to_string()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .with_context(|| format!("{} cannot be started", python.display()))?;
    if let Some(mut input) = peer.stdin.take() {
        input.write_all(PEER.as_bytes())?;
    }
    let output = peer.wait_with_output()?;
    let said = String::from_utf8_lossy(&output.stderr);
    let why = || format!("{}: {}", python.display(), said.trim().lines().last().unwrap_or("no word"));
    anyhow::ensure!(output.status.success(), why());
    let runs: Figures<Vec<f64>> = serde_json::from_slice(&output.stdout).with_context(why)?;
    Ok(runs.map(median))
}

fn events_per_s(mut program: Program, cpu_time: Duration) -> anyhow::Result<f64> {
    program.synchronise(Duration::ZERO)?;
    let since = cpu_time::this_thread()?;
    let mut events = 0.0;
    loop {
        for _ in 0..BATCH {
            program.step(Duration::ZERO)?.context("the program has stopped")?;
        }
        events += f64::from(BATCH);
        let taken = cpu_time::this_thread()? - since;
        if taken >= cpu_time && !taken.is_zero() {
            return Ok(events / taken.as_secs_f64());
        }
    }
}

/// The verifier's work.
struct Verified {
    states: usize,
    time_s: f64,
    cpu_time_s: f64,
}

/// Looks for a deadlock at a table that has none, so at every state.
fn verify(philosophers: usize) -> anyhow::Result<Verified> {
    let verifier = Verifier::new(dinner(philosophers)?).inspect([Inspection::Deadlock]);
    let (since, cpu_since) = (Instant::now(), cpu_time::this_process()?);
    let report = verifier.run();
    let (time, cpu_time) = (since.elapsed(), cpu_time::this_process()? - cpu_since);
    anyhow::ensure!(report.verdict.is_none() && report.is_complete(), "the verifier is wrong: {report}");
    Ok(Verified { states: report.states, time_s: time.as_secs_f64(), cpu_time_s: cpu_time.as_secs_f64() })
}

/// Philosophers between sticks; all but the first take the right one first.
fn dinner(philosophers: usize) -> anyhow::Result<Program> {
    let mut program = Program::new(ProgramConfig::default());
    for i in 1..=philosophers {
        let next = i % philosophers + 1;
        let taken = EventSet::from([format!("take/{i}/right"), format!("take/{next}/left")]);
        let put = EventSet::from([format!("put/{i}/right"), format!("put/{next}/left")]);
        let lies = Bid::new().wait_for(&taken).block(&put);
        forever(&mut program, &format!("stick {i}"), [lies, Bid::new().wait_for(put).block(taken)])?;
        let (first, second) = if i == 1 { ("left", "right") } else { ("right", "left") };
        let acts = [("take", first), ("take", second), ("put", second), ("put", first)];
        let acts = acts.map(|(act, side)| Bid::new().request(format!("{act}/{i}/{side}")));
        forever(&mut program, &format!("philosopher {i}"), acts)?;
    }
    Ok(program)
}

fn hot_cold(idle: usize) -> anyhow::Result<Program> {
    let mut program = Program::new(ProgramConfig::default());
    forever(&mut program, "hot tap", [Bid::new().request("hot")])?;
    forever(&mut program, "cold tap", [Bid::new().request("cold")])?;
    let cold_first = Bid::new().wait_for("cold").block("hot");
    forever(&mut program, "alternator", [cold_first, Bid::new().wait_for("hot").block("cold")])?;
    for n in 0..idle {
        forever(&mut program, &format!("idle {n}"), [Bid::new().wait_for(format!("never/{n}"))])?;
    }
    Ok(program)
}

fn woken(waiters: usize) -> anyhow::Result<Program> {
    let mut program = Program::new(ProgramConfig::default());
    forever(&mut program, "clock", [Bid::new().request("tick")])?;
    for n in 0..waiters {
        forever(&mut program, &format!("waiter {n}"), [Bid::new().wait_for("tick")])?;
    }
    Ok(program)
}

fn forever<const N: usize>(program: &mut Program, name: &str, bids: [Bid; N]) -> anyhow::Result<()> {
    program.add(name, Script::new(&[Op::forever(bids.map(Op::Sync))])?);
    Ok(())
}
