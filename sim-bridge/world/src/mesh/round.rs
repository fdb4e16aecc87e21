//! Ellipsoids and cones, by flat faces that contain them and stand out by less than a hundredth of their size.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use super::{Faces, Mesh, MeshError};

/// Corners around the axis.
const ROUND: u32 = 48;
/// Rings of corners between the poles of an ellipsoid.
const RINGS: u32 = 23;

impl Mesh {
    /// An ellipsoid about the origin.
    pub fn ellipsoid(radii: &Vector3<f64>) -> Result<Self, MeshError> {
        // The middle of a face is nearer to the centre than its corners: by half a step around and half a step up.
        let outwards = 1.0 / ((PI / f64::from(ROUND)).cos() * (PI / f64::from(2 * (RINGS + 1))).cos());
        let mut corners = vec![[0.0, 0.0, -1.0]];
        for ring in 1..=RINGS {
            let (z, radius) = (PI * (f64::from(ring) / f64::from(RINGS + 1) - 0.5)).sin_cos();
            corners.extend(circle(radius, z));
        }
        corners.push([0.0, 0.0, 1.0]);
        let top = corners.len() as u32 - 1;
        let at = |ring: u32, around: u32| 1 + ring * ROUND + around % ROUND;
        let mut triangles = Vec::new();
        for around in 0..ROUND {
            triangles.push([0, at(0, around + 1), at(0, around)]);
            triangles.push([top, at(RINGS - 1, around), at(RINGS - 1, around + 1)]);
            for ring in 0..RINGS - 1 {
                let (a, b) = (at(ring, around), at(ring, around + 1));
                let (c, d) = (at(ring + 1, around + 1), at(ring + 1, around));
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        Self::filled(Faces { corners, triangles }.scaled(&(radii * outwards)))
    }

    /// A cone about z, half of its length above the origin, its point up.
    pub fn cone(radius: f64, length: f64) -> Result<Self, MeshError> {
        let outer = radius / (PI / f64::from(ROUND)).cos();
        let mut corners = vec![[0.0, 0.0, -0.5 * length], [0.0, 0.0, 0.5 * length]];
        corners.extend(circle(outer, -0.5 * length));
        let faces = (0..ROUND).flat_map(|around| {
            let (a, b) = (2 + around, 2 + (around + 1) % ROUND);
            [[0, b, a], [1, a, b]]
        });
        let triangles = faces.collect();
        Self::filled(Faces { corners, triangles })
    }
}

/// Corners around z, counter-clockwise.
fn circle(radius: f64, z: f64) -> impl Iterator<Item = [f64; 3]> {
    (0..ROUND).map(move |around| {
        let (sin, cos) = (TAU * f64::from(around) / f64::from(ROUND)).sin_cos();
        [radius * cos, radius * sin, z]
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn all_of_an_ellipsoid_is_inside_and_little_else(
            longitude in 0.0..TAU,
            sine in -1.0..1.0_f64,
            (a, b, c) in (0.2..5.0, 0.2..5.0, 0.2..5.0),
        ) {
            let radii = Vector3::new(a, b, c);
            let mesh = Mesh::ellipsoid(&radii).expect("an ellipsoid");
            let round = (1.0 - sine * sine).sqrt();
            let surface = Vector3::new(round * longitude.cos(), round * longitude.sin(), sine).component_mul(&radii);
            prop_assert!(mesh.signed_distance(&Point3::from(surface)) <= 1e-9);
            prop_assert!(mesh.signed_distance(&Point3::from(surface * 1.012)) > 0.0);
        }

        #[test]
        fn all_of_a_cone_is_inside_and_little_else(
            around in 0.0..TAU,
            share in 0.0..0.99_f64,
            (radius, length) in (0.2..5.0, 0.2..5.0),
        ) {
            let mesh = Mesh::cone(radius, length).expect("a cone");
            let (out, z) = ((1.0 - share) * radius, length * (share - 0.5));
            let surface = |factor: f64| Point3::new(factor * out * around.cos(), factor * out * around.sin(), z);
            prop_assert!(mesh.signed_distance(&surface(1.0)) <= 1e-9);
            prop_assert!(mesh.signed_distance(&surface(1.01)) > 0.0);
        }
    }
}
