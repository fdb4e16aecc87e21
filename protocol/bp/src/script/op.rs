//! The ops of scripts and how they are written.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use serde::de::{Error, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::bid::Bid;
use crate::event::Event;
use crate::event_set::EventSet;
use crate::notation::Many;

/// One op of a script; the [module](super) lists their JSON forms.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Op {
    Sync(Bid),
    /// Runs the body again and again.
    Repeat {
        times: Times,
        body: Vec<Op>,
    },
    /// Runs the body until an event of `set` happens or so much time has passed, and goes on behind it.
    Until {
        /// The events that end it at any synchronisation point inside.
        set: EventSet,
        /// The time it may take.
        within: Option<Duration>,
        body: Vec<Op>,
    },
    /// Runs the ops filed under the name of the event that ended the last sync, if there are any.
    On(BTreeMap<String, Vec<Op>>),
    /// Fails an assertion and ends.
    AssertFail(String),
    /// Puts events in the external queue.
    Enqueue(Vec<Event>),
    /// Adds a b-thread.
    Spawn(Spawn),
    /// Says whether the program waits for external events when it has nothing to do.
    Daemon(bool),
    /// Says what to enqueue when interrupted, from here on.
    OnInterruptEnqueue(Vec<Reply>),
    Stop,
}

impl Op {
    /// Runs `body` `times` times.
    pub fn repeat(times: u32, body: impl Into<Vec<Op>>) -> Self {
        Self::Repeat { times: Times::Count(times), body: body.into() }
    }

    /// Runs `body` for ever.
    pub fn forever(body: impl Into<Vec<Op>>) -> Self {
        Self::Repeat { times: Times::Forever, body: body.into() }
    }

    /// Whether the op may wait or end, so that a loop around it may come to rest.
    pub(super) fn may_pause(&self) -> bool {
        match self {
            Self::Sync(_) | Self::Stop | Self::AssertFail(_) => true,
            Self::Repeat { body, .. } | Self::Until { body, .. } => body.iter().any(Self::may_pause),
            Self::On(arms) => arms.values().flatten().any(Self::may_pause),
            Self::Enqueue(_) | Self::Spawn(_) | Self::Daemon(_) | Self::OnInterruptEnqueue(_) => false,
        }
    }
}

/// The number of rounds of a loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Times {
    Count(u32),
    /// Until the script ends from within.
    Forever,
}

/// The b-thread that `spawn` adds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Spawn {
    /// A script of the library, under its own name.
    Template(String),
    /// A script spelled out in place.
    Inline(ScriptSource),
}

/// A named script as written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScriptSource {
    /// Name of the b-thread.
    pub name: String,
    pub body: Vec<Op>,
    /// Priority under [`Strategy::BThreadPriority`](crate::Strategy::BThreadPriority).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub priority: Option<i32>,
}

/// One event that an interrupted script enqueues.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// The event that interrupted it, written `$event`.
    Interrupting,
    /// A given event.
    Event(Event),
}

const INTERRUPTING: &str = "$event";

impl Serialize for Reply {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Interrupting => serializer.serialize_str(INTERRUPTING),
            Self::Event(event) => event.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Reply {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let event = Event::deserialize(deserializer)?;
        Ok(if event.name() == INTERRUPTING { Self::Interrupting } else { Self::Event(event) })
    }
}

impl Serialize for Times {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Count(count) => serializer.serialize_u32(*count),
            Self::Forever => serializer.serialize_str("forever"),
        }
    }
}

impl<'de> Deserialize<'de> for Times {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct TimesVisitor;

        impl Visitor<'_> for TimesVisitor {
            type Value = Times;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number of rounds or \"forever\"")
            }

            fn visit_u64<E: Error>(self, count: u64) -> Result<Times, E> {
                u32::try_from(count).map(Times::Count).map_err(|_| E::custom("more than 4294967295 rounds"))
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Times, E> {
                if text == "forever" {
                    Ok(Times::Forever)
                } else {
                    Err(E::invalid_value(serde::de::Unexpected::Str(text), &self))
                }
            }
        }

        deserializer.deserialize_any(TimesVisitor)
    }
}

