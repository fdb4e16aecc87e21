//! B-threads as data: read from a file or sent from the ground, checked, then run.
//!
//! A script is a list of [`Op`]s, in JSON one object each:
//!
//! | op | does |
//! |---|---|
//! | `{"sync": {"request": [..], "wait": .., "block": .., "interrupt": .., "state": [..], "hot": true, "prio": 5}}` | states a bid |
//! | `{"repeat": 3, "do": [..]}`, `{"repeat": "forever", "do": [..]}` | repeats |
//! | `{"until": set, "within_s": 5.0, "do": [..]}` | runs the body until an event of the set, or for so long; one of both suffices |
//! | `{"on": {"name": [..], ..}}` | goes on by the name of the event that ended the last sync |
//! | `{"assert_fail": "why"}` | fails an assertion and ends |
//! | `{"enqueue": [..]}` | puts events in the external queue |
//! | `{"spawn": "template"}`, `{"spawn": {"name": "n", "body": [..]}}` | adds a b-thread |
//! | `{"daemon": false}` | says whether the program waits for external events when it has nothing to do |
//! | `{"on_interrupt_enqueue": ["$event", ..]}` | from here on, enqueues these when interrupted; `$event` is what interrupts |
//! | `{"stop": true}` | ends |
//!
//! Events and sets are written as in [`crate::notation`]. A datum `"$x"` of a requested or stated event stands for
//! the datum `x` of the event that ended the last sync; `timeout` is the event by which time ends a block.
//!
//! A [`ScriptFile`] is a script for people: with a name, a purpose and parameters, and without the ops that only a
//! whole program should have.

mod code;
mod file;
mod filler;
mod op;
mod parameter;
mod reading;
mod samples;
mod soundness;
mod trial;

use std::collections::BTreeMap;
use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;

use crate::bid::Bid;
use crate::bthread::{BThread, Context};
use crate::event::Event;
use code::{Code, Step};
pub use file::{Assignment, BoundScript, ScriptFile};
pub use filler::MAX_OPS;
pub use op::{Op, Reply, ScriptSource, Spawn, Times};
pub use parameter::{Argument, Parameter, ParameterKind};
pub use reading::{MAX_TEXT, ScriptFileError};
pub use trial::{Trial, TrialFault};

/// The most ops that a script may run between two synchronisation points.
const OPS_BETWEEN_SYNCS: usize = 100_000;

/// The reason for which a script was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ScriptError {
    #[error("`spawn` names the template `{template}`, which is not defined; defined are {defined:?}")]
    UnknownTemplate { template: String, defined: Vec<String> },
    #[error("`repeat forever` holds neither `sync` nor `stop`; it would never end: {body}")]
    EndlessLoop { body: String },
}

/// Scripts that other scripts may spawn, by name.
#[derive(Clone, Debug, Default)]
pub struct Library(Arc<BTreeMap<String, Arc<Code>>>);

impl Library {
    /// Checks and compiles templates, which may spawn one another.
    pub fn new(templates: impl IntoIterator<Item = ScriptSource>) -> Result<Self, ScriptError> {
        let templates: Vec<ScriptSource> = templates.into_iter().collect();
        let names: Vec<String> = templates.iter().map(|template| template.name.clone()).collect();
        let compiled =
            templates.iter().map(|t| Ok((t.name.clone(), Code::compile(&t.body, t.priority, &names)?)));
        Ok(Self(Arc::new(compiled.collect::<Result<_, _>>()?)))
    }

    fn names(&self) -> Vec<String> {
        self.0.keys().cloned().collect()
    }
}

