//! Ellipsoids and cones: distances and rays, in their own frames.

use nalgebra::{Point3, Vector2, Vector3};

/// Halvings until a distance is exact.
const HALVINGS: usize = 100;

/// Distance from a point to an ellipsoid about the origin, negative inside. The nearest place of its surface
/// is where the normal leads to the point: with the point's part y along each axis and the radius e, at e^2 y
/// / (t + e^2), of which the sum of squares of e y / (t + e^2) is 1 (D. Eberly, Distance from a Point to an
/// Ellipse, an Ellipsoid).
pub(crate) fn distance_to_ellipsoid(radii: &Vector3<f64>, point: &Point3<f64>) -> f64 {
    let at = point.coords.abs();
    let thinnest = radii.imin();
    let squares = radii.component_mul(radii);
    let share = |t: f64| -> f64 {
        (0..3).map(|axis| (radii[axis] * at[axis] / (t + squares[axis])).powi(2)).sum::<f64>() - 1.0
    };
    let least = -squares[thinnest];
    let (mut low, mut high) =
        (least + radii[thinnest] * at[thinnest], least + radii.component_mul(&at).norm());
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if share(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let t = 0.5 * (low + high);
    let mut nearest = Vector3::from_fn(|axis, _| {
        let below = t + squares[axis];
        if at[axis] == 0.0 || below <= 0.0 { 0.0 } else { squares[axis] * at[axis] / below }
    });
    if at[thinnest] == 0.0 {
        // In the middle plane the nearest place may be off it, on the thinnest axis.
        nearest[thinnest] = 0.0;
        let rest = 1.0 - nearest.component_div(radii).norm_squared();
        nearest[thinnest] = radii[thinnest] * rest.max(0.0).sqrt();
    }
    let distance = (nearest - at).norm();
    if at.component_div(radii).norm_squared() < 1.0 { -distance } else { distance }
}

/// Distance from a point to a cone about z with its point at `half_height`, negative inside.
pub(crate) fn distance_to_cone(radius: f64, half_height: f64, point: &Point3<f64>) -> f64 {
    // In the half-plane through the axis: the rim, the tip, and the point.
    let (rim, tip) = (Vector2::new(radius, -half_height), Vector2::new(0.0, half_height));
    let at = Vector2::new(point.x.hypot(point.y), point.z);
    let to_segment = |from: Vector2<f64>, to: Vector2<f64>| {
        let along = to - from;
        let share = ((at - from).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        (at - from - along * share).norm()
    };
    let distance = to_segment(rim, tip).min(to_segment(Vector2::new(0.0, -half_height), rim));
    let side = (tip - rim).perp(&(at - rim));
    if side > 0.0 && at.y > -half_height { -distance } else { distance }
}

/// Distance along a ray to a cone about z with its point at `half_height`: 0 when it starts inside.
pub(crate) fn cast_ray_on_cone(
    radius: f64,
    half_height: f64,
    origin: &Point3<f64>,
    direction: &Vector3<f64>,
) -> Option<f64> {
    if distance_to_cone(radius, half_height, origin) <= 0.0 {
        return Some(0.0);
    }
    let slope = radius / (2.0 * half_height);
    let (depth, sinks) = (half_height - origin.z, -direction.z);
    // Where the distance from the axis is the radius at that depth below the tip: a t^2 + 2 b t + c = 0.
    let a = direction.xy().norm_squared() - (slope * sinks).powi(2);
    let b = origin.coords.xy().dot(&direction.xy()) - slope * slope * depth * sinks;
    let c = origin.coords.xy().norm_squared() - (slope * depth).powi(2);
    let mut met: Option<f64> = None;
    let mut note = |t: f64, is_met: bool| {
        if is_met && t >= 0.0 && met.is_none_or(|met| t < met) {
            met = Some(t);
        }
    };
    let side = |t: f64| (0.0..=2.0 * half_height).contains(&(depth + sinks * t));
    let discriminant = b * b - a * c;
    if a == 0.0 && b != 0.0 {
        note(-c / (2.0 * b), side(-c / (2.0 * b)));
    } else if discriminant >= 0.0 {
        for root in [discriminant.sqrt(), -discriminant.sqrt()] {
            note((root - b) / a, side((root - b) / a));
        }
    }
    if sinks != 0.0 {
        let t = (2.0 * half_height - depth) / sinks;
        let place = origin.coords + direction * t;
        note(t, place.xy().norm() <= radius);
    }
    met
}
