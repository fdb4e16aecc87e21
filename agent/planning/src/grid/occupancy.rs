//! Which cells of a box are blocked, a bit for each.

use crate::map::VoxelIndex;

/// A grid that takes more than this, in bytes, is refused: some two thousand million cells.
const MOST_BYTES: usize = 256 << 20;
/// Searches keep a cell in one word.
const MOST_ALONG_AN_AXIS: usize = 2_000_000;
/// The neighbourhood's lowest and highest cells along x, y and z, as bits.
const FACES: [[u32; 2]; 3] =
    [[0o111_111_111, 0o444_444_444], [0o007_007_007, 0o700_700_700], [0o000_000_777, 0o777_000_000]];
/// All of the neighbourhood that is outside a grid of one layer for certain.
const ABOVE_AND_BELOW: u32 = FACES[2][0] | FACES[2][1];

/// The size of a grid cannot be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("a grid of {} x {} x {} cells, expected 1 to 2,000,000 along each axis and no more in all than 256 MB hold at a bit for each", .size[0], .size[1], .size[2])]
pub struct SizeError {
    /// The size asked for: cells along x, y and z.
    pub size: [usize; 3],
}

/// Which cells of a box are blocked; outside of it all are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OccupancyGrid {
    size: [usize; 3],
    /// Bytes from a row to the next.
    row: usize,
    /// Rows from a layer to the next.
    layer: usize,
    /// A bit for each cell, set if blocked, with a border of one blocked cell all round, so that no neighbour has to be
    /// looked for outside.
    bits: Vec<u8>,
}

impl OccupancyGrid {
    /// A grid of free cells, so many along x, y and z.
    pub fn new(size: [usize; 3]) -> Result<OccupancyGrid, SizeError> {
        let [nx, _, nz] = size;
        let is_possible = size.iter().all(|side| (1..=MOST_ALONG_AN_AXIS).contains(side));
        let [wide, layer, high] = size.map(|side| side.saturating_add(2));
        // A byte more, because three bits may lie across two bytes.
        let row = wide.div_ceil(8) + 1;
        let bytes = row.saturating_mul(layer).saturating_mul(high);
        if !is_possible || bytes > MOST_BYTES {
            return Err(SizeError { size });
        }
        let mut grid = OccupancyGrid { size, row, layer, bits: vec![0; bytes] };
        let slab = row * layer;
        grid.bits[..slab].fill(u8::MAX);
        grid.bits[slab * (nz + 1)..].fill(u8::MAX);
        for z in 1..=nz {
            let low = z * slab;
            grid.bits[low..low + row].fill(u8::MAX);
            grid.bits[low + slab - row..low + slab].fill(u8::MAX);
            for start in (low + row..low + slab - row).step_by(row) {
                grid.bits[start] |= 1;
                grid.bits[start + (nx + 1) / 8] |= 1 << ((nx + 1) % 8);
            }
        }
        Ok(grid)
    }

    /// Cells along x, y and z.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Whether a cell lies in the grid.
    pub fn contains(&self, cell: VoxelIndex) -> bool {
        let [nx, ny, nz] = self.size;
        cell.x < nx && cell.y < ny && cell.z < nz
    }

    /// Whether a cell is blocked; outside all are.
    pub fn is_blocked(&self, cell: VoxelIndex) -> bool {
        !self.contains(cell) || {
            let (byte, bit) = self.place(cell);
            self.bits[byte] >> bit & 1 == 1
        }
    }

    /// Blocks or frees a cell; outside nothing changes.
    pub fn set_blocked(&mut self, cell: VoxelIndex, blocked: bool) {
        if self.contains(cell) {
            let (byte, bit) = self.place(cell);
            let others = self.bits[byte] & !(1 << bit);
            self.bits[byte] = others | u8::from(blocked) << bit;
        }
    }

    /// Which of the 27 cells around a cell of the grid, itself included, are blocked: a bit for each, lowest first, x
    /// fastest, z slowest.
    #[inline(always)]
    pub fn blocked_around(&self, cell: VoxelIndex) -> u32 {
        let slab = self.row * self.layer;
        // Cell (x, y, z) is bit x + 1 of row y + 1 of layer z + 1, so its lowest neighbour is bit x of row y of layer
        // z.
        let first = cell.z * slab + cell.y * self.row + cell.x / 8;
        let shift = cell.x % 8;
        let in_row = |byte: usize| {
            let pair = &self.bits[byte..byte + 2];
            u32::from(u16::from_le_bytes([pair[0], pair[1]]) >> shift & 7)
        };
        let in_layer =
            |byte: usize| in_row(byte) | in_row(byte + self.row) << 3 | in_row(byte + 2 * self.row) << 6;
        if self.size[2] == 1 {
            return ABOVE_AND_BELOW | in_layer(first + slab) << 9;
        }
        in_layer(first) | in_layer(first + slab) << 9 | in_layer(first + 2 * slab) << 18
    }

    /// Which of the 27 cells around a cell of the grid lie outside, in the order of
    /// [`OccupancyGrid::blocked_around`].
    pub fn outside_around(&self, cell: VoxelIndex) -> u32 {
        let at = [cell.x, cell.y, cell.z];
        let mut outside = 0;
        for (axis, [low, high]) in FACES.into_iter().enumerate() {
            if at[axis] == 0 {
                outside |= low;
            }
            if at[axis] + 1 == self.size[axis] {
                outside |= high;
            }
        }
        outside
    }

    /// The byte and the bit of a cell of the grid.
    fn place(&self, cell: VoxelIndex) -> (usize, usize) {
        let byte = ((cell.z + 1) * self.layer + cell.y + 1) * self.row + (cell.x + 1) / 8;
        (byte, (cell.x + 1) % 8)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::grid::{MOVES, moved};

    proptest! {
        #[test]
        fn a_neighbourhood_is_what_its_cells_are(
            size in [1..12_usize, 1..5_usize, 1..5_usize],
            blocked in prop::collection::vec([0..12_usize, 0..5_usize, 0..5_usize], 0..60),
        ) {
            let mut grid = OccupancyGrid::new(size).unwrap();
            for [x, y, z] in &blocked {
                grid.set_blocked(VoxelIndex { x: *x, y: *y, z: *z }, true);
            }
            for place in 0..size.iter().product::<usize>() {
                let cell = VoxelIndex { x: place % size[0], y: place / size[0] % size[1], z: place / size[0] / size[1] };
                let (around, outside) = (grid.blocked_around(cell), grid.outside_around(cell));
                prop_assert_eq!(grid.is_blocked(cell), blocked.contains(&[cell.x, cell.y, cell.z]));
                for step in MOVES {
                    let there = moved(cell, step.by);
                    prop_assert_eq!(outside & step.end != 0, !grid.contains(there));
                    prop_assert_eq!(around & step.end != 0, grid.is_blocked(there));
                }
            }
        }
    }

    #[test]
    fn a_cell_can_be_freed_again() {
        let mut grid = OccupancyGrid::new([9, 1, 1]).unwrap();
        let cell = VoxelIndex { x: 7, y: 0, z: 0 };
        grid.set_blocked(cell, true);
        grid.set_blocked(cell, false);
        assert_eq!(grid, OccupancyGrid::new([9, 1, 1]).unwrap());
    }

    #[test]
    fn sizes_without_end_are_refused() {
        for size in [
            [0, 1, 1],
            [usize::MAX, 2, 2],
            [1, 1, 5_000_000],
            [2_000_000, 2_000_000, 1],
            [100_000, 100_000, 100_000],
        ] {
            assert_eq!(OccupancyGrid::new(size), Err(SizeError { size }));
        }
    }
}
