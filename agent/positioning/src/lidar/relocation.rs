//! Finding the place again after it was lost: near where it should be first, then wherever it looks alike.

use nalgebra::{Isometry2, Matrix3, Vector2};
use std::f64::consts::PI;

use super::key_frames::KeyFrames;
use super::level::{LevelScan, Return};
use super::local_map::LocalMap;
use super::matching::refine;
use super::place::Place;
use super::search::{Found, Search};

/// The first search reaches this far at least, and at most, m.
const NEAR_M: [f64; 2] = [2.0, 12.0];
/// And turns so far at least, rad.
const NEAR_RAD: f64 = 0.4;
/// A search about a frame that looks alike reaches this far, m.
const ALIKE_M: f64 = 5.0;
/// Frames that are tried.
const MOST_FRAMES: usize = 8;
/// Frames nearer than this to one that was tried are not tried, m.
const APART_M: f64 = 4.0;
/// Share of the scan that lies on the map where the place is.
const LEAST_SHARE: f64 = 0.65;

/// A search in work.
#[derive(Clone, Debug)]
pub struct Relocation {
    returns: Vec<Return>,
    /// Where the vehicle was believed to be when the scan was taken.
    guess: Isometry2<f64>,
    /// Frames to try after this one, the best last.
    next: Vec<usize>,
    frame: usize,
    map: LocalMap,
    search: Search,
}

/// The result of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Relocated {
    Searching,
    At {
        pose: Isometry2<f64>,
        /// A frame near it.
        frame: usize,
    },
    /// At no place that is known.
    Nowhere,
}

impl Relocation {
    /// Prepares to find where `scan` was taken. `grown` is how the covariance of the prediction has grown.
    pub fn new(frames: &KeyFrames, scan: &LevelScan, guess: &Isometry2<f64>, grown: &Matrix3<f64>) -> Self {
        let all = frames.all();
        let place = Place::new(&scan.returns);
        let off_m = |at: usize| (all[at].position() - guess.translation.vector).norm();
        let mut ranked: Vec<usize> = (0..all.len()).collect();
        ranked.sort_by(|one, other| {
            place.unlike(&all[*one].place).total_cmp(&place.unlike(&all[*other].place))
        });
        let nearest = (0..all.len()).min_by(|one, other| off_m(*one).total_cmp(&off_m(*other))).unwrap_or(0);
        let mut next: Vec<usize> = Vec::new();
        for at in ranked {
            let is_apart = |other: &usize| (all[at].position() - all[*other].position()).norm() > APART_M;
            if next.len() < MOST_FRAMES && next.iter().all(is_apart) {
                next.push(at);
            }
        }
        next.reverse();
        let sigma_m = grown[(0, 0)].max(grown[(1, 1)]).max(0.0).sqrt();
        let reach_m = (3.0 * sigma_m).clamp(NEAR_M[0], NEAR_M[1]);
        let turn_rad = (3.0 * grown[(2, 2)].max(0.0).sqrt()).clamp(NEAR_RAD, PI);
        let mut map = LocalMap::new(&Vector2::zeros());
        frames.draw(&mut map, &guess.translation.vector, nearest, &frames.apart(nearest));
        let search = Search::new(&map, &scan.returns, guess, reach_m, turn_rad);
        Self { returns: scan.returns.clone(), guess: *guess, next, frame: nearest, map, search }
    }

    /// Goes on; where the vehicle is now, once it is found, when `guess` is where it is believed to be.
    pub fn advance(&mut self, frames: &KeyFrames, guess: &Isometry2<f64>, squares: usize) -> Relocated {
        let found = match self.search.advance(squares) {
            Found::Searching => return Relocated::Searching,
            Found::At(pose) => refine(&self.map, &self.returns, &pose),
            Found::Nowhere => None,
        };
        if let Some(found) = found.filter(|found| found.share >= LEAST_SHARE && found.is_whole) {
            let since = self.guess.inverse() * guess;
            return Relocated::At { pose: found.pose * since, frame: self.frame };
        }
        let Some(frame) = self.next.pop() else { return Relocated::Nowhere };
        let pose = frames.all()[frame].pose;
        self.frame = frame;
        frames.draw(&mut self.map, &pose.translation.vector, frame, &frames.apart(frame));
        self.search = Search::new(&self.map, &self.returns, &pose, ALIKE_M, PI);
        Relocated::Searching
    }
}
