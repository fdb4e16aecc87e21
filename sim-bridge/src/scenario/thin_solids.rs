//! Thin solids: what a planar lidar may fly over without seeing it.

use std::fmt;

use nalgebra::Vector3;
use skein_world::{Obstacle, VehicleModel};

use super::Scenario;

/// What is less high than this is seen by a planar lidar in its own plane alone, in metres; it pitches by
/// more at ten metres already.
const THIN_M: f64 = 0.2;
/// From the heights of flight to what is near them, in metres.
const NEAR_M: f64 = 1.0;
/// From a straight way to what is on it, in metres.
const ON_THE_WAY_M: f64 = 0.75;
/// From one place on a way to the next that is looked at, in metres.
const STEP_M: f64 = 0.2;
/// What reaches down so near to the ground is ground, in metres.
const GROUND_M: f64 = 0.1;
/// So many solids are named.
const NAMED: usize = 8;

/// Solids that a planar lidar does not see, near where it flies.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "a planar lidar does not see what is thinner than 0.2 m in height: {}; fly vehicles of the model \"x500-vertical-scanner\", move the flight away, or fly all the same with --thin-solids",
    Named(.0)
)]
pub struct ThinSolids(Vec<ThinSolid>);

/// The first of them, by name.
struct Named<'a>(&'a [ThinSolid]);

#[derive(Debug, Clone, PartialEq)]
struct ThinSolid {
    name: String,
    thickness_m: f64,
    /// From its lowest to its highest point.
    heights_m: [f64; 2],
}

impl fmt::Display for Named<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, solid) in self.0.iter().take(NAMED).enumerate() {
            let ThinSolid { name, thickness_m, heights_m: [low_m, high_m] } = solid;
            let comma = if number == 0 { "" } else { ", " };
            write!(
                f,
                "{comma}`{name}` ({thickness_m:.3} m, from {low_m:.2} to {high_m:.2} m above the ground)"
            )?;
        }
        match self.0.len().saturating_sub(NAMED) {
            0 => Ok(()),
            more => write!(f, " and {more} more"),
        }
    }
}

impl Scenario {
    /// Checks that there is nothing near the heights of flight that the vehicles' lidars do not see.
    ///
    /// # Errors
    /// What is thinner than 0.2 m in height, within a metre of the heights at which
    /// vehicles with a planar lidar alone fly.
    pub fn check_thin_solids(&self) -> Result<(), ThinSolids> {
        let heights: Vec<f64> = self.blind_ways().flatten().map(|place| place.z).collect();
        let low_m = heights.iter().copied().fold(f64::INFINITY, f64::min) - NEAR_M;
        let high_m = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max) + NEAR_M;
        self.refuse_thin(|_, [lowest_m, highest_m]| lowest_m <= high_m && highest_m >= low_m)
    }

    /// The same of what is within 0.75 m of the straight ways between the waypoints.
    ///
    /// # Errors
    /// As for [`Scenario::check_thin_solids`].
    pub fn check_thin_solids_on_the_way(&self) -> Result<(), ThinSolids> {
        let ways: Vec<Vec<Vector3<f64>>> = self.blind_ways().collect();
        let places: Vec<Vector3<f64>> = ways.iter().flat_map(|way| way.windows(2)).flat_map(along).collect();
        self.refuse_thin(|solid, _| {
            places.iter().any(|place| solid.signed_distance(&(*place).into()) < ON_THE_WAY_M)
        })
    }

    /// The ways of the vehicles that have a planar lidar alone, from above where they stand.
    fn blind_ways(&self) -> impl Iterator<Item = Vec<Vector3<f64>>> + '_ {
        let is_planar = |model: &VehicleModel| model.lidar.is_some_and(|lidar| lidar.upright_rays == 0);
        let planar = self.vehicles.iter().filter(move |vehicle| is_planar(&vehicle.model));
        planar.map(|vehicle| {
            let above = vehicle.start + Vector3::z() * self.takeoff_height_m;
            std::iter::once(above).chain(vehicle.waypoints.iter().copied()).collect()
        })
    }

    fn refuse_thin(&self, is_near: impl Fn(&Obstacle, [f64; 2]) -> bool) -> Result<(), ThinSolids> {
        let thin = self.scene.obstacles().iter().filter_map(|solid| {
            let found = thin_solid(solid)?;
            (found.heights_m[0] > GROUND_M && is_near(solid, found.heights_m)).then_some(found)
        });
        let thin: Vec<_> = thin.collect();
        if thin.is_empty() { Ok(()) } else { Err(ThinSolids(thin)) }
    }
}

/// Places on a leg, no further apart than a vehicle is wide.
fn along(leg: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let steps = ((leg[1] - leg[0]).norm() / STEP_M).ceil().max(1.0);
    (0..=steps as u32).map(|step| leg[0].lerp(&leg[1], f64::from(step) / steps)).collect()
}

fn thin_solid(obstacle: &Obstacle) -> Option<ThinSolid> {
    let (thickness_m, bounds) = (obstacle.thickness_m(), obstacle.aabb()?);
    let heights_m = [bounds.min.z, bounds.max.z];
    (thickness_m < THIN_M).then(|| ThinSolid { name: obstacle.name.clone(), thickness_m, heights_m })
}
