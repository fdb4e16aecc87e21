//! From a scenario to the configurations of its world, agents and ground station.

use std::time::Duration;

use skein_agent::{AgentConfig, DEFAULT_SIGMA_LIMIT_M, Envelope, Fence, Mind, Parts, PositionSource};
use skein_bp::{Program, script::Assignment};
use skein_dbp::{Kept, NodeName};
use skein_ground::planning::Theatre;
use skein_ground::{Giver, GroundConfig};
use skein_swarm::route::Craft;
use skein_wire::{Fleet, standard_authority};
use skein_world::{SimulationConfig, VehicleSetup};

use crate::cli;
use crate::node_names::{GROUND, vehicle_name};
use crate::scenario::{Scenario, VehiclePlan};
use crate::sequential::Sequential;

/// The fleet's name on one host.
pub const FLEET: &str = "sim";
/// Lowest height at which vehicles return, m above the world's origin.
const RETURN_ALTITUDE_M: f64 = 3.0;
/// Vehicles return at so many heights, this far apart, m.
const RETURN_LEVELS: (usize, f64) = (4, 1.0);

/// The node name that an operator's script may use. Nobody misses it while it is not there.
const SCRIPT: &str = "script/operator";

/// The world of a scenario.
#[must_use]
pub fn simulation_config(scenario: &Scenario) -> SimulationConfig {
    let vehicles = (1..).zip(&scenario.vehicles).map(|(system_id, plan)| VehicleSetup {
        model: plan.model.clone(),
        position: plan.start,
        yaw: plan.yaw,
        system_id,
        position_errors: plan.position_errors.clone(),
    });
    SimulationConfig {
        scene: scenario.scene.clone(),
        vehicles: vehicles.collect(),
        seed: scenario.seed,
        wind: scenario.wind,
    }
}

/// The agents of a scenario, in the order of its vehicles.
#[must_use]
pub fn agent_configs(scenario: &Scenario) -> Vec<AgentConfig> {
    let vehicles = || (0..scenario.vehicles.len()).map(vehicle_name);
    let others = [GROUND.to_string(), SCRIPT.to_owned()];
    let roster: Vec<String> = vehicles().map(|name| name.to_string()).chain(others).collect();
    let bounds = scenario.scene.bounds();
    let fence = Fence { min: bounds.min.into(), max: bounds.max.into() };
    let (levels, spacing_m) = RETURN_LEVELS;
    scenario
        .vehicles
        .iter()
        .enumerate()
        .map(|(index, plan)| AgentConfig {
            fleet: FLEET.to_owned(),
            node: vehicle_name(index).to_string(),
            ground: GROUND.to_string(),
            roster: roster.clone(),
            incarnation: 1,
            system_id: u8::try_from(index + 1).unwrap_or(u8::MAX),
            datum: *scenario.scene.datum(),
            home: plan.start.into(),
            waypoints: plan.waypoints.iter().map(|point| (*point).into()).collect(),
            errands: plan.errands.clone(),
            rally: scenario.rally.iter().map(|place| (*place).into()).collect(),
            arrives_with: match scenario.arrive_together {
                true => vehicles().map(|name| name.to_string()).collect(),
                false => Vec::new(),
            },
            takeoff_height_m: scenario.takeoff_height_m,
            return_altitude_m: (RETURN_ALTITUDE_M + spacing_m * (index % levels) as f64)
                .min(bounds.max.z - 1.0),
            position: sources(scenario, plan),
            signing: None,
            sigma_limit_m: DEFAULT_SIGMA_LIMIT_M,
            lidar: plan.model.lidar.is_some(),
            fence,
            epoch: Duration::ZERO,
            airspace: scenario.airspace.clone(),
            envelope: Envelope {
                cruise_m_s: scenario.cruise_speed_m_s.min(plan.model.max_speed_m_s),
                climb_m_s: plan.model.max_climb_m_s.min(1.5),
                airspeed_m_s: plan.model.top_airspeed_m_s(),
                tilt_rad: plan.model.top_tilt_rad(),
                endurance_s: plan.model.endurance_s(),
                brake_m_s2: plan.model.max_accel_m_s2 * 0.7,
                hull_m: plan.model.hull_radius_m,
                separation_m: scenario.separation_m(plan),
                margin_m: scenario.margin_m.unwrap_or(Envelope::DEFAULT.margin_m),
                ..Envelope::default()
            },
            planners: scenario.planners,
            link_loss: scenario.without_ground,
            scripts: scripts_of(scenario, index + 1),
            behaviours: scenario.behaviours.clone(),
            lease: lease(scenario),
            radio_range_m: scenario.network.radio_range_m,
            authority: standard_authority(),
            kept: Kept::default(),
            seed: scenario.seed.wrapping_mul(1000).wrapping_add(index as u64),
        })
        .collect()
}

