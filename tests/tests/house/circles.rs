//! Imports between the files of a crate.

use std::collections::{BTreeMap, BTreeSet};

use syn::visit::{self, Visit};

use crate::modules::{Modules, modules, roots};
use crate::{members, root};

/// A path that a file names, from the crate's root.
type Path = Vec<String>;

/// What one file says: the paths that it names, and the names that it hands on from elsewhere.
#[derive(Default)]
struct Named {
    paths: Vec<Path>,
    /// `pub use a::B as C`: `C` and the path of `B`; a star hands on every name.
    handed_on: Vec<(String, Path)>,
}

/// Reads a file at `here`, without its tests.
struct Reader<'a> {
    here: Path,
    modules: &'a Modules,
    named: Named,
}

impl Reader<'_> {
    /// A path as it stands in the file, from the crate's root; `None` if it leads to another crate or to a local name.
    fn absolute(&self, path: &[String]) -> Option<Path> {
        let mut at = self.here.clone();
        match path.first()?.as_str() {
            "crate" => return Some(path[1..].to_vec()),
            "self" => {}
            "super" => {
                at.pop();
            }
            first => {
                at.push(first.to_owned());
                return self
                    .modules
                    .contains_key(&at)
                    .then(|| self.here.iter().chain(path).cloned().collect());
            }
        }
        let rest = &path[1..];
        let ups = rest.iter().take_while(|part| *part == "super").count();
        at.truncate(at.len().saturating_sub(ups));
        Some(at.into_iter().chain(rest[ups..].iter().cloned()).collect())
    }

    fn take_in(&mut self, tree: &syn::UseTree, before: &mut Path, is_public: bool) {
        let (name, last) = match tree {
            syn::UseTree::Path(path) => {
                before.push(path.ident.to_string());
                self.take_in(&path.tree, before, is_public);
                before.pop();
                return;
            }
            syn::UseTree::Group(group) => {
                group.items.iter().for_each(|tree| self.take_in(tree, before, is_public));
                return;
            }
            syn::UseTree::Name(name) => (name.ident.to_string(), name.ident.to_string()),
            syn::UseTree::Rename(rename) => (rename.rename.to_string(), rename.ident.to_string()),
            syn::UseTree::Glob(_) => ("*".to_owned(), "*".to_owned()),
        };
        let whole: Path =
            before.iter().cloned().chain([last]).filter(|part| part != "*" && part != "self").collect();
        let whole = if before.first().is_some_and(|first| first == "self") {
            std::iter::once("self".to_owned()).chain(whole).collect()
        } else {
            whole
        };
        let Some(path) = self.absolute(&whole) else { return };
        if is_public {
            let name = if name == "self" { path.last().cloned().unwrap_or_default() } else { name };
            self.named.handed_on.push((name, path.clone()));
        }
        self.named.paths.push(path);
    }
}

fn is_for_tests(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("test")
            || attribute.path().is_ident("cfg")
                && attribute.parse_args::<syn::Path>().is_ok_and(|path| path.is_ident("test"))
    })
}

impl<'ast> Visit<'ast> for Reader<'_> {
    fn visit_item_mod(&mut self, module: &'ast syn::ItemMod) {
        // Modules within a file are part of it, and have names of their own.
        if !is_for_tests(&module.attrs) && module.content.is_some() {
            self.here.push(module.ident.to_string());
            visit::visit_item_mod(self, module);
            self.here.pop();
        }
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        let is_public = !matches!(item.vis, syn::Visibility::Inherited);
        self.take_in(&item.tree, &mut Vec::new(), is_public);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let parts: Path = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        // `child::item` names a part of the module itself.
        if parts.len() > 1 && ["crate", "super", "self"].contains(&parts[0].as_str()) {
            self.named.paths.extend(self.absolute(&parts));
        }
        visit::visit_path(self, path);
    }
}

/// The file in which the item at `path` stands, as the path of its module.
fn home_of(path: &[String], modules: &Modules, named: &BTreeMap<Path, Named>, depth: usize) -> Option<Path> {
    let length = (0..=path.len()).rev().find(|length| modules.contains_key(&path[..*length]))?;
    let (module, rest) = path.split_at(length);
    let Some(name) = rest.first().filter(|_| depth < 8) else { return Some(module.to_vec()) };
    let handed_on = &named[module].handed_on;
    let target = handed_on.iter().find(|(known, _)| known == name).map(|(_, target)| target.clone());
    match target {
        Some(target) if target != path => home_of(&target, modules, named, depth + 1),
        _ => Some(module.to_vec()),
    }
}

/// Which files of a crate import from which.
fn imports(modules: &Modules) -> BTreeMap<Path, BTreeSet<Path>> {
    let read = |(path, (_, file)): (&Path, &(std::path::PathBuf, syn::File))| {
        let mut reader = Reader { here: path.clone(), modules, named: Named::default() };
        reader.visit_file(file);
        (path.clone(), reader.named)
    };
    let named: BTreeMap<_, _> = modules.iter().map(read).collect();
    let homes = |path: &Path, said: &Named| {
        let homes = said.paths.iter().filter_map(|named_path| home_of(named_path, modules, &named, 0));
        // A file is the door of its folder, and may use what is in it.
        homes.filter(|home| !home.starts_with(path)).collect()
    };
    named.iter().map(|(path, said)| (path.clone(), homes(path, said))).collect()
}

/// The groups of files each of which leads to every other one.
fn circles(imports: &BTreeMap<Path, BTreeSet<Path>>) -> Vec<BTreeSet<Path>> {
    let reach = |from: &Path| {
        let (mut reached, mut ahead) = (BTreeSet::new(), vec![from.clone()]);
        while let Some(next) = ahead.pop() {
            ahead.extend(imports[&next].iter().filter(|path| reached.insert((*path).clone())).cloned());
        }
        reached
    };
    let reached: BTreeMap<_, _> = imports.keys().map(|path| (path.clone(), reach(path))).collect();
    let circle = |path: &Path| -> BTreeSet<Path> {
        let back = |other: &&Path| reached[*other].contains(path);
        reached[path].iter().filter(back).cloned().collect()
    };
    imports
        .keys()
        .map(circle)
        .filter(|circle| !circle.is_empty())
        .collect::<BTreeSet<_>>()
        .into_iter()
        .collect()
}

#[test]
fn no_files_import_one_another_in_a_circle() {
    let mut found = Vec::new();
    for (folder, _) in members() {
        for root_file in roots(&folder).into_iter().filter(|file| file.starts_with(folder.join("src"))) {
            let modules = modules(&root_file);
            for circle in circles(&imports(&modules)) {
                let file = |path: &Path| modules[path].0.strip_prefix(root()).unwrap().display().to_string();
                found.push(circle.iter().map(file).collect::<Vec<_>>().join(" ~ "));
            }
        }
    }
    assert!(found.is_empty(), "circles of files:\n{}", found.join("\n"));
}

#[test]
fn a_circle_is_seen() {
    let path = |name: &str| vec![name.to_owned()];
    let mut imports = BTreeMap::from([
        (path("a"), BTreeSet::from([path("b")])),
        (path("b"), BTreeSet::from([path("c")])),
        (path("c"), BTreeSet::new()),
    ]);
    assert!(circles(&imports).is_empty());
    imports.insert(path("c"), BTreeSet::from([path("a")]));
    assert_eq!(circles(&imports), [BTreeSet::from(["a", "b", "c"].map(path))]);
}
