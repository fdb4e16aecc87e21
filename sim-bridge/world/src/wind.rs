//! Wind: a mean and gusts.

use std::time::Duration;

use nalgebra::Vector3;

use crate::noise::Noise;

/// The wind, the same everywhere in the world. The default is still air.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindConfig {
    /// Mean velocity of the air, ENU, m/s.
    pub mean: Vector3<f64>,
    /// Standard deviation of each axis of the gusts, m/s.
    pub gust_sigma_m_s: f64,
    /// Correlation time of the gusts, s.
    pub gust_time_s: f64,
}

impl Default for WindConfig {
    fn default() -> Self {
        Self { mean: Vector3::zeros(), gust_sigma_m_s: 0.0, gust_time_s: 2.0 }
    }
}

/// Wind in the course of time: gusts are an Ornstein-Uhlenbeck process, the first-order form of
/// Dryden turbulence, sampled exactly.
#[derive(Debug, Clone)]
pub struct Wind {
    config: WindConfig,
    gust: Vector3<f64>,
    decay: f64,
    noise: Noise,
}

impl Wind {
    /// Wind that is asked every `step`.
    pub fn new(config: WindConfig, step: Duration, seed: u64) -> Self {
        let mut noise = Noise::new(seed, u64::MAX);
        let gust = noise.vector(config.gust_sigma_m_s);
        let decay = (-step.as_secs_f64() / config.gust_time_s.max(1e-3)).exp();
        Self { config, gust, decay, noise }
    }

    /// Velocity of the air in the next step, ENU, m/s.
    pub fn step(&mut self) -> Vector3<f64> {
        if self.config.gust_sigma_m_s > 0.0 {
            let kick = (1.0 - self.decay * self.decay).sqrt() * self.config.gust_sigma_m_s;
            self.gust = self.gust * self.decay + self.noise.vector(kick);
        }
        self.config.mean + self.gust
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn still_air_is_still() {
        let mut wind = Wind::new(WindConfig::default(), Duration::from_millis(4), 1);
        assert_eq!(wind.step(), Vector3::zeros());
    }

    #[test]
    fn gusts_keep_their_deviation_and_their_memory() {
        let config = WindConfig { mean: Vector3::new(3.0, 0.0, 0.0), gust_sigma_m_s: 1.0, gust_time_s: 0.2 };
        let mut wind = Wind::new(config, Duration::from_millis(4), 5);
        let samples: Vec<f64> = (0..100_000).map(|_| wind.step().x - 3.0).collect();
        let mean_of =
            |products: &mut dyn Iterator<Item = f64>, count: usize| products.sum::<f64>() / count as f64;
        let variance = mean_of(&mut samples.iter().map(|x| x * x), samples.len());
        let lagged =
            mean_of(&mut samples.windows(51).map(|window| window[0] * window[50]), samples.len() - 50);
        assert!((variance - 1.0).abs() < 0.15, "variance {variance}");
        // 50 steps of 4 ms are one correlation time.
        assert!((lagged / variance - (-1.0_f64).exp()).abs() < 0.1, "correlation {}", lagged / variance);
    }
}
