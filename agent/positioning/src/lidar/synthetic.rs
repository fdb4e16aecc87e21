//! Worlds of walls and trunks for tests, and what a scanner sees of them.

use std::f64::consts::{PI, TAU};
use std::time::Duration;

use nalgebra::{Isometry2, Matrix3, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::level::{Prediction, Sweep};

const RAYS: u32 = 720;
const RANGE_M: f64 = 40.0;
pub const SIGMA_M: f64 = 0.03;

/// Walls from one place to another, and trunks by middle and radius, m.
#[derive(Clone, Debug, Default)]
pub struct World {
    pub walls: Vec<[Vector2<f64>; 2]>,
    pub trunks: Vec<(Vector2<f64>, f64)>,
}

pub struct Scanned {
    ranges_m: Vec<f32>,
}

impl Scanned {
    pub fn sweep(&self) -> Sweep<'_> {
        Sweep { ranges_m: &self.ranges_m, ..World::default().sweep(TAU / f64::from(RAYS)) }
    }
}

/// A normal number of variance 1.
pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (radius, turn): (f64, f64) = (random.random_range(1e-12..1.0), random.random_range(0.0..TAU));
    (-2.0 * radius.ln()).sqrt() * turn.cos()
}

/// A level prediction at a pose, 2 m above the ground, with this variance of each of its three parts.
pub fn flat(pose: Isometry2<f64>, variance: f64) -> Prediction {
    Prediction {
        position: pose.translation.vector.push(2.0),
        body_to_world: UnitQuaternion::from_euler_angles(0.0, 0.0, pose.rotation.angle()),
        velocity: Vector3::zeros(),
        turn_rate: Vector3::zeros(),
        covariance: Matrix3::identity() * variance,
        ground_m: 0.0,
    }
}

impl World {
    fn outline(corners: &[[f64; 2]]) -> Vec<[Vector2<f64>; 2]> {
        let corner = |at: usize| Vector2::from(corners[at % corners.len()]);
        (0..corners.len()).map(|at| [corner(at), corner(at + 1)]).collect()
    }

    /// A rectangular room about the origin.
    pub fn room(length_m: f64, width_m: f64) -> Self {
        let (x, y) = (length_m / 2.0, width_m / 2.0);
        Self { walls: Self::outline(&[[-x, -y], [x, -y], [x, y], [-x, y]]), trunks: Vec::new() }
    }

    /// Two walls about the origin, turned by `heading_rad`.
    pub fn corridor(length_m: f64, width_m: f64, heading_rad: f64) -> Self {
        let turn = nalgebra::UnitComplex::new(heading_rad);
        let place = |x: f64, y: f64| turn * Vector2::new(x * length_m / 2.0, y * width_m / 2.0);
        let walls = vec![[place(-1.0, -1.0), place(1.0, -1.0)], [place(1.0, 1.0), place(-1.0, 1.0)]];
        Self { walls, trunks: Vec::new() }
    }

    /// Trunks of 0.2 to 0.5 m anywhere in a strip from x = -20 m on, 1 m off the x axis at least.
    pub fn forest(seed: u64, length_m: f64, density_per_m2: f64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let count = (density_per_m2 * (length_m + 40.0) * 50.0) as usize;
        let mut trunk = || {
            let place =
                Vector2::new(random.random_range(-20.0..length_m + 20.0), random.random_range(-25.0..25.0));
            (place, random.random_range(0.2..0.5))
        };
        let trunks = (0..count).map(|_| trunk()).filter(|(place, radius)| place.y.abs() > 1.5 + radius);
        Self { walls: Vec::new(), trunks: trunks.collect() }
    }

    /// A hall of racks 2 m deep, 6 m apart, all alike but for the goods that stand out by up to 0.3 m.
    pub fn warehouse(length_m: f64, racks: u32, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let [from, to] = [-10.0, length_m];
        let north = 6.0 * f64::from(racks) + 2.0;
        let mut walls = Self::outline(&[[from, -8.0], [to, -8.0], [to, north], [from, north]]);
        for rack in 0..racks {
            let middle = 3.0 + 6.0 * f64::from(rack) - 6.0;
            let (low, high) = (middle - 1.0, middle + 1.0);
            walls.extend(Self::outline(&[
                [2.0, low],
                [length_m - 12.0, low],
                [length_m - 12.0, high],
                [2.0, high],
            ]));
            for _ in 0..(length_m / 2.5) as u32 {
                let (x, out) = (random.random_range(2.5..length_m - 14.0), random.random_range(0.05..0.3));
                let (side, sign) =
                    if random.random_range(0.0..1.0) < 0.5 { (low, -1.0) } else { (high, 1.0) };
                let corners =
                    [[x, side], [x, side + sign * out], [x + 0.8, side + sign * out], [x + 0.8, side]];
                walls.extend(Self::outline(&corners));
            }
        }
        Self { walls, trunks: Vec::new() }
    }

