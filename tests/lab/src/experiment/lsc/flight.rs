//! One mission: a world, its vehicles, their radio, and what came of it.
//!
//! Nobody plans for anybody else. The only things vehicles share are the map, the clock that starts with the mission,
//! and what they say to whoever is within range. Within each step they speak in turn, one every 4 ms: first all say
//! what they are committed to, for those who have come into range, then twice each plans, commits itself and says so.
//! The last word is said just before the step begins.

use std::sync::Arc;
use std::time::Duration;

use anyhow::Context as _;
use nalgebra::Vector3;
use skein_swarm::traffic::{Apart, Lattice, Roads, Traveller, TravellerConfig};
use skein_world::{
    Aabb, PositionErrors, STEP, Scene, Simulation, SimulationConfig, VehicleModel, VehicleSetup, WindConfig,
    vehicle::GpsModel,
};

use super::pilot::Pilot;
use crate::cpu_time;
use skein_sim::mission::{LscAgent, LscMission};

/// Cells of the lattice, as of the missions' starts and goals, m.
const CELL_M: f64 = 0.5;
/// A step of the lattice lasts as many ticks. With 28 a vehicle moves at 0.89 m/s and 1.59 m/s^2 at most: what is
/// left of the limits corrects.
const TICKS_PER_STEP: u64 = 28;
/// The agents' tick in steps of the world: 20 ms.
const STEPS_PER_TICK: u64 = 5;
/// Turns of each to speak before a step; it plans in every one but the first.
const ROUNDS: usize = 3;
/// Range of radio, m.
const RADIO_RANGE_M: f64 = 3.0;
/// Distance of hulls from obstacles in plans, m: for what the vehicle deviates from them.
const OBSTACLE_MARGIN_M: f64 = 0.07;
/// Distance of hulls from one another in plans, m. With more, commitments could meet before vehicles hear one another.
const VEHICLE_MARGIN_M: f64 = 0.1;
/// A vehicle is never planned lower than this, m.
const LEAST_HEIGHT_M: f64 = 0.4;
/// Most states that a plan expands.
const BUDGET: usize = 60_000;
/// At its goal, to within this, m, and slower than this, m/s.
const ARRIVED: (f64, f64) = (0.1, 0.1);
/// A mission that takes longer has failed, s.
const MOST_S: f64 = 240.0;
/// Vehicles that do not hover at their starts by then never will, s.
const MOST_BEFORE_S: f64 = 30.0;
/// Tracks are kept ten times a second, in steps of the world.
const STEPS_PER_TRACK_POINT: u64 = 25;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Space {
    /// At the height of their starts.
    Planar,
    Spatial,
}

/// The result of a mission.
#[derive(Debug, Clone, Default)]
pub struct Flown {
    /// Why it failed; `None` if it did not.
    pub reason: Option<String>,
    /// From hover to hover, s.
    pub flight_time_s: f64,
    /// Of all vehicles together, m.
    pub distance_m: f64,
    /// Least distance of two centres in the air, m.
    pub min_separation_m: f64,
    /// Least distance of a hull from an obstacle, m.
    pub min_clearance_m: f64,
    /// Least distance of a centre from the bounds, m, negative outside.
    pub min_to_bounds_m: f64,
    /// Greatest speed commanded on an axis, m/s.
    pub max_speed_m_s: f64,
    /// Greatest change of a command on an axis, m/s^2.
    pub max_accel_m_s2: f64,
    /// Greatest distance of a vehicle from where its itinerary and its lag put it, m.
    pub max_error_m: f64,
    /// CPU time of each plan, ms.
    pub plan_ms: Vec<f64>,
    /// The track of each vehicle, world ENU, m.
    pub tracks: Vec<Vec<Vector3<f64>>>,
}

/// Flies a mission.
///
/// # Errors
/// The mission cannot be flown at all.
pub fn fly(mission: &LscMission, scene: &Scene, space: Space, seed: u64) -> anyhow::Result<Flown> {
    Flight::new(mission, scene, space, seed)?.run()
}

struct Flight {
    simulation: Simulation,
    pilots: Vec<Pilot>,
    goals: Vec<Vector3<f64>>,
    bounds: Aabb,
    flown: Flown,
}

impl Flight {
    fn new(mission: &LscMission, scene: &Scene, space: Space, seed: u64) -> anyhow::Result<Self> {
        let scene = scene.clone().with_bounds(mission.bounds);
        let roads = Arc::new(roads(mission, &scene, space)?);
        let mut pilots = Vec::new();
        let mut vehicles = Vec::new();
        for (number, agent) in (0..).zip(&mission.agents) {
            on_lattice(&roads, number, agent)?;
            let apart = Apart {
                half_cells: 2.0 * (2.0 * agent.radius_m + VEHICLE_MARGIN_M) / CELL_M,
                downwash: agent.downwash,
            };
            let config = TravellerConfig { apart, budget: BUDGET };
            let traveller = Traveller::new(number, Arc::clone(&roads), &agent.start, &agent.goal, config)?;
            let index = pilots.len();
            pilots.push(Pilot::new(index, traveller, *agent, *scene.datum(), space == Space::Planar));
            vehicles.push(VehicleSetup {
                model: model(agent)?,
                position: Vector3::new(agent.start.x, agent.start.y, 0.0),
                yaw: 0.0,
                system_id: u8::try_from(index + 1).context("more vehicles than MAVLink has system ids")?,
                position_errors: PositionErrors::default(),
            });
        }
        let config = SimulationConfig { scene, vehicles, seed, wind: WindConfig::default() };
        Ok(Self {
            simulation: Simulation::new(config),
            goals: mission.agents.iter().map(|agent| agent.goal).collect(),
            bounds: mission.bounds,
            flown: Flown {
                min_to_bounds_m: f64::INFINITY,
                tracks: vec![Vec::new(); pilots.len()],
                ..Flown::default()
            },
            pilots,
        })
    }

