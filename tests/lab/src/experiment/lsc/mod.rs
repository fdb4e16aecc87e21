//! LSC-DR's missions (Park 2022): ten vehicles in forests and mazes, each with its own plan and a radio of 3 m.

mod flight;
mod pilot;
mod tracking;

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::Args;
use nalgebra::Vector3;
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use skein_sim::mission::{LscAgent, LscMission};
use skein_sim::scenario::read_world;
use skein_world::{Aabb, Scene};

use self::flight::{Flown, Space, fly};
use crate::figure::{Figure, Line, Style};
use crate::numbers::one_or_more;
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::runs;
use crate::statistics::mean;

/// Families of missions: their name, where missions and worlds are, and how many there are.
const FAMILIES: [Family; 2] = [
    Family { name: "forest10", mission: "missions/forest10/forest10_", world: "world/forest/forest" },
    Family { name: "maze10_dense", mission: "missions/maze10_dense/maze10_", world: "world/maze/dense/maze" },
];
const MISSIONS_PER_FAMILY: usize = 15;
/// The published flights (`published.csv`): mission, flight time in s, mean planning time in ms.
const PUBLISHED: [(&str, f64, f64); 2] = [("forest10_10", 15.8, 8.256), ("maze10_dense_1", 51.2, 5.290)];
/// Least distance of two centres, m.
const LEAST_SEPARATION_M: f64 = 0.3;

struct Family {
    name: &'static str,
    mission: &'static str,
    world: &'static str,
}

/// One mission with its world.
#[derive(Clone)]
struct Setting {
    name: String,
    mission: LscMission,
    scene: Scene,
}

#[derive(Args)]
pub struct Lsc {
    /// The folder of LSC-DR's missions and worlds.
    #[arg(long, value_name = "DIR")]
    dir: Option<PathBuf>,
    /// The first N missions of each family.
    #[arg(long, value_name = "N", default_value_t = MISSIONS_PER_FAMILY, value_parser = one_or_more())]
    runs: usize,
}

impl Experiment for Lsc {
    const NAME: &'static str = "lsc";
    const ABOUT: &'static str = "LSC-DR's ten-agent missions in forests and dense mazes (Park 2022)";

    fn run(&self) -> anyhow::Result<Report> {
        let dir = self.dir.as_deref().context("say where LSC-DR's missions and worlds are with --dir")?;
        let settings = settings(dir, self.runs)?;
        let planar = fly_all("planar missions", &settings, Space::Planar)?;
        let spatial = fly_all("spatial missions", &settings, Space::Spatial)?;
        let shuffled_settings = shuffled(&settings);
        let shuffled = fly_all("planar missions, goals shuffled", &shuffled_settings, Space::Planar)?;
        let mut report = Report::default();
        report.number("missions", planar.len());
        report.number("succeeded", succeeded(&planar));
        report.number("planar", rows(&settings, &planar));
        report.number("spatial_succeeded", succeeded(&spatial));
        report.number("spatial", rows(&settings, &spatial));
        report.number("shuffled_succeeded", succeeded(&shuffled));
        report.number("shuffled", rows(&shuffled_settings, &shuffled));
        table(&mut report, "At the height of the starts", &settings, &planar);
        table(&mut report, "At any height", &settings, &spatial);
        table(&mut report, "At the height of the starts, goals shuffled", &shuffled_settings, &shuffled);
        goals(&mut report, &settings, &planar);
        for (setting, flown) in settings.iter().zip(&planar) {
            if published(&setting.name).is_some() {
                report.figure(&setting.name, map(setting, flown));
            }
        }
        Ok(report)
    }
}

/// The first missions of each family.
fn settings(dir: &Path, runs: usize) -> anyhow::Result<Vec<Setting>> {
    let missions =
        FAMILIES.iter().flat_map(|family| (1..=runs.min(MISSIONS_PER_FAMILY)).map(move |k| (family, k)));
    missions
        .map(|(family, k)| {
            let path = |stem: &str, extension: &str| dir.join(format!("{stem}{k}.{extension}"));
            let (mission_path, world_path): (PathBuf, PathBuf) =
                (path(family.mission, "json"), path(family.world, "csv"));
            let text = std::fs::read_to_string(&mission_path)
                .with_context(|| format!("{}: cannot be read", mission_path.display()))?;
            let mission = LscMission::read(&text, &mission_path.display().to_string())?;
            let scene = read_world(&world_path, false)?.scene;
            Ok(Setting { name: format!("{}_{k}", family.name), mission, scene })
        })
        .collect()
}

