//! The folders in which the models of Gazebo worlds lie.

use std::path::{Component, Path, PathBuf};

use skein_world::mesh::MOST_BYTES;
use skein_world::{Files, Found};

/// Variables that list folders of models.
const VARIABLES: [&str; 4] =
    ["GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "SDF_PATH", "GAZEBO_MODEL_PATH"];
/// Folders of models in the user's own folder.
const OWN: [&str; 3] = [".gazebo/models", ".gz/models", ".ignition/models"];
/// Folders of what was fetched from a server, in the user's own folder.
const CACHES: [&str; 2] = [".gz/fuel", ".ignition/fuel"];

/// Where the files of one world are looked for.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ModelFolders {
    /// In the order of the search.
    folders: Vec<PathBuf>,
    /// Models fetched from servers, by their names.
    caches: Vec<PathBuf>,
}

impl ModelFolders {
    /// For a world file: the folders beside it, then those that the environment names, then the caches.
    pub fn of(world: &Path) -> Self {
        let beside = world.parent().unwrap_or(Path::new(""));
        let above = beside.join("..");
        let mut folders = vec![beside.to_owned(), beside.join("models"), above.join("models"), above];
        for variable in VARIABLES {
            let listed = std::env::var_os(variable);
            let listed = listed.iter().flat_map(std::env::split_paths);
            folders.extend(listed.filter(|folder| !folder.as_os_str().is_empty()));
        }
        let home = std::env::var_os("HOME").map(PathBuf::from);
        folders.extend(home.iter().flat_map(|home| OWN.map(|own| home.join(own))));
        let fetched = std::env::var_os("GZ_FUEL_CACHE_PATH").map(PathBuf::from);
        let usual = home.iter().flat_map(|home| CACHES.map(|cache| home.join(cache)));
        let caches = fetched.into_iter().chain(usual).collect();
        Self { folders, caches }
    }

    /// The places at which `uri` in the file `from` may be.
    fn places(&self, uri: &str, from: &str) -> Vec<PathBuf> {
        if let Some((server, path)) = uri
            .split_once("://")
            .filter(|(scheme, _)| scheme.starts_with("http"))
            .and_then(|(_, rest)| rest.split_once('/'))
        {
            return self.caches.iter().flat_map(|cache| fetched(&cache.join(server), path)).collect();
        }
        let named = uri.split_once("://").filter(|(scheme, _)| matches!(*scheme, "model" | "package"));
        if let Some((_, path)) = named {
            return self.under(path, from);
        }
        let path = uri.strip_prefix("file://").unwrap_or(uri);
        if Path::new(path).is_absolute() {
            return vec![PathBuf::from(path)];
        }
        let beside = Path::new(from).parent().map(|folder| folder.join(path));
        beside.into_iter().chain(self.under(path, from)).collect()
    }

    /// A path in each of the folders, and beside the model that names it.
    fn under(&self, path: &str, from: &str) -> Vec<PathBuf> {
        let model = Path::new(from).parent().and_then(Path::parent);
        let folders = self.folders.iter().map(PathBuf::as_path).chain(model);
        folders.map(|folder| folder.join(path)).collect()
    }
}

/// The newest version of what was fetched: `1.0/owner/models/name`, or with a version and more after it.
fn fetched(server: &Path, path: &str) -> Vec<PathBuf> {
    let mut parts = path.trim_matches('/').split('/').peekable();
    if parts.peek().is_some_and(|part| part.parse::<f64>().is_ok()) {
        parts.next();
    }
    let decoded = |part: &str| part.replace("%20", " ").to_lowercase();
    let named: PathBuf = server
        .components()
        .chain(parts.by_ref().take(3).map(decoded).collect::<PathBuf>().components())
        .collect();
    let mut rest: Vec<&str> = parts.collect();
    let stated = rest.first().and_then(|version| version.parse::<u32>().ok());
    if rest.first().is_some_and(|part| *part == "tip" || part.parse::<u32>().is_ok()) {
        rest.remove(0);
    }
    if rest.first() == Some(&"files") {
        rest.remove(0);
    }
    let number =
        |entry: std::io::Result<std::fs::DirEntry>| entry.ok()?.file_name().to_str()?.parse::<u32>().ok();
    let newest = || std::fs::read_dir(&named).ok()?.filter_map(number).max();
    let version = stated.or_else(newest);
    version.map(|version| named.join(version.to_string()).join(rest.join("/"))).into_iter().collect()
}

