//! Meshes: rays and distances a second on one of 100,000 triangles, and a flight through the forest beside
//! it.

use std::f64::consts::FRAC_PI_2;
use std::hint::black_box;

use clap::Args;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde_json::json;
use skein_sim::cli::{Controller, Exit};
use skein_sim::fly::Trial;
use skein_sim::scenario::Scenario;
use skein_world::mesh::Faces;
use skein_world::{Mesh, Obstacle, Shape};

use crate::cpu_time;
use crate::task::Task;

/// Corners along each side of the square that becomes the mesh: 223 x 223 cells of two triangles are 99,458.
const CORNERS: u32 = 224;
/// Length of that square, metres.
const SIDE_M: f64 = 60.0;

#[derive(Args)]
pub struct Meshes {
    /// Rays, and places whose distance is asked for.
    #[arg(long, value_name = "N", default_value_t = 200_000)]
    queries: usize,
    /// Vehicles in the forest.
    #[arg(long, value_name = "N", default_value_t = 3)]
    vehicles: usize,
    /// The seed of rays and forest.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
}

impl Task for Meshes {
    const NAME: &'static str = "mesh";
    const ABOUT: &'static str = "Rays and distances a second on a mesh of 100,000 triangles; \
                                 the forest's real-time factor without and with it";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let (faces, mesh) = hills()?;
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut part = |reach: f64| (rng.next_u32() as f64 / f64::from(u32::MAX) - 0.5) * 2.0 * reach;
        let places: Vec<_> =
            (0..self.queries).map(|_| Point3::new(part(25.0), part(25.0), 6.0 + part(3.0))).collect();
        let directions: Vec<_> =
            (0..self.queries).map(|_| Vector3::new(part(1.0), part(1.0), part(0.3)).normalize()).collect();
        let rays = per_second(self.queries, || {
            for (place, direction) in places.iter().zip(&directions) {
                black_box(mesh.cast_ray(place, direction));
            }
        })?;
        let distances = per_second(self.queries, || {
            for place in &places {
                black_box(mesh.signed_distance(place));
            }
        })?;
        let scenario = Scenario::built_in("forest", Some(self.vehicles), self.seed)?;
        let bare = real_time_factor(&scenario)?;
        let mut beside = scenario;
        // Upright, a wall along the forest, which the level scanners see.
        let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
        let place = Translation3::new(0.0, beside.scene.bounds().max.y + HIGHEST_M, 0.0);
        let hills = Obstacle::new("hills", Shape::Mesh(mesh), Isometry3::from_parts(place, upright));
        beside.scene = beside.scene.with_more([hills]);
        let with_mesh = real_time_factor(&beside)?;
        if as_json {
            println!(
                "{}",
                json!({
                    "triangles": faces, "rays_per_s": rays, "distances_per_s": distances,
                    "forest_realtime_factor": bare, "forest_with_mesh_realtime_factor": with_mesh,
                })
            );
        } else {
            println!("{faces} triangles: {rays:.0} rays/s, {distances:.0} distances/s");
            println!("forest: {bare:.1} x real time without the mesh, {with_mesh:.1} x with it");
        }
        Ok(Exit::Done)
    }
}

/// Heights of the hills at most, metres.
const HIGHEST_M: f64 = 2.0;

/// Hills over a square about the origin, and how many triangles they have.
fn hills() -> anyhow::Result<(usize, Mesh)> {
    let place = |number: u32| (f64::from(number) / f64::from(CORNERS - 1) - 0.5) * SIDE_M;
    let corner = |row: u32, column: u32| {
        let (x, y) = (place(column), place(row));
        [x, y, HIGHEST_M * ((0.7 * x).sin() * (0.9 * y).cos())]
    };
    let corners = (0..CORNERS).flat_map(|row| (0..CORNERS).map(move |column| corner(row, column))).collect();
    let cell = |row: u32, column: u32| {
        let first = row * CORNERS + column;
        [[first, first + 1, first + CORNERS], [first + 1, first + CORNERS + 1, first + CORNERS]]
    };
    let cells = (0..CORNERS - 1).flat_map(|row| (0..CORNERS - 1).map(move |column| cell(row, column)));
    let triangles: Vec<_> = cells.flatten().collect();
    Ok((triangles.len(), Mesh::hollow(Faces { corners, triangles })?))
}

fn per_second(queries: usize, ask: impl FnOnce()) -> anyhow::Result<f64> {
    let ((), took_ms) = cpu_time::measured_ms(ask)?;
    Ok(queries as f64 / took_ms * 1000.0)
}

/// Simulated seconds for each second of this thread's processor.
fn real_time_factor(scenario: &Scenario) -> anyhow::Result<f64> {
    let (flown, took_ms) =
        cpu_time::measured_ms(|| Trial::new(scenario, Controller::Bp).fly(&mut |_, _| {}))?;
    Ok(flown?.summary.sim_time_s / took_ms * 1000.0)
}
