//! Terrain as heights on a grid.

use nalgebra::Vector2;

/// Heights at the nodes of a square grid, with what lies between them interpolated (bilinear). Beyond the border the
/// ground goes on as high as the border is.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightGrid {
    corner: Vector2<f64>,
    spacing_m: f64,
    columns: usize,
    /// Row by row northwards, eastwards within a row.
    heights_m: Vec<f64>,
}

/// Why heights are no grid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HeightGridError {
    #[error("`spacing_m` is {0}: expected a number above 0")]
    Spacing(f64),
    #[error("`heights_m` has {rows} rows of {columns}: expected two or more of two or more")]
    TooFew { rows: usize, columns: usize },
    #[error("`heights_m`: row {row} has {found} heights, the first has {expected}")]
    Ragged { row: usize, found: usize, expected: usize },
    #[error("`corner_m` or `heights_m` holds a number that is not finite")]
    NotFinite,
}

impl HeightGrid {
    /// The grid whose south-western node is `corner` (ENU, metres), with rows from south to north of heights from
    /// west to east, metres.
    pub fn new(
        corner: Vector2<f64>,
        spacing_m: f64,
        rows: &[Vec<f64>],
    ) -> Result<HeightGrid, HeightGridError> {
        if !(spacing_m > 0.0 && spacing_m.is_finite()) {
            return Err(HeightGridError::Spacing(spacing_m));
        }
        let columns = rows.first().map_or(0, Vec::len);
        if rows.len() < 2 || columns < 2 {
            return Err(HeightGridError::TooFew { rows: rows.len(), columns });
        }
        if let Some((index, row)) = rows.iter().enumerate().find(|(_, row)| row.len() != columns) {
            return Err(HeightGridError::Ragged { row: index + 1, found: row.len(), expected: columns });
        }
        let heights_m = rows.concat();
        if !heights_m.iter().chain(corner.iter()).all(|number| number.is_finite()) {
            return Err(HeightGridError::NotFinite);
        }
        Ok(HeightGrid { corner, spacing_m, columns, heights_m })
    }

    /// Its south-western node (ENU, metres).
    pub fn corner(&self) -> Vector2<f64> {
        self.corner
    }

    /// From node to node, metres.
    pub fn spacing_m(&self) -> f64 {
        self.spacing_m
    }

    /// Its rows, from south to north, metres.
    pub fn rows(&self) -> impl Iterator<Item = &[f64]> {
        self.heights_m.chunks_exact(self.columns)
    }

    pub fn height_m(&self, x: f64, y: f64) -> f64 {
        let (column, east) = self.cell(x - self.corner.x, self.columns);
        let (row, north) = self.cell(y - self.corner.y, self.heights_m.len() / self.columns);
        let along = |row: usize| {
            let west = self.node(column, row);
            west + (self.node(column + 1, row) - west) * east
        };
        along(row) + (along(row + 1) - along(row)) * north
    }

    /// A height that is not exceeded in a rectangle, metres.
    pub(super) fn most_in_m(&self, lower: &Vector2<f64>, upper: &Vector2<f64>) -> f64 {
        let cell = |axis: usize, at: f64| {
            let nodes = [self.columns, self.heights_m.len() / self.columns];
            self.cell(at - self.corner[axis], nodes[axis]).0
        };
        let rows = cell(1, lower.y)..=cell(1, upper.y) + 1;
        let columns = cell(0, lower.x)..=cell(0, upper.x) + 1;
        let nodes = rows.flat_map(|row| columns.clone().map(move |column| (column, row)));
        nodes.map(|(column, row)| self.node(column, row)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// A slope that it does not exceed.
    pub(super) fn steepest(&self) -> f64 {
        let most = |pairs: &mut dyn Iterator<Item = (f64, f64)>| {
            pairs.map(|(one, other)| (other - one).abs()).fold(0.0, f64::max) / self.spacing_m
        };
        let east = most(&mut self.rows().flat_map(|row| row.windows(2).map(|pair| (pair[0], pair[1]))));
        let further = self.heights_m.iter().skip(self.columns).copied();
        let north = most(&mut self.heights_m.iter().copied().zip(further));
        east.hypot(north)
    }

    fn node(&self, column: usize, row: usize) -> f64 {
        self.heights_m[row * self.columns + column]
    }

    /// The cell along an axis with so many nodes, and the place in it, 0 to 1.
    fn cell(&self, offset_m: f64, nodes: usize) -> (usize, f64) {
        let at = (offset_m / self.spacing_m).clamp(0.0, (nodes - 1) as f64);
        let cell = (at as usize).min(nodes - 2);
        (cell, at - cell as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_between_nodes_are_interpolated_and_those_beyond_are_the_borders() {
        let rows = [vec![0.0, 2.0, 4.0], vec![10.0, 12.0, 14.0]];
        let grid = HeightGrid::new(Vector2::new(-5.0, 0.0), 5.0, &rows).unwrap();
        assert_eq!([grid.height_m(-5.0, 0.0), grid.height_m(5.0, 5.0)], [0.0, 14.0]);
        assert_eq!(grid.height_m(-2.5, 2.5), 6.0);
        assert_eq!([grid.height_m(-50.0, 0.0), grid.height_m(0.0, 80.0)], [0.0, 12.0]);
        assert_eq!(grid.most_in_m(&Vector2::new(-4.0, 1.0), &Vector2::new(-3.0, 2.0)), 12.0);
        assert!((grid.steepest() - (0.4_f64).hypot(2.0)).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_grid_is_refused() {
        let of = |spacing_m, rows: &[Vec<f64>]| HeightGrid::new(Vector2::zeros(), spacing_m, rows);
        let sound = vec![vec![0.0; 2]; 2];
        assert_eq!(of(0.0, &sound), Err(HeightGridError::Spacing(0.0)));
        assert!(matches!(of(1.0, &[vec![0.0; 2]]), Err(HeightGridError::TooFew { rows: 1, .. })));
        let ragged = [vec![0.0; 2], vec![0.0; 3]];
        assert!(matches!(of(1.0, &ragged), Err(HeightGridError::Ragged { row: 2, .. })));
        let hole = [vec![0.0, f64::NAN], vec![0.0; 2]];
        assert_eq!(of(1.0, &hole), Err(HeightGridError::NotFinite));
    }
}
