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
use std::time::Duration;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::op::{Op, Times};
use super::parameter::{Argument, Parameter};
use super::{Script, ScriptError};
use crate::bid::Bid;
use crate::configuration::{self, Malformed};
use crate::event_set::EventSet;

/// How long the text of a script may be, in bytes.
pub const MAX_TEXT: usize = 16 * 1024;
/// How many ops a script may have once each `each` is spelled out.
pub const MAX_OPS: usize = 400;
/// How long a name may be, in letters.
const MAX_NAME: usize = 32;
/// Blocks that take less time would fire without end.
const LEAST_WITHIN: Duration = Duration::from_millis(100);

/// Why a script was refused: where, and what was expected there.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}{}: {}{problem}", .line.map(|line| format!(":{line}")).unwrap_or_default(), quoted(.field))]
pub struct ScriptFileError {
    /// The file, or the script's name once its file does not matter any more.
    pub file: String,
    /// The line, from 1, where it is known.
    pub line: Option<usize>,
    /// The field, such as `body[1].do[0].sync`; empty when it is about the whole.
    pub field: String,
    /// What is wrong there.
    pub problem: String,
}

fn quoted(field: &str) -> String {
    if field.is_empty() { String::new() } else { format!("`{field}` ") }
}

/// What is wrong at a field.
struct Fault {
    field: String,
    problem: String,
}

impl Fault {
    fn new(field: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { field: field.into(), problem: problem.into() }
    }

    fn within(self, file: &str) -> ScriptFileError {
        ScriptFileError { file: file.to_owned(), line: None, field: self.field, problem: self.problem }
    }
}

/// A script as its file says it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScriptFile {
    /// Its name: lower-case words.
    pub name: String,
    /// What it is for, in one line.
    pub about: String,
    /// What it leaves open.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub parameters: BTreeMap<String, Parameter>,
    /// Events that end it, wherever it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    ends_on: Option<Value>,
    /// The ops, with parameters in braces.
    body: Vec<Value>,
}

/// A script and what its parameters shall be: what is sent to a vehicle.
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
    /// Reads a script; `file` is what errors call it, and ends in `.json` unless it is TOML. The body is tried with values
    /// that fit its parameters.
    ///
    /// # Errors
    /// [`ScriptFileError`] at the first thing that is not as expected.
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
        let mut filler = Filler { names: names.collect(), ops_left: MAX_OPS };
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

    /// The script for the node `me`.
    ///
    /// # Errors
    /// As for [`ScriptFile::bind`].
    pub fn bind(&self, me: &str) -> Result<BoundScript, ScriptFileError> {
        self.script.bind(me, self.called.as_deref(), &self.with)
    }
}

fn too_long(length: usize) -> String {
    format!("the script is {length} bytes long: expected at most {MAX_TEXT}")
}

fn from_toml<T: DeserializeOwned>(file: &str, text: &str) -> Result<T, ScriptFileError> {
    check_length(file, text)?;
    configuration::read(text).map_err(|Malformed { line, field, problem, .. }| ScriptFileError {
        file: file.to_owned(),
        line: Some(line),
        field,
        problem,
    })
}

fn from_json<T: for<'de> Deserialize<'de>>(file: &str, text: &str) -> Result<T, ScriptFileError> {
    check_length(file, text)?;
    let mut parser = serde_json::Deserializer::from_str(text);
    let fault = |error: &serde_json::Error, field: String| {
        let message = error.to_string();
        let problem = message.split(" at line ").next().unwrap_or_default().to_owned();
        ScriptFileError { file: file.to_owned(), line: Some(error.line()), field, problem }
    };
    let read =
        serde_path_to_error::deserialize(&mut parser).map_err(|error| fault(error.inner(), path(&error)))?;
    parser.end().map_err(|error| fault(&error, String::new()))?;
    Ok(read)
}

fn check_length(file: &str, text: &str) -> Result<(), ScriptFileError> {
    if text.len() > MAX_TEXT {
        return Err(Fault::new("", too_long(text.len())).within(file));
    }
    Ok(())
}

