//! The swarm that all algorithms share.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::{Objective, SearchSpace};

/// The motion of an algorithm's particles.
pub trait Motion {
    /// Told of before every generation but the first, which only looks at where the particles begin.
    fn begin_generation(&mut self, _: &Flock) {}

    /// Gives a particle its next velocity.
    fn accelerate(&mut self, mover: Mover<'_>, space: &SearchSpace, rng: &mut ChaCha8Rng);

    /// Most that a particle may move at once, as a share of the box's width.
    fn max_step(&self) -> f64;
}

/// The particles' positions and memories. Particle after particle, a position is `dimensions` numbers.
#[derive(Clone, Debug)]
pub struct Flock {
    space: SearchSpace,
    positions: Vec<f64>,
    velocities: Vec<f64>,
    bests: Vec<f64>,
    best_costs: Vec<f64>,
    leader: Best,
}

/// The best position found so far.
#[derive(Clone, Debug, PartialEq)]
pub struct Best {
    pub position: Vec<f64>,
    /// The objective there; infinite before the first evaluation.
    pub cost: f64,
}

/// A particle about to move.
pub struct Mover<'a> {
    pub position: &'a [f64],
    /// Its velocity so far, to be replaced by the next one.
    pub velocity: &'a mut [f64],
    /// `pbest`: the best place it has been at.
    pub own_best: &'a [f64],
    /// `gbest`: the best place that any particle had been at when this generation began.
    pub leader: &'a [f64],
}

/// A swarm in search of an objective's least value.
#[derive(Clone, Debug)]
pub struct Swarm<M> {
    motion: M,
    flock: Flock,
    best: Best,
    rng: ChaCha8Rng,
    /// The particle whose turn it is.
    turn: usize,
    evaluations: usize,
}

/// A number in 0..1, of 32 random bits: no search needs more, and half of its time would go into them.
pub(super) fn unit(rng: &mut ChaCha8Rng) -> f64 {
    f64::from(rng.next_u32()) / 4_294_967_296.0
}

impl Mover<'_> {
    /// The equation of motion, `v = w v + c1 r1 (pbest - x) + c2 r2 (gbest - x)` (P3), with random numbers `r1` and
    /// `r2` in 0..1 of their own for each dimension.
    pub fn attract(self, inertia: f64, c1: f64, c2: f64, rng: &mut ChaCha8Rng) {
        let places = self.position.iter().zip(self.own_best).zip(self.leader);
        for (velocity, ((at, own), leader)) in self.velocity.iter_mut().zip(places) {
            let (r1, r2) = (unit(rng), unit(rng));
            *velocity = inertia * *velocity + c1 * r1 * (own - at) + c2 * r2 * (leader - at);
        }
    }
}

impl Flock {
    /// Positions of all particles, one after another.
    pub fn positions(&self) -> &[f64] {
        &self.positions
    }

    /// Mean distance of the particles from where they were `then`, along each dimension as a share of its width.
    pub fn mean_distance(&self, then: &[f64]) -> f64 {
        let dimensions = self.space.dimensions();
        let moved = self.positions.iter().zip(then).enumerate();
        let sum: f64 =
            moved.map(|(k, (now, then))| (now - then).abs() / self.space.width(k % dimensions)).sum();
        sum / self.positions.len() as f64
    }
}

impl<M: Motion> Swarm<M> {
    /// A swarm of `size` particles at places drawn evenly from the whole box, at rest.
    pub fn new(space: &SearchSpace, motion: M, size: usize, seed: u64) -> Swarm<M> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let dimensions = space.dimensions();
        let size = size.max(1);
        let positions = (0..size * dimensions)
            .map(|k| {
                let share = unit(&mut rng);
                space.lower()[k % dimensions] + share * space.width(k % dimensions)
            })
            .collect();
        let nowhere = Best { position: vec![0.0; dimensions], cost: f64::INFINITY };
        let flock = Flock {
            space: space.clone(),
            positions,
            velocities: vec![0.0; size * dimensions],
            bests: vec![0.0; size * dimensions],
            best_costs: vec![f64::INFINITY; size],
            leader: nowhere.clone(),
        };
        Swarm { motion, flock, best: nowhere, rng, turn: 0, evaluations: 0 }
    }

    /// The same swarm with its first particles at the places given, of which each is brought into the box.
    pub fn starting_at<'a>(mut self, places: impl IntoIterator<Item = &'a [f64]>) -> Swarm<M> {
        let dimensions = self.flock.space.dimensions();
        for (position, place) in self.flock.positions.chunks_exact_mut(dimensions).zip(places) {
            for (dimension, (at, value)) in position.iter_mut().zip(place).enumerate() {
                *at = self.flock.space.clamp(dimension, *value);
            }
        }
        self
    }

    /// Goes on for so many evaluations.
    pub fn run(&mut self, objective: &mut impl Objective, evaluations: usize) {
        for _ in 0..evaluations {
            self.step(objective);
        }
    }

    /// Moves one particle, whose turn it is, and evaluates where it has come to.
    pub fn step(&mut self, objective: &mut impl Objective) {
        if self.evaluations >= self.size() {
            self.move_particle();
        }
        let dimensions = self.flock.space.dimensions();
        let here = self.turn * dimensions..(self.turn + 1) * dimensions;
        let position = &self.flock.positions[here.clone()];
        let cost = objective.cost_below(self.flock.best_costs[self.turn], position);
        self.evaluations += 1;
        if cost < self.flock.best_costs[self.turn] {
            self.flock.best_costs[self.turn] = cost;
            self.flock.bests[here].copy_from_slice(position);
        }
        if cost < self.best.cost {
            self.best.cost = cost;
            self.best.position.copy_from_slice(position);
        }
        self.turn += 1;
        if self.turn == self.size() {
            self.turn = 0;
            self.flock.leader.clone_from(&self.best);
            self.motion.begin_generation(&self.flock);
        }
    }

    fn move_particle(&mut self) {
        let Flock { space, positions, velocities, bests, leader, .. } = &mut self.flock;
        let dimensions = space.dimensions();
        let here = self.turn * dimensions..(self.turn + 1) * dimensions;
        let (position, velocity) = (&mut positions[here.clone()], &mut velocities[here.clone()]);
        let mover =
            Mover { position, velocity: &mut *velocity, own_best: &bests[here], leader: &leader.position };
        self.motion.accelerate(mover, space, &mut self.rng);
        for (dimension, (at, speed)) in position.iter_mut().zip(velocity).enumerate() {
            let most = self.motion.max_step() * space.width(dimension);
            *speed = speed.clamp(-most, most);
            let next = *at + *speed;
            *at = space.clamp(dimension, next);
            if *at != next {
                *speed = 0.0;
            }
        }
    }

    /// Tells the swarm of a place found by other means. It leads from then on if it is the best.
    pub(super) fn learn(&mut self, position: &[f64], cost: f64) {
        if cost < self.best.cost {
            self.best.position.copy_from_slice(position);
            self.best.cost = cost;
            self.flock.leader.clone_from(&self.best);
        }
    }

    /// The best found so far.
    pub fn best(&self) -> &Best {
        &self.best
    }

    pub fn motion(&self) -> &M {
        &self.motion
    }

    pub fn size(&self) -> usize {
        self.flock.best_costs.len()
    }

    /// Evaluations spent so far.
    pub fn evaluations(&self) -> usize {
        self.evaluations
    }
}
