//! Poses of key frames from what was measured between them.
//!
//! Gauss-Newton over a block-sparse L D Lt factor in the order in which the frames came, where a chain with few loops
//! fills in little. Loops carry a robust weight (Geman-McClure), so that a wrong one yields to the rest. The work is
//! done in small pieces: a call of [`Solve::advance`] does as many block products as it is allowed.

use std::collections::BTreeMap;

use nalgebra::{Isometry2, Matrix3, Vector2, Vector3};

/// Rounds of linearisation.
const ROUNDS: usize = 8;
/// Squared error, in variances, beyond which a loop's weight falls off in the last round.
const KERNEL: f64 = 12.0;
/// By so much the kernel narrows from round to round (Yang 2020): at first each loop pulls, and in the end those that
/// the rest does not bear out do not.
const NARROWING: f64 = 4.0;
/// The last round's longest step in a solution, m and rad.
const SETTLED: f64 = 0.02;
/// No covariance is less than this, so that each has an inverse: m² and rad².
const LEAST_VARIANCE: f64 = 1e-8;

/// A measurement between two frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Indices of the frames.
    pub from: usize,
    pub to: usize,
    /// Pose of `to` in the frame of `from`.
    pub relative: Isometry2<f64>,
    /// Covariance of `relative`, along the axes of `from` (m²) and of the heading (rad²).
    pub covariance: Matrix3<f64>,
    /// Found by recognising a place, and so perhaps wrong.
    pub is_loop: bool,
}

/// Covariance of a pose that was composed of one with covariance `first` (world axes), whose rotation and translation
/// are those of `base`, and of `relative` with `second` (axes of `base`).
pub fn composed(
    base: &Isometry2<f64>,
    first: &Matrix3<f64>,
    relative: &Isometry2<f64>,
    second: &Matrix3<f64>,
) -> Matrix3<f64> {
    let arm = base.rotation * relative.translation.vector;
    let mut moved = Matrix3::identity();
    moved[(0, 2)] = -arm.y;
    moved[(1, 2)] = arm.x;
    let turn = turned(base);
    moved * first * moved.transpose() + turn * second * turn.transpose()
}

/// The rotation of `pose` for east, north and heading.
pub fn turned(pose: &Isometry2<f64>) -> Matrix3<f64> {
    let (sin, cos) = pose.rotation.angle().sin_cos();
    Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0)
}

/// The least poses' solution in work.
#[derive(Clone, Debug)]
pub struct Solve {
    poses: Vec<Isometry2<f64>>,
    prior: Isometry2<f64>,
    prior_covariance: Matrix3<f64>,
    edges: Vec<Edge>,
    /// Inverses of the edges' covariances.
    information: Vec<Matrix3<f64>>,
    round: usize,
    factor: Factor,
    stage: Stage,
    /// The longest step of the last round, m and rad.
    last_step: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    Linearise,
    Eliminate(usize),
    Covariances(usize),
    Done,
}

/// The normal equations, eliminated in place.
#[derive(Clone, Debug, Default)]
struct Factor {
    /// Diagonal blocks, and their inverses once they are eliminated.
    diagonal: Vec<Matrix3<f64>>,
    /// Blocks below the diagonal by column; the factor's once it is eliminated.
    below: Vec<BTreeMap<usize, Matrix3<f64>>>,
    right: Vec<Vector3<f64>>,
    covariances: Vec<Matrix3<f64>>,
    /// Of the covariance's blocks those where the factor has one.
    beside: Vec<BTreeMap<usize, Matrix3<f64>>>,
}

impl Solve {
    /// Starts from these poses; that of the first is known to be `poses[0]` to `prior_covariance`. Edges to frames that
    /// are not there are left out.
    pub fn new(poses: Vec<Isometry2<f64>>, prior_covariance: Matrix3<f64>, edges: Vec<Edge>) -> Self {
        let count = poses.len();
        let is_between = |edge: &Edge| edge.from < count && edge.to < count && edge.from != edge.to;
        let edges: Vec<Edge> = edges.into_iter().filter(is_between).collect();
        let stage = if count == 0 { Stage::Done } else { Stage::Linearise };
        Self {
            prior: poses.first().copied().unwrap_or_default(),
            information: edges.iter().map(|edge| inverse(&edge.covariance)).collect(),
            poses,
            prior_covariance,
            edges,
            round: 0,
            factor: Factor::default(),
            stage,
            last_step: 0.0,
        }
    }

