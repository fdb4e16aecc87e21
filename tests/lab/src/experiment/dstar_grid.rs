//! Zhang 2019: D* with a collision factor, and elision, on the marker grid; and what D* is for, planning again
//! when the map changes, beside a search from scratch.

use std::fmt;

use clap::Args;
use nalgebra::Vector3;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use serde_json::json;
use skein_planning::Path;
use skein_planning::global::{DStarLite, Effort, Route, Search, Unsolved, elide_collinear};
use skein_planning::grid::{Grid, OccupancyGrid, SizeError, StepCosts};
use skein_planning::map::VoxelIndex;

use crate::cpu_time;
use crate::figure::{Figure, Line, Style};
use crate::numbers::one_or_more;
use crate::quantile::{median, quantile};
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::runs;

/// Cells along a side of the marker grid.
pub(super) const MARKERS: usize = 10;
/// Its blocked cells, a reconstruction: the paper's picture is not legible.
pub(super) const BLOCKED: [usize; 9] = [24, 32, 33, 34, 42, 45, 46, 47, 57];
/// The ends of the published routes.
const ENDS: [usize; 2] = [3, 66];
/// The published routes, by the cells' numbers, row by row from 1.
const PLAIN: [usize; 7] = [3, 14, 25, 35, 44, 55, 66];
const IMPROVED: [usize; 9] = [3, 4, 15, 26, 35, 44, 54, 65, 66];
const ELIDED: [usize; 7] = [3, 4, 26, 44, 54, 65, 66];

/// The map that changes, in cells of one metre.
const SIZE: [usize; 3] = [200, 200, 40];
/// Most distance of a change from the vehicle, m.
const REACH_M: f64 = 10.0;
/// The vehicle moves on by a cell after so many changes.
const CHANGES_PER_STEP: usize = 4;
const RUNS: usize = 1;
/// Changes from one line of progress to the next.
const CHANGES_PER_LINE: usize = 100;
/// Least speed-up of planning again over a fresh search, by the medians.
const SPEEDUP: f64 = 10.0;
/// Two sums of the same costs in different order differ by less.
const SAME_COST: f64 = 1e-6;

#[derive(Args)]
pub struct DstarGrid {
    /// Runs of each world, whose seeds are 1 to N.
    #[arg(long, value_name = "N", default_value_t = RUNS, value_parser = one_or_more())]
    runs: usize,
}

impl Experiment for DstarGrid {
    const NAME: &'static str = "dstar-grid";
    const ABOUT: &'static str =
        "D* with a collision factor on the marker grid, and re-planning by D* Lite (Zhang 2019)";

    fn run(&self) -> anyhow::Result<Report> {
        let mut report = Report::default();
        routes(&mut report)?;
        replanning(&mut report, self.runs)?;
        Ok(report)
    }
}

/// The cell with a number on the marker grid.
pub(super) fn marker(number: usize) -> VoxelIndex {
    VoxelIndex { x: (number - 1) % MARKERS, y: (number - 1) / MARKERS, z: 0 }
}

/// The way across the marker grid at these costs.
fn cross(costs: StepCosts) -> anyhow::Result<Vec<VoxelIndex>> {
    let mut grid = Grid { cells: OccupancyGrid::new([MARKERS, MARKERS, 1])?, costs };
    BLOCKED.iter().for_each(|number| grid.cells.set_blocked(marker(*number), true));
    let [start, goal] = ENDS.map(marker);
    Ok(DStarLite::new(&grid, start, goal).plan(&grid, usize::MAX)?.cells)
}

/// The ends of the straight parts of the way that a vehicle may fly: no corner of a blocked cell is cut.
pub(super) fn flying_route() -> Vec<VoxelIndex> {
    cross(StepCosts::FLYING).map(|cells| elided(&cells)).unwrap_or_default()
}

/// The waypoints that are flown of a route: of collinear ones the ends.
fn elided(cells: &[VoxelIndex]) -> Vec<VoxelIndex> {
    let points = cells.iter().map(|cell| Vector3::new(cell.x as f64, cell.y as f64, 0.0)).collect();
    let kept = Path::new(points).map(|path| elide_collinear(&path));
    let points = kept.iter().flat_map(|path| path.points());
    points.map(|at| VoxelIndex { x: at.x as usize, y: at.y as usize, z: 0 }).collect()
}

