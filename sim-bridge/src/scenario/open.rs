//! `open`: an empty field; half of the vehicles fly east, half north, and their ways cross.

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use skein_world::Aabb;

use super::field::positive;
use super::layout::{self, Layout, Route, SPACING_M};

/// Parameters of the `[open]` table.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Open {
    /// From start line to goal line, in metres; grows where the vehicles need it.
    #[serde(deserialize_with = "positive")]
    pub length_m: f64,
    /// Nominal flight height, in metres.
    #[serde(deserialize_with = "positive")]
    pub height_m: f64,
    /// Least distance between two starts, and between two goals, of one group, in metres.
    #[serde(deserialize_with = "positive")]
    pub spacing_m: f64,
}

impl Default for Open {
    fn default() -> Self {
        Self { length_m: 24.0, height_m: 3.0, spacing_m: SPACING_M }
    }
}

/// Distance that a start or goal strays from its place in the row, in metres.
const JITTER_M: f64 = 0.5;
/// From the outermost start or goal to the world's bounds, in metres.
const MARGIN_M: f64 = 10.0;

impl Open {
    /// A square field about the origin. One group starts in the west, the other in the south.
    pub fn generate(&self, vehicles: usize, rng: &mut ChaCha8Rng) -> Layout {
        let eastward = vehicles.div_ceil(2);
        // The rows must not reach into one another's start lines at the corners.
        let half = self.length_m.max((eastward as f64 + 2.0) * self.pitch_m()) / 2.0;
        let mut routes = self.group(eastward, half, rng);
        let turned = self.group(vehicles - eastward, half, rng);
        let swap = |v: Vector3<f64>| Vector3::new(v.y, v.x, v.z);
        routes.extend(turned.into_iter().map(|r| Route { start: swap(r.start), goal: swap(r.goal) }));
        let reach = half + MARGIN_M;
        Layout {
            obstacles: Vec::new(),
            bounds: Aabb {
                min: Vector3::new(-reach, -reach, -1.0),
                max: Vector3::new(reach, reach, self.height_m + 7.0),
            },
            routes,
            notes: Vec::new(),
        }
    }

    /// Side by side distance within a group, in metres: the least, and room for [`JITTER_M`].
    fn pitch_m(&self) -> f64 {
        self.spacing_m + 2.0 * JITTER_M
    }

    /// A row of vehicles that fly east from `-half` to `half`, their goals shuffled.
    fn group(&self, count: usize, half: f64, rng: &mut ChaCha8Rng) -> Vec<Route> {
        let order = layout::permutation(rng, count);
        let mut routes = Vec::with_capacity(count);
        for (i, &goal) in order.iter().enumerate() {
            let mut y = |row: usize| {
                let jitter = layout::uniform(rng, -JITTER_M, JITTER_M);
                (row as f64 - (count as f64 - 1.0) / 2.0) * self.pitch_m() + jitter
            };
            let (from, to) = (y(i), y(goal));
            let height = layout::spread_height(rng, self.height_m);
            routes
                .push(Route { start: Vector3::new(-half, from, 0.0), goal: Vector3::new(half, to, height) });
        }
        routes
    }
}