    /// Does so many block products more; whether it is done.
    pub fn advance(&mut self, mut products: usize) -> bool {
        while self.stage != Stage::Done && products > 0 {
            let done = match self.stage {
                Stage::Linearise => {
                    self.linearise();
                    self.stage = Stage::Eliminate(0);
                    self.edges.len()
                }
                Stage::Eliminate(column) if column < self.poses.len() => {
                    self.stage = Stage::Eliminate(column + 1);
                    self.factor.eliminate(column)
                }
                Stage::Eliminate(_) => {
                    self.step();
                    self.poses.len()
                }
                Stage::Covariances(0) | Stage::Done => {
                    self.stage = Stage::Done;
                    0
                }
                Stage::Covariances(left) => {
                    self.stage = Stage::Covariances(left - 1);
                    self.factor.cover(left - 1)
                }
            };
            products = products.saturating_sub(done.max(1));
        }
        self.stage == Stage::Done
    }

    /// Whether the last round changed hardly anything: without that the solution is none.
    pub fn has_settled(&self) -> bool {
        self.last_step < SETTLED
    }

    /// Poses and their covariances (world axes), once it is done.
    pub fn solution(&self) -> impl Iterator<Item = (&Isometry2<f64>, &Matrix3<f64>)> {
        self.poses.iter().zip(&self.factor.covariances)
    }

    fn linearise(&mut self) {
        let count = self.poses.len();
        let mut factor = Factor {
            diagonal: vec![Matrix3::zeros(); count],
            below: vec![BTreeMap::new(); count],
            right: vec![Vector3::zeros(); count],
            ..Factor::default()
        };
        let kernel = KERNEL * NARROWING.powi((ROUNDS - 1).saturating_sub(self.round) as i32);
        let known = inverse(&self.prior_covariance);
        let off = self.prior.translation.vector - self.poses[0].translation.vector;
        let turn = self.poses[0].rotation.rotation_to(&self.prior.rotation).angle();
        factor.diagonal[0] += known;
        factor.right[0] += known * off.push(turn);
        for (edge, information) in self.edges.iter().zip(&self.information) {
            let (from, to) = (&self.poses[edge.from], &self.poses[edge.to]);
            let back = turned(from).transpose();
            let arm = to.translation.vector - from.translation.vector;
            let error = error(from, to, &edge.relative);
            // Of the error by both poses; the second's is `back` itself.
            let mut by_from = -back;
            by_from.set_column(2, &(back * Vector3::new(arm.y, -arm.x, -1.0)));
            let weight = match edge.is_loop {
                true => (kernel / (kernel + (error.transpose() * information * error).x)).powi(2),
                false => 1.0,
            };
            let information = information * weight;
            factor.diagonal[edge.from] += by_from.transpose() * information * by_from;
            factor.diagonal[edge.to] += back.transpose() * information * back;
            factor.right[edge.from] -= by_from.transpose() * information * error;
            factor.right[edge.to] -= back.transpose() * information * error;
            let across = back.transpose() * information * by_from;
            let (column, row, block) = match edge.from < edge.to {
                true => (edge.from, edge.to, across),
                false => (edge.to, edge.from, across.transpose()),
            };
            *factor.below[column].entry(row).or_insert_with(Matrix3::zeros) += block;
        }
        self.factor = factor;
    }

    fn step(&mut self) {
        let steps = self.factor.solve();
        self.last_step = 0.0;
        for (pose, step) in self.poses.iter_mut().zip(&steps) {
            // `max` passes over what is no number.
            let length = if step.norm().is_nan() { f64::INFINITY } else { step.norm() };
            self.last_step = self.last_step.max(length);
            pose.translation.vector += step.xy();
            pose.rotation *= nalgebra::UnitComplex::new(step.z);
        }
        self.round += 1;
        self.stage = Stage::Linearise;
        if self.round >= ROUNDS {
            let count = self.poses.len();
            self.factor.covariances = vec![Matrix3::zeros(); count];
            self.factor.beside = vec![BTreeMap::new(); count];
            self.stage = Stage::Covariances(count);
        }
    }
}