/// The published routes, and one that a vehicle may fly.
fn routes(report: &mut Report) -> anyhow::Result<()> {
    let numbers =
        |cells: &[VoxelIndex]| cells.iter().map(|cell| cell.y * MARKERS + cell.x + 1).collect::<Vec<_>>();
    let (plain, improved) = (cross(StepCosts::ZHANG_PLAIN)?, cross(StepCosts::ZHANG_IMPROVED)?);
    let (elided, flying) = (elided(&improved), cross(StepCosts::FLYING)?);
    let rows = [
        ("plain D*", &plain, Some(PLAIN.as_slice())),
        ("improved", &improved, Some(&IMPROVED)),
        ("improved and elided", &elided, Some(&ELIDED)),
        ("improved, no corner cut", &flying, None),
    ];
    for (name, cells, published) in rows {
        if let Some(published) = published {
            let is_same = numbers(cells) == published;
            report.goal(&format!("{name}: the published route"), f64::from(is_same), Bound::Exactly(1.0));
        }
    }
    let text =
        |cells: &[VoxelIndex]| numbers(cells).iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
    report.table(
        "Routes on the marker grid",
        &["", "route"],
        rows.map(|(name, cells, _)| vec![name.to_owned(), text(cells)]),
    );
    report.number(
        "routes",
        json!({
            "plain": numbers(&plain),
            "improved": numbers(&improved),
            "elided": numbers(&elided),
            "flying": numbers(&flying),
        }),
    );
    let at = |cell: &VoxelIndex| (cell.x as f64 + 0.5, MARKERS as f64 - 0.5 - cell.y as f64);
    let mut lines: Vec<Line> = BLOCKED
        .iter()
        .map(|number| {
            let (x, y) = at(&marker(*number));
            let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)];
            let points = corners.map(|(dx, dy)| (x + dx, y + dy)).to_vec();
            Line { name: String::new(), style: Style::Filled, points }
        })
        .collect();
    for (name, cells, _) in rows {
        let points = cells.iter().map(at).collect();
        lines.push(Line { name: name.to_owned(), style: Style::Solid, points });
    }
    report.figure("routes", Figure { x: "cell".into(), y: "row".into(), is_map: true, lines });
    Ok(())
}

/// A map that a vehicle crosses while it changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum World {
    /// Walls every 25 m with two windows in each, and clutter.
    Rooms,
    /// A fifth of the cells blocked, at random.
    Clutter,
}

/// All of them.
const WORLDS: [World; 2] = [World::Rooms, World::Clutter];

impl World {
    fn name(self) -> &'static str {
        match self {
            Self::Rooms => "rooms",
            Self::Clutter => "clutter",
        }
    }

    /// Changes in a run. In rooms, where nearly all of the map is nearer than the goal, searches from scratch take so
    /// long that there are fewer.
    fn changes(self) -> usize {
        match self {
            Self::Rooms => 250,
            Self::Clutter => 1000,
        }
    }

    fn cells(self, rng: &mut ChaCha8Rng) -> Result<OccupancyGrid, SizeError> {
        let mut cells = OccupancyGrid::new(SIZE)?;
        let clutter = if self == Self::Rooms { 0.03 } else { 0.2 };
        for cell in all_cells() {
            cells.set_blocked(cell, rng.random::<f64>() < clutter);
        }
        if self == Self::Rooms {
            for wall in (25..SIZE[0]).step_by(25) {
                for (y, z) in (0..SIZE[1]).flat_map(|y| (0..SIZE[2]).map(move |z| (y, z))) {
                    cells.set_blocked(VoxelIndex { x: wall, y, z }, true);
                }
                for _ in 0..2 {
                    let (low_y, low_z) = (rng.random_range(0..SIZE[1] - 6), rng.random_range(0..SIZE[2] - 6));
                    for (y, z) in (0..6).flat_map(|y| (0..6).map(move |z| (low_y + y, low_z + z))) {
                        cells.set_blocked(VoxelIndex { x: wall, y, z }, false);
                    }
                }
            }
        }
        Ok(cells)
    }
}

