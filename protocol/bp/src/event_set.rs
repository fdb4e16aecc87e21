//! Sets of events, as data.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use smallvec::SmallVec;

use crate::bound::{Bound, Exceeded, count_node};
use crate::event::{Event, check_data, check_name};
use crate::pattern::Pattern;
use crate::scope::{Level, Scope};
use crate::value::{Real, Value};

/// A set of events. It is data, never a closure, because it is indexed, sent to other nodes and shown to people.
///
/// A text becomes a name pattern with any data; an [`Event`] becomes the set of exactly that event.
///
/// ```
/// use skein_bp::{Event, EventSet};
/// let low = EventSet::from("uav/*/goto").and(EventSet::field_range("z", f64::NEG_INFINITY, 2.0));
/// assert!(low.contains(&Event::new("uav/3/goto").with("z", 1.5)));
/// assert!(!low.contains(&Event::new("uav/3/goto").with("z", 9.0)));
/// assert!(low.could_match_home("uav/3"));
/// assert!(!low.could_match_home("ground/main"));
/// ```
#[derive(Clone, PartialEq, Eq, Hash, Default)]
pub enum EventSet {
    #[default]
    None,
    All,
    /// One event, name and data.
    Exactly(Event),
    /// Events with a fitting name and any data.
    Named(Pattern),
    /// Events whose name starts with this text.
    Prefix(Arc<str>),
    /// Events with a number under `key` in `min..=max`; a whole number counts.
    FieldRange {
        /// The key of the datum.
        key: Arc<str>,
        /// The least number, in the unit the key names.
        min: Real,
        /// The greatest number.
        max: Real,
    },
    /// Events whose data has all of these.
    FieldIs(BTreeMap<Arc<str>, Value>),
    /// Events whose fields `x`, `y`, `z` (metres, ENU) lie in a box, borders included; a missing `z` fits, a missing
    /// `x` or `y` does not.
    Region {
        /// The least corner.
        min: [Real; 3],
        /// The greatest corner.
        max: [Real; 3],
    },
    Not(Box<EventSet>),
    /// Events in each of the sets; of no sets: every event.
    And(Vec<EventSet>),
    /// Events in one of the sets; of no sets: no event.
    Or(Vec<EventSet>),
}

impl EventSet {
    /// Events with exactly this name, and any data.
    pub fn named(name: impl Into<Arc<str>>) -> Self {
        Self::Named(Pattern::literal(name))
    }

    /// Events whose name starts with `prefix`.
    pub fn prefix(prefix: impl Into<Arc<str>>) -> Self {
        Self::Prefix(prefix.into())
    }

    /// Events with `value` under `key`.
    pub fn field_is(key: impl Into<Arc<str>>, value: impl Into<Value>) -> Self {
        Self::FieldIs(BTreeMap::from([(key.into(), value.into())]))
    }

    /// Events with a number under `key` in `min..=max`.
    pub fn field_range(key: impl Into<Arc<str>>, min: f64, max: f64) -> Self {
        Self::FieldRange { key: key.into(), min: min.into(), max: max.into() }
    }

    /// Events whose fields `x`, `y`, `z` (metres, ENU) lie between two corners.
    pub fn region(min: [f64; 3], max: [f64; 3]) -> Self {
        Self::Region { min: min.map(Real::from), max: max.map(Real::from) }
    }

    pub fn any_of<S: Into<EventSet>>(sets: impl IntoIterator<Item = S>) -> Self {
        sets.into_iter().fold(Self::None, |union, set| union.or(set))
    }

    /// Events in both sets.
    #[must_use]
    pub fn and(self, other: impl Into<EventSet>) -> Self {
        match (self, other.into()) {
            (Self::All, set) | (set, Self::All) => set,
            (Self::None, _) | (_, Self::None) => Self::None,
            (Self::And(mut sets), set) => {
                sets.push(set);
                Self::And(sets)
            }
            (a, b) => Self::And(vec![a, b]),
        }
    }

