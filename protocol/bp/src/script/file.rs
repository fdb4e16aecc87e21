//! Scripts as people write, keep and send them: with a name, a purpose and parameters.
//!
//! A file is TOML or JSON; `schema/script.schema.json` beside this crate describes it.
//!
//! ```
//! use skein_bp::script::{Argument, ScriptFile};
//!
//! let file = ScriptFile::parse("pause.toml", r#"
//!     name = "pause"
//!     about = "Keeps the vehicle where it is for a while."
//!
//!     [parameters.for_s]
//!     about = "How long."
//!     type = "number"
//!     unit = "s"
//!     default = 10.0
//!     min = 1.0
//!
//!     [[body]]
//!     within_s = "{for_s}"
//!     do = [{ sync = { block = { any_data = "{me}/advance" } } }]
//! "#)?;
//! let with = [("for_s".to_owned(), Argument::Number(0.5))].into();
//! let refusal = file.bind("uav/3", None, &with).unwrap_err();
//! assert_eq!(refusal.to_string(), "pause: `with.for_s` is 0.5: expected at least 1 s");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::bid::Bid;
use crate::bound::Bound;
use crate::event_set::EventSet;
use crate::script::filler::Filler;
use crate::script::op::Op;
use crate::script::parameter::{Argument, Parameter};
use crate::script::reading::{Fault, MAX_TEXT, ScriptFileError, from_json, from_toml, read, too_long};
use crate::script::soundness::check;
use crate::script::{Script, ScriptError};

/// The longest name, in letters.
const MAX_NAME: usize = 32;

/// A script as it stands in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScriptFile {
    /// Its name: lower-case words.
    pub name: String,
    /// Its purpose, in one line.
    pub about: String,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub parameters: BTreeMap<String, Parameter>,
    /// Events that end it, wherever it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    ends_on: Option<Value>,
    /// The ops, with parameters in braces.
    body: Vec<Value>,
}

/// A script with values for its parameters, as it is sent to a vehicle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Assignment {
    pub script: ScriptFile,
    /// Values of its parameters.
    #[serde(default)]
    pub with: BTreeMap<String, Argument>,
    /// Another name to run under, so that one script may run twice.
    #[serde(default, rename = "as", skip_serializing_if = "Option::is_none")]
    pub called: Option<String>,
}

/// A script whose parameters have values, checked.
#[derive(Clone, Debug)]
pub struct BoundScript {
    /// The name it runs under.
    pub name: String,
    pub about: String,
    /// The values of all its parameters.
    pub with: BTreeMap<String, Argument>,
    /// The b-thread, before its first synchronisation point.
    pub bthread: Script,
}

impl ScriptFile {
    /// Reads a script; `file` is what errors call it, and ends in `.json` unless it is TOML. The body is tried with
    /// values that fit its parameters.
    pub fn parse(file: &str, text: &str) -> Result<Self, ScriptFileError> {
        let script: Self =
            if file.ends_with(".json") { from_json(file, text)? } else { from_toml(file, text)? };
        let examples = script.parameters.iter().map(|(name, p)| (name.clone(), p.example())).collect();
        script.bound("uav/1", None, &examples).map_err(|fault| fault.within(file))?;
        Ok(script)
    }

    /// The script for the node `me` with values for its parameters, under its own name or another.
    ///
    /// # Errors
    /// [`ScriptFileError`] when a value is missing, is not what the parameter may be, or the body is not sound with it.
    pub fn bind(
        &self,
        me: &str,
        called: Option<&str>,
        with: &BTreeMap<String, Argument>,
    ) -> Result<BoundScript, ScriptFileError> {
        self.bound(me, called, with).map_err(|fault| fault.within(&self.name))
    }

    fn bound(
        &self,
        me: &str,
        called: Option<&str>,
        with: &BTreeMap<String, Argument>,
    ) -> Result<BoundScript, Fault> {
        check_name("name", &self.name)?;
        let name = called.unwrap_or(&self.name);
        check_name("as", name)?;
        let with = self.values(with)?;
        let own = [("me", me), ("name", name)].map(|(key, value)| (key.to_owned(), Value::from(value)));
        let names = own.into_iter().chain(with.iter().map(|(key, value)| (key.clone(), value.to_json())));
        let mut filler = Filler::new(names.collect());
        let ends_on = match &self.ends_on {
            Some(set) => read::<EventSet>("ends_on", filler.fill(set, "ends_on")?)?,
            None => EventSet::None,
        };
        let body = filler.fill_list(&self.body, "body")?;
        let ops = read::<Vec<Op>>("body", Value::Array(body))?;
        check(&ops, "body")?;
        let ops = ending_on(ops, &ends_on);
        let bthread =
            Script::new(&ops).map_err(|error: ScriptError| Fault::new("body", error.to_string()))?;
        check_size(&bthread)?;
        Ok(BoundScript { name: name.to_owned(), about: self.about.clone(), with, bthread })
    }