fn all_cells() -> impl Iterator<Item = VoxelIndex> {
    let [nx, ny, nz] = SIZE;
    (0..nx * ny * nz).map(move |n| VoxelIndex { x: n % nx, y: n / nx % ny, z: n / (nx * ny) })
}

/// Times to plan again after each change, in milliseconds of processor time.
#[derive(Debug, Default)]
struct Times {
    again: Vec<f64>,
    fresh: Vec<f64>,
    /// The plan before the first change, from scratch by D* Lite.
    first: Vec<f64>,
    unreachable: usize,
    /// Greatest difference between the costs of the two.
    apart: f64,
}

/// A vehicle on its way.
struct Flight {
    grid: Grid,
    at: VoxelIndex,
    goal: VoxelIndex,
    rng: ChaCha8Rng,
    incremental: DStarLite,
    scratch: Search,
    times: Times,
}

impl Flight {
    fn new(world: World, seed: u64) -> anyhow::Result<Flight> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut grid = Grid { cells: world.cells(&mut rng)?, costs: StepCosts::FLYING };
        let at = VoxelIndex { x: 2, y: 2, z: 2 };
        let goal = VoxelIndex { x: SIZE[0] - 3, y: SIZE[1] - 3, z: SIZE[2] - 3 };
        [at, goal].into_iter().for_each(|cell| grid.cells.set_blocked(cell, false));
        let incremental = DStarLite::new(&grid, at, goal);
        let (scratch, times) = (Search::default(), Times::default());
        let mut flight = Flight { grid, at, goal, rng, incremental, scratch, times };
        // Memory that later searches find ready is not part of what they are measured by.
        let _ = flight.fresh();
        flight.set_out(goal)?;
        Ok(flight)
    }

    /// Turns to a goal, and plans to it for the first time.
    fn set_out(&mut self, goal: VoxelIndex) -> anyhow::Result<()> {
        self.goal = goal;
        self.grid.cells.set_blocked(goal, false);
        self.incremental = DStarLite::new(&self.grid, self.at, goal);
        let (_, ms) = cpu_time::measured_ms(|| self.incremental.plan(&self.grid, usize::MAX))?;
        self.times.first.push(ms);
        Ok(())
    }

    fn fresh(&mut self) -> Result<Route, Unsolved> {
        self.scratch.solve(&self.grid, self.at, self.goal, Effort::OPTIMAL)
    }

    /// Changes the map, plans again by both, compares, and moves on.
    fn step(&mut self, number: usize, route: &mut Vec<VoxelIndex>) -> anyhow::Result<()> {
        let changed = self.change(route);
        let (again, again_ms) = cpu_time::measured_ms(|| {
            self.incremental.move_to(self.at);
            self.incremental.heed(&self.grid, &changed);
            self.incremental.plan(&self.grid, usize::MAX)
        })?;
        let (fresh, fresh_ms) = cpu_time::measured_ms(|| self.fresh())?;
        self.times.again.push(again_ms);
        self.times.fresh.push(fresh_ms);
        match (again, fresh) {
            (Ok(again), Ok(fresh)) => {
                self.times.apart = self.times.apart.max((again.cost - fresh.cost).abs());
                *route = again.cells;
            }
            (Err(_), Err(_)) => {
                self.times.unreachable += 1;
                route.clear();
            }
            (again, fresh) => {
                anyhow::bail!(
                    "one of the searches finds a way where the other finds none: {again:?}, {fresh:?}"
                )
            }
        }
        if number.is_multiple_of(CHANGES_PER_STEP) && route.len() > 1 {
            route.remove(0);
            self.at = route[0];
        }
        if self.at == self.goal {
            let [x, y, z] = SIZE.map(|side| self.rng.random_range(0..side));
            self.set_out(VoxelIndex { x, y, z })?;
        }
        Ok(())
    }

    /// Blocks or frees a cube of 1 to 3 m within reach of the vehicle, every second time on the way ahead. Returns
    /// the cells that are not as they were.
    fn change(&mut self, route: &[VoxelIndex]) -> Vec<VoxelIndex> {
        let blocks = self.rng.random::<bool>();
        let edge = self.rng.random_range(1..=3_usize);
        let reach = REACH_M as usize;
        let ahead = route.get(self.rng.random_range(2..reach)).copied();
        let near = |at: usize, by: usize| (at + by).saturating_sub(reach);
        let [dx, dy, dz] = [0; 3].map(|_: usize| self.rng.random_range(0..=2 * reach));
        let around = VoxelIndex { x: near(self.at.x, dx), y: near(self.at.y, dy), z: near(self.at.z, dz) };
        let low = if self.rng.random::<bool>() { ahead.unwrap_or(around) } else { around };
        let mut changed = Vec::new();
        for n in 0..edge * edge * edge {
            let by = [n % edge, n / edge % edge, n / (edge * edge)];
            let cell = VoxelIndex { x: low.x + by[0], y: low.y + by[1], z: low.z + by[2] };
            let is_kept = [self.at, self.goal].contains(&cell) || !self.grid.cells.contains(cell);
            if !is_kept && self.is_within_reach(cell) && self.grid.cells.is_blocked(cell) != blocks {
                self.grid.cells.set_blocked(cell, blocks);
                changed.push(cell);
            }
        }
        changed
    }

    fn is_within_reach(&self, cell: VoxelIndex) -> bool {
        let place = |cell: VoxelIndex| Vector3::new(cell.x as f64, cell.y as f64, cell.z as f64);
        (place(cell) - place(self.at)).norm() <= REACH_M
    }
}

