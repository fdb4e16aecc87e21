//! Conformance cases: small programs as data, and what every engine must do with them.
//!
//! A *run* expectation lists all legal traces: every run must be one of them, and over many seeds each must be seen. A
//! *selectable_at_start* expectation gives the events that may be selected first. A *verify* expectation gives what the
//! [verifier](skein_bp::verify) must find. Programs are [scripts](skein_bp::script); events and sets are written as in
//! [`skein_bp::notation`].

mod verification;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::time::Duration;

use serde::Deserialize;
use skein_bp::script::{Library, Op, Script, ScriptError, ScriptSource};
use skein_bp::{Event, Program, ProgramConfig, Strategy};
use verification::Verification;

/// The one format that is understood.
pub const FORMAT: &str = "bp-conformance/1";

/// Seeds that every *run* expectation is tried with.
const MIN_SEEDS: u64 = 300;
/// Seeds after which a trace that was never seen counts as unreachable.
const MAX_SEEDS: u64 = 200_000;
/// Selections after which a run counts as endless.
const MAX_SELECTIONS: usize = 10_000;

/// Why a file of cases was refused.
#[derive(Debug, thiserror::Error)]
pub enum SuiteError {
    #[error("not a file of conformance cases: {0}")]
    Syntax(#[from] serde_json::Error),
    #[error("`format` is `{found}`, expected `{FORMAT}`")]
    Format { found: String },
}

/// A file of cases.
#[derive(Debug)]
pub struct Suite {
    cases: Vec<Case>,
    unsound: Vec<Finding>,
}

/// The finding about one case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The case's name, or its position if it has none.
    pub case: String,
    /// The difference from what was expected, or the reason why the case cannot be understood.
    pub problem: String,
}

/// The outcome of a suite; counts are of expectations.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Expectations that hold.
    pub passed: usize,
    /// One finding for each expectation that does not.
    pub failures: Vec<Finding>,
}

impl Suite {
    /// Reads a suite. A case that cannot be understood is set aside in [`Suite::unsound`].
    ///
    /// # Errors
    /// [`SuiteError`] when the whole cannot be understood.
    pub fn parse(text: &str) -> Result<Self, SuiteError> {
        #[derive(Deserialize)]
        struct Outline {
            format: String,
            cases: Vec<serde_json::Value>,
        }

        let Outline { format, cases } = serde_json::from_str(text)?;
        if format != FORMAT {
            return Err(SuiteError::Format { found: format });
        }
        let mut suite = Self { cases: Vec::new(), unsound: Vec::new() };
        for (at, case) in cases.into_iter().enumerate() {
            let name =
                case.get("name").and_then(|name| name.as_str()).map_or(format!("#{at}"), str::to_owned);
            match Case::parse(case) {
                Ok(case) => suite.cases.push(case),
                Err(problem) => suite.unsound.push(Finding { case: name, problem }),
            }
        }
        Ok(suite)
    }

    /// Cases that cannot be understood, and why.
    pub fn unsound(&self) -> &[Finding] {
        &self.unsound
    }

    /// Checks every expectation of every case that is understood.
    pub fn check(&self) -> Report {
        let mut report = Report::default();
        for case in &self.cases {
            for expectation in &case.expect {
                match expectation.check(case) {
                    Ok(()) => report.passed += 1,
                    Err(problem) => report.failures.push(Finding { case: case.name.clone(), problem }),
                }
            }
        }
        report
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.case, self.problem)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} passed, {} failed", self.passed, self.failures.len())
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Case {
    name: String,
    /// The source of the case, for readers.
    #[serde(default, rename = "source")]
    _source: Option<String>,
    /// A remark, for readers.
    #[serde(default, rename = "note")]
    _note: Option<String>,
    #[serde(default)]
    strategy: StrategyChoice,
    bthreads: Vec<CaseBThread>,
    #[serde(default)]
    templates: Templates,
    #[serde(default)]
    external: Vec<Event>,
    #[serde(default)]
    daemon: bool,
    #[serde(default)]
    feed: Vec<Event>,
    expect: Vec<Expectation>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct StrategyChoice {
    #[serde(default)]
    kind: Strategy,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CaseBThread {
    name: String,
    body: Vec<Op>,
    priority: Option<i32>,
    /// Whether the b-thread is there only to be spawned.
    #[serde(default)]
    template: bool,
}

/// The names for `spawn` besides the case's b-threads: a list of scripts, or an object of bodies.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Templates {
    Listed(Vec<ScriptSource>),
    Filed(BTreeMap<String, Template>),
}

#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Template {
    Body(Vec<Op>),
    Prioritised { body: Vec<Op>, priority: Option<i32> },
}

impl Default for Templates {
    fn default() -> Self {
        Self::Listed(Vec::new())
    }
}

impl Templates {
    fn sources(&self) -> Vec<ScriptSource> {
        match self {
            Self::Listed(sources) => sources.clone(),
            Self::Filed(filed) => filed.iter().map(|(name, template)| template.source(name)).collect(),
        }
    }
}

impl Template {
    fn source(&self, name: &str) -> ScriptSource {
        let (body, priority) = match self {
            Self::Body(body) => (body, None),
            Self::Prioritised { body, priority } => (body, *priority),
        };
        ScriptSource { name: name.to_owned(), body: body.clone(), priority }
    }
}

impl CaseBThread {
    fn source(&self) -> ScriptSource {
        ScriptSource { name: self.name.clone(), body: self.body.clone(), priority: self.priority }
    }
}

