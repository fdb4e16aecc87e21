//! Events and their data, inside of other messages.

use skein_bp::{Event, Value};

use super::field::{Result, required};
use crate::decode_error::DecodeError;
use crate::proto::{self, value::Kind};

impl From<&Value> for proto::Value {
    fn from(value: &Value) -> Self {
        let kind = match value {
            Value::Bool(flag) => Kind::Flag(*flag),
            Value::Int(integer) => Kind::Integer(*integer),
            Value::Real(real) => Kind::Real(real.get()),
            Value::Text(text) => Kind::Text(text.as_ref().into()),
        };
        Self { kind: Some(kind) }
    }
}

impl TryFrom<proto::Value> for Value {
    type Error = DecodeError;

    fn try_from(value: proto::Value) -> Result<Self> {
        Ok(match required("Value.kind", value.kind)? {
            Kind::Flag(flag) => flag.into(),
            Kind::Integer(integer) => integer.into(),
            Kind::Real(real) => real.into(),
            Kind::Text(text) => text.into(),
        })
    }
}

impl From<&Event> for proto::Event {
    fn from(event: &Event) -> Self {
        Self {
            name: event.name().into(),
            data: event.data().map(|(key, value)| (key.into(), value.into())).collect(),
        }
    }
}

impl TryFrom<proto::Event> for Event {
    type Error = DecodeError;

    fn try_from(event: proto::Event) -> Result<Self> {
        if event.name.is_empty() {
            return Err(DecodeError::Missing { field: "Event.name" });
        }
        event.data.into_iter().try_fold(Event::new(event.name), |event, (key, value)| {
            Ok(event.with(key, Value::try_from(value)?))
        })
    }
}
