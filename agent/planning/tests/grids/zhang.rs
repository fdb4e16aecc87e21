//! The routes that Zhang 2019 publishes, on a marker grid whose obstacles are a reconstruction: the paper's picture
//! is not legible.

use nalgebra::Vector3;
use skein_planning::Path;
use skein_planning::global::{DStarLite, elide_collinear};
use skein_planning::grid::{Grid, OccupancyGrid, StepCosts};
use skein_planning::map::VoxelIndex;

/// Cells are numbered row by row from 1.
fn cell(number: usize) -> VoxelIndex {
    VoxelIndex { x: (number - 1) % 10, y: (number - 1) / 10, z: 0 }
}

fn numbers(cells: &[VoxelIndex]) -> Vec<usize> {
    cells.iter().map(|cell| cell.y * 10 + cell.x + 1).collect()
}

fn route(costs: StepCosts) -> (Vec<VoxelIndex>, f64) {
    let mut grid = Grid { cells: OccupancyGrid::new([10, 10, 1]).unwrap(), costs };
    for number in [24, 32, 33, 34, 42, 45, 46, 47, 57] {
        grid.cells.set_blocked(cell(number), true);
    }
    let route = DStarLite::new(&grid, cell(3), cell(66)).plan(&grid, usize::MAX).unwrap();
    (route.cells, route.cost)
}

#[test]
fn the_plain_route_is_the_published_one() {
    let (cells, cost) = route(StepCosts::ZHANG_PLAIN);
    assert_eq!((numbers(&cells), cost), (vec![3, 14, 25, 35, 44, 55, 66], 80.0));
}

#[test]
fn the_improved_route_is_the_published_one_and_so_is_the_elided() {
    let (cells, cost) = route(StepCosts::ZHANG_IMPROVED);
    assert_eq!((numbers(&cells), cost), (vec![3, 4, 15, 26, 35, 44, 54, 65, 66], 132.0));
    let points = cells.iter().map(|cell| Vector3::new(cell.x as f64, cell.y as f64, 0.0)).collect();
    let elided = elide_collinear(&Path::new(points).unwrap());
    let kept: Vec<VoxelIndex> =
        elided.points().iter().map(|at| VoxelIndex { x: at.x as usize, y: at.y as usize, z: 0 }).collect();
    assert_eq!(numbers(&kept), [3, 4, 26, 44, 54, 65, 66]);
}

#[test]
fn what_flies_cuts_no_corner_of_that_grid() {
    let (cells, _) = route(StepCosts::FLYING);
    let mut grid = OccupancyGrid::new([10, 10, 1]).unwrap();
    for number in [24, 32, 33, 34, 42, 45, 46, 47, 57] {
        grid.set_blocked(cell(number), true);
    }
    for step in cells.windows(2) {
        let corners = [VoxelIndex { x: step[0].x, ..step[1] }, VoxelIndex { x: step[1].x, ..step[0] }];
        assert!(corners.iter().all(|corner| !grid.is_blocked(*corner)), "{:?}", numbers(&cells));
    }
}