impl Serialize for Op {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        match self {
            Self::Sync(bid) => map.serialize_entry("sync", bid)?,
            Self::Repeat { times, body } => {
                map.serialize_entry("repeat", times)?;
                map.serialize_entry("do", body)?;
            }
            Self::Until { set, within, body } => {
                if !set.is_none() {
                    map.serialize_entry("until", set)?;
                }
                if let Some(within) = within {
                    map.serialize_entry("within_s", &within.as_secs_f64())?;
                }
                map.serialize_entry("do", body)?;
            }
            Self::On(arms) => map.serialize_entry("on", arms)?,
            Self::AssertFail(message) => map.serialize_entry("assert_fail", message)?,
            Self::Enqueue(events) => map.serialize_entry("enqueue", events)?,
            Self::Spawn(spawn) => map.serialize_entry("spawn", spawn)?,
            Self::Daemon(daemon) => map.serialize_entry("daemon", daemon)?,
            Self::OnInterruptEnqueue(replies) => map.serialize_entry("on_interrupt_enqueue", replies)?,
            Self::Stop => map.serialize_entry("stop", &true)?,
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for Op {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(OpVisitor)
    }
}

const OPS: &[&str] = &[
    "sync",
    "repeat",
    "until",
    "within_s",
    "do",
    "on",
    "assert_fail",
    "enqueue",
    "spawn",
    "daemon",
    "on_interrupt_enqueue",
    "stop",
];

struct OpVisitor;

impl<'de> Visitor<'de> for OpVisitor {
    type Value = Op;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "an op: an object with one of the keys {OPS:?}")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Op, A::Error> {
        let mut block = Block::default();
        let mut op = None;
        while let Some(key) = map.next_key::<String>()? {
            if block.take(&key, &mut map)? {
                continue;
            }
            let other = match &*key {
                "sync" => Op::Sync(map.next_value()?),
                "on" => Op::On(map.next_value()?),
                "assert_fail" => Op::AssertFail(map.next_value()?),
                "enqueue" => Op::Enqueue(map.next_value::<Many<Event>>()?.0),
                "spawn" => Op::Spawn(map.next_value()?),
                "daemon" => Op::Daemon(map.next_value()?),
                "on_interrupt_enqueue" => Op::OnInterruptEnqueue(map.next_value::<Many<Reply>>()?.0),
                "stop" => {
                    map.next_value::<bool>()?;
                    Op::Stop
                }
                unknown => return Err(Error::unknown_field(unknown, OPS)),
            };
            if op.replace(other).is_some() {
                return Err(Error::custom(format_args!("one op per object; `{key}` is the second")));
            }
        }
        match (op, block.into_op()?) {
            (Some(op), None) | (None, Some(op)) => Ok(op),
            (None, None) => Err(Error::custom(format_args!("an op needs one of the keys {OPS:?}"))),
            (Some(_), Some(_)) => Err(Error::custom("what has a `do` goes with no other op")),
        }
    }
}

/// An op that has a body, as far as it has been read.
#[derive(Default)]
struct Block {
    times: Option<Times>,
    set: Option<EventSet>,
    within: Option<Duration>,
    body: Option<Vec<Op>>,
}

impl Block {
    /// Reads the value of `key` if it is a block's; says whether it was.
    fn take<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<bool, A::Error> {
        match key {
            "repeat" => self.times = Some(map.next_value()?),
            "until" => self.set = Some(map.next_value()?),
            "within_s" => self.within = Some(read_seconds(map.next_value()?)?),
            "do" => self.body = Some(map.next_value()?),
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn into_op<E: Error>(self) -> Result<Option<Op>, E> {
        let Self { times, set, within, body } = self;
        match (times, set.is_some() || within.is_some(), body) {
            (None, false, None) => Ok(None),
            (None, false, Some(_)) => Err(E::missing_field("repeat")),
            (_, _, None) => Err(E::missing_field("do")),
            (Some(times), false, Some(body)) => Ok(Some(Op::Repeat { times, body })),
            (None, true, Some(body)) => Ok(Some(Op::Until { set: set.unwrap_or_default(), within, body })),
            (Some(_), true, _) => {
                Err(E::custom("`repeat` goes with no `until` or `within_s`; put one inside the other"))
            }
        }
    }
}

fn read_seconds<E: Error>(seconds: f64) -> Result<Duration, E> {
    Duration::try_from_secs_f64(seconds)
        .map_err(|_| E::custom(format_args!("`within_s` is {seconds}: expected seconds, 0 or more")))
}
