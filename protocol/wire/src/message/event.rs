//! Events and their data, inside of other messages.

use skein_bp::{Bound, Event, Value};
use skein_dbp::shortened;

use super::field::{Result, bounded, required};
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
        // What no other node would take in is cut here: a hole in the stream of events would be for ever.
        let mut room = Bound::EventBytes.most() / 4 * 3;
        let datum = |(key, value): (&str, &Value)| {
            let value = match value {
                Value::Text(text) if text.len() > room => Value::from(shortened(text, room)),
                value => value.clone(),
            };
            room = room.saturating_sub(value.as_text().map_or(0, |text| text.len()));
            (key.into(), (&value).into())
        };
        Self { name: event.name().into(), data: event.data().map(datum).collect() }
    }
}

impl TryFrom<proto::Event> for Event {
    type Error = DecodeError;

    fn try_from(event: proto::Event) -> Result<Self> {
        if event.name.is_empty() {
            return Err(DecodeError::Missing { field: "Event.name" });
        }
        // Each datum is put in its place among those before.
        bounded("Event.data", Bound::EventFields, event.data.len())?;
        let event = event.data.into_iter().try_fold(Event::new(event.name), |event, (key, value)| {
            Ok::<_, DecodeError>(event.with(key, Value::try_from(value)?))
        })?;
        event.check_bounds().map_err(|cause| DecodeError::Bound { field: "Event", cause })?;
        Ok(event)
    }
}
