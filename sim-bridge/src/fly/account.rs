//! The account of a run at its end, and the summary that is made of it.

use std::time::Duration;

use skein_agent::{Outcome, SetPointRecord};
use skein_world::Simulation;

use crate::node_names::vehicle_name;
use crate::scenario::Scenario;
use crate::summary::{self, Collisions, EventCounts, PlanTimes, Spread, Summary, Traffic, VehicleSummary};

/// The facts of a run at its end.
pub struct Account<'a> {
    /// The truth of it.
    pub simulation: &'a Simulation,
    /// The end of each vehicle's mission, by its agent's word.
    pub outcomes: Vec<Option<Outcome>>,
    /// The reason why each vehicle does not move on, by its agent's word; empty if there is none.
    pub waiting_for: Vec<String>,
    /// The inputs of each agent's set-points, where they are known.
    pub set_points: Vec<SetPointRecord>,
    /// The times of plans, where they are known.
    pub plan_times_ms: &'a [f64],
    /// Events of all nodes.
    pub events: EventCounts,
    /// Messages of all nodes.
    pub network: Traffic,
    /// Hash of the run, if it replays.
    pub trace_hash: Option<String>,
}

/// The summary of the run; `called_off` is the reason why it was ended before it was over.
pub fn summary(
    scenario: &Scenario,
    account: &Account<'_>,
    wall: Duration,
    called_off: Option<String>,
) -> Summary {
    let truth = account.simulation.truth();
    let vehicles = 0..account.outcomes.len();
    let per_vehicle: Vec<VehicleSummary> = vehicles.clone().map(|index| vehicle(account, index)).collect();
    let collisions =
        Collisions { obstacle: truth.collisions_obstacle.into(), vehicle: truth.collisions_vehicle.into() };
    let collided = match collisions {
        Collisions { obstacle: 0, vehicle: 0 } => None,
        Collisions { obstacle, vehicle } => {
            Some(format!("{obstacle} collisions with obstacles and {vehicle} between vehicles"))
        }
    };
    let failed = per_vehicle
        .iter()
        .find(|vehicle| vehicle.outcome != summary::Outcome::Arrived)
        .map(|vehicle| format!("{}: {}", vehicle.id, vehicle.reason.as_deref().unwrap_or("did not arrive")));
    let reason = called_off.or(collided).or(failed);
    let flown = || vehicles.clone().filter_map(|index| account.simulation.vehicle(index));
    let sim_time_s = account.simulation.now().as_secs_f64();
    Summary {
        scenario: scenario.name.clone(),
        seed: scenario.seed,
        vehicles: per_vehicle.len(),
        succeeded: reason.is_none(),
        reason,
        sim_time_s,
        wall_time_s: wall.as_secs_f64(),
        realtime_factor: sim_time_s / wall.as_secs_f64().max(1e-9),
        collisions,
        min_separation_m: truth.min_separation_m,
        min_clearance_m: truth.min_clearance_m,
        flight_time_s: Spread::of(flown().map(|vehicle| vehicle.flight_time.as_secs_f64())),
        path_length_m: Spread::of(flown().map(|vehicle| vehicle.path_length_m)),
        plan_ms: PlanTimes::of(account.plan_times_ms.to_vec()),
        events: account.events,
        network: account.network,
        trace_hash: account.trace_hash.clone(),
        per_vehicle,
    }
}

fn vehicle(account: &Account<'_>, index: usize) -> VehicleSummary {
    let truth = account.simulation.vehicle(index);
    let outcome = account.outcomes.get(index).and_then(Option::as_ref);
    let crashed = truth.is_some_and(|vehicle| vehicle.crashed);
    let airborne = truth.is_some_and(|vehicle| vehicle.airborne);
    let flew = truth.is_some_and(|vehicle| !vehicle.flight_time.is_zero());
    let (outcome, reason) = match outcome {
        _ if crashed => (summary::Outcome::Crashed, Some("it crashed".to_owned())),
        Some(Outcome::Complete) => (summary::Outcome::Arrived, None),
        Some(Outcome::Failed(why)) => (summary::Outcome::LandedEarly, Some(why.clone())),
        None if airborne => (summary::Outcome::Airborne, Some("it was still in the air".to_owned())),
        None if flew => (summary::Outcome::LandedEarly, Some("it landed before its goal".to_owned())),
        None => {
            let why = account.waiting_for.get(index).map(String::as_str).unwrap_or_default();
            let colon = if why.is_empty() { "" } else { ": " };
            (summary::Outcome::Grounded, Some(format!("it never took off{colon}{why}")))
        }
    };
    let set_points = account.set_points.get(index).copied().unwrap_or_default();
    VehicleSummary {
        id: vehicle_name(index).to_string(),
        outcome,
        reason,
        flight_time_s: truth.map_or(0.0, |vehicle| vehicle.flight_time.as_secs_f64()),
        path_length_m: truth.map_or(0.0, |vehicle| vehicle.path_length_m),
        set_points: set_points.commands,
        oldest_input_ms: set_points.oldest_input.as_secs_f64() * 1000.0,
        hard_brakes: set_points.hard_brakes,
        battery: truth.map_or(0.0, |vehicle| vehicle.battery.fraction),
    }
}
