//! Markers in an image.

use nalgebra::Vector2;

use super::blobs::{self, Blob};
use super::cells;
use super::dictionary::{Dictionary, Identity};
use super::edges;
use super::grey::Grey;
use super::quadrilateral::{self, Corners};
use super::threshold::Mask;

/// Reach of the thresholds' windows, pixels: the first parts small cells, the last bears blur.
const WINDOWS: [usize; 3] = [2, 6, 11];
/// A marker that was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    /// Its id in the dictionary.
    pub id: u32,
    /// Its upper left, upper right, lower right and lower left corner as it is printed, in pixels; (0, 0) is the centre
    /// of the image's first pixel.
    pub corners: [Vector2<f64>; 4],
    /// Data bits that were read wrongly and corrected.
    pub errors: u32,
}

/// Finds the markers of a dictionary, in the order of their ids.
pub fn detect(image: &Grey, dictionary: &Dictionary) -> Vec<Detection> {
    let mut found: Vec<Detection> = Vec::new();
    for corners in candidates(image, dictionary.cells()) {
        let centre = quadrilateral::centre(&corners);
        if found.iter().any(|marker| quadrilateral::holds(&marker.corners, centre)) {
            continue;
        }
        if let Some(identity) = cells::read(image, &corners, dictionary) {
            found.push(detection(image, corners, identity, dictionary.cells()));
        }
    }
    found.sort_by_key(|marker| marker.id);
    found
}

/// Quadrilaterals of every threshold that may be markers of so many cells, the largest first.
fn candidates(image: &Grey, cells: usize) -> Vec<Corners> {
    let mut found = Vec::new();
    for window in WINDOWS {
        let mask = Mask::of(image, window);
        let blobs = blobs::blobs(&mask).into_iter().filter(|blob| may_be_a_marker(blob, &mask, cells));
        found.extend(blobs.filter_map(|blob| {
            let (width, height) = blob.extent();
            // A quadrilateral's outline is no longer than its bounds'.
            let outline = blob.outline(&mask, 2 * (width + height) as usize)?;
            quadrilateral::corners(&outline).map(|corners| grown(&corners))
        }));
    }
    found.sort_by(|a, b| quadrilateral::perimeter(b).total_cmp(&quadrilateral::perimeter(a)));
    found
}

/// Whether a blob has a pixel for every cell, and none on the image's border, beyond which it may go on.
fn may_be_a_marker(blob: &Blob, mask: &Mask, cells: usize) -> bool {
    let (width, height) = blob.extent();
    let is_inside = blob.left > 0
        && blob.start.1 > 0
        && blob.right < mask.width as i32 - 1
        && blob.bottom < mask.height as i32 - 1;
    is_inside && width.max(height) > cells as i32 && width.min(height) >= 4
}

/// The outline of dark pixels goes through their centres, half a pixel within the edge.
fn grown(corners: &Corners) -> Corners {
    let centre = quadrilateral::centre(corners);
    corners
        .map(|corner| corner + (corner - centre).map(|along| 0.5 * along.signum() * f64::from(along != 0.0)))
}

fn detection(image: &Grey, corners: Corners, identity: Identity, cells: usize) -> Detection {
    let cell = quadrilateral::perimeter(&corners) / (4 * cells) as f64;
    let mut corners = edges::refine(image, &corners, cell);
    corners.rotate_left(identity.turns);
    Detection { id: identity.id, corners, errors: identity.errors }
}

#[cfg(test)]
mod tests {
    use super::super::homography::Homography;
    use super::*;

    const WIDTH: usize = 320;
    const HEIGHT: usize = 240;

    /// Draws markers on white paper whose black squares have these corners, on a grey ground.
    fn draw(dictionary: &Dictionary, markers: &[(u32, Corners)]) -> Vec<u8> {
        let cells = dictionary.cells() as f64;
        let square = [[0.0, 0.0], [cells, 0.0], [cells, cells], [0.0, cells]].map(Vector2::from);
        let to_cells: Vec<_> = markers
            .iter()
            .map(|(id, corners)| (*id, Homography::between(corners.iter().copied().zip(square)).unwrap()))
            .collect();
        let brightness = |at: Vector2<f64>| {
            let on = |(id, to_cells): &(u32, Homography)| {
                let cell = to_cells.map(at);
                let paper = -1.0..cells + 1.0;
                (paper.contains(&cell.x) && paper.contains(&cell.y)).then(|| {
                    // The paper around the border counts as cells beyond the last.
                    let index = |along: f64| if along < 0.0 { usize::MAX } else { along as usize };
                    dictionary.is_white(*id, index(cell.y), index(cell.x))
                })
            };
            match to_cells.iter().find_map(on).flatten() {
                Some(true) => 220.0,
                Some(false) => 30.0,
                None => 120.0,
            }
        };
        let pixel = |n: usize| {
            let corner = Vector2::new((n % WIDTH) as f64 - 0.5, (n / WIDTH) as f64 - 0.5);
            let within = |k: usize| Vector2::new((k % 4) as f64 + 0.5, (k / 4) as f64 + 0.5) / 4.0;
            ((0..16).map(|k| brightness(corner + within(k))).sum::<f64>() / 16.0) as u8
        };
        (0..WIDTH * HEIGHT).map(pixel).collect()
    }

