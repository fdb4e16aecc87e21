//! `campaign narrow-graphs`: the decisions of right of way alone, on every connected graph of a few places and on
//! random ones. The b-threads are those that fly; of the channels no more is known than that who hears of another hears any
//! earlier state of it. Nobody shares a narrow place by right; and where there is a way for all, from every state that
//! comes about all may yet arrive.

mod decisions;
mod graph;
mod model;
mod mutant;

use std::time::{Duration, Instant};

use clap::Args;
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;
use serde_json::json;
use skein_agent::bthreads::RightOfWay;
use skein_sim::cli::Exit;

use self::graph::{Case, Graph};
use self::model::{Model, Outcome};
use self::mutant::{Missing, Mutant};
use crate::numbers::seconds;
use crate::task::Task;

/// Lease of the nodes; in a verification time has no length.
const LEASE: Duration = Duration::from_secs(1);

#[derive(Args, Clone, Debug)]
pub struct NarrowGraphs {
    /// Vehicles in each graph.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..=3))]
    vehicles: u8,
    /// Places of the largest graphs that are all looked at.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u8).range(1..=4))]
    places: u8,
    /// Cases in random graphs of six places, beside them.
    #[arg(long, value_name = "N", default_value_t = 0)]
    random: usize,
    /// The order of cases and the random ones come from it.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Cases at most, in an order by chance; all unless given.
    #[arg(long, value_name = "N")]
    cases: Option<usize>,
    /// Cases alone in which every goal is in a wide place, where who has arrived is in nobody's way.
    #[arg(long)]
    wide_goals: bool,
    /// No case is begun after so long, s.
    #[arg(long, value_name = "S", value_parser = seconds)]
    seconds: Option<Duration>,
    /// States of a case to look at, at most.
    #[arg(long, value_name = "N", default_value_t = 200_000)]
    most_states: usize,
    /// Claims that were withdrawn meanwhile are heard late, too.
    #[arg(long)]
    stale: bool,
    /// Leave out a decision.
    #[arg(long, value_enum)]
    missing: Option<Missing>,
    /// Cases that went wrong to tell of, at most.
    #[arg(long, value_name = "N", default_value_t = 3)]
    tell: usize,
}

/// All cases together.
#[derive(Debug, Default)]
struct Found {
    graphs: usize,
    cases: usize,
    of_cases: usize,
    without_a_way: usize,
    cut: usize,
    shared: usize,
    stuck: usize,
    /// Of those that are stuck, the ones where a vehicle's goal is in a narrow place.
    stuck_at_narrow_goals: usize,
    states: usize,
    moves: usize,
    largest: usize,
    told: Vec<String>,
}

impl Task for NarrowGraphs {
    const NAME: &'static str = "narrow-graphs";
    const ABOUT: &'static str =
        "Right of way's decisions alone, in every small graph of narrow and wide places";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let began = Instant::now();
        let found = self.find();
        let took_s = began.elapsed().as_secs_f64();
        let not_covered = [
            format!("{} of {} cases were not looked at", found.of_cases - found.cases, found.of_cases),
            format!(
                "{} cases have more than {} states: their ends were not looked at",
                found.cut, self.most_states
            ),
            "lost nodes, lapsed leases, short radios, and ways that are not known beforehand".to_owned(),
            "chance: a way to arrive from every state, not that it is taken in bounded time".to_owned(),
        ];
        if as_json {
            let object = json!({
                "vehicles": self.vehicles,
                "graphs": found.graphs,
                "cases": found.cases,
                "without_a_way": found.without_a_way,
                "states": found.states,
                "moves": found.moves,
                "largest_states": found.largest,
                "seconds": took_s,
                "shared": found.shared,
                "stuck": found.stuck,
                "stuck_at_narrow_goals": found.stuck_at_narrow_goals,
                "cut": found.cut,
                "told": found.told,
                "not_covered": not_covered,
            });
            println!("{object}");
        } else {
            println!(
                "{} graphs, {} cases ({} without a way), {} states, {} moves, {took_s:.1} s",
                found.graphs, found.cases, found.without_a_way, found.states, found.moves
            );
            println!(
                "{} share a place, {} do not all arrive ({} of them with a goal in a narrow place)",
                found.shared, found.stuck, found.stuck_at_narrow_goals
            );
            not_covered.iter().for_each(|what| println!("not covered: {what}"));
            found.told.iter().for_each(|story| println!("{story}"));
        }
        Ok(Exit::of(found.shared + found.stuck == 0))
    }
}

