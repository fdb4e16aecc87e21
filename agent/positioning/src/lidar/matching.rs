//! Point-to-line matching of a scan against a map.
//!
//! The residual of a return is its distance from a surface along the mean of both normals (Rusinkiewicz 2019), which is
//! zero for any two places of one arc: trunks and walls are matched alike. Weights are robust; what they leave is scaled
//! by what the residuals show.

use nalgebra::{Isometry2, Matrix3, SymmetricEigen, Vector2, Vector3};

use super::level::Return;
use super::local_map::LocalMap;

/// Greatest distance of a surface, m: in the first steps, and in the last.
const REACH_M: [f64; 2] = [0.6, 0.25];
/// Steps with the wider reach.
const WIDE_STEPS: usize = 4;
/// Steps at most.
const MOST_STEPS: usize = 16;
/// A step shorter than this is the last, m and, at the mean distance of the returns, rad.
const LEAST_STEP_M: f64 = 2e-4;
/// The Geman-McClure kernel's width in standard deviations.
const KERNEL: f64 = 3.0;
/// Median of the square of a normal number of variance 1.
const MEDIAN: f64 = 0.455;
/// Roughness of surfaces and what cells round off, m².
const ROUGHNESS_M2: f64 = 0.01 * 0.01;
/// Surfaces bend, rad²: what lies beside a return tells less of it.
const BEND_RAD2: f64 = 0.05;
/// A direction in which the returns tell less than this many times what the errors of the surfaces' directions feign is
/// not told at all.
const TELLING: f64 = 3.0;
/// A direction is told when it is told to this, m.
const WORST_SIGMA_M: f64 = 0.3;
/// Variances are larger than independent noise makes them: neighbours share their surfaces' errors.
const INFLATION: f64 = 3.0;
/// Variance along a direction that nothing tells, m².
pub const UNTOLD_M2: f64 = 1e4;
/// Fewer matched returns are no match.
const LEAST_RETURNS: usize = 12;

/// A pose at which a scan fits the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    pub pose: Isometry2<f64>,
    /// Covariance of east, north (m²) and heading (rad²) in the map; 1e4 m² along what nothing tells.
    pub covariance: Matrix3<f64>,
    /// Share of the scan's returns that lie on the map's surfaces, 0 to 1.
    pub share: f64,
    /// Unit vector in the world along which the scan tells nothing, as in a smooth corridor.
    pub degenerate: Option<Vector2<f64>>,
    /// Whether the scan tells each part of the pose, the heading too.
    pub is_whole: bool,
    /// Steps taken.
    pub steps: usize,
}

/// A return beside its surface.
struct Pair {
    /// Distance along the normal, m.
    residual: f64,
    variance: f64,
    /// Of the normal's direction, rad².
    normal_variance: f64,
    /// Derivative of the residual by east, north, heading.
    across: Vector3<f64>,
    /// The same if the normal were turned by a quarter.
    along: Vector3<f64>,
}

/// Moves the scan from `guess` to where it fits `map`; `None` where hardly anything of it does. The guess may be off by
/// 0.4 m, and by as much at the distance of the returns through its heading. Where the scan tells nothing of a direction, the pose stays as guessed there.
pub fn refine(map: &LocalMap, scan: &[Return], guess: &Isometry2<f64>) -> Option<Match> {
    let spread = scan.iter().map(|one| one.point.norm_squared()).sum::<f64>() / scan.len().max(1) as f64;
    let arm_m = spread.sqrt().max(1.0);
    let mut pose = *guess;
    let mut steps = 0;
    loop {
        let pairs = pairs(map, scan, &pose, REACH_M[usize::from(steps >= WIDE_STEPS)]);
        let normal = Normal::of(&pairs, arm_m)?;
        let step = normal.step();
        steps += 1;
        if steps >= MOST_STEPS || (steps > WIDE_STEPS && step.norm() < LEAST_STEP_M) {
            let share = normal.inliers as f64 / scan.len() as f64;
            let (covariance, degenerate) = (normal.covariance(), normal.degenerate());
            let is_whole = normal.told.iter().all(Option::is_some);
            return Some(Match { pose, covariance, share, degenerate, is_whole, steps });
        }
        pose.translation.vector += step.xy();
        pose.rotation *= nalgebra::UnitComplex::new(step.z / arm_m);
    }
}

