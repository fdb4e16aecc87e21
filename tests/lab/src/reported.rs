//! An experiment as a task: its report is printed, and written with its figures.

use std::path::PathBuf;

use clap::Args;
use skein_sim::cli::Exit;

use crate::report::Report;
use crate::task::Task;

/// A published experiment, run again.
pub trait Experiment: Args {
    const NAME: &'static str;
    /// One line for the help and the report.
    const ABOUT: &'static str;

    /// Runs, and compares the result with what must be reached.
    ///
    /// # Errors
    /// The reason why it cannot be run.
    fn run(&self) -> anyhow::Result<Report>;
}

#[derive(Args)]
pub struct Reported<E: Experiment> {
    #[command(flatten)]
    experiment: E,
    /// Folder for report.json and figures; `out/<name>` if not given.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl<E: Experiment> Task for Reported<E> {
    const NAME: &'static str = E::NAME;
    const ABOUT: &'static str = E::ABOUT;

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let report = self.experiment.run()?;
        let out = self.out.clone().unwrap_or_else(|| PathBuf::from("out").join(E::NAME));
        let written = report.write(&out)?;
        if as_json {
            println!("{}", report.to_json());
        } else {
            println!("{}: {}\n{report}", E::NAME, E::ABOUT);
            for path in written {
                println!("written: {}", path.display());
            }
        }
        Ok(Exit::of(report.is_reached()))
    }
}