    /// The values of all parameters, defaults included.
    fn values(&self, with: &BTreeMap<String, Argument>) -> Result<BTreeMap<String, Argument>, Fault> {
        if let Some(unknown) = with.keys().find(|name| !self.parameters.contains_key(*name)) {
            let known: Vec<&str> = self.parameters.keys().map(String::as_str).collect();
            let problem = format!("is no parameter; there are: {}", known.join(", "));
            return Err(Fault::new(format!("with.{unknown}"), problem));
        }
        let value = |(name, parameter): (&String, &Parameter)| {
            let field = format!("parameters.{name}");
            if !is_word(name) || ["me", "name"].contains(&name.as_str()) {
                return Err(Fault::new(
                    field,
                    "has a name of its own: expected another, in lower-case letters",
                ));
            }
            if let Some(fault) = parameter.fault() {
                return Err(Fault::new(field, fault));
            }
            let field = format!("with.{name}");
            let Some(given) = with.get(name).or(parameter.default.as_ref()) else {
                return Err(Fault::new(field, format!("is missing: expected {}", parameter.kind)));
            };
            let accepted = parameter.accept(given).map_err(|problem| Fault::new(field, problem))?;
            Ok((name.clone(), accepted))
        };
        self.parameters.iter().map(value).collect()
    }
}

impl Assignment {
    /// Reads what [`to_json`](Self::to_json) has written.
    ///
    /// # Errors
    /// [`ScriptFileError`] when it is too long or no assignment.
    pub fn from_json(text: &str) -> Result<Self, ScriptFileError> {
        from_json("script", text)
    }

    /// The assignment as text, to be sent.
    ///
    /// # Errors
    /// [`ScriptFileError`] when it is longer than [`MAX_TEXT`].
    pub fn to_json(&self) -> Result<String, ScriptFileError> {
        let fault = |problem: String| Fault::new("", problem).within(&self.script.name);
        let text = serde_json::to_string(self).map_err(|error| fault(error.to_string()))?;
        if text.len() > MAX_TEXT { Err(fault(too_long(text.len()))) } else { Ok(text) }
    }

    /// The name it will run under.
    pub fn name(&self) -> &str {
        self.called.as_deref().unwrap_or(&self.script.name)
    }

    pub fn bind(&self, me: &str) -> Result<BoundScript, ScriptFileError> {
        self.script.bind(me, self.called.as_deref(), &self.with)
    }
}

/// Checks that there is not too much in all synchronisation points together, and nothing too deep in any.
fn check_size(script: &Script) -> Result<(), Fault> {
    let mut nodes = 0;
    for set in script.bids().flat_map(|bid: &Bid| [bid.waits(), bid.blocks(), bid.interrupts()]) {
        let extent = set.extent();
        nodes += extent.nodes;
        extent.check().and(Bound::ScriptNodes.check(nodes)).map_err(|exceeded| {
            Fault::new("body", format!("is too much, with what ends it at each `sync`: {exceeded}"))
        })?;
    }
    Ok(())
}

fn check_name(field: &str, name: &str) -> Result<(), Fault> {
    if is_word(name) {
        return Ok(());
    }
    let problem = format!("is {name:?}: expected 1 to {MAX_NAME} of the letters a-z, 0-9, `_` and `-`");
    Err(Fault::new(field, problem))
}

fn is_word(text: &str) -> bool {
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || c == '-';
    (1..=MAX_NAME).contains(&text.len()) && text.chars().all(plain)
}

/// The same ops, ended by the events of a set at each synchronisation point.
fn ending_on(ops: Vec<Op>, set: &EventSet) -> Vec<Op> {
    let inside = |body| ending_on(body, set);
    ops.into_iter()
        .map(|op| match op {
            Op::Sync(bid) => Op::Sync(bid.interrupt(set)),
            Op::Repeat { times, body } => Op::Repeat { times, body: inside(body) },
            Op::Until { set: until, within, body } => Op::Until { set: until, within, body: inside(body) },
            Op::On(arms) => Op::On(arms.into_iter().map(|(name, body)| (name, inside(body))).collect()),
            other => other,
        })
        .collect()
}