fn pairs(map: &LocalMap, scan: &[Return], pose: &Isometry2<f64>, reach_m: f64) -> Vec<Pair> {
    let pair = |one: &Return| {
        let arm = pose.rotation * one.point;
        let facing = pose.rotation * one.normal;
        let point = arm + pose.translation.vector;
        let surface = map.nearest(&point, &facing, reach_m)?;
        let normal = (facing + surface.normal).normalize();
        let quarter = |of: &Vector2<f64>| Vector2::new(-of.y, of.x);
        let (along, off) = (quarter(&normal), point - surface.point);
        let normal_variance = (one.normal_variance + surface.normal_variance) / 4.0;
        let bend_m2 = (normal_variance + BEND_RAD2) * off.dot(&along).powi(2);
        Some(Pair {
            residual: off.dot(&normal),
            variance: one.variance + surface.variance + ROUGHNESS_M2 + bend_m2,
            normal_variance,
            across: normal.push(normal.dot(&quarter(&arm))),
            along: along.push(along.dot(&quarter(&arm))),
        })
    };
    scan.iter().filter_map(pair).collect()
}

/// The normal equations, with the heading counted in metres at the returns' mean distance.
struct Normal {
    /// Directions, by columns.
    axes: Matrix3<f64>,
    /// Information on each direction, 1/m²; `None` for one that is not told.
    told: [Option<f64>; 3],
    /// The step along each.
    steps: Vector3<f64>,
    /// By how much the residuals are larger than their variances say.
    excess: f64,
    arm_m: f64,
    inliers: usize,
}

impl Normal {
    fn of(pairs: &[Pair], arm_m: f64) -> Option<Self> {
        if pairs.len() < LEAST_RETURNS {
            return None;
        }
        let mut squares: Vec<f64> = pairs.iter().map(|pair| pair.residual.powi(2) / pair.variance).collect();
        let middle = squares.len() / 2;
        let (_, median, _) = squares.select_nth_unstable_by(middle, f64::total_cmp);
        let excess = (*median / MEDIAN).max(1.0);
        let (mut told, mut feigned) = (Matrix3::zeros(), Matrix3::zeros());
        let mut pull = Vector3::zeros();
        let mut inliers = 0;
        let scaled = |row: &Vector3<f64>| Vector3::new(row.x, row.y, row.z / arm_m);
        for pair in pairs {
            let square = pair.residual.powi(2) / (pair.variance * excess);
            let kernel = (KERNEL * KERNEL / (KERNEL * KERNEL + square)).powi(2);
            let weight = kernel / pair.variance;
            inliers += usize::from(square < KERNEL * KERNEL);
            let (across, along) = (scaled(&pair.across), scaled(&pair.along));
            told += weight * across * across.transpose();
            feigned += weight * pair.normal_variance * along * along.transpose();
            pull -= weight * pair.residual * across;
        }
        let eigen = SymmetricEigen::new(told);
        let least = excess * INFLATION / WORST_SIGMA_M.powi(2);
        let tell = |axis: usize| {
            let (value, direction) = (eigen.eigenvalues[axis], eigen.eigenvectors.column(axis));
            let feigned = (direction.transpose() * feigned * direction).x;
            (value > TELLING * feigned && value - feigned > least).then_some(value - feigned)
        };
        let told = [tell(0), tell(1), tell(2)];
        let along = eigen.eigenvectors.transpose() * pull;
        let step = |axis: usize| told[axis].map_or(0.0, |_| along[axis] / eigen.eigenvalues[axis]);
        let steps = Vector3::new(step(0), step(1), step(2));
        (steps.iter().all(|step| step.is_finite())).then_some(Self {
            axes: eigen.eigenvectors,
            told,
            steps,
            excess,
            arm_m,
            inliers,
        })
    }

    /// East and north, m, and the heading's, m at the returns' mean distance.
    fn step(&self) -> Vector3<f64> {
        self.axes * self.steps
    }

