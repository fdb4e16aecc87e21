//! The vehicles of these tests: point masses that lag behind their commands, hear of one another late, and do
//! not quite know where they are.

use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use skein_planning::local::braking::stopping_speed;
use skein_planning::separation::{
    FilterConfig, Motion, Neighbour, Outcome, RepulsionConfig, filter, repulsion,
};

const STEP_S: f64 = 0.004;
const STEPS_PER_TICK: u32 = 5;
/// Ticks of 20 ms from one broadcast, and position fix, to the next.
const TICKS_PER_STATE: u32 = 5;
const TICK_S: f64 = 0.02;

pub const LAG_S: f64 = 0.3;
pub const ACCEL_M_S2: f64 = 3.0;
pub const CRUISE_M_S: f64 = 2.5;
pub const SIGMA_M: f64 = 0.05;

#[derive(Clone, Debug)]
pub struct Vehicle {
    pub position: Vector3<f64>,
    pub velocity: Vector3<f64>,
    pub goal: Vector3<f64>,
    /// A vehicle that flies straight on whatever comes.
    pub stubborn: bool,
    error: Vector3<f64>,
    command: Vector3<f64>,
    sent: Vec<(u32, Vector3<f64>, Vector3<f64>)>,
}

impl Vehicle {
    pub fn new(position: Vector3<f64>, goal: Vector3<f64>) -> Vehicle {
        Vehicle {
            position,
            velocity: Vector3::zeros(),
            goal,
            stubborn: false,
            error: Vector3::zeros(),
            command: Vector3::zeros(),
            sent: Vec::new(),
        }
    }

    fn believed(&self) -> Vector3<f64> {
        self.position + self.error
    }

    fn has_arrived(&self) -> bool {
        (self.position - self.goal).norm() < 0.3
    }
}

/// Decides where a vehicle wants to go.
pub trait Pilot {
    /// The velocity wanted, and the obstacle points known, of a vehicle that believes to be at `position` and truly
    /// is at `truth`.
    fn decide(&mut self, position: &Vector3<f64>, truth: &Vector3<f64>) -> (Vector3<f64>, Vec<Vector3<f64>>);
}

pub struct Swarm {
    /// One for each vehicle, or none: then all go straight to their goals.
    pub pilots: Vec<Box<dyn Pilot>>,
    pub vehicles: Vec<Vehicle>,
    pub obstacles: Vec<Vector3<f64>>,
    pub planar: bool,
    pub filter: FilterConfig,
    pub repulsion: Option<RepulsionConfig>,
    /// Share of broadcasts that reach nobody.
    pub loss: f64,
    /// Ticks that a broadcast takes.
    pub delay_ticks: u32,
    rng: ChaCha8Rng,
    ticks: u32,
}

/// What happened in a flight.
#[derive(Clone, Copy, Debug)]
pub struct Flight {
    pub arrived: bool,
    pub time_s: f64,
    pub min_separation_m: f64,
    pub min_clearance_m: f64,
    pub infeasible_ticks: u32,
}

impl Default for Flight {
    fn default() -> Self {
        Flight {
            arrived: false,
            time_s: 0.0,
            min_separation_m: f64::INFINITY,
            min_clearance_m: f64::INFINITY,
            infeasible_ticks: 0,
        }
    }
}

impl Swarm {
    pub fn new(vehicles: Vec<Vehicle>, seed: u64) -> Swarm {
        Swarm {
            pilots: Vec::new(),
            vehicles,
            obstacles: Vec::new(),
            planar: true,
            filter: FilterConfig::default(),
            repulsion: Some(RepulsionConfig::default()),
            loss: 0.0,
            delay_ticks: 5,
            rng: ChaCha8Rng::seed_from_u64(seed),
            ticks: 0,
        }
    }

    /// Flies until all have arrived, or the time is up.
    pub fn fly_home(&mut self, limit_s: f64) -> Flight {
        let mut flight = Flight::default();
        while !flight.arrived && flight.time_s < limit_s {
            self.tick(&mut flight);
            flight.arrived = self.vehicles.iter().all(Vehicle::has_arrived);
        }
        flight
    }

    /// Flies on for a while, adding to a flight begun.
    pub fn fly_on(&mut self, time_s: f64, flight: &mut Flight) {
        let until_s = flight.time_s + time_s;
        while flight.time_s < until_s {
            self.tick(flight);
        }
    }

