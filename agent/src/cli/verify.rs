//! `skein-agent verify`: looks at every run of the program that flies, or of small networks.

use std::cell::Cell;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context as _, bail, ensure};
use serde_json::{Value, json};
use skein_bp::behaviour::Behaviours;
use skein_bp::script::{Argument, Assignment, ParameterKind, ScriptFile};
use skein_bp::verify::{Progress, Report, Violation};
use skein_dbp::verify::programs::{self, Network};
use skein_dbp::verify::{Faults, MoveCounts};

use crate::agent_error::AgentError;
use crate::bthreads::LinkLossPolicy;
use crate::config::AgentConfig;
use crate::config_file::Config;
use crate::verify::{NotCovered, Scene, SceneReport, VehicleVerifier};

/// States of a scene that are looked at unless told otherwise.
const STATES_OF_SCENE: usize = 1_000_000;
/// States of a network that are looked at unless told otherwise.
const STATES_OF_NETWORK: usize = 50_000;
/// States that are drawn unless told otherwise.
const STATES_DRAWN: usize = 1_000;

/// The faults that are looked for in every network.
const LOOKED_FOR: [&str; 4] = [
    "failed assertions",
    "nodes that do not settle",
    "b-threads that are hot where nothing is due any more",
    "cycles along which a b-thread is always hot, though all that stays on its way arrives and time passes",
];

/// The arguments of `skein-agent verify`.
#[derive(clap::Args)]
pub struct Verify {
    /// Configuration of the vehicle [default: agent/agent.toml, returning home when the ground station is lost].
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Run this script too; parameters without a default get values that fit.
    #[arg(long, value_name = "FILE")]
    script: Vec<PathBuf>,
    /// Check this scene only; may be repeated.
    #[arg(long, value_name = "NAME")]
    scene: Vec<String>,
    /// Check programs on networks of up to three nodes instead: all, or the one of this name.
    #[arg(long, value_name = "NAME", num_args = 0..=1, conflicts_with_all = ["config", "script", "scene", "dot"])]
    network: Option<Option<String>>,
    /// Explore at most N states of each scene or network; 0 explores all.
    #[arg(long, value_name = "N")]
    states: Option<usize>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    /// Write the state graph of one scene for Graphviz instead of checking it.
    #[arg(long, value_name = "FILE", requires = "scene")]
    dot: Option<PathBuf>,
}

impl Verify {
    /// Verifies, prints what was found, and says whether all is well.
    pub fn run(self, known: &Behaviours) -> anyhow::Result<ExitCode> {
        let is_well = match (&self.network, &self.dot) {
            (Some(name), _) => self.networks(name.as_deref())?,
            (None, Some(file)) => self.draw(file, known)?,
            (None, None) => self.vehicle(known)?,
        };
        Ok(if is_well { ExitCode::SUCCESS } else { ExitCode::from(1) })
    }

    fn most_states(&self, unless_told: usize) -> usize {
        match self.states {
            Some(0) => usize::MAX,
            states => states.unwrap_or(unless_told),
        }
    }

    /// Of the vehicle with its scripts; why not, if one of these is refused.
    fn verifier(
        &self,
        unless_told: usize,
        known: &Behaviours,
    ) -> anyhow::Result<Result<VehicleVerifier, String>> {
        let mut config = match &self.config {
            Some(path) => Config::read(path, known)?.agent,
            None => AgentConfig { link_loss: LinkLossPolicy::Return, ..Config::example()?.agent },
        };
        for path in &self.script {
            let script = assignment(path, &config)?;
            config.scripts.push(script);
        }
        match VehicleVerifier::new(&config) {
            Ok(verifier) => Ok(Ok(verifier.most_states(self.most_states(unless_told)))),
            Err(AgentError::Script { name, why }) => Ok(Err(format!("script `{name}` is refused: {why}"))),
            Err(error) => Err(error.into()),
        }
    }

    fn tell_refusal(&self, why: &str) {
        if self.json {
            println!("{}", json!({ "verified": false, "refused": why }));
        } else {
            println!("{why}");
        }
    }

    fn scenes(&self, verifier: &VehicleVerifier) -> anyhow::Result<Vec<Scene>> {
        let scenes: Vec<Scene> = verifier.scenes().collect();
        if self.scene.is_empty() {
            return Ok(scenes);
        }
        let named = |name: &String| {
            let names = || scenes.iter().map(|scene| scene.word()).collect::<Vec<_>>().join(", ");
            let scene = scenes.iter().copied().find(|scene| scene.word() == name);
            scene.with_context(|| format!("`--scene {name}`: expected one of {}", names()))
        };
        self.scene.iter().map(named).collect()
    }

