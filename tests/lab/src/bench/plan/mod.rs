//! Searches on published maps: how often they find a way, how long it is beside the shortest, and what that takes.

pub mod movingai;
#[cfg(feature = "peers")]
mod peer;

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use serde::Serialize;
#[cfg(feature = "peers")]
use serde_json::json;
use skein_planning::global::{DStarLite, Effort, Route, Search, Unsolved};
use skein_planning::grid::{Grid, StepCosts};
use skein_sim::cli::Exit;

use self::movingai::Problem;
use crate::cpu_time;
use crate::numbers::one_or_more;
use crate::quantile::quantile;
use crate::task::Task;

/// Published lengths have six digits or more: within this share, and this many cells, a length is the published one.
const SAME_LENGTH: (f64, f64) = (5e-6, 1e-8);

/// The spread of a measure over many searches.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Spread {
    pub median: f64,
    pub p95: f64,
    pub p99: f64,
    pub max: f64,
}

impl Spread {
    pub fn of(mut values: Vec<f64>) -> Spread {
        values.sort_by(f64::total_cmp);
        let [median, p95, p99, max] = [0.5, 0.95, 0.99, 1.0].map(|share| quantile(&values, share));
        Spread { median, p95, p99, max }
    }
}

/// The results of a map's problems.
#[derive(Debug, Serialize)]
struct Result {
    planner: Planner,
    problems: usize,
    /// A way was found and is proven to keep the bound.
    solved: usize,
    /// Of those, of the published length.
    optimal: usize,
    /// Greatest length of those over the published one.
    worst_ratio: f64,
    /// They are all proven to cost at most so many times the least.
    bound: f64,
    /// A way was found, but the budget was spent before the bound was proven.
    unproven: usize,
    /// Greatest length of those over the published one.
    worst_unproven_ratio: Option<f64>,
    expanded: Spread,
    /// Of processor time.
    ms: Spread,
}

/// Which search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
enum Planner {
    /// A*: the shortest way.
    Astar,
    /// Weighted A*: a way within the bound.
    Weighted,
    /// Anytime repairing A*: better ways until one is within the bound or the budget is spent.
    Budgeted,
    /// D* Lite: the shortest way, from scratch.
    DstarLite,
}

#[derive(Args)]
pub struct Plan {
    /// A map of the Moving AI lab's (.map), or a voxel map (.3dmap).
    #[arg(long, value_name = "FILE", requires = "scen", required_unless_present = "peers")]
    map: Option<PathBuf>,
    /// Its problems, with their optimal lengths (.scen, .3dscen).
    #[arg(long, value_name = "FILE", requires = "map")]
    scen: Option<PathBuf>,
    /// Which search.
    #[arg(long, value_enum, default_value_t = Planner::Astar)]
    planner: Planner,
    /// Only the first so many problems.
    #[arg(long, value_name = "N")]
    limit: Option<usize>,
    /// Most cost of a way of `weighted` or `budgeted`, as a multiple of the least.
    #[arg(long, value_name = "X", default_value_t = 1.05, value_parser = at_least_one)]
    bound: f64,
    /// Most cells to expand for a problem; without end if not given, but for `budgeted`.
    #[arg(long, value_name = "N", value_parser = one_or_more())]
    budget: Option<usize>,
    /// Beside the `pathfinding` crate instead, on random grids and on the map if one is given (cargo feature `peers`).
    #[arg(long)]
    peers: bool,
}

impl Task for Plan {
    const NAME: &'static str = "plan";
    const ABOUT: &'static str = "Searches on published maps, beside their published lengths";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let (grid, problems) = match (&self.map, &self.scen) {
            (Some(map), Some(scen)) => read(map, scen)?,
            _ => return peers(None, as_json),
        };
        let problems = &problems[..self.limit.unwrap_or(usize::MAX).min(problems.len())];
        if self.peers {
            return peers(Some((&grid, problems)), as_json);
        }
        let result = measure(self, &grid, problems)?;
        if as_json {
            println!("{}", serde_json::to_string(&result)?);
            return Ok(Exit::Done);
        }
        let Result { planner, problems, solved, optimal, worst_ratio, bound, unproven, expanded, ms, .. } =
            result;
        let planner = planner.to_possible_value();
        let planner = planner.as_ref().map_or("", PossibleValue::get_name);
        println!("{planner}: {solved} of {problems} problems solved within {bound:.4} times the least");
        println!("{optimal} of them at the published length; at worst {worst_ratio:.4} times that");
        if unproven > 0 {
            println!("{unproven} more found a way, but spent the budget before proving the bound");
        }
        for (what, Spread { median, p95, p99, max }, digits) in
            [("cells expanded", expanded, 0), ("ms of processor time", ms, 3)]
        {
            println!(
                "{what}: median {median:.digits$}, p95 {p95:.digits$}, p99 {p99:.digits$}, max {max:.digits$}"
            );
        }
        Ok(Exit::Done)
    }
}

