//! A vehicle that is lost inside the gate: its block stays until the operator lifts it.

use std::error::Error;
use std::time::Duration;

use skein_bp::catalogue::Declared as _;
use skein_bp::script::{Op, Script};
use skein_bp::{Bid, Program};
use skein_dbp::{Happened, Lift, NodeName};

use crate::fleet::{Fleet, GROUND, VEHICLES};
use crate::guarded::{self, Care, Guarded};
use crate::trip::Trip;

/// How often vehicles entered in each part of the story.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Story {
    /// While the first vehicle is lost inside.
    pub lost: u32,
    /// After it has started again.
    pub back: u32,
    /// After its block was lifted.
    pub lifted: u32,
}

/// The length of each part.
const PART: Duration = Duration::from_secs(10);

fn vehicle(me: &NodeName, program: &mut Program) {
    program.add("trip", Trip::new(me, Duration::from_secs(1)));
    guard(me, program);
}

fn guard(me: &NodeName, program: &mut Program) {
    program.add(guarded::NAME, Guarded::new(me.clone(), Care::ForGood));
}

/// The operator's word `ground/main/let_go` becomes a request at each home that keeps the block.
fn ground(lost: &NodeName) -> Result<Script, Box<dyn Error>> {
    let lift = |home: &&str| {
        let lift = Lift { node: lost.clone(), bthread: guarded::NAME.into() };
        Op::Sync(Bid::new().request(lift.at(home)))
    };
    let told = Op::Sync(Bid::new().wait_for(format!("{GROUND}/let_go")));
    let homes = VEHICLES.iter().filter(|home| **home != lost.as_str());
    Ok(Script::new(&[told].into_iter().chain(homes.map(lift)).collect::<Vec<_>>())?)
}

pub fn fly(seed: u64) -> Result<Story, Box<dyn Error>> {
    let lost = NodeName::new(VEHICLES[0])?;
    let lifting = ground(&lost)?;
    let mut fleet = Fleet::new(seed)?;
    fleet.start(GROUND, 1, |_, program| drop(program.add("lift", lifting)))?;
    for me in VEHICLES {
        fleet.start(me, 1, vehicle)?;
    }
    let enters_here = |seen: &Happened| seen.home == lost && seen.event.kind() == "enter";
    while !fleet.tick()?.iter().any(enters_here) {}
    fleet.stop(&lost);
    let while_lost = entries(&mut fleet)?;
    // Its new life knows of no claim, and does not fly.
    fleet.start(lost.as_str(), 2, guard)?;
    let back = entries(&mut fleet)?;
    fleet.tell(GROUND, format!("{GROUND}/let_go"));
    Ok(Story { lost: while_lost, back, lifted: entries(&mut fleet)? })
}

fn entries(fleet: &mut Fleet) -> Result<u32, Box<dyn Error>> {
    let (mut entries, end) = (0, fleet.now() + PART);
    while fleet.now() < end {
        entries += fleet.tick()?.iter().map(|seen| u32::from(seen.event.kind() == "enter")).sum::<u32>();
    }
    Ok(entries)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_enters_until_the_block_of_the_lost_one_is_lifted() {
        for seed in 0..50 {
            let story = fly(seed).unwrap();
            assert_eq!((story.lost, story.back), (0, 0), "seed {seed}");
            assert!(story.lifted > 0, "seed {seed}: {story:?}");
        }
    }
}
