//! Blobs darker than their surroundings.

use super::grey::Grey;

/// So much darker than the mean of the window, in grey levels, is dark: noise alone is not.
const CONTRAST: u32 = 7;

/// Which pixels of an image are darker than the mean of the square window around them.
pub(super) struct Mask {
    pub(super) width: usize,
    pub(super) height: usize,
    /// 1 where it is dark.
    pub(super) dark: Vec<u8>,
}

impl Mask {
    /// Looks at an image through windows that reach so many pixels, 127 at most, to all sides.
    pub(super) fn of(image: &Grey, reach: usize) -> Self {
        let reach = reach.min(127);
        let (width, height) = (image.width(), image.height());
        let mut window = Columns::new(image, reach);
        let mut dark = vec![0; width * height];
        for (y, row) in dark.chunks_exact_mut(width).enumerate() {
            window.compare(image.row(y), row);
            window.move_down(image, y);
        }
        Self { width, height, dark }
    }

    pub(super) fn is_dark(&self, x: i32, y: i32) -> bool {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return false };
        x < self.width && y < self.height && self.dark[y * self.width + x] == 1
    }
}

/// The sums of the window's rows in every column; beyond the image's border its last pixel goes on.
struct Columns {
    reach: usize,
    sums: Vec<u16>,
}

impl Columns {
    fn new(image: &Grey, reach: usize) -> Self {
        let mut sums = vec![0; image.width()];
        for y in -(reach as isize)..=reach as isize {
            let row = image.row(y.max(0) as usize);
            sums.iter_mut().zip(row).for_each(|(sum, pixel)| *sum += u16::from(*pixel));
        }
        Self { reach, sums }
    }

    fn move_down(&mut self, image: &Grey, y: usize) {
        let (leaves, enters) = (image.row(y.saturating_sub(self.reach)), image.row(y + self.reach + 1));
        for ((sum, leaves), enters) in self.sums.iter_mut().zip(leaves).zip(enters) {
            *sum = *sum + u16::from(*enters) - u16::from(*leaves);
        }
    }

    fn compare(&self, pixels: &[u8], dark: &mut [u8]) {
        let (reach, last) = (self.reach, self.sums.len() - 1);
        let side = 2 * reach as u32 + 1;
        let (area, at) = (side * side, |x: usize| u32::from(self.sums[x.min(last)]));
        let mut sum = at(0) * (reach as u32 + 1) + (1..=reach).map(at).sum::<u32>();
        for (x, (pixel, dark)) in pixels.iter().zip(dark).enumerate() {
            *dark = u8::from((u32::from(*pixel) + CONTRAST) * area <= sum);
            sum = sum + at(x + reach + 1) - at(x.saturating_sub(reach));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_is_dark_beside_the_mean_of_its_window() {
        let (width, height) = (13, 9);
        let pixels: Vec<u8> = (0..width * height).map(|n| (n * n * 37 % 251) as u8).collect();
        let image = Grey::new(&pixels, width, height).unwrap();
        let mask = Mask::of(&image, 2);
        let at = |x: i32, y: i32| {
            let (x, y) = (x.clamp(0, 12) as usize, y.clamp(0, 8) as usize);
            u32::from(pixels[y * width + x])
        };
        for y in 0..9 {
            for x in 0..13 {
                let sum: u32 = (-2..=2)
                    .flat_map(|dy| (-2..=2).map(move |dx| (dx, dy)))
                    .map(|(dx, dy)| at(x + dx, y + dy))
                    .sum();
                assert_eq!(mask.is_dark(x, y), (at(x, y) + 7) * 25 <= sum, "{x} {y}");
            }
        }
    }
}