    fn tick(&mut self, flight: &mut Flight) {
        for at in 0..self.vehicles.len() {
            if (self.ticks + at as u32).is_multiple_of(TICKS_PER_STATE) {
                let error = Vector3::from_fn(|_, _| gaussian(&mut self.rng) * SIGMA_M);
                let vehicle = &mut self.vehicles[at];
                vehicle.error = error;
                if vehicle.sent.is_empty() || uniform(&mut self.rng, 0.0, 1.0) >= self.loss {
                    vehicle.sent.push((self.ticks, vehicle.believed(), vehicle.velocity));
                }
            }
        }
        let commands: Vec<_> = (0..self.vehicles.len()).map(|at| self.command(at, flight)).collect();
        for (vehicle, command) in self.vehicles.iter_mut().zip(commands) {
            vehicle.command = command;
        }
        for _ in 0..STEPS_PER_TICK {
            for vehicle in &mut self.vehicles {
                let wanted = (vehicle.command - vehicle.velocity) / LAG_S;
                let accel = if wanted.norm() > ACCEL_M_S2 { wanted.normalize() * ACCEL_M_S2 } else { wanted };
                vehicle.velocity += accel * STEP_S;
                vehicle.position += vehicle.velocity * STEP_S;
            }
            self.measure(flight);
        }
        self.ticks += 1;
        flight.time_s += TICK_S;
    }

    fn command(&mut self, at: usize, flight: &mut Flight) -> Vector3<f64> {
        let vehicle = &self.vehicles[at];
        let position = vehicle.believed();
        let (mut desired, seen) = match self.pilots.get_mut(at) {
            Some(pilot) => pilot.decide(&position, &vehicle.position),
            None => (straight(&(vehicle.goal - position), self.planar), Vec::new()),
        };
        if vehicle.stubborn {
            return desired;
        }
        let neighbours: Vec<_> = (0..self.vehicles.len())
            .filter(|other| *other != at)
            .filter_map(|other| self.heard(other))
            .collect();
        if let Some(config) = &self.repulsion {
            desired += repulsion(&position, &desired, &neighbours, config);
        }
        let motion = Motion {
            position,
            velocity: self.vehicles[at].velocity,
            acceleration: Vector3::zeros(),
            sigma_m: SIGMA_M,
            desired,
            planar: self.planar,
        };
        let obstacles = if seen.is_empty() { &self.obstacles } else { &seen };
        let filtered = filter(&motion, &neighbours, obstacles, &self.filter);
        if matches!(filtered.outcome, Outcome::Infeasible { .. }) {
            flight.infeasible_ticks += 1;
        }
        filtered.velocity
    }

    fn heard(&self, other: usize) -> Option<Neighbour> {
        let vehicle = &self.vehicles[other];
        let (sent, position, velocity) = vehicle
            .sent
            .iter()
            .rev()
            .find(|(sent, ..)| sent + self.delay_ticks <= self.ticks)
            .or(vehicle.sent.first())?;
        Some(Neighbour {
            id: other as u32,
            position: *position,
            velocity: *velocity,
            sigma_m: SIGMA_M,
            age_s: f64::from(self.ticks - sent) * TICK_S,
            radius_m: 0.25,
            cooperative: !vehicle.stubborn,
        })
    }

    fn measure(&self, flight: &mut Flight) {
        for (at, vehicle) in self.vehicles.iter().enumerate() {
            for other in &self.vehicles[at + 1..] {
                flight.min_separation_m =
                    flight.min_separation_m.min((vehicle.position - other.position).norm());
            }
            for point in &self.obstacles {
                // Obstacle points are columns.
                let mut offset = vehicle.position - point;
                offset.z = (offset.z.abs() - self.filter.obstacle_half_height_m).max(0.0);
                flight.min_clearance_m = flight.min_clearance_m.min(offset.norm());
            }
        }
    }
}

/// Velocity that comes to rest at a goal.
fn straight(to_goal: &Vector3<f64>, planar: bool) -> Vector3<f64> {
    let speed = stopping_speed(to_goal.norm(), 1.5, 0.5).min(CRUISE_M_S);
    let mut desired = to_goal.try_normalize(1e-6).unwrap_or_default() * speed;
    if planar {
        desired.z = to_goal.z.clamp(-0.5, 0.5);
    }
    desired
}

pub fn gaussian(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| uniform(rng, 0.0, 1.0)).sum::<f64>() - 6.0
}

pub fn uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    let unit = (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    low + (high - low) * unit
}
