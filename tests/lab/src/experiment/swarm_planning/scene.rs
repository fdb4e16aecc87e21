//! The world of P3.

use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use skein_planning::airspace::{Airspace, Mountain, ThreatZone};
use skein_swarm::assignment::assign;
use skein_swarm::route::arrival_slots;

/// The targets, metres.
pub const TARGETS: [[f64; 3]; 10] = [
    [2000.0, 200.0, 300.0],
    [2000.0, 400.0, 600.0],
    [2000.0, 500.0, 500.0],
    [2000.0, 650.0, 380.0],
    [2000.0, 800.0, 430.0],
    [2000.0, 1000.0, 580.0],
    [2000.0, 1350.0, 680.0],
    [2000.0, 1500.0, 300.0],
    [2000.0, 1800.0, 650.0],
    [2000.0, 2000.0, 580.0],
];
/// The place of each mountain, and its height, metres.
const MOUNTAINS: [[f64; 3]; 2] = [[500.0, 1500.0, 400.0], [500.0, 500.0, 200.0]];
/// The place of each threat zone, and its radius, metres.
const THREATS: [[f64; 3]; 4] =
    [[1000.0, 1000.0, 400.0], [500.0, 500.0, 200.0], [500.0, 1200.0, 200.0], [1500.0, 500.0, 200.0]];
/// Chosen: `sx` and `sy` of the mountains, metres.
const SLOPE_M: f64 = 200.0;
/// Chosen: height at which vehicles set out, and how much higher some do, metres.
const START_M: (f64, f64) = (100.0, 40.0);
/// Chosen: how far apart vehicles arrive at one target, metres.
pub const SPACING_M: f64 = 60.0;

/// P3's airspace, 2000 x 2000 x 1000 m.
pub fn airspace() -> Airspace {
    let mountain = |[x, y, height_m]: [f64; 3]| Mountain {
        centre: Vector2::new(x, y),
        height_m,
        slope_m: Vector2::repeat(SLOPE_M),
    };
    let threat = |[x, y, radius_m]: [f64; 3]| ThreatZone { centre: Vector2::new(x, y), radius_m };
    Airspace {
        lower: Vector3::zeros(),
        upper: Vector3::new(2000.0, 2000.0, 1000.0),
        mountains: MOUNTAINS.map(mountain).to_vec(),
        threats: THREATS.map(threat).to_vec(),
        ..Airspace::default()
    }
}

/// Start and goal of each vehicle. They set out along the western edge, each from a place of its own that is drawn
/// from the seed, and arrive at slots around the targets, so assigned that the straight ways are shortest together.
pub fn ends(airspace: &Airspace, vehicles: usize, seed: u64) -> Option<Vec<(Vector3<f64>, Vector3<f64>)>> {
    let starts = starts(airspace, vehicles, seed);

    let at_each = vehicles.div_ceil(TARGETS.len());
    let slots: Vec<_> = TARGETS
        .iter()
        .flat_map(|target| {
            let target = Vector3::from(*target);
            let west = Vector3::new(airspace.lower.x, target.y, target.z);
            arrival_slots(&target, &west, at_each, SPACING_M, airspace)
        })
        .collect();
    let distances: Vec<Vec<f64>> =
        starts.iter().map(|start| slots.iter().map(|slot| (slot - start).norm()).collect()).collect();
    let taken = assign(&distances)?;
    Some(starts.into_iter().zip(taken).map(|(start, slot)| (start, slots[slot])).collect())
}

/// Where vehicles set out: along the western edge, each at a place of its own that is drawn from the seed.
pub fn starts(airspace: &Airspace, vehicles: usize, seed: u64) -> Vec<Vector3<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let lane_m = (airspace.upper.y - airspace.lower.y) / vehicles as f64;
    let start = |k: usize| {
        let (aside, higher): (f64, f64) = (rng.random(), rng.random());
        let y = airspace.lower.y + (k as f64 + 0.25 + 0.5 * aside) * lane_m;
        Vector3::new(airspace.lower.x, y, START_M.0 + higher * START_M.1)
    };
    (0..vehicles).map(start).collect()
}