    fn run(mut self) -> anyhow::Result<Flown> {
        if self.hover() {
            let distance_before = self.distance_m();
            self.flown.reason = self.travel()?;
            self.flown.distance_m = self.distance_m() - distance_before;
        } else {
            self.flown.reason = Some("not all vehicles came to hover at their starts".to_owned());
        }
        Ok(self.judged())
    }

    /// Everybody up to its start. Returns whether all hover there.
    fn hover(&mut self) -> bool {
        let mut hovered_since = None;
        while self.simulation.now().as_secs_f64() < MOST_BEFORE_S {
            let now = self.world_tick();
            let mut all = true;
            for pilot in &mut self.pilots {
                all &= pilot.prepare(now);
            }
            self.deliver();
            let since = *hovered_since.get_or_insert(now);
            if !all {
                hovered_since = None;
            } else if now.saturating_sub(since) >= Duration::from_secs(1) {
                return true;
            }
        }
        false
    }

    /// From starts to goals. Returns why that failed, if it did.
    fn travel(&mut self) -> anyhow::Result<Option<String>> {
        let steps_per_step = TICKS_PER_STEP * STEPS_PER_TICK;
        let step_s = steps_per_step as f64 * STEP.as_secs_f64();
        let turns = (ROUNDS * self.pilots.len()) as u64;
        // All have spoken one tick before the step begins.
        let first_turn = (steps_per_step - STEPS_PER_TICK)
            .checked_sub(turns)
            .context("more vehicles than can speak in turn within a step")?;
        for instant in 0.. {
            let (step, into) = (u32::try_from(instant / steps_per_step)?, instant % steps_per_step);
            if into >= first_turn && into - first_turn < turns {
                let turn = (into - first_turn) as usize;
                let (round, speaker) = (turn / self.pilots.len(), turn % self.pilots.len());
                if round > 0 {
                    self.plan(speaker, step + 1)?;
                }
                self.speak(speaker);
            }
            if instant.is_multiple_of(STEPS_PER_TICK) {
                let now = self.simulation.now();
                let phase = into as f64 / steps_per_step as f64;
                for pilot in &mut self.pilots {
                    pilot.fly(now, step, phase, step_s);
                }
                self.deliver();
            }
            self.world_step();
            self.observe(instant);
            self.flown.flight_time_s = (instant + 1) as f64 * STEP.as_secs_f64();
            if let Some(wrecked) = self.wrecked() {
                return Ok(Some(format!("vehicle {} crashed", wrecked + 1)));
            }
            if self.has_arrived(step) {
                return Ok(None);
            }
            if self.flown.flight_time_s > MOST_S {
                return Ok(Some(format!("not all vehicles arrived within {MOST_S} s")));
            }
        }
        Ok(None)
    }

    /// A vehicle plans, and commits itself by one step.
    fn plan(&mut self, speaker: usize, step: u32) -> anyhow::Result<()> {
        let Some(pilot) = self.pilots.get_mut(speaker) else { return Ok(()) };
        let (turn, took_ms) = cpu_time::measured_ms(|| pilot.traveller.take_turn(step))?;
        self.flown.plan_ms.extend(turn.map(|_| took_ms));
        Ok(())
    }

    /// A vehicle says what it knows to all within range.
    fn speak(&mut self, speaker: usize) {
        let (Some(pilot), Some(from)) = (self.pilots.get(speaker), self.position(speaker)) else { return };
        let words: Vec<_> = pilot.traveller.words().cloned().collect();
        for listener in 0..self.pilots.len() {
            let in_range =
                self.position(listener).is_some_and(|position| (position - from).norm() <= RADIO_RANGE_M);
            if let Some(pilot) = self.pilots.get_mut(listener).filter(|_| in_range && listener != speaker) {
                words.iter().for_each(|word| pilot.traveller.hear(word));
            }
        }
    }

    /// The world until the agents' next tick. Returns the time then.
    fn world_tick(&mut self) -> Duration {
        for _ in 0..STEPS_PER_TICK {
            self.world_step();
        }
        self.simulation.now()
    }

    fn world_step(&mut self) {
        self.simulation.step();
        let now = self.simulation.now();
        for (index, pilot) in self.pilots.iter_mut().enumerate() {
            pilot.receive(now, &self.simulation.receive(index));
        }
    }

