//! Events: a name and data.

use std::cmp::Ordering;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::{Arc, LazyLock};

use crate::bound::{Bound, Exceeded};
use crate::scope::{NameKeys, leading_chunks};
use crate::value::Value;

/// Something that can happen: a name in chunks parted by `/`, and data.
///
/// Equality is name and data. The first two chunks are the event's home, the node that selects it. Cheap to clone.
///
/// ```
/// use skein_bp::Event;
/// let goto = Event::new("uav/3/goto").with("y", 2.0).with("x", 1.0);
/// assert_eq!(goto.home(), "uav/3");
/// assert_eq!(goto.real("x"), Some(1.0));
/// assert_eq!(goto.to_string(), "uav/3/goto{x: 1.0, y: 2.0}");
/// assert_ne!(goto, Event::new("uav/3/goto"));
/// ```
#[derive(Clone)]
pub struct Event(Arc<Body>);

#[derive(Clone)]
struct Body {
    name: Arc<str>,
    keys: NameKeys,
    /// In key order, each key once.
    data: Vec<(Arc<str>, Value)>,
}

impl Event {
    /// An event without data.
    pub fn new(name: impl Into<Arc<str>>) -> Self {
        let name = name.into();
        let keys = NameKeys::of(&name);
        Self(Arc::new(Body { name, keys, data: Vec::new() }))
    }

    /// The event that a b-thread gets when the deadline of its bid passes; see [`Bid::deadline`](crate::Bid::deadline).
    pub fn timeout() -> Self {
        static TIMEOUT: LazyLock<Event> = LazyLock::new(|| Event::new("timeout"));
        TIMEOUT.clone()
    }

    /// The same event with one more datum; a datum already under `key` is replaced.
    #[must_use]
    pub fn with(mut self, key: impl Into<Arc<str>>, value: impl Into<Value>) -> Self {
        let (key, value) = (key.into(), value.into());
        let data = &mut Arc::make_mut(&mut self.0).data;
        match data.binary_search_by(|(k, _)| k.cmp(&key)) {
            Ok(at) => {
                if let Some(slot) = data.get_mut(at) {
                    slot.1 = value;
                }
            }
            Err(at) => data.insert(at, (key, value)),
        }
        self
    }

    /// The whole name.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// The first two chunks of the name, or all of a shorter one.
    pub fn home(&self) -> &str {
        leading_chunks(&self.0.name, 2)
    }

    /// The last chunk of the name: what happens, whoever it happens to.
    pub fn kind(&self) -> &str {
        self.0.name.rsplit('/').next().unwrap_or_default()
    }

    /// The datum under `key`.
    pub fn get(&self, key: &str) -> Option<&Value> {
        self.0.data.iter().find(|(k, _)| &**k == key).map(|(_, value)| value)
    }

    /// The number under `key`, whole or real.
    pub fn real(&self, key: &str) -> Option<f64> {
        self.get(key)?.as_number()
    }

    /// The whole number under `key`, `2.0` included.
    pub fn int(&self, key: &str) -> Option<i64> {
        self.get(key)?.as_whole()
    }

    /// The text under `key`.
    pub fn text(&self, key: &str) -> Option<&str> {
        self.get(key)?.as_text().map(|text| &**text)
    }

    /// The truth value under `key`.
    pub fn bool(&self, key: &str) -> Option<bool> {
        self.get(key)?.as_flag()
    }

    /// All data, in key order.
    pub fn data(&self) -> impl ExactSizeIterator<Item = (&str, &Value)> {
        self.0.data.iter().map(|(key, value)| (&**key, value))
    }

    /// Lets through what an event from outside may be.
    ///
    /// # Errors
    /// [`Exceeded`] when it is too long, or has too many data.
    pub fn check_bounds(&self) -> Result<(), Exceeded> {
        check_name(self.name())?;
        check_data(self.data())
    }

    pub(crate) fn keys(&self) -> &NameKeys {
        &self.0.keys
    }

    /// A total order that is cheaper than `Ord` and means nothing to a reader.
    pub(crate) fn cmp_by_key(&self, other: &Self) -> Ordering {
        self.0.keys.name.cmp(&other.0.keys.name).then_with(|| self.cmp(other))
    }
}

/// Lets through what a name or a pattern from outside may be.
pub(crate) fn check_name(name: &str) -> Result<(), Exceeded> {
    Bound::NameBytes.check(name.len())?;
    Bound::NameChunks.check(name.split('/').count())
}

/// Lets through what data from outside may be.
pub(crate) fn check_data<'a>(
    data: impl ExactSizeIterator<Item = (&'a str, &'a Value)>,
) -> Result<(), Exceeded> {
    Bound::EventFields.check(data.len())?;
    let mut bytes = 0;
    for (key, value) in data {
        Bound::NameBytes.check(key.len())?;
        bytes += key.len() + value.as_text().map_or(size_of::<Value>(), |text| text.len());
    }
    Bound::EventBytes.check(bytes)
}

impl From<&str> for Event {
    fn from(name: &str) -> Self {
        Self::new(name)
    }
}

impl From<String> for Event {
    fn from(name: String) -> Self {
        Self::new(name)
    }
}

impl From<&Event> for Event {
    fn from(event: &Event) -> Self {
        event.clone()
    }
}

impl PartialEq for Event {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
            || (self.0.keys.name == other.0.keys.name
                && self.0.name == other.0.name
                && self.0.data == other.0.data)
    }
}

impl Eq for Event {}

impl PartialOrd for Event {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Event {
    fn cmp(&self, other: &Self) -> Ordering {
        if Arc::ptr_eq(&self.0, &other.0) {
            return Ordering::Equal;
        }
        self.0.name.cmp(&other.0.name).then_with(|| self.0.data.cmp(&other.0.data))
    }
}

impl Hash for Event {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.keys.name.hash(state);
        self.0.data.hash(state);
    }
}

/// Name and data; with `{:#}` for people, whose numbers have two decimals.
impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        for (at, (key, value)) in self.data().enumerate() {
            write!(f, "{}{key}: ", if at == 0 { "{" } else { ", " })?;
            value.fmt(f)?;
        }
        f.write_str(if self.0.data.is_empty() { "" } else { "}" })
    }
}

impl fmt::Debug for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
