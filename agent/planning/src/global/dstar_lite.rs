//! D* Lite (Koenig and Likhachev 2002): the shortest way again, cheaply, after the grid has changed or the vehicle
//! moved.

use super::open_list::{Open, OpenList};
use super::{Route, Unsolved};
use crate::grid::{Bricks, MOVES, Packed, ReversibleLattice, moved, octile};
use crate::map::VoxelIndex;

/// A search from the goal to a vehicle that moves, over a [`ReversibleLattice`] that changes.
///
/// It keeps, for every cell, the cost `g` of the way to the goal as it was when last expanded, and `rhs`, what the
/// neighbours' `g` make of it now. Where the two differ the cell waits in the open list under the key
/// `(min(g, rhs) + h(start, cell) + km, min(g, rhs))`; `km` grows by the heuristic as the vehicle moves, so that keys
/// from before stay lower bounds and nothing has to be sorted anew. A change near the vehicle, which is where sensors
/// see, touches few cells whose distance to the goal depends on it. The costs found are those of a fresh search.
///
/// This is the paper's optimised version, its final one, with two differences. Outdated entries stay in the open list
/// until they are met. And sums of real numbers are rounded, so cells whose keys differ from the vehicle's by no more
/// than rounding may be expanded too, lest a cell on the way itself be left as it was.
///
/// The first search is `O(n log n)` in all cells nearer to the goal than the vehicle is, by `f`; the next ones in the
/// cells whose cost changes. Memory is taken near the cells looked at.
///
/// ```
/// use skein_planning::global::DStarLite;
/// use skein_planning::grid::{Grid, OccupancyGrid, StepCosts};
/// use skein_planning::map::VoxelIndex;
///
/// let cell = |x, y| VoxelIndex { x, y, z: 0 };
/// let mut grid = Grid { cells: OccupancyGrid::new([5, 3, 1])?, costs: StepCosts::EUCLIDEAN };
/// let mut search = DStarLite::new(&grid, cell(0, 1), cell(4, 1));
/// assert_eq!(search.plan(&grid, usize::MAX)?.cost, 4.0);
/// grid.cells.set_blocked(cell(2, 1), true);
/// search.move_to(cell(1, 1));
/// search.heed(&grid, &[cell(2, 1)]);
/// assert_eq!(search.plan(&grid, usize::MAX)?.cells.len(), 5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct DStarLite {
    nodes: Bricks<Node>,
    /// A tie is the key's second part, `min(g, rhs)`: if that has changed, the entry is outdated.
    open: OpenList,
    /// Entries that the open list may have before outdated ones are looked for.
    most_open: usize,
    size: [usize; 3],
    least_costs: [f64; 3],
    start: VoxelIndex,
    goal: VoxelIndex,
    /// Where the vehicle was when keys were last made to fit.
    keyed_for: VoxelIndex,
    km: f64,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    g: f64,
    rhs: f64,
}

impl Default for Node {
    fn default() -> Self {
        Node { g: f64::INFINITY, rhs: f64::INFINITY }
    }
}

impl Node {
    fn is_consistent(self) -> bool {
        self.g == self.rhs
    }

    fn least(self) -> f64 {
        self.g.min(self.rhs)
    }
}

/// Sums that differ by less than this share are the same but for rounding.
const ROUNDING: f64 = 1e-10;
/// Outdated entries are looked for when the open list is longer than this, and than twice what was left the last time.
const OPEN_AT_LEAST: usize = 4096;

impl DStarLite {
    /// A search from `goal` to `start`, both cells of the lattice. [`DStarLite::plan`] does the work.
    pub fn new(lattice: &impl ReversibleLattice, start: VoxelIndex, goal: VoxelIndex) -> DStarLite {
        let mut search = DStarLite {
            nodes: Bricks::default(),
            open: OpenList::default(),
            most_open: OPEN_AT_LEAST,
            size: lattice.size(),
            least_costs: lattice.least_costs(),
            start,
            goal,
            keyed_for: start,
            km: 0.0,
        };
        search.nodes.fit(search.size);
        search.nodes.slot(goal).rhs = 0.0;
        search.open.reset(search.key(goal), search.least_costs[0]);
        search.push(goal);
        search
    }

    /// Where the way ends.
    pub fn goal(&self) -> VoxelIndex {
        self.goal
    }

    /// The vehicle has moved to a cell of the lattice.
    pub fn move_to(&mut self, start: VoxelIndex) {
        self.start = start;
    }

    /// Cells have changed: that they are blocked, or anything else that the cost of steps from them or their neighbours
    /// depends on. Told after the change, before the next [`DStarLite::plan`]. Cells outside the lattice are ignored.
    pub fn heed(&mut self, lattice: &impl ReversibleLattice, changed: &[VoxelIndex]) {
        self.fit_keys();
        let around = |cell: &VoxelIndex| {
            let cell = *cell;
            MOVES.iter().map(move |step| moved(cell, step.by)).chain([cell])
        };
        let [nx, ny, nz] = self.size;
        let inside = |cell: &VoxelIndex| cell.x < nx && cell.y < ny && cell.z < nz;
        let mut touched: Vec<VoxelIndex> = changed.iter().flat_map(around).filter(inside).collect();
        touched.sort_unstable();
        touched.dedup();
        for cell in touched {
            self.renew(lattice, cell);
        }
    }

