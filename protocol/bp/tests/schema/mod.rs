//! The published schema, and as much of JSON Schema as it uses.

#![allow(clippy::panic)] // A test fails by panicking.

use serde_json::Value;

/// `schema/script.schema.json`.
pub struct Schema(Value);

impl Schema {
    pub fn read() -> Self {
        Self(serde_json::from_str(include_str!("../../schema/script.schema.json")).unwrap())
    }

    /// Where `value` does not fit the schema; `None` when it does.
    pub fn fault(&self, value: &Value) -> Option<String> {
        self.check(&self.0, value).err()
    }

    fn check(&self, schema: &Value, value: &Value) -> Result<(), String> {
        let fault = |keyword: &str| Err(format!("{value} does not fit {keyword} of {schema}"));
        for (keyword, rule) in schema.as_object().unwrap() {
            let fits = match keyword.as_str() {
                "$schema" | "$defs" | "title" | "description" => true,
                "$ref" => {
                    let target = rule.as_str().unwrap().strip_prefix('#').unwrap();
                    self.check(self.0.pointer(target).unwrap(), value)?;
                    true
                }
                "type" => match rule.as_str().unwrap() {
                    "object" => value.is_object(),
                    "array" => value.is_array(),
                    "string" => value.is_string(),
                    "boolean" => value.is_boolean(),
                    "number" => value.is_number(),
                    "integer" => value.is_i64() || value.is_u64(),
                    other => panic!("the schema uses the type {other}"),
                },
                "const" => rule == value,
                "enum" => rule.as_array().unwrap().contains(value),
                "minimum" => value.as_f64().is_none_or(|x| x >= rule.as_f64().unwrap()),
                "minItems" => value.as_array().is_none_or(|list| list.len() as u64 >= rule.as_u64().unwrap()),
                "maxItems" => value.as_array().is_none_or(|list| list.len() as u64 <= rule.as_u64().unwrap()),
                "minProperties" => {
                    value.as_object().is_none_or(|map| map.len() as u64 >= rule.as_u64().unwrap())
                }
                "pattern" => value.as_str().is_none_or(|text| fits_pattern(rule.as_str().unwrap(), text)),
                "required" => {
                    let has = |map: &serde_json::Map<_, _>| {
                        rule.as_array().unwrap().iter().all(|key| map.contains_key(key.as_str().unwrap()))
                    };
                    value.as_object().is_none_or(has)
                }
                "items" => {
                    value.as_array().into_iter().flatten().try_for_each(|item| self.check(rule, item))?;
                    true
                }
                "properties" => {
                    for (key, value) in value.as_object().into_iter().flatten() {
                        rule.get(key).map_or(Ok(()), |rule| self.check(rule, value))?;
                    }
                    true
                }
                "additionalProperties" => {
                    let known =
                        |key: &String| schema.get("properties").is_some_and(|known| known.get(key).is_some());
                    for (key, value) in value.as_object().into_iter().flatten().filter(|(key, _)| !known(key))
                    {
                        match rule {
                            Value::Bool(allowed) if *allowed => {}
                            Value::Bool(_) => return fault(&format!("additionalProperties, with {key},")),
                            rule => self.check(rule, value)?,
                        }
                    }
                    true
                }
                "anyOf" => self.count(rule, value) > 0,
                "oneOf" => self.count(rule, value) == 1,
                other => panic!("the schema uses {other}, which this test does not know"),
            };
            if !fits {
                return fault(keyword);
            }
        }
        Ok(())
    }

    fn count(&self, rules: &Value, value: &Value) -> usize {
        rules.as_array().unwrap().iter().filter(|rule| self.check(rule, value).is_ok()).count()
    }
}

/// The two patterns of the schema.
fn fits_pattern(pattern: &str, text: &str) -> bool {
    let word = |text: &str, more: &str| {
        text.chars()
            .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || "_-".contains(c) || more.contains(c))
    };
    match pattern {
        "^[a-z0-9_-]{1,32}$" => (1..=32).contains(&text.len()) && word(text, ""),
        r"^\{[a-z0-9_.-]+\}$" => {
            let inside = text.strip_prefix('{').and_then(|text| text.strip_suffix('}'));
            inside.is_some_and(|inside| !inside.is_empty() && word(inside, "."))
        }
        other => panic!("the schema uses the pattern {other}"),
    }
}
