//! Scripts made flat, so that a place in one is a number.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use super::ScriptError;
use super::op::{Op, Reply, ScriptSource, Spawn, Times};
use crate::bid::Bid;
use crate::bthread::DEFAULT_BTHREAD_PRIORITY;
use crate::event::Event;
use crate::event_set::EventSet;
use crate::value::Value;

/// A compiled script.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Code {
    pub(super) steps: Vec<Step>,
    pub(super) loop_depth: usize,
    /// The `until` blocks in the order in which they begin.
    pub(super) scopes: Vec<Scope>,
    pub(super) priority: i32,
}

/// An `until` block.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Scope {
    pub(super) set: EventSet,
    pub(super) within: Option<Duration>,
    /// The step behind it.
    pub(super) end: usize,
    /// The number of loops it stands in.
    pub(super) loop_depth: usize,
}

/// One step; numbers are places in the code.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Step {
    Sync {
        bid: Bid,
        /// The blocks it stands in, outermost first.
        scopes: Vec<usize>,
        /// Whether its requests take data from the event that ended the last sync.
        refers: bool,
    },
    /// The beginning of a block that may take so long only.
    Open(usize),
    Close(usize),
    /// The end of a loop's body.
    Again {
        depth: usize,
        times: Times,
        start: usize,
    },
    Branch {
        arms: BTreeMap<String, usize>,
        otherwise: usize,
    },
    Jump(usize),
    Fail(String),
    Enqueue(Vec<Event>),
    SpawnTemplate(String),
    SpawnInline(String, Arc<Code>),
    Daemon(bool),
    OnInterrupt(Vec<Reply>),
    Stop,
}

impl Code {
    /// Compiles a script that may spawn the `templates` named.
    pub(super) fn compile(
        body: &[Op],
        priority: Option<i32>,
        templates: &[String],
    ) -> Result<Arc<Self>, ScriptError> {
        let mut compiler =
            Compiler { steps: Vec::new(), loop_depth: 0, scopes: Vec::new(), open: Vec::new(), templates };
        compiler.body(body, 0)?;
        let priority = priority.unwrap_or(DEFAULT_BTHREAD_PRIORITY);
        let Compiler { steps, loop_depth, scopes, .. } = compiler;
        Ok(Arc::new(Self { steps, loop_depth, scopes, priority }))
    }
}

struct Compiler<'a> {
    steps: Vec<Step>,
    loop_depth: usize,
    scopes: Vec<Scope>,
    /// The blocks around what is being compiled, outermost first.
    open: Vec<usize>,
    templates: &'a [String],
}

impl Compiler<'_> {
    fn body(&mut self, ops: &[Op], depth: usize) -> Result<(), ScriptError> {
        ops.iter().try_for_each(|op| self.op(op, depth))
    }

    fn op(&mut self, op: &Op, depth: usize) -> Result<(), ScriptError> {
        let step = match op {
            Op::Repeat { times, body } => return self.repeat(*times, body, depth),
            Op::Until { set, within, body } => return self.until(set, *within, body, depth),
            Op::On(arms) => return self.branch(arms, depth),
            Op::Spawn(spawn) => self.spawn(spawn)?,
            Op::Sync(bid) => self.sync(bid),
            Op::AssertFail(message) => Step::Fail(message.clone()),
            Op::Enqueue(events) => Step::Enqueue(events.clone()),
            Op::Daemon(daemon) => Step::Daemon(*daemon),
            Op::OnInterruptEnqueue(replies) => Step::OnInterrupt(replies.clone()),
            Op::Stop => Step::Stop,
        };
        self.steps.push(step);
        Ok(())
    }

    fn repeat(&mut self, times: Times, body: &[Op], depth: usize) -> Result<(), ScriptError> {
        if times == Times::Count(0) {
            return Ok(());
        }
        if times == Times::Forever && !body.iter().any(Op::may_pause) {
            let body = serde_json::to_string(body).unwrap_or_else(|_| "(no JSON form)".to_owned());
            return Err(ScriptError::EndlessLoop { body });
        }
        self.loop_depth = self.loop_depth.max(depth + 1);
        let start = self.steps.len();
        self.body(body, depth + 1)?;
        self.steps.push(Step::Again { depth, times, start });
        Ok(())
    }

    fn until(
        &mut self,
        set: &EventSet,
        within: Option<Duration>,
        body: &[Op],
        depth: usize,
    ) -> Result<(), ScriptError> {
        let number = self.scopes.len();
        self.scopes.push(Scope { set: set.clone(), within, end: 0, loop_depth: depth });
        if within.is_some() {
            self.steps.push(Step::Open(number));
        }
        self.open.push(number);
        self.body(body, depth)?;
        self.open.pop();
        if within.is_some() {
            self.steps.push(Step::Close(number));
        }
        if let Some(scope) = self.scopes.get_mut(number) {
            scope.end = self.steps.len();
        }
        Ok(())
    }

    /// The bid also waits for what ends the blocks around it.
    fn sync(&self, bid: &Bid) -> Step {
        let sets = self.open.iter().filter_map(|scope| self.scopes.get(*scope)).map(|scope| &scope.set);
        Step::Sync {
            bid: sets.fold(bid.clone(), |bid, set| bid.wait_for(set)),
            scopes: self.open.clone(),
            refers: bid
                .requests()
                .iter()
                .chain(bid.stated())
                .flat_map(Event::data)
                .any(|(_, value)| reference(value).is_some()),
        }
    }

    /// Branch, then the arms one after another, each with a jump behind the last.
    fn branch(&mut self, arms: &BTreeMap<String, Vec<Op>>, depth: usize) -> Result<(), ScriptError> {
        let branch = self.steps.len();
        self.steps.push(Step::Jump(0));
        let mut starts = BTreeMap::new();
        let mut jumps = Vec::with_capacity(arms.len());
        for (name, body) in arms {
            starts.insert(name.clone(), self.steps.len());
            self.body(body, depth)?;
            jumps.push(self.steps.len());
            self.steps.push(Step::Jump(0));
        }
        let end = self.steps.len();
        for jump in jumps {
            self.put(jump, Step::Jump(end));
        }
        self.put(branch, Step::Branch { arms: starts, otherwise: end });
        Ok(())
    }

    fn put(&mut self, at: usize, step: Step) {
        if let Some(place) = self.steps.get_mut(at) {
            *place = step;
        }
    }

    fn spawn(&self, spawn: &Spawn) -> Result<Step, ScriptError> {
        match spawn {
            Spawn::Inline(ScriptSource { name, body, priority }) => {
                Ok(Step::SpawnInline(name.clone(), Code::compile(body, *priority, self.templates)?))
            }
            Spawn::Template(name) if self.templates.contains(name) => Ok(Step::SpawnTemplate(name.clone())),
            Spawn::Template(name) => {
                Err(ScriptError::UnknownTemplate { template: name.clone(), defined: self.templates.to_vec() })
            }
        }
    }
}

/// The datum of the last event that `value` stands for: `x` where it is the text `$x`.
pub(super) fn reference(value: &Value) -> Option<&str> {
    value.as_text()?.strip_prefix('$')
}

/// The event in which each `$key` is replaced by what the event `last` has under `key`, or left out where it has
/// nothing.
pub(super) fn refer(event: &Event, last: Option<&Event>) -> Event {
    let data = event.data().filter_map(|(key, value)| match reference(value) {
        Some(wanted) => Some((key, last?.get(wanted)?)),
        None => Some((key, value)),
    });
    data.fold(Event::new(event.name()), |event, (key, value)| event.with(key, value.clone()))
}
