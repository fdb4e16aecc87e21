//! Closing loops: a place that was seen before is looked for where the path's covariance lets it be, and measured.

use std::collections::BTreeSet;

use nalgebra::{Isometry2, Matrix3, Vector2};

use super::key_frames::KeyFrames;
use super::local_map::LocalMap;
use super::matching::{Match, refine};
use super::pose_graph::turned;
use super::search::{Found, Search};

/// Scans from places this far apart show much of the same, m.
const SHARED_M: f64 = 5.0;
/// No search reaches further, m and rad.
const FURTHEST: (f64, f64) = (12.0, 0.6);
/// Within this a match needs no search, m.
const NEAR_M: f64 = 0.3;
/// Share of the scan that lies on the other place's map when both are one.
const LEAST_SHARE: f64 = 0.6;
/// Greatest distance of a loop from where the path leads, in standard deviations.
const GATE: f64 = 4.0;
/// A match is surer of itself than two whole neighbourhoods of frames are of one another.
const WIDER: f64 = 4.0;

/// The view of the search for loops.
pub struct Closing<'a> {
    pub frames: &'a KeyFrames,
    /// The frame next to the vehicle.
    pub from: usize,
    /// Variance of the path from it to each frame, m².
    pub apart: &'a [f64],
}

/// A place seen again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loop {
    pub from: usize,
    pub to: usize,
    /// Pose of `to` in the frame of `from`.
    pub relative: Isometry2<f64>,
    pub covariance: Matrix3<f64>,
}

/// The search for loops.
#[derive(Clone, Debug, Default)]
pub struct Closure {
    /// The frames of which it was tried whether they show one place.
    tried: BTreeSet<[usize; 2]>,
    search: Option<Box<Attempt>>,
    is_busy: bool,
}

#[derive(Clone, Debug)]
struct Attempt {
    from: usize,
    to: usize,
    map: LocalMap,
    search: Option<Search>,
    /// Standard deviation of the path, m.
    sigma_m: f64,
}

/// Pairs that are remembered as tried.
const MOST_TRIED: usize = 4000;

impl Closure {
    /// Whether the newest step had a place to try.
    pub fn is_busy(&self) -> bool {
        self.is_busy
    }

    /// Goes on searching; a loop where one has been found.
    pub fn advance(&mut self, closing: &Closing<'_>, squares: usize) -> Option<Loop> {
        let attempt = self.search.take().or_else(|| self.begin(closing));
        self.is_busy = attempt.is_some();
        let mut attempt = attempt?;
        let frames = closing.frames.all();
        let Some(search) = &mut attempt.search else {
            return attempt.measure(closing.frames, &frames[attempt.from].pose);
        };
        match search.advance(squares) {
            Found::Searching => {
                self.search = Some(attempt);
                None
            }
            Found::At(pose) => attempt.measure(closing.frames, &pose),
            Found::Nowhere => None,
        }
    }

    fn begin(&mut self, closing: &Closing<'_>) -> Option<Box<Attempt>> {
        let frames = closing.frames.all();
        let own = &frames[closing.from];
        let off_m = |at: usize| (frames[at].position() - own.position()).norm();
        let may_be = |at: &usize| {
            let apart_m2 = closing.apart[*at];
            let reach_m = SHARED_M + (3.0 * apart_m2.sqrt()).min(FURTHEST.0);
            let is_new = !self.tried.contains(&[closing.from, *at]);
            !KeyFrames::agree(apart_m2) && apart_m2.is_finite() && off_m(*at) < reach_m && is_new
        };
        let unlike = |at: usize| own.place.unlike(&frames[at].place) + 0.05 * off_m(at);
        let to =
            (0..frames.len()).filter(may_be).min_by(|one, other| unlike(*one).total_cmp(&unlike(*other)))?;
        if self.tried.len() >= MOST_TRIED {
            self.tried.pop_first();
        }
        self.tried.insert([closing.from, to]);
        let sigma_m = closing.apart[to].sqrt();
        let mut map = LocalMap::new(&Vector2::zeros());
        closing.frames.draw(&mut map, &frames[to].position(), to, &closing.frames.apart(to));
        let wide = 3.0 * sigma_m > NEAR_M;
        let search = || {
            let turn_rad = (3.0 * own.covariance[(2, 2)].sqrt()).clamp(0.05, FURTHEST.1);
            let reach_m = (3.0 * sigma_m).min(FURTHEST.0);
            Search::new(&map, &own.returns, &own.pose, reach_m, turn_rad)
        };
        let search = wide.then(search);
        Some(Box::new(Attempt { from: closing.from, to, map, search, sigma_m }))
    }
}

impl Attempt {
    /// Matches the frame's scan on the other place's map, from `guess`.
    fn measure(&self, frames: &KeyFrames, guess: &Isometry2<f64>) -> Option<Loop> {
        let (own, other) = (&frames.all()[self.from], &frames.all()[self.to]);
        let found: Match = refine(&self.map, &own.returns, guess)?;
        let off_m = (found.pose.translation.vector - own.position()).norm();
        if found.share < LEAST_SHARE || !found.is_whole || off_m > GATE * self.sigma_m + 0.1 {
            return None;
        }
        let back = turned(&found.pose).transpose();
        let relative = found.pose.inverse() * other.pose;
        // The match's errors are those of `from` in the world; seen from `from`, they swing the other.
        let arm = relative.translation.vector;
        let mut swing = Matrix3::identity();
        swing[(0, 2)] = -arm.y;
        swing[(1, 2)] = arm.x;
        let covariance = swing * back * found.covariance * back.transpose() * swing.transpose();
        Some(Loop { from: self.from, to: self.to, relative, covariance: covariance * WIDER })
    }
}
