//! Rooms with obstacles: forests, and mazes between two halls.

use std::collections::BTreeSet;
use std::sync::Arc;

use nalgebra::{Vector2, Vector3};
use rand::seq::{IndexedRandom as _, SliceRandom as _};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use skein_swarm::traffic::{Lattice, Roads};

/// Radius of a vehicle, m.
const RADIUS_M: f64 = 0.15;
/// Distance of a vehicle's hull from obstacles, m.
const MARGIN_M: f64 = 0.07;
/// Cells, m.
const CELL_M: f64 = 0.5;
/// Height of a level flight, m.
const HEIGHT_M: f64 = 1.0;
const VEHICLES: usize = 10;

/// Middle of a square pillar of half a metre, as high as the room, m.
type Pillar = Vector2<f64>;

/// A start and a goal, m.
pub type Trip = (Vector3<f64>, Vector3<f64>);

/// Where vehicles fly, and from where to where.
#[derive(Debug, Clone)]
pub struct Place {
    pub roads: Arc<Roads>,
    pub trips: Vec<Trip>,
}

impl Place {
    /// A maze of corridors of one cell between two halls; half of the vehicles fly through it one way, half the
    /// other, each from and to any cell of the halls.
    pub fn maze(seed: u64) -> Self {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let open = carve(rng);
        let walls =
            (0..9_i16).flat_map(|x| (0..9_i16).map(move |y| (x, y))).filter(|cell| !open.contains(cell));
        let pillars = walls.map(|(x, y)| Vector2::new(f64::from(x), f64::from(y)) * CELL_M).collect();
        let roads = roads([Vector2::new(-2.0, -0.3), Vector2::new(6.0, 4.3)], pillars);
        let mut hall = |west: f64| {
            let cells = (0..3).flat_map(|x| (0..9).map(move |y| (x, y)));
            let mut cells: Vec<_> = cells
                .map(|(x, y)| Vector3::new(west + 0.5 * f64::from(x), 0.5 * f64::from(y), HEIGHT_M))
                .collect();
            cells.shuffle(rng);
            cells
        };
        // Starts and goals, on both sides.
        let (west, east) = (hall(-1.5), hall(4.5));
        let half = VEHICLES / 2;
        let eastward = west.iter().zip(&east).take(half);
        let westward = east.iter().zip(&west).skip(half).take(half);
        let mut trips: Vec<Trip> = eastward.chain(westward).map(|(start, goal)| (*start, *goal)).collect();
        trips.shuffle(rng);
        Self { roads, trips }
    }

    /// Forty pillars at random in ten by ten metres; starts and goals anywhere between them.
    pub fn forest(seed: u64) -> Self {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let pillars = (0..40).map(|_| Vector2::from_fn(|_, _| rng.random_range(-4.75..4.75))).collect();
        let roads = roads([Vector2::repeat(-5.0), Vector2::repeat(5.0)], pillars);
        let cells =
            |x: i16| (-9..=9).map(move |y| Vector3::new(0.5 * f64::from(x), 0.5 * f64::from(y), HEIGHT_M));
        let state = |point: &Vector3<f64>| roads.lattice().nearest(point).unwrap();
        // What is connected with the most of the forest.
        let mut cells: Vec<_> = (-9..=9).flat_map(cells).filter(|cell| roads.is_open(&state(cell))).collect();
        let is_central = |middle: &Vector3<f64>| {
            let distances = roads.distances(state(middle));
            let reached = cells.iter().filter(|cell| distances.steps_from(&roads, &state(cell)).is_some());
            (2 * reached.count() > cells.len()).then_some(distances)
        };
        let distances = cells.iter().find_map(is_central).unwrap();
        cells.retain(|cell| distances.steps_from(&roads, &state(cell)).is_some());
        let starts: Vec<_> = cells.sample(rng, VEHICLES).copied().collect();
        let goals: Vec<_> = cells.sample(rng, VEHICLES).copied().collect();
        Self { roads, trips: starts.into_iter().zip(goals).collect() }
    }
}

/// The open cells of a maze of nine by nine: a tree that grows at random from the entrance in the west, and a few
/// cells more.
fn carve(rng: &mut ChaCha8Rng) -> BTreeSet<(i16, i16)> {
    let beside = |(x, y): (i16, i16)| [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)];
    let is_inside = |(x, y): (i16, i16)| (1..8).contains(&x) && (1..8).contains(&y);
    loop {
        let (entrance, exit) = ((0, rng.random_range(1..8)), (8, rng.random_range(1..8)));
        let mut open = BTreeSet::from([entrance]);
        let mut growing = vec![(1, entrance.1)];
        while !growing.is_empty() {
            let newest = rng.random_bool(0.7);
            let index = if newest { growing.len() - 1 } else { rng.random_range(0..growing.len()) };
            let cell = growing.swap_remove(index);
            let neighbours = beside(cell).into_iter().filter(|cell| open.contains(cell)).count();
            if !is_inside(cell) || open.contains(&cell) || (neighbours > 1 && !rng.random_bool(0.03)) {
                continue;
            }
            open.insert(cell);
            let mut next = beside(cell);
            next.shuffle(rng);
            growing.extend(next);
        }
        open.insert(exit);
        if open.contains(&(exit.0 - 1, exit.1)) {
            return open;
        }
    }
}

fn roads(bounds: [Vector2<f64>; 2], pillars: Vec<Pillar>) -> Arc<Roads> {
    let [least, greatest] = bounds;
    let inside = Vector2::repeat(RADIUS_M);
    let through = Vector3::new(0.0, 0.0, HEIGHT_M);
    let lattice =
        Lattice::new((least + inside).push(HEIGHT_M), (greatest - inside).push(HEIGHT_M), through, CELL_M);
    let clearance = move |point: &Vector3<f64>| {
        let to_pillar = |pillar: &Pillar| {
            (point.xy() - pillar).abs().add_scalar(-CELL_M / 2.0).map(|d| d.max(0.0)).norm()
        };
        pillars.iter().map(to_pillar).fold(f64::INFINITY, f64::min)
    };
    Arc::new(Roads::new(lattice, clearance, RADIUS_M + MARGIN_M))
}
