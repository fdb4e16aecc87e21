//! Which way the gate is flown: decided once, and known to all before it counts.

use std::error::Error;
use std::time::Duration;

use serde::Serialize;
use skein_bp::script::{Op, Script};
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::NodeName;

use crate::fleet::{Fleet, GROUND, VEHICLES};
use crate::guarded::{self, Care, Guarded};
use crate::trip::Trip;

/// Keeps a vehicle out of the gate between `swarm/close` and `swarm/open`, and knows the way since.
///
/// Nobody acts on a decision before everybody has learned the one before. So where one vehicle has heard `open`, all
/// have heard `close`, and none enters the old way any more.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct OneWay {
    me: NodeName,
    way: Option<String>,
}

impl OneWay {
    pub fn new(me: &NodeName) -> Self {
        Self { me: me.clone(), way: None }
    }
}

impl BThread for OneWay {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().wait_for(["swarm/close", "swarm/open"]);
        Some(if self.way.is_none() { bid.block(self.me.event_name("enter")) } else { bid })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.way = event.text("way").map(Into::into);
    }
}

/// At the coordinator: for each of these ways, closes the gate at the operator's word and opens it for the new way.
fn traffic(ways: &[&str]) -> Result<Script, Box<dyn Error>> {
    let turn = |way: &&str| {
        [
            Op::Sync(Bid::new().wait_for(format!("{GROUND}/turn"))),
            Op::Sync(Bid::new().request("swarm/close")),
            Op::Sync(Bid::new().request(Event::new("swarm/open").with("way", *way))),
        ]
    };
    Ok(Script::new(&ways.iter().flat_map(turn).collect::<Vec<_>>())?)
}

/// The time for which each way is flown.
const TURN: Duration = Duration::from_secs(30);

/// The way in which each entry was flown, in order.
pub fn fly(ways: &[&str], seed: u64) -> Result<Vec<String>, Box<dyn Error>> {
    let traffic = traffic(ways)?;
    let mut fleet = Fleet::new(seed)?;
    fleet.start(GROUND, 1, |_, program| drop(program.add("traffic", traffic)))?;
    for me in VEHICLES {
        fleet.start(me, 1, |name, program| {
            program.add("trip", Trip::new(name, Duration::from_secs(1)));
            program.add(guarded::NAME, Guarded::new(name.clone(), Care::ForGood));
            program.add("one way", OneWay::new(name));
        })?;
    }
    let mut flown = Vec::new();
    for part in (1..).take(ways.len()) {
        fleet.tell(GROUND, format!("{GROUND}/turn"));
        while fleet.now() < part * TURN {
            for entry in fleet.tick()?.into_iter().filter(|occurred| occurred.event.kind() == "enter") {
                let one_way =
                    fleet.node(&entry.home).and_then(|node| node.program().state_of::<OneWay>("one way"));
                flown.extend(one_way.and_then(|one_way| one_way.way.clone()));
            }
        }
    }
    Ok(flown)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_flies_the_old_way_once_one_flies_the_new_way() {
        let ways = ["north", "south", "east"];
        for seed in 0..20 {
            let mut flown = fly(&ways, seed).unwrap();
            assert!(flown.len() > 6, "seed {seed}: {flown:?}");
            flown.dedup();
            assert_eq!(flown, ways, "seed {seed}");
        }
    }
}
