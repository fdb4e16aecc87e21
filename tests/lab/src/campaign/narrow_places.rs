//! `campaign narrow-places`: right of way on real nodes, explored to the end: vehicles against one another through two
//! narrow places, with every order of messages and a few faults. Nobody shares a place with one that goes against it,
//! and nobody stands for ever while nothing more happens.
//!
//! A b-thread plays the flight: it tells what lies ahead and where it is, and moves on with leave to move alone.

use std::time::{Duration, Instant};

use clap::Args;
use serde::Serialize;
use serde_json::json;
use skein_agent::Me;
use skein_agent::bthreads::{RIGHT_OF_WAY, RightOfWay};
use skein_bp::verify::{Inspection, Omission, Report};
use skein_bp::{BThread, Bid, Context, Event, Program, ProgramConfig};
use skein_dbp::verify::{Faults, Member, NetworkVerifier, NetworkView};
use skein_dbp::{NodeConfig, NodeName};
use skein_sim::cli::Exit;
use skein_wire::event::{Advance, Leave, Passage};

use crate::experiment::naive_right_of_way::NaiveRightOfWay;
use crate::task::Task;

/// Lease of the nodes; in a verification time has no length.
const LEASE: Duration = Duration::from_secs(1);
/// A time in flight, which in a verification may pass at any move.
const FLIES_FOR: Duration = Duration::from_secs(5);
/// The b-thread that plays the flight.
const FLIGHT: &str = "flight";

/// The narrow places from west to east, m.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, clap::ValueEnum)]
enum Places {
    /// Far from one another: each is claimed by itself, and there is room between them.
    Apart,
    /// Next to one another: one stretch, entered place by place.
    Joined,
}

/// The rule by which the vehicles share them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Rule {
    /// As the fleet flies.
    Flown,
    /// Enter where nobody is heard to be.
    Naive,
}

#[derive(Args, Clone, Copy)]
pub struct NarrowPlaces {
    /// Vehicles: those with odd numbers fly east, the others west.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u8).range(2..=3))]
    vehicles: u8,
    /// The two places.
    #[arg(long, value_enum, default_value_t = Places::Apart)]
    places: Places,
    /// The rule.
    #[arg(long, value_enum, default_value_t = Rule::Flown)]
    rule: Rule,
    /// Leases that may lapse.
    #[arg(long, value_name = "N", default_value_t = 1)]
    lapses: u32,
    /// Messages that may arrive twice.
    #[arg(long, value_name = "N", default_value_t = 0)]
    repeats: u32,
    /// Cuts between two vehicles, each healed again.
    #[arg(long, value_name = "N", default_value_t = 0)]
    partitions: u32,
    /// States to look at, at most.
    #[arg(long, value_name = "N", default_value_t = 2_000_000)]
    most_states: usize,
}

impl Task for NarrowPlaces {
    const NAME: &'static str = "narrow-places";
    const ABOUT: &'static str =
        "Right of way on real nodes through two narrow places, every run with a few faults explored";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let began = Instant::now();
        let Report { verdict, states, edges, depth, not_covered, .. } = self.verify()?;
        let seconds = began.elapsed().as_secs_f64();
        if as_json {
            let left_out: Vec<String> = not_covered.iter().map(Omission::to_string).collect();
            let object = json!({
                "vehicles": self.vehicles,
                "states": states,
                "moves": edges,
                "depth": depth,
                "seconds": seconds,
                "verdict": verdict.as_ref().map(ToString::to_string),
                "not_covered": left_out,
            });
            println!("{object}");
        } else {
            println!("{states} states, {edges} moves, at most {depth} one after another, {seconds:.1} s");
            not_covered.iter().for_each(|what| println!("not covered: {what}"));
            println!("{}", verdict.as_ref().map_or_else(|| "sound".to_owned(), ToString::to_string));
        }
        Ok(Exit::of(verdict.is_none()))
    }
}

impl NarrowPlaces {
    fn verify(&self) -> anyhow::Result<Report> {
        let names = (1..=self.vehicles).map(|number| format!("uav/{number}")).collect::<Vec<_>>();
        let members = (1..).zip(&names).map(|(number, name)| self.member(number, name, &names));
        // Who claims again and again may have any number of older records on their way.
        let faults = Faults {
            delay: false,
            lapses: self.lapses,
            repeats: self.repeats,
            partitions: self.partitions,
            ..Faults::default()
        };
        let verifier = NetworkVerifier::new(members.collect::<Result<_, _>>()?, faults)
            .inspect([Inspection::FailedAssertion, Inspection::HotTermination])
            .invariant("nobody shares a narrow place", nobody_shares_a_place)
            .most_states(self.most_states);
        Ok(verifier.run())
    }

    fn member(&self, number: usize, name: &str, all: &[String]) -> anyhow::Result<Member> {
        let me = Me::new(name);
        let mut program = Program::new(ProgramConfig::vehicle(0));
        let others = all.iter().map(String::as_str).filter(|other| *other != name);
        match self.rule {
            Rule::Flown => program.add(RIGHT_OF_WAY, RightOfWay::new(me.clone(), others, LEASE)),
            Rule::Naive => program.add(RIGHT_OF_WAY, NaiveRightOfWay::new(me.clone())),
        };
        program.add(FLIGHT, Flight::new(me, self.places, number % 2 == 1));
        Ok(Member {
            config: NodeConfig::new(NodeName::new(name)?, 1, Vec::new()),
            program,
            may_restart: false,
        })
    }
}