    /// Events in either set.
    #[must_use]
    pub fn or(self, other: impl Into<EventSet>) -> Self {
        match (self, other.into()) {
            (Self::None, set) | (set, Self::None) => set,
            (Self::All, _) | (_, Self::All) => Self::All,
            (Self::Or(mut sets), set) => {
                sets.push(set);
                Self::Or(sets)
            }
            (a, b) => Self::Or(vec![a, b]),
        }
    }

    /// Events outside the set; `!set` is the same.
    #[must_use]
    #[allow(clippy::should_implement_trait)] // It does; the method reads better at the end of a chain.
    pub fn not(self) -> Self {
        match self {
            Self::None => Self::All,
            Self::All => Self::None,
            Self::Not(set) => *set,
            set => Self::Not(Box::new(set)),
        }
    }

    /// Whether `event` is in the set.
    #[inline]
    pub fn contains(&self, event: &Event) -> bool {
        // Most sets that are asked are one of these.
        match self {
            Self::None => false,
            Self::All => true,
            Self::Named(pattern) => pattern.matches_event(event),
            set => set.holds(event),
        }
    }

    fn holds(&self, event: &Event) -> bool {
        count_node();
        match self {
            Self::None => false,
            Self::All => true,
            Self::Exactly(only) => only == event,
            Self::Named(pattern) => pattern.matches_event(event),
            Self::Prefix(prefix) => event.name().starts_with(&**prefix),
            Self::FieldRange { key, min, max } => event.real(key).is_some_and(|x| in_range(x, *min, *max)),
            Self::FieldIs(fields) => fields.iter().all(|(key, value)| event.get(key) == Some(value)),
            Self::Region { min, max } => in_region(event, min, max),
            Self::Not(set) => !set.contains(event),
            Self::And(sets) => sets.iter().all(|set| set.contains(event)),
            Self::Or(sets) => sets.iter().any(|set| set.contains(event)),
        }
    }

    /// Whether the set surely holds nothing.
    pub fn is_none(&self) -> bool {
        match self {
            Self::None => true,
            Self::Or(sets) => sets.iter().all(Self::is_none),
            Self::And(sets) => sets.iter().any(Self::is_none),
            _ => false,
        }
    }

    /// Whether the set may hold an event whose first two chunks are `home`. Errs towards yes.
    pub fn could_match_home(&self, home: &str) -> bool {
        self.may_reach(&Scope::new(Level::Home, home))
    }

    /// Whether the two sets may share an event, judged by names alone. Errs towards yes.
    pub fn may_overlap(&self, other: &EventSet) -> bool {
        let own = self.scopes();
        other.scopes().iter().any(|scope| own.iter().any(|own| own.overlaps(scope)))
    }

    /// Whether the set may hold an event of this name, with whatever data. Errs towards yes, only where what data it
    /// needs contradicts itself.
    pub fn may_hold_named(&self, name: &str) -> bool {
        count_node();
        match self {
            Self::None => false,
            Self::All | Self::FieldRange { .. } | Self::FieldIs(_) | Self::Region { .. } => true,
            Self::Exactly(only) => only.name() == name,
            Self::Named(pattern) => pattern.matches(name),
            Self::Prefix(prefix) => name.starts_with(&**prefix),
            Self::Not(set) => !set.holds_all_named(name),
            Self::And(sets) => sets.iter().all(|set| set.may_hold_named(name)),
            Self::Or(sets) => sets.iter().any(|set| set.may_hold_named(name)),
        }
    }

    /// Whether the set surely holds every event of this name, whatever its data. Errs towards no.
    pub fn holds_all_named(&self, name: &str) -> bool {
        count_node();
        match self {
            Self::All => true,
            Self::None | Self::Exactly(_) | Self::FieldRange { .. } | Self::Region { .. } => false,
            Self::FieldIs(fields) => fields.is_empty(),
            Self::Named(pattern) => pattern.matches(name),
            Self::Prefix(prefix) => name.starts_with(&**prefix),
            Self::Not(set) => !set.may_hold_named(name),
            Self::And(sets) => sets.iter().all(|set| set.holds_all_named(name)),
            Self::Or(sets) => sets.iter().any(|set| set.holds_all_named(name)),
        }
    }

