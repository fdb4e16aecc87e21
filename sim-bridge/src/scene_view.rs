//! A world's obstacles as recordings and the console show them.

use std::time::Duration;

use nalgebra::Translation3;
use skein_wire::{Form, Solid};
use skein_world::{Aabb, Obstacle, Scene, Shape};

/// A scene of which something moves is shown this often.
pub const MOVING_PERIOD: Duration = Duration::from_millis(200);

/// A cone is shown as a pile of so many cylinders.
const CONE_STEPS: f64 = 8.0;

/// The obstacles of `scene`; planes without end are left out, and of meshes their blocks are shown.
pub fn view(scene: &Scene) -> skein_wire::Scene {
    let bounds = scene.bounds();
    // The bounds reach below the ground, which is at 0, so that one who lands stays inside.
    let mut min = bounds.min;
    min.z = min.z.max(0.0);
    skein_wire::Scene { min, max: bounds.max, solids: scene.obstacles().iter().flat_map(solids).collect() }
}

/// The forms that show an obstacle.
fn solids(obstacle: &Obstacle) -> Vec<Solid> {
    let at = |z: f64, form: Form| Solid { form, pose: obstacle.pose * Translation3::new(0.0, 0.0, z) };
    match obstacle.shape {
        Shape::Box { half_extents } => vec![at(0.0, Form::Box(2.0 * half_extents))],
        Shape::Cylinder { radius, half_height } => {
            vec![at(0.0, Form::Cylinder { radius, height: 2.0 * half_height })]
        }
        Shape::Sphere { radius } => vec![at(0.0, Form::Sphere { radius })],
        Shape::Capsule { radius, half_length } => vec![
            at(0.0, Form::Cylinder { radius, height: 2.0 * half_length }),
            at(half_length, Form::Sphere { radius }),
            at(-half_length, Form::Sphere { radius }),
        ],
        Shape::Ellipsoid { radii } => vec![at(0.0, Form::Box(2.0 * radii))],
        Shape::Cone { radius, half_height } => {
            let height = 2.0 * half_height / CONE_STEPS;
            let step = |step: f64| {
                let radius = radius * (1.0 - step / CONE_STEPS);
                at((step + 0.5) * height - half_height, Form::Cylinder { radius, height })
            };
            (0..CONE_STEPS as u32).map(|number| step(f64::from(number))).collect()
        }
        Shape::Mesh(ref mesh) => {
            let block = |block: &Aabb| {
                let middle = Translation3::from((block.min + block.max) / 2.0);
                Solid { form: Form::Box(block.max - block.min), pose: obstacle.pose * middle }
            };
            mesh.blocks().iter().map(block).collect()
        }
        Shape::Plane { .. } => Vec::new(),
    }
}
