//! A part of the world as an automaton, written down as a table.

use std::hash::{Hash, Hasher};
use std::sync::Arc;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};

/// One part of what is around a vehicle's program: places, and the events by which it goes from one to another.
///
/// As a b-thread it requests what it offers, waits for what it hears, and blocks what cannot be in that place.
#[derive(Clone, Debug, Serialize)]
pub struct Part {
    #[serde(skip)]
    places: Arc<Vec<Place>>,
    at: Arc<str>,
    #[serde(skip)]
    priority: Option<i32>,
}

/// A place of a [`Part`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    name: Arc<str>,
    offers: Vec<(Event, Arc<str>)>,
    hears: Vec<(EventSet, Arc<str>)>,
    rules_out: EventSet,
}

impl Place {
    /// A place where nothing happens yet.
    pub fn new(name: impl Into<Arc<str>>) -> Self {
        Self { name: name.into(), offers: Vec::new(), hears: Vec::new(), rules_out: EventSet::None }
    }

    /// `event` may happen here at any time, and leads to the place `to`.
    #[must_use]
    pub fn offers(mut self, event: Event, to: impl Into<Arc<str>>) -> Self {
        self.offers.push((event, to.into()));
        self
    }

    /// `event` may happen here again and again, and changes nothing.
    #[must_use]
    pub fn keeps_offering(self, event: Event) -> Self {
        let here = self.name.clone();
        self.offers(event, here)
    }

    /// When an event of `set` happens, it leads to the place `to`. The first set that holds the event counts.
    #[must_use]
    pub fn hears(mut self, set: EventSet, to: impl Into<Arc<str>>) -> Self {
        self.hears.push((set, to.into()));
        self
    }

    /// Events of `set` cannot happen as long as the part is here.
    #[must_use]
    pub fn rules_out(mut self, set: EventSet) -> Self {
        self.rules_out = self.rules_out.or(set);
        self
    }
}

impl Part {
    /// A part that begins in the first of these places.
    pub fn new(places: Vec<Place>) -> Self {
        let at = places.first().map_or_else(|| "".into(), |place| place.name.clone());
        Self { places: Arc::new(places), at, priority: None }
    }

    pub fn of_one(place: Place) -> Self {
        Self::new(vec![place])
    }

    /// What it requests has this priority: it stands for another node's b-thread, whose bid is on this vehicle's board.
    #[must_use]
    pub fn with_priority(mut self, priority: i32) -> Self {
        self.priority = Some(priority);
        self
    }

    /// The name of the place where it is.
    pub fn place(&self) -> &str {
        &self.at
    }

    fn here(&self) -> Option<&Place> {
        self.places.iter().find(|place| place.name == self.at)
    }
}

impl BThread for Part {
    fn bid(&self) -> Option<Bid> {
        let here = self.here()?;
        let bid = here.offers.iter().fold(Bid::new(), |bid, (event, _)| bid.request(event.clone()));
        let bid = here.hears.iter().fold(bid, |bid, (set, _)| bid.wait_for(set.clone()));
        let bid = bid.block(here.rules_out.clone());
        Some(self.priority.into_iter().fold(bid, Bid::priority))
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        let Some(here) = self.here() else { return };
        let offered = here.offers.iter().find(|(offer, _)| offer == event).map(|(_, to)| to);
        let heard = || here.hears.iter().find(|(set, _)| set.contains(event)).map(|(_, to)| to);
        if let Some(to) = offered.or_else(heard).cloned() {
            self.at = to;
        }
    }
}

impl PartialEq for Part {
    fn eq(&self, other: &Self) -> bool {
        self.at == other.at && (Arc::ptr_eq(&self.places, &other.places) || self.places == other.places)
    }
}

impl Eq for Part {}

impl Hash for Part {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.at.hash(state);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_goes_where_its_table_says() {
        let mut tap = Part::new(vec![
            Place::new("shut").offers("opens".into(), "open").rules_out("flows".into()),
            Place::new("open").keeps_offering("flows".into()).hears("shuts".into(), "shut"),
        ]);
        let mut cx = Context::at(std::time::Duration::ZERO);
        assert!(tap.bid().unwrap().blocks().contains(&"flows".into()));
        for (event, place) in [("flows", "shut"), ("opens", "open"), ("flows", "open"), ("shuts", "shut")] {
            tap.resume(&event.into(), &mut cx);
            assert_eq!(tap.place(), place, "after {event}");
        }
    }
}
