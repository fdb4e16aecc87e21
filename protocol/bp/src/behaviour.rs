//! Behaviours: b-threads that belong together, in a crate of one's own, switched on by a node's configuration.
//!
//! A program lists the [`Behaviours`] that it was built with. Each is off until the table `[behaviours]` of a
//! configuration names it; what stands there is its settings, checked. The [`Chosen`] ones join the node's program, and
//! bring their events and what verification judges them by.
//!
//! ```
//! use serde::{Deserialize, Serialize};
//! use serde_json::json;
//! use skein_bp::behaviour::{Behaviour, Behaviours, Host};
//! use skein_bp::{BThread, Bid, Context, Event, Program, ProgramConfig};
//!
//! /// Rings so many times.
//! #[derive(Deserialize)]
//! struct Bell { times: u32 }
//!
//! impl Behaviour for Bell {
//!     const NAME: &'static str = "bell";
//!     const NODES: &'static str = "door/*";
//!
//!     fn load(&self, host: &Host<'_>, program: &mut Program) {
//!         program.add(Self::NAME, Ringing { event: format!("{}/rings", host.node), left: self.times });
//!     }
//! }
//!
//! #[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
//! struct Ringing { event: String, left: u32 }
//!
//! impl BThread for Ringing {
//!     fn bid(&self) -> Option<Bid> {
//!         (self.left > 0).then(|| Bid::new().request(self.event.as_str()))
//!     }
//!     fn resume(&mut self, _: &Event, _: &mut Context) {
//!         self.left -= 1;
//!     }
//! }
//!
//! let mut known = Behaviours::default();
//! known.add::<Bell>();
//! let settings = |value: serde_json::Value| value.as_object().cloned().unwrap_or_default();
//! let chosen = known.choose(&settings(json!({ "bell": { "times": 2 } })))?;
//! let mut program = Program::new(ProgramConfig::default());
//! chosen.load(&Host { node: "door/1", roster: vec!["door/1"] }, &mut program);
//! assert_eq!(program.superstep(Default::default())?.len(), 2);
//!
//! let error = known.choose(&settings(json!({ "bell": { "tmes": 2 } }))).unwrap_err();
//! assert_eq!(error.to_string(), "`behaviours.bell`: missing field `times`");
//! let error = known.choose(&settings(json!({ "gong": {} }))).unwrap_err();
//! assert_eq!(error.to_string(), "`behaviours.gong`: this program has no such behaviour; it has: bell");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use crate::bthread::BThread;
use crate::catalogue::{Declaration, Whose};
use crate::event_set::EventSet;
use crate::pattern::Pattern;
use crate::program::Program;

/// Prefix of the names of b-threads that stand for the world around a program under verification.
pub const WORLD: &str = "world/";

/// The settings of behaviours by their names: the table `[behaviours]` of a configuration.
pub type Settings = Map<String, Value>;

/// A node whose program a behaviour joins.
#[derive(Clone, Debug)]
pub struct Host<'a> {
    /// Its name, such as `uav/1`: the home of its events.
    pub node: &'a str,
    /// The names of all nodes of the mission, its own among them.
    pub roster: Vec<&'a str>,
}

/// B-threads that are switched on together. The type is their settings, as a configuration states them; fields that
/// it does not know are refused.
pub trait Behaviour: DeserializeOwned + Send + Sync + 'static {
    /// Its name in configurations.
    const NAME: &'static str;
    /// The nodes that it is for, as a pattern: `uav/*` or `ground/*`.
    const NODES: &'static str;
    /// The events that it brings.
    const EVENTS: &'static [Declaration] = &[];
    /// The names of events that its b-threads wait for and that a node tells only while somebody listens.
    const HEARS: &'static [&'static str] = &[];

    /// Adds its b-threads to a node's program.
    fn load(&self, host: &Host<'_>, program: &mut Program);

    /// Adds what verification needs: what must hold, and parts of the world that tell what its b-threads wait for.
    fn model(&self, host: &Host<'_>, model: &mut Model<'_>) {
        let _ = (host, model);
    }
}

