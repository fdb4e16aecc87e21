//! The grid as a search knows it: its size, its steps, and their costs.

use super::detours::{self, Worth};
use super::moves::LENGTHS;
use super::{CENTRE, MOVES, OccupancyGrid, moved, moves_to, unswept};
use crate::map::VoxelIndex;

/// A box of cells with steps between neighbours.
///
/// A step is told by the number of its move in [`MOVES`]. No step costs less than [`Lattice::least_costs`], and those
/// must be such that the octile distance is what the shortest way on an empty grid costs ([`super::octile`]). The
/// cost of the steps from a cell depends on that cell and its 26 neighbours alone.
pub trait Lattice {
    /// Cells along x, y and z.
    fn size(&self) -> [usize; 3];

    /// The least that a step through a face, across an edge and across a corner can cost.
    fn least_costs(&self) -> [f64; 3];

    /// Tells `visit` every step that leads from `cell`: its move and its cost.
    fn steps_from(&self, cell: VoxelIndex, visit: impl FnMut(usize, f64));

    /// The same without some that a cheapest way which came to `cell` by a move need not take. What is left out leads
    /// where one also gets from the cell before, without `cell`: for less, or for the same if the last step of that way
    /// is of a lesser kind ([`Move::kind`](super::Move::kind)).
    ///
    /// A search of least cost finds the same costs with it. For if the cheapest ways to some cell end in steps left
    /// out, then each also has a neighbour before it whose last step is of a lesser kind, and there are but three
    /// kinds.
    fn steps_after(&self, cell: VoxelIndex, _arrived_by: usize, visit: impl FnMut(usize, f64)) {
        self.steps_from(cell, visit);
    }
}

/// A lattice that can be searched from the goal to the start.
pub trait ReversibleLattice: Lattice {
    /// Tells `visit` every step that leads into `cell`: its move and its cost, to the last bit as
    /// [`Lattice::steps_from`] tells it.
    fn steps_into(&self, cell: VoxelIndex, visit: impl FnMut(usize, f64));
}

/// The steps on a [`Grid`] and their costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepCosts {
    /// Cost of a step through a face, across an edge and across a corner.
    pub lengths: [f64; 3],
    /// Whether a diagonal step may pass between blocked cells. What flies never may: otherwise every cell of the box
    /// that the step sweeps must be free.
    pub cuts_corners: bool,
    /// The collision factor `Ob` (Zhang 2019): a step from a cell with a blocked one among its straight neighbours
    /// costs so much more, with one among its diagonal neighbours half as much more, with both the sum. Zhang
    /// searches from the goal to the start, so that the *child* of a step is the cell that the vehicle leaves.
    pub collision_factor: f64,
}

impl StepCosts {
    /// Lengths in cells, no corners cut: what published optimal lengths hold for (Sturtevant 2012).
    pub const EUCLIDEAN: StepCosts =
        StepCosts { lengths: LENGTHS, cuts_corners: false, collision_factor: 0.0 };

    /// Zhang's plain D*: straight 10, diagonal 14, corners cut.
    pub const ZHANG_PLAIN: StepCosts =
        StepCosts { lengths: [10.0, 14.0, 17.0], cuts_corners: true, collision_factor: 0.0 };

    /// Zhang's improved D*: the same with `Ob = 8`.
    pub const ZHANG_IMPROVED: StepCosts = StepCosts { collision_factor: 8.0, ..Self::ZHANG_PLAIN };

    /// Zhang's collision factor for what flies: lengths in cells, `Ob` in the same proportion to them, no corners cut.
    pub const FLYING: StepCosts = StepCosts { collision_factor: 0.8, ..Self::EUCLIDEAN };
}

/// All 26 neighbours, as bits of a neighbourhood.
const NEIGHBOURS: u32 = 0o777_777_777 & !CENTRE;
/// The straight neighbours, through the cell's faces, as bits of its neighbourhood.
const STRAIGHT: u32 = 0o020_252_020;

/// Cells that are free or blocked, with one cost for steps of each kind.
///
/// A step leads from a free cell to a free cell. In a grid of one layer there are 8 neighbours, else 26.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Which cells are blocked.
    pub cells: OccupancyGrid,
    pub costs: StepCosts,
}

impl Grid {
    /// The cost of a step from `cell` beyond its length, given its neighbourhood.
    #[inline]
    fn penalty(&self, cell: VoxelIndex, around: u32) -> f64 {
        let factor = self.costs.collision_factor;
        if factor == 0.0 {
            return 0.0;
        }
        let blocked = around & !self.cells.outside_around(cell);
        let straight = if blocked & STRAIGHT == 0 { 0.0 } else { factor };
        let diagonal = if blocked & !STRAIGHT & !CENTRE == 0 { 0.0 } else { factor / 2.0 };
        straight + diagonal
    }

    /// The ends of the moves that lead from a cell with such a neighbourhood, or, reversed, into it.
    #[inline]
    fn passable(&self, blocked: u32) -> u32 {
        if blocked & CENTRE != 0 {
            0
        } else if self.costs.cuts_corners {
            !blocked & NEIGHBOURS
        } else {
            unswept(blocked)
        }
    }

    /// Which detours are worth as much as a way through a cell from which steps cost so much beyond their length.
    fn worth(&self, penalty: f64) -> Worth {
        let StepCosts { lengths, cuts_corners, collision_factor } = self.costs;
        if cuts_corners || lengths != LENGTHS || collision_factor < 0.0 {
            Worth::None
        } else if penalty >= collision_factor + collision_factor / 2.0 {
            // No other cell's can be greater.
            Worth::Any
        } else {
            Worth::Direct
        }
    }
}

impl Lattice for Grid {
    fn size(&self) -> [usize; 3] {
        self.cells.size()
    }

    fn least_costs(&self) -> [f64; 3] {
        self.costs.lengths
    }

    #[inline]
    fn steps_from(&self, cell: VoxelIndex, mut visit: impl FnMut(usize, f64)) {
        let around = self.cells.blocked_around(cell);
        let penalty = self.penalty(cell, around);
        moves_to(self.passable(around))
            .for_each(|number| visit(number, self.costs.lengths[MOVES[number].kind] + penalty));
    }

    #[inline]
    fn steps_after(&self, cell: VoxelIndex, arrived_by: usize, mut visit: impl FnMut(usize, f64)) {
        let around = self.cells.blocked_around(cell);
        let penalty = self.penalty(cell, around);
        let needed = detours::without(self.passable(around), around, arrived_by, self.worth(penalty));
        moves_to(needed).for_each(|number| visit(number, self.costs.lengths[MOVES[number].kind] + penalty));
    }
}

impl ReversibleLattice for Grid {
    #[inline]
    fn steps_into(&self, cell: VoxelIndex, mut visit: impl FnMut(usize, f64)) {
        moves_to(self.passable(self.cells.blocked_around(cell))).for_each(|number| {
            let before = moved(cell, MOVES[number].by);
            let penalty = match self.costs.collision_factor {
                0.0 => 0.0,
                _ => self.penalty(before, self.cells.blocked_around(before)),
            };
            visit(25 - number, self.costs.lengths[MOVES[number].kind] + penalty);
        });
    }
}
