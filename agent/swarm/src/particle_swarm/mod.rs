//! Particle swarms (Kennedy and Eberhart 1995): search in a box by particles that remember their best places.
//!
//! One algorithm per file over one [`Swarm`]: an algorithm is a [`Motion`], which says how particles move. All of
//! them move by the same equation, [`Mover::attract`]; they spend evaluations, not time, can be interrupted after any
//! number of them, and go on where they stopped. The same seed and the same objective give the same result, bit for
//! bit.
//!
//! ```
//! use skein_swarm::particle_swarm::{Improved, ImprovedConfig, Objective, SearchSpace, Swarm};
//!
//! struct Sphere(SearchSpace);
//! impl Objective for Sphere {
//!     fn space(&self) -> &SearchSpace { &self.0 }
//!     fn cost_below(&mut self, _: f64, at: &[f64]) -> f64 { at.iter().map(|x| x * x).sum() }
//! }
//!
//! let mut sphere = Sphere(SearchSpace::new(vec![-10.0; 4], vec![10.0; 4])?);
//! let motion = Improved::new(&sphere.0, ImprovedConfig::default());
//! let mut swarm = Swarm::new(&sphere.0, motion, 30, 7);
//! swarm.run(&mut sphere, 1500);
//! assert!(swarm.best().cost < 5.0);
//! # Ok::<(), skein_swarm::particle_swarm::SearchSpaceError>(())
//! ```

mod improved;
mod modes;
mod space;
mod swarm;
mod tabu;

pub use self::improved::{Improved, ImprovedConfig};
pub use self::space::{SearchSpace, SearchSpaceError};
pub use self::swarm::{Best, Flock, Motion, Mover, Swarm};
pub use self::tabu::{TabuConfig, TabuSwarm};

/// A function to be minimised.
pub trait Objective {
    /// Its domain.
    fn space(&self) -> &SearchSpace;

    /// Its value at a position in the space, one number for each dimension; if that is not below `limit`, any number
    /// that is not. A swarm only needs to know values that are better than what it remembers.
    fn cost_below(&mut self, limit: f64, position: &[f64]) -> f64;
}
