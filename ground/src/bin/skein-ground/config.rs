//! The configuration file of a ground station. `ground/ground.toml` explains every field.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context as _;
use serde::Deserialize;
use skein_dbp::{Authority, NodeName};
use skein_ground::GroundConfig;
use skein_wire::{Fleet, standard_authority};
use skein_zenoh::NetworkSettings;

/// Everything that the station must know, checked.
pub struct Config {
    pub station: GroundConfig,
    pub network: NetworkSettings,
    pub console: SocketAddr,
    pub record: PathBuf,
    pub state: PathBuf,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    fleet: String,
    node: String,
    vehicles: Vec<String>,
    #[serde(default = "operators")]
    operators: Vec<String>,
    launch: Launch,
    #[serde(default)]
    muster: bool,
    #[serde(default = "console")]
    console: SocketAddr,
    #[serde(default = "record")]
    record: PathBuf,
    #[serde(default = "state")]
    state: PathBuf,
    #[serde(default = "lease_ms")]
    lease_ms: u64,
    network: NetworkSettings,
    authority: Option<Authority>,
}

#[derive(Deserialize, PartialEq)]
#[serde(rename_all = "snake_case")]
enum Launch {
    AtStart,
    OnOrder,
}

fn operators() -> Vec<String> {
    vec!["script/operator".into()]
}

fn console() -> SocketAddr {
    ([127, 0, 0, 1], 8700).into()
}

fn record() -> PathBuf {
    "record".into()
}

fn state() -> PathBuf {
    "state".into()
}

fn lease_ms() -> u64 {
    1000
}

impl Config {
    /// Reads and checks a configuration file.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let file: File = toml::from_str(&text).with_context(|| path.display().to_string())?;
        file.check(folder).with_context(|| path.display().to_string())
    }
}

impl File {
    fn check(self, folder: &Path) -> anyhow::Result<Config> {
        let name = |field: &str, text: &str| NodeName::new(text).with_context(|| format!("`{field}`"));
        let vehicles =
            self.vehicles.iter().map(|vehicle| name("vehicles", vehicle)).collect::<Result<Vec<_>, _>>()?;
        anyhow::ensure!(!vehicles.is_empty(), "`vehicles` is empty: name at least one, such as \"uav/1\"");
        let operators = self.operators.iter().map(|operator| name("operators", operator));
        let operators = operators.collect::<Result<Vec<_>, _>>()?;
        let node = name("node", &self.node)?;
        anyhow::ensure!(!vehicles.contains(&node), "`vehicles` holds the station's own name, {node}");
        anyhow::ensure!(
            (100..=10_000).contains(&self.lease_ms),
            "`lease_ms` is {}: expected 100 to 10000",
            self.lease_ms
        );
        let fleet = Fleet::new(&self.fleet).context("`fleet`")?;
        let station = GroundConfig {
            launch_on_order: self.launch == Launch::OnOrder,
            muster: self.muster,
            operators,
            lease: Duration::from_millis(self.lease_ms),
            authority: self.authority.unwrap_or_else(standard_authority),
            ..GroundConfig::new(fleet, node, vehicles)
        };
        Ok(Config {
            station,
            network: self.network.relative_to(folder),
            console: self.console,
            record: folder.join(self.record),
            state: folder.join(self.state),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXAMPLE: &str = include_str!("../../../ground.toml");

    fn check(text: &str) -> anyhow::Result<Config> {
        toml::from_str::<File>(text)?.check(Path::new("/etc/skein"))
    }

    #[test]
    fn the_example_is_sound_with_its_comments_and_with_all_its_fields() {
        let config = check(EXAMPLE).unwrap();
        assert!(config.station.launch_on_order && config.network.security.is_none());
        assert_eq!(config.record, Path::new("/etc/skein/record"));
        // Every field that is commented out is one, and has the value that counts without it.
        let all: Vec<&str> = EXAMPLE
            .lines()
            .map(|line| line.strip_prefix('#').filter(|line| !line.starts_with(' ')).unwrap_or(line))
            .collect();
        let full = check(&all.join("\n")).unwrap();
        assert_eq!((full.console, full.record, full.state), (config.console, config.record, config.state));
        assert_eq!(full.network.mode, config.network.mode);
        assert!(full.network.security.is_some());
        assert_eq!(full.station.lease, config.station.lease);
        assert_eq!(full.station.operators, config.station.operators);
        assert_eq!(full.station.authority, config.station.authority);
    }

    #[test]
    fn faults_are_named() {
        for (from, to, fault) in [
            ("\"uav/1\", \"uav/2\"", "", "`vehicles` is empty"),
            ("\"uav/1\"", "\"uav\"", "`vehicles`"),
            ("\"uav/1\"", "\"ground/main\"", "own name"),
            ("\"on_order\"", "\"soon\"", "unknown variant `soon`"),
            ("fleet = \"demo\"", "fleet = \"a b\"", "`fleet`"),
            ("#lease_ms = 1000", "lease_ms = 1", "`lease_ms` is 1"),
            ("#muster = false", "mustard = true", "unknown field `mustard`"),
        ] {
            let text = EXAMPLE.replace(from, to);
            assert_ne!(text, EXAMPLE, "{from} is not in the example");
            let error = format!("{:#}", check(&text).err().unwrap());
            assert!(error.contains(fault), "{error} does not name {fault}");
        }
    }
}