    fn turned(middle: [f64; 2], half: f64, angle: f64, squeeze: f64) -> Corners {
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]: [f64; 2]| {
            let (sin, cos) = angle.sin_cos();
            let turned = Vector2::new(x * cos - y * sin, x * sin + y * cos) * half;
            // Farther to the right is farther away.
            let depth = 1.0 + squeeze * turned.x / half;
            Vector2::from(middle) + turned / depth
        })
    }

    #[test]
    fn markers_of_every_family_are_found_in_every_direction_with_their_corners() {
        for name in ["original", "4x4_50", "5x5_100", "6x6_250", "7x7_1000"] {
            let dictionary = Dictionary::named(name).unwrap();
            let markers = [
                (3, turned([50.3, 60.8], 22.0, 0.1, 0.0)),
                (17, turned([140.0, 70.0], 30.0, 1.2, 0.15)),
                (25, turned([250.0, 80.0], 40.0, 2.9, -0.1)),
                (49, turned([90.0, 170.0], 35.0, 4.4, 0.2)),
                (30, turned([220.0, 180.0], 12.0, 5.5, 0.0)),
            ];
            let pixels = draw(&dictionary, &markers);
            let found = detect(&Grey::new(&pixels, WIDTH, HEIGHT).unwrap(), &dictionary);
            let ids: Vec<_> = found.iter().map(|marker| marker.id).collect();
            assert_eq!(ids, [3, 17, 25, 30, 49], "{name}");
            for marker in found {
                let (_, corners) = markers.iter().find(|(id, _)| *id == marker.id).unwrap();
                for (found, corner) in marker.corners.iter().zip(corners) {
                    assert!((found - corner).norm() < 0.12, "{name} {}: {found} is not {corner}", marker.id);
                }
            }
        }
    }

    #[test]
    fn a_marker_with_a_wrong_cell_is_corrected_and_one_of_another_dictionary_is_not_seen() {
        let dictionary = Dictionary::named("6x6_250").unwrap();
        let corners = turned([160.0, 120.0], 48.0, 0.0, 0.0);
        let mut pixels = draw(&dictionary, &[(7, corners)]);
        // A cell is 12 pixels; this one is the second of the second row.
        for y in 84..96 {
            pixels[y * WIDTH + 136 - 12..][..12].fill(if dictionary.is_white(7, 1, 1).unwrap() {
                30
            } else {
                220
            });
        }
        let image = Grey::new(&pixels, WIDTH, HEIGHT).unwrap();
        let found = detect(&image, &dictionary);
        assert_eq!(found.iter().map(|marker| (marker.id, marker.errors)).collect::<Vec<_>>(), [(7, 1)]);
        assert_eq!(
            detect(&image, &Dictionary::named("6x6_50").unwrap()).len(),
            1,
            "a part of the same family"
        );
        assert_eq!(detect(&image, &Dictionary::named("5x5_1000").unwrap()), []);
    }

    #[test]
    fn noise_and_even_images_hold_no_markers() {
        let mut state = 1_u32;
        let noise: Vec<u8> = (0..WIDTH * HEIGHT)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 24) as u8
            })
            .collect();
        for name in ["original", "4x4_250", "5x5_1000"] {
            let dictionary = Dictionary::named(name).unwrap();
            assert_eq!(detect(&Grey::new(&noise, WIDTH, HEIGHT).unwrap(), &dictionary), [], "{name}");
            for even in [0, 255] {
                let pixels = vec![even; WIDTH * HEIGHT];
                assert_eq!(detect(&Grey::new(&pixels, WIDTH, HEIGHT).unwrap(), &dictionary), [], "{name}");
            }
        }
        assert_eq!(detect(&Grey::new(&[7], 1, 1).unwrap(), &Dictionary::named("original").unwrap()), []);
    }
}