    /// From `place` along the direction to the first thing met, m.
    pub fn range(&self, place: &Vector2<f64>, direction_rad: f64) -> f64 {
        let direction = Vector2::new(direction_rad.cos(), direction_rad.sin());
        let wall = |[from, to]: &[Vector2<f64>; 2]| {
            let (along, off) = (to - from, from - place);
            let cross = direction.perp(&along);
            let (range, share) = (off.perp(&along) / cross, off.perp(&direction) / cross);
            ((0.0..=1.0).contains(&share) && range > 0.0).then_some(range)
        };
        let trunk = |(middle, radius): &(Vector2<f64>, f64)| {
            let off = middle - place;
            let (along, aside) = (off.dot(&direction), off.perp(&direction));
            let half_2 = radius * radius - aside * aside;
            (half_2 > 0.0 && along > 0.0).then(|| along - half_2.sqrt())
        };
        let walls = self.walls.iter().filter_map(wall);
        walls.chain(self.trunks.iter().filter_map(trunk)).fold(f64::INFINITY, f64::min)
    }

    /// A whole turn at once.
    pub fn scan(&self, pose: &Isometry2<f64>, seed: u64) -> Scanned {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (place, heading) = (pose.translation.vector, pose.rotation.angle());
        let near = |(middle, _): &&(Vector2<f64>, f64)| (middle - place).norm() < RANGE_M + 1.0;
        let seen =
            Self { walls: self.walls.clone(), trunks: self.trunks.iter().filter(near).copied().collect() };
        let range = |ray: u32| {
            let range_m = seen.range(&place, heading - PI + f64::from(ray) * TAU / f64::from(RAYS));
            (range_m + SIGMA_M * normal(&mut random)) as f32
        };
        Scanned { ranges_m: (0..RAYS).map(range).collect() }
    }

    /// A sweep without ranges.
    pub fn sweep(&self, angle_step: f64) -> Sweep<'_> {
        Sweep {
            stamp: Duration::ZERO,
            ranges_m: &[],
            angle_min: -PI,
            angle_step,
            max_range_m: RANGE_M,
            first_ray_s: 0.0,
            ray_step_s: 0.0,
            sigma_m: SIGMA_M,
        }
    }
}

/// A flight through a world, told by dead reckoning that errs.
pub struct Flight {
    random: ChaCha8Rng,
    truth: Isometry2<f64>,
    reckoned: Isometry2<f64>,
    covariance: Matrix3<f64>,
}

impl Flight {
    pub fn new(start: Isometry2<f64>, seed: u64) -> Self {
        let covariance = Matrix3::identity() * 1e-6;
        Self { random: ChaCha8Rng::seed_from_u64(seed), truth: start, reckoned: start, covariance }
    }

    /// Flies to `to` in a tenth of a second, with an error of 3 % and a bit of the way, and of 2 mrad.
    pub fn fly(&mut self, to: Isometry2<f64>) -> Prediction {
        let moved = self.truth.inverse() * to;
        let sigma_m = 0.005 + 0.03 * moved.translation.vector.norm();
        let mut off = |sigma: f64| sigma * normal(&mut self.random);
        let wrong = Isometry2::new(Vector2::new(off(sigma_m), off(sigma_m)), off(0.002));
        self.truth = to;
        self.reckoned *= moved * wrong;
        let grown = Vector3::new(sigma_m.powi(2), sigma_m.powi(2), 0.002_f64.powi(2));
        self.covariance += Matrix3::from_diagonal(&grown);
        Prediction { covariance: self.covariance, ..flat(self.reckoned, 0.0) }
    }

    /// From now on the reckoning is off by `away`.
    pub fn mislead(&mut self, away: &Isometry2<f64>) {
        self.reckoned *= away;
    }
}