    fn covariance(&self) -> Matrix3<f64> {
        let variance = |told: Option<f64>| told.map_or(UNTOLD_M2, |told| INFLATION * self.excess / told);
        let variances = Vector3::from(self.told.map(variance));
        let covariance = self.axes * Matrix3::from_diagonal(&variances) * self.axes.transpose();
        let unscaled = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 1.0 / self.arm_m));
        let covariance = unscaled * covariance * unscaled;
        (covariance + covariance.transpose()) / 2.0
    }

    fn degenerate(&self) -> Option<Vector2<f64>> {
        let axis = self.told.iter().position(Option::is_none)?;
        self.axes.column(axis).xy().try_normalize(0.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lidar::key_frames::KeyFrame;
    use crate::lidar::level::LevelScan;
    use crate::lidar::synthetic::{World, flat};

    fn level(world: &World, pose: &Isometry2<f64>, seed: u64) -> LevelScan {
        LevelScan::new(&world.scan(pose, seed).sweep(), &flat(*pose, 1e-4), |_| false)
    }

    /// Matches scans of `world` from near places against a map of a few scans, and tells the errors (east, north,
    /// heading), each divided by its sigma, and the greatest error in m.
    fn errors(world: &World, guess_off: f64, seeds: std::ops::Range<u64>) -> (Vec<Vector3<f64>>, f64) {
        let mut map = LocalMap::new(&Vector2::zeros());
        for (place, x) in [(100, -1.5), (101, 0.0), (102, 1.5)] {
            let pose = Isometry2::new(Vector2::new(x, 0.0), 0.1);
            map.add(&pose, &level(world, &pose, place).returns);
        }
        let mut worst: f64 = 0.0;
        let error = |seed: u64| {
            let turn = seed as f64 * 2.4;
            let off = Vector2::new(turn.cos(), turn.sin());
            let pose = Isometry2::new(off * 0.8, turn);
            let guess = Isometry2::new(pose.translation.vector + off * guess_off, turn + 0.05 * guess_off);
            let found = refine(&map, &level(world, &pose, seed).returns, &guess).unwrap();
            let off = found.pose.translation.vector - pose.translation.vector;
            worst = worst.max(off.norm());
            let turned = (found.pose.rotation / pose.rotation).angle();
            let sigma = found.covariance.diagonal().map(f64::sqrt);
            off.push(turned).component_div(&sigma)
        };
        (seeds.map(error).collect(), worst)
    }

    #[test]
    fn scans_fit_walls_and_trunks_with_honest_covariance() {
        let worlds = [World::room(18.0, 11.0), World::forest(7, 40.0, 0.04)];
        for (world, name) in worlds.iter().zip(["room", "forest"]) {
            let (errors, worst) = errors(world, 0.4, 0..100);
            assert!(worst < 0.05, "{name}: {worst} m");
            let beyond = errors.iter().flatten_components().filter(|error| error.abs() > 3.0).count();
            assert!(beyond <= 3, "{name}: {beyond} of 300 beyond 3 sigma");
            let rms =
                (errors.iter().flatten_components().map(|error| error * error).sum::<f64>() / 300.0).sqrt();
            assert!(rms > 0.1, "{name}: nor is it told far too large: {rms}");
        }
    }

    /// The components of many vectors.
    trait Components<'a> {
        fn flatten_components(self) -> impl Iterator<Item = f64>;
    }

    impl<'a, I: Iterator<Item = &'a Vector3<f64>> + 'a> Components<'a> for I {
        fn flatten_components(self) -> impl Iterator<Item = f64> {
            self.flat_map(|vector| [vector.x, vector.y, vector.z])
        }
    }

    #[test]
    fn a_smooth_corridor_tells_nothing_along_itself() {
        let corridor = World::corridor(200.0, 2.4, 0.7);
        let axis = Vector2::new(0.7_f64.cos(), 0.7_f64.sin());
        let mut map = LocalMap::new(&Vector2::zeros());
        map.add(&Isometry2::identity(), &level(&corridor, &Isometry2::identity(), 1).returns);
        for seed in 2..30 {
            let pose = Isometry2::new(axis * 1.0, 0.5);
            let guess = Isometry2::new(axis * 0.6, 0.48);
            let found = refine(&map, &level(&corridor, &pose, seed).returns, &guess).unwrap();
            let degenerate = found.degenerate.unwrap();
            assert!(degenerate.dot(&axis).abs() > 0.999);
            let off = found.pose.translation.vector - guess.translation.vector;
            assert!(off.dot(&axis).abs() < 0.06, "it is not pulled along: {}", off.dot(&axis));
            let along = axis.push(0.0);
            assert!((along.transpose() * found.covariance * along).x > 1e3);
            let across = Vector3::new(-axis.y, axis.x, 0.0);
            let information = found.covariance.try_inverse().unwrap();
            assert!((across.transpose() * information * across).x > 1.0 / 0.02_f64.powi(2));
        }
    }

    #[test]
    fn headings_do_not_lean_one_way_from_key_frame_to_key_frame() {
        let corridor = World::corridor(60.0, 3.0, 0.0);
        let (from, to) = (Isometry2::identity(), Isometry2::new(Vector2::new(0.7, 0.0), 0.0));
        let turned = |seed: u64| {
            let zero = Matrix3::zeros();
            let frame = KeyFrame::new(from, zero, zero, &level(&corridor, &from, 2 * seed).returns);
            let mut map = LocalMap::new(&Vector2::zeros());
            map.add(&from, &frame.returns);
            refine(&map, &level(&corridor, &to, 2 * seed + 1).returns, &to).unwrap().pose.rotation.angle()
        };
        let mean = (0..40).map(turned).sum::<f64>() / 40.0;
        // A match has a sigma of 0.4 mrad.
        assert!(mean.abs() < 0.0002, "{mean}");
    }
}