/// Difference of two poses from what was measured: along the axes of the first, m, and of the heading, rad.
pub fn error(from: &Isometry2<f64>, to: &Isometry2<f64>, measured: &Isometry2<f64>) -> Vector3<f64> {
    let said = from.inverse() * to;
    let off: Vector2<f64> = said.translation.vector - measured.translation.vector;
    off.push(measured.rotation.rotation_to(&said.rotation).angle())
}

fn inverse(covariance: &Matrix3<f64>) -> Matrix3<f64> {
    let known = covariance + Matrix3::identity() * LEAST_VARIANCE;
    let inverse = known.cholesky().map(|factor| factor.inverse());
    inverse.filter(|inverse| inverse.iter().all(|value| value.is_finite())).unwrap_or_else(Matrix3::zeros)
}

impl Factor {
    /// Eliminates one column; how many products that took.
    fn eliminate(&mut self, column: usize) -> usize {
        // A frame that nothing holds would have no inverse.
        let own = self.diagonal[column] + Matrix3::identity() * 1e-9;
        let inverse = inverse(&(own - Matrix3::identity() * LEAST_VARIANCE));
        self.diagonal[column] = inverse;
        let blocks: Vec<(usize, Matrix3<f64>)> =
            std::mem::take(&mut self.below[column]).into_iter().collect();
        let right = self.right[column];
        for (at, (row, block)) in blocks.iter().enumerate() {
            let factor = block * inverse;
            self.right[*row] -= factor * right;
            self.diagonal[*row] -= factor * block.transpose();
            for (other, below) in &blocks[at + 1..] {
                let update = below * factor.transpose();
                *self.below[*row].entry(*other).or_insert_with(Matrix3::zeros) -= update;
            }
            self.below[column].insert(*row, factor);
        }
        blocks.len() * (blocks.len() + 1) / 2
    }

    fn solve(&self) -> Vec<Vector3<f64>> {
        let mut steps: Vec<Vector3<f64>> = vec![Vector3::zeros(); self.diagonal.len()];
        for column in (0..self.diagonal.len()).rev() {
            let mut step = self.diagonal[column] * self.right[column];
            for (row, factor) in &self.below[column] {
                step -= factor.transpose() * steps[*row];
            }
            steps[column] = step;
        }
        steps
    }

    /// The covariance of one column's frame, from those after it (Takahashi 1973); how many products that took.
    fn cover(&mut self, column: usize) -> usize {
        let factors: Vec<(usize, Matrix3<f64>)> =
            self.below[column].iter().map(|(row, f)| (*row, *f)).collect();
        let mut own = self.diagonal[column];
        let mut beside = BTreeMap::new();
        for (row, factor) in &factors {
            let mut block = Matrix3::zeros();
            for (other, beyond) in &factors {
                block -= self.covariance(*row, *other) * beyond;
            }
            own -= factor.transpose() * block;
            beside.insert(*row, block);
        }
        self.covariances[column] = (own + own.transpose()) / 2.0;
        self.beside[column] = beside;
        factors.len() * factors.len()
    }