/// The sources of position of a vehicle of the simulated world: what the scenario says, or what it has.
fn sources(scenario: &Scenario, plan: &VehiclePlan) -> Vec<PositionSource> {
    if !scenario.position.is_empty() {
        return scenario.position.clone();
    }
    let model = &plan.model;
    let sources = [
        (PositionSource::Autopilot, model.gps.is_some()),
        (PositionSource::Markers, model.floor_camera.is_some()),
    ];
    sources.into_iter().filter(|(_, has)| *has).map(|(source, _)| source).collect()
}

/// The parts of an agent with this in control.
#[must_use]
pub fn agent_parts(config: &AgentConfig, controller: cli::Controller) -> Parts {
    let parts = Parts::of(config);
    match controller {
        cli::Controller::Bp => parts,
        cli::Controller::Sequential => Parts { mind: Box::new(Sequential::new(config)), ..parts },
        cli::Controller::None => Parts { mind: Box::new(Nobody), ..parts },
    }
}

/// No b-thread at all: everything else runs, and nothing flies (Wang 2023, feasibility).
#[derive(Debug)]
struct Nobody;

impl Mind for Nobody {
    fn load(&self, _: &mut Program, _: &AgentConfig) {}
}

/// The scripts of the vehicle with this number, from 1.
fn scripts_of(scenario: &Scenario, number: usize) -> Vec<Assignment> {
    let own = scenario.scripts.iter().filter(|script| script.vehicle == number);
    own.map(|script| script.assignment.clone()).collect()
}

/// Lease of every node's bids.
fn lease(scenario: &Scenario) -> Duration {
    Duration::from_secs_f64(scenario.network.lease_ms / 1000.0)
}

/// The ground station of a scenario, with its operator's orders.
#[must_use]
pub fn ground_config(scenario: &Scenario, fleet: Fleet, controller: cli::Controller) -> GroundConfig {
    let orders = scenario.orders.iter().filter_map(|(at_s, order)| {
        Some((Duration::from_secs_f64(*at_s), Giver::new("scenario").ok()?, order.clone()))
    });
    let vehicles = (0..scenario.vehicles.len()).map(vehicle_name).collect();
    GroundConfig {
        orders: orders.collect(),
        loaded: controller == cli::Controller::Bp,
        launch_on_order: scenario.launch_on_order
            || scenario.orders.iter().any(|(_, order)| order.what().is_launch()),
        muster: scenario.musters(),
        behaviours: scenario.behaviours.clone(),
        operators: NodeName::new(SCRIPT).into_iter().collect(),
        theatre: theatre(scenario),
        lease: lease(scenario),
        seed: scenario.seed,
        ..GroundConfig::new(fleet, GROUND.clone(), vehicles)
    }
}

/// What the station plans with: the scenario's bounds and airspace, and vehicles no better than its least able one.
fn theatre(scenario: &Scenario) -> Option<Theatre> {
    let envelopes: Vec<Envelope> = agent_configs(scenario).into_iter().map(|agent| agent.envelope).collect();
    let least = |of: fn(&Envelope) -> f64| envelopes.iter().map(of).fold(f64::INFINITY, f64::min);
    let most = |of: fn(&Envelope) -> f64| envelopes.iter().map(of).fold(0.0, f64::max);
    let craft = Craft::of_body(
        (least(|envelope| envelope.cruise_m_s), least(|envelope| envelope.climb_m_s)),
        least(|envelope| envelope.endurance_s),
        most(|envelope| envelope.separation_m),
        most(|envelope| envelope.hull_m),
        scenario.takeoff_height_m,
    );
    let bounds = scenario.scene.bounds();
    Theatre::new(scenario.airspace.clone(), (bounds.min, bounds.max), craft).ok()
}
