//! The naive rule and the guarded ones side by side.

use std::collections::BTreeSet;
use std::error::Error;
use std::ops::Range;
use std::time::Duration;

use skein_dbp::NodeName;

use crate::fleet::{Fleet, VEHICLES};
use crate::guarded::{self, Care, Guarded};
use crate::naive::Naive;
use crate::trip::Trip;

/// The length of each run.
const RUN: Duration = Duration::from_secs(20);
/// When one vehicle is cut off, where one is.
const CUT: Range<Duration> = Duration::from_secs(8)..Duration::from_secs(12);

/// The rule by which the gate is guarded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Look, then enter.
    Naive,
    /// Block, then enter.
    Guarded(Care),
}

/// The tally of many runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    pub entries: u32,
    /// Entries while another vehicle was inside.
    pub shared: u32,
    /// The first seed in which that happened.
    pub first_shared: Option<u64>,
}

/// Who is inside, by what has occurred at the vehicles themselves.
#[derive(Debug, Default)]
struct Gate {
    inside: BTreeSet<NodeName>,
    tally: Tally,
}

impl Gate {
    fn note(&mut self, vehicle: NodeName, verb: &str) {
        match verb {
            "enter" => {
                self.tally.entries += 1;
                self.tally.shared += u32::from(!self.inside.is_empty());
                self.inside.insert(vehicle);
            }
            "leave" => drop(self.inside.remove(&vehicle)),
            _ => {}
        }
    }
}

/// Flies every seed; `cut` says whether a vehicle is cut off for a while in each.
pub fn fly_all(rule: Rule, cut: bool, seeds: Range<u64>) -> Result<Tally, Box<dyn Error>> {
    let mut tally = Tally::default();
    for seed in seeds {
        let Tally { entries, shared, .. } = fly(rule, cut, seed)?;
        tally.entries += entries;
        tally.shared += shared;
        tally.first_shared = tally.first_shared.or((shared > 0).then_some(seed));
    }
    Ok(tally)
}

fn fly(rule: Rule, cut: bool, seed: u64) -> Result<Tally, Box<dyn Error>> {
    let mut fleet = Fleet::new(seed)?;
    for (me, rest_ms) in VEHICLES.into_iter().zip([700, 1100, 1300]) {
        fleet.start(me, 1, |name, program| {
            program.add("trip", Trip::new(name, Duration::from_millis(rest_ms)));
            match rule {
                Rule::Naive => program.add("look", Naive::new(name)),
                Rule::Guarded(care) => program.add(guarded::NAME, Guarded::new(name.clone(), care)),
            };
        })?;
    }
    let mut gate = Gate::default();
    while fleet.now() < RUN {
        let whom = usize::try_from(seed)? % VEHICLES.len();
        fleet.cut_off(Some(whom).filter(|_| cut && CUT.contains(&fleet.now())));
        for occurred in fleet.tick()? {
            gate.note(occurred.home, occurred.event.kind());
        }
    }
    Ok(gate.tally)
}