/// Of processor time, in milliseconds.
#[derive(Debug, Clone, Copy, Serialize)]
struct Spread {
    median: f64,
    mean: f64,
    p95: f64,
    p99: f64,
    max: f64,
}

impl Spread {
    fn of(times_ms: &[f64]) -> Spread {
        let mut sorted = times_ms.to_vec();
        sorted.sort_by(f64::total_cmp);
        let [median, p95, p99, max] = [0.5, 0.95, 0.99, 1.0].map(|share| quantile(&sorted, share));
        let mean = sorted.iter().sum::<f64>() / sorted.len().max(1) as f64;
        Spread { median, mean, p95, p99, max }
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Spread { median, mean, p95, max, .. } = self;
        write!(f, "{median:.3} / {mean:.3} / {p95:.3} / {max:.1}")
    }
}

/// The results of all changes in a world that a seed has made.
struct Run {
    world: World,
    seed: u64,
    times: Times,
    again: Spread,
    fresh: Spread,
}

impl Run {
    fn of(world: World, seed: u64) -> anyhow::Result<Run> {
        let changes = world.changes();
        let mut flight = Flight::new(world, seed)?;
        let mut route = Vec::new();
        for number in 1..=changes {
            flight.step(number, &mut route)?;
            if number.is_multiple_of(CHANGES_PER_LINE) {
                eprintln!("dstar-grid: {}, seed {seed}: {number} of {changes} changes", world.name());
            }
        }
        let times = flight.times;
        let [again, fresh] = [&times.again, &times.fresh].map(|times| Spread::of(times));
        Ok(Run { world, seed, times, again, fresh })
    }

    /// The speed-up of planning again, by the medians.
    fn speedup(&self) -> f64 {
        self.fresh.median / self.again.median
    }

    fn name(&self) -> String {
        format!("{}, seed {}", self.world.name(), self.seed)
    }

    fn set_goals(&self, report: &mut Report) {
        let apart = format!("{}: greatest difference from a fresh search's cost", self.name());
        report.goal(&apart, self.times.apart, Bound::AtMost(SAME_COST));
        let speedup = format!("{}: times as fast, medians", self.name());
        report.goal(&speedup, self.speedup(), Bound::AtLeast(SPEEDUP));
    }

