//! The reader of a world, between one file and the next.

use std::collections::BTreeMap;

use super::account::Account;
use super::error::SdfError;
use super::text::Element;
use super::tree::Model;
use super::{DEPTH_LIMIT, MOST_PARTS};
use crate::files::Files;
use crate::mesh::Mesh;

pub(super) struct Reader<'f> {
    pub files: &'f dyn Files,
    pub account: Account,
    /// Included models, by the name of their file.
    pub models: BTreeMap<String, Model>,
    /// Meshes, by the name of their file and all that makes one of another.
    pub meshes: BTreeMap<String, Mesh>,
    /// Ground at z = 0 is stated.
    pub has_ground: bool,
    /// Models, links, frames and solids so far.
    parts: usize,
}

impl<'f> Reader<'f> {
    pub(super) fn new(files: &'f dyn Files) -> Self {
        Self {
            files,
            account: Account::default(),
            models: BTreeMap::new(),
            meshes: BTreeMap::new(),
            has_ground: false,
            parts: 0,
        }
    }

    pub(super) fn check_depth(&self, element: Element<'_>, depth: usize) -> Result<(), SdfError> {
        if depth < DEPTH_LIMIT { Ok(()) } else { Err(SdfError::TooDeep { place: element.place() }) }
    }

    /// Counts parts of the world.
    pub(super) fn count(&mut self, element: Element<'_>, parts: usize) -> Result<(), SdfError> {
        self.parts = self.parts.saturating_add(parts);
        if self.parts <= MOST_PARTS { Ok(()) } else { Err(SdfError::TooMany { place: element.place() }) }
    }
}
