//! World files of others, each read as what its name ends in.

use std::path::Path;

use skein_world::{Account, Scene};

use super::{ScenarioError, read};
use crate::model_folders::ModelFolders;

/// A world that was read from a file.
#[derive(Debug, Clone)]
pub struct ReadWorld {
    pub scene: Scene,
    /// What became of the elements of a Gazebo world; empty of others.
    pub account: Account,
}

impl ReadWorld {
    /// Lines for people on what counts for nothing, and on what is missing.
    pub fn notes(&self) -> Vec<String> {
        let left_out = self.account.refused().map(|entry| format!("{entry}; left out"));
        self.account.notes().map(ToString::to_string).chain(left_out).collect()
    }
}

/// Reads a Gazebo world, or a `.csv` of boxes; `without_missing` if it may lack what cannot be read.
///
/// # Errors
/// The first fault in a file; all that is solid and cannot be read.
pub fn read_world(path: &Path, without_missing: bool) -> Result<ReadWorld, ScenarioError> {
    let text = read(path)?;
    let name = path.display().to_string();
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
        return Ok(ReadWorld { scene: Scene::from_csv(&text, &name)?, account: Account::default() });
    }
    let reading = Scene::from_sdf(&text, &name, &ModelFolders::of(path))?;
    let (scene, account) =
        if without_missing { reading.without_missing() } else { reading.whole().map_err(Box::new)? };
    Ok(ReadWorld { scene, account })
}
