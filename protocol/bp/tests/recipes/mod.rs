//! Events, sets and bids made at random.

#![allow(dead_code)] // Each test file uses its part.

use proptest::prelude::*;
use skein_bp::{Bid, Event, EventSet};

pub fn event() -> impl Strategy<Value = Event> {
    (prop_oneof!["a/1/x", "a/1/y", "a/2/x", "b", "c"], prop::option::of(0..2_i64)).prop_map(|(name, k)| {
        match k {
            Some(k) => Event::new(name).with("k", k),
            None => Event::new(name),
        }
    })
}

pub fn set() -> impl Strategy<Value = EventSet> {
    prop_oneof![
        4 => Just(EventSet::None),
        3 => event().prop_map(EventSet::Exactly),
        2 => prop_oneof!["a/1/x", "a/\\*/x", "a/1/\\*\\*", "\\*\\*", "c"].prop_map(EventSet::from),
        1 => prop_oneof!["a", "a/", "a/1", "a/1/"].prop_map(EventSet::prefix),
        1 => event().prop_map(|event| EventSet::from(event).not()),
        1 => (event(), event()).prop_map(|(a, b)| EventSet::from([a, b])),
        1 => Just(EventSet::from("a/**").and(EventSet::field_is("k", 1))),
    ]
}

pub fn bid() -> impl Strategy<Value = Bid> {
    (
        prop::collection::vec(event(), 0..3),
        set(),
        set(),
        prop_oneof![5 => Just(EventSet::None), 1 => set()],
        prop::option::of(0..3),
    )
        .prop_map(|(requests, waits, blocks, interrupts, priority)| {
            let bid = requests.into_iter().fold(Bid::new(), Bid::request);
            let bid = bid.wait_for(waits).block(blocks).interrupt(interrupts);
            priority.map_or(bid.clone(), |priority| bid.priority(priority))
        })
}
