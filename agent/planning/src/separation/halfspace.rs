//! The velocity nearest to a wanted one within half-spaces and a speed limit: a small quadratic programme,
//! solved exactly.
//!
//! Incremental, as linear programmes of low dimension are (Seidel 1991; used for velocities by van den Berg
//! 2011): half-spaces are taken in one by one; while the best point satisfies the next one it stays, else the
//! best point lies on that one's border, which is the same problem with one dimension less. The order is the
//! caller's, so the answer is deterministic.

use nalgebra::{SVector, Vector2, Vector3};

/// Violations smaller than this are rounding, m/s.
const TOLERANCE: f64 = 1e-9;
/// Normals this close to parallel have no common border, and a shorter one has no direction.
const PARALLEL: f64 = 1e-9;

/// All `v` with `normal . v <= bound`; `normal` is a unit vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct HalfSpace<const D: usize> {
    pub(crate) normal: SVector<f64, D>,
    pub(crate) bound: f64,
}

impl<const D: usize> HalfSpace<D> {
    /// By how much `v` lies outside; negative inside.
    pub(crate) fn excess(&self, v: &SVector<f64, D>) -> f64 {
        self.normal.dot(v) - self.bound
    }
}

/// The point nearest to `target` in all `spaces` and within `radius` of the origin; `None` if there is none.
pub(crate) fn nearest_2d(target: Vector2<f64>, radius: f64, spaces: &[HalfSpace<2>]) -> Option<Vector2<f64>> {
    let mut best = clamped(target, radius);
    for (taken, space) in spaces.iter().enumerate() {
        if space.excess(&best) > TOLERANCE {
            best = nearest_on_line(target, radius, space, &spaces[..taken])?;
        }
    }
    Some(best)
}

pub(crate) fn nearest_3d(target: Vector3<f64>, radius: f64, spaces: &[HalfSpace<3>]) -> Option<Vector3<f64>> {
    let mut best = clamped(target, radius);
    for (taken, space) in spaces.iter().enumerate() {
        if space.excess(&best) > TOLERANCE {
            best = nearest_on_plane(target, radius, space, &spaces[..taken])?;
        }
    }
    Some(best)
}

/// On the border of `space`, within the half-spaces taken in before it.
fn nearest_on_line(
    target: Vector2<f64>,
    radius: f64,
    space: &HalfSpace<2>,
    before: &[HalfSpace<2>],
) -> Option<Vector2<f64>> {
    let foot = space.normal * space.bound;
    let along = Vector2::new(-space.normal.y, space.normal.x);
    let half_chord = chord(radius, space.bound)?;
    let (mut low, mut high) = (-half_chord, half_chord);
    for other in before {
        let slope = other.normal.dot(&along);
        let room = -other.excess(&foot);
        if slope.abs() < PARALLEL {
            if room < -TOLERANCE {
                return None;
            }
        } else if slope > 0.0 {
            high = high.min(room / slope);
        } else {
            low = low.max(room / slope);
        }
    }
    if low > high + TOLERANCE {
        return None;
    }
    let wanted = target.dot(&along);
    Some(foot + along * wanted.min(high).max(low.min(high)))
}

/// On the border of `space`, within the half-spaces taken in before it: a problem in the plane.
fn nearest_on_plane(
    target: Vector3<f64>,
    radius: f64,
    space: &HalfSpace<3>,
    before: &[HalfSpace<3>],
) -> Option<Vector3<f64>> {
    let foot = space.normal * space.bound;
    let disc = chord(radius, space.bound)?;
    let (e1, e2) = plane_basis(&space.normal);
    let mut lines = Vec::with_capacity(before.len());
    for other in before {
        let slope = Vector2::new(other.normal.dot(&e1), other.normal.dot(&e2));
        let room = -other.excess(&foot);
        let steepness = slope.norm();
        if steepness < PARALLEL {
            if room < -TOLERANCE {
                return None;
            }
        } else {
            lines.push(HalfSpace { normal: slope / steepness, bound: room / steepness });
        }
    }
    let in_plane = nearest_2d(Vector2::new(target.dot(&e1), target.dot(&e2)), disc, &lines)?;
    Some(foot + e1 * in_plane.x + e2 * in_plane.y)
}

/// Half the width of the ball of `radius` where it is cut at `distance` from its centre.
fn chord(radius: f64, distance: f64) -> Option<f64> {
    let squared = radius * radius - distance * distance;
    (squared >= -TOLERANCE).then(|| squared.max(0.0).sqrt())
}

/// Two unit vectors square to `normal` and to one another.
fn plane_basis(normal: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    // The axis that the normal points along least is furthest from parallel to it.
    let axis = if normal.x.abs() <= normal.y.abs() && normal.x.abs() <= normal.z.abs() {
        Vector3::x()
    } else if normal.y.abs() <= normal.z.abs() {
        Vector3::y()
    } else {
        Vector3::z()
    };
    let e1 = normal.cross(&axis).normalize();
    (e1, normal.cross(&e1))
}