impl NarrowGraphs {
    fn find(&self) -> Found {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let vehicles = usize::from(self.vehicles);
        let graphs: Vec<_> = (1..=usize::from(self.places)).flat_map(Graph::all).collect();
        let mut cases: Vec<_> = graphs.iter().flat_map(|graph| Case::all(graph, vehicles)).collect();
        if self.wide_goals {
            cases.retain(Case::has_wide_goals);
        }
        if self.cases.is_some() || self.seconds.is_some() {
            cases.shuffle(&mut random);
        }
        let mut found = Found { of_cases: cases.len() + self.random, ..Found::default() };
        cases.truncate(self.cases.unwrap_or(usize::MAX));
        let mut random_cases = (0..).map(|_| Case::random(6, vehicles, &mut random));
        let asked = |case: &Case| !self.wide_goals || case.has_wide_goals();
        cases.extend(random_cases.by_ref().filter(asked).take(self.random));
        found.graphs = graphs.len() + self.random;
        let began = Instant::now();
        for case in &cases {
            if self.seconds.is_some_and(|seconds| began.elapsed() > seconds) {
                break;
            }
            found.take(case, &self.explore(case), self.tell);
        }
        found
    }

    fn explore(&self, case: &Case) -> Outcome {
        let rule = |me: &skein_agent::Me, others: &[&str]| Mutant {
            me: me.clone(),
            flown: RightOfWay::new(me.clone(), others.iter().copied(), LEASE),
            missing: self.missing,
        };
        Model::new(case, self.stale).explore(rule, self.most_states)
    }
}

impl Found {
    fn take(&mut self, case: &Case, outcome: &Outcome, tell: usize) {
        self.cases += 1;
        self.without_a_way += usize::from(!case.has_a_way());
        self.cut += usize::from(outcome.is_cut);
        self.shared += usize::from(outcome.shared.is_some());
        self.stuck += usize::from(outcome.stuck.is_some());
        self.stuck_at_narrow_goals += usize::from(outcome.stuck.is_some() && !case.has_wide_goals());
        self.states += outcome.states;
        self.moves += outcome.moves;
        self.largest = self.largest.max(outcome.states);
        if let Some(story) = outcome.shared.as_ref().or(outcome.stuck.as_ref())
            && self.told.len() < tell
        {
            self.told.push(format!("{case}:\n  {}", story.join("\n  ")));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn explored(case: &Case, stale: bool, missing: Option<Missing>) -> Outcome {
        let campaign = NarrowGraphs {
            vehicles: 2,
            places: 1,
            random: 0,
            seed: 1,
            cases: None,
            wide_goals: false,
            seconds: None,
            most_states: 100_000,
            stale,
            missing,
            tell: 0,
        };
        campaign.explore(case)
    }

    #[test]
    fn two_get_past_one_another_in_a_corridor_in_every_run_of_the_rule_that_flies() {
        for (case, stale) in [
            (Case::corridor(1), true),
            (Case::corridor(2), true),
            (Case::met_inside(), false),
            (Case::crossing(), true),
            (Case::four_ways(), true),
        ] {
            let outcome = explored(&case, stale, None);
            assert!(!outcome.is_cut && outcome.shared.is_none() && outcome.stuck.is_none(), "{outcome:?}");
        }
    }

    #[test]
    fn a_rule_without_confirmation_or_hold_lets_two_share_a_place() {
        for missing in [Missing::Confirmation, Missing::Hold] {
            assert!(explored(&Case::corridor(1), false, Some(missing)).shared.is_some(), "{missing:?}");
        }
    }

    #[test]
    fn where_nobody_gives_in_two_that_stand_in_nobody_s_way_claim_a_crossing_for_ever() {
        let outcome = explored(&Case::four_ways(), false, Some(Missing::GivingIn));
        assert!(!outcome.is_cut && outcome.stuck.is_some(), "{outcome:?}");
    }

    #[test]
    fn where_nobody_makes_way_two_that_met_inside_stand_for_ever() {
        assert!(explored(&Case::met_inside(), false, Some(Missing::MakingWay)).stuck.is_some());
    }
}
