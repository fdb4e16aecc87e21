//! `rehearse`: flies from a present state in lockstep, once with each seed, and tells what comes of it.

use std::collections::BTreeMap;
use std::io::Read as _;
use std::num::NonZero;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use skein_agent::bthreads::LinkLossPolicy;
use skein_agent::{AgentConfig, Outcome, Parts, Planners};
use skein_bp::behaviour::Chosen;
use skein_dbp::NodeName;
use skein_ground::Giver;
use skein_ground::rehearsal::{
    Actor, Failure, Nearness, Played, Range, Rehearsal, Rehearsed, UnfitRehearsal, Wait,
};
use skein_wire::event::{Airborne, Declared as _, What};
use skein_wire::{Fleet, Form, Link, Network, NetworkConfig, Order, Solid, Who};
use skein_world::{
    Aabb, HANGS, Obstacle, PositionErrors, Scene, Shape, Simulation, Truth, VehicleModel, WindConfig,
};

use crate::cli::Controller;
use crate::fly::{self, Links, Swarm};
use crate::scenario::{self, SEPARATION_HULLS, Scenario, VehiclePlan, read_world};
use crate::summary::Traffic;

/// Vehicles in the air are told to go on so long after they are let go.
const SETTLES: Duration = Duration::from_millis(100);
/// A vehicle that has not set out so long after that does not.
const SETS_OUT: Duration = Duration::from_secs(5);
/// The waits of vehicles are looked at so often.
const LOOK: Duration = Duration::from_millis(200);
/// So many of the nearest pairs are told, and of the waits of a vehicle.
const NEAREST_TOLD: usize = 10;
const WAITS_TOLD: usize = 5;

/// Reads the rehearsal in a file, or on standard input without one, and flies it.
///
/// # Errors
/// It cannot be read, or a field is not what it may be.
pub fn run(file: Option<&Path>) -> anyhow::Result<Rehearsed> {
    let name = file.map_or_else(|| "standard input".to_owned(), |file| file.display().to_string());
    let text = match file {
        Some(file) => std::fs::read_to_string(file).with_context(|| format!("{name}: cannot be read"))?,
        None => {
            let mut text = String::new();
            std::io::stdin().read_to_string(&mut text).context("standard input: cannot be read")?;
            text
        }
    };
    rehearse(&read(&text).with_context(|| name.clone())?).with_context(|| name)
}

/// Reads a rehearsal in JSON.
///
/// # Errors
/// The field at fault, with its line, and what was expected.
pub fn read(text: &str) -> anyhow::Result<Rehearsal> {
    let mut json = serde_json::Deserializer::from_str(text);
    let rehearsal: Rehearsal = serde_path_to_error::deserialize(&mut json)
        .map_err(|error| anyhow::anyhow!("`{}`: {}", error.path(), error.inner()))?;
    json.end()?;
    rehearsal.check()?;
    Ok(rehearsal)
}

/// Flies it, once with each seed, several at a time.
///
/// # Errors
/// A field that is not what it may be.
pub fn rehearse(rehearsal: &Rehearsal) -> anyhow::Result<Rehearsed> {
    rehearsal.check()?;
    let began = Instant::now();
    let first = rehearsal.seeds.first().copied().unwrap_or_default();
    let scenario = scenario_of(rehearsal, first)?;
    let threads = std::thread::available_parallelism().map_or(1, NonZero::get);
    let mut played = Vec::new();
    for seeds in rehearsal.seeds.chunks(threads) {
        let together: Vec<anyhow::Result<Flown>> = std::thread::scope(|scope| {
            let flights: Vec<_> =
                seeds.iter().map(|seed| scope.spawn(|| fly(rehearsal, &scenario, *seed))).collect();
            let join = |flight: std::thread::ScopedJoinHandle<'_, _>| {
                flight.join().unwrap_or_else(|_| Err(anyhow::anyhow!("a rehearsed flight has broken down")))
            };
            flights.into_iter().map(join).collect()
        });
        for flown in together {
            played.push(flown?);
        }
    }
    Ok(told(rehearsal, &scenario, &played, began.elapsed()))
}

