//! Sets of events, as they stand in scripts and kept files (JSON), and inside messages (protobuf).

use prost::Message as _;
use skein_bp::{Event, EventSet};
use skein_wire::proto;

use crate::target::{Allowed, Reached, Target};

pub const TARGET: Target =
    Target { name: "event_sets", allowed: Allowed { bytes: 16 << 10, per_byte: 400 }, read, seeds };

fn read(input: &[u8]) -> Reached {
    let in_text = serde_json::from_slice::<EventSet>(input).ok();
    let in_message = proto::EventSet::decode(input).ok().and_then(|form| EventSet::try_from(form).ok());
    let reached = in_text
        .into_iter()
        .chain(in_message)
        .map(|set| follow(&set))
        .max_by_key(|reached| u8::from(*reached == Reached::Planted));
    reached.unwrap_or(Reached::Refused)
}

/// Writes and reads a set, and asks it what nodes ask of sets.
fn follow(set: &EventSet) -> Reached {
    assert_eq!(set.check_bounds(), Ok(()));
    let text = serde_json::to_string(set).expect("a set is written");
    let again: EventSet = serde_json::from_str(&text).expect("what was written is read");
    assert_eq!(serde_json::to_string(&again).expect("a set is written"), text);
    let form = proto::EventSet::from(set);
    let from_message = EventSet::try_from(form.clone()).expect("what was written is read");
    assert_eq!(proto::EventSet::from(&from_message).encode_to_vec(), form.encode_to_vec());
    let event = Event::new("uav/1/goto").with("x", 1.0).with("y", 2.0).with("z", 3.0);
    assert_eq!(set.contains(&event), from_message.contains(&event));
    if set.contains(&event) {
        assert!(set.may_hold_named(event.name()) && set.could_match_home("uav/1"));
        assert!(set.may_overlap(&EventSet::from(event.clone())));
        assert!(!set.clone().not().contains(&event));
    }
    let other = EventSet::named("uav/*/goto").or("ground/main/ordered");
    if set.is_within(&other) && set.contains(&event) {
        assert!(other.contains(&event));
    }
    if set.holds_all_named(event.name()) {
        assert!(set.contains(&event));
    }
    Reached::read(matches!(set, EventSet::Or(sets) if sets.len() == 4))
}

fn sets() -> Vec<(&'static str, EventSet)> {
    let goto = Event::new("uav/1/goto").with("x", 1.0).with("why", "because").with("n", 3);
    vec![
        ("exactly", EventSet::from(goto)),
        ("named", EventSet::named("uav/*/enter/**").or("ground/main/ordered")),
        ("range", EventSet::field_range("z", 0.0, f64::INFINITY).and(EventSet::prefix("uav/1/").not())),
        (
            "region",
            EventSet::region([0.0; 3], [f64::INFINITY, 2.0, 3.0]).or(EventSet::field_is("armed", true)),
        ),
        ("none", EventSet::None),
    ]
}

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let text = |set: &EventSet| serde_json::to_vec(set).expect("a set is written");
    let mut seeds: Vec<_> = sets().iter().map(|(name, set)| (*name, text(set))).collect();
    let names = ["exactly.binary", "named.binary", "range.binary", "region.binary", "none.binary"];
    seeds.extend(
        names
            .into_iter()
            .zip(sets())
            .map(|(name, (_, set))| (name, proto::EventSet::from(&set).encode_to_vec())),
    );
    seeds
}
