//! The house keeps its shape: crates know only those that ARCHITECTURE.md says, no files import one another in a
//! circle, and no file is forgotten.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // A test fails by panicking.

mod circles;
mod layers;
mod modules;

use std::path::{Path, PathBuf};

/// The folder of the workspace.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().expect("the workspace is there")
}

/// The folders of the workspace's members, with the names of their crates.
fn members() -> Vec<(PathBuf, toml::Table)> {
    let manifest = |folder: &Path| -> toml::Table {
        let path = folder.join("Cargo.toml");
        std::fs::read_to_string(&path).unwrap().parse().unwrap_or_else(|error| panic!("{path:?}: {error}"))
    };
    let workspace = manifest(&root());
    let members = workspace["workspace"]["members"].as_array().expect("a list of members");
    let member = |member: &toml::Value| {
        let folder = root().join(member.as_str().expect("a folder"));
        (folder.clone(), manifest(&folder))
    };
    members.iter().map(member).collect()
}