/// The end of a vehicle's flight with one seed.
#[derive(Default)]
struct Fate {
    /// It has arrived, or why not; none while it is under way.
    end: Option<Result<(), String>>,
    lands_s: Option<f64>,
    battery: f64,
    /// Its waits by their reason, s.
    waits_s: BTreeMap<String, f64>,
}

/// A flight with one seed.
struct Flown {
    seed: u64,
    fates: Vec<Fate>,
    /// The least distance of each pair in the air, m, and when, s.
    nearest: BTreeMap<(usize, usize), (f64, f64)>,
    truth: Truth,
    lasted_s: f64,
}

/// The scenario in whose world and with whose vehicles it is flown.
fn scenario_of(rehearsal: &Rehearsal, seed: u64) -> anyhow::Result<Scenario> {
    let mut notes = Vec::new();
    let mut scene = match &rehearsal.world {
        None => Scene::new("rehearsal", Vec::new()),
        Some(path) => {
            let world = read_world(Path::new(path), false).context("rehearsal: `world`")?;
            notes = world.notes();
            world.scene
        }
    };
    let mut obstacles = Vec::new();
    for (index, obstacle) in rehearsal.obstacles.iter().enumerate() {
        let wrong = |(field, expected): (&str, &str)| {
            UnfitRehearsal::new(format!("obstacles[{index}].{field}"), obstacle, expected)
        };
        obstacles.push(standing(index, &obstacle.solid().map_err(wrong)?));
    }
    scene = scene
        .with_more(obstacles)
        .with_bounds(Aabb { min: rehearsal.min_m.into(), max: rehearsal.max_m.into() });
    let airspace = rehearsal
        .airspace
        .check()
        .map_err(|error| anyhow::anyhow!("rehearsal: `airspace.{}`: {}", error.field, error.problem))?;
    let mut vehicles = Vec::new();
    for (index, actor) in rehearsal.vehicles.iter().enumerate() {
        vehicles.push(plan(rehearsal, actor, index)?);
    }
    Ok(Scenario {
        name: "rehearsal".to_owned(),
        about: String::new(),
        seed,
        scene,
        airspace,
        fixed_bounds: true,
        vehicles,
        launch_on_order: false,
        muster: false,
        arrive_together: rehearsal.arrive_together,
        cruise_speed_m_s: rehearsal.cruise_m_s,
        planners: Planners::default(),
        separation_hulls: SEPARATION_HULLS,
        margin_m: None,
        position: Vec::new(),
        takeoff_height_m: rehearsal.takeoff_height_m,
        without_ground: LinkLossPolicy::default(),
        time_limit_s: rehearsal.time_limit_s,
        wind: WindConfig {
            mean: rehearsal.wind.mean_m_s.into(),
            gust_sigma_m_s: rehearsal.wind.gust_m_s,
            ..WindConfig::default()
        },
        orders: Vec::new(),
        scripts: Vec::new(),
        behaviours: Chosen::default(),
        network: scenario::Network::default(),
        rally: Vec::new(),
        notes,
    })
}

fn standing(index: usize, solid: &Solid) -> Obstacle {
    let shape = match solid.form {
        Form::Box(size) => Shape::Box { half_extents: size / 2.0 },
        Form::Cylinder { radius, height } => Shape::Cylinder { radius, half_height: height / 2.0 },
        Form::Sphere { radius } => Shape::Sphere { radius },
    };
    Obstacle::new(format!("obstacle {}", index + 1), shape, solid.pose)
}

