//! The particle swarm with constriction (Clerc and Kennedy 2002).

use rand_chacha::ChaCha8Rng;

use super::{Motion, Mover, SearchSpace};

/// `chi = 0.729`, `c1 = c2 = 1.494`: what `phi = 4.1` gives, with which a swarm contracts by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constriction {
    /// Most that a particle moves at once, as a share of the box's width.
    pub max_step: f64,
}

impl Default for Constriction {
    fn default() -> Self {
        Constriction { max_step: 0.5 }
    }
}

impl Motion for Constriction {
    fn accelerate(&mut self, mover: Mover<'_>, _: &SearchSpace, rng: &mut ChaCha8Rng) {
        mover.attract(0.729, 1.494, 1.494, rng);
    }

    fn max_step(&self) -> f64 {
        self.max_step
    }
}
