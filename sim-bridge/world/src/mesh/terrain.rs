//! Terrain: heights on a grid, and all that is below them.

use glamx::{DPose3, DQuat, DVec3};
use nalgebra::Vector3;
use parry3d_f64::shape::{HeightFieldCellStatus, SharedShape};
use parry3d_f64::utils::Array2;

use super::{Inside, Mesh, MeshError};

/// Grids of more heights than this along a side are refused.
pub const MOST_ALONG: usize = 4097;

/// Heights on a grid: shares of the whole, row by row, the first row in the north (y up), each from west to
/// east.
#[derive(Debug, Clone, PartialEq)]
pub struct Heights {
    pub rows: usize,
    pub columns: usize,
    pub heights: Vec<f32>,
}

impl Heights {
    /// The heights of a picture (PNG, JPEG, BMP: white is high), or of a square of numbers of one or two
    /// bytes, the lower first, where `name` ends in `.raw`.
    pub fn read(name: &str, bytes: &[u8]) -> Result<Self, MeshError> {
        if name.to_lowercase().ends_with(".raw") { Self::of_numbers(bytes) } else { Self::of_picture(bytes) }
    }

    fn of_numbers(bytes: &[u8]) -> Result<Self, MeshError> {
        let wide = |along: usize| along * along * 2 == bytes.len();
        let along = bytes.len().isqrt();
        let (along, heights) = match along * along == bytes.len() {
            true => (along, bytes.iter().map(|height| f32::from(*height)).collect()),
            false if wide((bytes.len() / 2).isqrt()) => {
                let heights =
                    bytes.chunks_exact(2).map(|pair| f32::from(u16::from_le_bytes([pair[0], pair[1]])));
                ((bytes.len() / 2).isqrt(), heights.collect())
            }
            false => return Err(MeshError::Raw(bytes.len())),
        };
        Ok(Self { rows: along, columns: along, heights }.normal())
    }

    fn of_picture(bytes: &[u8]) -> Result<Self, MeshError> {
        let malformed = |error: &dyn std::fmt::Display| MeshError::Malformed(error.to_string());
        let mut picture = image::ImageReader::new(std::io::Cursor::new(bytes))
            .with_guessed_format()
            .map_err(|error| malformed(&error))?;
        let mut limits = image::Limits::default();
        limits.max_image_width = u32::try_from(MOST_ALONG).ok();
        limits.max_image_height = limits.max_image_width;
        picture.limits(limits);
        let picture = picture.decode().map_err(|error| malformed(&error))?.into_luma16();
        let (columns, rows) = (picture.width() as usize, picture.height() as usize);
        let heights = picture.into_raw().into_iter().map(f32::from).collect();
        Ok(Self { rows, columns, heights }.normal())
    }

    /// The highest is 1, as Gazebo scales them.
    fn normal(mut self) -> Self {
        let highest = self.heights.iter().copied().fold(0.0, f32::max);
        let factor = if highest > 0.0 { 1.0 / highest } else { 0.0 };
        self.heights.iter_mut().for_each(|height| *height *= factor);
        self
    }
}

impl Mesh {
    /// Terrain over a rectangle about the origin: `size` is its length along x and y, and its height where
    /// the share is 1.
    pub fn terrain(heights: &Heights, size: &Vector3<f64>) -> Result<Self, MeshError> {
        let Heights { rows, columns, ref heights } = *heights;
        let fits = |along: usize| (2..=MOST_ALONG).contains(&along);
        if !fits(rows) || !fits(columns) || heights.len() != rows * columns {
            return Err(MeshError::Heights { rows, columns });
        }
        let mut grid = Array2::repeat(rows, columns, 0.0);
        for (number, height) in heights.iter().enumerate() {
            grid[(number / columns, number % columns)] = f64::from(*height);
        }
        // Parry's heights are along y, and its rows begin at the lowest z.
        let shape = SharedShape::heightfield(grid, DVec3::new(size.x, size.z, size.y));
        let pose = DPose3::from_parts(DVec3::ZERO, DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2));
        Ok(Self::new(shape, pose, Inside::Below))
    }

    /// The same terrain without the cells that are nowhere higher than this, metres; any other mesh as it is.
    #[must_use]
    pub fn higher_than(self, height_m: f64) -> Self {
        let Some(field) = self.shape.as_heightfield() else { return self };
        let mut field = field.clone();
        let least = height_m / field.scale().y;
        for row in 0..field.nrows() {
            for column in 0..field.ncols() {
                let corners = [(row, column), (row + 1, column), (row, column + 1), (row + 1, column + 1)];
                if corners.iter().all(|corner| field.heights()[*corner] <= least) {
                    field.set_cell_status(row, column, HeightFieldCellStatus::CELL_REMOVED);
                }
            }
        }
        Self::new(SharedShape::new(field), self.pose, self.inside)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    fn ramp() -> Mesh {
        // Three rows from north to south, two columns from west to east: high in the north-west.
        let heights = Heights { rows: 3, columns: 2, heights: vec![1.0, 0.5, 0.5, 0.25, 0.0, 0.0] };
        Mesh::terrain(&heights, &Vector3::new(10.0, 20.0, 8.0)).expect("a sound grid")
    }

    #[test]
    fn the_first_row_is_the_north_and_the_first_column_the_west() {
        let down = -Vector3::z();
        for ((x, y), height_m) in
            [((-4.99, 9.99), 8.0), ((4.99, 9.99), 4.0), ((-4.99, 0.0), 4.0), ((4.99, -9.99), 0.0)]
        {
            let met = ramp().cast_ray(&Point3::new(x, y, 20.0), &down).map(|range| 20.0 - range);
            assert!(
                met.is_some_and(|met| (met - height_m).abs() < 0.05),
                "({x}, {y}): {met:?} is not {height_m}"
            );
        }
    }

    #[test]
    fn below_the_terrain_is_inside_and_beside_it_is_not() {
        let ramp = ramp();
        assert!(ramp.signed_distance(&Point3::new(-4.0, 9.0, 1.0)) < 0.0);
        assert!(ramp.signed_distance(&Point3::new(-4.0, 9.0, 9.0)) > 0.0);
        assert!(ramp.signed_distance(&Point3::new(-6.0, 9.0, 1.0)) > 0.0);
        assert_eq!(ramp.cast_ray(&Point3::new(-4.0, 9.0, 1.0), &Vector3::x()), Some(0.0));
    }

    #[test]
    fn numbers_of_one_and_of_two_bytes_are_read_and_scaled_to_the_highest() {
        let narrow = Heights::read("a.raw", &[0, 51, 102, 204]).expect("four heights");
        assert_eq!((narrow.rows, narrow.heights.as_slice()), (2, [0.0, 0.25, 0.5, 1.0].as_slice()));
        let wide = Heights::read("a.raw", &[0, 0, 0, 1, 0, 2, 0, 4]).expect("four heights");
        assert_eq!(wide.heights, [0.0, 0.25, 0.5, 1.0]);
        assert_eq!(Heights::read("a.raw", &[0; 7]), Err(MeshError::Raw(7)));
    }
}