fn plan(rehearsal: &Rehearsal, actor: &Actor, index: usize) -> anyhow::Result<VehiclePlan> {
    let named = actor.model.as_ref().map(|name| (format!("vehicles[{index}].model"), name));
    let (field, name) = named.unwrap_or_else(|| ("model".to_owned(), &rehearsal.model));
    let model =
        VehicleModel::built_in(name).map_err(|error| anyhow::anyhow!("rehearsal: `{field}`: {error}"))?;
    let inside = Aabb { min: rehearsal.min_m.into(), max: rehearsal.max_m.into() };
    if !inside.contains(&actor.position_m.into()) {
        let expected = "a place between `min_m` and `max_m`";
        let field = format!("vehicles[{index}].position_m");
        return Err(UnfitRehearsal::new(field, actor.position_m, expected).into());
    }
    let [x, y, _] = actor.position_m;
    let below = if actor.airborne { [x, y, 0.0] } else { actor.position_m };
    Ok(VehiclePlan {
        start: actor.home_m.unwrap_or(below).into(),
        yaw: actor.yaw_rad,
        waypoints: actor.route_m.iter().map(|point| (*point).into()).collect(),
        errands: Vec::new(),
        model,
        autopilot: None,
        position_errors: PositionErrors::default(),
    })
}

/// The swarm at the beginning, over a network in memory.
fn swarm(rehearsal: &Rehearsal, scenario: &Scenario, seed: u64) -> anyhow::Result<(Swarm, Network)> {
    let scenario = Scenario { seed, ..scenario.clone() };
    let nodes: Vec<&NodeName> = rehearsal.vehicles.iter().map(|actor| &actor.node).collect();
    let own_name = |name: &str| {
        let index = (0..nodes.len()).find(|index| fly::vehicle_name(*index).as_str() == name);
        index.map_or_else(|| name.to_owned(), |index| nodes[index].to_string())
    };
    let mut configs: Vec<AgentConfig> = fly::agent_configs(&scenario);
    for (config, actor) in configs.iter_mut().zip(&rehearsal.vehicles) {
        config.node = actor.node.to_string();
        config.roster.iter_mut().chain(&mut config.arrives_with).for_each(|name| *name = own_name(name));
        config.epoch = Duration::from_secs_f64(rehearsal.began_s);
        config.scripts.clone_from(&actor.scripts);
    }
    let network = Network::new(NetworkConfig::default(), seed);
    let link = |node: &NodeName| Box::new(network.join(node)) as Box<dyn Link>;
    let links = Links { vehicles: nodes.iter().map(|node| link(node)).collect(), ground: link(&fly::GROUND) };
    let mut ground = fly::ground_config(&scenario, Fleet::new(fly::FLEET)?, Controller::Bp);
    ground.vehicles = nodes.into_iter().cloned().collect();

    let mut world = fly::simulation_config(&scenario);
    for (setup, actor) in world.vehicles.iter_mut().zip(&rehearsal.vehicles) {
        setup.position = actor.position_m.into();
    }
    let mut simulation = Simulation::new(world);
    for (index, actor) in rehearsal.vehicles.iter().enumerate() {
        simulation.charge(index, actor.battery);
        if actor.airborne {
            simulation.begin_in_air(index, scenario.vehicles[index].start);
        }
    }
    let mut swarm = Swarm::with_parts(simulation, configs, &Parts::of, ground, links)?;
    let by = Giver::from(swarm.ground().name());
    for (index, zone) in rehearsal.zones.iter().enumerate() {
        let wrong = |why: skein_ground::Refusal| {
            UnfitRehearsal::new(format!("zones[{index}]"), zone.name(), why.to_string())
        };
        swarm.ground_mut().draw(&by, zone.clone()).map_err(wrong)?;
    }
    Ok((swarm, network))
}

