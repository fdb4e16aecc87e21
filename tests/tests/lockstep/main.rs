//! Whole swarms in lockstep.

#![allow(clippy::unwrap_used, clippy::panic)] // A test fails by panicking.

mod autopilot_words;
mod cross_node_behaviours;
mod dark_obstacles;
mod determinism;
mod explain;
mod faults;
mod gazebo_worlds;
mod handed_back;
mod indoor;
mod landing;
mod limits;
mod lost_inside;
mod moving;
mod narrow_alone;
mod no_lidar;
mod planning;
mod positions;
mod preflight;
mod rehearsal;
mod routes;
mod scenarios;
mod scripts;
mod solids_of_many_kinds;
mod tasks;
mod thin_solids;
mod wind;
mod zones;
