//! A world's obstacles as recordings and the console show them.

use std::time::Duration;

use skein_wire::{Form, Solid};
use skein_world::{Obstacle, Scene, Shape};

/// A scene of which something moves is shown this often.
pub const MOVING_PERIOD: Duration = Duration::from_millis(200);

/// The obstacles of `scene`; planes without end are left out.
pub fn view(scene: &Scene) -> skein_wire::Scene {
    let solid = |obstacle: &Obstacle| {
        let form = match obstacle.shape {
            Shape::Box { half_extents } => Form::Box(2.0 * half_extents),
            Shape::Cylinder { radius, half_height } => Form::Cylinder { radius, height: 2.0 * half_height },
            Shape::Sphere { radius } => Form::Sphere { radius },
            Shape::Plane { .. } => return None,
        };
        Some(Solid { form, pose: obstacle.pose })
    };
    let bounds = scene.bounds();
    // The bounds reach below the ground, which is at 0, so that one who lands stays inside.
    let mut min = bounds.min;
    min.z = min.z.max(0.0);
    skein_wire::Scene { min, max: bounds.max, solids: scene.obstacles().iter().filter_map(solid).collect() }
}
