//! The vehicle's own name, from which its b-threads build their events.

use serde::Serialize;
use skein_bp::{Event, EventSet};
use skein_wire::event::{self, Declaration, Declared, Events};

/// A vehicle's node name, such as `uav/3`, as its b-threads use it.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Me(String);

impl Me {
    /// Takes the node name, such as `uav/3`.
    pub fn new(node: impl std::fmt::Display) -> Self {
        Self(node.to_string())
    }

    #[must_use]
    pub fn name(&self) -> &str {
        &self.0
    }

    /// This event of mine: `me.event(Land { why: "battery low".into() })`.
    #[must_use]
    pub fn event(&self, event: impl Declared) -> Event {
        event.at(&self.0)
    }

    /// The name of my event `verb`.
    #[must_use]
    pub fn event_name(&self, verb: &str) -> String {
        format!("{}/{verb}", self.0)
    }

    /// My events of one or several declared types, whatever their data: `me.any::<(Land, Landed)>()`.
    #[must_use]
    pub fn any<E: Events>(&self) -> EventSet {
        E::any_at(&self.0)
    }

    /// My events of a list, whatever their data.
    #[must_use]
    pub fn any_in(&self, events: impl IntoIterator<Item = &'static Declaration>) -> EventSet {
        event::any_of(&self.0, events)
    }

    /// The verb of one of my events; `None` for an event of another home.
    #[must_use]
    pub fn verb<'event>(&self, event: &'event Event) -> Option<&'event str> {
        event.name().strip_prefix(self.0.as_str())?.strip_prefix('/')
    }

    /// Whether `event` is mine, and of this type.
    #[must_use]
    pub fn heard<D: Declared>(&self, event: &Event) -> bool {
        self.verb(event) == Some(D::NAME)
    }

    /// The data of `event`, if it is mine, and of this type.
    #[must_use]
    pub fn read<D: Declared>(&self, event: &Event) -> Option<D> {
        if self.heard::<D>(event) { D::read(event) } else { None }
    }
}
