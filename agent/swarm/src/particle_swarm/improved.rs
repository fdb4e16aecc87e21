//! The improved particle swarm (P3): what a vehicle plans with onboard.

use std::collections::VecDeque;

use rand_chacha::ChaCha8Rng;

use super::modes::Modes;
use super::swarm::unit;
use super::{Flock, Motion, Mover, SearchSpace};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImprovedConfig {
    /// `wmin`: the inertia while particles move far.
    pub inertia_min: f64,
    /// `wmax`: the inertia while they hardly move.
    pub inertia_max: f64,
    /// `c1` and `c2`.
    pub attraction: f64,
    /// `lambda1`: particles that move by this share of the box or more move far.
    pub lambda1: f64,
    /// `lambda2`: particles that move by this share of the box or less hardly move.
    pub lambda2: f64,
    /// `k`: generations over which it is seen how far they move.
    pub generations: usize,
    /// Shift by an escape of what attracts, as a share of the box's width.
    pub kick: f64,
    /// Most that a particle moves at once, as a share of the box's width.
    pub max_step: f64,
}

impl Default for ImprovedConfig {
    fn default() -> Self {
        ImprovedConfig {
            inertia_min: 0.2,
            inertia_max: 0.4,
            attraction: 1.494,
            lambda1: 0.3,
            lambda2: 0.1,
            generations: 5,
            kick: 0.03,
            max_step: 0.5,
        }
    }
}

/// P3's improvements of the particle swarm, in the coordinates in which routes are simple.
///
/// * *Inertia.* Let `delta` be the mean distance, as a share of the box's width, between where particles are and where
///   they were `k` generations ago. `delta >= lambda1`: `w = wmin`; `delta <= lambda2`: `w = wmax`; between: unchanged.
/// * *Escape.* While `delta <= lambda2`, `pbest' = rand1 pbest` and `gbest' = rand2 gbest` attract instead of `pbest`
///   and `gbest`, which are kept. P3 scales about the origin of coordinates, so that the result depends on where that
///   is; here positions count from the search space's centre, and a shift in proportion to the box's width is added.
/// * *Modes.* Random numbers are drawn for each mode of a chain of coordinates, not for each coordinate. A random mix
///   of two smooth routes is then smooth, and an escape smooths; coordinate by coordinate it would be jagged. The
///   shift of mode `m` goes with `1 / m^2`, as the modes of a taut string do.
///
/// P3 does not give `wmin` and `wmax`. The shift makes up for the inertia: swarms with `w` above 0.5 do not settle
/// within 50 generations.
#[derive(Clone, Debug)]
pub struct Improved {
    config: ImprovedConfig,
    modes: Modes,
    inertia: f64,
    is_stuck: bool,
    /// All positions of the last generations, the oldest first.
    past: VecDeque<Vec<f64>>,
    /// Memory for the modes of what attracts and is attracted.
    own_best: Vec<f64>,
    leader: Vec<f64>,
    position: Vec<f64>,
    offset: Vec<f64>,
}

impl Improved {
    /// For swarms in this space.
    pub fn new(space: &SearchSpace, config: ImprovedConfig) -> Improved {
        let zeros = vec![0.0; space.dimensions()];
        Improved {
            config,
            modes: Modes::new(space.chain()),
            inertia: config.inertia_max,
            is_stuck: false,
            past: VecDeque::new(),
            own_best: zeros.clone(),
            leader: zeros.clone(),
            position: zeros.clone(),
            offset: zeros,
        }
    }

    /// `w` at present.
    pub fn inertia(&self) -> f64 {
        self.inertia
    }

    /// The swarm is judged stuck, and escapes.
    pub fn is_stuck(&self) -> bool {
        self.is_stuck
    }
}

impl Motion for Improved {
    fn begin_generation(&mut self, flock: &Flock) {
        let then = if self.past.len() >= self.config.generations { self.past.pop_front() } else { None };
        if let Some(then) = &then {
            let moved = flock.mean_distance(then);
            if moved >= self.config.lambda1 {
                self.inertia = self.config.inertia_min;
            } else if moved <= self.config.lambda2 {
                self.inertia = self.config.inertia_max;
            }
            self.is_stuck = moved <= self.config.lambda2;
        }
        let mut now = then.unwrap_or_default();
        now.clear();
        now.extend_from_slice(flock.positions());
        self.past.push_back(now);
    }

    fn accelerate(&mut self, mover: Mover<'_>, space: &SearchSpace, rng: &mut ChaCha8Rng) {
        for (place, amplitudes) in [
            (mover.own_best, &mut self.own_best),
            (mover.leader, &mut self.leader),
            (mover.position, &mut self.position),
        ] {
            for ((offset, value), centre) in self.offset.iter_mut().zip(place).zip(space.centre()) {
                *offset = value - centre;
            }
            self.modes.transform(&self.offset, amplitudes);
        }
        let c = self.config.attraction;
        let kick = self.config.kick * (space.chain() as f64).sqrt();
        let amplitudes = self.own_best.iter().zip(&self.leader).zip(&mut self.position).enumerate();
        for (dimension, ((own, leader), at)) in amplitudes {
            let (mut own, mut leader) = (*own, *leader);
            if self.is_stuck {
                let mode = (dimension % space.chain() + 1) as f64;
                let shift = kick * space.width(dimension) / (mode * mode);
                let mut perturb = |value: f64| {
                    let (rand, sway) = (unit(rng), unit(rng));
                    rand * value + (2.0 * sway - 1.0) * shift
                };
                (own, leader) = (perturb(own), perturb(leader));
            }
            let (r1, r2) = (unit(rng), unit(rng));
            *at = c * r1 * (own - *at) + c * r2 * (leader - *at);
        }
        self.modes.transform(&self.position, &mut self.offset);
        for (velocity, attraction) in mover.velocity.iter_mut().zip(&self.offset) {
            *velocity = self.inertia * *velocity + attraction;
        }
    }

    fn max_step(&self) -> f64 {
        self.config.max_step
    }
}
