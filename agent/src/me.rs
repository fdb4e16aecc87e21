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

    pub fn name(&self) -> &str {
        &self.0
    }

    /// This event of mine: `me.event(Land { why: "battery low".into() })`.
    pub fn event(&self, event: impl Declared) -> Event {
        event.at(&self.0)
    }

    pub fn event_name(&self, verb: &str) -> String {
        format!("{}/{verb}", self.0)
    }

    /// My events of one or several declared types, whatever their data: `me.any::<(Land, Landed)>()`.
    pub fn any<E: Events>(&self) -> EventSet {
        E::any_at(&self.0)
    }

    /// My events of a list, whatever their data.
    pub fn any_in(&self, events: impl IntoIterator<Item = &'static Declaration>) -> EventSet {
        event::any_of(&self.0, events)
    }

    /// The verb of one of my events; `None` for an event of another home.
    pub fn verb<'event>(&self, event: &'event Event) -> Option<&'event str> {
        event.name().strip_prefix(self.0.as_str())?.strip_prefix('/')
    }

    /// Whether `event` is mine, and of this type.
    pub fn heard<D: Declared>(&self, event: &Event) -> bool {
        self.verb(event) == Some(D::NAME)
    }

    /// The data of `event`, if it is mine, and of this type.
    pub fn read<D: Declared>(&self, event: &Event) -> Option<D> {
        if self.heard::<D>(event) { D::read(event) } else { None }
    }
}
