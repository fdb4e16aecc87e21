//! B-threads: the parts of a behavioural program.

use std::any::Any;
use std::fmt::Debug;
use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;

use crate::bid::Bid;
use crate::event::Event;

/// Priority of a b-thread that gives none under [`Strategy::BThreadPriority`](crate::Strategy::BThreadPriority), as in
/// BPjs.
pub const DEFAULT_BTHREAD_PRIORITY: i32 = -1;

/// A b-thread: a state machine that states a bid in each state and moves when an event it asked for happens.
///
/// Usually an enum with one variant per synchronisation point. It is cloned, compared, hashed and serialised, because
/// the verifier takes snapshots; so its state must be all there is to it.
///
/// ```
/// use serde::Serialize;
/// use skein_bp::{BThread, Bid, Context, Event};
///
/// /// Alternates hot and cold water.
/// #[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
/// enum Mixer { Cold, Hot }
///
/// impl BThread for Mixer {
///     fn bid(&self) -> Option<Bid> {
///         Some(match self {
///             Mixer::Cold => Bid::new().wait_for("cold").block("hot"),
///             Mixer::Hot => Bid::new().wait_for("hot").block("cold"),
///         })
///     }
///     fn resume(&mut self, _: &Event, _: &mut Context) {
///         *self = match self { Mixer::Cold => Mixer::Hot, Mixer::Hot => Mixer::Cold };
///     }
/// }
/// ```
pub trait BThread: Clone + Eq + Hash + Debug + Serialize + Send + 'static {
    /// The bid at this synchronisation point; `None` when the b-thread has ended. A function of the state alone.
    fn bid(&self) -> Option<Bid>;

    /// Runs to the next synchronisation point. `event` is one that was requested or waited for, or the timeout.
    fn resume(&mut self, event: &Event, cx: &mut Context);

    /// Runs to the first synchronisation point.
    fn start(&mut self, cx: &mut Context) {
        let _ = cx;
    }

    /// Runs when `event` interrupts the b-thread, which ends after it.
    fn interrupted(&mut self, event: &Event, cx: &mut Context) {
        let _ = (event, cx);
    }

    /// Priority under [`Strategy::BThreadPriority`](crate::Strategy::BThreadPriority): greater wins.
    fn priority(&self) -> i32 {
        DEFAULT_BTHREAD_PRIORITY
    }
}

/// The means of a b-thread while it runs to its next synchronisation point.
#[derive(Debug)]
pub struct Context {
    now: Duration,
    /// The effects that the b-thread asked for; most ask for none.
    pub(crate) effects: Option<Box<Effects>>,
}

#[derive(Debug, Default)]
pub(crate) struct Effects {
    pub(crate) enqueued: Vec<Event>,
    pub(crate) spawned: Vec<(Arc<str>, Box<dyn AnyBThread>)>,
    pub(crate) failure: Option<String>,
    pub(crate) daemon: Option<bool>,
}

impl Context {
    /// A context at a time since the run began. Programs make their own; this one serves a b-thread's unit tests.
    pub fn at(now: Duration) -> Self {
        Self { now, effects: None }
    }

    /// Time since the run began.
    pub fn now(&self) -> Duration {
        self.now
    }

    /// Puts `event` at the end of the external queue.
    pub fn enqueue(&mut self, event: impl Into<Event>) {
        self.effects().enqueued.push(event.into());
    }

    /// Adds a b-thread, which reaches its first synchronisation point before the next selection. When the name is taken
    /// by a b-thread that still runs, the new one is called `name~2`, `name~3` and so on.
    pub fn spawn(&mut self, name: impl Into<Arc<str>>, bthread: impl BThread) {
        self.effects().spawned.push((name.into(), Box::new(bthread)));
    }

    /// Reports a failed assertion, which stops the program. The first one counts.
    pub fn fail(&mut self, message: impl Into<String>) {
        self.effects().failure.get_or_insert_with(|| message.into());
    }

    /// Says whether the program stays when it has nothing to do, to wait for external events.
    pub fn set_daemon(&mut self, daemon: bool) {
        self.effects().daemon = Some(daemon);
    }

    pub(crate) fn has_spawned(&self) -> bool {
        self.effects.as_ref().is_some_and(|effects| !effects.spawned.is_empty())
    }

    fn effects(&mut self) -> &mut Effects {
        self.effects.get_or_insert_default()
    }
}

/// A b-thread whose type is forgotten, so that a program can hold many kinds.
pub(crate) trait AnyBThread: Debug + Send {
    fn bid(&self) -> Option<Bid>;
    fn resume(&mut self, event: &Event, cx: &mut Context);
    fn start(&mut self, cx: &mut Context);
    fn interrupted(&mut self, event: &Event, cx: &mut Context);
    fn priority(&self) -> i32;
    fn boxed_clone(&self) -> Box<dyn AnyBThread>;
    fn equals(&self, other: &dyn AnyBThread) -> bool;
    fn hash_into(&self, state: &mut dyn Hasher);
    fn to_json(&self) -> Result<serde_json::Value, serde_json::Error>;
    fn as_any(&self) -> &dyn Any;
}

impl<T: BThread> AnyBThread for T {
    fn bid(&self) -> Option<Bid> {
        BThread::bid(self)
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        BThread::resume(self, event, cx);
    }

    fn start(&mut self, cx: &mut Context) {
        BThread::start(self, cx);
    }

    fn interrupted(&mut self, event: &Event, cx: &mut Context) {
        BThread::interrupted(self, event, cx);
    }

    fn priority(&self) -> i32 {
        BThread::priority(self)
    }

    fn boxed_clone(&self) -> Box<dyn AnyBThread> {
        Box::new(self.clone())
    }

    fn equals(&self, other: &dyn AnyBThread) -> bool {
        other.as_any().downcast_ref::<T>() == Some(self)
    }

    fn hash_into(&self, mut state: &mut dyn Hasher) {
        self.hash(&mut state);
    }

    fn to_json(&self) -> Result<serde_json::Value, serde_json::Error> {
        serde_json::to_value(self)
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

impl Clone for Box<dyn AnyBThread> {
    fn clone(&self) -> Self {
        (**self).boxed_clone()
    }
}