/// A b-thread that runs [`Op`]s.
///
/// Its state is its place in the code and its loop counters; that is what is compared, hashed and serialised, together
/// with the code itself.
#[derive(Clone, Debug, Serialize)]
pub struct Script {
    #[serde(skip)]
    code: Arc<Code>,
    #[serde(skip)]
    library: Library,
    /// The step to run next; at a synchronisation point, the sync.
    at: usize,
    /// Finished rounds of each open loop, outermost first; 0 for loops that are not open.
    rounds: Vec<u32>,
    /// The step that said what to do when interrupted.
    on_interrupt: Option<usize>,
    /// When time ends each block that may take so long only; none for blocks that are not open.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    deadlines: Vec<Option<Duration>>,
    /// The event that ended the last sync, where the present one refers to it.
    #[serde(skip_serializing_if = "Option::is_none")]
    last: Option<Event>,
}

impl Script {
    /// A script that spawns nothing but what it spells out.
    pub fn new(body: &[Op]) -> Result<Self, ScriptError> {
        Self::with_library(body, None, &Library::default())
    }

    /// A script that may spawn the templates of a library; `priority` is for
    /// [`Strategy::BThreadPriority`](crate::Strategy::BThreadPriority).
    pub fn with_library(body: &[Op], priority: Option<i32>, library: &Library) -> Result<Self, ScriptError> {
        Ok(Self::at_start(Code::compile(body, priority, &library.names())?, library.clone()))
    }

    fn at_start(code: Arc<Code>, library: Library) -> Self {
        let rounds = vec![0; code.loop_depth];
        let deadlines = vec![None; code.scopes.len()];
        Self { code, library, at: 0, rounds, on_interrupt: None, deadlines, last: None }
    }

    /// The bid of every synchronisation point, in the order in which they are written. What a bid takes from an event
    /// shows as `$key`.
    pub fn bids(&self) -> impl Iterator<Item = &Bid> {
        self.code.steps.iter().filter_map(|step| match step {
            Step::Sync { bid, .. } => Some(bid),
            _ => None,
        })
    }

    /// Runs to the next sync or the end. `last` is the event that ended the last sync.
    fn run(&mut self, last: Option<&Event>, cx: &mut Context) {
        for _ in 0..OPS_BETWEEN_SYNCS {
            let Some(step) = self.code.steps.get(self.at) else { return self.end() };
            let here = self.at;
            self.at += 1;
            match step {
                Step::Sync { refers, .. } => {
                    self.at = here;
                    self.last = last.filter(|_| *refers).cloned();
                    return;
                }
                Step::Open(scope) => {
                    let within = self.code.scopes.get(*scope).and_then(|scope| scope.within);
                    self.set_deadline(*scope, within.map(|within| cx.now() + within));
                }
                Step::Close(scope) => self.set_deadline(*scope, None),
                Step::Again { depth, times, start } => self.go_round(*depth, *times, *start),
                Step::Branch { arms, otherwise } => {
                    let arm = last.and_then(|event| arms.get(event.name()));
                    self.at = *arm.unwrap_or(otherwise);
                }
                Step::Jump(target) => self.at = *target,
                Step::Fail(message) => {
                    cx.fail(message.clone());
                    return self.end();
                }
                Step::Enqueue(events) => events.iter().for_each(|event| cx.enqueue(event)),
                Step::SpawnTemplate(name) => {
                    if let Some(code) = self.library.0.get(name) {
                        cx.spawn(name.as_str(), Self::at_start(code.clone(), self.library.clone()));
                    }
                }
                Step::SpawnInline(name, code) => {
                    cx.spawn(name.as_str(), Self::at_start(code.clone(), self.library.clone()));
                }
                Step::Daemon(daemon) => cx.set_daemon(*daemon),
                Step::OnInterrupt(_) => self.on_interrupt = Some(here),
                Step::Stop => return self.end(),
            }
        }
        cx.fail(format!("ran {OPS_BETWEEN_SYNCS} ops without a sync"));
        self.end();
    }

