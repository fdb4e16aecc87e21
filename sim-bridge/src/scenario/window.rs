//! `window`: two groups meet at the one opening in a wall that reaches from bound to bound.

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use skein_world::{Aabb, Obstacle};

use super::field::positive;
use super::layout::{self, Layout, Route, SPACING_M};

/// Parameters of the `[window]` table.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Window {
    /// Width of the opening from south to north, in metres.
    #[serde(deserialize_with = "positive")]
    pub opening_width_m: f64,
    #[serde(deserialize_with = "positive")]
    pub opening_height_m: f64,
    /// Height of the opening's centre, which is the nominal flight height too, in metres.
    #[serde(deserialize_with = "positive")]
    pub centre_height_m: f64,
    #[serde(deserialize_with = "positive")]
    pub wall_thickness_m: f64,
    /// From the wall to the nearest start, in metres.
    #[serde(deserialize_with = "positive")]
    pub distance_m: f64,
}

impl Default for Window {
    fn default() -> Self {
        Self {
            opening_width_m: 2.0,
            opening_height_m: 2.0,
            centre_height_m: 3.0,
            wall_thickness_m: 0.4,
            distance_m: 9.0,
        }
    }
}

/// Side by side distance of vehicles in a group, in metres: [`SPACING_M`] and room for [`JITTER_M`].
const PITCH_M: f64 = SPACING_M + 2.0 * JITTER_M;
/// Distance that a start or goal strays from its place in the row, in metres.
const JITTER_M: f64 = 0.5;
/// Goals stand this far behind the starts, so that who has arrived is in nobody's way, in metres.
const GOALS_BEHIND_M: f64 = 4.0;
/// From the outermost goal to the world's bounds, in metres.
const MARGIN_M: f64 = 5.0;
/// Length of the wall beyond the bounds, in metres.
const OVERLAP_M: f64 = 1.0;

impl Window {
    /// The wall stands on the y axis, the opening over the origin; half of the vehicles start on either side.
    pub fn generate(&self, vehicles: usize, rng: &mut ChaCha8Rng) -> Layout {
        let west = vehicles.div_ceil(2);
        let reach_x = self.wall_thickness_m / 2.0 + self.distance_m + GOALS_BEHIND_M + MARGIN_M;
        let reach_y = west as f64 / 2.0 * PITCH_M + self.opening_width_m + MARGIN_M;
        let ceiling = self.centre_height_m + self.opening_height_m / 2.0 + 4.0;
        let mut routes = self.group(west, -1.0, rng);
        routes.extend(self.group(vehicles - west, 1.0, rng));
        let bounds = Aabb {
            min: Vector3::new(-reach_x, -reach_y, -1.0),
            max: Vector3::new(reach_x, reach_y, ceiling),
        };
        Layout { obstacles: self.wall(&bounds), bounds, routes, notes: Vec::new() }
    }

    /// A row of vehicles on one side (-1 west, 1 east) with shuffled goals on the other.
    fn group(&self, count: usize, side: f64, rng: &mut ChaCha8Rng) -> Vec<Route> {
        let order = layout::permutation(rng, count);
        let near = self.wall_thickness_m / 2.0 + self.distance_m;
        let mut place = |x: f64, i: usize, z: f64| {
            let jitter = layout::uniform(rng, -JITTER_M, JITTER_M);
            Vector3::new(x, (i as f64 - (count as f64 - 1.0) / 2.0) * PITCH_M + jitter, z)
        };
        let ends: Vec<_> = order
            .iter()
            .enumerate()
            .map(|(i, &goal)| (place(side * near, i, 0.0), place(-side * (near + GOALS_BEHIND_M), goal, 0.0)))
            .collect();
        ends.into_iter()
            .map(|(start, ground)| Route {
                start,
                goal: ground + Vector3::z() * layout::spread_height(rng, self.centre_height_m),
            })
            .collect()
    }

    /// Four boxes round the opening, reaching beyond the bounds and into the ground.
    fn wall(&self, bounds: &Aabb) -> Vec<Obstacle> {
        let (half_width, half_height) = (self.opening_width_m / 2.0, self.opening_height_m / 2.0);
        let (sill, lintel) = (self.centre_height_m - half_height, self.centre_height_m + half_height);
        let (south, north) = (bounds.min.y - OVERLAP_M, bounds.max.y + OVERLAP_M);
        let (bottom, top) = (bounds.min.z - OVERLAP_M, bounds.max.z + OVERLAP_M);
        let slab = |name: &str, y: (f64, f64), z: (f64, f64)| {
            let centre = Vector3::new(0.0, (y.0 + y.1) / 2.0, (z.0 + z.1) / 2.0);
            let size = Vector3::new(self.wall_thickness_m, y.1 - y.0, z.1 - z.0);
            Obstacle::block(name, centre, size)
        };
        let mut wall = vec![
            slab("wall south of the window", (south, -half_width), (bottom, top)),
            slab("wall north of the window", (half_width, north), (bottom, top)),
            slab("wall over the window", (-half_width, half_width), (lintel, top)),
        ];
        if sill > bottom {
            wall.push(slab("wall under the window", (-half_width, half_width), (bottom, sill)));
        }
        wall
    }
}
