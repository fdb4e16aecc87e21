//! The surroundings of a vehicle, as a set-point is made from them.

use nalgebra::Vector3;
use skein_planning::{
    map::{ClearanceMap, FreeRays},
    separation,
};

/// The vehicle's surroundings now.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings<'a> {
    pub map: &'a ClearanceMap,
    /// Whether the vehicle has a lidar: then it flies no faster than it sees the way free.
    pub sees: bool,
    /// The sight of the newest scan, further than the map reaches.
    pub rays: &'a FreeRays,
    /// Obstacle points of the newest scan, metres ENU: more exact than the map.
    pub obstacles: &'a [Vector3<f64>],
    /// The other vehicles in the air.
    pub neighbours: &'a [separation::Neighbour],
    /// Those of them that go before this vehicle where there is room for one, once it has entered there.
    pub first: &'a [separation::Neighbour],
    /// The number of them, and of those on the ground, whose names come before this vehicle's.
    pub rank: u32,
}
