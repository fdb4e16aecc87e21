//! Mountains as one can hit them.

use nalgebra::Isometry3;
use skein_planning::airspace::Mountain;
use skein_world::{Obstacle, Shape};

/// Height of the steps that a mountain is built of, in metres.
const STEP_M: f64 = 1.0;

/// Round steps inside of a mountain; `number`, from 1, is for their names.
pub fn steps(number: usize, mountain: &Mountain) -> impl Iterator<Item = Obstacle> + '_ {
    let count = (mountain.height_m / STEP_M).ceil().max(1.0);
    let rise_m = mountain.height_m / count;
    let step = move |k: usize| {
        // z = h exp(-(r / s)^2), at the step's upper edge and on the steeper axis.
        let radius = mountain.slope_m.min() * (count / (k as f64 + 1.0)).ln().sqrt();
        let middle_m = (k as f64 + 0.5) * rise_m;
        Obstacle {
            name: format!("mountain {number} step {}", k + 1),
            shape: Shape::Cylinder { radius, half_height: 0.5 * rise_m },
            pose: Isometry3::translation(mountain.centre.x, mountain.centre.y, middle_m),
            way: None,
        }
    };
    // The last would be the peak, a point.
    (0..(count as usize).saturating_sub(1)).map(step)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;
    use skein_planning::airspace::Airspace;

    use super::*;

    #[test]
    fn steps_stand_on_one_another_inside_of_the_mountain() {
        let mountain =
            Mountain { centre: Vector2::new(3.0, -4.0), height_m: 6.5, slope_m: Vector2::new(5.0, 8.0) };
        let terrain = Airspace { mountains: vec![mountain], ..Airspace::default() };
        let mut floor_m = 0.0;
        for step in steps(1, &mountain) {
            let Shape::Cylinder { radius, half_height } = step.shape else {
                panic!("{:?} is not round", step.shape)
            };
            let middle = step.pose.translation.vector;
            assert!((middle.z - half_height - floor_m).abs() < 1e-9, "{} stands on what is below", step.name);
            floor_m = middle.z + half_height;
            for edge in [middle.xy() + Vector2::x() * radius, middle.xy() + Vector2::y() * radius] {
                assert!(terrain.terrain_m(edge.x, edge.y) >= floor_m - 1e-9, "{} stands out", step.name);
            }
        }
        assert!(floor_m > 5.0, "they reach up to {floor_m} m");
    }
}