fn fly(rehearsal: &Rehearsal, scenario: &Scenario, seed: u64) -> anyhow::Result<Flown> {
    let (mut swarm, network) = swarm(rehearsal, scenario, seed)?;
    let actors = &rehearsal.vehicles;
    let going: Vec<NodeName> =
        actors.iter().filter(|actor| actor.airborne && !actor.held).map(|actor| actor.node.clone()).collect();
    let mut waiting_to_go = going.clone();
    let (told_at, mut is_told) = (HANGS + SETTLES, going.is_empty());
    let mut set_out = going.is_empty().then_some(Duration::ZERO);
    let mut flight = Flown {
        seed,
        fates: actors.iter().map(|_| Fate::default()).collect(),
        nearest: BTreeMap::new(),
        truth: swarm.truth(),
        lasted_s: 0.0,
    };
    let mut look_at = Duration::ZERO;
    loop {
        let now = swarm.now();
        if !is_told && now >= told_at {
            is_told = true;
            swarm.order(&Order::new(What::Resume, Who::These(going.clone())))?;
        }
        network.advance(now + skein_world::STEP);
        let happenings = swarm.step();
        if !happenings.ticked {
            continue;
        }
        for happened in
            happenings.selections.iter().filter(|happened| happened.event.kind() == Airborne::NAME)
        {
            waiting_to_go.retain(|node| *node != happened.home);
        }
        let now = swarm.now();
        if set_out.is_none() && is_told && (waiting_to_go.is_empty() || now > told_at + SETS_OUT) {
            set_out = Some(now);
        }
        let Some(began) = set_out else { continue };
        let since_s = now.saturating_sub(began).as_secs_f64();
        flight.measure(&swarm, since_s);
        if now >= look_at {
            look_at = now + LOOK;
            flight.look(&swarm);
        }
        if flight.is_over(rehearsal, &swarm) || since_s >= rehearsal.time_limit_s {
            flight.lasted_s = now.as_secs_f64();
            flight.truth = swarm.truth();
            flight.end(&swarm);
            return Ok(flight);
        }
    }
}

impl Flown {
    /// Takes in how near vehicles are, and whose mission has ended.
    fn measure(&mut self, swarm: &Swarm, since_s: f64) {
        let states: Vec<_> =
            (0..self.fates.len()).filter_map(|index| swarm.simulation().vehicle(index)).collect();
        for (i, one) in states.iter().enumerate() {
            for (j, other) in states.iter().enumerate().skip(i + 1) {
                if one.airborne || other.airborne {
                    let distance_m = (one.motion.position - other.motion.position).norm();
                    let least = self.nearest.entry((i, j)).or_insert((f64::INFINITY, since_s));
                    if distance_m < least.0 {
                        *least = (distance_m, since_s);
                    }
                }
            }
        }
        for ((fate, state), outcome) in self.fates.iter_mut().zip(&states).zip(swarm.outcomes()) {
            fate.battery = state.battery.fraction;
            let end = match outcome {
                _ if state.crashed => Some(Err("it crashes".to_owned())),
                Some(Outcome::Complete) => Some(Ok(())),
                Some(Outcome::Failed(why)) => Some(Err(why.clone())),
                None => None,
            };
            if fate.end.is_none() && end.is_some() {
                (fate.end, fate.lands_s) = (end, Some(since_s));
            }
        }
    }

    /// Takes in what vehicles wait for.
    fn look(&mut self, swarm: &Swarm) {
        for (fate, agent) in self.fates.iter_mut().zip(swarm.agents()) {
            let waits_for = agent.status(swarm.now()).waiting_for;
            if fate.end.is_none() && !waits_for.is_empty() {
                *fate.waits_s.entry(waits_for).or_default() += LOOK.as_secs_f64();
            }
        }
    }

    fn is_over(&self, rehearsal: &Rehearsal, swarm: &Swarm) -> bool {
        let is_down = |index| swarm.simulation().vehicle(index).is_none_or(|state| !state.airborne);
        let mut fates = self.fates.iter().zip(&rehearsal.vehicles).enumerate();
        fates.all(|(index, (fate, actor))| actor.held || fate.end.is_some() && is_down(index))
    }

    /// Says of those that are still under way why.
    fn end(&mut self, swarm: &Swarm) {
        let account = swarm.account(Traffic { messages: 0, bytes: 0 });
        for ((fate, waits_for), agent) in self.fates.iter_mut().zip(&account.waiting_for).zip(swarm.agents())
        {
            if fate.end.is_none() {
                let task = agent.status(swarm.now()).task;
                let waits =
                    if waits_for.is_empty() { String::new() } else { format!(", it waits for {waits_for}") };
                fate.end = Some(Err(format!("it is still under way: {task}{waits}")));
            }
        }
    }
}

