//! A*, weighted A*, and the search that is best when it is stopped: anytime repairing A* (Likhachev, Gordon and Thrun
//! 2003), of which the other two are special cases.

use super::open_list::{Open, OpenList};
use crate::grid::{Bricks, Lattice, MOVES, Packed, moved, octile};
use crate::map::VoxelIndex;

/// The effort of a search: how near the cheapest way it must come, and its budget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Weight of the heuristic that the search begins with, at least 1: the greater, the sooner there is a first
    /// path, which costs at most so many times the least.
    pub weight: f64,
    /// The search ends once its path is proven to cost at most so many times the least, at least 1.
    pub bound: f64,
    /// The search ends once it has expanded so many cells.
    pub budget: usize,
}

impl Effort {
    /// A budget that takes a few milliseconds with 26 neighbours, and less than ten on slow or busy processors.
    pub const IN_A_TICK: usize = 10_000;

    /// A*: the path of least cost.
    pub const OPTIMAL: Effort = Effort { weight: 1.0, bound: 1.0, budget: usize::MAX };

    /// Weighted A*: a path that costs at most `bound` times the least.
    pub fn weighted(bound: f64) -> Effort {
        Effort { weight: bound, bound, budget: usize::MAX }
    }

    /// Budgeted A*: soon a path, then better ones, until one costs at most `bound` times the least or `budget` cells
    /// have been expanded.
    pub fn budgeted(bound: f64, budget: usize) -> Effort {
        Effort { weight: FIRST_WEIGHT.max(bound), bound, budget }
    }
}

/// The weight that a budgeted search begins with.
const FIRST_WEIGHT: f64 = 1.5;
/// Share of the excess weight that the next round keeps.
const TIGHTENED: f64 = 0.25;

/// A way through a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// From the start to the goal, neighbour by neighbour.
    pub cells: Vec<VoxelIndex>,
    /// Sum of its steps' costs.
    pub cost: f64,
    /// It is proven to cost at most so many times the least.
    pub bound: f64,
    pub expanded: usize,
}

/// Why there is no way.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Unsolved {
    #[error("everything reachable from the start was searched ({expanded} cells)")]
    Unreachable { expanded: usize },
    #[error("no way was found within {expanded} expansions")]
    Spent { expanded: usize, partial: Vec<VoxelIndex> },
}

/// A search over a [`Lattice`], and the memory that searches reuse, so that the next one allocates little and clears
/// nothing.
///
/// With weight 1 this is A*: cells are expanded by least `f = g + h`, of equal ones by greatest `g`, `h` being the
/// octile distance, which is consistent, so that no cell is expanded twice and the first path found is the best. With
/// a greater weight `f = g + w h`; a path so found costs at most `w` times the least (Pohl 1970). Between rounds the
/// weight falls, what was found is kept, and only cells whose cost has improved since they were expanded are expanded
/// again. The bound told is the lesser of the weight and the path's cost over the least `g + h` of what may still be
/// expanded: no path can cost less than that.
///
/// Time is `O(n log n)` in the cells expanded, of which there are at most as many in each round as the grid has.
/// Memory is taken near the cells that were looked at only.
#[derive(Clone, Debug)]
pub struct Search {
    nodes: Bricks<Node>,
    /// Number of the search that `nodes` belong to.
    generation: u32,
    /// Number of the round within the search: rounds differ by weight.
    round: u8,
    open: OpenList,
    /// Cells whose cost improved after they were expanded in this round.
    inconsistent: Vec<VoxelIndex>,
    least_costs: [f64; 3],
    start: VoxelIndex,
    goal: VoxelIndex,
    effort: Effort,
    weight: f64,
    goal_g: f64,
    /// Proven bound on the cost of the path known.
    bound: f64,
    expanded: usize,
    /// The cell reached that is nearest to the goal by the heuristic, and how near.
    nearest: (VoxelIndex, f64),
}

/// A cell's record in a search; valid if `generation` is the search's own.
#[derive(Clone, Copy, Debug, Default)]
struct Node {
    g: f64,
    generation: u32,
    /// Number of the move that led here, or [`ROOT`].
    arrived_by: u8,
    /// The round in which it was expanded last, or 0.
    closed_in: u8,
}

/// Mark of the start, which no move led to.
const ROOT: u8 = u8::MAX;
/// The excess weight is beneath rounding after fewer.
const LAST_ROUND: u8 = 60;

impl Default for Search {
    fn default() -> Self {
        let origin = VoxelIndex::default();
        Search {
            nodes: Bricks::default(),
            generation: 0,
            round: 1,
            open: OpenList::default(),
            inconsistent: Vec::new(),
            least_costs: [1.0; 3],
            start: origin,
            goal: origin,
            effort: Effort::OPTIMAL,
            weight: 1.0,
            goal_g: f64::INFINITY,
            bound: f64::INFINITY,
            expanded: 0,
            nearest: (origin, f64::INFINITY),
        }
    }
}

