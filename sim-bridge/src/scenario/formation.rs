//! `[formation]`: the vehicles fly as one, each at its place beside the first.

use nalgebra::Vector3;
use serde::Deserialize;
use skein_swarm::formation::{Formation as Places, Shape};

use super::field::{points, positive};

/// The `[formation]` table.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Formation {
    shape: ShapeName,
    /// Distance between neighbours, in metres.
    #[serde(deserialize_with = "positive")]
    spacing_m: f64,
    /// The way of the first vehicle, from above the place where it stands (ENU, metres).
    #[serde(deserialize_with = "points")]
    leader_m: Vec<Vector3<f64>>,
}

/// A shape as a file calls it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ShapeName {
    Column,
    Line,
    Wedge,
}

impl Formation {
    /// A route for each vehicle (ENU, metres), the leader's first.
    pub fn routes(&self, vehicles: usize) -> Vec<Vec<Vector3<f64>>> {
        let shape = match self.shape {
            ShapeName::Column => Shape::Column,
            ShapeName::Line => Shape::Line,
            ShapeName::Wedge => Shape::Wedge,
        };
        Places { shape, spacing_m: self.spacing_m }.routes(&self.leader_m, vehicles)
    }
}