/// The same with goals dealt out among the agents anew, by a seed for each.
fn shuffled(settings: &[Setting]) -> Vec<Setting> {
    let mut shuffled = settings.to_vec();
    for (setting, seed) in shuffled.iter_mut().zip(1..) {
        let agents = &mut setting.mission.agents;
        let mut goals: Vec<_> = agents.iter().map(|agent| agent.goal).collect();
        goals.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
        for (agent, goal) in agents.iter_mut().zip(goals) {
            agent.goal = goal;
        }
        setting.name += ", shuffled";
    }
    shuffled
}

/// Each mission has a seed of its own, which is its place in the list.
fn fly_all(what: &str, settings: &[Setting], space: Space) -> anyhow::Result<Vec<Flown>> {
    let cases: Vec<(&Setting, u64)> = settings.iter().zip(1..).collect();
    runs::in_turn(what, &cases, |(setting, seed)| {
        fly(&setting.mission, &setting.scene, space, *seed).with_context(|| setting.name.clone())
    })
}

fn succeeded(flown: &[Flown]) -> usize {
    flown.iter().filter(|flown| flown.reason.is_none()).count()
}

fn rows(settings: &[Setting], flown: &[Flown]) -> Value {
    let row = |(setting, flown): (&Setting, &Flown)| {
        json!({
            "name": setting.name,
            "succeeded": flown.reason.is_none(),
            "reason": flown.reason,
            "flight_time_s": flown.flight_time_s,
            "distance_m": flown.distance_m,
            "min_separation_m": flown.min_separation_m,
            "min_clearance_m": flown.min_clearance_m,
            "min_to_bounds_m": flown.min_to_bounds_m,
            "max_speed_m_s": flown.max_speed_m_s,
            "max_accel_m_s2": flown.max_accel_m_s2,
            "max_error_m": flown.max_error_m,
            "plan_ms": { "mean": mean(&flown.plan_ms), "max": greatest(&flown.plan_ms) },
        })
    };
    settings.iter().zip(flown).map(row).collect()
}

fn table(report: &mut Report, title: &str, settings: &[Setting], flown: &[Flown]) {
    let heads = [
        "mission",
        "",
        "time (s)",
        "published",
        "way (m)",
        "apart (m)",
        "clear (m)",
        "plan (ms)",
        "at most",
        "published",
    ];
    let rows = settings.iter().zip(flown).map(|(setting, flown)| {
        let published = published(&setting.name);
        vec![
            setting.name.clone(),
            flown.reason.clone().unwrap_or_else(|| "arrived".to_owned()),
            format!("{:.1}", flown.flight_time_s),
            published.map(|(time_s, _)| format!("{time_s:.1}")).unwrap_or_default(),
            format!("{:.0}", flown.distance_m),
            format!("{:.3}", flown.min_separation_m),
            format!("{:.3}", flown.min_clearance_m),
            format!("{:.2}", mean(&flown.plan_ms)),
            format!("{:.1}", greatest(&flown.plan_ms)),
            published.map(|(_, plan_ms)| format!("{plan_ms:.2}")).unwrap_or_default(),
        ]
    });
    report.table(title, &heads, rows);
}

fn goals(report: &mut Report, settings: &[Setting], flown: &[Flown]) {
    let least = |of: fn(&Flown) -> f64| flown.iter().map(of).fold(f64::INFINITY, f64::min);
    report.goal("missions that succeed", succeeded(flown) as f64, Bound::Exactly(settings.len() as f64));
    report.goal(
        "least separation, m",
        least(|flown| flown.min_separation_m),
        Bound::AtLeast(LEAST_SEPARATION_M),
    );
    report.goal("least clearance, m", least(|flown| flown.min_clearance_m), Bound::AtLeast(0.0));
    report.goal(
        "least distance from the bounds, m",
        least(|flown| flown.min_to_bounds_m),
        Bound::AtLeast(0.0),
    );
    let over = |command: fn(&Flown) -> f64, limit: fn(&LscMission) -> f64| {
        let shares =
            settings.iter().zip(flown).map(|(setting, flown)| command(flown) / limit(&setting.mission));
        shares.fold(0.0, f64::max)
    };
    report.goal(
        "commanded speed over its limit",
        over(|flown| flown.max_speed_m_s, |mission| least_limit(mission, |agent| agent.max_speed_m_s)),
        Bound::AtMost(1.0 + ROUNDING),
    );
    report.goal(
        "commanded acceleration over its limit",
        over(|flown| flown.max_accel_m_s2, |mission| least_limit(mission, |agent| agent.max_accel_m_s2)),
        Bound::AtMost(1.0 + ROUNDING),
    );
    for (setting, flown) in settings.iter().zip(flown) {
        if let Some((time_s, _)) = published(&setting.name) {
            let found = if flown.reason.is_none() { flown.flight_time_s } else { f64::NAN };
            report.goal(&format!("{}: flight time, s", setting.name), found, Bound::Below(time_s));
        }
    }
}

