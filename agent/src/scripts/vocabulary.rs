//! The events that a script may speak of: those that the fleet's catalogue declares, with the fields that they have.

use skein_bp::{Event, EventSet, Pattern, Value};
use skein_dbp::NodeName;
use skein_wire::event::{Catalogue, Declaration};

use crate::me::Me;

/// The events that there are in a fleet.
#[derive(Clone, Debug)]
pub struct Vocabulary {
    nodes: Vec<NodeName>,
    events: Catalogue,
}

/// The declarations that a condition on data may be about; none where its events are not declared.
type Declared = Option<Vec<&'static Declaration>>;

impl Vocabulary {
    /// The events of `catalogue` at the nodes of `roster`.
    pub fn new(roster: &[String], catalogue: &Catalogue) -> Self {
        let nodes = roster.iter().filter_map(|node| NodeName::new(node).ok()).collect();
        Self { nodes, events: catalogue.clone() }
    }

    pub(super) fn nodes(&self) -> &[NodeName] {
        &self.nodes
    }

    /// The names of the vehicle's own events, but for those that its scripts make up.
    pub(super) fn names(&self, me: &Me) -> impl Iterator<Item = String> {
        self.events.at_vehicle().map(|event| me.event_name(event.name))
    }

    /// Checks that each name in a set is that of an event, each pattern fits one, and that they have the data asked
    /// for.
    pub(super) fn check(&self, set: &EventSet) -> Result<(), String> {
        self.check_among(set, &None)
    }

    /// Checks that there is this event, with data of these kinds.
    pub(super) fn check_event(&self, event: &Event) -> Result<(), String> {
        let declared = self.named(event.name())?;
        event.data().try_for_each(|(key, value)| check_datum(&declared, key, Some(value)))
    }

    fn check_among(&self, set: &EventSet, about: &Declared) -> Result<(), String> {
        match set {
            EventSet::None | EventSet::All => Ok(()),
            EventSet::Exactly(event) => self.check_event(event),
            EventSet::Named(pattern) => self.fitting(pattern).map(drop),
            EventSet::Prefix(prefix) => {
                let known = self.nodes.iter().any(|node| set.could_match_home(node.as_str()));
                if known { Ok(()) } else { Err(no_such_event(&format!("{prefix}.."))) }
            }
            EventSet::FieldIs(fields) => {
                fields.iter().try_for_each(|(key, value)| check_datum(about, key, Some(value)))
            }
            EventSet::FieldRange { key, .. } => check_datum(about, key, None),
            EventSet::Region { .. } => ["x", "y"].iter().try_for_each(|axis| check_datum(about, axis, None)),
            EventSet::Not(set) => self.check_among(set, about),
            EventSet::Or(sets) => sets.iter().try_for_each(|set| self.check_among(set, about)),
            EventSet::And(sets) => {
                let named = sets.iter().find_map(|set| match set {
                    EventSet::Named(pattern) => Some(self.fitting(pattern)),
                    _ => None,
                });
                let about = named.transpose()?.unwrap_or_else(|| about.clone());
                sets.iter().try_for_each(|set| self.check_among(set, &about))
            }
        }
    }

    /// The declarations of the events that a pattern fits.
    fn fitting(&self, pattern: &Pattern) -> Result<Declared, String> {
        if pattern.is_literal() {
            return self.named(pattern.as_str());
        }
        let set = EventSet::Named(pattern.clone());
        let at = |node: &NodeName| {
            let fits = |event: &&Declaration| pattern.matches(&node.event_name(event.name));
            self.events.at_vehicle().filter(fits).collect::<Vec<_>>()
        };
        let declared: Vec<_> = self.nodes.iter().flat_map(at).collect();
        let of_others =
            self.nodes.iter().any(|node| !is_vehicle(node) && set.could_match_home(node.as_str()));
        match (declared.is_empty(), of_others) {
            (_, true) => Ok(None),
            (false, false) => Ok(Some(declared)),
            (true, false) => Err(no_such_event(pattern.as_str())),
        }
    }

    fn named(&self, name: &str) -> Result<Declared, String> {
        let (node, verb) = self
            .nodes
            .iter()
            .find_map(|node| Some((node, name.strip_prefix(node.as_str())?.strip_prefix('/')?)))
            .ok_or_else(|| no_such_event(name))?;
        // What other nodes than vehicles say is their own affair, and so is what a script makes up.
        if !is_vehicle(node) || verb.starts_with("script/") {
            return Ok(None);
        }
        let declared = self.events.at_vehicle().find(|event| event.name == verb);
        declared.map(|event| Some(vec![event])).ok_or_else(|| no_such_event(name))
    }
}

fn is_vehicle(node: &NodeName) -> bool {
    node.kind() == "uav"
}

fn no_such_event(name: &str) -> String {
    format!("`{name}`, and there is no such event in this fleet")
}

/// Checks that one of these events has a field `key` that may be `value`, or, without a value, that it is a number.
fn check_datum(declared: &Declared, key: &str, value: Option<&Value>) -> Result<(), String> {
    let Some(declared) = declared else { return Ok(()) };
    let mut fault = None;
    for event in declared {
        let Some(field) = event.field(key) else { continue };
        let fits = match value {
            // It stands for the datum `x` of an event that has yet to come.
            Some(Value::Text(text)) if text.starts_with('$') => true,
            Some(value) => field.kind.takes(value) && field.takes_number(value.as_number()),
            None => field.kind.is_number(),
        };
        if fits {
            return Ok(());
        }
        fault = Some(match value {
            Some(value) => format!("`{key}` of `{}` as {value}: expected {}", event.name, field.expected()),
            None => format!("`{key}` of `{}` as a number: expected {}", event.name, field.expected()),
        });
    }
    Err(fault.unwrap_or_else(|| {
        let fields = |event: &&Declaration| match event.fields {
            [] => format!("`{}` has none", event.name),
            fields => {
                let names: Vec<_> = fields.iter().map(|field| format!("`{}`", field.name)).collect();
                format!("`{}` has {}", event.name, names.join(", "))
            }
        };
        let there_is: Vec<_> = declared.iter().take(3).map(fields).collect();
        format!("the field `{key}`, and there is no such field: {}", there_is.join("; "))
    }))
}
