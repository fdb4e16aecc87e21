//! The crate's tests, one file for each thing that is tested, in one program: it is linked once.

#![allow(clippy::unwrap_used)] // A test fails by panicking.

mod conformance;
mod deadlines;
mod event_sets;
mod explain;
mod external_events;
mod interrupts;
mod nodes;
mod random_programs;
mod recipes;
mod schema;
mod script_files;
mod scripts;
mod selection;
mod support;
mod verify_bounds;
mod verify_programs;
mod verify_random;
mod verify_worlds;
