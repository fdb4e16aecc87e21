//! Key frames: scans that are kept, where they were taken, and what was measured between them.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::{Isometry2, Matrix3, Vector2};

use super::level::{Return, gathered};
use super::local_map::LocalMap;
use super::place::Place;
use super::pose_graph::{Edge, composed, turned};

/// Returns of a key frame that are nearer to one another than this are one, m.
const SPACING_M: f64 = 0.08;
/// Frames agree when the path between them is known to this, m².
const AGREED_M2: f64 = 0.1 * 0.1;
/// At this distance an error of the heading counts, m.
const ARM_M: f64 = 8.0;
/// A local map is made of the frames this near, m.
const NEAR_M: f64 = 25.0;
/// Frames that make a local map, at most.
const MOST_MEMBERS: usize = 14;

/// A scan that is kept.
#[derive(Clone, Debug)]
pub struct KeyFrame {
    pub pose: Isometry2<f64>,
    /// Of `pose`, world axes: m² and rad².
    pub covariance: Matrix3<f64>,
    /// Covariance of the pose by the rest of the vehicle when the scan was taken, m² and rad².
    pub predicted: Matrix3<f64>,
    pub returns: Vec<Return>,
    pub place: Place,
}

/// All that is kept. The first frame holds the rest to the world.
#[derive(Clone, Debug, Default)]
pub struct KeyFrames {
    frames: Vec<KeyFrame>,
    edges: Vec<Edge>,
}

impl KeyFrame {
    pub fn new(
        pose: Isometry2<f64>,
        covariance: Matrix3<f64>,
        predicted: Matrix3<f64>,
        returns: &[Return],
    ) -> Self {
        let kept = gathered(returns, SPACING_M);
        Self { place: Place::new(&kept), pose, covariance, predicted, returns: kept }
    }

    pub fn position(&self) -> Vector2<f64> {
        self.pose.translation.vector
    }

    fn bytes(&self) -> usize {
        size_of::<Self>() + self.returns.capacity() * size_of::<Return>()
    }
}

impl KeyFrames {
    pub fn all(&self) -> &[KeyFrame] {
        &self.frames
    }

    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Memory that all take, bytes.
    pub fn bytes(&self) -> usize {
        self.frames.iter().map(KeyFrame::bytes).sum::<usize>() + self.edges.capacity() * size_of::<Edge>()
    }

    /// Adds a frame, with what was measured from another to it; the index it has.
    pub fn add(&mut self, frame: KeyFrame, from: Option<(usize, Isometry2<f64>, Matrix3<f64>)>) -> usize {
        let to = self.frames.len();
        self.frames.push(frame);
        let edge = |(from, relative, covariance)| Edge { from, to, relative, covariance, is_loop: false };
        self.edges.extend(from.map(edge));
        to
    }

    /// Adds what was measured between two frames where a loop closes.
    pub fn close(&mut self, from: usize, to: usize, relative: Isometry2<f64>, covariance: Matrix3<f64>) {
        self.edges.push(Edge { from, to, relative, covariance, is_loop: true });
    }

    /// For each frame, how well the path from `start` to it is known, m²; infinite where none leads there.
    pub fn apart(&self, start: usize) -> Vec<f64> {
        let mut beside: Vec<Vec<(usize, f64)>> = vec![Vec::new(); self.frames.len()];
        for edge in &self.edges {
            let variance = edge.covariance.diagonal();
            let cost = variance.x + variance.y + ARM_M * ARM_M * variance.z;
            beside[edge.from].push((edge.to, cost));
            beside[edge.to].push((edge.from, cost));
        }
        let mut apart = vec![f64::INFINITY; self.frames.len()];
        // Non-negative numbers are ordered as their bits.
        let mut open = BinaryHeap::from([Reverse((0_u64, start))]);
        while let Some(Reverse((bits, frame))) = open.pop() {
            let cost = f64::from_bits(bits);
            if cost >= apart[frame] {
                continue;
            }
            apart[frame] = cost;
            for &(next, more) in &beside[frame] {
                if cost + more < apart[next] {
                    open.push(Reverse(((cost + more.max(0.0)).to_bits(), next)));
                }
            }
        }
        apart
    }

