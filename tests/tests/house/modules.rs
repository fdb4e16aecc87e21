//! The modules of a crate, as its files declare them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::members;

/// A crate's files, by the path of their module from the crate's root.
pub type Modules = BTreeMap<Vec<String>, (PathBuf, syn::File)>;

/// The modules that hang on the file `root`, it included.
pub fn modules(root: &Path) -> Modules {
    let mut found = Modules::new();
    collect(root, root.parent().expect("a folder"), Vec::new(), &mut found);
    found
}

/// Takes in `file`, whose modules are in `folder`.
fn collect(file: &Path, folder: &Path, path: Vec<String>, found: &mut Modules) {
    let text = std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let parsed = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    for item in &parsed.items {
        let syn::Item::Mod(module) = item else { continue };
        if module.content.is_some() {
            continue;
        }
        let name = module.ident.to_string();
        let (beside, inside) = (folder.join(format!("{name}.rs")), folder.join(&name).join("mod.rs"));
        let child = if beside.is_file() { beside } else { inside };
        let path = path.iter().cloned().chain([name.clone()]).collect();
        collect(&child, &folder.join(&name), path, found);
    }
    found.insert(path, (file.to_owned(), parsed));
}

/// The files from which a crate's programs, library, tests and examples hang.
pub fn roots(folder: &Path) -> Vec<PathBuf> {
    let mut roots: Vec<_> =
        ["src/lib.rs", "src/main.rs", "build.rs"].iter().map(|file| folder.join(file)).collect();
    roots.push(folder.join("tests/main.rs"));
    for place in ["src/bin", "tests", "examples", "benches"] {
        let Ok(entries) = std::fs::read_dir(folder.join(place)) else { continue };
        for entry in entries {
            let path = entry.unwrap().path();
            let is_program = place != "tests" && path.extension().is_some_and(|extension| extension == "rs");
            roots.push(if is_program { path } else { path.join("main.rs") });
        }
    }
    let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap_or_default();
    let named = manifest.lines().filter_map(|line| line.strip_prefix("path = \"")?.strip_suffix('"'));
    roots.extend(named.map(|file| folder.join(file)));
    roots.retain(|file| file.is_file());
    roots.sort();
    roots.dedup();
    roots
}

#[test]
fn every_file_belongs_to_a_program() {
    let mut forgotten = Vec::new();
    for (folder, _) in members() {
        let reached: Vec<_> = roots(&folder).iter().flat_map(|root| modules(root).into_values()).collect();
        for place in ["src", "tests", "examples", "benches"] {
            each_file(&folder.join(place), &mut |file| {
                if !reached.iter().any(|(known, _)| known == file) {
                    forgotten.push(file.to_owned());
                }
            });
        }
    }
    assert!(forgotten.is_empty(), "no `mod` declares these files: {forgotten:#?}");
}

/// Visits the Rust files of a folder, but not of other crates that lie in it.
fn each_file(folder: &Path, visit: &mut dyn FnMut(&Path)) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries {
        let path = entry.unwrap().path();
        if path.is_dir() {
            if !path.join("Cargo.toml").is_file() {
                each_file(&path, visit);
            }
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            visit(&path);
        }
    }
}
