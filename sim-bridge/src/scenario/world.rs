//! World files of others, each read as what its name ends in.

use std::path::Path;

use skein_world::{Account, Scene};

use super::{ScenarioError, read};
use crate::model_folders::ModelFolders;

/// A world that was read from a file.
#[derive(Debug, Clone)]
pub struct ReadWorld {
    pub scene: Scene,
    /// The fate of the elements of a Gazebo world; empty of others.
    pub account: Account,
}

impl ReadWorld {
    /// Lines for people on what counts for nothing, and on what is missing.
    pub fn notes(&self) -> Vec<String> {
        let left_out = self.account.refused().map(|entry| format!("{entry}; left out"));
        self.account.notes().map(ToString::to_string).chain(left_out).collect()
    }
}

/// Reads a Gazebo world, a `.csv` of boxes, a mesh (`.obj`) or a point cloud (`.pcd`, `.ply`);
/// `without_missing` if it may lack what cannot be read.
///
/// # Errors
/// The first fault in a file; all that is solid and cannot be read.
pub fn read_world(path: &Path, without_missing: bool) -> Result<ReadWorld, ScenarioError> {
    let name = path.display().to_string();
    let kind = path.extension().map(|kind| kind.to_string_lossy().to_lowercase()).unwrap_or_default();
    let plain = |scene| ReadWorld { scene, account: Account::default() };
    match kind.as_str() {
        "csv" => Ok(plain(Scene::from_csv(&read(path)?, &name)?)),
        "obj" | "pcd" | "ply" => {
            let bytes = std::fs::read(path)
                .map_err(|cause| ScenarioError::Unreadable { path: path.to_owned(), cause })?;
            Ok(plain(Scene::from_measured(&bytes, &name)?))
        }
        _ => {
            let reading = Scene::from_sdf(&read(path)?, &name, &ModelFolders::of(path))?;
            let (scene, account) = if without_missing {
                reading.without_missing()
            } else {
                reading.whole().map_err(Box::new)?
            };
            Ok(ReadWorld { scene, account })
        }
    }
}