fn told(rehearsal: &Rehearsal, scenario: &Scenario, flown: &[Flown], wall: Duration) -> Rehearsed {
    let vehicles: Vec<Played> = rehearsal
        .vehicles
        .iter()
        .enumerate()
        .map(|(index, actor)| played(actor, flown.iter().filter_map(|flight| flight.fates.get(index))))
        .collect();
    let count = |of: fn(&Truth) -> u32| flown.iter().map(|flight| of(&flight.truth)).sum::<u32>();
    let collisions = [count(|truth| truth.collisions_obstacle), count(|truth| truth.collisions_vehicle)];
    let all_arrive = vehicles.iter().zip(&rehearsal.vehicles);
    let all_arrive = all_arrive.clone().all(|(played, actor)| actor.held || played.arrives == flown.len());
    let ends = |flight: &Flown| {
        let fates = flight.fates.iter().zip(&rehearsal.vehicles).filter(|(_, actor)| !actor.held);
        fates.map(|(fate, _)| fate.lands_s).try_fold(0.0_f64, |latest, lands_s| Some(latest.max(lands_s?)))
    };
    let clearances = flown.iter().filter_map(|flight| flight.truth.min_clearance_m);
    Rehearsed {
        seeds: rehearsal.seeds.clone(),
        succeeded: all_arrive && collisions == [0, 0],
        ends_s: Range::of(flown.iter().filter_map(ends)),
        nearest: nearest(rehearsal, flown),
        clearance_m: clearances.min_by(f64::total_cmp),
        collisions,
        realtime_factor: flown.iter().map(|flight| flight.lasted_s).sum::<f64>()
            / wall.as_secs_f64().max(1e-9),
        notes: scenario.notes.clone(),
        vehicles,
    }
}

fn played<'a>(actor: &Actor, fates: impl Iterator<Item = &'a Fate>) -> Played {
    let fates: Vec<&Fate> = fates.collect();
    let mut waits_s: BTreeMap<&str, f64> = BTreeMap::new();
    let mut fails: BTreeMap<&str, usize> = BTreeMap::new();
    for fate in &fates {
        for (waits_for, seconds) in &fate.waits_s {
            *waits_s.entry(waits_for).or_default() += seconds / fates.len() as f64;
        }
        match &fate.end {
            Some(Err(_)) if actor.held => *fails.entry("it is held").or_default() += 1,
            Some(Err(why)) => *fails.entry(why).or_default() += 1,
            Some(Ok(())) | None => {}
        }
    }
    let wait = |(waits_for, mean_s): (&str, f64)| Wait { waits_for: waits_for.to_owned(), mean_s };
    let mut waits: Vec<Wait> = waits_s.into_iter().map(wait).collect();
    waits.sort_by(|a, b| b.mean_s.total_cmp(&a.mean_s));
    waits.truncate(WAITS_TOLD);
    Played {
        vehicle: actor.node.to_string(),
        arrives: fates.iter().filter(|fate| fate.end == Some(Ok(()))).count(),
        lands_s: Range::of(fates.iter().filter_map(|fate| fate.lands_s)),
        battery: Range::of(fates.iter().map(|fate| fate.battery)),
        waits,
        fails: fails.into_iter().map(|(why, seeds)| Failure { why: why.to_owned(), seeds }).collect(),
    }
}

/// The nearest moment of each pair, with whichever seed.
fn nearest(rehearsal: &Rehearsal, flown: &[Flown]) -> Vec<Nearness> {
    let mut least: BTreeMap<(usize, usize), (f64, f64, u64)> = BTreeMap::new();
    for flight in flown {
        for (pair, (distance_m, at_s)) in &flight.nearest {
            let known = least.entry(*pair).or_insert((f64::INFINITY, 0.0, 0));
            if *distance_m < known.0 {
                *known = (*distance_m, *at_s, flight.seed);
            }
        }
    }
    let name = |index: usize| rehearsal.vehicles[index].node.to_string();
    let nearness = |((i, j), (distance_m, at_s, seed)): ((usize, usize), (f64, f64, u64))| Nearness {
        who: [name(i), name(j)],
        distance_m,
        at_s,
        seed,
    };
    let mut nearest: Vec<Nearness> = least.into_iter().map(nearness).collect();
    nearest.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
    nearest.truncate(NEAREST_TOLD);
    nearest
}