    fn vehicle(&self, known: &Behaviours) -> anyhow::Result<bool> {
        let verifier = match self.verifier(STATES_OF_SCENE, known)? {
            Ok(verifier) => verifier,
            Err(why) => {
                self.tell_refusal(&why);
                return Ok(false);
            }
        };
        let mut reports = Vec::new();
        for scene in self.scenes(&verifier)? {
            let began = Instant::now();
            let report = verifier.verify(scene, progress_line(scene.word()));
            clear_line();
            if !self.json {
                print_scene(&report, began.elapsed().as_secs_f64());
            }
            reports.push(report);
        }
        let not_covered = verifier.not_covered(&reports);
        let is_well = reports.iter().all(|report| report.report.verdict.is_none());
        if self.json {
            println!("{}", vehicle_json(&verifier, &reports, &not_covered, is_well));
        } else {
            print_rules(&verifier);
            print_not_covered(&not_covered);
            let bounded = reports.iter().any(|scene| !scene.report.is_complete());
            println!(
                "\n{}",
                match (is_well, bounded) {
                    (true, false) => "verified: every run of every scene holds",
                    (true, true) => "no violation as far as was looked; see what was not covered",
                    (false, _) => "violated",
                }
            );
        }
        Ok(is_well)
    }

    fn draw(&self, file: &Path, known: &Behaviours) -> anyhow::Result<bool> {
        let verifier = match self.verifier(STATES_DRAWN, known)? {
            Ok(verifier) => verifier,
            Err(why) => {
                self.tell_refusal(&why);
                return Ok(false);
            }
        };
        let [scene] = self.scenes(&verifier)?[..] else {
            bail!("`--dot`: expected one `--scene`, because each has states of its own");
        };
        let graph = verifier.verifier(scene).graph();
        std::fs::write(file, graph.to_dot()).with_context(|| file.display().to_string())?;
        let (states, edges) = (graph.states.len(), graph.edges.len());
        let omitted: Vec<String> = graph.not_covered.iter().map(ToString::to_string).collect();
        if self.json {
            println!(
                "{}",
                json!({ "scene": scene.word(), "states": states, "edges": edges, "not_covered": omitted })
            );
        } else {
            println!("{}: {states} states, {edges} edges of the scene `{scene}`", file.display());
            omitted.iter().for_each(|what| println!("not covered: {what}"));
        }
        Ok(true)
    }

    fn networks(&self, name: Option<&str>) -> anyhow::Result<bool> {
        let all = programs::all()?;
        let names = all.iter().map(|network| network.name).collect::<Vec<_>>().join(", ");
        let chosen: Vec<&Network> =
            all.iter().filter(|network| name.is_none_or(|name| network.name == name)).collect();
        ensure!(!chosen.is_empty(), "`--network {}`: expected one of {names}", name.unwrap_or_default());
        let mut is_well = true;
        let mut results = Vec::new();
        for network in chosen {
            let verifier = network.verifier(network.faults).most_states(self.most_states(STATES_OF_NETWORK));
            let began = Instant::now();
            let (report, moves) = verifier.on_progress(progress_line(network.name)).run_and_count();
            clear_line();
            // What is not sound must be found out, unless the search has ended before.
            let as_expected = report.verdict.is_none() == network.is_sound;
            is_well &= as_expected;
            if self.json {
                results.push(network_json(network, &report, &moves, as_expected));
            } else {
                print_network(network, &report, &moves, began.elapsed().as_secs_f64());
            }
        }
        if self.json {
            println!("{}", json!({ "verified": is_well, "networks": results }));
        } else {
            println!("{}", if is_well { "every program is as it should be" } else { "violated" });
        }
        Ok(is_well)
    }
}

/// A script from a file, whose parameters without a default get values that fit.
fn assignment(path: &Path, config: &AgentConfig) -> anyhow::Result<Assignment> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let script = ScriptFile::parse(&path.display().to_string(), &text)?;
    let other = config.roster.iter().find(|node| node.starts_with("uav/") && **node != config.node);
    let value = |parameter: &skein_bp::script::Parameter| match (parameter.kind, other) {
        (ParameterKind::Node, Some(other)) => Argument::Text(other.clone()),
        _ => parameter.example(),
    };
    let open = script.parameters.iter().filter(|(_, parameter)| parameter.default.is_none());
    let with = open.map(|(name, parameter)| (name.clone(), value(parameter))).collect();
    Ok(Assignment { script, with, called: None })
}

/// Shows on a terminal how far a search has come.
fn progress_line(what: &str) -> impl FnMut(&Progress) + 'static {
    let what = what.to_owned();
    let is_terminal = std::io::stderr().is_terminal();
    let told: Cell<Option<Instant>> = Cell::new(None);
    move |progress| {
        if is_terminal && told.get().is_none_or(|at| at.elapsed().as_millis() > 200) {
            told.set(Some(Instant::now()));
            // Nobody is told if the terminal is gone.
            let _ = write!(std::io::stderr(), "\r\x1b[K{what}: {progress}");
        }
    }
}

fn clear_line() {
    if std::io::stderr().is_terminal() {
        let _ = write!(std::io::stderr(), "\r\x1b[K");
    }
}

fn print_scene(scene: &SceneReport, seconds: f64) {
    let SceneReport { scene, report, .. } = scene;
    println!("scene `{scene}`: {}", scene.about());
    print_report(report, seconds);
}

