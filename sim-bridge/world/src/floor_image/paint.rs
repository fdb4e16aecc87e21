//! Markers on a floor, as light on the camera's sensor.

use nalgebra::{Isometry3, Matrix2, Point3, Vector2, Vector3};
use skein_positioning::markers::{Camera, Dictionary, Layout, Placed};

/// The floor, the white and the black of the prints, grey levels.
pub(super) const FLOOR: f32 = 150.0;
const WHITE: f32 = 215.0;
const BLACK: f32 = 30.0;
/// White paper around a marker, cells.
const PAPER: f64 = 1.0;
/// More of the marker's cells than this within one pixel are drawn as if they were so many.
const MOST_CELLS: f64 = 12.0;

/// The light that each pixel has caught.
pub(super) struct Canvas<'a> {
    camera: &'a Camera,
    rays: &'a [Option<Vector2<f64>>],
    pub(super) light: Vec<f32>,
}

impl<'a> Canvas<'a> {
    pub(super) fn new(camera: &'a Camera, rays: &'a [Option<Vector2<f64>>]) -> Self {
        Self { camera, rays, light: vec![FLOOR; rays.len()] }
    }

    /// Adds a share of the exposure, from one pose.
    pub(super) fn add(&mut self, layout: &Layout, pose: &Isometry3<f64>, defocus_px: f64, share: f32) {
        for placed in layout.markers() {
            if let Some(print) = Print::seen(self.camera, layout.dictionary(), placed, pose, defocus_px) {
                self.paint(&print, share);
            }
        }
    }

    fn paint(&mut self, print: &Print, share: f32) {
        let [left, top, right, bottom] = print.bounds;
        for y in top..bottom {
            let row = y * self.camera.width();
            for x in left..right {
                let Some(cell) = self.rays[row + x].and_then(|ray| print.cell(ray)) else { continue };
                self.light[row + x] += share * print.light(cell);
            }
        }
    }
}

/// A marker as one pose sees it.
struct Print {
    cells: usize,
    /// Row by row, the paper around included.
    levels: Vec<f32>,
    /// The camera in the marker's frame, and the directions of its axes there, in cells; rows go down.
    eye: Vector3<f64>,
    axes: [Vector3<f64>; 3],
    /// The extent of a pixel on the marker along columns and rows, cells.
    footprint: Vector2<f64>,
    /// Pixels that may show it: left, top, and before which it ends to the right and below.
    bounds: [usize; 4],
}

impl Print {
    /// `None` if the camera cannot see the marker.
    fn seen(
        camera: &Camera,
        dictionary: &Dictionary,
        placed: &Placed,
        pose: &Isometry3<f64>,
        defocus_px: f64,
    ) -> Option<Self> {
        let from_camera = placed.to_world.inverse() * pose;
        let to_camera = from_camera.inverse();
        if from_camera.translation.z <= 0.0 {
            return None;
        }
        let cell_m = placed.side_m / dictionary.cells() as f64;
        let bounds = bounds(camera, &to_camera, placed.side_m / 2.0 + PAPER * cell_m)?;
        let in_cells = |v: Vector3<f64>| Vector3::new(v.x, -v.y, v.z) / cell_m;
        let axes =
            [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| in_cells(from_camera.rotation * axis));
        let middle = dictionary.cells() as f64 / 2.0;
        let eye = in_cells(from_camera.translation.vector) + Vector3::new(middle, middle, 0.0);
        let footprint = footprint(camera, &to_camera)? * (1.0 + defocus_px * defocus_px).sqrt() / cell_m;
        let cells = dictionary.cells();
        let levels = levels(dictionary, placed.id);
        Some(Self { cells, levels, eye, axes, footprint: footprint.map(|side| side.min(MOST_CELLS)), bounds })
    }

