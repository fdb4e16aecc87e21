//! `check`: whether a scenario, world or mission file is sound, and what of it is read over.

use std::fmt;
use std::path::Path;

use serde::Serialize;
use skein_bp::behaviour::Behaviours;
use skein_world::Scene;

use crate::element::Element;
use crate::mission::{self, Allowances, MissionSet};
use crate::scenario::{Overrides, Scenario, ScenarioError, read_world};

/// The findings in a sound file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Findings {
    /// The file, or the name of the built-in scenario.
    pub file: String,
    /// `scenario`, `world` or `mission`.
    pub kind: &'static str,
    /// Its content, in words.
    pub holds: String,
    /// Parts that have no effect or give way.
    pub warnings: Vec<String>,
    /// What becomes of each of its elements.
    pub elements: Vec<Element>,
}

impl fmt::Display for Findings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: a sound {}: {}", self.file, self.kind, self.holds)?;
        self.warnings.iter().try_for_each(|warning| write!(f, "\nwarning: {warning}"))
    }
}

/// Reads a file as what its extension says it is: a world (`.sdf`, `.world`, `.csv`), a mission (`.plan`, `.waypoints`,
/// `.kml`, `.geojson`, `.json`), or else a scenario; `thin_solids` may be in its way.
pub fn check(
    file: &Path,
    allowances: Allowances,
    thin_solids: bool,
    known: &Behaviours,
) -> Result<Findings, ScenarioError> {
    let extension = extension(file);
    let (kind, holds, warnings) = match extension.as_deref() {
        Some("sdf" | "world" | "csv") => {
            let (scene, warnings) = read_world(file)?;
            ("world", world(&scene), warnings)
        }
        Some("plan" | "waypoints" | "mission" | "txt" | "json" | "geojson" | "kml") => {
            let set = mission::read_files(&[file.to_owned()], None, allowances)?;
            ("mission", missions(&set), notes(file, &set, allowances, known)?)
        }
        _ => {
            let overrides = Overrides { thin_solids, allowances, ..Overrides::default() };
            let scenario = Scenario::open_with(&file.to_string_lossy(), &overrides, 1, known)?;
            if !thin_solids {
                scenario.check_thin_solids()?;
            }
            let holds = format!("{} vehicles, {}", scenario.vehicles.len(), world(&scenario.scene));
            ("scenario", holds, scenario.notes)
        }
    };
    Ok(Findings {
        file: file.display().to_string(),
        kind,
        holds,
        warnings,
        elements: elements(file, allowances),
    })
}

/// What becomes of each element of a file, sound or not; none of one that is too broken to have any.
pub fn elements(file: &Path, allowances: Allowances) -> Vec<Element> {
    if !matches!(
        extension(file).as_deref(),
        Some("plan" | "waypoints" | "mission" | "txt" | "json" | "geojson" | "kml")
    ) {
        return Vec::new();
    }
    mission::account_of(file, None, allowances).map(|account| account.elements).unwrap_or_default()
}

fn extension(file: &Path) -> Option<String> {
    file.extension().map(|extension| extension.to_string_lossy().to_lowercase())
}

/// What `fly` says of a mission that is drawn on the earth, over open ground.
fn notes(
    file: &Path,
    set: &MissionSet,
    allowances: Allowances,
    known: &Behaviours,
) -> Result<Vec<String>, ScenarioError> {
    if set.datum.is_none() {
        return Ok(set.warnings.iter().map(ToString::to_string).collect());
    }
    let missions = vec![file.to_owned()];
    let vehicles = (set.missions.len() == 1).then_some(1);
    let overrides = Overrides { vehicles, missions, allowances, ..Overrides::default() };
    Ok(Scenario::open_with("open", &overrides, 1, known)?.notes)
}

fn world(scene: &Scene) -> String {
    let size = scene.bounds().max - scene.bounds().min;
    let obstacles = scene.obstacles().len();
    format!("{obstacles} obstacles in {:.0} x {:.0} x {:.0} m", size.x, size.y, size.z)
}

fn missions(set: &MissionSet) -> String {
    let waypoints: usize = set.missions.iter().map(|m| m.waypoints.len()).sum();
    let areas = set.airspace.stay_inside.iter().map(|zone| zone.any_of.len()).sum();
    let more = [
        (set.airspace.no_fly.len() + set.airspace.prisms.len(), "no-fly zones"),
        (areas, "areas to stay inside of"),
        (set.rally.len(), "rally points"),
    ];
    let more = more.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!(", {count} {what}"));
    let more: String = more.collect();
    format!("{} routes with {waypoints} waypoints in all{more}", set.missions.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(file: &Path) -> Result<Findings, ScenarioError> {
        super::check(file, Allowances::default(), false, &Behaviours::default())
    }

    #[test]
    fn each_kind_of_file_is_known_by_its_extension() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let put = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).map(|()| path)
        };
        let world = put("w.csv", "10,0,2.5,1,1,5\n")?;
        let mission = put("m.json", r#"{"agents": [{"start": [0, 0, 1], "goal": [5, 1, 1]}]}"#)?;
        let scenario = put("s.toml", "generator = \"open\"\nworld = \"w.csv\"\n")?;
        assert_eq!(
            (check(&world)?.kind, check(&world)?.holds.as_str()),
            ("world", "1 obstacles in 100 x 100 x 21 m")
        );
        assert_eq!(check(&mission)?.holds, "1 routes with 1 waypoints in all");
        assert_eq!(check(&scenario)?.holds, "4 vehicles, 1 obstacles in 100 x 100 x 21 m");
        assert_eq!(check(Path::new("forest"))?.kind, "scenario");
        Ok(())
    }

    #[test]
    fn what_a_planar_lidar_does_not_see_is_named_unless_that_is_taken_on()
    -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("s.toml");
        let bar = |height_m: f64, thickness_m: f64, model: &str| {
            let text = format!(
                "model = \"{model}\"\n[[vehicle]]\nstart_m = [0, 0]\nwaypoints_m = [[20, 0, 3.5]]\n\
                 [[obstacle]]\nname = \"bar\"\ncentre_m = [9, 0, {height_m}]\nbox_m = [0.1, 8, {thickness_m}]\n"
            );
            std::fs::write(&path, text)
        };
        bar(4.2, 0.1, "x500")?;
        let error = check(&path).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(
            error.contains("`bar` (0.100 m, from 4.15 to 4.25 m") && error.contains("--thin-solids"),
            "{error}"
        );
        assert!(super::check(&path, Allowances::default(), true, &Behaviours::default()).is_ok());
        for (height_m, thickness_m, model) in
            [(4.2, 0.1, "x500-vertical-scanner"), (4.2, 0.2, "x500"), (4.7, 0.1, "x500"), (0.05, 0.1, "x500")]
        {
            bar(height_m, thickness_m, model)?;
            assert!(check(&path).is_ok(), "{height_m} m, {thickness_m} m, {model}");
        }
        Ok(())
    }

    #[test]
    fn what_is_wrong_with_a_file_is_the_error() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("m.plan");
        std::fs::write(&path, "{\n\"mission\": {}}")?;
        let error = check(&path).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(error.contains("m.plan:2: field `mission`"), "{error}");
        Ok(())
    }
}