#[derive(Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum Expectation {
    Run(RunExpectation),
    SelectableAtStart(StartExpectation),
    Verify(Verification),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RunExpectation {
    traces: BTreeSet<Vec<String>>,
    end: End,
    alive: Option<Vec<String>>,
    violator: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct StartExpectation {
    set: BTreeSet<Event>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum End {
    NoBthreads,
    NoSelectable,
    Assertion,
}

/// One finished run.
struct Run {
    trace: Vec<String>,
    end: End,
    alive: Vec<String>,
    violator: Option<String>,
}

impl Case {
    fn parse(case: serde_json::Value) -> Result<Self, String> {
        let case: Self = serde_json::from_value(case).map_err(|error| error.to_string())?;
        case.program(0).map_err(|error| error.to_string())?;
        Ok(case)
    }

    fn program(&self, seed: u64) -> Result<Program, ScriptError> {
        // Fairness in ties would put some legal traces out of reach.
        let config = ProgramConfig {
            strategy: self.strategy.kind,
            seed,
            passed_over_limit: None,
            ..Default::default()
        };
        let mut program = Program::new(config);
        program.set_daemon(self.daemon);
        self.external.iter().for_each(|event| program.enqueue(event));
        let templates = self.templates.sources();
        let own = self.bthreads.iter().map(CaseBThread::source);
        // The later of two sources with one name counts.
        let library = Library::new(own.chain(templates))?;
        for CaseBThread { name, body, priority, .. } in
            self.bthreads.iter().filter(|bthread| !bthread.template)
        {
            program.add(name.as_str(), Script::with_library(body, *priority, &library)?);
        }
        Ok(program)
    }

    fn run(&self, seed: u64) -> Result<Run, String> {
        let mut program = self.program(seed).map_err(|error| error.to_string())?;
        let mut feed = self.feed.iter();
        let mut trace = Vec::new();
        while trace.len() < MAX_SELECTIONS {
            match program.step(Duration::ZERO) {
                Ok(Some(selection)) => trace.push(selection.event.name().to_owned()),
                // The superstep is done: a daemon gets the next event it is fed, and ends when there is none.
                Ok(None) if program.is_daemon() && program.has_bthreads() => match feed.next() {
                    Some(event) => program.enqueue(event),
                    None => return Ok(Run::of(&program, trace)),
                },
                Ok(None) | Err(_) => return Ok(Run::of(&program, trace)),
            }
        }
        Err(format!("seed {seed}: the run has not ended after {MAX_SELECTIONS} selections"))
    }
}

impl Run {
    fn of(program: &Program, trace: Vec<String>) -> Self {
        let end = match program.failed() {
            Some(_) => End::Assertion,
            None if program.has_bthreads() => End::NoSelectable,
            None => End::NoBthreads,
        };
        let mut alive: Vec<String> =
            program.bids().map(|(name, ..)| template_name(name).to_owned()).collect();
        alive.sort();
        let violator = program.failed().map(|(name, _)| template_name(name).to_owned());
        Self { trace, end, alive, violator }
    }
}

/// The name a b-thread was spawned under, without the number that tells it from its siblings.
fn template_name(name: &str) -> &str {
    match name.rsplit_once('~') {
        Some((template, number)) if number.parse::<u64>().is_ok() => template,
        _ => name,
    }
}

impl Expectation {
    fn check(&self, case: &Case) -> Result<(), String> {
        match self {
            Self::Verify(verification) => verification.check(case),
            Self::SelectableAtStart(StartExpectation { set }) => check_start(case, set),
            Self::Run(RunExpectation { traces, end, alive, violator }) => check_runs(case, traces, |run| {
                expect("end", &run.end, end)?;
                if let Some(mut alive) = alive.clone() {
                    alive.sort();
                    expect("alive", &run.alive, &alive)?;
                }
                match violator {
                    Some(_) => expect("violator", &run.violator, violator),
                    None => Ok(()),
                }
            }),
        }
    }
}

fn expect<T: PartialEq + fmt::Debug>(what: &str, got: &T, expected: &T) -> Result<(), String> {
    if got == expected { Ok(()) } else { Err(format!("{what} is {got:?}, expected {expected:?}")) }
}

fn check_start(case: &Case, expected: &BTreeSet<Event>) -> Result<(), String> {
    let mut program = case.program(0).map_err(|error| error.to_string())?;
    program.synchronise(Duration::ZERO).map_err(|error| error.to_string())?;
    expect("the selectable set at the start", &program.selectable().into_iter().collect(), expected)
}

fn check_runs(
    case: &Case,
    legal: &BTreeSet<Vec<String>>,
    check_end: impl Fn(&Run) -> Result<(), String>,
) -> Result<(), String> {
    let mut unseen: BTreeSet<&Vec<String>> = legal.iter().collect();
    for seed in 0..MAX_SEEDS {
        if seed >= MIN_SEEDS && unseen.is_empty() {
            return Ok(());
        }
        let run = case.run(seed)?;
        if !legal.contains(&run.trace) {
            return Err(illegal_trace(seed, &run.trace, legal));
        }
        check_end(&run).map_err(|difference| format!("seed {seed}, trace {:?}: {difference}", run.trace))?;
        unseen.remove(&run.trace);
    }
    match unseen.first() {
        None => Ok(()),
        Some(trace) => {
            Err(format!("{} legal traces not seen in {MAX_SEEDS} seeds, such as {trace:?}", unseen.len()))
        }
    }
}

fn illegal_trace(seed: u64, trace: &[String], legal: &BTreeSet<Vec<String>>) -> String {
    let common = |other: &Vec<String>| trace.iter().zip(other).take_while(|(a, b)| a == b).count();
    let message = format!("seed {seed}: the trace {trace:?} is not legal");
    match legal.iter().max_by_key(|other| common(other)) {
        None => message,
        Some(nearest) => {
            format!("{message}; it leaves the nearest, {nearest:?}, at selection {}", common(nearest) + 1)
        }
    }
}