    fn go_round(&mut self, depth: usize, times: Times, start: usize) {
        let Some(rounds) = self.rounds.get_mut(depth) else { return };
        match times {
            Times::Forever => self.at = start,
            Times::Count(times) if *rounds + 1 < times => {
                *rounds += 1;
                self.at = start;
            }
            Times::Count(_) => *rounds = 0,
        }
    }

    fn set_deadline(&mut self, scope: usize, at: Option<Duration>) {
        if let Some(deadline) = self.deadlines.get_mut(scope) {
            *deadline = at;
        }
    }

    /// The outermost block around the present sync that `event` ends.
    fn ended_by(&self, event: &Event, now: Duration) -> Option<usize> {
        let Some(Step::Sync { scopes, .. }) = self.code.steps.get(self.at) else { return None };
        if scopes.is_empty() {
            return None;
        }
        let deadline = |scope: &usize| self.deadlines.get(*scope).copied().flatten();
        if *event == Event::timeout() {
            let due = scopes.iter().find(|scope| deadline(scope).is_some_and(|at| at <= now));
            // Whoever lets a timer fire before its time means the one that fires first.
            let first =
                || scopes.iter().filter(|scope| deadline(scope).is_some()).min_by_key(|s| deadline(s));
            return due.or_else(first).copied();
        }
        let ends =
            |scope: &&usize| self.code.scopes.get(**scope).is_some_and(|scope| scope.set.contains(event));
        scopes.iter().find(ends).copied()
    }

    /// Goes on behind a block, whose loops and timers are over.
    fn leave(&mut self, scope: usize) {
        let code = self.code.clone();
        let Some(left) = code.scopes.get(scope) else { return };
        self.at = left.end;
        self.rounds.iter_mut().skip(left.loop_depth).for_each(|rounds| *rounds = 0);
        // Blocks that began later and are still open stand inside.
        self.deadlines.iter_mut().skip(scope).for_each(|deadline| *deadline = None);
    }

    /// Goes to the one state that all ended scripts share.
    fn end(&mut self) {
        self.at = self.code.steps.len();
        self.rounds.fill(0);
        self.deadlines.fill(None);
        self.on_interrupt = None;
        self.last = None;
    }
}

impl BThread for Script {
    fn bid(&self) -> Option<Bid> {
        let Step::Sync { bid, refers, .. } = self.code.steps.get(self.at)? else { return None };
        let mut bid = bid.clone();
        if *refers {
            bid = bid.map_events(|event| code::refer(event, self.last.as_ref()));
        }
        Some(self.deadlines.iter().flatten().fold(bid, |bid, at| bid.deadline(*at)))
    }

    fn start(&mut self, cx: &mut Context) {
        self.run(None, cx);
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        match self.ended_by(event, cx.now()) {
            Some(scope) => self.leave(scope),
            None => self.at += 1,
        }
        self.run(Some(event), cx);
    }

    fn interrupted(&mut self, event: &Event, cx: &mut Context) {
        let handler = self.on_interrupt.and_then(|at| self.code.steps.get(at));
        if let Some(Step::OnInterrupt(replies)) = handler {
            for reply in replies {
                cx.enqueue(match reply {
                    Reply::Interrupting => event,
                    Reply::Event(reply) => reply,
                });
            }
        }
        self.end();
    }

    fn priority(&self) -> i32 {
        self.code.priority
    }
}

impl PartialEq for Script {
    fn eq(&self, other: &Self) -> bool {
        self.at == other.at
            && self.rounds == other.rounds
            && self.on_interrupt == other.on_interrupt
            && self.deadlines == other.deadlines
            && self.last == other.last
            && (Arc::ptr_eq(&self.code, &other.code) || self.code == other.code)
            && (Arc::ptr_eq(&self.library.0, &other.library.0) || self.library.0 == other.library.0)
    }
}

impl Eq for Script {}

impl Hash for Script {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.at.hash(state);
        self.rounds.hash(state);
        self.on_interrupt.hash(state);
        self.deadlines.hash(state);
        self.last.hash(state);
    }
}