/// A place of the way: metres east of the first, and the heading in degrees.
type Place = (i32, i32);

/// One vehicle's way through its stretches, one after the other.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Flight {
    me: Me,
    /// Its stretches that are not behind it, the last first; of the one at hand the places that are not.
    ahead: Vec<Vec<Place>>,
    stage: Stage,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
enum Stage {
    /// It flies through the open, for any time.
    Open,
    /// It has seen the stretch, and is to tell of it.
    Seen,
    /// It flies on when it may.
    Before,
    /// It has flown into the next place, and is to tell so.
    Into,
    /// It flies through the place, for any time.
    Through,
    /// It is at the end of the place, and flies on when it may.
    AtEnd,
    /// It has flown out, and is to tell so.
    Out,
}

impl Flight {
    fn new(me: Me, places: Places, is_eastward: bool) -> Self {
        let stretches: &[&[i32]] = match places {
            Places::Apart => &[&[0], &[40]],
            Places::Joined => &[&[0, 2]],
        };
        let heading = if is_eastward { 0 } else { 180 };
        let mut ahead: Vec<Vec<Place>> =
            stretches.iter().map(|places| places.iter().map(|x| (*x, heading)).collect()).collect();
        if is_eastward {
            ahead.reverse();
        } else {
            ahead.iter_mut().for_each(|stretch| stretch.reverse());
        }
        Self { me, ahead, stage: Stage::Open }
    }

    /// The place that it is in.
    fn inside(&self) -> Option<Place> {
        let is_inside = matches!(self.stage, Stage::Into | Stage::Through | Stage::AtEnd);
        self.ahead.last().and_then(|stretch| stretch.first()).copied().filter(|_| is_inside)
    }

    /// The word of the stretch at hand.
    fn passage(&self) -> Option<Event> {
        let text = |(x, heading): &Place| format!("{x} 0 2 {heading}");
        let stretch = self.ahead.last()?;
        let way = stretch.iter().map(text).collect::<Vec<_>>().join("; ");
        let here = self.inside().map(|place| text(&place).as_str().into());
        let (x, _) = stretch.first()?;
        let at = Passage { x: f64::from(*x), y: 0.0, z: 2.0, way: Some(way.as_str().into()), here };
        Some(self.me.event(at))
    }
}

impl BThread for Flight {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().hot();
        if self.ahead.is_empty() {
            return None;
        }
        Some(match self.stage {
            Stage::Open | Stage::Through => bid.deadline(FLIES_FOR),
            Stage::Seen | Stage::Into => bid.request(self.passage()?),
            Stage::Before | Stage::AtEnd => bid.request(self.me.event(Advance::ANYWHERE)),
            Stage::Out => bid.request(self.me.event(Leave)),
        })
    }

    fn resume(&mut self, _: &Event, _: &mut Context) {
        self.stage = match self.stage {
            Stage::Open => Stage::Seen,
            Stage::Seen => Stage::Before,
            Stage::Before => Stage::Into,
            Stage::Into => Stage::Through,
            Stage::Through => Stage::AtEnd,
            Stage::AtEnd => {
                let stretch = self.ahead.last_mut();
                let is_last = stretch.is_none_or(|stretch| {
                    stretch.remove(0);
                    stretch.is_empty()
                });
                if is_last { Stage::Out } else { Stage::Into }
            }
            Stage::Out => {
                self.ahead.pop();
                Stage::Open
            }
        };
    }
}

fn nobody_shares_a_place(view: &NetworkView<'_>) -> Result<(), String> {
    let inside = view.programs().filter_map(|(name, program)| {
        let (x, heading) = program.state_of::<Flight>(FLIGHT)?.inside()?;
        Some((name, x, heading))
    });
    let inside: Vec<_> = inside.collect();
    for (one, place, heading) in &inside {
        if let Some((other, ..)) = inside.iter().find(|other| other.1 == *place && other.2 != *heading) {
            return Err(format!("{one} and {other} meet inside"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verified(places: Places, rule: Rule) -> Report {
        let campaign = NarrowPlaces {
            vehicles: 2,
            places,
            rule,
            lapses: 0,
            repeats: 0,
            partitions: 0,
            most_states: 8_000,
        };
        campaign.verify().expect("it can be explored")
    }

    #[test]
    fn in_the_first_thousands_of_states_two_real_nodes_share_no_narrow_place() {
        for places in [Places::Apart, Places::Joined] {
            let report = verified(places, Rule::Flown);
            assert!(report.verdict.is_none(), "{:?}", report.verdict);
        }
    }

    #[test]
    fn the_naive_rule_is_found_out() {
        let found = verified(Places::Apart, Rule::Naive).verdict.expect("they meet");
        assert!(found.to_string().contains("meet inside"), "{found}");
    }
}
