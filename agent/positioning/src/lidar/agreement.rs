//! Two vehicles agree on one frame: from where they started, and by seeing one another.
//!
//! Each flies in a frame of its own map, and both drift. What one sees of the other ties the frames. The errors of
//! poses last, so that sightings are not independent: they are fused by covariance intersection (Julier 1997), which
//! stays honest whatever they share.

use nalgebra::{Isometry2, Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};

use super::pose_graph::composed;

/// A sighting further off than this many standard deviations is of somebody else.
const GATE: f64 = 4.0;
/// Shares of what was known that a fusion is tried with.
const SHARES: u32 = 20;

/// A sighting of another vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// Where the one that sees was, in its own frame.
    pub own: Isometry2<f64>,
    /// Of `own`: m² and rad².
    pub own_covariance: Matrix3<f64>,
    /// Where it saw the other: to its nose and to its left, m.
    pub seen: Vector2<f64>,
    /// Of `seen`, m².
    pub seen_covariance: Matrix2<f64>,
    /// Where the other said it was, in its own frame, m.
    pub other: Vector2<f64>,
    /// Of `other`, m².
    pub other_covariance: Matrix2<f64>,
}

/// The pose of another vehicle's frame in one's own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    transform: Isometry2<f64>,
    covariance: Matrix3<f64>,
}

impl Agreement {
    /// As it is known from where both started: the other's frame in one's own, and its covariance (m², rad²).
    pub fn new(transform: Isometry2<f64>, covariance: Matrix3<f64>) -> Self {
        Self { transform, covariance }
    }

    /// The other's frame in one's own.
    pub fn transform(&self) -> &Isometry2<f64> {
        &self.transform
    }

    /// Of the transform: one's own axes, m² and rad².
    pub fn covariance(&self) -> &Matrix3<f64> {
        &self.covariance
    }

    /// Time passes, and both drift by as much as this, m² and rad².
    pub fn drift(&mut self, by: &Matrix3<f64>) {
        self.covariance += by;
    }

    /// A pose of the other with its covariance, in one's own frame.
    pub fn own(&self, pose: &Isometry2<f64>, covariance: &Matrix3<f64>) -> (Isometry2<f64>, Matrix3<f64>) {
        (self.transform * pose, composed(&self.transform, &self.covariance, pose, covariance))
    }

    /// Takes in a sighting; `false` when it does not fit, and is left out.
    pub fn observe(&mut self, sighting: &Sighting) -> bool {
        let (error, by_frame, noise) = self.expected(sighting);
        let gate = noise + by_frame * self.covariance * by_frame.transpose();
        let (Some(gate), Some(weight), Some(known)) =
            (gate.try_inverse(), noise.try_inverse(), self.covariance.try_inverse())
        else {
            return false;
        };
        let off = (error.transpose() * gate * error).x;
        if off.is_nan() || off > GATE * GATE {
            return false;
        }
        let told = by_frame.transpose() * weight * by_frame;
        let fused = |share: u32| {
            let share = f64::from(share) / f64::from(SHARES);
            let covariance = (known * share + told * (1.0 - share)).try_inverse()?;
            Some((covariance, 1.0 - share))
        };
        let size = |one: &(Matrix3<f64>, f64)| one.0.determinant();
        let fused = (1..=SHARES).filter_map(fused).min_by(|one, other| size(one).total_cmp(&size(other)));
        let Some((covariance, share)) = fused else { return false };
        let step: Vector3<f64> = covariance * by_frame.transpose() * weight * error * share;
        self.transform.translation.vector += step.xy();
        self.transform.rotation *= nalgebra::UnitComplex::new(step.z);
        self.covariance = (covariance + covariance.transpose()) / 2.0;
        true
    }

