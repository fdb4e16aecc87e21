//! Right of way: `window` flown by blocks that are confirmed before a vehicle enters, and by the naive rule that
//! enters where nobody is heard, over the network of the scenario and over a slow one that loses messages.

use std::collections::BTreeMap;

use clap::Args;
use serde_json::json;
use skein_agent::stretch::Stretch;
use skein_agent::{BThreads, Mind, Parts};
use skein_bp::Event;
use skein_dbp::{Happened, NodeName};
use skein_sim::cli::Controller;
use skein_sim::fly::Trial;
use skein_sim::scenario::Scenario;
use skein_wire::event::{Declared as _, Enter, GiveWay, Landed, Leave, Passage};

use super::naive_right_of_way::Naive;
use crate::figure::{Figure, Line, Style};
use crate::numbers::one_or_more;
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::runs;
use crate::statistics::mean;

const RUNS: usize = 20;
/// Makes the mind that follows a rule.
type Rule = fn() -> Box<dyn Mind>;
const RULES: [(Rule, &str); 2] = [(|| Box::new(BThreads), "confirmed"), (|| Box::new(Naive), "naive")];
/// A network that is slow and loses messages: mean latency, milliseconds, and the share lost.
const SLOW: (f64, f64) = (100.0, 0.2);
/// Two places nearer than this, per horizontal axis and in height, are one, metres.
const SAME_PLACE_M: f64 = 1.2;
const SAME_HEIGHT_M: f64 = 2.2;
/// Headings that differ by less are the same way, degrees, a rounded degree allowed for.
const SAME_WAY_DEG: f64 = 61.0;

/// The vehicles in narrow places.
#[derive(Debug, Clone, Default)]
struct Narrow {
    /// What each has entered and not left behind: its `enter`s.
    inside: BTreeMap<NodeName, Vec<Event>>,
    entries: usize,
    /// Entries into a place through which somebody else goes another way.
    shared: usize,
    most_at_once: usize,
    /// Times of changes, seconds, and the number inside from then on.
    over_time: Vec<(f64, f64)>,
}

impl Narrow {
    fn watch(&mut self, now_s: f64, happened: &Happened) {
        let before = self.inside.len();
        match happened.event.kind() {
            Enter::NAME => {
                let others = self.inside.iter().filter(|(home, _)| **home != happened.home);
                let mut others = others.flat_map(|(_, entered)| entered);
                self.entries += 1;
                self.shared += usize::from(others.any(|other| go_against(other, &happened.event)));
                // Entered another way, it is not flown through the former.
                let entered = self.inside.entry(happened.home.clone()).or_default();
                entered.retain(|enter| !go_against(enter, &happened.event));
                entered.push(happened.event.clone());
            }
            Passage::NAME => {
                // What lies behind is let go.
                let left = Stretch::read(&happened.event).unwrap_or_default();
                if let Some(entered) = self.inside.get_mut(&happened.home) {
                    entered.retain(|enter| left.is_at(enter));
                }
            }
            GiveWay::NAME | Leave::NAME | Landed::NAME => drop(self.inside.remove(&happened.home)),
            _ => {}
        }
        let now = self.inside.len();
        self.most_at_once = self.most_at_once.max(now);
        if now != before {
            self.over_time.extend([(now_s, before as f64), (now_s, now as f64)]);
        }
    }
}

/// Whether two entered places are one, flown through different ways.
fn go_against(one: &Event, other: &Event) -> bool {
    let off =
        |field: &str| (one.real(field).unwrap_or_default() - other.real(field).unwrap_or_default()).abs();
    let turned = (off("heading") + 180.0).rem_euclid(360.0) - 180.0;
    off("x").max(off("y")) <= SAME_PLACE_M && off("z") <= SAME_HEIGHT_M && turned.abs() > SAME_WAY_DEG
}

/// One flight of the swarm.
#[derive(Debug, Clone)]
struct Flight {
    passage: Narrow,
    succeeded: bool,
    collisions: u64,
    flight_time_s: f64,
}

#[derive(Args)]
pub struct RightOfWay {
    /// Worlds, whose seeds are 1 to N.
    #[arg(long, value_name = "N", default_value_t = RUNS, value_parser = one_or_more())]
    runs: usize,
    /// Size of the swarm; the scenario's own if not given.
    #[arg(long, value_name = "N", value_parser = one_or_more())]
    vehicles: Option<usize>,
}

impl Experiment for RightOfWay {
    const NAME: &'static str = "right-of-way";
    const ABOUT: &'static str =
        "nobody against another through a window: blocks that are confirmed, and the naive rule beside them";

