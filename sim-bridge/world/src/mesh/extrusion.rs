//! Outlines pulled up: a ground plan that has a height.

use earcut::Earcut;

use super::{Faces, Mesh, MeshError};

/// Outlines of more corners are refused.
pub const MOST_CORNERS: usize = 10_000;

impl Mesh {
    /// The solid between z = 0 and `height` over an outline, whose corners go round in either direction.
    pub fn extrusion(outline: &[[f64; 2]], height: f64) -> Result<Self, MeshError> {
        if outline.len() > MOST_CORNERS {
            return Err(MeshError::Outline);
        }
        let mut outline = outline.to_vec();
        outline.dedup();
        if outline.len() > 1 && outline.first() == outline.last() {
            outline.pop();
        }
        if area(&outline) < 0.0 {
            outline.reverse();
        }
        let mut caps: Vec<u32> = Vec::new();
        Earcut::new().earcut(outline.iter().copied(), &[], &mut caps);
        if caps.is_empty() || area(&outline) == 0.0 {
            return Err(MeshError::Outline);
        }
        Self::filled(walls_and_caps(&outline, height, &caps))
    }
}

/// Twice the area, positive of an outline that goes round counter-clockwise.
fn area(outline: &[[f64; 2]]) -> f64 {
    let next = outline.iter().cycle().skip(1);
    outline.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum()
}

/// The faces, all of which point outwards.
fn walls_and_caps(outline: &[[f64; 2]], height: f64, caps: &[u32]) -> Faces {
    let at = |z: f64| outline.iter().map(move |[x, y]| [*x, *y, z]);
    let corners: Vec<[f64; 3]> = at(0.0).chain(at(height)).collect();
    let count = outline.len() as u32;
    let walls = (0..count).flat_map(|a| {
        let b = (a + 1) % count;
        [[a, b, b + count], [a, b + count, a + count]]
    });
    let caps = caps.chunks_exact(3).flat_map(|face| {
        let [a, b, c] = counter_clockwise(outline, [face[0], face[1], face[2]]);
        [[a + count, b + count, c + count], [c, b, a]]
    });
    Faces { triangles: walls.chain(caps).collect(), corners }
}

fn counter_clockwise(outline: &[[f64; 2]], [a, b, c]: [u32; 3]) -> [u32; 3] {
    let corner = |number: u32| outline.get(number as usize).copied().unwrap_or_default();
    if area(&[corner(a), corner(b), corner(c)]) < 0.0 { [c, b, a] } else { [a, b, c] }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};

    use super::*;

    /// An L, 4 m each way and 2 m wide, whichever way round.
    fn corner(reversed: bool) -> Mesh {
        let mut outline =
            vec![[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 2.0], [2.0, 4.0], [0.0, 4.0], [0.0, 0.0]];
        if reversed {
            outline.reverse();
        }
        Mesh::extrusion(&outline, 3.0).expect("a sound outline")
    }

    #[test]
    fn the_notch_of_an_outline_is_free() {
        for mesh in [corner(false), corner(true)] {
            for ((x, y, z), distance_m) in [
                ((1.0, 1.0, 1.5), -1.0),
                ((3.0, 3.0, 1.5), 1.0),
                ((1.0, 1.0, 4.0), 1.0),
                ((3.0, 1.0, 2.5), -0.5),
            ] {
                let found = mesh.signed_distance(&Point3::new(x, y, z));
                assert!((found - distance_m).abs() < 1e-9, "({x}, {y}, {z}): {found}");
            }
            let met = mesh.cast_ray(&Point3::new(9.0, 3.0, 1.0), &-Vector3::x());
            assert!(met.is_some_and(|range| (range - 7.0).abs() < 1e-9), "{met:?}");
            assert_eq!(mesh.cast_ray(&Point3::new(1.0, 1.0, 1.0), &Vector3::x()), Some(0.0));
        }
    }

    #[test]
    fn a_line_is_no_outline() {
        assert_eq!(Mesh::extrusion(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]], 1.0), Err(MeshError::Outline));
        assert_eq!(Mesh::extrusion(&[], 1.0), Err(MeshError::Outline));
    }
}
