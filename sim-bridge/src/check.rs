//! `check`: whether a scenario, world or mission file is sound, and what of it is read over.

use std::fmt;
use std::path::Path;

use serde::Serialize;
use skein_agent::AgentCore;
use skein_bp::behaviour::Behaviours;
use skein_world::sdf::Entry;
use skein_world::{Account, Scene};
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

use crate::element::{Element, Verdict};
use crate::fly::agent_configs;
use crate::mission::{self, MissionSet};
use crate::scenario::{Named, Overrides, Scenario, ScenarioError, read_world};

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
    /// The fate of each element of a world or mission file.
    pub elements: Vec<Element>,
}

impl fmt::Display for Findings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: a sound {}: {}", self.file, self.kind, self.holds)?;
        self.warnings.iter().try_for_each(|warning| write!(f, "\nwarning: {warning}"))
    }
}

/// Reads a file as what its extension says it is: a world (`.sdf`, `.world`, `.csv`, `.obj`, `.pcd`, `.ply`),
/// a mission (`.plan`, `.waypoints`, `.kml`, `.geojson`, `.json`), or else a scenario, with what `allowed` lifts.
pub fn check(file: &Path, allowed: &Overrides, known: &Behaviours) -> Result<Findings, ScenarioError> {
    let elements;
    let (kind, holds, warnings) = match () {
        () if is_world(file) => {
            let read = read_world(file, allowed.without_missing)?;
            elements = world_elements(&read.account);
            ("world", world(&read.scene), read.notes())
        }
        () if is_mission(file) => {
            elements = mission_elements(file, allowed);
            let set = mission::read_files(&[file.to_owned()], None, allowed.allowances)?;
            ("mission", missions(&set), notes(file, &set, allowed, known)?)
        }
        () => {
            let scenario = Scenario::open_with(&file.to_string_lossy(), allowed, 1, known)?;
            if !allowed.thin_solids {
                scenario.check_thin_solids()?;
            }
            check_scripts(&scenario)?;
            elements = scenario_elements(file, allowed, None);
            let vehicles = counted(scenario.vehicles.len(), "vehicle");
            let holds = format!("{vehicles}, {}", world(&scenario.scene));
            ("scenario", holds, scenario.notes)
        }
    };
    Ok(Findings { file: file.display().to_string(), kind, holds, warnings, elements })
}

/// The fate of each element of a file that is not sound, for this reason; none of one that is too broken to have any.
pub fn elements(file: &Path, allowed: &Overrides, error: &ScenarioError) -> Vec<Element> {
    match (is_mission(file), error) {
        (true, _) => mission_elements(file, allowed),
        (false, ScenarioError::Lacking(lacking)) if is_world(file) => world_elements(&lacking.0),
        _ if is_world(file) => Vec::new(),
        _ => scenario_elements(file, allowed, Some(error)),
    }
}

fn is_world(file: &Path) -> bool {
    matches!(extension(file).as_deref(), Some("sdf" | "world" | "csv" | "obj" | "pcd" | "ply"))
}

fn is_mission(file: &Path) -> bool {
    matches!(
        extension(file).as_deref(),
        Some("plan" | "waypoints" | "mission" | "txt" | "json" | "geojson" | "kml")
    )
}

fn mission_elements(file: &Path, allowed: &Overrides) -> Vec<Element> {
    mission::account_of(file, None, allowed.allowances).map(|account| account.elements).unwrap_or_default()
}

/// The fate of a scenario's own fields and tables, and of each element of the world and missions that it names.
fn scenario_elements(file: &Path, allowed: &Overrides, fault: Option<&ScenarioError>) -> Vec<Element> {
    let own = own_elements(file, fault);
    let Named { world, missions } = Named::by(file);
    let world = allowed.world.clone().or(world);
    let of_world = match (&world, fault) {
        (Some(_), Some(ScenarioError::Lacking(lacking))) => world_elements(&lacking.0),
        (Some(path), _) => {
            read_world(path, true).map(|read| world_elements(&read.account)).unwrap_or_default()
        }
        (None, _) => Vec::new(),
    };
    let missions = missions.iter().chain(&allowed.missions);
    let of_missions = missions.flat_map(|path| {
        let here = |element| Element { file: Some(path.display().to_string()), ..element };
        mission_elements(path, allowed).into_iter().map(here)
    });
    own.into_iter().chain(of_world).chain(of_missions).collect()
}

