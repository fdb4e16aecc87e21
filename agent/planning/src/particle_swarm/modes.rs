//! The modes of a chain of numbers: how much of it swings as each half wave.

use std::f64::consts::PI;

/// The orthonormal discrete sine transform (DST-I) of chains of one length. It is its own inverse.
///
/// A chain of `n` numbers between two that are fixed, as the offsets of a route's waypoints are, is a sum of `n` half
/// waves. What a smooth route needs lies in the first few.
#[derive(Clone, Debug)]
pub(super) struct Modes {
    length: usize,
    /// Row after row.
    matrix: Vec<f64>,
}

impl Modes {
    pub(super) fn new(length: usize) -> Modes {
        let ends = (length + 1) as f64;
        let entry = |k: usize| {
            let (mode, place) = ((k / length + 1) as f64, (k % length + 1) as f64);
            (2.0 / ends).sqrt() * (PI * mode * place / ends).sin()
        };
        // A chain of one is itself.
        let matrix = if length == 1 { vec![1.0] } else { (0..length * length).map(entry).collect() };
        Modes { length, matrix }
    }

    /// Transforms every chain of `from` into `to`.
    pub(super) fn transform(&self, from: &[f64], to: &mut [f64]) {
        for (from, to) in from.chunks_exact(self.length).zip(to.chunks_exact_mut(self.length)) {
            to.fill(0.0);
            // The matrix is symmetric: its rows are its columns.
            for (value, column) in from.iter().zip(self.matrix.chunks_exact(self.length)) {
                for (sum, entry) in to.iter_mut().zip(column) {
                    *sum += value * entry;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_half_wave_is_one_mode_and_the_transform_its_own_inverse() {
        let modes = Modes::new(7);
        let wave: Vec<f64> = (1..=7).map(|k| (PI * 2.0 * f64::from(k) / 8.0).sin()).collect();
        let (mut amplitudes, mut back) = (vec![0.0; 7], vec![0.0; 7]);
        modes.transform(&wave, &mut amplitudes);
        for (mode, amplitude) in amplitudes.iter().enumerate() {
            let expected = if mode == 1 { 2.0 } else { 0.0 };
            assert!((amplitude - expected).abs() < 1e-12, "mode {mode}: {amplitude}");
        }
        modes.transform(&amplitudes, &mut back);
        assert!(wave.iter().zip(&back).all(|(one, other)| (one - other).abs() < 1e-12));
    }
}