    fn run(&self) -> anyhow::Result<Report> {
        let seeds: Vec<u64> = (1..=self.runs as u64).collect();
        let mut report = Report::default();
        let mut rows = Vec::new();
        for (network, is_slow) in [("as in `window`", false), ("100 ms, 20 % lost", true)] {
            let of_both = runs::in_turn(network, &seeds, |seed| {
                let mut scenario = Scenario::built_in("window", self.vehicles, *seed)?;
                both_ways(&mut scenario);
                if is_slow {
                    (scenario.network.latency_ms, scenario.network.loss) = SLOW;
                }
                Ok([fly(&scenario, RULES[0].0)?, fly(&scenario, RULES[1].0)?])
            })?;
            for (side, (_, rule)) in RULES.iter().enumerate() {
                let flights: Vec<&Flight> = of_both.iter().map(|both| &both[side]).collect();
                let sum = |of: fn(&Flight) -> usize| flights.iter().map(|flight| of(flight)).sum::<usize>();
                let entries = sum(|flight| flight.passage.entries);
                let shared = sum(|flight| flight.passage.shared);
                let most = flights.iter().map(|flight| flight.passage.most_at_once).max().unwrap_or(0);
                let succeeded = sum(|flight| flight.succeeded.into());
                let collisions: u64 = flights.iter().map(|flight| flight.collisions).sum();
                let time_s = mean(&flights.iter().map(|flight| flight.flight_time_s).collect::<Vec<_>>());
                report.number(
                    &format!("{rule}{}", if is_slow { "_slow_network" } else { "" }),
                    json!({
                        "runs": flights.len(), "succeeded": succeeded, "collisions": collisions,
                        "entries": entries, "shared_entries": shared, "most_at_once": most, "flight_time_s": time_s,
                    }),
                );
                rows.push(vec![
                    network.to_owned(),
                    (*rule).to_owned(),
                    format!("{succeeded} of {}", flights.len()),
                    collisions.to_string(),
                    format!("{shared} of {entries}"),
                    most.to_string(),
                    format!("{time_s:.1} s"),
                ]);
                let goal = format!("{rule}, {network}: entries against another who is inside");
                match (side, is_slow) {
                    (0, _) => report.goal(&goal, shared as f64, Bound::Exactly(0.0)),
                    // News that comes at once is seldom too late.
                    (_, true) => report.goal(&goal, shared as f64, Bound::AtLeast(1.0)),
                    (_, false) => {}
                }
            }
            if let (true, Some(both)) = (is_slow, of_both.iter().max_by_key(|both| both[1].passage.shared)) {
                report.figure("inside", inside(both));
            }
        }
        report.table(
            "Right of way at a window",
            &["network", "rule", "all arrive", "collisions", "shared entries", "most at once", "flight time"],
            rows,
        );
        Ok(report)
    }
}

/// Every second vehicle flies the other way.
fn both_ways(scenario: &mut Scenario) {
    for vehicle in scenario.vehicles.iter_mut().skip(1).step_by(2) {
        let (start, goal) = (vehicle.start, vehicle.goal());
        vehicle.start = goal.xy().push(start.z);
        vehicle.waypoints = vec![start.xy().push(goal.z)];
    }
}

fn fly(scenario: &Scenario, rule: Rule) -> anyhow::Result<Flight> {
    let mut passage = Narrow::default();
    let trial = Trial::new(scenario, Controller::Bp)
        .with_parts(move |config| Parts { mind: rule(), ..Parts::of(config) });
    let summary = trial
        .fly(&mut |swarm, selections| {
            selections.iter().for_each(|happened| passage.watch(swarm.now().as_secs_f64(), happened));
        })?
        .summary;
    Ok(Flight {
        passage,
        succeeded: summary.succeeded,
        collisions: summary.collisions.obstacle + summary.collisions.vehicle,
        flight_time_s: summary.flight_time_s.mean,
    })
}

/// The number inside over the time of one flight, by rule.
fn inside(both: &[Flight; 2]) -> Figure {
    let line = |((_, rule), flight): (&(Rule, &str), &Flight)| Line {
        name: (*rule).to_owned(),
        style: Style::Solid,
        points: flight.passage.over_time.clone(),
    };
    Figure {
        x: "time, s".to_owned(),
        y: "vehicles in the passage".to_owned(),
        is_map: false,
        lines: RULES.iter().zip(both).rev().map(line).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn confirmed_blocks_keep_a_passage_to_one_way_and_the_naive_rule_does_not() {
        let report = RightOfWay { runs: 3, vehicles: None }.run().expect("it can be run");
        assert!(report.is_reached(), "{report}");
        let json = report.to_json();
        assert_eq!(json["confirmed"]["succeeded"], 3);
        assert!(json["naive_slow_network"]["most_at_once"].as_u64() > Some(1), "{json}");
    }
}
