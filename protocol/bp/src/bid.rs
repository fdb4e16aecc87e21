//! Bids: what a b-thread says at a synchronisation point.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Deserializer, Serialize};

use crate::event::Event;
use crate::event_set::EventSet;
use crate::notation::Many;

/// A b-thread's statement at a synchronisation point.
///
/// Every method may be used more than once; sets and requests add up.
///
/// ```
/// use skein_bp::{Bid, Event};
/// let bid = Bid::new().request("uav/3/takeoff").wait_for("uav/3/abort").block("uav/3/land").priority(5);
/// assert_eq!(bid.requests(), [Event::new("uav/3/takeoff")]);
/// assert!(bid.blocks().contains(&Event::new("uav/3/land").with("why", "battery")));
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Bid(Arc<Statement>); // Shared, since b-threads that loop state the same bid again and again.

#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Statement {
    #[serde(rename = "request", deserialize_with = "many_events", skip_serializing_if = "Vec::is_empty")]
    requests: Vec<Event>,
    #[serde(rename = "wait", skip_serializing_if = "EventSet::is_none")]
    waits: EventSet,
    #[serde(rename = "block", skip_serializing_if = "EventSet::is_none")]
    blocks: EventSet,
    #[serde(rename = "interrupt", skip_serializing_if = "EventSet::is_none")]
    interrupts: EventSet,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    hot: bool,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    hold_when_lost: bool,
    #[serde(rename = "prio", skip_serializing_if = "Option::is_none")]
    priority: Option<i32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    deadline: Option<Duration>,
    #[serde(rename = "state", deserialize_with = "many_events", skip_serializing_if = "Vec::is_empty")]
    states: Vec<Event>,
}

impl Bid {
    /// A bid for nothing: a b-thread that states it waits for ever.
    pub fn new() -> Self {
        Self::default()
    }

    /// Asks that `event` happen. One of several requested events resumes the b-thread; their order matters only under
    /// [`Strategy::Ordered`](crate::Strategy::Ordered).
    #[must_use]
    pub fn request(mut self, event: impl Into<Event>) -> Self {
        let requests = &mut self.statement().requests;
        if requests.is_empty() {
            // Most bids request one event and need room for no more.
            requests.reserve_exact(1);
        }
        requests.push(event.into());
        self
    }

    /// Resumes the b-thread when an event of `set` happens at someone else's request.
    #[must_use]
    pub fn wait_for(mut self, set: impl Into<EventSet>) -> Self {
        add(&mut self.statement().waits, set);
        self
    }

    /// Forbids the events of `set`, the b-thread's own requests included.
    #[must_use]
    pub fn block(mut self, set: impl Into<EventSet>) -> Self {
        add(&mut self.statement().blocks, set);
        self
    }

    /// Ends the b-thread when an event of `set` happens.
    #[must_use]
    pub fn interrupt(mut self, set: impl Into<EventSet>) -> Self {
        add(&mut self.statement().interrupts, set);
        self
    }

    /// Says that the b-thread must not stay here for ever: a liveness requirement for the verifier.
    #[must_use]
    pub fn hot(mut self) -> Self {
        self.statement().hot = true;
        self
    }

    /// Says that the blocks are to outlive this program: where it is represented by a proxy, that goes on blocking when
    /// the program is lost. Means nothing in one program.
    #[must_use]
    pub fn hold_when_lost(mut self) -> Self {
        self.statement().hold_when_lost = true;
        self
    }

    /// Priority of the requests under [`Strategy::SyncPriority`](crate::Strategy::SyncPriority): greater wins, none is
    /// lowest.
    #[must_use]
    pub fn priority(mut self, priority: i32) -> Self {
        self.statement().priority = Some(priority);
        self
    }

    /// Resumes the b-thread with [`Event::timeout`] once the time since the run began reaches `at`; the earliest of
    /// several counts.
    #[must_use]
    pub fn deadline(mut self, at: Duration) -> Self {
        let deadline = &mut self.statement().deadline;
        *deadline = Some(deadline.map_or(at, |earlier| earlier.min(at)));
        self
    }

    /// States something that holds while the b-thread stays here, in the form of an event that never happens. The
    /// program does nothing with it but tell it to who asks: see [`Program::stated`](crate::Program::stated).
    #[must_use]
    pub fn state(mut self, event: impl Into<Event>) -> Self {
        self.statement().states.push(event.into());
        self
    }

