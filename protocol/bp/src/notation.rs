//! The notation of events and event sets in files.
//!
//! An event is its name, or `{"name": "goto", "data": {"x": 1.0}}`. A set is an event (exactly that one), a list (any
//! of its sets), or an object; an object with several keys means all of them at once:
//!
//! | key | the set of events |
//! |---|---|
//! | `all` | `true`: every event; `false`: none |
//! | `any_data` | with this name |
//! | `named` | whose name fits this pattern |
//! | `prefix` | whose name starts with this text |
//! | `data_has` | whose data has these fields |
//! | `field_range` | `{"key": "z", "min": 0.0, "max": 2.0}`: with a number there; a missing bound is none |
//! | `region` | `{"min": [x, y, z], "max": [x, y, z]}`: in the box, in metres; `null` is no bound |
//! | `not`, `and`, `or` | outside a set, in each of a list, in any of a list |

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::sync::Arc;

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Error, IgnoredAny, IntoDeserializer, MapAccess, SeqAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::event::Event;
use crate::event_set::{EventSet, Extent};
use crate::pattern::Pattern;
use crate::value::{Real, Value};

type Data = BTreeMap<Arc<str>, Value>;

const EVENT_KEYS: &[&str] = &["name", "data"];
const SET_KEYS: &[&str] = &[
    "name",
    "data",
    "all",
    "any_data",
    "named",
    "prefix",
    "data_has",
    "field_range",
    "region",
    "not",
    "and",
    "or",
];

impl Serialize for Event {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.data().len() == 0 {
            return serializer.serialize_str(self.name());
        }
        let mut map = serializer.serialize_map(Some(2))?;
        map.serialize_entry("name", self.name())?;
        map.serialize_entry("data", &self.data().collect::<BTreeMap<_, _>>())?;
        map.end()
    }
}

impl<'de> Deserialize<'de> for Event {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(EventVisitor)
    }
}

struct EventVisitor;

impl<'de> Visitor<'de> for EventVisitor {
    type Value = Event;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an event: its name, or {\"name\": .., \"data\": {..}}")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<Event, E> {
        checked(Event::new(name))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Event, A::Error> {
        let mut parts = EventParts::default();
        while let Some(key) = map.next_key::<String>()? {
            if !parts.take(&key, &mut map)? {
                return Err(Error::unknown_field(&key, EVENT_KEYS));
            }
        }
        parts.into_event()?.ok_or_else(|| Error::missing_field("name"))
    }
}

fn checked<E: Error>(event: Event) -> Result<Event, E> {
    if event.name().is_empty() {
        return Err(E::custom("an event without a name: expected one such as uav/1/land"));
    }
    event.check_bounds().map_err(E::custom)?;
    Ok(event)
}

/// An event in object form, as far as it has been read.
#[derive(Default)]
struct EventParts {
    name: Option<Arc<str>>,
    data: Option<Data>,
}

impl EventParts {
    /// Reads the value of `key` if it is an event's; says whether it was.
    fn take<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<bool, A::Error> {
        match key {
            "name" => self.name = Some(map.next_value()?),
            "data" => self.data = map.next_value()?,
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn into_event<E: Error>(self) -> Result<Option<Event>, E> {
        match (self.name, self.data) {
            (None, None) => Ok(None),
            (None, Some(_)) => Err(E::missing_field("name")),
            (Some(name), data) => {
                let data = data.unwrap_or_default();
                let event =
                    data.into_iter().fold(Event::new(name), |event, (key, value)| event.with(key, value));
                checked(event).map(Some)
            }
        }
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RangeNotation {
    key: Arc<str>,
    min: Option<f64>,
    max: Option<f64>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RegionNotation {
    min: [Option<f64>; 3],
    max: [Option<f64>; 3],
}

/// Files have no way to write infinity, so a bound that is infinite is left out.
fn finite(bound: Real) -> Option<f64> {
    Some(bound.get()).filter(|x| x.is_finite())
}

impl Serialize for EventSet {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::None => keyed(serializer, "all", &false),
            Self::All => keyed(serializer, "all", &true),
            Self::Exactly(event) => event.serialize(serializer),
            Self::Named(name) if name.is_literal() => keyed(serializer, "any_data", name.as_str()),
            Self::Named(pattern) => keyed(serializer, "named", pattern.as_str()),
            Self::Prefix(prefix) => keyed(serializer, "prefix", prefix),
            Self::FieldRange { key, min, max } => {
                let range = RangeNotation { key: key.clone(), min: finite(*min), max: finite(*max) };
                keyed(serializer, "field_range", &range)
            }
            Self::FieldIs(fields) => keyed(serializer, "data_has", fields),
            Self::Region { min, max } => {
                keyed(serializer, "region", &RegionNotation { min: min.map(finite), max: max.map(finite) })
            }
            Self::Not(set) => keyed(serializer, "not", set),
            Self::And(sets) => keyed(serializer, "and", sets),
            Self::Or(sets) => sets.serialize(serializer),
        }
    }
}

fn keyed<S: Serializer, T: Serialize + ?Sized>(
    serializer: S,
    key: &str,
    value: &T,
) -> Result<S::Ok, S::Error> {
    let mut map = serializer.serialize_map(Some(1))?;
    map.serialize_entry(key, value)?;
    map.end()
}

impl<'de> Deserialize<'de> for EventSet {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Measured::deserialize(deserializer).map(|measured| measured.set)
    }
}

/// A set and how much of one it is, so that it is refused as soon as it is too much.
struct Measured {
    set: EventSet,
    extent: Extent,
}

impl Measured {
    fn leaf<E: Error>(set: EventSet) -> Result<Self, E> {
        set.check_names().map_err(E::custom)?;
        let extent = set.extent();
        Self::checked(set, extent)
    }

    fn list<E: Error>(sets: Vec<Self>, of: impl FnOnce(Vec<EventSet>) -> EventSet) -> Result<Self, E> {
        let extent = Extent::around(sets.iter().map(|measured| measured.extent));
        Self::checked(of(sets.into_iter().map(|measured| measured.set).collect()), extent)
    }

    fn checked<E: Error>(set: EventSet, extent: Extent) -> Result<Self, E> {
        let extent = extent.check().map_err(E::custom)?;
        Ok(Self { set, extent })
    }
}

impl<'de> Deserialize<'de> for Measured {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(EventSetVisitor)
    }
}

struct EventSetVisitor;

impl<'de> Visitor<'de> for EventSetVisitor {
    type Value = Measured;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "an event set: an event, a list of sets, or an object with keys of {SET_KEYS:?}")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<Measured, E> {
        Measured::leaf(EventSet::Exactly(checked(Event::new(name))?))
    }