impl Search {
    /// Searches from start to goal, both cells of the lattice, until there is an answer.
    ///
    /// ```
    /// use skein_planning::global::{Effort, Search};
    /// use skein_planning::grid::{Grid, OccupancyGrid, StepCosts};
    /// use skein_planning::map::VoxelIndex;
    ///
    /// let cell = |x, y| VoxelIndex { x, y, z: 0 };
    /// let mut grid = Grid { cells: OccupancyGrid::new([5, 3, 1])?, costs: StepCosts::EUCLIDEAN };
    /// grid.cells.set_blocked(cell(2, 1), true);
    /// let route = Search::default().solve(&grid, cell(0, 1), cell(4, 1), Effort::OPTIMAL)?;
    /// assert!((route.cost - (2.0 + 2.0 * 2.0_f64.sqrt())).abs() < 1e-12, "no corner is cut");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn solve(
        &mut self,
        lattice: &impl Lattice,
        start: VoxelIndex,
        goal: VoxelIndex,
        effort: Effort,
    ) -> Result<Route, Unsolved> {
        self.begin(lattice, start, goal, effort);
        loop {
            if let Some(answer) = self.advance(lattice, usize::MAX) {
                return answer;
            }
        }
    }

    /// Begins a search, in place of any before. [`Search::advance`] does the work.
    pub fn begin(&mut self, lattice: &impl Lattice, start: VoxelIndex, goal: VoxelIndex, effort: Effort) {
        self.inconsistent.clear();
        self.least_costs = lattice.least_costs();
        self.nodes.fit(lattice.size());
        self.generation = self.generation.checked_add(1).unwrap_or_else(|| {
            self.nodes.clear();
            1
        });
        self.round = 1;
        (self.start, self.goal, self.effort) = (start, goal, effort);
        self.weight = effort.weight.max(1.0);
        self.bound = f64::INFINITY;
        self.expanded = 0;
        self.goal_g = if start == goal { 0.0 } else { f64::INFINITY };
        let h = self.heuristic(start);
        self.nearest = (start, h);
        *self.nodes.slot(start) =
            Node { g: 0.0, generation: self.generation, arrived_by: ROOT, closed_in: 0 };
        self.open.reset(self.weight * h, self.least_costs[0]);
        self.open.push(self.weight * h, greatest_first(0.0), Packed::of(start));
    }

    /// Goes on with a search, for at most `expansions` cells. `None` if there is no answer yet.
    ///
    /// The lattice may have changed since the last call: what was expanded before stays as it was found.
    pub fn advance(&mut self, lattice: &impl Lattice, expansions: usize) -> Option<Result<Route, Unsolved>> {
        let pause = self.expanded.saturating_add(expansions);
        loop {
            let is_settled = self.improve(lattice, pause.min(self.effort.budget));
            let is_spent = self.expanded >= self.effort.budget;
            if !is_settled && !is_spent {
                return None;
            }
            if self.goal_g == f64::INFINITY {
                let expanded = self.expanded;
                return Some(Err(if is_settled {
                    Unsolved::Unreachable { expanded }
                } else {
                    Unsolved::Spent { expanded, partial: self.way_to(self.nearest.0) }
                }));
            }
            self.prove(is_settled);
            if is_spent || self.bound <= self.effort.bound || self.round == LAST_ROUND {
                return Some(Ok(self.route(lattice)));
            }
            self.tighten();
        }
    }

    /// Cells expanded so far.
    pub fn expanded(&self) -> usize {
        self.expanded
    }

    /// Expands cells until no open one promises a better path at this weight, or `limit` cells have been expanded in
    /// all. Whether the former came first.
    fn improve(&mut self, lattice: &impl Lattice, limit: usize) -> bool {
        while let Some(next) = self.open.pop() {
            if self.open.rank(self.goal_g) <= next.rank {
                self.open.put_back(next);
                return true;
            }
            let node = self.nodes.slot(next.cell.unpacked());
            if node.closed_in == self.round || g_of(&next) > node.g {
                continue;
            }
            if self.expanded >= limit {
                self.open.put_back(next);
                return false;
            }
            node.closed_in = self.round;
            let arrived_by = usize::from(node.arrived_by);
            self.expanded += 1;
            self.expand(lattice, next, arrived_by);
        }
        true
    }

    fn expand(&mut self, lattice: &impl Lattice, next: Open, arrived_by: usize) {
        let (here, here_g) = (next.cell.unpacked(), g_of(&next));
        let leaves_out = self.seeks_least() && arrived_by < MOVES.len();
        let relax = |number: usize, cost: f64| {
            let there = moved(here, MOVES[number].by);
            let g = here_g + cost;
            let node = self.nodes.slot(there);
            if node.generation != self.generation {
                *node =
                    Node { g: f64::INFINITY, generation: self.generation, arrived_by: ROOT, closed_in: 0 };
            }
            if g >= node.g {
                return;
            }
            node.g = g;
            node.arrived_by = number as u8;
            if node.closed_in == self.round {
                self.inconsistent.push(there);
                return;
            }
            let h = octile(there, self.goal, self.least_costs);
            self.open.push(g + self.weight * h, greatest_first(g), Packed::of(there));
            if h < self.nearest.1 {
                self.nearest = (there, h);
            }
            if there == self.goal {
                self.goal_g = g;
            }
        };
        if leaves_out {
            lattice.steps_after(here, arrived_by, relax);
        } else {
            lattice.steps_from(here, relax);
        }
    }

    /// Works out what the path known is proven to cost at most, in the least. With all settled, the weight is a proof
    /// too.
    fn prove(&mut self, is_settled: bool) {
        if is_settled {
            self.bound = self.bound.min(self.weight);
        }
        if self.bound > self.effort.bound {
            let least = self.unfinished().map(|(_, g, h)| g + h).fold(self.goal_g, f64::min);
            let proven = if self.goal_g > 0.0 { self.goal_g / least } else { 1.0 };
            self.bound = self.bound.min(proven);
        }
    }

    /// Begins the next round, with less weight.
    fn tighten(&mut self) {
        let weight = 1.0 + (self.weight - 1.0) * TIGHTENED;
        self.weight = weight.max(self.effort.bound.max(1.0)).min(self.bound);
        let unfinished: Vec<_> = self.unfinished().collect();
        let keys = unfinished.iter().map(|(_, g, h)| g + self.weight * h);
        self.open.reset(keys.fold(f64::INFINITY, f64::min), self.least_costs[0]);
        for (cell, g, h) in unfinished {
            self.open.push(g + self.weight * h, greatest_first(g), Packed::of(cell));
        }
        self.inconsistent.clear();
        self.round += 1;
    }

    /// The cells that may still be expanded, or expanded again: `g` and `h` of each.
    fn unfinished(&self) -> impl Iterator<Item = (VoxelIndex, f64, f64)> + '_ {
        let open = self.open.iter().filter(|entry| {
            let node = self.nodes.get(entry.cell.unpacked());
            node.closed_in != self.round && g_of(entry) == node.g
        });
        let cells = open.map(|entry| entry.cell.unpacked()).chain(self.inconsistent.iter().copied());
        cells.map(|cell| (cell, self.nodes.get(cell).g, self.heuristic(cell)))
    }

    /// The path known. With weight, its cost may be less than the goal's `g`: a cell on it may have improved since.
    fn route(&self, lattice: &impl Lattice) -> Route {
        let cells = self.way_to(self.goal);
        let cost = if self.seeks_least() { self.goal_g } else { cost_of(lattice, &cells).min(self.goal_g) };
        Route { bound: self.bound.max(1.0), expanded: self.expanded, cost, cells }
    }

    /// The way to a cell that was reached.
    fn way_to(&self, last: VoxelIndex) -> Vec<VoxelIndex> {
        let mut cells = vec![last];
        let mut here = last;
        while let Some(step) = MOVES.get(usize::from(self.nodes.get(here).arrived_by)) {
            here = moved(here, step.by.map(|c| -c));
            cells.push(here);
        }
        cells.reverse();
        cells
    }

    /// Whether the first path found is the best, so that no cell is expanded before its `g` is the least.
    fn seeks_least(&self) -> bool {
        self.effort.weight <= 1.0
    }

    fn heuristic(&self, cell: VoxelIndex) -> f64 {
        octile(cell, self.goal, self.least_costs)
    }
}

/// The tie that puts the greatest `g` first.
#[inline]
fn greatest_first(g: f64) -> u64 {
    !g.to_bits()
}

/// The `g` that such a tie was made of.
#[inline]
fn g_of(open: &Open) -> f64 {
    f64::from_bits(!open.tie)
}

/// The cost of a way through neighbours; infinite if a step of it does not exist.
pub fn cost_of(lattice: &impl Lattice, cells: &[VoxelIndex]) -> f64 {
    let step_cost = |pair: &[VoxelIndex]| {
        let mut found = f64::INFINITY;
        lattice.steps_from(pair[0], |number, cost| {
            if moved(pair[0], MOVES[number].by) == pair[1] {
                found = cost;
            }
        });
        found
    };
    cells.windows(2).map(step_cost).sum()
}
