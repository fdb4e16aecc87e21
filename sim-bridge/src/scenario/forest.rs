//! `forest`: a swarm crosses a wood of upright trunks, and its ways cross one another.

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use skein_world::{Aabb, Obstacle};

use super::field::{non_negative, positive};
use super::layout::{self, Layout, Route, SPACING_M};

/// Parameters of the `[forest]` table.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Forest {
    /// Extent of the wood from west to east, in metres.
    #[serde(deserialize_with = "positive")]
    pub length_m: f64,
    /// Extent of the wood from south to north, in metres; grows where the vehicles need it.
    #[serde(deserialize_with = "positive")]
    pub width_m: f64,
    /// Trunks per square metre of wood.
    #[serde(deserialize_with = "non_negative")]
    pub density_per_m2: f64,
    /// Thinnest trunk's radius, in metres.
    #[serde(deserialize_with = "positive")]
    pub min_radius_m: f64,
    /// Thickest trunk's radius, in metres.
    #[serde(deserialize_with = "positive")]
    pub max_radius_m: f64,
    #[serde(deserialize_with = "positive")]
    pub tree_height_m: f64,
    /// Bark to bark between neighbouring trunks, in metres, as far as the density leaves room.
    #[serde(deserialize_with = "non_negative")]
    pub gap_m: f64,
    /// Nominal flight height, in metres.
    #[serde(deserialize_with = "positive")]
    pub height_m: f64,
}

impl Default for Forest {
    fn default() -> Self {
        Self {
            length_m: 60.0,
            width_m: 40.0,
            density_per_m2: 0.042,
            min_radius_m: 0.3,
            max_radius_m: 0.6,
            tree_height_m: 8.0,
            gap_m: 2.7,
            height_m: 3.0,
        }
    }
}

/// From the wood's edge to the nearest start or goal, in metres.
const CLEARING_M: f64 = 3.0;
/// From the outermost start or goal to the world's bounds, in metres.
const MARGIN_M: f64 = 5.0;
/// Throws for one trunk before its gap gives way.
const THROWS: usize = 2000;
/// Shuffles of the goals before the reversed order, in which all lines cross, is taken.
const SHUFFLES: usize = 64;
/// Most trunks a file may ask for.
const MAX_TREES: f64 = 2000.0;

struct Trunk {
    x: f64,
    y: f64,
    radius: f64,
}

impl Forest {
    /// Checks that the parameters fit one another; else names the field at fault and its fault.
    pub fn check(&self) -> Result<(), (&'static str, String)> {
        if self.min_radius_m > self.max_radius_m {
            return Err(("min_radius_m", format!("expected at most max_radius_m, {}", self.max_radius_m)));
        }
        if 2.0 * self.max_radius_m > self.length_m.min(self.width_m) {
            return Err(("max_radius_m", "a trunk is thicker than the wood".to_owned()));
        }
        let trees = self.trees_wanted();
        if trees > MAX_TREES {
            return Err((
                "density_per_m2",
                format!("{trees} trunks are too many: expected at most {MAX_TREES}"),
            ));
        }
        Ok(())
    }

    fn trees_wanted(&self) -> f64 {
        (self.density_per_m2 * self.length_m * self.width_m).ceil()
    }

    /// A wood whose south-west corner is the origin, starts west of it, goals east of it.
    pub fn generate(&self, vehicles: usize, rng: &mut ChaCha8Rng) -> Layout {
        let rows = self.rows(vehicles);
        let columns = vehicles.div_ceil(rows.max(1));
        let depth = CLEARING_M + columns.saturating_sub(1) as f64 * SPACING_M;
        let (trees, notes) = self.trees(rng);
        let routes = self.routes(vehicles, rows, rng);
        let ceiling = self.tree_height_m.max(self.height_m + layout::HEIGHT_SPREAD_M) + 2.0;
        Layout {
            obstacles: trees,
            bounds: Aabb {
                min: Vector3::new(-depth - MARGIN_M, -MARGIN_M, -1.0),
                max: Vector3::new(self.length_m + depth + MARGIN_M, self.width_m + MARGIN_M, ceiling),
            },
            routes,
            notes,
        }
    }

