//! The peer: ORCA as the crate `dodgy_3d` has it, with the settings of RVO2's `Sphere` example.

use std::borrow::Cow;

use dodgy_3d::{Agent, AvoidanceOptions, Vec3};
use nalgebra::Vector3;

use super::grid::Grid;
use super::{Avoidance, HULL_M, SPEED_M_S, STEP_S, Vehicle};

/// Neighbours within this distance are avoided, metres.
const NEIGHBOUR_M: f64 = 15.0;
/// So many of them, the nearest.
const MOST_NEIGHBOURS: usize = 10;
/// Collisions are avoided this far ahead, seconds.
const HORIZON_S: f32 = 10.0;

/// The crate's avoidance, agent by agent: its own `Simulator` passes over those who are near (0.5.2) and finds
/// neighbours by comparing all pairs, so they are found here as for ours.
pub(super) struct Dodgy;

impl Avoidance for Dodgy {
    fn velocities(&self, vehicles: &[Vehicle]) -> Vec<Vector3<f64>> {
        let positions: Vec<_> = vehicles.iter().map(|vehicle| vehicle.position).collect();
        let grid = Grid::new(&positions, NEIGHBOUR_M);
        let agents: Vec<Agent> = vehicles.iter().map(agent).collect();
        let options = AvoidanceOptions { time_horizon: HORIZON_S };
        let mut near: Vec<(f64, usize)> = Vec::new();
        let velocities = vehicles.iter().zip(&agents).enumerate().map(|(at, (vehicle, agent))| {
            near.clear();
            let others = grid.within(&vehicle.position, NEIGHBOUR_M).filter(|other| *other != at);
            near.extend(others.filter_map(|other| {
                Some(((positions.get(other)? - vehicle.position).norm_squared(), other))
            }));
            if near.len() > MOST_NEIGHBOURS {
                near.select_nth_unstable_by(MOST_NEIGHBOURS, |a, b| a.0.total_cmp(&b.0));
                near.truncate(MOST_NEIGHBOURS);
            }
            near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            let neighbours: Vec<_> =
                near.iter().filter_map(|(_, other)| agents.get(*other)).map(Cow::Borrowed).collect();
            let velocity = agent.compute_avoiding_velocity(
                &neighbours,
                single(&vehicle.preferred()),
                SPEED_M_S as f32,
                STEP_S as f32,
                &options,
            );
            Vector3::new(velocity.x, velocity.y, velocity.z).cast()
        });
        velocities.collect()
    }
}

fn agent(vehicle: &Vehicle) -> Agent {
    Agent {
        position: single(&vehicle.position),
        velocity: single(&vehicle.velocity),
        radius: HULL_M as f32,
        avoidance_responsibility: 1.0,
    }
}

/// In the crate's single precision.
fn single(vector: &Vector3<f64>) -> Vec3 {
    Vec3::new(vector.x as f32, vector.y as f32, vector.z as f32)
}
