//! The program that flies swarms on one host: see `skein-sim --help`.

use std::path::Path;
use std::process::ExitCode;

use anyhow::Context as _;
use clap::Parser as _;
use serde_json::json;
use skein_bp::behaviour::Behaviours;

use crate::cli::{self, Cli, Command, Exit};
use crate::mission::write;
use crate::scenario::{Overrides, Scenario, ScenarioError};
use crate::summary::Summary;
use crate::{check, fly, rehearse};

/// Runs the program, with the behaviours that `add` adds to it: vehicles' and ground stations'.
pub fn main(add: impl FnOnce(&mut Behaviours)) -> ExitCode {
    let mut known = Behaviours::default();
    add(&mut known);
    #[cfg(feature = "zenoh")]
    {
        skein_zenoh::share_threads();
        skein_zenoh::log("warn", true);
    }
    let cli = Cli::parse();
    let exit = run(&cli, &known).unwrap_or_else(|error| {
        let message = format!("{error:#}");
        if cli.json {
            println!("{}", json!({ "error": message }));
        }
        eprintln!("skein-sim: {message}");
        Exit::WrongInput
    });
    exit.into()
}

fn run(cli: &Cli, known: &Behaviours) -> anyhow::Result<Exit> {
    match &cli.command {
        Command::Fly(args) => {
            let summary = fly::run(args, known)?;
            show(&summary, cli.json)?;
            Ok(Exit::of(summary.succeeded))
        }
        #[cfg(feature = "zenoh")]
        Command::Serve(args) => {
            let summary = crate::serve::run(args, known, cli.json)?;
            show(&summary, cli.json)?;
            Ok(Exit::Done)
        }
        #[cfg(feature = "zenoh")]
        Command::Configure(args) => crate::configure::run(args, known, cli.json).map(|()| Exit::Done),
        #[cfg(not(feature = "zenoh"))]
        Command::Serve(_) | Command::Configure(_) => {
            anyhow::bail!("built without the cargo feature `zenoh`, which this needs")
        }
        Command::Plan(args) => plan(args, known, cli.json).map(|()| Exit::Done),
        Command::Rehearse { file } => {
            let rehearsed = rehearse::run(file.as_deref())?;
            println!("{}", serde_json::to_string_pretty(&rehearsed)?);
            Ok(Exit::of(rehearsed.succeeded))
        }
        Command::List => {
            list(cli.json);
            Ok(Exit::Done)
        }
        Command::Check { file, allowances, thin_solids, without_missing } => {
            let allowed = Overrides {
                allowances: *allowances,
                thin_solids: *thin_solids,
                without_missing: *without_missing,
                ..Overrides::default()
            };
            check(file, &allowed, known, cli.json)
        }
    }
}

/// Writes a plan for each vehicle.
fn plan(args: &cli::Plan, known: &Behaviours, as_json: bool) -> anyhow::Result<()> {
    let scenario = args.world.open(known)?;
    std::fs::create_dir_all(&args.out).with_context(|| format!("{}: cannot be made", args.out.display()))?;
    let mut paths = Vec::new();
    for (number, vehicle) in (1..).zip(&scenario.vehicles) {
        let path = args.out.join(format!("uav-{number}.plan"));
        let text = write::to_plan(&scenario.mission_of(vehicle), &scenario.surroundings())?;
        std::fs::write(&path, text).with_context(|| format!("{}: cannot be written", path.display()))?;
        paths.push(path);
    }
    if as_json {
        println!("{}", json!({ "plans": paths }));
    } else {
        paths.iter().for_each(|path| println!("{}", path.display()));
    }
    Ok(())
}

fn show(summary: &Summary, as_json: bool) -> anyhow::Result<()> {
    if as_json {
        print!("{}", summary.to_json()?);
    } else {
        print!("{}", summary.render());
    }
    Ok(())
}

/// An unsound file is an answer, and the check has failed; a file that cannot be read is wrong input.
fn check(file: &Path, allowed: &Overrides, known: &Behaviours, as_json: bool) -> anyhow::Result<Exit> {
    match check::check(file, allowed, known) {
        Ok(findings) => {
            if as_json {
                println!("{}", serde_json::to_string(&findings)?);
            } else {
                println!("{findings}");
            }
            Ok(Exit::Done)
        }
        Err(error @ ScenarioError::Unreadable { .. }) => Err(error.into()),
        Err(error) => {
            if as_json {
                let elements = check::elements(file, allowed, &error);
                println!("{}", json!({ "file": file, "error": error.to_string(), "elements": elements }));
            }
            eprintln!("skein-sim: {error}");
            Ok(Exit::Failed)
        }
    }
}

fn list(as_json: bool) {
    let scenarios = Scenario::names();
    if as_json {
        let names: serde_json::Map<_, _> =
            scenarios.into_iter().map(|(name, about)| (name.to_owned(), about.into())).collect();
        println!("{}", json!({ "scenarios": names }));
    } else {
        for (name, about) in scenarios {
            println!("{name:<10} {about}");
        }
    }
}
