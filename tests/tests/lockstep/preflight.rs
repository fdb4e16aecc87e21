//! A vehicle that is not ready does not take off, and says why.

use std::time::Duration;

use nalgebra::Vector3;
use skein_agent::AgentConfig;
use skein_mav::messages::{MavParamType, PARAM_SET_DATA};
use skein_mav::{Address, FrameWriter};
use skein_sim::cli::Controller;
use skein_sim::fly::{self, Links, Swarm};
use skein_sim::scenario::Scenario;
use skein_tests::Lockstep;
use skein_wire::event::{Declared as _, Unready};
use skein_wire::{Fleet, Link, NodeName};
use skein_world::{Obstacle, Scene, Simulation};

const ALONE: &str = "name = \"alone\"\n[bounds]\nmin_m = [-10.0, -20.0, -1.0]\nmax_m = [40.0, 20.0, 15.0]\n\
    [[vehicle]]\nstart_m = [0.0, 0.0]\nwaypoints_m = [[10.0, 0.0, 3.0]]\n";

fn alone() -> Scenario {
    Scenario::from_toml(ALONE, "scenario.toml", None, 1).unwrap()
}

/// Looks for so long on; whether the first vehicle flies then, what it says it waits for, and what it last
/// said keeps it from being ready.
fn after(lockstep: &mut Lockstep, seconds: f64) -> (bool, String, Option<String>) {
    let end = lockstep.swarm.now() + Duration::from_secs_f64(seconds);
    let mut why = None;
    while lockstep.swarm.now() < end {
        for said in lockstep.step().selections {
            why = Unready::read(&said.event).map(|unready| unready.why.to_string()).or(why);
        }
    }
    let now = lockstep.swarm.now();
    let waits_for = lockstep.swarm.agents().next().unwrap().status(now).waiting_for;
    (lockstep.swarm.simulation().vehicle(0).unwrap().airborne, waits_for, why)
}

/// What the ground station has been told that keeps the first vehicle from being ready.
fn told_to_the_ground(lockstep: &Lockstep) -> Vec<String> {
    let readiness = lockstep.swarm.ground().readiness(&lockstep.nodes[0]);
    readiness.unwrap().faults().map(|check| format!("{}: {}", check.name, check.value)).collect()
}

/// Such a vehicle never takes off, and vehicle, event and ground station say this.
fn is_refused(lockstep: &mut Lockstep, fault: &str) {
    let (flies, waits_for, why) = after(lockstep, 20.0);
    assert!(!flies, "it flies");
    assert!(waits_for.contains(fault), "it waits for {waits_for:?}");
    assert!(why.as_ref().is_some_and(|why| why.contains(fault)), "it says {why:?}");
    let told = told_to_the_ground(lockstep);
    assert!(told.iter().any(|told| told.starts_with(fault)), "the ground knows {told:?}");
}

/// A vehicle whose agent is configured otherwise.
fn configured(change: impl Fn(&mut AgentConfig)) -> Lockstep {
    let Lockstep { network, nodes, scenario, .. } = Lockstep::of(alone());
    let mut agents = fly::agent_configs(&scenario);
    agents.iter_mut().for_each(change);
    let link = |node: &NodeName| Box::new(network.join(node)) as Box<dyn Link>;
    let links = Links { vehicles: vec![link(&nodes[0])], ground: link(&fly::GROUND) };
    let ground = fly::ground_config(&scenario, Fleet::new(fly::FLEET).unwrap(), Controller::Bp);
    let world = Simulation::new(fly::simulation_config(&scenario));
    let swarm = Swarm::new(world, agents, ground, links).unwrap();
    Lockstep { swarm, network, nodes, scenario }
}

#[test]
fn on_a_wrong_pad_it_does_not_take_off() {
    is_refused(
        &mut configured(|config| config.home = [12.0, 0.0, 0.0]),
        "home: stands 12 m west of its home",
    );
}

#[test]
fn with_a_datum_that_is_too_low_it_does_not_take_off() {
    is_refused(&mut configured(|config| config.datum.height_m -= 4.0), "home: stands 4 m above its home");
}

#[test]
fn outside_its_fence_it_does_not_take_off() {
    let mut lockstep = configured(|config| config.fence.min[0] = 5.0);
    is_refused(&mut lockstep, "fence: stands outside, at (");
}

#[test]
fn on_the_ground_and_ready_it_passes_all_checks_and_flies() {
    let mut lockstep = Lockstep::of(alone());
    let (mut passed, mut flies) = (Vec::new(), false);
    while lockstep.swarm.now() < Duration::from_secs(20) && !flies {
        lockstep.step();
        if let Some(readiness) = lockstep.swarm.ground().readiness(&lockstep.nodes[0])
            && readiness.is_ready()
        {
            passed = readiness.checks.iter().map(|check| check.name.clone()).collect();
        }
        flies = lockstep.swarm.simulation().vehicle(0).unwrap().airborne;
    }
    assert!(flies, "it waits for {:?}", told_to_the_ground(&lockstep));
    for name in ["autopilot", "position", "lidar", "home", "overhead", "battery", "COM_OF_LOSS_T"] {
        assert!(passed.iter().any(|passed| passed == name), "{name} is none of {passed:?}");
    }
}

#[test]
fn under_a_roof_that_its_range_finder_sees_it_does_not_take_off() {
    let mut scenario = alone();
    let roof = Obstacle::block("roof", Vector3::new(0.0, 0.0, 1.7), Vector3::new(4.0, 4.0, 0.2));
    scenario.scene = Scene::new("carport", vec![roof]).with_bounds(*scenario.scene.bounds());
    let (flies, waits_for, _) = after(&mut Lockstep::of(scenario), 20.0);
    assert!(!flies && waits_for.contains("overhead: a roof 1.5 m above it"), "{waits_for}");
}

/// The bytes with which another station changes a parameter.
fn sets(parameter: &str, value: f32) -> Vec<u8> {
    let mut writer = FrameWriter::new(Address { system_id: 255, component_id: 190 });
    writer.write(&PARAM_SET_DATA {
        target_system: 1,
        target_component: 1,
        param_id: parameter.into(),
        param_value: value,
        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
    });
    writer.take()
}

#[test]
fn a_failsafe_that_somebody_makes_unsafe_between_two_flights_is_noticed_and_mended_again() {
    let mut lockstep = Lockstep::of(alone());
    lockstep.run_until(Duration::from_secs(100));
    let landed = lockstep.swarm.simulation().vehicle(0).unwrap().motion.position;
    assert!((landed - Vector3::new(10.0, 0.0, 0.0)).norm() < 1.0, "it landed at {landed}");
    after(&mut lockstep, 5.0);
    // It may fly again from where it landed.
    assert_eq!(told_to_the_ground(&lockstep), Vec::<String>::new());
    lockstep.swarm.send_mavlink(0, &sets("COM_OF_LOSS_T", 30.0));
    after(&mut lockstep, 5.0);
    assert_eq!(told_to_the_ground(&lockstep), ["COM_OF_LOSS_T: 30"]);
    lockstep.swarm.send_mavlink(0, &sets("COM_OF_LOSS_T", 0.5));
    after(&mut lockstep, 5.0);
    assert_eq!(told_to_the_ground(&lockstep), Vec::<String>::new());
}
