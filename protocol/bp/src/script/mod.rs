//! B-threads as data: read from a file or sent from the ground, checked, then run.
//!
//! A script is a list of [`Op`]s, in JSON one object each:
//!
//! | op | does |
//! |---|---|
//! | `{"sync": {"request": [..], "wait": .., "block": .., "interrupt": .., "hot": true, "prio": 5}}` | states a bid |
//! | `{"repeat": 3, "do": [..]}`, `{"repeat": "forever", "do": [..]}` | repeats |
//! | `{"on": {"name": [..], ..}}` | goes on by the name of the event that ended the last sync |
//! | `{"assert_fail": "why"}` | fails an assertion and ends |
//! | `{"enqueue": [..]}` | puts events in the external queue |
//! | `{"spawn": "template"}`, `{"spawn": {"name": "n", "body": [..]}}` | adds a b-thread |
//! | `{"daemon": false}` | says whether the program waits for external events when it has nothing to do |
//! | `{"on_interrupt_enqueue": ["$event", ..]}` | from here on, enqueues these when interrupted; `$event` is what interrupts |
//! | `{"stop": true}` | ends |
//!
//! Events and sets are written as in [`crate::notation`].

mod code;
mod op;

use std::collections::BTreeMap;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

use serde::Serialize;

use crate::bid::Bid;
use crate::bthread::{BThread, Context};
use crate::event::Event;
use code::{Code, Step};
pub use op::{Op, Reply, ScriptSource, Spawn, Times};

/// How many ops a script may run between two synchronisation points.
const OPS_BETWEEN_SYNCS: usize = 100_000;

/// Why a script was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ScriptError {
    /// `spawn` names a template that is not in the library.
    #[error("`spawn` names the template `{template}`, which is not defined; defined are {defined:?}")]
    UnknownTemplate {
        /// The name given.
        template: String,
        /// The names there are.
        defined: Vec<String>,
    },
    /// A loop without end never synchronises, so it could never be left.
    #[error("`repeat forever` holds neither `sync` nor `stop`; it would never end: {body}")]
    EndlessLoop {
        /// The loop's body as JSON.
        body: String,
    },
}

/// Scripts that other scripts may spawn, by name.
#[derive(Clone, Debug, Default)]
pub struct Library(Arc<BTreeMap<String, Arc<Code>>>);

impl Library {
    /// Checks and compiles templates, which may spawn one another.
    ///
    /// # Errors
    /// [`ScriptError`] of the first template that is unsound.
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
}

impl Script {
    /// A script that spawns nothing but what it spells out.
    ///
    /// # Errors
    /// [`ScriptError`] when the script is unsound.
    pub fn new(body: &[Op]) -> Result<Self, ScriptError> {
        Self::with_library(body, None, &Library::default())
    }

    /// A script that may spawn the templates of a library; `priority` is for
    /// [`Strategy::BThreadPriority`](crate::Strategy::BThreadPriority).
    ///
    /// # Errors
    /// [`ScriptError`] when the script is unsound.
    pub fn with_library(body: &[Op], priority: Option<i32>, library: &Library) -> Result<Self, ScriptError> {
        Ok(Self::at_start(Code::compile(body, priority, &library.names())?, library.clone()))
    }

    fn at_start(code: Arc<Code>, library: Library) -> Self {
        let rounds = vec![0; code.loop_depth];
        Self { code, library, at: 0, rounds, on_interrupt: None }
    }

    /// Runs to the next sync or the end. `last` is the event that ended the last sync.
    fn run(&mut self, last: Option<&Event>, cx: &mut Context) {
        for _ in 0..OPS_BETWEEN_SYNCS {
            let Some(step) = self.code.steps.get(self.at) else { return self.end() };
            let here = self.at;
            self.at += 1;
            match step {
                Step::Sync(_) => {
                    self.at = here;
                    return;
                }
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

    /// Goes to the one state that all ended scripts share.
    fn end(&mut self) {
        self.at = self.code.steps.len();
        self.rounds.fill(0);
        self.on_interrupt = None;
    }
}

impl BThread for Script {
    fn bid(&self) -> Option<Bid> {
        match self.code.steps.get(self.at)? {
            Step::Sync(bid) => Some(bid.clone()),
            _ => None,
        }
    }

    fn start(&mut self, cx: &mut Context) {
        self.run(None, cx);
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        self.at += 1;
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
    }
}