    /// Whether frames with this between them are drawn as one map.
    pub fn agree(apart_m2: f64) -> bool {
        apart_m2 < AGREED_M2
    }

    /// The frame nearest to `place` of those that agree with `start`.
    pub fn nearest(&self, place: &Vector2<f64>, start: usize, apart: &[f64]) -> usize {
        let off = |at: usize| (self.frames[at].position() - place).norm_squared();
        let agreed = (0..self.frames.len()).filter(|at| Self::agree(apart[*at]));
        agreed.min_by(|one, other| off(*one).total_cmp(&off(*other))).unwrap_or(start)
    }

    /// Draws the map about `place` of the frames that agree with frame `start`; those it is made of.
    pub fn draw(&self, map: &mut LocalMap, place: &Vector2<f64>, start: usize, apart: &[f64]) -> Vec<usize> {
        let off = |at: usize| (self.frames[at].position() - place).norm();
        let is_near = |at: &usize| *at == start || Self::agree(apart[*at]) && off(*at) < NEAR_M;
        let mut members: Vec<usize> = (0..self.frames.len()).filter(is_near).collect();
        members.sort_by(|one, other| off(*one).total_cmp(&off(*other)));
        members.truncate(MOST_MEMBERS);
        map.clear(place);
        for member in &members {
            let frame = &self.frames[*member];
            map.add(&frame.pose, &frame.returns);
        }
        members
    }

    /// Takes over solved poses. Frames that came after the solution was begun follow the frame they were measured from.
    pub fn correct<'a>(&mut self, solution: impl Iterator<Item = (&'a Isometry2<f64>, &'a Matrix3<f64>)>) {
        let mut solved = 0;
        for (frame, (pose, covariance)) in self.frames.iter_mut().zip(solution) {
            (frame.pose, frame.covariance) = (*pose, *covariance);
            solved += 1;
        }
        for at in solved..self.frames.len() {
            let measured = self.edges.iter().find(|edge| edge.to == at && !edge.is_loop);
            if let Some(edge) = measured {
                let base = &self.frames[edge.from];
                let covariance = composed(&base.pose, &base.covariance, &edge.relative, &edge.covariance);
                (self.frames[at].pose, self.frames[at].covariance) = (base.pose * edge.relative, covariance);
            }
        }
    }

    /// Forgets the frame that is nearest to the one it was measured from, none of `kept` and not the first. What was
    /// measured from it is measured from that one from now on.
    pub fn forget_one(&mut self, kept: &[usize]) {
        let may_go = |edge: &&Edge| !edge.is_loop && edge.to != 0 && !kept.contains(&edge.to);
        let length = |edge: &&Edge| edge.relative.translation.vector.norm();
        let shortest = |one: &&Edge, other: &&Edge| length(one).total_cmp(&length(other));
        let Some(gone) = self.edges.iter().filter(may_go).min_by(shortest).copied() else { return };
        self.edges.retain(|edge| edge.to != gone.to || edge.is_loop);
        for edge in &mut self.edges {
            if edge.from == gone.to {
                *edge = after(&gone, edge);
            } else if edge.to == gone.to {
                *edge = after(&gone, &back(edge));
            }
        }
        self.frames.remove(gone.to);
        let moved = |at: usize| at - usize::from(at > gone.to);
        for edge in &mut self.edges {
            (edge.from, edge.to) = (moved(edge.from), moved(edge.to));
        }
        self.edges.retain(|edge| edge.from != edge.to);
    }
}

/// Two measurements, one after the other.
fn after(first: &Edge, second: &Edge) -> Edge {
    let covariance = composed(&first.relative, &first.covariance, &second.relative, &second.covariance);
    Edge {
        from: first.from,
        to: second.to,
        relative: first.relative * second.relative,
        covariance,
        ..*second
    }
}

/// The same measurement, the other way round.
fn back(edge: &Edge) -> Edge {
    let relative = edge.relative.inverse();
    // The error, seen from the other end.
    let arm = edge.relative.translation.vector;
    let mut shift = Matrix3::identity();
    shift[(0, 2)] = arm.y;
    shift[(1, 2)] = -arm.x;
    let moved = shift * edge.covariance * shift.transpose();
    let turn = turned(&relative);
    Edge { from: edge.to, to: edge.from, relative, covariance: turn * moved * turn.transpose(), ..*edge }
}
