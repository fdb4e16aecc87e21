//! A* finds the optimal lengths published with real maps (Sturtevant 2012; Brewer and Sturtevant 2018).

#![expect(clippy::unwrap_used, reason = "a test that cannot be set up fails")]

use std::fs;
use std::path::PathBuf;

use nalgebra::Vector3;
use skein_planning::global::Potential;
use skein_planning::global::astar::{AstarConfig, AstarScratch, Request, plan};
use skein_planning::map::{ClearanceMap, VoxelMapConfig};

/// A file of the shared data, or `None`, said aloud, where the data is absent.
fn shared(file: &str) -> Option<String> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")).join(file);
    let text = fs::read_to_string(path).ok();
    if text.is_none() {
        println!("skipped: needs ../shared/data/{file}");
    }
    text
}

fn map(size: [usize; 3], blocked: impl Iterator<Item = [usize; 3]>) -> ClearanceMap {
    let size_m = size.map(|cells| cells as f64);
    let config = VoxelMapConfig {
        resolution_m: 1.0,
        size_m,
        max_range_m: 1.0,
        vertical_extent_m: 0.0,
        ground_m: -1.0,
    };
    let mut map = ClearanceMap::new(config, Vector3::from(size_m) / 2.0, 1.0).unwrap();
    for cell in blocked {
        map.insert(&centre(cell));
    }
    map
}

fn centre(cell: [usize; 3]) -> Vector3<f64> {
    Vector3::from(cell.map(|c| c as f64 + 0.5))
}

/// Checks every `stride`-th of the problems: start, goal, optimal length.
fn check(map: &mut ClearanceMap, problems: &[([usize; 3], [usize; 3], f64)], stride: usize) {
    let config = AstarConfig {
        clearance_m: 0.0,
        comfort_weight: 0.0,
        budget: usize::MAX,
        vertical_margin_m: 1e6,
        ..AstarConfig::default()
    };
    let space = problems.iter().any(|(from, to, _)| from[2] != to[2]);
    let config = AstarConfig { planar_band_m: if space { -1.0 } else { 0.0 }, ..config };
    let (potential, mut scratch) = (Potential::default(), AstarScratch::default());
    for (from, to, optimal) in problems.iter().step_by(stride) {
        let request = Request { start: centre(*from), goal: centre(*to), potential: &potential, discs: &[] };
        let found = plan(map, &request, &config, &mut scratch).unwrap();
        assert!(
            (found.cost - optimal).abs() < 1e-3,
            "{from:?} to {to:?}: {} instead of {optimal}",
            found.cost
        );
    }
}

#[test]
fn lengths_on_plane_maps_are_the_published_ones() {
    for (name, scenario, stride) in [
        ("arena.map", "arena.map.scen", 7),
        ("maze-32-32-2.map", "maze-32-32-2-random-1.scen", 29),
        ("random-32-32-20.map", "random-32-32-20-random-1.scen", 29),
    ] {
        let (Some(text), Some(scenario)) =
            (shared(&format!("grid2d/{name}")), shared(&format!("grid2d/{scenario}")))
        else {
            return;
        };
        let rows: Vec<_> = text.lines().skip_while(|line| *line != "map").skip(1).collect();
        let blocked = rows.iter().enumerate().flat_map(|(y, row)| {
            row.bytes()
                .enumerate()
                .filter(|(_, cell)| !matches!(cell, b'.' | b'G'))
                .map(move |(x, _)| [x, y, 0])
        });
        let mut map = map([rows[0].len(), rows.len(), 1], blocked);
        let problems: Vec<_> = scenario
            .lines()
            .skip(1)
            .map(|line| {
                let fields: Vec<&str> = line.split_whitespace().collect();
                let [sx, sy, gx, gy] = [4, 5, 6, 7].map(|field| fields[field].parse().unwrap());
                ([sx, sy, 0], [gx, gy, 0], fields[8].parse().unwrap())
            })
            .collect();
        check(&mut map, &problems, stride);
    }
}

#[test]
fn lengths_in_space_are_the_published_ones() {
    let (Some(text), Some(scenario)) =
        (shared("voxel3d/Simple.3dmap"), shared("voxel3d/Simple.3dmap.3dscen"))
    else {
        return;
    };
    let numbers =
        |line: &str| -> Vec<f64> { line.split_whitespace().filter_map(|n| n.parse().ok()).collect() };
    let cell = |n: &[f64]| [n[0] as usize, n[1] as usize, n[2] as usize];
    let size = cell(&numbers(text.lines().next().unwrap()));
    let blocked = text.lines().skip(1).map(numbers).filter(|n| n.len() == 3).map(|n| cell(&n));
    let mut map = map(size, blocked);
    let problems: Vec<_> = scenario
        .lines()
        .map(numbers)
        .filter(|n| n.len() >= 7)
        .map(|n| (cell(&n[..3]), cell(&n[3..6]), n[6]))
        .collect();
    assert!(problems.len() > 10);
    check(&mut map, &problems, problems.len() / 25);
}