    fn row(&self) -> Vec<String> {
        vec![
            self.name(),
            self.times.again.len().to_string(),
            self.again.to_string(),
            self.fresh.to_string(),
            format!("{:.0}", self.speedup()),
            format!("{:.1}", self.fresh.mean / self.again.mean),
            format!("{:.0}", self.times.first.first().copied().unwrap_or_default()),
            self.times.unreachable.to_string(),
        ]
    }

    fn to_json(&self) -> serde_json::Value {
        let Times { again, fresh, first, unreachable, apart } = &self.times;
        let ratios = again.iter().zip(fresh).map(|(again, fresh)| fresh / again).collect();
        json!({
            "seed": self.seed,
            "changes": again.len(),
            "replan_ms": self.again,
            "fresh_ms": self.fresh,
            "first_ms": first,
            "speedup_of_medians": self.speedup(),
            "median_speedup": median(ratios),
            "speedup_of_means": self.fresh.mean / self.again.mean,
            "unreachable": unreachable,
            "cost_apart": apart,
        })
    }
}

/// Re-planning after each of many changes near a moving vehicle.
fn replanning(report: &mut Report, runs: usize) -> anyhow::Result<()> {
    let seeds = 1..=runs as u64;
    let cases: Vec<(World, u64)> = seeds.flat_map(|seed| WORLDS.map(|world| (world, seed))).collect();
    let all = runs::in_turn("dstar-grid", &cases, |(world, seed)| Run::of(*world, *seed))?;
    let mut rows = Vec::new();
    let mut figure = Figure {
        x: "time to plan again (log10 of ms)".into(),
        y: "share of changes".into(),
        ..Figure::default()
    };
    let mut worlds = serde_json::Map::new();
    for world in WORLDS {
        let here: Vec<&Run> = all.iter().filter(|run| run.world == world).collect();
        here.iter().for_each(|run| run.set_goals(report));
        rows.extend(here.iter().map(|run| run.row()));
        let worst = here.iter().map(|run| run.speedup()).fold(f64::INFINITY, f64::min);
        let seeds: Vec<_> = here.iter().map(|run| run.to_json()).collect();
        worlds.insert(world.name().to_owned(), json!({ "seeds": seeds, "worst_speedup_of_medians": worst }));
        let again = here.iter().flat_map(|run| run.times.again.iter().copied()).collect();
        let fresh = here.iter().flat_map(|run| run.times.fresh.iter().copied()).collect();
        for (name, style, times) in
            [("D* Lite", Style::Solid, again), ("A* from scratch", Style::Reference, fresh)]
        {
            let points = distribution(times);
            figure.lines.push(Line { name: format!("{name}, {}", world.name()), style, points });
        }
    }
    report.number("replanning", worlds);
    report.table(
        "Planning again after a change within 10 m of the vehicle, on 200 x 200 x 40 m in cells of 1 m; ms of processor time",
        &["", "changes", "D* Lite: median / mean / p95 / max", "A* from scratch", "medians", "means", "first plan", "no way"],
        rows,
    );
    report.figure("replanning", figure);
    Ok(())
}

/// The share of values below each of a hundred of them.
fn distribution(mut values: Vec<f64>) -> Vec<(f64, f64)> {
    values.sort_by(f64::total_cmp);
    let shares = (1..100).map(|percent| f64::from(percent) / 100.0);
    shares.map(|share| (quantile(&values, share).max(1e-6).log10(), share)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_three_routes_are_the_published_ones() {
        let mut report = Report::default();
        routes(&mut report).unwrap();
        assert!(report.is_reached(), "{report}");
        assert_eq!(report.to_json()["routes"]["elided"], json!(ELIDED));
    }

    #[test]
    fn planning_again_costs_what_a_fresh_plan_costs() {
        let mut flight = Flight::new(World::Clutter, 7).unwrap();
        let mut route = Vec::new();
        for number in 1..=8 {
            flight.step(number, &mut route).unwrap();
        }
        assert!(flight.times.apart <= SAME_COST, "{}", flight.times.apart);
        assert_eq!(flight.times.again.len(), 8);
        assert_ne!(flight.at, VoxelIndex { x: 2, y: 2, z: 2 }, "it moves");
    }
}