    /// Whether every event of this set is surely in `other`. Errs towards no, also where it is too much to compare
    /// ([`Bound::SetSteps`]).
    pub fn is_within(&self, other: &EventSet) -> bool {
        let steps = || Bound::SetSteps.most().saturating_mul(self.extent().nodes + other.extent().nodes);
        self == other || Comparison { steps: steps() }.is_within(self, other)
    }

    /// The set without those alternatives that surely hold nothing of `other`, judged by names alone.
    pub fn about(&self, other: &EventSet) -> EventSet {
        match self {
            Self::Or(sets) => Self::any_of(sets.iter().map(|set| set.about(other))),
            Self::And(sets) => Self::And(sets.iter().map(|set| set.about(other)).collect()),
            set if set.may_overlap(other) => set.clone(),
            _ => Self::None,
        }
    }

    fn may_reach(&self, scope: &Scope<'_>) -> bool {
        self.scopes().iter().any(|own| own.overlaps(scope))
    }

    /// Scopes that together hold every event of the set; each once, and if one is that of any event, that alone.
    pub(crate) fn scopes(&self) -> Scopes<'_> {
        let mut scopes = Scopes::new();
        let widest = self.add_scopes(&mut scopes);
        if widest == Level::Any && !scopes.is_empty() {
            scopes.clear();
            scopes.push(Scope::ANY);
        } else if scopes.len() > 1 {
            scopes.sort_unstable_by_key(|scope| (scope.level, scope.key));
            scopes.dedup();
        }
        scopes
    }

    /// Adds the set's scopes, and gives the widest level among them; a set without scopes, which is empty, counts as the
    /// narrowest. Looks at each set inside once.
    fn add_scopes<'a>(&'a self, scopes: &mut Scopes<'a>) -> Level {
        count_node();
        let scope = match self {
            Self::None => return Level::Name,
            Self::Or(sets) => {
                return sets.iter().fold(Level::Name, |widest, set| widest.min(set.add_scopes(scopes)));
            }
            Self::And(sets) if !sets.is_empty() => return Self::add_narrowest(sets, scopes),
            Self::Exactly(event) => Scope::name(event.name(), event.keys()),
            Self::Named(pattern) => pattern.scope(),
            Self::Prefix(prefix) => Scope::starting_with(prefix),
            Self::And(_)
            | Self::All
            | Self::Not(_)
            | Self::FieldRange { .. }
            | Self::FieldIs(_)
            | Self::Region { .. } => Scope::ANY,
        };
        scopes.push(scope);
        scope.level
    }

    /// Any member bounds the whole of an intersection, so the narrowest one does best.
    fn add_narrowest<'a>(sets: &'a [EventSet], scopes: &mut Scopes<'a>) -> Level {
        let start = scopes.len();
        let mut narrowest = None;
        for set in sets {
            #[cfg(feature = "mutants")]
            if Bound::SetWalk.most() == usize::MAX {
                set.add_scopes(&mut Scopes::new());
            }
            let at = scopes.len();
            let level = set.add_scopes(scopes);
            if narrowest.is_none_or(|narrowest| level >= narrowest) {
                narrowest = Some(level);
                scopes.drain(start..at);
            } else {
                scopes.truncate(at);
            }
        }
        narrowest.unwrap_or(Level::Any)
    }

    /// Lets through what a set from outside may be.
    ///
    /// # Errors
    /// [`Exceeded`], which names the bound.
    pub fn check_bounds(&self) -> Result<(), Exceeded> {
        self.extent().check()?;
        self.check_all_names()
    }

    fn check_all_names(&self) -> Result<(), Exceeded> {
        match self {
            Self::Not(set) => set.check_all_names(),
            Self::And(sets) | Self::Or(sets) => sets.iter().try_for_each(Self::check_all_names),
            set => set.check_names(),
        }
    }

    /// Lets through the names that a set from outside may have; looks at no set inside it.
    ///
    /// # Errors
    /// [`Exceeded`] when a name is too long, or there are too many data.
    pub(crate) fn check_names(&self) -> Result<(), Exceeded> {
        match self {
            Self::Exactly(event) => event.check_bounds(),
            Self::Named(pattern) => check_name(pattern.as_str()),
            Self::Prefix(prefix) => check_name(prefix),
            Self::FieldRange { key, .. } => Bound::NameBytes.check(key.len()),
            Self::FieldIs(fields) => check_data(fields.iter().map(|(key, value)| (&**key, value))),
            _ => Ok(()),
        }
    }

    /// The extent of a set.
    pub fn extent(&self) -> Extent {
        match self {
            Self::Not(set) => Extent::around([set.extent()]),
            Self::And(sets) | Self::Or(sets) => Extent::around(sets.iter().map(Self::extent)),
            Self::FieldIs(fields) => Extent { nodes: 1 + fields.len(), depth: 1 },
            Self::Exactly(event) => Extent { nodes: 1 + event.data().len(), depth: 1 },
            _ => Extent { nodes: 1, depth: 1 },
        }
    }
}

