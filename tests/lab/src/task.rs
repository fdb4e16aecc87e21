//! An entry of the laboratory: its name, its arguments, and its run.

use clap::{ArgMatches, Command};
use skein_sim::cli::Exit;

/// An experiment, a campaign or a benchmark.
pub trait Task: clap::Args {
    const NAME: &'static str;
    /// One line for the help.
    const ABOUT: &'static str;
    /// Not in the help: a process that another task starts.
    const HIDDEN: bool = false;

    /// Runs, and prints the result: as one JSON object, or for people.
    ///
    /// # Errors
    /// The reason why it cannot be run.
    fn run(&self, as_json: bool) -> anyhow::Result<Exit>;
}

/// A task in the list of its kind.
pub struct Entry {
    pub name: &'static str,
    pub command: fn() -> Command,
    pub run: fn(&ArgMatches, bool) -> anyhow::Result<Exit>,
}

impl Entry {
    #[must_use]
    pub const fn of<T: Task>() -> Self {
        Self {
            name: T::NAME,
            command: || T::augment_args(Command::new(T::NAME)).about(T::ABOUT).hide(T::HIDDEN),
            run: |arguments, as_json| T::from_arg_matches(arguments)?.run(as_json),
        }
    }
}