    /// The number of vehicles side by side along an edge.
    fn rows(&self, vehicles: usize) -> usize {
        let room = (self.width_m / SPACING_M) as usize;
        vehicles.min(room.max(1))
    }

    fn trees(&self, rng: &mut ChaCha8Rng) -> (Vec<Obstacle>, Vec<String>) {
        let count = self.trees_wanted() as usize;
        let mut trunks: Vec<Trunk> = Vec::with_capacity(count);
        let mut gap = self.gap_m;
        for _ in 0..count {
            trunks.push(self.plant(&trunks, &mut gap, rng));
        }
        let mut notes = Vec::new();
        if gap < self.gap_m {
            let wanted = self.gap_m;
            notes.push(format!("forest: {count} trunks leave gaps of {gap:.2} m instead of {wanted:.2} m"));
        }
        let tree = |(i, t): (usize, &Trunk)| {
            Obstacle::trunk(format!("tree {}", i + 1), t.x, t.y, t.radius, self.tree_height_m)
        };
        (trunks.iter().enumerate().map(tree).collect(), notes)
    }

    /// Throws darts until one lands `gap` from every other trunk; the gap shrinks when the wood is full.
    fn plant(&self, trunks: &[Trunk], gap: &mut f64, rng: &mut ChaCha8Rng) -> Trunk {
        let radius = layout::uniform(rng, self.min_radius_m, self.max_radius_m);
        loop {
            for _ in 0..THROWS {
                let x = layout::uniform(rng, radius, self.length_m - radius);
                let y = layout::uniform(rng, radius, self.width_m - radius);
                let clear = |t: &Trunk| {
                    let reach = t.radius + radius + *gap;
                    let (dx, dy) = (t.x - x, t.y - y);
                    dx * dx + dy * dy >= reach * reach
                };
                if trunks.iter().all(clear) || *gap <= 0.0 {
                    return Trunk { x, y, radius };
                }
            }
            *gap = if *gap > 0.1 { *gap * 0.95 } else { 0.0 };
        }
    }

    /// Starts and goals in facing grids, joined so that at least half of all pairs of lines cross.
    fn routes(&self, vehicles: usize, rows: usize, rng: &mut ChaCha8Rng) -> Vec<Route> {
        let pitch = self.width_m / rows.max(1) as f64;
        let place = |i: usize, side: f64, from: f64| {
            let (row, column) = (i % rows.max(1), i / rows.max(1));
            let x = from + side * (CLEARING_M + column as f64 * SPACING_M);
            Vector3::new(x, (row as f64 + 0.5) * pitch, 0.0)
        };
        let heights: Vec<f64> = (0..vehicles).map(|_| layout::spread_height(rng, self.height_m)).collect();
        let join = |order: &[usize]| -> Vec<Route> {
            let ends = order.iter().zip(&heights).enumerate();
            let route = |(i, (&goal, &height)): (usize, (&usize, &f64))| Route {
                start: place(i, -1.0, 0.0),
                goal: place(goal, 1.0, self.length_m) + Vector3::z() * height,
            };
            ends.map(route).collect()
        };
        let pairs = vehicles * vehicles.saturating_sub(1) / 2;
        for _ in 0..SHUFFLES {
            let mut order = layout::permutation(rng, vehicles);
            // Two ways cross in an order or in its reverse, so that one of the two has half of all crossings.
            for _ in 0..2 {
                let routes = join(&order);
                if 2 * layout::crossing_pairs(&routes) >= pairs {
                    return routes;
                }
                order.reverse();
            }
        }
        join(&(0..vehicles).rev().collect::<Vec<_>>())
    }
}
