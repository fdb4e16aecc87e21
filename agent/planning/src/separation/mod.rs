//! Keeping the distance: a repulsion that resolves encounters, and a filter that makes them safe.

mod filter;
mod halfspace;
mod repulsion;

use nalgebra::Vector3;

pub use filter::{Cause, FilterConfig, Filtered, Motion, Outcome, distance_kept_m, filter};
pub use repulsion::{RepulsionConfig, repulsion};

/// A neighbour is taken to keep its velocity no longer than this, seconds.
const EXTRAPOLATE_S: f64 = 0.5;

/// Another vehicle: its state as last heard, and how old and how certain that is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour {
    pub id: u32,
    /// Position then (ENU, metres).
    pub position: Vector3<f64>,
    /// Velocity then (ENU, m/s).
    pub velocity: Vector3<f64>,
    /// Standard deviation of the position, metres.
    pub sigma_m: f64,
    /// Age of the state, seconds, the time on the network included.
    pub age_s: f64,
    pub radius_m: f64,
    /// Whether it keeps its distance by the same rule. A vehicle flown by a pilot does not.
    pub cooperative: bool,
}

impl Neighbour {
    /// Where it should be now (ENU, metres): straight on for the state's age, half a second at most. One that
    /// is silent for longer stays there.
    pub fn predicted(&self) -> Vector3<f64> {
        self.position + self.velocity * self.age_s.clamp(0.0, EXTRAPOLATE_S)
    }

    /// Whether all its numbers are finite and none negative that must not be.
    pub(crate) fn is_sound(&self) -> bool {
        let numbers = self.position.iter().chain(self.velocity.iter()).chain([
            &self.sigma_m,
            &self.age_s,
            &self.radius_m,
        ]);
        numbers.copied().all(f64::is_finite) && self.sigma_m >= 0.0 && self.radius_m >= 0.0
    }
}
