//! Sets of events, inside of other messages.

use std::collections::BTreeMap;
use std::sync::Arc;

use skein_bp::{EventSet, Pattern, Real, Value};

use super::field::{Result, required};
use crate::decode_error::DecodeError;
use crate::proto::{self, event_set};

impl From<&EventSet> for proto::EventSet {
    fn from(set: &EventSet) -> Self {
        use event_set::{Form, List};
        let list = |sets: &[EventSet]| List { sets: sets.iter().map(Into::into).collect() };
        let corner = |corner: &[Real; 3]| Some(corner.map(Real::get).into());
        let form = match set {
            EventSet::None => Form::None(event_set::Unit {}),
            EventSet::All => Form::All(event_set::Unit {}),
            EventSet::Exactly(event) => Form::Exactly(event.into()),
            EventSet::Named(pattern) if pattern.is_literal() => Form::Name(pattern.as_str().into()),
            EventSet::Named(pattern) => Form::Named(pattern.as_str().into()),
            EventSet::Prefix(prefix) => Form::Prefix(prefix.as_ref().into()),
            EventSet::FieldRange { key, min, max } => {
                Form::Range(event_set::Range { key: key.as_ref().into(), min: min.get(), max: max.get() })
            }
            EventSet::FieldIs(fields) => Form::Fields(event_set::Fields {
                fields: fields.iter().map(|(key, value)| (key.as_ref().into(), value.into())).collect(),
            }),
            EventSet::Region { min, max } => {
                Form::Region(event_set::Region { min: corner(min), max: corner(max) })
            }
            EventSet::Not(set) => Form::Not(Box::new(set.as_ref().into())),
            EventSet::And(sets) => Form::And(list(sets)),
            EventSet::Or(sets) => Form::Or(list(sets)),
        };
        Self { form: Some(form) }
    }
}

impl TryFrom<proto::EventSet> for EventSet {
    type Error = DecodeError;

    fn try_from(set: proto::EventSet) -> Result<Self> {
        let set = read(set)?;
        set.check_bounds().map_err(|cause| DecodeError::Bound { field: "EventSet", cause })?;
        Ok(set)
    }
}

/// Ends for any input: the decoder has bounded the tree's depth.
fn read(set: proto::EventSet) -> Result<EventSet> {
    use event_set::Form;
    let list = |list: event_set::List| list.sets.into_iter().map(read).collect::<Result<Vec<_>>>();
    let corner = |corner: proto::Vec3| [corner.x, corner.y, corner.z].map(Real::from);
    Ok(match required("EventSet.form", set.form)? {
        Form::None(_) => EventSet::None,
        Form::All(_) => EventSet::All,
        Form::Exactly(event) => EventSet::Exactly(event.try_into()?),
        Form::Named(pattern) => EventSet::Named(Pattern::new(pattern)),
        Form::Name(name) => EventSet::Named(Pattern::literal(name)),
        Form::Prefix(prefix) => EventSet::Prefix(prefix.into()),
        Form::Range(range) => {
            EventSet::FieldRange { key: range.key.into(), min: range.min.into(), max: range.max.into() }
        }
        Form::Fields(fields) => EventSet::FieldIs(
            fields
                .fields
                .into_iter()
                .map(|(key, value)| Ok((Arc::from(key), Value::try_from(value)?)))
                .collect::<Result<BTreeMap<_, _>>>()?,
        ),
        Form::Region(region) => EventSet::Region {
            min: corner(required("EventSet.region.min", region.min)?),
            max: corner(required("EventSet.region.max", region.max)?),
        },
        Form::Not(set) => EventSet::Not(Box::new(read(*set)?)),
        Form::And(sets) => EventSet::And(list(sets)?),
        Form::Or(sets) => EventSet::Or(list(sets)?),
    })
}
