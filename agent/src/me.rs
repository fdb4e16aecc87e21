//! The vehicle's own name, from which its b-threads build their events.

use serde::Serialize;
use skein_bp::{Event, EventSet};
use skein_wire::vocabulary;

/// A vehicle's node name, such as `uav/3`, as its b-threads use it.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Me(String);

impl Me {
    /// Takes the node name, such as `uav/3`.
    pub fn new(node: impl std::fmt::Display) -> Self {
        Self(node.to_string())
    }

    /// The node name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.0
    }

    /// The event `<me>/<verb>` without data.
    #[must_use]
    pub fn event(&self, verb: &str) -> Event {
        vocabulary::event(&self.0, verb)
    }

    /// The event `<me>/<verb>` that says why it is requested.
    #[must_use]
    pub fn because(&self, verb: &str, why: &str) -> Event {
        self.event(verb).with("why", why)
    }

    /// All events `<me>/<verb>`, whatever their data.
    #[must_use]
    pub fn any(&self, verb: &str) -> EventSet {
        vocabulary::of(&self.0, verb)
    }

    /// All events `<me>/<verb>` for several verbs.
    #[must_use]
    pub fn any_of(&self, verbs: &[&str]) -> EventSet {
        EventSet::Or(verbs.iter().map(|verb| self.any(verb)).collect())
    }

    /// The verb of one of my events; `None` for an event of another home.
    #[must_use]
    pub fn verb<'event>(&self, event: &'event Event) -> Option<&'event str> {
        event.name().strip_prefix(self.0.as_str())?.strip_prefix('/')
    }

    /// Whether `event` is `<me>/<verb>`.
    #[must_use]
    pub fn heard(&self, event: &Event, verb: &str) -> bool {
        self.verb(event) == Some(verb)
    }
}
