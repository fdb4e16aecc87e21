//! Seeded Gaussian noise.

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// A stream of normal numbers. Streams of one seed are independent, so that one instrument more
/// or less does not change what the others say.
#[derive(Debug, Clone)]
pub(crate) struct Noise {
    rng: ChaCha8Rng,
    /// Numbers come in pairs; this is the one not yet used.
    spare: Option<f64>,
}

impl Noise {
    pub(crate) fn new(seed: u64, stream: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        Self { rng, spare: None }
    }

    /// A number of mean 0 and standard deviation `sigma`.
    pub(crate) fn normal(&mut self, sigma: f64) -> f64 {
        sigma * self.spare.take().unwrap_or_else(|| self.draw_pair())
    }

    /// Three independent numbers of mean 0 and standard deviation `sigma`.
    pub(crate) fn vector(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::new(self.normal(sigma), self.normal(sigma), self.normal(sigma))
    }

    /// Marsaglia's polar method.
    fn draw_pair(&mut self) -> f64 {
        loop {
            let (x, y) = (2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0);
            let square = x * x + y * y;
            if square > 0.0 && square < 1.0 {
                let scale = (-2.0 * square.ln() / square).sqrt();
                self.spare = Some(y * scale);
                return x * scale;
            }
        }
    }

    /// In [0, 1), 53 bits.
    fn uniform(&mut self) -> f64 {
        (self.rng.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn has_the_mean_and_deviation_asked_for() {
        let mut noise = Noise::new(7, 0);
        let samples: Vec<f64> = (0..20_000).map(|_| noise.normal(0.5)).collect();
        let mean = samples.iter().sum::<f64>() / 20_000.0;
        let variance = samples.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / 20_000.0;
        assert!(mean.abs() < 0.015, "mean {mean}");
        assert!((variance.sqrt() - 0.5).abs() < 0.01, "sigma {}", variance.sqrt());
    }

    #[test]
    fn streams_differ_and_repeat() {
        let draw = |stream| Noise::new(3, stream).normal(1.0);
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1), draw(2));
    }
}