    /// A block of the covariance, of two frames that are beside one another in the factor.
    fn covariance(&self, row: usize, column: usize) -> Matrix3<f64> {
        let stored = |column: usize, row: usize| self.beside[column].get(&row).copied().unwrap_or_default();
        match row.cmp(&column) {
            std::cmp::Ordering::Equal => self.covariances[row],
            std::cmp::Ordering::Greater => stored(column, row),
            std::cmp::Ordering::Less => stored(row, column).transpose(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(x: f64, y: f64, heading: f64) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(x, y), heading)
    }

    fn diagonal(position: f64, heading: f64) -> Matrix3<f64> {
        Matrix3::from_diagonal(&Vector3::new(position, position, heading))
    }

    /// A square of 40 legs whose odometry turns a little too far, closed by loops.
    fn square(loops: &[(usize, usize, Isometry2<f64>)]) -> (Vec<Isometry2<f64>>, Solve) {
        let mut truth = vec![pose(3.0, -2.0, 0.4)];
        let mut drifted = truth.clone();
        let mut edges = Vec::new();
        for leg in 0..40 {
            let turn = if leg % 10 == 9 { std::f64::consts::FRAC_PI_2 } else { 0.0 };
            truth.push(truth[leg] * pose(1.0, 0.0, turn));
            let relative = pose(1.003, 0.002, turn + 0.0015);
            drifted.push(drifted[leg] * relative);
            let covariance = diagonal(4e-4, 4e-5);
            edges.push(Edge { from: leg, to: leg + 1, relative, covariance, is_loop: false });
        }
        edges.extend(loops.iter().map(|&(from, to, relative)| Edge {
            from,
            to,
            relative,
            covariance: diagonal(1e-4, 1e-5),
            is_loop: true,
        }));
        (truth, Solve::new(drifted, diagonal(0.01, 0.001), edges))
    }

    fn worst_m(truth: &[Isometry2<f64>], solve: &Solve) -> f64 {
        let off = |(one, (other, _)): (&Isometry2<f64>, (&Isometry2<f64>, _))| {
            (one.translation.vector - other.translation.vector).norm()
        };
        truth.iter().zip(solve.solution()).map(off).fold(0.0, f64::max)
    }

    #[test]
    fn a_loop_takes_the_drift_out_in_small_pieces() {
        let (truth, mut open) = square(&[]);
        assert!(open.advance(usize::MAX));
        assert!(worst_m(&truth, &open) > 0.25);
        let (truth, mut closed) = square(&[(40, 0, pose(0.0, 0.0, 0.0))]);
        let mut calls = 0;
        while !closed.advance(50) {
            calls += 1;
        }
        assert!(calls > 5);
        assert!(worst_m(&truth, &closed) < 0.12, "{}", worst_m(&truth, &closed));
    }

    #[test]
    fn a_wrong_loop_yields() {
        let right = [(40, 0, pose(0.0, 0.0, 0.0)), (38, 2, pose(2.0, 2.0, -std::f64::consts::FRAC_PI_2))];
        let (truth, mut solve) = square(&[right[0], right[1], (30, 5, pose(1.0, 0.0, 0.0))]);
        solve.advance(usize::MAX);
        assert!(worst_m(&truth, &solve) < 0.15, "{}", worst_m(&truth, &solve));
    }

    #[test]
    fn covariances_are_those_of_the_dense_inverse() {
        let (_, mut solve) = square(&[(40, 0, pose(0.0, 0.0, 0.0)), (25, 7, pose(-7.0, 5.0, 3.1))]);
        while solve.stage != Stage::Eliminate(0) {
            solve.advance(1);
        }
        let count = solve.poses.len();
        let mut dense = nalgebra::DMatrix::zeros(3 * count, 3 * count);
        // The last round's equations are the ones whose inverse is told.
        while !matches!(solve.stage, Stage::Covariances(_)) {
            if solve.stage == Stage::Eliminate(0) {
                for column in 0..count {
                    dense
                        .fixed_view_mut::<3, 3>(3 * column, 3 * column)
                        .copy_from(&solve.factor.diagonal[column]);
                    for (row, block) in &solve.factor.below[column] {
                        dense.fixed_view_mut::<3, 3>(3 * row, 3 * column).copy_from(block);
                        dense.fixed_view_mut::<3, 3>(3 * column, 3 * row).copy_from(&block.transpose());
                    }
                }
            }
            solve.advance(1);
        }
        solve.advance(usize::MAX);
        let inverse = dense.try_inverse().unwrap();
        for (at, (_, covariance)) in solve.solution().enumerate() {
            let block = inverse.fixed_view::<3, 3>(3 * at, 3 * at).into_owned();
            assert!((covariance - block).norm() < 1e-6 * block.norm(), "{at}: {covariance} {block}");
        }
        let composed = composed(
            &pose(3.0, -2.0, 0.4),
            &diagonal(0.01, 0.001),
            &pose(1.0, 0.0, 0.0),
            &diagonal(0.0, 0.0),
        );
        assert!((composed[(1, 1)] - 0.01 - 0.001 * 0.4_f64.cos().powi(2)).abs() < 1e-12);
    }

    #[test]
    fn nothing_that_is_measured_makes_it_fall() {
        let nan = Matrix3::repeat(f64::NAN);
        let edge = Edge { from: 0, to: 7, relative: pose(0.0, 0.0, 0.0), covariance: nan, is_loop: true };
        let poses = vec![pose(0.0, 0.0, 0.0); 3];
        let mut solve = Solve::new(poses, nan, vec![edge, Edge { to: 2, ..edge }, Edge { to: 0, ..edge }]);
        assert!(solve.advance(usize::MAX));
        assert!(Solve::new(Vec::new(), nan, Vec::new()).advance(1));
    }
}
