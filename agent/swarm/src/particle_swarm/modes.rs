//! The modes of a chain of numbers: how much of it swings as each half wave.

use std::f64::consts::PI;

/// The orthonormal discrete sine transform (DST-I) of chains of one length. It is its own inverse.
///
/// A chain of `n` numbers between two that are fixed, as the offsets of a route's waypoints are, is a sum of `n` half
/// waves. What a smooth route needs lies in the first few.
#[derive(Clone, Debug)]
pub(super) struct Modes {
    length: usize,
    /// The matrix in strips of [`LANES`] columns, filled up with zeros; in each strip row after row.
    strips: Vec<Vec<[f64; LANES]>>,
}

/// Sums that a processor takes at once.
const LANES: usize = 4;

impl Modes {
    pub(super) fn new(length: usize) -> Modes {
        let ends = (length + 1) as f64;
        let entry = |row: usize, column: usize| match (length, column < length) {
            // A chain of one is itself.
            (1, true) => 1.0,
            (_, true) => (2.0 / ends).sqrt() * (PI * ((row + 1) * (column + 1)) as f64 / ends).sin(),
            (_, false) => 0.0,
        };
        let strip = |strip: usize| {
            (0..length).map(|row| std::array::from_fn(|lane| entry(row, strip * LANES + lane))).collect()
        };
        Modes { length, strips: (0..length.div_ceil(LANES)).map(strip).collect() }
    }

    /// Transforms every chain of `from` into `to`.
    pub(super) fn transform(&self, from: &[f64], to: &mut [f64]) {
        for (from, to) in from.chunks_exact(self.length).zip(to.chunks_exact_mut(self.length)) {
            for (strip, to) in self.strips.iter().zip(to.chunks_mut(LANES)) {
                let mut sums = [0.0; LANES];
                for (value, entries) in from.iter().zip(strip) {
                    for (sum, entry) in sums.iter_mut().zip(entries) {
                        *sum += value * entry;
                    }
                }
                to.copy_from_slice(&sums[..to.len()]);
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
