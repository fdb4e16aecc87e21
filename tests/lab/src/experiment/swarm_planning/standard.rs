//! The standard particle swarm, with which P3 compares.

use rand_chacha::ChaCha8Rng;

use super::{Motion, Mover, SearchSpace};

/// `w = 0.9`, `c1 = c2 = 2` (P3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standard {
    /// Most that a particle moves at once, as a share of the box's width. P3 does not give it; the usual `vmax = xmax`
    /// (Eberhart and Shi 2000) is half the width of a box `-xmax..xmax`.
    pub max_step: f64,
}

impl Default for Standard {
    fn default() -> Self {
        Standard { max_step: 0.5 }
    }
}

impl Motion for Standard {
    fn accelerate(&mut self, mover: Mover<'_>, _: &SearchSpace, rng: &mut ChaCha8Rng) {
        mover.attract(0.9, 2.0, 2.0, rng);
    }

    fn max_step(&self) -> f64 {
        self.max_step
    }
}
