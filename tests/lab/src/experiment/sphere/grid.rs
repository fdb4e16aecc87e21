//! Which of many vehicles are near a place: a grid of cells.

use nalgebra::Vector3;

/// Vehicles by the cell that they are in; made anew when they have moved.
///
/// A uniform grid (Green 2010, "Particle simulation using CUDA", with the cells sorted rather than hashed). Making it
/// takes `O(n log n)` steps. Looking around a place costs nine searches of `O(log n)`, and one comparison for each
/// vehicle in the 27 cells there: with an edge of the distance that is looked at, about as many as are near.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    edge_m: f64,
    /// Sorted by cell, so that cells one above the other lie beside one another.
    vehicles: Vec<Entry>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Entry {
    cell: Cell,
    index: usize,
    position: Vector3<f64>,
}

/// East, north, up.
type Cell = [i64; 3];

impl Grid {
    /// A grid with cells of this edge, metres. Vehicles at no finite place are left out.
    #[must_use]
    pub fn new(positions: &[Vector3<f64>], edge_m: f64) -> Self {
        let edge_m = if edge_m > 0.0 { edge_m } else { 1.0 };
        let finite = |(_, position): &(usize, &Vector3<f64>)| position.iter().all(|axis| axis.is_finite());
        let mut vehicles: Vec<Entry> = positions
            .iter()
            .enumerate()
            .filter(finite)
            .map(|(index, position)| Entry { cell: cell(position, edge_m), index, position: *position })
            .collect();
        vehicles.sort_unstable_by_key(|entry| (entry.cell, entry.index));
        Self { edge_m, vehicles }
    }

    /// The indices of the vehicles nearer than `reach_m` to `place`, in the order of their cells; the one that is
    /// there itself is among them. A reach longer than the cells' edge looks at as many more of them.
    pub fn within(&self, place: &Vector3<f64>, reach_m: f64) -> impl Iterator<Item = usize> + '_ {
        let place = *place;
        let [east, north, up] = cell(&place, self.edge_m);
        let rings = (reach_m / self.edge_m).ceil().clamp(0.0, MOST_RINGS) as i64;
        let columns =
            (-rings..=rings).flat_map(move |x| (-rings..=rings).map(move |y| (east + x, north + y)));
        columns
            .flat_map(move |(x, y)| self.column([x, y, up - rings], up + rings))
            .filter(move |entry| (entry.position - place).norm_squared() < reach_m * reach_m)
            .map(|entry| entry.index)
    }

    /// The vehicles from a cell up to the height `top` above it.
    fn column(&self, [x, y, bottom]: Cell, top: i64) -> impl Iterator<Item = &Entry> {
        let from = self.vehicles.partition_point(|entry| entry.cell < [x, y, bottom]);
        self.vehicles[from..].iter().take_while(move |entry| entry.cell <= [x, y, top])
    }
}

/// Reaches of more cells than this are cut short: 10 000 times 10 000 columns help nobody.
const MOST_RINGS: f64 = 1e4;

/// The cell of a place; far away, the last one that has a number.
fn cell(place: &Vector3<f64>, edge_m: f64) -> Cell {
    let number = |metres: f64| (metres / edge_m).floor().clamp(-1e15, 1e15) as i64;
    [number(place.x), number(place.y), number(place.z)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn those_within_reach_are_found_and_no_others() {
        let vehicles = [Vector3::zeros(), Vector3::new(2.0, 0.0, 0.0), Vector3::new(9.0, 0.0, 0.0)];
        let grid = Grid::new(&vehicles, 3.0);
        let near: Vec<usize> = grid.within(&Vector3::new(1.0, 0.0, 0.0), 3.0).collect();
        assert_eq!(near, [0, 1]);
    }
    use proptest::prelude::*;

    #[test]
    fn vehicles_at_no_finite_place_are_near_nobody() {
        let grid = Grid::new(&[Vector3::new(f64::NAN, 0.0, 0.0), Vector3::zeros()], 2.0);
        assert_eq!(grid.within(&Vector3::zeros(), 2.0).collect::<Vec<_>>(), [1]);
        assert_eq!(grid.within(&Vector3::new(f64::NAN, 0.0, 0.0), 2.0).count(), 0);
    }

    proptest! {
        #[test]
        fn the_grid_finds_whom_a_search_through_all_finds(
            places in prop::collection::vec(prop::array::uniform3(-20.0..20.0_f64), 1..60),
            edge in 0.5..8.0_f64,
            reach in 0.1..12.0_f64,
        ) {
            let places: Vec<Vector3<f64>> = places.into_iter().map(Vector3::from).collect();
            let grid = Grid::new(&places, edge);
            for place in &places {
                let mut found: Vec<usize> = grid.within(place, reach).collect();
                found.sort_unstable();
                let all = places.iter().enumerate();
                let near: Vec<usize> = all.filter(|(_, other)| (*other - place).norm() < reach).map(|(at, _)| at).collect();
                prop_assert_eq!(found, near);
            }
        }
    }
}