/// The size of a set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extent {
    /// Sets inside it, itself and the data they ask for included.
    pub nodes: usize,
    /// Levels of sets inside one another, at least 1.
    pub depth: usize,
}

impl Extent {
    /// That of a set which is made of others.
    pub(crate) fn around(inside: impl IntoIterator<Item = Extent>) -> Self {
        inside.into_iter().fold(Self { nodes: 1, depth: 1 }, |all, one| Self {
            nodes: all.nodes.saturating_add(one.nodes),
            depth: all.depth.max(one.depth + 1),
        })
    }

    /// Lets through what a set from outside may be.
    ///
    /// # Errors
    /// [`Exceeded`] for [`Bound::SetDepth`] or [`Bound::SetNodes`].
    pub fn check(self) -> Result<Self, Exceeded> {
        Bound::SetDepth.check(self.depth)?;
        Bound::SetNodes.check(self.nodes)?;
        Ok(self)
    }
}

/// Most sets have one.
pub(crate) type Scopes<'a> = SmallVec<[Scope<'a>; 2]>;

/// The comparison of two sets: when it has taken too many steps, every answer is no.
struct Comparison {
    steps: usize,
}

impl Comparison {
    fn is_over(&mut self) -> bool {
        count_node();
        let over = self.steps == 0;
        self.steps = self.steps.saturating_sub(1);
        over
    }

    /// Whether every event of `inner` is surely in `outer`.
    fn is_within(&mut self, inner: &EventSet, outer: &EventSet) -> bool {
        use EventSet::{All, And, Exactly, Named, None, Not, Or, Prefix};
        if self.is_over() {
            return false;
        }
        match (inner, outer) {
            (None, _) | (_, All) => true,
            (Or(sets), outer) => sets.iter().all(|set| self.is_within(set, outer)),
            (inner, And(sets)) => sets.iter().all(|set| self.is_within(inner, set)),
            (inner, Or(sets)) if sets.iter().any(|set| self.is_within(inner, set)) => true,
            (And(sets), outer) if sets.iter().any(|set| self.is_within(set, outer)) => true,
            (Exactly(event), outer) => outer.contains(event),
            (inner, outer) if inner == outer => true,
            (inner, Not(set)) => self.is_apart(inner, set),
            (Named(inner), Named(outer)) => inner.is_within(outer),
            (Named(inner), Prefix(outer)) => inner.fixed_start().starts_with(&**outer),
            (Prefix(inner), Prefix(outer)) => inner.starts_with(&**outer),
            (Prefix(inner), Named(outer)) => {
                let start = outer.fixed_start();
                outer.as_str().strip_suffix("**") == Some(start) && inner.starts_with(start)
            }
            _ => false,
        }
    }

