//! `[coverage]`: the vehicles see all of an area between them, in lines there and back.

use nalgebra::Vector3;
use serde::Deserialize;
use skein_swarm::coverage::{CoverageError, cover};

use super::field::{ground_points, positive};

/// The `[coverage]` table.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coverage {
    /// Corners of the area in order, on the ground (ENU, metres).
    #[serde(deserialize_with = "ground_points")]
    area_m: Vec<Vector3<f64>>,
    /// Width of the strip that a vehicle sees, in metres.
    #[serde(deserialize_with = "positive")]
    swath_m: f64,
    /// Height of the lines above the ground, in metres.
    #[serde(deserialize_with = "positive")]
    height_m: f64,
}

impl Coverage {
    /// A route for each vehicle (ENU, metres).
    pub fn routes(&self, vehicles: usize) -> Result<Vec<Vec<Vector3<f64>>>, CoverageError> {
        let corners: Vec<_> = self.area_m.iter().map(|corner| corner.xy()).collect();
        let lift = |route: Vec<nalgebra::Vector2<f64>>| {
            route.iter().map(|point| Vector3::new(point.x, point.y, self.height_m)).collect()
        };
        Ok(cover(&corners, self.swath_m, vehicles)?.into_iter().map(lift).collect())
    }
}
