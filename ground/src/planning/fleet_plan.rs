//! A plan for the fleet.

use nalgebra::Vector3;
use serde::Serialize;
use skein_dbp::NodeName;
use skein_swarm::route::{Assessment, Conflict, Flight, conflicts};
use skein_wire::{Route, UnfitRoute};

use super::problem::{FleetProblem, LeftOut};

/// A planner of routes. Both have the same cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The particle swarm with tabu search.
    Swarm,
    /// A* on a lattice.
    Lattice,
}

/// The task of a vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct Journey {
    pub node: NodeName,
    /// The numbers of the targets that it visits, in order.
    pub targets: Vec<usize>,
    /// From where it is, the points of its way (ENU, metres).
    pub route: Vec<Vector3<f64>>,
    /// The numbers of those of them where it is to be whatever comes.
    pub stops: Vec<usize>,
    pub assessment: Assessment,
    /// Which planner found it.
    pub by: Method,
    /// The best of the other planner, if it found any.
    pub second: Option<Alternative>,
    /// Factor by which it flies slower than at cruise, to arrive with the last.
    pub slowed: f64,
}

/// Another route of a vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct Alternative {
    pub by: Method,
    pub route: Vec<Vector3<f64>>,
    pub stops: Vec<usize>,
    pub assessment: Assessment,
}

impl Journey {
    /// The route as it is sent, to the centimetre.
    ///
    /// # Errors
    /// [`UnfitRoute`]: it has too many points.
    pub fn sent(&self) -> Result<Route, UnfitRoute> {
        let points = self.route.iter().skip(1).map(|point| point.map(|m| (m * 100.0).round() / 100.0).into());
        let stops: Vec<usize> = self.stops.iter().map(|index| index - 1).collect();
        Ok(Route::new(points.collect())?.with_targets(&stops))
    }
}

/// Two vehicles that would come nearer to one another than a plan keeps.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Encounter {
    pub who: [String; 2],
    /// After the vehicles have set out, s.
    pub at_s: f64,
    pub distance_m: f64,
    /// ENU, metres.
    pub place: [f64; 3],
}

/// The routes of a fleet.
#[derive(Clone, Debug, PartialEq)]
pub struct FleetPlan {
    pub journeys: Vec<Journey>,
    /// The vehicles that no route was made for.
    pub left_out: Vec<LeftOut>,
    /// When all arrive, seconds after they have set out.
    pub arrival_s: f64,
    /// Of all journeys together, metres.
    pub cost_m: f64,
    /// Who would come too near to whom, others included. A plan with any is not to be flown.
    pub encounters: Vec<Encounter>,
}

impl FleetPlan {
    /// These journeys, at such a pace that all arrive together.
    pub(super) fn new(mut journeys: Vec<Journey>, left_out: Vec<LeftOut>, problem: &FleetProblem) -> Self {
        let arrival_s = journeys.iter().map(|journey| journey.assessment.time_s).fold(0.0, f64::max);
        for journey in &mut journeys {
            let own_s = journey.assessment.time_s;
            journey.slowed = if own_s > 0.0 { arrival_s / own_s } else { 1.0 };
        }
        let cost_m = journeys.iter().map(|journey| journey.assessment.cost_m).sum();
        let encounters = encounters(&journeys, problem);
        Self { journeys, left_out, arrival_s, cost_m, encounters }
    }
}

fn encounters(journeys: &[Journey], problem: &FleetProblem) -> Vec<Encounter> {
    let craft = &problem.theatre.craft;
    let cost = craft.cost(1.0);
    let own = journeys
        .iter()
        .map(|journey| (journey.node.to_string(), Flight::along(&journey.route, &cost, journey.slowed)));
    let flies_on = |node: &NodeName| journeys.iter().all(|journey| journey.node != *node);
    let others = problem.others.iter().filter(|other| flies_on(&other.node));
    let others = others.map(|other| (other.node.to_string(), Flight::along(&other.way, &cost, 1.0)));
    let (names, flights): (Vec<_>, Vec<_>) = own.chain(others).unzip();
    let concerns = |conflict: &Conflict| conflict.who.iter().any(|who| *who < journeys.len());
    // Those who begin too near to one another do not come any nearer by the plan.
    let begins = |conflict: &Conflict| conflict.at_s <= 0.0;
    conflicts(&flights, craft.separation_m)
        .into_iter()
        .filter(|conflict| concerns(conflict) && !begins(conflict))
        .map(|conflict| Encounter {
            who: conflict.who.map(|who| names[who].clone()),
            at_s: conflict.at_s,
            distance_m: conflict.distance_m,
            place: conflict.place.into(),
        })
        .collect()
}
