//! The command line of `skein-lab`, made from the lists of tasks.

use anyhow::Context as _;
use clap::{Arg, ArgAction, ArgMatches, Command};
use skein_sim::cli::Exit;

use crate::task::Entry;
use crate::{bench, campaign, experiment};

struct Kind {
    name: &'static str,
    about: &'static str,
    tasks: &'static [Entry],
}

const KINDS: [Kind; 3] = [
    Kind {
        name: "experiment",
        about: "Run a published experiment again, as tables and plots: exit 1 if something that it must reach was missed",
        tasks: experiment::TASKS,
    },
    Kind {
        name: "campaign",
        about: "Run something many times with faults, and judge it: exit 1 if anything was violated",
        tasks: campaign::TASKS,
    },
    Kind { name: "bench", about: "Measure something, and print it", tasks: bench::TASKS },
];

const JSON: &str = "json";

#[must_use]
pub fn command() -> Command {
    let json = Arg::new(JSON).long(JSON).global(true).action(ArgAction::SetTrue);
    let choice = |name| Command::new(name).subcommand_required(true).arg_required_else_help(true);
    let kinds = KINDS.map(|kind| {
        let tasks = kind.tasks.iter().map(|task| (task.command)());
        choice(kind.name).about(kind.about).subcommand_value_name("NAME").subcommands(tasks)
    });
    choice("skein-lab")
        .version(env!("CARGO_PKG_VERSION"))
        .about("Skein's laboratory: experiments, campaigns, benchmarks")
        .after_help("Exit codes: 0 done, 1 goal missed or promise violated, 2 wrong usage or input.")
        .arg(json.help("Print one JSON object on standard output and nothing else there"))
        .subcommands(kinds)
}

#[must_use]
pub fn is_json(arguments: &ArgMatches) -> bool {
    arguments.get_flag(JSON)
}

/// Runs the task that the command line names.
///
/// # Errors
/// The reason why it cannot be run.
pub fn run(arguments: &ArgMatches) -> anyhow::Result<Exit> {
    let (kind, rest) = arguments.subcommand().context("no kind of task is named")?;
    let (name, rest) = rest.subcommand().context("no task is named")?;
    let tasks = KINDS.iter().filter(|known| known.name == kind).flat_map(|kind| kind.tasks);
    let task = tasks.into_iter().find(|task| task.name == name).context("no such task")?;
    (task.run)(rest, is_json(arguments))
}

#[cfg(test)]
mod tests {
    use clap::error::ErrorKind;

    use super::*;

    #[test]
    fn the_definition_is_sound() {
        command().debug_assert();
    }

    #[test]
    fn help_lists_what_there_is_but_for_helping_processes() {
        let help = |kind: &str| {
            let asked = command().try_get_matches_from(["skein-lab", kind, "--help"]).expect_err("help");
            assert_eq!(asked.kind(), ErrorKind::DisplayHelp);
            asked.to_string()
        };
        for kind in &KINDS {
            let help = help(kind.name);
            for task in kind.tasks {
                assert_eq!(help.contains(&format!("\n  {} ", task.name)), !(task.command)().is_hide_set());
            }
        }
        assert!(!help("bench").contains("fleet-of"));
    }

    #[test]
    fn wrong_usage_exits_with_2() {
        for line in [
            "skein-lab",
            "skein-lab experiment",
            "skein-lab experiment dance",
            "skein-lab experiment circle --runs 0",
            "skein-lab experiment circle --vehicles 3",
            "skein-lab bench fleet --seconds nan",
            "skein-lab bench plan --map M",
            "skein-lab campaign network --break G10",
            "skein-lab fly open",
        ] {
            let error = command().try_get_matches_from(line.split(' ')).expect_err("wrong usage");
            assert_eq!(error.exit_code(), 2, "{line}");
        }
    }
}