    /// Where a ray meets the marker, column and row in cells from the corner of its paper.
    fn cell(&self, ray: Vector2<f64>) -> Option<Vector2<f64>> {
        let way = self.axes[0] * ray.x + self.axes[1] * ray.y + self.axes[2];
        let far = -self.eye.z / way.z;
        let met = (self.eye.xy() + way.xy() * far).add_scalar(PAPER);
        (far > 0.0).then_some(met)
    }

    /// How much brighter than the floor the pixel is whose middle shows this place: the mean over what it covers.
    fn light(&self, at: Vector2<f64>) -> f32 {
        let (low, high) = (at - self.footprint / 2.0, at + self.footprint / 2.0);
        let side = self.cells as f64 + 2.0 * PAPER;
        if high.min() <= 0.0 || low.max() >= side {
            return 0.0;
        }
        let first = low.map(|along| along.max(0.0) as usize);
        let last = high.map(|along| (along.min(side - 1e-9)) as usize);
        if first == last && low.min() >= 0.0 && high.max() <= side {
            return self.level(first.x, first.y);
        }
        let share = |n: usize, axis: usize| {
            let (from, to) = (n as f64, n as f64 + 1.0);
            (high[axis].min(to) - low[axis].max(from)).max(0.0) / self.footprint[axis]
        };
        let mut sum = 0.0;
        for row in first.y..=last.y {
            for column in first.x..=last.x {
                sum += self.level(column, row) * (share(column, 0) * share(row, 1)) as f32;
            }
        }
        sum
    }

    fn level(&self, column: usize, row: usize) -> f32 {
        self.levels[row * (self.cells + 2) + column]
    }
}

/// How much brighter than the floor each cell is, from the corner of the paper.
fn levels(dictionary: &Dictionary, id: u32) -> Vec<f32> {
    let side = dictionary.cells() + 2;
    let level = |n: usize| {
        // The paper before the first cell counts as cells beyond the last.
        let cell = |along: usize| along.checked_sub(1).unwrap_or(usize::MAX);
        let is_white = dictionary.is_white(id, cell(n / side), cell(n % side)).unwrap_or(true);
        if is_white { WHITE - FLOOR } else { BLACK - FLOOR }
    };
    (0..side * side).map(level).collect()
}

/// The pixels within which a square in the marker's plane is seen; `None` outside the image.
fn bounds(camera: &Camera, to_camera: &Isometry3<f64>, half_m: f64) -> Option<[usize; 4]> {
    let around = [-1.0, 0.0, 1.0].map(|y| [-1.0, 0.0, 1.0].map(|x| Point3::new(x * half_m, y * half_m, 0.0)));
    let seen = around.as_flattened().iter().map(|point| camera.project(&(to_camera * point).coords));
    let seen: Vec<_> = seen.flatten().collect();
    let whole = [camera.width() as f64, camera.height() as f64];
    let of = |axis: usize| {
        let along = seen.iter().map(|pixel| pixel[axis]);
        // A square of which a part is out of sight may be anywhere.
        let (low, high) = match seen.len() {
            9 => (along.clone().fold(f64::INFINITY, f64::min), along.fold(f64::NEG_INFINITY, f64::max)),
            _ => (0.0, whole[axis]),
        };
        let (low, high) = ((low - 2.0).max(0.0), (high + 3.0).min(whole[axis]));
        (low < high).then_some((low as usize, high as usize))
    };
    let ((left, right), (top, bottom)) = (of(0)?, of(1)?);
    (!seen.is_empty()).then_some([left, top, right, bottom])
}

/// How far a pixel reaches along the marker's x and y at its middle, m.
fn footprint(camera: &Camera, to_camera: &Isometry3<f64>) -> Option<Vector2<f64>> {
    let middle = to_camera.translation.vector;
    let turn = to_camera.rotation.to_rotation_matrix();
    let (_, slope) = camera.look(&middle)?;
    let of_plane = slope * turn.matrix().fixed_columns::<2>(0);
    let back: Matrix2<f64> = of_plane.try_inverse()?;
    Some(Vector2::new(back.row(0).norm(), back.row(1).norm()))
}
