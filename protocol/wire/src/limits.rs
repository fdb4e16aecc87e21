//! The limits on a vehicle's motion that its b-threads state, taken together.

use std::sync::Arc;

use skein_bp::Event;

use crate::event::{Declared as _, Limit};

/// The tightest of the bounds that are stated, each with the b-thread that states it.
///
/// ```
/// use skein_wire::Limits;
/// use skein_wire::event::{Declared as _, Limit};
///
/// let low = Limit { max_z: Some(4.0), ..Limit::NONE }.at("uav/1");
/// let high = Limit { min_z: Some(6.0), speed_m_s: Some(1.0), ..Limit::NONE }.at("uav/1");
/// let limits = Limits::of("uav/1", [("low", &low)]);
/// assert_eq!(limits.region(), ([f64::NEG_INFINITY; 3], [f64::INFINITY, f64::INFINITY, 4.0]));
/// assert_eq!(limits.contradiction(), None);
/// let limits = Limits::of("uav/1", [("low", &low), ("high", &high)]);
/// assert_eq!(limits.speed_m_s(), 1.0);
/// assert_eq!(limits.contradiction().unwrap(), "high says `z not below 6 m`, and low says `z not above 4 m`");
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Limits {
    speed: Option<Bound>,
    min: [Option<Bound>; 3],
    max: [Option<Bound>; 3],
    /// A b-thread that has stated what is no limit.
    unreadable: Option<Arc<str>>,
}

#[derive(Clone, Debug, PartialEq)]
struct Bound {
    value: f64,
    whose: Arc<str>,
}

const AXES: [&str; 3] = ["x", "y", "z"];

impl Limits {
    /// Takes together what b-threads state of the vehicle `me`, each under its name. Statements about anything else
    /// are left alone.
    pub fn of<'a>(me: &str, stated: impl IntoIterator<Item = (&'a str, &'a Event)>) -> Self {
        let mut limits = Self::default();
        for (whose, event) in stated {
            let name = event.name().strip_prefix(me).and_then(|name| name.strip_prefix('/'));
            if name == Some(Limit::NAME) {
                match Limit::read(event).filter(|_| event.data().len() > 0) {
                    Some(limit) => limits.tighten(whose, &limit),
                    None => limits.unreadable = Some(whose.into()),
                }
            }
        }
        limits
    }

    /// These limits, and one more that `whose` states.
    #[must_use]
    pub fn with(mut self, whose: &str, limit: &Limit) -> Self {
        self.tighten(whose, limit);
        self
    }

    /// `whose` has stated a limit that cannot be read: no place is within all limits.
    pub fn note_unreadable(&mut self, whose: &str) {
        self.unreadable = Some(whose.into());
    }

    fn tighten(&mut self, whose: &str, limit: &Limit) {
        let &Limit { speed_m_s, min_x, min_y, min_z, max_x, max_y, max_z } = limit;
        at_most(&mut self.speed, speed_m_s, whose);
        for (bound, value) in self.max.iter_mut().zip([max_x, max_y, max_z]) {
            at_most(bound, value, whose);
        }
        for (bound, value) in self.min.iter_mut().zip([min_x, min_y, min_z]) {
            at_least(bound, value, whose);
        }
    }

    /// Whether nothing is limited.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// The greatest speed, m/s; infinite without a limit.
    pub fn speed_m_s(&self) -> f64 {
        self.speed.as_ref().map_or(f64::INFINITY, |bound| bound.value)
    }

    /// The least and the greatest coordinates, m ENU; infinite without a limit.
    pub fn region(&self) -> ([f64; 3], [f64; 3]) {
        let value = |bound: &Option<Bound>, none: f64| bound.as_ref().map_or(none, |bound| bound.value);
        (
            self.min.each_ref().map(|bound| value(bound, f64::NEG_INFINITY)),
            self.max.each_ref().map(|bound| value(bound, f64::INFINITY)),
        )
    }

    /// Why no place is within all limits, if none is: who says what.
    pub fn contradiction(&self) -> Option<String> {
        if let Some(whose) = &self.unreadable {
            return Some(format!("{whose} states a limit that cannot be read"));
        }
        let bounds = self.min.iter().zip(&self.max).zip(AXES);
        bounds.filter_map(|((min, max), axis)| Some((min.as_ref()?, max.as_ref()?, axis))).find_map(
            |(min, max, axis)| {
                (min.value > max.value).then(|| {
                    let (Bound { value: low, whose: a }, Bound { value: high, whose: b }) = (min, max);
                    format!("{a} says `{axis} not below {low} m`, and {b} says `{axis} not above {high} m`")
                })
            },
        )
    }

    /// Each bound in words, with whose it is: `script/low limits z to at most 4 m`.
    pub fn in_words(&self) -> Vec<String> {
        let mut words = Vec::new();
        let mut say = |bound: &Option<Bound>, of: &str, how: &str, unit: &str| {
            if let Some(Bound { value, whose }) = bound {
                words.push(format!("{whose} limits {of} to {how} {value} {unit}"));
            }
        };
        say(&self.speed, "speed", "at most", "m/s");
        for ((min, max), axis) in self.min.iter().zip(&self.max).zip(AXES) {
            say(min, axis, "at least", "m");
            say(max, axis, "at most", "m");
        }
        words
    }
}

fn at_most(bound: &mut Option<Bound>, value: Option<f64>, whose: &str) {
    if let Some(value) = value.filter(|value| bound.as_ref().is_none_or(|bound| *value < bound.value)) {
        *bound = Some(Bound { value, whose: whose.into() });
    }
}

fn at_least(bound: &mut Option<Bound>, value: Option<f64>, whose: &str) {
    if let Some(value) = value.filter(|value| bound.as_ref().is_none_or(|bound| *value > bound.value)) {
        *bound = Some(Bound { value, whose: whose.into() });
    }
}