/// A program under verification, to which a behaviour adds what it is judged by.
#[derive(Debug)]
pub struct Model<'a> {
    program: &'a mut Program,
    rules: Vec<Arc<str>>,
    world: Vec<Arc<str>>,
}

impl<'a> Model<'a> {
    /// Of this program, which holds the behaviours already.
    pub fn new(program: &'a mut Program) -> Self {
        Self { program, rules: Vec::new(), world: Vec::new() }
    }

    /// Adds what must hold, in words, and the b-thread that watches it: it fails when the rule is broken, or is hot
    /// while something is due.
    pub fn require(&mut self, rule: &str, watcher: impl BThread) {
        self.rules.push(self.program.add(rule, watcher));
    }

    /// Adds a part of the world, which moves whenever the program rests.
    pub fn tell(&mut self, name: &str, part: impl BThread) {
        self.world.push(self.program.add(format!("{WORLD}{name}"), part));
    }

    /// The rules that were added.
    pub fn rules(&self) -> &[Arc<str>] {
        &self.rules
    }

    /// The b-threads that stand for the world, by name.
    pub fn world(&self) -> &[Arc<str>] {
        &self.world
    }
}

/// A behaviour whose settings are known.
trait Ready: Send + Sync {
    fn load(&self, host: &Host<'_>, program: &mut Program);
    fn model(&self, host: &Host<'_>, model: &mut Model<'_>);
}

impl<B: Behaviour> Ready for B {
    fn load(&self, host: &Host<'_>, program: &mut Program) {
        Behaviour::load(self, host, program);
    }

    fn model(&self, host: &Host<'_>, model: &mut Model<'_>) {
        Behaviour::model(self, host, model);
    }
}

/// A behaviour that a program was built with.
#[derive(Clone, Copy)]
struct Known {
    nodes: &'static str,
    events: &'static [Declaration],
    hears: &'static [&'static str],
    read: fn(&Value) -> Result<Arc<dyn Ready>, BehaviourError>,
}

/// The behaviours that a program was built with.
#[derive(Clone, Default)]
pub struct Behaviours(BTreeMap<&'static str, Known>);

/// A fault in a table `[behaviours]`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{field}`: {problem}")]
pub struct BehaviourError {
    /// The field at fault, such as `behaviours.dwell.for_s`.
    pub field: String,
    pub problem: String,
}

impl Behaviours {
    /// Adds a behaviour, in place of another of its name.
    pub fn add<B: Behaviour>(&mut self) {
        let read = |settings: &Value| read::<B>(settings).map(|ready| Arc::new(ready) as Arc<dyn Ready>);
        self.0.insert(B::NAME, Known { nodes: B::NODES, events: B::EVENTS, hears: B::HEARS, read });
    }

    /// Switches on what these settings name.
    ///
    /// # Errors
    /// A behaviour that the program does not have, or whose settings are not as it expects.
    pub fn choose(&self, settings: &Settings) -> Result<Chosen, BehaviourError> {
        let choice = |(name, settings): (&String, &Value)| {
            let Some((name, known)) = self.0.get_key_value(name.as_str()) else {
                return Err(fault(name, format!("this program has no such behaviour; it has: {self:?}")));
            };
            Ok(Choice { name, known: *known, settings: settings.clone(), ready: (known.read)(settings)? })
        };
        settings.iter().map(choice).collect::<Result<_, _>>().map(Chosen)
    }

    /// The same in the configuration of `node`.
    ///
    /// # Errors
    /// As [`choose`](Self::choose); or a behaviour is for other nodes.
    pub fn choose_for(&self, node: &str, settings: &Settings) -> Result<Chosen, BehaviourError> {
        let chosen = self.choose(settings)?;
        match chosen.0.iter().find(|choice| !choice.is_for(node)) {
            None => Ok(chosen),
            Some(Choice { name, known, .. }) => {
                Err(fault(name, format!("is for nodes `{}`, and this is {node}", known.nodes)))
            }
        }
    }
}

impl fmt::Debug for Behaviours {
    /// Their names.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = self.0.keys().copied().collect();
        f.write_str(if names.is_empty() { "none" } else { "" })?;
        f.write_str(&names.join(", "))
    }
}