fn print_report(report: &Report, seconds: f64) {
    for line in report.to_string().lines() {
        println!("  {line}");
    }
    if let Some(longest) = report.longest_burst {
        println!("  at most {longest} events from one rest to the next");
    }
    println!("  {seconds:.1} s\n");
}

fn print_rules(verifier: &VehicleVerifier) {
    println!("looked for, in every state of every scene:");
    verifier.rules().for_each(|rule| println!("  {rule}"));
}

fn print_not_covered(not_covered: &NotCovered) {
    println!("\nnot covered by any of these scenes:");
    for (event, bthreads) in &not_covered.never_told {
        println!("  {event}, for which waits: {}", bthreads.join(", "));
    }
    for event in &not_covered.never_selected {
        println!("  {event}, requested and never selected");
    }
    not_covered.left_out.iter().for_each(|what| println!("  {what}"));
}

fn print_network(network: &Network, report: &Report, moves: &MoveCounts, seconds: f64) {
    let should = if network.is_sound { "" } else { " (must be found to fail)" };
    println!("`{}`{should}: {}", network.name, network.about);
    let nodes: Vec<&str> = network.members.iter().map(|member| member.config.name.as_str()).collect();
    println!("  nodes: {}; may go wrong: {}", nodes.join(", "), faults(&network.faults).join(", "));
    if let Some((requirement, _)) = &network.requirement {
        println!("  must hold: {requirement}");
    }
    println!("  looked for besides: {}", LOOKED_FOR.join(", "));
    let made: Vec<String> = moves.iter().map(|(kind, count)| format!("{count} x {kind}")).collect();
    println!("  moves: {}", made.join(", "));
    print_report(report, seconds);
}

fn faults(faults: &Faults) -> Vec<String> {
    let Faults { delay, lapses, restarts, repeats, partitions, .. } = faults;
    let counted =
        [(lapses, "lapse"), (restarts, "restart"), (repeats, "repetition"), (partitions, "partition")];
    let counted = counted.into_iter().filter(|(count, _)| **count > 0);
    let delay = if *delay { "delay and loss of bids" } else { "loss of bids" };
    std::iter::once(delay.to_owned()).chain(counted.map(|(count, what)| format!("{count} {what}"))).collect()
}

fn violation_json(violation: &Violation) -> Value {
    let texts = |events: &[skein_bp::Event]| events.iter().map(ToString::to_string).collect::<Vec<_>>();
    json!({
        "what": violation.kind.to_string(),
        "bthreads": violation.violators,
        "trace": texts(violation.stem()),
        "again_and_again": violation.cycle().map(texts),
    })
}

fn report_json(report: &Report) -> Value {
    json!({
        "violation": report.verdict.as_ref().map(violation_json),
        "states": report.states,
        "edges": report.edges,
        "depth": report.depth,
        "complete": report.is_complete(),
        "not_covered": report.not_covered.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}

fn vehicle_json(
    verifier: &VehicleVerifier,
    reports: &[SceneReport],
    not_covered: &NotCovered,
    is_well: bool,
) -> Value {
    let scene = |scene: &SceneReport| {
        let SceneReport { scene, report, coverage } = scene;
        let bthreads = coverage.bthreads.iter().map(|(name, seen)| {
            let bids: Vec<String> = seen.bids.iter().map(ToString::to_string).collect();
            json!({ "name": name, "states": seen.states, "bids": bids })
        });
        let mut result = report_json(report);
        if let Value::Object(fields) = &mut result {
            fields.insert("scene".to_owned(), scene.word().into());
            fields.insert("about".to_owned(), scene.about().into());
            fields.insert("longest_burst".to_owned(), report.longest_burst.into());
            fields.insert("bthreads".to_owned(), bthreads.collect());
        }
        result
    };
    let never_told = not_covered.never_told.iter();
    json!({
        "verified": is_well,
        "vehicle": verifier.vehicle(),
        "rules": verifier.rules().collect::<Vec<_>>(),
        "scenes": reports.iter().map(scene).collect::<Vec<_>>(),
        "never_told": never_told
            .map(|(event, bthreads)| json!({ "event": event, "bthreads": bthreads }))
            .collect::<Vec<_>>(),
        "never_selected": not_covered.never_selected.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "left_out": not_covered.left_out,
    })
}

fn network_json(network: &Network, report: &Report, moves: &MoveCounts, as_expected: bool) -> Value {
    let mut result = report_json(report);
    if let Value::Object(fields) = &mut result {
        let requirement = network.requirement.as_ref().map(|(name, _)| *name);
        fields.insert("network".to_owned(), network.name.into());
        fields.insert("about".to_owned(), network.about.into());
        fields.insert("requirement".to_owned(), requirement.into());
        fields.insert("looked_for".to_owned(), json!(LOOKED_FOR));
        fields.insert("must_hold".to_owned(), network.is_sound.into());
        fields.insert("as_expected".to_owned(), as_expected.into());
        fields.insert("may_go_wrong".to_owned(), faults(&network.faults).into());
        fields.insert("moves".to_owned(), json!(moves));
    }
    result
}
