//! Searches of grids: optimal against a search without any cleverness, within their bounds, and as published.

#![expect(clippy::unwrap_used, reason = "a test that cannot be set up fails")]

mod dstar_lite;
mod published;
mod reference;
mod search;
mod zhang;
