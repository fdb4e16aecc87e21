//! Searches of grids: optimal against a search without any cleverness, within their bounds, and as published.

mod dstar_lite;
mod reference;
mod search;
mod zhang;