    /// Passes the agents' MAVLink to the autopilots.
    fn deliver(&mut self) {
        for (index, pilot) in self.pilots.iter_mut().enumerate() {
            self.simulation.send(index, &pilot.take_output());
        }
    }

    fn observe(&mut self, instant: u64) {
        for index in 0..self.pilots.len() {
            let (Some(position), Some(pilot)) = (self.position(index), self.pilots.get(index)) else {
                continue;
            };
            let to_bounds = (position - self.bounds.min).min().min((self.bounds.max - position).min());
            self.flown.min_to_bounds_m = self.flown.min_to_bounds_m.min(to_bounds);
            let error_m = (position - pilot.tracker().expected()).xy().norm();
            self.flown.max_error_m = self.flown.max_error_m.max(error_m);
            if let Some(track) = self.flown.tracks.get_mut(index)
                && instant.is_multiple_of(STEPS_PER_TRACK_POINT)
            {
                track.push(position);
            }
        }
    }

    fn position(&self, index: usize) -> Option<Vector3<f64>> {
        self.simulation.vehicle(index).map(|vehicle| vehicle.motion.position)
    }

    fn distance_m(&self) -> f64 {
        let vehicles = (0..self.pilots.len()).filter_map(|index| self.simulation.vehicle(index));
        vehicles.map(|vehicle| vehicle.path_length_m).sum()
    }

    fn wrecked(&self) -> Option<usize> {
        (0..self.pilots.len())
            .find(|index| self.simulation.vehicle(*index).is_some_and(|vehicle| vehicle.crashed))
    }

    fn has_arrived(&self, step: u32) -> bool {
        let (within_m, slower_m_s) = ARRIVED;
        self.goals.iter().zip(&self.pilots).enumerate().all(|(index, (goal, pilot))| {
            pilot.traveller.is_home(step)
                && self.simulation.vehicle(index).is_some_and(|vehicle| {
                    (vehicle.motion.position - goal).norm() < within_m
                        && vehicle.motion.velocity.norm() < slower_m_s
                })
        })
    }

    /// The record, with what the referee has seen.
    fn judged(mut self) -> Flown {
        let truth = self.simulation.truth();
        let greatest = |of: fn(&Pilot) -> f64| self.pilots.iter().map(of).fold(0.0, f64::max);
        self.flown.max_speed_m_s = greatest(|pilot| pilot.tracker().greatest_speed_m_s());
        self.flown.max_accel_m_s2 = greatest(|pilot| pilot.tracker().greatest_accel_m_s2());
        self.flown.min_separation_m = truth.min_separation_m.unwrap_or(f64::INFINITY);
        self.flown.min_clearance_m = truth.min_clearance_m.unwrap_or(f64::INFINITY);
        let collisions = truth.collisions_obstacle + truth.collisions_vehicle;
        if collisions > 0 && self.flown.reason.is_none() {
            self.flown.reason = Some(format!("{collisions} collisions"));
        }
        self.flown
    }
}

/// The places where one can fly.
fn roads(mission: &LscMission, scene: &Scene, space: Space) -> anyhow::Result<Roads> {
    let agents = || mission.agents.iter();
    let through = agents().map(|agent| agent.start).next().context("a mission without agents")?;
    let hull_m = agents().map(|agent| agent.radius_m).fold(0.0, f64::max);
    let mut least = mission.bounds.min.add_scalar(hull_m);
    let mut greatest = mission.bounds.max.add_scalar(-hull_m);
    match space {
        Space::Planar => (least.z, greatest.z) = (through.z, through.z),
        Space::Spatial => least.z = least.z.max(LEAST_HEIGHT_M),
    }
    let lattice = Lattice::new(least, greatest, through, CELL_M);
    Ok(Roads::new(lattice, |point| scene.clearance(point), hull_m + OBSTACLE_MARGIN_M))
}

/// Starts and goals are in the middle of cells.
fn on_lattice(roads: &Roads, number: u32, agent: &LscAgent) -> anyhow::Result<()> {
    for (what, point) in [("start", agent.start), ("goal", agent.goal)] {
        let cell = roads.lattice().nearest(&point).map(|state| state.place.map(f64::from).into());
        let off = cell.map(|place| (roads.lattice().point(&place) - point).amax());
        anyhow::ensure!(
            off.is_none_or(|off| off < 0.01),
            "agent {}: its {what} is {:.2} m off the lattice of {CELL_M} m through the first agent's start; move it",
            number + 1,
            off.unwrap_or_default()
        );
    }
    Ok(())
}

/// The vehicle, with a motion-capture system in place of its satellite receiver: 5 mm at 50 Hz.
fn model(agent: &LscAgent) -> anyhow::Result<VehicleModel> {
    let mut model = VehicleModel::built_in("crazyflie")?;
    model.hull_radius_m = agent.radius_m;
    (model.max_climb_m_s, model.max_descent_m_s) = (agent.max_speed_m_s.z, agent.max_speed_m_s.z);
    model.gps = Some(GpsModel {
        sigma_horizontal_m: 0.005,
        sigma_vertical_m: 0.005,
        sigma_velocity_m_s: 0.05,
        rate_hz: 50.0,
    });
    Ok(model)
}
