//! A grey image that somebody else owns.

use nalgebra::Vector2;
use thiserror::Error;

/// More pixels along a side are taken for a mistake.
const SIDE_LIMIT: usize = 16_384;

/// A grey image, row by row from the top left, a byte a pixel. The centre of the first pixel is at (0, 0), x runs to
/// the right and y down.
#[derive(Clone, Copy, Debug)]
pub struct Grey<'a> {
    pixels: &'a [u8],
    width: usize,
    height: usize,
}

/// The pixels are not an image of this size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error(
    "{pixels} bytes are not an image of {width} by {height} pixels; expected {} bytes, sides of 1 to {SIDE_LIMIT}",
    width.saturating_mul(*height)
)]
pub struct NoImage {
    pixels: usize,
    width: usize,
    height: usize,
}

impl<'a> Grey<'a> {
    /// An image of so many columns and rows.
    pub fn new(pixels: &'a [u8], width: usize, height: usize) -> Result<Self, NoImage> {
        let sides = 1..=SIDE_LIMIT;
        if !sides.contains(&width) || !sides.contains(&height) || pixels.len() != width * height {
            return Err(NoImage { pixels: pixels.len(), width, height });
        }
        Ok(Self { pixels, width, height })
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// A row from the top; the last one for those beyond.
    pub(super) fn row(&self, y: usize) -> &'a [u8] {
        let start = y.min(self.height - 1) * self.width;
        &self.pixels[start..start + self.width]
    }

    /// The brightness at a place between pixels, 0 to 255; outside it is that of the border.
    pub(super) fn sample(&self, at: Vector2<f64>) -> f64 {
        let x = at.x.clamp(0.0, (self.width - 1) as f64);
        let y = at.y.clamp(0.0, (self.height - 1) as f64);
        let (left, top) = (x as usize, y as usize);
        let (right, x, y) = ((left + 1).min(self.width - 1), x - left as f64, y - top as f64);
        let across = |row: &[u8]| f64::from(row[left]) * (1.0 - x) + f64::from(row[right]) * x;
        across(self.row(top)) * (1.0 - y) + across(self.row(top + 1)) * y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brightness_is_interpolated_between_pixels_and_held_outside() {
        let image = Grey::new(&[0, 100, 200, 40], 2, 2).unwrap();
        assert_eq!(image.sample(Vector2::new(0.5, 0.0)), 50.0);
        assert_eq!(image.sample(Vector2::new(0.5, 0.5)), 85.0);
        assert_eq!(image.sample(Vector2::new(9.0, -3.0)), 100.0);
    }

    #[test]
    fn other_sizes_are_told() {
        let told = Grey::new(&[0; 5], 2, 3).unwrap_err().to_string();
        assert!(told.starts_with("5 bytes are not an image of 2 by 3 pixels; expected 6 bytes"), "{told}");
        assert!(Grey::new(&[], 0, 0).is_err());
        assert!(Grey::new(&[0; 4], usize::MAX, 2).is_err());
    }
}
