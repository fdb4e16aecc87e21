//! Events to try a script with: for each set one inside, and some that miss it narrowly.

use std::collections::BTreeSet;

use crate::event::Event;
use crate::event_set::EventSet;
use crate::value::{Real, Value};

/// Most events that one set gives.
const MOST_PER_SET: usize = 64;
/// Stands for a chunk, a text or a name that is left open.
const ANY: &str = "any";
/// The distance beside a bound at which a number is tried.
const BESIDE: f64 = 1.0;

/// Events in and beside the sets.
pub(super) fn samples<'a>(sets: &'a [&'a EventSet]) -> impl Iterator<Item = Event> + 'a {
    sets.iter().flat_map(|set| branches(set)).flat_map(|branch| {
        let mut facets = Facets::default();
        facets.look_at(branch);
        facets.events()
    })
}

/// The sets of which a set is the union.
fn branches(set: &EventSet) -> Vec<&EventSet> {
    match set {
        EventSet::Or(sets) => sets.iter().flat_map(branches).collect(),
        other => vec![other],
    }
}

/// The marks by which a set distinguishes events.
#[derive(Default)]
struct Facets {
    whole: Vec<Event>,
    names: BTreeSet<String>,
    /// Each a choice of data; one of each is put together.
    choices: Vec<Vec<Vec<(String, Value)>>>,
}

impl Facets {
    fn look_at(&mut self, set: &EventSet) {
        match set {
            EventSet::None | EventSet::All => {}
            EventSet::Exactly(event) => self.whole.push(event.clone()),
            EventSet::Named(pattern) => {
                let chunks =
                    pattern.as_str().split('/').map(|chunk| if chunk.starts_with('*') { ANY } else { chunk });
                self.names.insert(chunks.collect::<Vec<_>>().join("/"));
            }
            EventSet::Prefix(prefix) => drop(self.names.insert(format!("{prefix}{ANY}"))),
            EventSet::FieldRange { key, min, max } => {
                let numbers = [inside(*min, *max), min.get() - BESIDE, max.get() + BESIDE];
                let choice = |x: &f64| vec![(key.to_string(), Value::from(*x))];
                self.choices.push(numbers.iter().filter(|x| x.is_finite()).map(choice).collect());
            }
            EventSet::FieldIs(fields) => {
                let all = fields.iter().map(|(key, value)| (key.to_string(), value.clone())).collect();
                self.choices.push(vec![all, Vec::new()]);
            }
            EventSet::Region { min, max } => {
                let [x, y, z] = [0, 1, 2].map(|axis| inside(min[axis], max[axis]));
                let far = [max[0].get() + BESIDE, min[0].get() - BESIDE].into_iter().find(|x| x.is_finite());
                let point = |x: f64| {
                    let axes = [("x", x), ("y", y), ("z", z)];
                    axes.map(|(axis, coordinate)| (axis.to_owned(), Value::from(coordinate))).to_vec()
                };
                self.choices.push([Some(x), far].into_iter().flatten().map(point).collect());
            }
            EventSet::Not(set) => self.look_at(set),
            EventSet::And(sets) | EventSet::Or(sets) => sets.iter().for_each(|set| self.look_at(set)),
        }
    }

    fn events(self) -> Vec<Event> {
        let names =
            if self.names.is_empty() && self.whole.is_empty() { [ANY.to_owned()].into() } else { self.names };
        let mut events: Vec<Event> =
            self.whole.into_iter().chain(names.into_iter().map(Event::new)).collect();
        for choice in self.choices {
            let with = |event: &Event, data: &Vec<(String, Value)>| {
                data.iter().fold(event.clone(), |event, (key, value)| event.with(key.as_str(), value.clone()))
            };
            events =
                events.iter().flat_map(|event| choice.iter().map(move |data| with(event, data))).collect();
            events.truncate(MOST_PER_SET);
        }
        events
    }
}

/// A number between two bounds, of which either may be missing.
fn inside(min: Real, max: Real) -> f64 {
    match (min.get(), max.get()) {
        (min, max) if min.is_finite() && max.is_finite() => (min + max) / 2.0,
        (min, _) if min.is_finite() => min,
        (_, max) if max.is_finite() => max,
        _ => 0.0,
    }
}