    /// The requested events, in the order they were asked for.
    pub fn requests(&self) -> &[Event] {
        &self.0.requests
    }

    pub fn waits(&self) -> &EventSet {
        &self.0.waits
    }

    pub fn blocks(&self) -> &EventSet {
        &self.0.blocks
    }

    /// The events that end the b-thread.
    pub fn interrupts(&self) -> &EventSet {
        &self.0.interrupts
    }

    /// Whether the b-thread must not stay here for ever.
    pub fn is_hot(&self) -> bool {
        self.0.hot
    }

    /// Whether the blocks are to outlive the program.
    pub fn holds_when_lost(&self) -> bool {
        self.0.hold_when_lost
    }

    pub fn given_priority(&self) -> Option<i32> {
        self.0.priority
    }

    /// When the b-thread resumes by itself, as time since the run began.
    pub fn given_deadline(&self) -> Option<Duration> {
        self.0.deadline
    }

    /// The statements that hold while the b-thread stays here.
    pub fn stated(&self) -> &[Event] {
        &self.0.states
    }

    /// The same bid with other events in the place of each that it requests or states.
    pub(crate) fn map_events(mut self, mut map: impl FnMut(&Event) -> Event) -> Self {
        let requests = self.0.requests.iter().map(&mut map).collect();
        let states = self.0.states.iter().map(map).collect();
        let statement = self.statement();
        (statement.requests, statement.states) = (requests, states);
        self
    }

    /// The part that counts when a channel states the bid for a b-thread elsewhere, which sees to its own waits.
    pub(crate) fn for_proxy(&self) -> Self {
        let Statement { requests, blocks, priority, .. } = &*self.0;
        let (requests, blocks) = (requests.clone(), blocks.clone());
        Self(Arc::new(Statement { requests, blocks, priority: *priority, ..Statement::default() }))
    }

    /// The same bid without its requests: their events are waited for.
    pub(crate) fn only_waiting(&self) -> Self {
        let requests = self.requests().iter();
        let mut bid = requests.fold(self.clone(), |bid, event| bid.wait_for(EventSet::from(event)));
        bid.statement().requests.clear();
        bid
    }

    /// Whether one is a clone of the other.
    pub(crate) fn is_the_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// Whether the two bids ask for and block the same events, so that the same questions concern them.
    pub(crate) fn concerns_as(&self, other: &Self) -> bool {
        let (a, b) = (&*self.0, &*other.0);
        self.is_the_same(other)
            || (a.requests == b.requests
                && a.waits == b.waits
                && a.blocks == b.blocks
                && a.interrupts == b.interrupts)
    }

    /// The statement, to be changed: a copy if clones share it.
    fn statement(&mut self) -> &mut Statement {
        Arc::make_mut(&mut self.0)
    }
}

fn add(set: &mut EventSet, more: impl Into<EventSet>) {
    *set = std::mem::take(set).or(more);
}

fn many_events<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Event>, D::Error> {
    Many::deserialize(deserializer).map(|events| events.0)
}

impl fmt::Display for Bid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        if !self.0.requests.is_empty() {
            let requests: Vec<String> = self.0.requests.iter().map(Event::to_string).collect();
            parts.push(format!("request {}", requests.join(", ")));
        }
        for (verb, set) in
            [("wait for", &self.0.waits), ("block", &self.0.blocks), ("interrupt on", &self.0.interrupts)]
        {
            if !set.is_none() {
                parts.push(format!("{verb} {set}"));
            }
        }
        if !self.0.states.is_empty() {
            let states: Vec<String> = self.0.states.iter().map(Event::to_string).collect();
            parts.push(format!("state {}", states.join(", ")));
        }
        if self.0.hot {
            parts.push("hot".to_owned());
        }
        if let Some(priority) = self.0.priority {
            parts.push(format!("priority {priority}"));
        }
        if let Some(deadline) = self.0.deadline {
            parts.push(format!("deadline {:.3} s", deadline.as_secs_f64()));
        }
        f.write_str(if parts.is_empty() { "nothing" } else { "" })?;
        f.write_str(&parts.join("; "))
    }
}