/// The fields and tables at the top of a scenario's file. What it may not say is refused by the reader; the rest is
/// honoured.
fn own_elements(file: &Path, fault: Option<&ScenarioError>) -> Vec<Element> {
    let Ok(text) = std::fs::read_to_string(file) else { return Vec::new() };
    let Ok(table) = DeTable::parse(&text) else { return Vec::new() };
    let (faulty, message) = match fault {
        Some(
            ScenarioError::Malformed { field, message, .. }
            | ScenarioError::Contradiction { field, message, .. },
        ) => (field.split(['.', '[']).next().unwrap_or_default(), message.as_str()),
        _ => ("", ""),
    };
    let element = |(name, value): (&Spanned<DeString<'_>>, &Spanned<DeValue<'_>>)| {
        let what = name.get_ref().to_string();
        let is_at_fault = !faulty.is_empty() && what == faulty;
        let tables = value.get_ref().as_array().filter(|all| all.iter().all(|one| one.get_ref().is_table()));
        Element {
            file: None,
            line: text[..name.span().start].matches('\n').count() + 1,
            verdict: if is_at_fault { Verdict::Refused } else { Verdict::Honoured },
            why: if is_at_fault { message.to_owned() } else { String::new() },
            count: tables.map_or(1, |tables| tables.len().max(1)),
            what,
        }
    };
    let mut elements: Vec<_> = table.get_ref().iter().map(element).collect();
    elements.sort_by_key(|element| element.line);
    elements
}

fn extension(file: &Path) -> Option<String> {
    file.extension().map(|extension| extension.to_string_lossy().to_lowercase())
}

/// What `fly` says of a mission that is drawn on the earth, over open ground.
fn notes(
    file: &Path,
    set: &MissionSet,
    allowed: &Overrides,
    known: &Behaviours,
) -> Result<Vec<String>, ScenarioError> {
    if set.datum.is_none() {
        return Ok(set.warnings.iter().map(ToString::to_string).collect());
    }
    let missions = vec![file.to_owned()];
    let vehicles = (set.missions.len() == 1).then_some(1);
    let overrides = Overrides { vehicles, missions, ..allowed.clone() };
    Ok(Scenario::open_with("open", &overrides, 1, known)?.notes)
}

/// What became of the elements of a world file.
fn world_elements(account: &Account) -> Vec<Element> {
    let element = |entry: &Entry| Element {
        what: entry.element.clone(),
        file: Some(entry.place.source_name.to_string()),
        line: entry.place.line as usize,
        verdict: match entry.verdict {
            skein_world::Verdict::Honoured => Verdict::Honoured,
            skein_world::Verdict::Harmless => Verdict::Harmless,
            skein_world::Verdict::Refused => Verdict::Refused,
        },
        why: entry.note.clone(),
        count: entry.count,
    };
    account.entries.iter().map(element).collect()
}

fn world(scene: &Scene) -> String {
    let size = scene.bounds().max - scene.bounds().min;
    let obstacles = counted(scene.obstacles().len(), "obstacle");
    format!("{obstacles} in {:.0} x {:.0} x {:.0} m", size.x, size.y, size.z)
}

fn missions(set: &MissionSet) -> String {
    let waypoints: usize = set.missions.iter().map(|m| m.waypoints.len()).sum();
    let areas = set.airspace.stay_inside.iter().map(|zone| zone.any_of.len()).sum();
    let more = [
        (set.airspace.no_fly.len() + set.airspace.prisms.len(), "no-fly zone"),
        (areas, "fence"),
        (set.rally.len(), "rally point"),
    ];
    let more = more
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!(", {}", counted(*count, what)));
    let more: String = more.collect();
    format!("{} with {} in all{more}", counted(set.missions.len(), "route"), counted(waypoints, "waypoint"))
}

