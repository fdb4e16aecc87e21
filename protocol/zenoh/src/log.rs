//! A program's log.

use std::io::IsTerminal as _;

use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;
use tracing_subscriber::{EnvFilter, Layer as _};

use crate::links;

/// Writes the program's log to its standard error: from `level` up unless `RUST_LOG` says otherwise, with the places
/// where it was written or without. Why links fail is noted beside it, to be told in plain words.
pub fn log(level: &str, with_places: bool) {
    // Zenoh warns of things that are as they should be on one host, and repeats others with every attempt.
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| format!("{level},zenoh=error").into());
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_target(with_places)
        .with_filter(filter);
    tracing_subscriber::registry().with(lines).with(links::overhearing()).init();
}
