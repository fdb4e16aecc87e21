//! The black and white cells within a quadrilateral.

use nalgebra::Vector2;

use super::dictionary::{Dictionary, Identity};
use super::grey::Grey;
use super::homography::Homography;
use super::quadrilateral::Corners;

/// Samples along a side of a cell.
const SAMPLES: usize = 3;
/// The share of a cell's side that is left out on both sides.
const MARGIN: f64 = 0.2;
/// Samples that differ less than this, as a standard deviation in grey levels, are all of one colour.
const LEAST_SPREAD: f64 = 5.0;
/// So many of the border's cells may be white, as a share of the data's.
const WRONG_BORDER: f64 = 0.35;

/// The marker that a quadrilateral is, its first corner taken for the upper left.
pub(super) fn read(image: &Grey, corners: &Corners, dictionary: &Dictionary) -> Option<Identity> {
    let cells = dictionary.cells();
    let samples = sample(image, corners, cells)?;
    let threshold = otsu(samples.iter().flatten())?;
    let is_white = |cell: &[u8]| {
        let sum: u32 = cell.iter().copied().map(u32::from).sum();
        sum > u32::from(threshold) * cell.len() as u32
    };
    let (mut bits, mut wrong) = (0_u64, 0.0);
    for (index, cell) in samples.iter().enumerate() {
        let (row, column) = (index / cells, index % cells);
        let is_border = row == 0 || column == 0 || row == cells - 1 || column == cells - 1;
        match (is_border, is_white(cell)) {
            (true, true) => wrong += 1.0,
            (true, false) => {}
            (false, white) => bits = bits << 1 | u64::from(white),
        }
    }
    let allowed = WRONG_BORDER * (dictionary.side() * dictionary.side()) as f64;
    (wrong <= allowed).then(|| dictionary.identify(bits)).flatten()
}

/// The brightness at places all over each cell, row by row.
fn sample(image: &Grey, corners: &Corners, cells: usize) -> Option<Vec<[u8; SAMPLES * SAMPLES]>> {
    let side = cells as f64;
    let square = [[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]].map(Vector2::from);
    let to_image = Homography::between(square.into_iter().zip(*corners))?;
    let place = |sample: usize| MARGIN + (1.0 - 2.0 * MARGIN) * sample as f64 / (SAMPLES - 1) as f64;
    let cell = |index: usize| {
        let (row, column) = ((index / cells) as f64, (index % cells) as f64);
        std::array::from_fn(|n| {
            let within = Vector2::new(column + place(n % SAMPLES), row + place(n / SAMPLES));
            image.sample(to_image.map(within)) as u8
        })
    };
    Some((0..cells * cells).map(cell).collect())
}

/// The brightness that best parts dark samples from bright ones (Otsu 1979); those above it are bright. `None` if
/// all are about as bright.
fn otsu<'a>(samples: impl Iterator<Item = &'a u8>) -> Option<u8> {
    let mut histogram = [0.0; 256];
    samples.for_each(|sample| histogram[usize::from(*sample)] += 1.0);
    let moment = |power: i32| {
        histogram.iter().enumerate().map(|(level, count)| count * (level as f64).powi(power)).sum::<f64>()
    };
    let (count, sum) = (moment(0), moment(1));
    let variance = moment(2) / count - (sum / count).powi(2);
    let (mut below, mut sum_below) = (0.0, 0.0);
    let (mut best, mut between) = (0, 0.0);
    for (level, here) in (0_u8..=255).zip(histogram) {
        below += here;
        sum_below += here * f64::from(level);
        let above = count - below;
        if below > 0.0 && above > 0.0 {
            let apart = sum_below / below - (sum - sum_below) / above;
            let spread = below * above * apart * apart;
            if spread > between {
                (best, between) = (level, spread);
            }
        }
    }
    (variance >= LEAST_SPREAD * LEAST_SPREAD).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_parts_two_heaps() {
        let dark = [40_u8, 42, 44, 41, 50];
        let bright = [180_u8, 200, 190];
        let threshold = otsu(dark.iter().chain(&bright)).unwrap();
        assert!((50..180).contains(&threshold), "{threshold}");
        assert_eq!(otsu([100_u8, 101, 103, 99].iter()), None);
    }
}
