//! Faults of a world file.

use thiserror::Error;

use super::place::Place;
use super::{DEPTH_LIMIT, MOST_PARTS};

/// Why a world file was refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SdfError {
    #[error("{place}: {message}; {advice}")]
    Malformed { place: Place, message: String, advice: &'static str },
    #[error("{place}: <{element}> holds `{found}`; expected {expected}")]
    Value { place: Place, element: String, found: String, expected: &'static str },
    #[error("{place}: <{element}> needs {expected} inside; add it")]
    Missing { place: Place, element: String, expected: &'static str },
    #[error("{place}: models nest deeper than {DEPTH_LIMIT} levels; flatten the file")]
    TooDeep { place: Place },
    #[error(
        "{place}: from here on, the world has more than {MOST_PARTS} models, links, frames and solids; make it smaller"
    )]
    TooMany { place: Place },
    #[error(
        "{place}: there is no frame `{frame}`; expected the name of a frame, link, joint or model beside or inside it"
    )]
    NoFrame { place: Place, frame: String },
    #[error(
        "{place}: the pose is relative to itself, by way of `{frame}`; let one of these poses be relative to its model"
    )]
    Circle { place: Place, frame: String },
}