/// Reads a map and its problems; errors name file, line and what was expected.
fn read(map: &Path, scen: &Path) -> anyhow::Result<(Grid, Vec<Problem>)> {
    let text = |file: &Path| {
        std::fs::read_to_string(file).with_context(|| format!("{}: cannot be read as text", file.display()))
    };
    let wrong = |file: &Path, error: movingai::FormatError| anyhow::anyhow!("{}: {error}", file.display());
    let cells = movingai::map(&text(map)?).map_err(|error| wrong(map, error))?;
    let problems = movingai::problems(&text(scen)?, &cells).map_err(|error| wrong(scen, error))?;
    Ok((Grid { cells, costs: StepCosts::EUCLIDEAN }, problems))
}

fn measure(args: &Plan, grid: &Grid, problems: &[Problem]) -> anyhow::Result<Result> {
    let effort = effort(args);
    let mut search = Search::default();
    let (mut expanded, mut ms) = (Vec::new(), Vec::new());
    let (mut proven, mut unproven) = (Vec::new(), Vec::new());
    for problem in problems {
        let (found, took_ms) =
            cpu_time::measured_ms(|| solve(args.planner, grid, problem, effort, &mut search))?;
        ms.push(took_ms);
        expanded.push(match &found {
            Ok(route) => route.expanded,
            Err(Unsolved::Unreachable { expanded } | Unsolved::Spent { expanded, .. }) => *expanded,
        } as f64);
        if let Ok(route) = found {
            let kept = route.bound <= effort.bound;
            if kept { &mut proven } else { &mut unproven }.push((route, problem.length));
        }
    }
    Ok(Result {
        planner: args.planner,
        problems: problems.len(),
        solved: proven.len(),
        optimal: proven.iter().filter(|(route, length)| is_length(route.cost, *length)).count(),
        worst_ratio: worst_ratio(&proven).unwrap_or(1.0),
        bound: proven.iter().map(|(route, _)| route.bound).fold(1.0, f64::max),
        unproven: unproven.len(),
        worst_unproven_ratio: worst_ratio(&unproven),
        expanded: Spread::of(expanded),
        ms: Spread::of(ms),
    })
}

fn effort(args: &Plan) -> Effort {
    let budget = args.budget.unwrap_or(usize::MAX);
    match args.planner {
        Planner::Astar | Planner::DstarLite => Effort { budget, ..Effort::OPTIMAL },
        Planner::Weighted => Effort { budget, ..Effort::weighted(args.bound) },
        Planner::Budgeted => Effort::budgeted(args.bound, args.budget.unwrap_or(Effort::IN_A_TICK)),
    }
}

fn solve(
    planner: Planner,
    grid: &Grid,
    problem: &Problem,
    effort: Effort,
    search: &mut Search,
) -> std::result::Result<Route, Unsolved> {
    match planner {
        Planner::DstarLite => DStarLite::new(grid, problem.start, problem.goal).plan(grid, effort.budget),
        Planner::Astar | Planner::Weighted | Planner::Budgeted => {
            search.solve(grid, problem.start, problem.goal, effort)
        }
    }
}

fn at_least_one(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() && number >= 1.0 => Ok(number),
        _ => Err("expected a number, 1 or more".to_owned()),
    }
}

fn is_length(found: f64, published: f64) -> bool {
    let (share, cells) = SAME_LENGTH;
    (found - published).abs() <= share * published + cells
}

fn worst_ratio(routes: &[(Route, f64)]) -> Option<f64> {
    let ratios = routes.iter().map(
        |(route, length)| {
            if is_length(route.cost, *length) { 1.0 } else { route.cost / length }
        },
    );
    ratios.max_by(f64::total_cmp)
}

#[cfg(not(feature = "peers"))]
fn peers(_: Option<(&Grid, &[Problem])>, _: bool) -> anyhow::Result<Exit> {
    anyhow::bail!("built without the cargo feature `peers`, which `--peers` needs")
}

#[cfg(feature = "peers")]
fn peers(published: Option<(&Grid, &[Problem])>, as_json: bool) -> anyhow::Result<Exit> {
    let cases = peer::run(published)?;
    if as_json {
        println!("{}", json!({ "cases": cases }));
    } else {
        cases.iter().for_each(|case| println!("{case}"));
    }
    Ok(Exit::Done)
}
