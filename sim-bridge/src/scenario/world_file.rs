//! World files: Gazebo SDF, or a list of boxes.

use std::path::Path;

use skein_world::Scene;

use super::{ScenarioError, read};

/// Reads a Gazebo world, or a `.csv` of boxes; returns what of it could not be read as lines for people.
pub fn read_world(path: &Path) -> Result<(Scene, Vec<String>), ScenarioError> {
    let text = read(path)?;
    let name = path.display().to_string();
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
        return Ok((Scene::from_csv(&text, &name)?, Vec::new()));
    }
    let (scene, warnings) = Scene::from_sdf(&text, &name)?;
    Ok((scene, warnings.iter().map(ToString::to_string).collect()))
}