    /// By how much what was seen lies off what is expected; how that follows the frame; its noise.
    fn expected(&self, sighting: &Sighting) -> (Vector2<f64>, Matrix2x3<f64>, Matrix2<f64>) {
        let arm = self.transform.rotation * sighting.other;
        let ray = sighting.own.rotation * sighting.seen;
        let error = sighting.own.translation.vector + ray - arm - self.transform.translation.vector;
        let turned_by = |arm: &Vector2<f64>| Matrix2x3::new(1.0, 0.0, -arm.y, 0.0, 1.0, arm.x);
        let turn = self.transform.rotation.to_rotation_matrix();
        let look = sighting.own.rotation.to_rotation_matrix();
        let noise = turned_by(&ray) * sighting.own_covariance * turned_by(&ray).transpose()
            + look * sighting.seen_covariance * look.transpose()
            + turn * sighting.other_covariance * turn.transpose();
        (error, turned_by(&arm), noise)
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::lidar::synthetic::normal;

    /// Two vehicles fly circles about one another and see each other with 5 cm of noise.
    fn flown(seed: u64, sightings: u32) -> (Agreement, Isometry2<f64>, usize) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut off = |sigma: f64| sigma * normal(&mut random);
        let truth = Isometry2::new(Vector2::new(off(0.4), off(0.4)), off(0.08));
        let start = Matrix3::from_diagonal(&Vector3::new(0.16, 0.16, 0.0064));
        let mut agreement = Agreement::new(Isometry2::identity(), start);
        let sure = Matrix3::from_diagonal(&Vector3::new(1e-4, 1e-4, 1e-6));
        // What lasts in both poses.
        let [own_off, other_off] = [Vector2::new(off(0.01), off(0.01)), Vector2::new(off(0.01), off(0.01))];
        let mut taken = 0;
        for at in 0..sightings {
            let turn = f64::from(at) * 0.3;
            let own = Isometry2::new(Vector2::new(3.0 * turn.cos(), 3.0 * turn.sin()), turn);
            let other = Vector2::new(-5.0 * turn.cos() + 2.0, 5.0 * turn.sin());
            let place = (truth * nalgebra::Point2::from(other)).coords;
            let seen = own.rotation.inverse() * (place - own.translation.vector);
            taken += usize::from(agreement.observe(&Sighting {
                own: Isometry2::from_parts((own.translation.vector + own_off).into(), own.rotation),
                own_covariance: sure,
                seen: seen + Vector2::new(off(0.05), off(0.05)),
                seen_covariance: Matrix2::identity() * 0.0025,
                other: other + other_off,
                other_covariance: Matrix2::identity() * 1e-4,
            }));
        }
        (agreement, truth, taken)
    }

    #[test]
    fn sightings_tie_two_frames_honestly() {
        let mut beyond = 0;
        for seed in 0..100 {
            let (agreement, truth, taken) = flown(seed, 40);
            assert!(taken >= 38, "{taken}");
            let off = agreement.transform().translation.vector - truth.translation.vector;
            let turned = truth.rotation.rotation_to(&agreement.transform().rotation).angle();
            assert!(off.norm() < 0.1 && turned.abs() < 0.03, "{off} {turned}");
            let sigma = agreement.covariance().diagonal().map(f64::sqrt);
            beyond += usize::from(off.push(turned).component_div(&sigma).abs().max() > 3.0);
            assert!(sigma.x < 0.1 && sigma.z < 0.03, "{sigma}");
        }
        assert!(beyond <= 1, "{beyond}");
    }

    #[test]
    fn whoever_is_elsewhere_is_somebody_else() {
        let (mut agreement, _, _) = flown(1, 40);
        let before = agreement;
        let sighting = Sighting {
            own: Isometry2::identity(),
            own_covariance: Matrix3::identity() * 1e-4,
            seen: Vector2::new(4.0, 4.0),
            seen_covariance: Matrix2::identity() * 0.0025,
            other: Vector2::new(1.0, 1.0),
            other_covariance: Matrix2::identity() * 1e-4,
        };
        assert!(!agreement.observe(&sighting));
        assert!(!agreement.observe(&Sighting { seen: Vector2::repeat(f64::NAN), ..sighting }));
        assert_eq!(agreement, before);
    }
}