/// Where an error is; empty for the whole.
fn path<E>(error: &serde_path_to_error::Error<E>) -> String {
    let path = error.path().to_string();
    if path == "." { String::new() } else { path }
}

/// Reads a value that stands at `field`.
fn read<T: for<'de> Deserialize<'de>>(field: &str, value: Value) -> Result<T, Fault> {
    serde_path_to_error::deserialize(value).map_err(|error| {
        let inner = path(&error);
        let dot = if inner.is_empty() || inner.starts_with('[') { "" } else { "." };
        Fault::new(format!("{field}{dot}{inner}"), error.inner().to_string())
    })
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

/// Puts values in the place of names in braces.
struct Filler {
    names: BTreeMap<String, Value>,
    ops_left: usize,
}

impl Filler {
    fn fill(&mut self, value: &Value, field: &str) -> Result<Value, Fault> {
        Ok(match value {
            Value::String(text) => self.fill_text(text, field)?,
            Value::Array(list) => Value::Array(self.fill_list(list, field)?),
            Value::Object(object) => {
                let mut filled = Map::new();
                for (key, value) in object {
                    let field = format!("{field}.{key}");
                    let key = match self.fill_text(key, &field)? {
                        Value::String(key) => key,
                        other => other.to_string(),
                    };
                    filled.insert(key, self.fill(value, &field)?);
                }
                Value::Object(filled)
            }
            plain => plain.clone(),
        })
    }

    /// Fills each item, and spells out what is to be done with each point of a route.
    fn fill_list(&mut self, list: &[Value], field: &str) -> Result<Vec<Value>, Fault> {
        let mut filled = Vec::with_capacity(list.len());
        for (index, item) in list.iter().enumerate() {
            let field = format!("{field}[{index}]");
            let Some(left) = self.ops_left.checked_sub(1) else {
                return Err(Fault::new(
                    field,
                    format!("is one too many: expected at most {MAX_OPS} ops and lists"),
                ));
            };
            self.ops_left = left;
            match item.as_object().filter(|object| object.contains_key("each")) {
                Some(each) => filled.extend(self.fill_each(each, &field)?),
                None => filled.push(self.fill(item, &field)?),
            }
        }
        Ok(filled)
    }

    fn fill_each(&mut self, each: &Map<String, Value>, field: &str) -> Result<Vec<Value>, Fault> {
        let shape = || Fault::new(field, "is expected to be { each = \"ROUTE\", as = \"POINT\", do = [..] }");
        let (Some(Value::String(route)), Some(Value::String(point)), Some(Value::Array(body)), 3) =
            (each.get("each"), each.get("as"), each.get("do"), each.len())
        else {
            return Err(shape());
        };
        let points = self.names.get(route).and_then(Value::as_array).cloned();
        let Some(points) = points.filter(|points| points.iter().all(Value::is_array)) else {
            return Err(Fault::new(
                format!("{field}.each"),
                format!("is {route:?}, which is no route among the parameters"),
            ));
        };
        if self.names.contains_key(point) {
            return Err(Fault::new(
                format!("{field}.as"),
                format!("is {point:?}, which means something already"),
            ));
        }
        let mut filled = Vec::new();
        for value in points {
            self.names.insert(point.clone(), value);
            filled.extend(self.fill_list(body, &format!("{field}.do"))?);
        }
        self.names.remove(point);
        Ok(filled)
    }

    /// A text that is nothing but a name in braces becomes its value, whatever that is; inside a longer text it is written
    /// out.
    fn fill_text(&self, text: &str, field: &str) -> Result<Value, Fault> {
        let mut filled = String::new();
        let mut rest = text;
        while let Some((before, after)) = rest.split_once('{') {
            let Some((name, behind)) = after.split_once('}') else {
                return Err(Fault::new(field, format!("has a brace without an end: {text:?}")));
            };
            let value = self.value(name, field)?;
            if before.is_empty() && behind.is_empty() && filled.is_empty() {
                return Ok(value);
            }
            filled.push_str(before);
            match value {
                Value::String(text) => filled.push_str(&text),
                other => filled.push_str(&other.to_string()),
            }
            rest = behind;
        }
        filled.push_str(rest);
        Ok(Value::String(filled))
    }

    /// The value of `name`, or of one coordinate: `name.x`.
    fn value(&self, name: &str, field: &str) -> Result<Value, Fault> {
        let (name, axis) = name.split_once('.').map_or((name, None), |(name, axis)| (name, Some(axis)));
        let unknown = || {
            let known: Vec<&str> = self.names.keys().map(String::as_str).collect();
            Fault::new(
                field,
                format!("has `{{{name}}}`, which is no parameter; there are: {}", known.join(", ")),
            )
        };
        let value = self.names.get(name).ok_or_else(unknown)?;
        let Some(axis) = axis else { return Ok(value.clone()) };
        let coordinate = ["x", "y", "z"].iter().position(|known| *known == axis);
        coordinate.and_then(|index| value.get(index)).filter(|value| value.is_number()).cloned().ok_or_else(
            || Fault::new(field, format!("has `{{{name}.{axis}}}`: expected `.x`, `.y` or `.z` of a point")),
        )
    }
}

/// Checks what only whole programs may do, and that no loop goes round without a synchronisation point.
fn check(ops: &[Op], field: &str) -> Result<(), Fault> {
    for (index, op) in ops.iter().enumerate() {
        let field = format!("{field}[{index}]");
        let alien = |what: &str| {
            let expected = "expected `sync`, `repeat`, `until`, `within_s`, `each`, `on` or `stop`";
            Err(Fault::new(&field, format!("is `{what}`, which is not for scripts from files: {expected}")))
        };
        match op {
            Op::Sync(bid) => check_bid(bid, &field)?,
            Op::Repeat { times, body } => {
                if *times != Times::Count(0) && !always_syncs(body) {
                    let problem = "may go round without a `sync`: expected one on every way through it";
                    return Err(Fault::new(&field, problem));
                }
                check(body, &format!("{field}.do"))?;
            }
            Op::Until { within, body, .. } => {
                if within.is_some_and(|within| within < LEAST_WITHIN) {
                    return Err(Fault::new(
                        format!("{field}.within_s"),
                        "is too short: expected at least 0.1 s",
                    ));
                }
                check(body, &format!("{field}.do"))?;
            }
            Op::On(arms) => {
                for (name, body) in arms {
                    check(body, &format!("{field}.on.{name}"))?;
                }
            }
            Op::Stop => {}
            Op::AssertFail(_) => return alien("assert_fail"),
            Op::Enqueue(_) => return alien("enqueue"),
            Op::Spawn(_) => return alien("spawn"),
            Op::Daemon(_) => return alien("daemon"),
            Op::OnInterruptEnqueue(_) => return alien("on_interrupt_enqueue"),
        }
    }
    Ok(())
}

fn check_bid(bid: &Bid, field: &str) -> Result<(), Fault> {
    let fault = |key: &str, problem: &str| Err(Fault::new(format!("{field}.sync.{key}"), problem));
    if bid.given_deadline().is_some() {
        return fault("deadline", "is not for scripts from files: expected `within_s` around the `sync`");
    }
    if bid.holds_when_lost() {
        return fault("hold_when_lost", "is not for scripts from files: they block nothing from afar");
    }
    if bid.given_priority().is_some() {
        return fault("prio", "is not for scripts from files: all have the priority of a mission");
    }
    Ok(())
}

/// Whether every way through `ops` comes to a synchronisation point or ends the script.
fn always_syncs(ops: &[Op]) -> bool {
    ops.iter().any(|op| match op {
        Op::Sync(_) | Op::Stop => true,
        Op::Repeat { times, body } => *times != Times::Count(0) && always_syncs(body),
        Op::Until { body, .. } => always_syncs(body),
        _ => false,
    })
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
