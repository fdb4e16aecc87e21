//! Values by cell, in bricks that are made when they are first written to.

use crate::map::VoxelIndex;

/// Bits of a cell's place within its brick, along x, y and z: a brick holds what lies together, so that a search that
/// goes on in one place finds what it needs together in memory.
const DEEP: [u32; 3] = [3, 3, 3];
/// The same for a grid of one layer.
const FLAT: [u32; 3] = [5, 5, 0];
/// Memory kept from one search to the next, at most, in bytes: searches of a huge map that each look elsewhere would
/// in the end fill memory with all of it.
const KEPT: usize = 128 << 20;

/// A value for each cell of a grid that takes memory only near those that were written to: a search of a map of many
/// millions of cells looks at few of them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bricks<T> {
    size: [usize; 3],
    is_flat: bool,
    /// Bricks along x and y.
    count: [usize; 2],
    bricks: Vec<Box<[T]>>,
    /// Values in the bricks that were made.
    made: usize,
}

impl<T: Copy + Default> Bricks<T> {
    /// Fits it to a grid of so many cells along x, y and z. What was there is lost, unless the size is the same and
    /// it takes little memory.
    pub fn fit(&mut self, size: [usize; 3]) {
        if self.made * size_of::<T>() > KEPT {
            self.clear();
        }
        if self.size == size {
            return;
        }
        self.size = size;
        self.is_flat = size[2] == 1;
        let bits = bits(self.is_flat);
        let count = [0, 1, 2].map(|axis: usize| size[axis].div_ceil(1 << bits[axis]));
        self.count = [count[0], count[1]];
        self.made = 0;
        self.bricks.clear();
        self.bricks.resize_with(count.iter().product(), Box::default);
    }

    /// Forgets all values, and frees their memory.
    pub fn clear(&mut self) {
        self.made = 0;
        self.bricks.fill_with(Box::default);
    }

    /// The value of a cell of the grid: the default one if nothing was written near.
    #[inline]
    pub fn get(&self, cell: VoxelIndex) -> T {
        let (brick, place) = self.place(cell);
        self.bricks.get(brick).and_then(|brick| brick.get(place)).copied().unwrap_or_default()
    }

    /// The value of a cell of the grid, to be written to.
    #[inline(always)]
    pub fn slot(&mut self, cell: VoxelIndex) -> &mut T {
        let (brick, place) = self.place(cell);
        let brick = &mut self.bricks[brick];
        if brick.is_empty() {
            *brick = vec![T::default(); 1 << bits(self.is_flat).iter().sum::<u32>()].into_boxed_slice();
            self.made += brick.len();
        }
        &mut brick[place]
    }

    /// The brick of a cell, and its place there.
    #[inline(always)]
    fn place(&self, VoxelIndex { x, y, z }: VoxelIndex) -> (usize, usize) {
        let of = |[bx, by, bz]: [u32; 3]| {
            let brick = ((z >> bz) * self.count[1] + (y >> by)) * self.count[0] + (x >> bx);
            let low = |at: usize, bits: u32| at & ((1 << bits) - 1);
            (brick, (low(z, bz) << by | low(y, by)) << bx | low(x, bx))
        };
        // With either known where this is compiled, it takes half as long.
        if self.is_flat { of(FLAT) } else { of(DEEP) }
    }
}

/// Bits of a cell's place within its brick, along x, y and z.
fn bits(is_flat: bool) -> [u32; 3] {
    if is_flat { FLAT } else { DEEP }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(x: usize, y: usize, z: usize) -> VoxelIndex {
        VoxelIndex { x, y, z }
    }

    #[test]
    fn each_cell_has_a_value_of_its_own() {
        for size in [[40, 70, 1], [9, 17, 10]] {
            let mut bricks = Bricks::<u32>::default();
            bricks.fit(size);
            let [nx, ny, nz] = size;
            let all = || (0..nx * ny * nz).map(|n| (n as u32, cell(n % nx, n / nx % ny, n / (nx * ny))));
            all().for_each(|(number, cell)| *bricks.slot(cell) = number);
            assert!(all().all(|(number, cell)| bricks.get(cell) == number));
            bricks.fit(size);
            assert_eq!(bricks.get(cell(1, 0, 0)), 1, "the same size changes nothing");
            bricks.clear();
            assert!(all().all(|(_, cell)| bricks.get(cell) == 0));
        }
    }

    #[test]
    fn much_memory_is_not_kept_for_the_next_search() {
        let mut bricks = Bricks::<[[u64; 8]; 8]>::default();
        bricks.fit([520, 520, 1]);
        let all = || (0..270_400).map(|n| cell(n % 520, n / 520, 0));
        all().take(10_000).for_each(|cell| bricks.slot(cell)[0][0] = 1);
        bricks.fit([520, 520, 1]);
        assert_eq!(bricks.get(cell(1, 0, 0))[0][0], 1);
        all().for_each(|cell| bricks.slot(cell)[0][0] = 1);
        bricks.fit([520, 520, 1]);
        assert_eq!((bricks.get(cell(1, 0, 0))[0][0], bricks.made), (0, 0));
    }

    #[test]
    fn bricks_are_made_where_they_are_written_to() {
        let mut bricks = Bricks::<u64>::default();
        bricks.fit([1000, 1000, 1000]);
        *bricks.slot(cell(999, 999, 999)) = 7;
        *bricks.slot(cell(3, 0, 0)) += 1;
        let read = [(0, 0, 0), (3, 0, 0), (500, 500, 500), (999, 999, 999)]
            .map(|(x, y, z)| bricks.get(cell(x, y, z)));
        assert_eq!(read, [0, 1, 0, 7]);
        assert_eq!(bricks.bricks.iter().filter(|brick| !brick.is_empty()).count(), 2);
    }
}
