//! The models of a world as they are written, before anybody knows where they stand.

use nalgebra::Isometry3;

use super::place::Place;
use crate::obstacle::Shape;

/// A name of a frame, and where it is written.
#[derive(Debug, Clone)]
pub(super) struct Reference {
    pub frame: String,
    pub place: Place,
}

/// A pose, relative to a named frame or to what is usual.
#[derive(Debug, Clone, Default)]
pub(super) struct Pose {
    pub relative_to: Option<Reference>,
    pub offset: Isometry3<f64>,
}

/// A model; the world itself is one that holds all others.
#[derive(Debug, Clone, Default)]
pub(super) struct Model {
    pub name: String,
    pub is_static: bool,
    pub pose: Pose,
    /// The frame of its own that `pose` is the place of.
    pub placement: Option<Reference>,
    /// Its parts count as its parent's own.
    pub is_merged: bool,
    pub frames: Vec<Frame>,
    pub links: Vec<Link>,
    pub models: Vec<Model>,
}

/// A frame or joint.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    pub name: String,
    /// The frame of its pose where it does not say.
    pub attached_to: Option<Reference>,
    pub pose: Pose,
}

#[derive(Debug, Clone)]
pub(super) struct Link {
    pub name: String,
    pub pose: Pose,
    pub bodies: Vec<Body>,
}

/// A solid of a link.
#[derive(Debug, Clone)]
pub(super) struct Body {
    pub name: String,
    pub pose: Pose,
    pub shape: Shape,
}

impl Model {
    /// All models, links, frames and solids, itself included.
    pub(super) fn parts(&self) -> usize {
        let bodies: usize = self.links.iter().map(|link| 1 + link.bodies.len()).sum();
        1 + self.frames.len() + bodies + self.models.iter().map(Self::parts).sum::<usize>()
    }

    pub(super) fn has_bodies(&self) -> bool {
        self.links.iter().any(|link| !link.bodies.is_empty()) || self.models.iter().any(Self::has_bodies)
    }
}
