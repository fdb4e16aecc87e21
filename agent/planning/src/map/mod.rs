//! The surroundings that a vehicle has seen: evidence in voxels, and the distance to the nearest obstacle.

mod clearance;
mod fading;
mod free_rays;
mod ray;
mod sectors;
mod voxel;

pub use clearance::{ClearanceMap, Nearest};
pub use free_rays::FreeRays;
pub use sectors::{SECTORS, Sectors};
pub use voxel::{Change, MapError, RayEnd, VoxelIndex, VoxelMap, VoxelMapConfig, VoxelState};

pub(crate) use ray::{sweep, traverse};
