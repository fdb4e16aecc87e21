//! Gazebo worlds: the Simulation Description Format (SDF), as far as it matters to where it is safe to fly.
//!
//! Models, included ones too, their frames and solids stand where Gazebo has them, or where the `<state>` of
//! a saved world has them; actors walk. What makes a file wrong is an error with its place. What is solid and
//! cannot be read is refused, by name, in the [`Account`]: [`Reading::whole`] gives no scene then. Everything
//! stands still but actors, whether static or not.

mod account;
mod actor;
mod error;
mod frames;
mod geometry;
mod include;
mod model;
mod place;
mod reader;
mod stand;
mod state;
mod text;
mod tree;
mod world;

use std::fmt;

pub use account::{Account, Entry, Verdict};
pub use error::SdfError;
pub use place::Place;

use self::reader::Reader;
use self::text::Source;
use crate::files::Files;
use crate::scene::Scene;

/// Models may nest this deep.
const DEPTH_LIMIT: usize = 32;
/// Models, links, frames and solids of a world.
const MOST_PARTS: usize = 200_000;
/// Refusals that an error names.
const NAMED: usize = 8;

/// A world as it was read.
#[derive(Debug, Clone)]
pub struct Reading {
    scene: Scene,
    /// The parts of the file that the scene has, and those that it lacks.
    pub account: Account,
}

/// A world that lacks something, and the account of it.
#[derive(Debug, Clone)]
pub struct Lacking(pub Account);

impl fmt::Display for Lacking {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut told = 0;
        for entry in self.0.refused().take(NAMED) {
            writeln!(f, "{entry}")?;
            told += entry.count;
        }
        match self.0.count_refused().saturating_sub(told) {
            0 => {}
            more => writeln!(f, "and {more} more")?,
        }
        write!(
            f,
            "the world lacks what is named here; put it there, or fly without it with --without-missing"
        )
    }
}

impl std::error::Error for Lacking {}

impl Reading {
    /// The scene, if it has all that is solid in the file.
    ///
    /// # Errors
    /// All that it lacks.
    pub fn whole(self) -> Result<(Scene, Account), Lacking> {
        match self.account.count_refused() {
            0 => Ok((self.scene, self.account)),
            _ => Err(Lacking(self.account)),
        }
    }

    /// The scene as it is, though solids may be missing.
    pub fn without_missing(self) -> (Scene, Account) {
        (self.scene, self.account)
    }
}

impl Scene {
    /// Reads a Gazebo world (or a bare model) from the text of an SDF file; `source_name` is what messages
    /// call it and where `files` begins to look for what it names.
    ///
    /// # Errors
    /// The first fault in a file.
    pub fn from_sdf(text: &str, source_name: &str, files: &dyn Files) -> Result<Reading, SdfError> {
        let mut reader = Reader::new(files);
        let scene = Source::new(source_name, text).read(|root| reader.read_root(root))?;
        Ok(Reading { scene, account: reader.account })
    }
}
