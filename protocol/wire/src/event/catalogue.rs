//! All events that are declared, and what follows from their declarations.

use skein_bp::EventSet;
use std::fmt;

use skein_bp::catalogue::{Declaration, Field, Whose};
use skein_dbp::RULES;
use skein_dbp::facts::FACTS;

use super::{AIRSPACE, JOINT, MISSION, MOTION, ORDERS, SCRIPT_FACTS, SCRIPTS, SENSES, STATED, STATION};

/// Events that belong together.
#[derive(Clone, Copy, Debug)]
pub struct Subject {
    pub title: &'static str,
    /// The node, or the pattern of nodes, that is home to them.
    pub home: &'static str,
    pub events: &'static [Declaration],
}

/// The home of a vehicle's events.
const VEHICLE: &str = "uav/*";

const STANDARD: [Subject; 12] = [
    Subject { title: "A vehicle's motion", home: VEHICLE, events: MOTION },
    Subject { title: "What b-threads state of a vehicle's motion", home: VEHICLE, events: STATED },
    Subject { title: "A vehicle's flight and mission", home: VEHICLE, events: MISSION },
    Subject { title: "What a vehicle finds out on its way", home: VEHICLE, events: SENSES },
    Subject { title: "What is drawn on the map for a vehicle", home: VEHICLE, events: AIRSPACE },
    Subject { title: "Orders to a vehicle", home: VEHICLE, events: ORDERS },
    Subject { title: "Scripts on a vehicle", home: VEHICLE, events: SCRIPTS },
    Subject { title: "What is told to scripts", home: VEHICLE, events: SCRIPT_FACTS },
    Subject { title: "Joint decisions", home: "swarm", events: JOINT },
    Subject { title: "A ground station", home: "ground/*", events: STATION },
    Subject { title: "What an operator requests of any node", home: "*/*", events: RULES },
    Subject { title: "Facts of every node", home: "*/*", events: FACTS },
];

/// The events that a fleet knows: Skein's own, and those that others declare for their behaviours.
#[derive(Clone, Debug)]
pub struct Catalogue(Vec<Subject>);

impl Default for Catalogue {
    fn default() -> Self {
        Self::standard()
    }
}

impl Catalogue {
    /// Skein's own events.
    pub fn standard() -> Self {
        Self(STANDARD.to_vec())
    }

    /// Knows these events of vehicles too.
    #[must_use]
    pub fn with(mut self, events: &'static [Declaration]) -> Self {
        self.0.push(Subject { title: "Further events of a vehicle", home: VEHICLE, events });
        self
    }

    /// All events, by subject.
    pub fn subjects(&self) -> impl Iterator<Item = &Subject> {
        self.0.iter()
    }

    /// The events that have a vehicle for their home, facts apart.
    pub fn of_vehicle(&self) -> impl Iterator<Item = &'static Declaration> {
        self.0.iter().filter(|subject| subject.home == VEHICLE).flat_map(|subject| subject.events)
    }

    /// The same, and facts.
    pub fn at_vehicle(&self) -> impl Iterator<Item = &'static Declaration> {
        self.of_vehicle().chain(FACTS)
    }

    /// What only a vehicle itself can say or decide: from afar these are neither blocked nor requested (G6).
    pub fn own(&self) -> impl Iterator<Item = &'static Declaration> {
        self.of_vehicle().filter(|event| event.whose == Whose::Own)
    }

    /// What an operator requests of a vehicle: its gateway.
    pub fn gateway(&self) -> impl Iterator<Item = &'static Declaration> {
        self.of_vehicle().filter(|event| event.whose == Whose::Operator)
    }
}

/// The set of these events at `node`, whatever their data.
pub fn any_of(node: &str, events: impl IntoIterator<Item = &'static Declaration>) -> EventSet {
    EventSet::any_of(events.into_iter().map(|event| EventSet::named(format!("{node}/{}", event.name))))
}

/// A table for each subject, in Markdown.
impl fmt::Display for Catalogue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for Subject { title, home, events } in self.subjects() {
            writeln!(f, "\n## {title}: `{home}/...`\n")?;
            writeln!(f, "| event | whose | data | |\n|---|---|---|---|")?;
            for Declaration { name, about, whose, fields } in *events {
                let whose = match whose {
                    Whose::Own => "own",
                    Whose::Operator => "operator's",
                    Whose::Anyone => "anyone's",
                };
                let fields: Vec<String> = fields.iter().map(in_words).collect();
                writeln!(f, "| `{name}` | {whose} | {} | {about} |", fields.join("<br>"))?;
            }
        }
        Ok(())
    }
}

fn in_words(field: &Field) -> String {
    let about = if field.about.is_empty() { String::new() } else { format!(". {}", field.about) };
    format!("`{}`: {}{about}", field.name, field.expected())
}
