//! A* finds the optimal lengths published with real maps (Sturtevant 2012; Brewer and Sturtevant 2018), on a plain
//! grid and on a vehicle's map.

use std::fs;
use std::path::PathBuf;

use nalgebra::Vector3;
use skein_lab::bench::plan::movingai::{self, Problem};
use skein_planning::Region;
use skein_planning::global::astar::{Astar, AstarConfig, Request, plan};
use skein_planning::global::{DStarLite, Effort, Potential, Search};
use skein_planning::grid::{Grid, OccupancyGrid, StepCosts};
use skein_planning::map::{ClearanceMap, VoxelIndex, VoxelMapConfig};

/// A map with its problems, or `None`, said aloud, where the data is absent.
fn shared(map: &str, scenario: &str) -> Option<(Grid, Vec<Problem>)> {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data"));
    let read = |file: &str| {
        let text = fs::read_to_string(folder.join(file)).ok();
        if text.is_none() {
            println!("skipped: needs ../shared/data/{file}");
        }
        text
    };
    let (map, scenario) = (read(map)?, read(scenario)?);
    let cells = movingai::map(&map).unwrap();
    let problems = movingai::problems(&scenario, &cells).unwrap();
    Some((Grid { cells, costs: StepCosts::EUCLIDEAN }, problems))
}

/// Lengths are published with six digits or more.
fn assert_published(length: f64, problem: &Problem) {
    assert!((length - problem.length).abs() <= 5e-6 * problem.length + 1e-8, "{length} for {problem:?}");
}

/// Checks every `stride`-th of the problems with both exact searches.
fn check(map: &str, scenario: &str, stride: usize) {
    let Some((grid, problems)) = shared(map, scenario) else { return };
    let mut search = Search::default();
    for (number, problem) in problems.iter().enumerate().step_by(stride) {
        let route = search.solve(&grid, problem.start, problem.goal, Effort::OPTIMAL).unwrap();
        assert_published(route.cost, problem);
        if number % (5 * stride) == 0 {
            let route = DStarLite::new(&grid, problem.start, problem.goal).plan(&grid, usize::MAX).unwrap();
            assert_published(route.cost, problem);
        }
    }
}

#[test]
fn lengths_on_plane_maps_are_the_published_ones() {
    check("grid2d/arena.map", "grid2d/arena.map.scen", 3);
    check("grid2d/den312d.map", "grid2d/den312d.map.scen", 7);
    check("grid2d/maze-32-32-2.map", "grid2d/maze-32-32-2-random-1.scen", 7);
    check("grid2d/random-32-32-20.map", "grid2d/random-32-32-20-random-1.scen", 7);
}

#[test]
fn lengths_in_space_are_the_published_ones() {
    check("voxel3d/Simple.3dmap", "voxel3d/Simple.3dmap.3dscen", 400);
    check("voxel3d/DA1.3dmap", "voxel3d/DA1.3dmap.3dscen", 3000);
}

/// The same on a map such as a vehicle has.
fn check_clearance_map(map: &str, scenario: &str, stride: usize) {
    let Some((grid, problems)) = shared(map, scenario) else { return };
    let mut map = clearance_map(&grid.cells);
    let planar_band_m = if grid.cells.size()[2] == 1 { 0.0 } else { -1.0 };
    let config = AstarConfig {
        clearance_m: 0.0,
        comfort_weight: 0.0,
        budget: usize::MAX,
        planar_band_m,
        vertical_margin_m: 1e6,
        ..AstarConfig::default()
    };
    let (potential, mut search) = (Potential::default(), Astar::default());
    for problem in problems.iter().step_by(stride) {
        let (start, goal) = (centre(problem.start), centre(problem.goal));
        let request = Request { start, goal, potential: &potential, discs: &[], within: Region::EVERYWHERE };
        assert_published(plan(&mut map, &request, &config, &mut search).unwrap().cost, problem);
    }
}

fn cells([nx, ny, nz]: [usize; 3]) -> impl Iterator<Item = VoxelIndex> {
    (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| VoxelIndex { x, y, z })))
}

fn clearance_map(grid: &OccupancyGrid) -> ClearanceMap {
    let size_m = grid.size().map(|cells| cells as f64);
    let config = VoxelMapConfig {
        resolution_m: 1.0,
        size_m,
        max_range_m: 1.0,
        vertical_extent_m: 0.0,
        ground_m: -1.0,
        ..VoxelMapConfig::default()
    };
    let mut map = ClearanceMap::new(config, Vector3::from(size_m) / 2.0, 1.0).unwrap();
    for cell in cells(grid.size()).filter(|cell| grid.is_blocked(*cell)) {
        map.insert(&centre(cell));
    }
    map
}

fn centre(cell: VoxelIndex) -> Vector3<f64> {
    Vector3::new(cell.x as f64 + 0.5, cell.y as f64 + 0.5, cell.z as f64 + 0.5)
}

#[test]
fn lengths_on_a_vehicles_map_are_the_published_ones() {
    check_clearance_map("grid2d/arena.map", "grid2d/arena.map.scen", 7);
    check_clearance_map("grid2d/maze-32-32-2.map", "grid2d/maze-32-32-2-random-1.scen", 29);
    check_clearance_map("voxel3d/Simple.3dmap", "voxel3d/Simple.3dmap.3dscen", 400);
}
