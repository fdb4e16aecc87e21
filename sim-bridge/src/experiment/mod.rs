//! `experiment`: the published experiments, run again, as tables and plots, each beside what it must reach.
//!
//! An experiment is a file here, named in [`EXPERIMENTS`].

mod ablation;
mod circle;
mod dstar_grid;
mod feasibility;
mod figure;
mod lsc;
mod naive_right_of_way;
mod performance;
mod report;
mod right_of_way;
mod runs;
mod sphere;
mod statistics;
mod swarm_planning;
mod vfh;

use std::path::PathBuf;

use anyhow::Context as _;

pub use self::figure::{Figure, Line, Style};
pub use self::report::{Bound, Report};
use crate::cli;

/// An experiment that can be run.
pub struct Experiment {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it reproduces, in a line.
    pub about: &'static str,
    run: fn(&Options) -> anyhow::Result<Report>,
}

pub const EXPERIMENTS: &[Experiment] = &[
    Experiment {
        name: "feasibility",
        about: "whether it navigates: b-threads loaded or not, obstacles or none (Wang 2023, table 1)",
        run: feasibility::run,
    },
    Experiment {
        name: "performance",
        about: "b-threads against one sequential loop in 500 random worlds (Wang 2023, table 2)",
        run: performance::run,
    },
    Experiment {
        name: "vfh",
        about: "dense cylinders by vector field histogram, at a speed that follows the scene (Xu 2023)",
        run: vfh::run,
    },
    Experiment {
        name: "circle",
        about: "a circle by cascade PID: variable integral against a plain one (Zhang 2019)",
        run: circle::run,
    },
    Experiment {
        name: "ablation",
        about: "what each layer of the pipeline contributes: forests, a crossing and a window without it",
        run: ablation::run,
    },
    Experiment {
        name: "right-of-way",
        about: "one vehicle at a time through a window: blocks that are confirmed, and the naive rule beside them",
        run: right_of_way::run,
    },
    Experiment {
        name: "sphere",
        about: "a hundred vehicles through the middle of a sphere, beside ORCA",
        run: sphere::run,
    },
    Experiment {
        name: "dstar-grid",
        about: "D* with a collision factor on the marker grid, and re-planning by D* Lite (Zhang 2019)",
        run: dstar_grid::run,
    },
    Experiment {
        name: "lsc",
        about: "LSC-DR's ten-agent missions in forests and dense mazes (Park 2022)",
        run: lsc::run,
    },
    Experiment {
        name: "swarm-planning",
        about: "twenty vehicles plan to ten targets among mountains and threats: particle swarms compared (P3)",
        run: swarm_planning::run,
    },
];

/// What the command line says to an experiment. What is not given is the experiment's own.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Options {
    /// How many runs.
    pub runs: Option<usize>,
    /// How many vehicles.
    pub vehicles: Option<usize>,
    /// Where published data lies.
    pub dir: Option<PathBuf>,
}

/// Runs an experiment, prints what came of it, and writes its figures and `report.json`. Returns whether everything
/// that it must reach was reached.
///
/// # Errors
/// What keeps it from being run, or its files from being written.
pub fn run(args: &cli::Experiment, as_json: bool) -> anyhow::Result<bool> {
    let experiment =
        EXPERIMENTS.iter().find(|known| known.name == args.name).context("no such experiment")?;
    let options = Options { runs: args.runs, vehicles: args.vehicles, dir: args.dir.clone() };
    let report = (experiment.run)(&options)?;
    let out = args.out.clone().unwrap_or_else(|| PathBuf::from("out").join(experiment.name));
    let written = report.write(&out)?;
    if as_json {
        println!("{}", report.to_json());
    } else {
        println!("{}: {}\n{report}", experiment.name, experiment.about);
        for path in written {
            println!("written: {}", path.display());
        }
    }
    Ok(report.is_reached())
}