    /// The shortest way from where the vehicle is now, expanding at most `budget` cells.
    ///
    /// # Errors
    /// There is no way; or the budget was spent first, and the next call goes on from there.
    pub fn plan(&mut self, lattice: &impl ReversibleLattice, budget: usize) -> Result<Route, Unsolved> {
        self.fit_keys();
        let mut expanded = 0;
        while let Some(next) = self.next() {
            if expanded == budget {
                return Err(Unsolved::Spent { expanded, partial: vec![self.start] });
            }
            self.open.pop();
            expanded += usize::from(self.settle(lattice, next));
        }
        self.drop_outdated();
        self.route(lattice, expanded).ok_or(Unsolved::Unreachable { expanded })
    }

    /// Keys from before the vehicle moved stay lower bounds of those made from now on.
    fn fit_keys(&mut self) {
        self.km += octile(self.keyed_for, self.start, self.least_costs);
        self.keyed_for = self.start;
    }

    /// The first entry of the open list, if it may matter to the way from the start.
    fn next(&mut self) -> Option<Open> {
        let reached = self.nodes.get(self.start).least() + self.km;
        let last = self.open.rank(reached + ROUNDING * (1.0 + reached));
        self.open.peek().filter(|next| next.rank <= last)
    }

    /// Takes an entry of the open list; whether its cell was expanded.
    fn settle(&mut self, lattice: &impl ReversibleLattice, next: Open) -> bool {
        let cell = next.cell.unpacked();
        let node = self.nodes.get(cell);
        if node.is_consistent() || node.least().to_bits() != next.tie {
            return false;
        }
        let key = self.key(cell);
        if next.rank < self.open.rank(key) {
            self.open.push(key, next.tie, next.cell);
            return false;
        }
        if node.g > node.rhs {
            self.lower(lattice, cell, node.rhs);
        } else {
            self.raise(lattice, cell, node.g);
        }
        true
    }

    /// The way from a cell has become cheaper: so may be those through it.
    fn lower(&mut self, lattice: &impl ReversibleLattice, here: VoxelIndex, g: f64) {
        self.nodes.slot(here).g = g;
        lattice.steps_into(here, |number, cost| {
            let before = before(here, number);
            let node = self.nodes.slot(before);
            if cost + g < node.rhs && before != self.goal {
                node.rhs = cost + g;
                self.push(before);
            }
        });
    }

    /// The way from a cell has become dearer: those that led through it must be found again.
    fn raise(&mut self, lattice: &impl ReversibleLattice, here: VoxelIndex, g: f64) {
        self.nodes.slot(here).g = f64::INFINITY;
        self.push(here);
        lattice.steps_into(here, |number, cost| {
            let before = before(here, number);
            if self.nodes.get(before).rhs == cost + g {
                self.renew(lattice, before);
            }
        });
    }

    /// Works `rhs` out anew from the neighbours.
    fn renew(&mut self, lattice: &impl ReversibleLattice, cell: VoxelIndex) {
        if cell == self.goal {
            return;
        }
        let mut rhs = f64::INFINITY;
        lattice.steps_from(cell, |number, cost| {
            let there = moved(cell, MOVES[number].by);
            rhs = rhs.min(cost + self.nodes.get(there).g);
        });
        let node = self.nodes.slot(cell);
        if node.rhs != rhs {
            node.rhs = rhs;
            self.push(cell);
        }
    }

    /// Puts a cell on the open list, if it belongs there.
    fn push(&mut self, cell: VoxelIndex) {
        let node = self.nodes.get(cell);
        if !node.is_consistent() {
            self.open.push(self.key(cell), node.least().to_bits(), Packed::of(cell));
        }
    }

    fn key(&self, cell: VoxelIndex) -> f64 {
        self.nodes.get(cell).least() + octile(self.start, cell, self.least_costs) + self.km
    }

    /// Forgets outdated entries of the open list once they may be many.
    fn drop_outdated(&mut self) {
        if self.open.len() <= self.most_open {
            return;
        }
        let mut cells: Vec<Packed> = self.open.iter().map(|entry| entry.cell).collect();
        cells.sort_unstable();
        cells.dedup();
        self.open.reset(self.key(self.goal).min(self.key(self.start)), self.least_costs[0]);
        cells.into_iter().for_each(|cell| self.push(cell.unpacked()));
        self.most_open = OPEN_AT_LEAST.max(2 * self.open.len());
    }

    /// From the start, always to the neighbour through which the way is cheapest.
    fn route(&self, lattice: &impl ReversibleLattice, expanded: usize) -> Option<Route> {
        let mut cells = vec![self.start];
        let (mut here, mut cost) = (self.start, 0.0);
        let mut left = f64::INFINITY;
        while here != self.goal {
            let mut best: Option<(f64, f64, VoxelIndex)> = None;
            lattice.steps_from(here, |number, step_cost| {
                let there = moved(here, MOVES[number].by);
                let g = self.nodes.get(there).g;
                if best.is_none_or(|(least, ..)| step_cost + g < least) {
                    best = Some((step_cost + g, step_cost, there));
                }
            });
            // What is left falls at every step, or there is no way.
            let (rest, step_cost, there) = best.filter(|(rest, ..)| *rest < left)?;
            left = rest;
            cost += step_cost;
            here = there;
            cells.push(there);
        }
        Some(Route { cells, cost, bound: 1.0, expanded })
    }
}

/// The cell that a step leads from into `here`.
fn before(here: VoxelIndex, number: usize) -> VoxelIndex {
    moved(here, MOVES[number].by.map(|c| -c))
}
