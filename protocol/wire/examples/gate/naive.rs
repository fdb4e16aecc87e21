//! The gate, guarded the naive way: look, then enter. Wrong, and shown for that.

use std::collections::BTreeSet;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::NodeName;

/// Requests the vehicle's `enter` when it has approached and nobody is inside as far as it has heard.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Naive {
    me: NodeName,
    approaching: bool,
    /// The homes of those who have entered and not left.
    inside: BTreeSet<String>,
}

impl Naive {
    pub fn new(me: &NodeName) -> Self {
        Self { me: me.clone(), approaching: false, inside: BTreeSet::new() }
    }
}

impl BThread for Naive {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().wait_for(["uav/*/enter", "uav/*/leave"]).wait_for(me.event_name("approach"));
        let free = self.approaching && self.inside.is_empty();
        Some(if free { bid.request(me.event_name("enter")) } else { bid })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        match event.kind() {
            "enter" => drop(self.inside.insert(event.home().to_owned())),
            "leave" => drop(self.inside.remove(event.home())),
            _ => {}
        }
        if event.home() == self.me.as_str() {
            self.approaching = event.kind() == "approach";
        }
    }
}