    /// Whether the two sets surely share no event.
    fn is_apart(&mut self, a: &EventSet, b: &EventSet) -> bool {
        use EventSet::{And, Named, Or};
        if self.is_over() {
            return false;
        }
        match (a, b) {
            (Or(sets), other) | (other, Or(sets)) => sets.iter().all(|set| self.is_apart(set, other)),
            (And(sets), other) | (other, And(sets)) => sets.iter().any(|set| self.is_apart(set, other)),
            (Named(a), Named(b)) => a.is_apart_from(b),
            (a, b) => !a.may_overlap(b),
        }
    }
}

fn in_range(x: f64, min: Real, max: Real) -> bool {
    min.get() <= x && x <= max.get()
}

fn in_region(event: &Event, min: &[Real; 3], max: &[Real; 3]) -> bool {
    let axes = ["x", "y", "z"].into_iter().zip(min).zip(max);
    axes.into_iter().all(|((axis, min), max)| match event.get(axis).map(Value::as_number) {
        Some(number) => number.is_some_and(|x| in_range(x, *min, *max)),
        None => axis == "z",
    })
}

impl std::ops::Not for EventSet {
    type Output = Self;

    fn not(self) -> Self {
        EventSet::not(self)
    }
}

impl From<&str> for EventSet {
    fn from(pattern: &str) -> Self {
        Self::Named(pattern.into())
    }
}

impl From<String> for EventSet {
    fn from(pattern: String) -> Self {
        Self::Named(Pattern::new(pattern))
    }
}

impl From<Pattern> for EventSet {
    fn from(pattern: Pattern) -> Self {
        Self::Named(pattern)
    }
}

impl From<Event> for EventSet {
    fn from(event: Event) -> Self {
        Self::Exactly(event)
    }
}

impl From<&Event> for EventSet {
    fn from(event: &Event) -> Self {
        Self::Exactly(event.clone())
    }
}

impl From<&EventSet> for EventSet {
    fn from(set: &EventSet) -> Self {
        set.clone()
    }
}

impl<S: Into<EventSet>, const N: usize> From<[S; N]> for EventSet {
    fn from(sets: [S; N]) -> Self {
        Self::any_of(sets)
    }
}

impl<S: Into<EventSet>> From<Vec<S>> for EventSet {
    fn from(sets: Vec<S>) -> Self {
        Self::any_of(sets)
    }
}

impl fmt::Display for EventSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::All => f.write_str("all"),
            Self::Exactly(event) => write!(f, "={event}"),
            Self::Named(pattern) => pattern.fmt(f),
            Self::Prefix(prefix) => write!(f, "{prefix}.."),
            Self::FieldRange { key, min, max } => write!(f, "{key} in {min}..={max}"),
            Self::FieldIs(fields) => {
                join(f, fields.iter().map(|(key, value)| format!("{key} = {value}")), " & ")
            }
            Self::Region { min, max } => {
                write!(f, "at [{}, {}, {}]", min[0], min[1], min[2])?;
                write!(f, "..=[{}, {}, {}]", max[0], max[1], max[2])
            }
            Self::Not(set) => write!(f, "!{set}"),
            Self::And(sets) => join(f, sets.iter(), " & "),
            Self::Or(sets) => join(f, sets.iter(), " | "),
        }
    }
}

/// Writes `(a | b | c)`.
fn join(
    f: &mut fmt::Formatter<'_>,
    parts: impl Iterator<Item = impl fmt::Display>,
    separator: &str,
) -> fmt::Result {
    f.write_str("(")?;
    for (at, part) in parts.enumerate() {
        write!(f, "{}{part}", if at == 0 { "" } else { separator })?;
    }
    f.write_str(")")
}

impl fmt::Debug for EventSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