/// Of divisions and differences.
const ROUNDING: f64 = 1e-9;

fn least_limit(mission: &LscMission, of: fn(&LscAgent) -> Vector3<f64>) -> f64 {
    mission.agents.iter().map(|agent| of(agent).min()).fold(f64::INFINITY, f64::min)
}

/// Flight time in s and planning time in ms of a mission whose flight is published.
fn published(name: &str) -> Option<(f64, f64)> {
    PUBLISHED.iter().find(|(known, ..)| *known == name).map(|(_, time_s, plan_ms)| (*time_s, *plan_ms))
}

fn map(setting: &Setting, flown: &Flown) -> Figure {
    let Aabb { min, max } = setting.mission.bounds;
    let corners = [(min.x, min.y), (max.x, min.y), (max.x, max.y), (min.x, max.y), (min.x, min.y)];
    let bounds = Line { name: String::new(), style: Style::Reference, points: corners.to_vec() };
    let obstacles = setting.scene.obstacles().iter().map(|obstacle| Line {
        name: String::new(),
        style: Style::Filled,
        points: obstacle.footprint().into_iter().map(|[x, y]| (x, y)).collect(),
    });
    let tracks = flown.tracks.iter().map(|track| Line {
        name: String::new(),
        style: Style::Solid,
        points: track.iter().map(|position| (position.x, position.y)).collect(),
    });
    Figure {
        x: "east (m)".to_owned(),
        y: "north (m)".to_owned(),
        is_map: true,
        lines: std::iter::once(bounds).chain(obstacles).chain(tracks).collect(),
    }
}

fn greatest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use skein_world::Obstacle;

    use super::*;

    const SWAP: &str = r#"{
        "quadrotors": { "small": {
            "max_vel": [1.0, 1.0, 1.0], "max_acc": [2.0, 2.0, 2.0], "radius": 0.15, "downwash": 2.0 } },
        "world": [{ "dimension": [-2.0, -1.3, 0.0, 2.0, 1.3, 2.5] }],
        "agents": [ # Two on each side of a wall with a gap for one.
            { "type": "small", "start": [-1.5, 0.5, 1], "goal": [1.5, -0.5, 1] },
            { "type": "small", "start": [-1.5, -0.5, 1], "goal": [1.5, 0.5, 1] },
            { "type": "small", "start": [1.5, 0.5, 1], "goal": [-1.5, -0.5, 1] },
            { "type": "small", "start": [1.5, -0.5, 1], "goal": [-1.5, 0.5, 1] }
        ]
    }"#;

    fn wall_with_a_gap() -> Setting {
        let half = |name, y| Obstacle::block(name, Vector3::new(0.0, y, 1.25), Vector3::new(0.5, 1.0, 2.5));
        Setting {
            name: "swap".to_owned(),
            mission: LscMission::read(SWAP, "swap.json").expect("a mission"),
            scene: Scene::new("wall", vec![half("south", -0.8), half("north", 0.8)]),
        }
    }

    #[test]
    fn four_swap_sides_through_a_gap_for_one() {
        let setting = wall_with_a_gap();
        let flown = fly(&setting.mission, &setting.scene, Space::Planar, 1).expect("it can be flown");
        let mut report = Report::default();
        goals(&mut report, &[setting], &[flown]);
        assert!(report.is_reached(), "{report}");
    }

    #[test]
    fn a_start_between_two_cells_is_refused_by_name() {
        let mut setting = wall_with_a_gap();
        setting.mission.agents[1].start.x += 0.2;
        let refused = fly(&setting.mission, &setting.scene, Space::Planar, 1).err().map(|e| e.to_string());
        assert!(refused.is_some_and(|error| error.starts_with("agent 2: its start is 0.20 m off")));
    }

    #[test]
    fn without_a_folder_it_says_what_it_needs() {
        let refused = Lsc { dir: None, runs: 1 }.run().err().map(|error| error.to_string());
        assert!(refused.is_some_and(|error| error.contains("--dir")));
    }
}
