//! Filling in parameters: a body with names in braces becomes one with values.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

use crate::bound::Bound;
use crate::script::reading::Fault;

/// The most ops that a script may have once each `each` is spelled out.
pub const MAX_OPS: usize = 400;

/// Puts values in the place of names in braces.
pub(super) struct Filler {
    names: BTreeMap<String, Value>,
    ops_left: usize,
    /// Bytes of texts so far.
    bytes: usize,
}

impl Filler {
    pub(super) fn new(names: BTreeMap<String, Value>) -> Self {
        Self { names, ops_left: MAX_OPS, bytes: 0 }
    }

    pub(super) fn fill(&mut self, value: &Value, field: &str) -> Result<Value, Fault> {
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
    pub(super) fn fill_list(&mut self, list: &[Value], field: &str) -> Result<Vec<Value>, Fault> {
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

    /// A text that is nothing but a name in braces becomes its value, whatever that is; inside a longer text it is
    /// written out.
    fn fill_text(&mut self, text: &str, field: &str) -> Result<Value, Fault> {
        let filled = self.filled(text, field)?;
        self.count(size(&filled), field)?;
        Ok(filled)
    }

    /// Notes that the script is so much longer.
    fn count(&mut self, bytes: usize, field: &str) -> Result<(), Fault> {
        self.bytes += bytes;
        Bound::ScriptBytes
            .check(self.bytes)
            .map_err(|exceeded| Fault::new(field, format!("makes it too long: {exceeded}")))
    }

    fn filled(&self, text: &str, field: &str) -> Result<Value, Fault> {
        let room = Bound::ScriptBytes.most().saturating_sub(self.bytes);
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
            if filled.len() > room {
                // Whoever counts it refuses it.
                break;
            }
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

/// About how many bytes a value is.
fn size(value: &Value) -> usize {
    match value {
        Value::String(text) => text.len(),
        Value::Array(list) => list.iter().map(size).sum(),
        Value::Object(object) => object.iter().map(|(key, value)| key.len() + size(value)).sum(),
        _ => size_of::<f64>(),
    }
}