fn fault(field: impl fmt::Display, problem: String) -> BehaviourError {
    BehaviourError { field: format!("behaviours.{field}"), problem }
}

fn read<B: Behaviour>(settings: &Value) -> Result<B, BehaviourError> {
    let mut track = serde_path_to_error::Track::new();
    let mut unknown = None;
    let parser = serde_path_to_error::Deserializer::new(settings, &mut track);
    let ready = serde_ignored::deserialize(parser, |path| {
        unknown.get_or_insert_with(|| path.to_string());
    });
    let field =
        |inner: String| if inner == "." { B::NAME.to_owned() } else { format!("{}.{inner}", B::NAME) };
    match (ready, unknown) {
        (Ok(ready), None) => Ok(ready),
        (Ok(_), Some(inner)) => Err(fault(field(inner), "is no setting of this behaviour".to_owned())),
        (Err(error), _) => Err(fault(field(track.path().to_string()), error.to_string())),
    }
}

/// Behaviours that are switched on, with their settings.
#[derive(Clone, Default)]
pub struct Chosen(Vec<Choice>);

#[derive(Clone)]
struct Choice {
    name: &'static str,
    known: Known,
    settings: Value,
    ready: Arc<dyn Ready>,
}

impl Choice {
    fn is_for(&self, node: &str) -> bool {
        Pattern::new(self.known.nodes).matches(node)
    }
}

impl Chosen {
    fn of<'a>(&'a self, node: &'a str) -> impl Iterator<Item = &'a Choice> {
        self.0.iter().filter(move |choice| choice.is_for(node))
    }

    /// Adds the b-threads of those that are for this node to its program.
    pub fn load(&self, host: &Host<'_>, program: &mut Program) {
        self.of(host.node).for_each(|choice| choice.ready.load(host, program));
    }

    /// Adds what these are judged by.
    pub fn model(&self, host: &Host<'_>, model: &mut Model<'_>) {
        self.of(host.node).for_each(|choice| choice.ready.model(host, model));
    }

    /// The events that they bring to `node` in which `whose` has a say.
    pub fn events(&self, node: &str, whose: Whose) -> EventSet {
        let declared = self.declarations(node).flatten().filter(|event| event.whose == whose);
        declared.fold(EventSet::None, |set, event| set.or(EventSet::named(format!("{node}/{}", event.name))))
    }

    pub fn hear(&self, node: &str, event: &str) -> bool {
        self.of(node).any(|choice| choice.known.hears.contains(&event))
    }

    /// The lists of events that they bring to `node`.
    pub fn declarations<'a>(&'a self, node: &'a str) -> impl Iterator<Item = &'static [Declaration]> + 'a {
        self.of(node).map(|choice| choice.known.events)
    }

    /// The settings of those that are for `node`: what its configuration states.
    pub fn settings(&self, node: &str) -> Settings {
        self.of(node).map(|choice| (choice.name.to_owned(), choice.settings.clone())).collect()
    }
}

impl PartialEq for Chosen {
    fn eq(&self, other: &Self) -> bool {
        let named = |one: &Choice, other: &Choice| one.name == other.name && one.settings == other.settings;
        self.0.len() == other.0.len() && self.0.iter().zip(&other.0).all(|(one, other)| named(one, other))
    }
}

impl fmt::Debug for Chosen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_map().entries(self.0.iter().map(|choice| (choice.name, &choice.settings))).finish()
    }
}