impl Files for ModelFolders {
    fn open(&self, uri: &str, from: &str) -> Found {
        for place in self.places(uri, from) {
            let Ok(about) = std::fs::metadata(&place) else { continue };
            let name = tidy(&place).display().to_string();
            if about.is_dir() {
                return Found::Folder { name };
            }
            if !about.is_file() {
                return Found::Unreadable(format!("`{name}` is no file"));
            }
            if about.len() > MOST_BYTES {
                return Found::Unreadable(format!("`{name}` is longer than {} MiB", MOST_BYTES >> 20));
            }
            return match std::fs::read(&place) {
                Ok(bytes) => Found::File { name, bytes: bytes.into() },
                Err(error) => Found::Unreadable(format!("`{name}`: {error}")),
            };
        }
        Found::Missing
    }
}

/// The path without steps down and up again.
fn tidy(path: &Path) -> PathBuf {
    let mut tidy = PathBuf::new();
    for part in path.components() {
        match (part, tidy.components().next_back()) {
            (Component::CurDir, _) => {}
            (Component::ParentDir, Some(Component::Normal(_))) => {
                tidy.pop();
            }
            _ => tidy.push(part),
        }
    }
    tidy
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(folders: &ModelFolders, uri: &str, from: &Path) -> Option<PathBuf> {
        match folders.open(uri, &from.display().to_string()) {
            Found::File { name, .. } | Found::Folder { name } => Some(PathBuf::from(name)),
            Found::Missing | Found::Unreadable(_) => None,
        }
    }

    #[test]
    fn models_are_found_beside_the_world_beside_one_another_and_in_the_caches() -> std::io::Result<()> {
        let folder = tempfile::tempdir()?;
        let root = std::fs::canonicalize(folder.path())?;
        let put = |path: &str| -> std::io::Result<PathBuf> {
            let path = root.join(path);
            path.parent().map(std::fs::create_dir_all).transpose()?;
            std::fs::write(&path, "x")?;
            Ok(path)
        };
        let world = put("worlds/w.sdf")?;
        let tree = put("models/tree/model.sdf")?;
        let leaf = put("models/leaf/leaf.stl")?;
        let rock = put("worlds/models/rock/rock.stl")?;
        put("fuel/server.org/me/models/big barn/2/model.sdf")?;
        let barn = put("fuel/server.org/me/models/big barn/11/model.sdf")?;
        let old = root.join("fuel/server.org/me/models/big barn/2");
        let folders = ModelFolders { caches: vec![root.join("fuel")], ..ModelFolders::of(&world) };
        let barn = barn.parent().map(Path::to_owned);
        for (uri, from, expected) in [
            ("model://tree", &world, tree.parent().map(Path::to_owned)),
            ("model://leaf/leaf.stl", &tree, Some(leaf.clone())),
            ("models/rock/rock.stl", &world, Some(rock.clone())),
            ("../leaf/leaf.stl", &tree, Some(leaf.clone())),
            ("https://server.org/1.0/Me/models/Big%20Barn", &world, barn.clone()),
            ("https://server.org/1.0/Me/models/Big Barn/2", &world, Some(old)),
            ("https://server.org/1.0/Me/models/Big Barn/tip", &world, barn),
            ("https://server.org/1.0/me/models/none", &world, None),
            ("model://none", &world, None),
        ] {
            assert_eq!(found(&folders, uri, from), expected, "{uri}");
        }
        let absolute = format!("file://{}", leaf.display());
        assert_eq!(found(&folders, &absolute, &world), Some(leaf));
        Ok(())
    }
}
