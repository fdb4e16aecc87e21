//! `replay`: a recorded mission in the console, with a time line.

use std::net::SocketAddr;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use serde_json::json;

use crate::console::Console;
use crate::explain::Recorded;
use crate::replay::{Digest, Replay};

/// The swarm is shown this often.
const PERIOD: Duration = Duration::from_millis(100);
/// Wishes of browsers are looked for this often.
const GLANCE: Duration = Duration::from_millis(20);

/// Serves a recording until Ctrl-C; with `json` prints what it came to instead. Exits with 1 when it holds nothing.
pub(super) fn run(file: &Path, address: SocketAddr, as_json: bool) -> anyhow::Result<ExitCode> {
    let recorded = Recorded::open(file)?;
    let Some(digest) = Digest::of(&recorded) else {
        let reason = format!("{}: it holds nothing", file.display());
        if as_json {
            println!("{}", json!({ "error": reason }));
        }
        eprintln!("skein-ground: {reason}");
        return Ok(ExitCode::FAILURE);
    };
    if as_json {
        println!("{}", serde_json::to_string(&digest)?);
        return Ok(ExitCode::SUCCESS);
    }
    let Some(replay) = Replay::new(recorded) else { return Ok(ExitCode::FAILURE) };
    println!("{}", in_words(file, &digest));
    serve(file, address, replay)?;
    Ok(ExitCode::SUCCESS)
}

fn serve(file: &Path, address: SocketAddr, mut replay: Replay) -> anyhow::Result<()> {
    let mut console = Console::serve(address, None, || ())?;
    println!("console: {} (Ctrl-C ends it)", console.url());
    console.note_recording(file);
    let stopping = Arc::new(AtomicBool::new(false));
    ctrlc::set_handler({
        let stopping = stopping.clone();
        move || stopping.store(true, Ordering::Relaxed)
    })
    .context("Ctrl-C cannot be caught")?;
    replay.play(true);
    let (mut before, mut shown) = (Instant::now(), None::<Instant>);
    while !stopping.load(Ordering::Relaxed) {
        let jumps = replay.jumps();
        console.take_orders().for_each(|wish| wish.carry_out_on(&mut replay));
        let now = Instant::now();
        replay.go_on(now - std::mem::replace(&mut before, now));
        if jumps != replay.jumps() || shown.is_none_or(|shown| now - shown >= PERIOD) {
            shown = Some(now);
            console.show_replay(&mut replay);
        }
        std::thread::sleep(GLANCE);
    }
    Ok(())
}

fn in_words(file: &Path, digest: &Digest) -> String {
    let cut = if digest.complete { "" } else { ", cut short" };
    let head = format!(
        "{}: {} vehicles, {:.1} s{cut}, {} events",
        file.display(),
        digest.vehicles.len(),
        digest.to_s - digest.from_s,
        digest.events
    );
    std::iter::once(head).chain(digest.nearest_in_words()).collect::<Vec<_>>().join("\n")
}