fn clamped<const D: usize>(point: SVector<f64, D>, radius: f64) -> SVector<f64, D> {
    let length = point.norm();
    if length > radius { point * (radius / length) } else { point }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn space2(angle: f64, bound: f64) -> HalfSpace<2> {
        HalfSpace { normal: Vector2::new(angle.cos(), angle.sin()), bound }
    }

    fn space3(direction: [f64; 3], bound: f64) -> HalfSpace<3> {
        HalfSpace { normal: Vector3::from(direction).normalize(), bound }
    }

    #[test]
    fn a_free_target_is_kept_and_a_fast_one_is_slowed() {
        assert_eq!(nearest_2d(Vector2::new(0.3, 0.4), 1.0, &[]), Some(Vector2::new(0.3, 0.4)));
        let slowed = nearest_2d(Vector2::new(3.0, 4.0), 1.0, &[]).unwrap();
        assert!((slowed - Vector2::new(0.6, 0.8)).norm() < 1e-12);
    }

    #[test]
    fn a_corner_of_two_half_spaces_is_found() {
        let spaces = [space3([1.0, 0.0, 0.0], 0.5), space3([0.0, 1.0, 0.0], -0.25)];
        let found = nearest_3d(Vector3::new(1.0, 1.0, 0.25), 2.0, &spaces).unwrap();
        assert!((found - Vector3::new(0.5, -0.25, 0.25)).norm() < 1e-12);
    }

    #[test]
    fn contradictions_have_no_answer() {
        let spaces = [space2(0.0, -0.1), space2(std::f64::consts::PI, -0.1)];
        assert_eq!(nearest_2d(Vector2::zeros(), 1.0, &spaces), None);
        assert_eq!(nearest_2d(Vector2::zeros(), 1.0, &[space2(1.0, -2.0)]), None);
    }

    proptest! {
        // The bounds are non-negative, as they are while distances are kept, so the origin is always
        // feasible.
        #[test]
        fn no_sampled_velocity_in_the_plane_is_better(
            target in prop::array::uniform2(-4.0..4.0_f64),
            spaces in prop::collection::vec((0.0..std::f64::consts::TAU, 0.0..2.0_f64), 0..12),
        ) {
            let target = Vector2::from(target);
            let spaces: Vec<_> = spaces.into_iter().map(|(angle, bound)| space2(angle, bound)).collect();
            let found = nearest_2d(target, 2.5, &spaces);
            prop_assert!(found.is_some());
            let found = found.unwrap();
            prop_assert!(found.norm() <= 2.5 + 1e-9);
            prop_assert!(spaces.iter().all(|space| space.excess(&found) <= 1e-7));
            for i in 0..200 {
                for j in 0..25 {
                    let angle = f64::from(i) * std::f64::consts::TAU / 200.0;
                    let v = Vector2::new(angle.cos(), angle.sin()) * (f64::from(j) * 0.1);
                    if spaces.iter().all(|space| space.excess(&v) <= 0.0) {
                        prop_assert!((v - target).norm() >= (found - target).norm() - 1e-7);
                    }
                }
            }
        }

        #[test]
        fn the_answer_in_space_satisfies_the_optimality_conditions(
            target in prop::array::uniform3(-4.0..4.0_f64),
            spaces in prop::collection::vec((prop::array::uniform3(-1.0..1.0_f64), 0.0..2.0_f64), 0..14),
            probes in prop::collection::vec(prop::array::uniform3(-2.5..2.5_f64), 200),
        ) {
            let target = Vector3::from(target);
            let spaces: Vec<_> = spaces.into_iter()
                .filter(|(direction, _)| Vector3::from(*direction).norm() > 0.1)
                .map(|(direction, bound)| space3(direction, bound)).collect();
            let found = nearest_3d(target, 2.5, &spaces);
            prop_assert!(found.is_some());
            let found = found.unwrap();
            prop_assert!(found.norm() <= 2.5 + 1e-9);
            prop_assert!(spaces.iter().all(|space| space.excess(&found) <= 1e-7));
            // Of a convex set, the nearest point is the one from which no feasible point lies towards the
            // target.
            for probe in probes.into_iter().map(Vector3::from) {
                // Shrinking towards the feasible origin makes any probe feasible.
                let share = spaces.iter().map(|space| {
                    let along = space.normal.dot(&probe);
                    if along > space.bound { space.bound / along } else { 1.0 }
                }).fold(1.0_f64.min(2.5 / probe.norm()), f64::min);
                let feasible = probe * share;
                prop_assert!((feasible - found).dot(&(target - found)) <= 1e-6);
            }
        }

        #[test]
        fn the_order_of_half_spaces_does_not_matter(
            target in prop::array::uniform2(-4.0..4.0_f64),
            spaces in prop::collection::vec((0.0..std::f64::consts::TAU, 0.0..2.0_f64), 0..12),
        ) {
            let spaces: Vec<_> = spaces.into_iter().map(|(angle, bound)| space2(angle, bound)).collect();
            let backwards: Vec<_> = spaces.iter().rev().copied().collect();
            let one = nearest_2d(Vector2::from(target), 2.5, &spaces).unwrap();
            let other = nearest_2d(Vector2::from(target), 2.5, &backwards).unwrap();
            prop_assert!((one - other).norm() < 1e-6);
        }
    }
}