/// So many of them, in words: `1 obstacle`, `2 obstacles`.
fn counted(number: usize, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}

/// The vehicles try their scripts out before they fly.
fn check_scripts(scenario: &Scenario) -> Result<(), ScenarioError> {
    let scripted = agent_configs(scenario).into_iter().filter(|config| !config.scripts.is_empty());
    for config in scripted {
        let vehicle = config.node.clone();
        AgentCore::new(config).map_err(|why| ScenarioError::Agent { vehicle, why })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(file: &Path) -> Result<Findings, ScenarioError> {
        super::check(file, &Overrides::default(), &Behaviours::default())
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
            ("world", "1 obstacle in 100 x 100 x 21 m")
        );
        assert_eq!(check(&mission)?.holds, "1 route with 1 waypoint in all");
        assert_eq!(check(&scenario)?.holds, "4 vehicles, 1 obstacle in 100 x 100 x 21 m");
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
        let allowed = Overrides { thin_solids: true, ..Overrides::default() };
        assert!(super::check(&path, &allowed, &Behaviours::default()).is_ok());
        for (height_m, thickness_m, model) in
            [(4.2, 0.1, "x500-vertical-scanner"), (4.2, 0.2, "x500"), (4.7, 0.1, "x500"), (0.05, 0.1, "x500")]
        {
            bar(height_m, thickness_m, model)?;
            assert!(check(&path).is_ok(), "{height_m} m, {thickness_m} m, {model}");
        }
        Ok(())
    }

    #[test]
    fn a_world_that_lacks_a_model_is_unsound_unless_it_is_allowed_to()
    -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("w.sdf");
        let barn = "<include><uri>model://barn</uri></include><light name='l' type='point'/>";
        std::fs::write(&path, format!("<sdf version='1.9'><world name='w'>\n{barn}</world></sdf>"))?;
        let Err(error) = check(&path) else { panic!("it lacks a barn") };
        assert!(error.to_string().contains("w.sdf:2:1: included model `model://barn` is not there"));
        let verdict = |elements: Vec<Element>, name: &str| {
            elements.into_iter().find(|element| element.what == name).map(|element| element.verdict)
        };
        let unsound = elements(&path, &Overrides::default(), &error);
        assert_eq!(verdict(unsound, "world/include"), Some(Verdict::Refused));
        let allowed = Overrides { without_missing: true, ..Overrides::default() };
        let findings = super::check(&path, &allowed, &Behaviours::default())?;
        assert!(findings.warnings.iter().any(|warning| warning.contains("barn")), "{:?}", findings.warnings);
        assert_eq!(verdict(findings.elements.clone(), "world/light"), Some(Verdict::Harmless));
        assert_eq!(verdict(findings.elements, "sdf/world"), Some(Verdict::Honoured));
        Ok(())
    }

    #[test]
    fn a_script_that_no_vehicle_would_run_is_refused_as_fly_refuses_it()
    -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("s.toml");
        std::fs::write(&path, "generator = \"open\"\n[[script]]\nfile = \"grab.toml\"\n")?;
        let script = |event: &str| {
            let body = format!("[[body]]\nsync = {{ request = \"{{me}}/{event}\" }}\n");
            std::fs::write(folder.path().join("grab.toml"), format!("name = \"grab\"\nabout = \"x\"\n{body}"))
        };
        script("airborne")?;
        let error = check(&path).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(error.contains("uav/1") && error.contains("script `grab`"), "{error}");
        let scenario =
            Scenario::from_toml(&std::fs::read_to_string(&path)?, &path.to_string_lossy(), None, 1)?;
        let refused = AgentCore::new(agent_configs(&scenario).remove(0)).err().map(|e| e.to_string());
        assert!(refused.is_some_and(|refused| error.contains(&refused)), "what `fly` says");
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
