//! `antipodal`: vehicles on a circle swap places with those opposite, all through one middle.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use skein_world::Aabb;

use super::field::positive;
use super::layout::{self, Layout, Route, SPACING_M};

/// Parameters of the `[antipodal]` table.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Antipodal {
    /// Radius of the circle, in metres; grows where the vehicles would stand closer than 3 m.
    #[serde(deserialize_with = "positive")]
    pub radius_m: f64,
    /// Nominal flight height, in metres.
    #[serde(deserialize_with = "positive")]
    pub height_m: f64,
}

impl Default for Antipodal {
    fn default() -> Self {
        Self { radius_m: 8.0, height_m: 3.0 }
    }
}

/// From the circle to the world's bounds, in metres.
const MARGIN_M: f64 = 8.0;

impl Antipodal {
    /// A circle about the origin, turned by a random angle.
    pub fn generate(&self, vehicles: usize, rng: &mut ChaCha8Rng) -> Layout {
        let needed = layout::circle_radius(vehicles, SPACING_M);
        let radius = self.radius_m.max(needed);
        let mut notes = Vec::new();
        if radius > self.radius_m {
            notes.push(format!(
                "antipodal: {vehicles} vehicles {SPACING_M} m apart need a circle of {radius:.1} m instead of {} m",
                self.radius_m
            ));
        }
        let turn = layout::uniform(rng, 0.0, TAU);
        let mut route = |i: usize| {
            let start = layout::on_circle(radius, turn + TAU * i as f64 / vehicles as f64);
            let height = layout::spread_height(rng, self.height_m);
            Route { start, goal: -start + Vector3::z() * height }
        };
        let routes = (0..vehicles).map(&mut route).collect();
        let reach = radius + MARGIN_M;
        Layout {
            obstacles: Vec::new(),
            bounds: Aabb {
                min: Vector3::new(-reach, -reach, -1.0),
                max: Vector3::new(reach, reach, self.height_m + 7.0),
            },
            routes,
            notes,
        }
    }
}
