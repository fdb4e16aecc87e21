//! `[coverage]`: the vehicles see all of an area between them, in lines there and back.

use nalgebra::Vector3;
use serde::Deserialize;
use skein_planning::airspace::Airspace;
use skein_swarm::coverage::{Area, CoverageError, cover};

use super::field::{ground_points, positive};

/// A turn from leg to leg takes this share of the time for a stop and a start, as flown: corners are cut.
const TURN_SHARE: f64 = 0.65;

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
    /// A route for each vehicle (ENU, metres), over the area and outside of the zones of `airspace`. All end
    /// at the same time if they fly at `cruise_m_s` and accelerate by no more than `accel_m_s2`.
    pub fn routes(
        &self,
        vehicles: usize,
        airspace: &Airspace,
        cruise_m_s: f64,
        accel_m_s2: f64,
    ) -> Result<Vec<Vec<Vector3<f64>>>, CoverageError> {
        let corners: Vec<_> = self.area_m.iter().map(|corner| corner.xy()).collect();
        let area = Area { corners: &corners, height_m: self.height_m, airspace };
        let lift = |route: Vec<nalgebra::Vector2<f64>>| {
            route.iter().map(|point| Vector3::new(point.x, point.y, self.height_m)).collect()
        };
        let leg_s = |leg_m: f64| leg_m / cruise_m_s + TURN_SHARE * cruise_m_s / accel_m_s2;
        Ok(cover(&area, self.swath_m, vehicles, &leg_s)?.into_iter().map(lift).collect())
    }
}