    fn visit_unit<E: Error>(self) -> Result<Measured, E> {
        Measured::leaf(EventSet::None)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Measured, A::Error> {
        let mut sets = Vec::new();
        while let Some(set) = seq.next_element()? {
            sets.push(set);
        }
        Measured::list(sets, EventSet::Or)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Measured, A::Error> {
        let mut event = EventParts::default();
        let mut sets = Vec::new();
        while let Some(key) = map.next_key::<String>()? {
            if !event.take(&key, &mut map)? {
                sets.push(read_keyed(&key, &mut map)?);
            }
        }
        if let Some(event) = event.into_event()? {
            sets.push(Measured::leaf(EventSet::Exactly(event))?);
        }
        match (sets.pop(), sets.is_empty()) {
            (None, _) => Err(Error::custom(format_args!("an event set needs one of the keys {SET_KEYS:?}"))),
            (Some(only), true) => Ok(only),
            (Some(last), false) => {
                sets.push(last);
                Measured::list(sets, EventSet::And)
            }
        }
    }
}

fn read_keyed<'de, A: MapAccess<'de>>(key: &str, map: &mut A) -> Result<Measured, A::Error> {
    Measured::leaf(match key {
        "all" if map.next_value()? => EventSet::All,
        "all" => EventSet::None,
        "any_data" => EventSet::Named(Pattern::literal(map.next_value::<Arc<str>>()?)),
        "named" => EventSet::Named(Pattern::new(map.next_value::<Arc<str>>()?)),
        "prefix" => EventSet::Prefix(map.next_value()?),
        "data_has" => EventSet::FieldIs(map.next_value()?),
        "field_range" => {
            let RangeNotation { key, min, max } = map.next_value()?;
            EventSet::field_range(key, min.unwrap_or(f64::NEG_INFINITY), max.unwrap_or(f64::INFINITY))
        }
        "region" => {
            let RegionNotation { min, max } = map.next_value()?;
            EventSet::region(
                min.map(|x| x.unwrap_or(f64::NEG_INFINITY)),
                max.map(|x| x.unwrap_or(f64::INFINITY)),
            )
        }
        "not" => {
            let Measured { set, extent } = map.next_value()?;
            return Measured::checked(EventSet::Not(Box::new(set)), Extent::around([extent]));
        }
        "and" => return Measured::list(map.next_value()?, EventSet::And),
        "or" => return Measured::list(map.next_value()?, EventSet::Or),
        _ => {
            map.next_value::<IgnoredAny>()?;
            return Err(Error::unknown_field(key, SET_KEYS));
        }
    })
}

/// A list, or one item for a list of one.
pub(crate) struct Many<T>(pub(crate) Vec<T>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Many<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ManyVisitor(PhantomData))
    }
}

struct ManyVisitor<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for ManyVisitor<T> {
    type Value = Many<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an event or a list of events")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Many<T>, E> {
        T::deserialize(text.into_deserializer()).map(|item| Many(vec![item]))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Many<T>, A::Error> {
        T::deserialize(MapAccessDeserializer::new(map)).map(|item| Many(vec![item]))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Many<T>, A::Error> {
        Vec::deserialize(SeqAccessDeserializer::new(seq)).map(Many)
    }
}
