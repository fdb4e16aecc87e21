//! The acceleration of a vehicle, from its velocities.

use std::collections::VecDeque;
use std::time::Duration;

use nalgebra::Vector3;

/// The acceleration is the mean over this long: shorter ones are an estimate's noise.
const OVER: Duration = Duration::from_millis(100);
/// Velocities further apart than this tell nothing of now.
const GAP: Duration = Duration::from_millis(200);

/// The newest velocities, with the times at which they held; ENU, m/s.
#[derive(Clone, Debug, Default)]
pub struct Acceleration {
    velocities: VecDeque<(Duration, Vector3<f64>)>,
}

impl Acceleration {
    /// Nothing is known any more.
    pub fn forget(&mut self) {
        self.velocities.clear();
    }

    /// Takes in the velocity of now, and returns the acceleration, m/s²; zero while too little is known.
    pub fn follow(&mut self, now: Duration, velocity: Vector3<f64>) -> Vector3<f64> {
        if self.velocities.back().is_some_and(|(last, _)| now.saturating_sub(*last) > GAP) {
            self.forget();
        }
        self.velocities.push_back((now, velocity));
        let is_past = |(at, _): &(Duration, _)| now.saturating_sub(*at) >= OVER;
        while self.velocities.get(1).is_some_and(is_past) {
            self.velocities.pop_front();
        }
        match self.velocities.front() {
            Some((at, before)) if now - *at >= OVER => (velocity - before) / (now - *at).as_secs_f64(),
            _ => Vector3::zeros(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_acceleration_is_found_and_none_across_a_pause() {
        let mut acceleration = Acceleration::default();
        let mut at = |ms: u64| {
            let velocity = Vector3::new(2.0, -1.0, 0.0) * (ms as f64 / 1000.0);
            acceleration.follow(Duration::from_millis(ms), velocity)
        };
        assert_eq!(at(0), Vector3::zeros());
        let found: Vec<_> = (1..20).map(|tick| at(20 * tick)).collect();
        assert_eq!(found[3], Vector3::zeros(), "80 ms are too few");
        assert!(found[4..].iter().all(|found| (found - Vector3::new(2.0, -1.0, 0.0)).norm() < 1e-9));
        assert_eq!(at(700), Vector3::zeros());
    }
}
