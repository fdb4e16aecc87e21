//! The configuration file of a ground station. `ground/ground.toml` explains every field.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context as _;
use serde::de::{MapAccess, Unexpected, Visitor};
use serde::{Deserialize, Serialize};
use skein_bp::behaviour::{Behaviours, Settings};
use skein_bp::configuration;
use skein_dbp::{Authority, NodeName};
use skein_planning::airspace::AirspaceTable;
use skein_swarm::route::Craft;
use skein_wire::{Fleet, standard_authority};
use skein_zenoh::{NetworkSettings, Security};

use crate::config::{GroundConfig, REHEARSER};
use crate::console::{ConsoleSecurity, Role};
use crate::planning::Theatre;

/// Everything that the station must know, checked.
pub struct Config {
    pub station: GroundConfig,
    pub network: NetworkSettings,
    pub console: SocketAddr,
    /// TLS, and who may do what; none on the loopback interface unless it is configured.
    pub console_security: Option<ConsoleSecurity>,
    pub record: PathBuf,
    /// The greatest size of a recording, bytes.
    pub record_most_bytes: u64,
    pub state: PathBuf,
}

/// The example, with an explanation of every field.
pub const EXAMPLE: &str = include_str!("../ground.toml");

/// The file, field by field. What is never written keeps its default in files that are made.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroundFile {
    pub fleet: String,
    pub node: String,
    pub vehicles: Vec<String>,
    #[serde(default = "operators")]
    pub operators: Vec<String>,
    pub launch: Launch,
    #[serde(default)]
    pub muster: bool,
    #[serde(default, deserialize_with = "console_or_address")]
    pub console: ConsoleFile,
    #[serde(default = "record")]
    pub record: PathBuf,
    #[serde(default = "record_most_mb", skip_serializing)]
    record_most_mb: u64,
    #[serde(default = "state", skip_serializing)]
    state: PathBuf,
    #[serde(default = "lease_ms", skip_serializing)]
    lease_ms: u64,
    #[serde(default, skip_serializing_if = "Settings::is_empty")]
    pub behaviours: Settings,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    planning: Option<PlanningFile>,
    #[serde(default = "rehearser", skip_serializing)]
    rehearser: PathBuf,
    pub network: NetworkSettings,
    #[serde(skip_serializing)]
    authority: Option<Authority>,
}

/// The table `[console]`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConsoleFile {
    #[serde(default = "console")]
    pub listen: SocketAddr,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    authority: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    certificate: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    key: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    roles: BTreeMap<String, Role>,
}

impl Default for ConsoleFile {
    fn default() -> Self {
        Self::at(console())
    }
}

impl ConsoleFile {
    /// A console at this address, without certificates.
    pub fn at(listen: SocketAddr) -> Self {
        Self { listen, authority: None, certificate: None, key: None, roles: BTreeMap::new() }
    }

    /// The certificates, those of the network unless others are named; none where the console is for this computer.
    fn security(&self, network: Option<&Security>, folder: &Path) -> anyhow::Result<Option<ConsoleSecurity>> {
        if self.listen.ip().is_loopback() && self.roles.is_empty() {
            return Ok(None);
        }
        let path = |own: &Option<PathBuf>, shared: fn(&Security) -> &PathBuf, name: &str| {
            let own = own.as_ref().map(|path| folder.join(path));
            own.or_else(|| network.map(|security| shared(security).clone())).with_context(|| {
                format!(
                    "`console.listen` is {}: beyond the loopback interface the console is served over TLS only; name \
                     `console.{name}`, or [network.security]",
                    self.listen
                )
            })
        };
        Ok(Some(ConsoleSecurity {
            authority: path(&self.authority, |security| &security.authority, "authority")?,
            certificate: path(&self.certificate, |security| &security.certificate, "certificate")?,
            key: path(&self.key, |security| &security.key, "key")?,
            roles: self.roles.clone(),
        }))
    }
}

/// When the swarm takes off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Launch {
    AtStart,
    OnOrder,
}

fn operators() -> Vec<String> {
    vec!["script/operator".into()]
}

fn console() -> SocketAddr {
    ([127, 0, 0, 1], 8700).into()
}

/// The table, or in its place only the address.
fn console_or_address<'de, D: serde::Deserializer<'de>>(from: D) -> Result<ConsoleFile, D::Error> {
    struct Either;
    impl<'de> Visitor<'de> for Either {
        type Value = ConsoleFile;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("an address such as \"127.0.0.1:8700\", or a table with `listen`")
        }

        fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<ConsoleFile, E> {
            text.parse().map(ConsoleFile::at).map_err(|_| E::invalid_value(Unexpected::Str(text), &self))
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<ConsoleFile, A::Error> {
            ConsoleFile::deserialize(serde::de::value::MapAccessDeserializer::new(map))
        }
    }
    from.deserialize_any(Either)
}

fn record() -> PathBuf {
    "record".into()
}

fn record_most_mb() -> u64 {
    4096
}

fn state() -> PathBuf {
    "state".into()
}

fn rehearser() -> PathBuf {
    REHEARSER.into()
}

fn lease_ms() -> u64 {
    1000
}

/// The `[planning]` table: what the station plans with.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanningFile {
    min_m: [f64; 3],
    max_m: [f64; 3],
    #[serde(default)]
    craft: Craft,
    #[serde(default)]
    airspace: AirspaceTable,
}

impl PlanningFile {
    fn of(theatre: &Theatre) -> Self {
        let airspace = &theatre.airspace;
        let (min_m, max_m) = (airspace.lower.into(), airspace.upper.into());
        Self { min_m, max_m, craft: theatre.craft, airspace: AirspaceTable::of(airspace) }
    }

    fn check(self) -> anyhow::Result<Theatre> {
        let airspace = self.airspace.check().context("`planning`")?;
        let space = (self.min_m.into(), self.max_m.into());
        Theatre::new(airspace, space, self.craft).context("`planning`")
    }
}

impl Config {
    /// Reads and checks a configuration file for a program with these behaviours.
    pub fn read(path: &Path, known: &Behaviours) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::parse(&text, folder, known).with_context(|| path.display().to_string())
    }

    /// Reads and checks the text of a configuration file whose paths are relative to `folder`.
    pub fn parse(text: &str, folder: &Path, known: &Behaviours) -> anyhow::Result<Self> {
        configuration::read::<GroundFile>(text)?.check(folder, known)
    }
}

impl GroundFile {
    /// The file of a station with this configuration.
    pub fn of(station: &GroundConfig, console: SocketAddr, network: NetworkSettings) -> Self {
        let names = |nodes: &[NodeName]| nodes.iter().map(NodeName::to_string).collect();
        Self {
            fleet: station.fleet.to_string(),
            node: station.name.to_string(),
            vehicles: names(&station.vehicles),
            operators: names(&station.operators),
            launch: if station.launch_on_order { Launch::OnOrder } else { Launch::AtStart },
            muster: station.muster,
            console: ConsoleFile::at(console),
            record: record(),
            record_most_mb: record_most_mb(),
            state: state(),
            lease_ms: lease_ms(),
            behaviours: station.behaviours.settings(station.name.as_str()),
            planning: station.theatre.as_ref().map(PlanningFile::of),
            rehearser: rehearser(),
            network,
            authority: None,
        }
    }

    fn check(self, folder: &Path, known: &Behaviours) -> anyhow::Result<Config> {
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
            behaviours: known.choose_for(&self.node, &self.behaviours)?,
            theatre: self.planning.map(PlanningFile::check).transpose()?,
            rehearser: match self.rehearser.components().count() {
                1 => self.rehearser,
                _ => folder.join(self.rehearser),
            },
            lease: Duration::from_millis(self.lease_ms),
            authority: self.authority.unwrap_or_else(standard_authority),
            ..GroundConfig::new(fleet, node, vehicles)
        };
        let network = self.network.relative_to(folder);
        Ok(Config {
            station,
            console: self.console.listen,
            console_security: self.console.security(network.security.as_ref(), folder)?,
            network,
            record: folder.join(self.record),
            record_most_bytes: self.record_most_mb.saturating_mul(1 << 20),
            state: folder.join(self.state),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str) -> anyhow::Result<Config> {
        Config::parse(text, Path::new("/etc/skein"), &Behaviours::default())
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
        assert_eq!(full.record_most_bytes, config.record_most_bytes);
        assert_eq!(full.network.mode, config.network.mode);
        assert!(full.network.security.is_some());
        assert_eq!(full.station.lease, config.station.lease);
        assert_eq!(full.station.operators, config.station.operators);
        assert_eq!(full.station.authority, config.station.authority);
        assert_eq!(full.station.theatre.unwrap().craft, Craft::default());
    }

    #[test]
    fn what_is_written_is_what_was_read() {
        let config = check(EXAMPLE).unwrap();
        let file = GroundFile::of(&config.station, config.console, config.network);
        let again = check(&toml::to_string(&file).unwrap()).unwrap().station;
        assert_eq!((again.name, again.vehicles), (config.station.name, config.station.vehicles));
        assert!(again.launch_on_order && !again.muster);
        assert_eq!(again.operators, config.station.operators);
    }

    #[test]
    fn the_console_is_an_address_or_a_table_and_uses_the_networks_certificates_beyond_this_computer() {
        let short = EXAMPLE.replace("[console]\n", "console = \"127.0.0.1:9000\"\n");
        let config = check(&short).unwrap();
        assert_eq!((config.console.port(), config.console_security), (9000, None));
        let secured = EXAMPLE.replace("#[network.security]", "[network.security]");
        let secured = ["authority", "certificate", "key"]
            .iter()
            .fold(secured, |text, key| text.replace(&format!("\n#{key} ="), &format!("\n{key} =")));
        let table = "[console]\nlisten = \"0.0.0.0:8700\"\nkey = \"k.pem\"\nroles = { anna = \"safety\" }\n";
        let config = check(&secured.replacen("[console]\n", table, 1)).unwrap();
        let security = config.console_security.unwrap();
        assert_eq!(security.authority, Path::new("/etc/skein/certificates/authority.pem"));
        assert_eq!(
            (security.key.as_path(), security.roles["anna"]),
            (Path::new("/etc/skein/k.pem"), Role::Safety)
        );
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
            ("[console]", "[console]\nlisten = \"0.0.0.0:8700\"", "over TLS only"),
            ("[console]", "[console]\nlisten = \"8700\"", "invalid socket address"),
            ("[console]", "[console.roles]\nanna = \"king\"", "unknown variant `king`"),
            ("[console]\n", "console = \"here\"\n", "an address such as"),
            ("[network]", "[behaviours]\nwell = {}\n[network]", "`behaviours.well`"),
            ("[network]", "[planning]\nmin_m = [0, 0, 0]\nmax_m = [9, 9, 0]\n[network]", "are no box"),
            (
                "[network]",
                "[planning]\nmin_m = [0, 0, 0]\nmax_m = [9, 9, 9]\ncraft = { climb_m_s = -1.0 }\n[network]",
                "`climb_m_s` is -1",
            ),
        ] {
            let text = EXAMPLE.replace(from, to);
            assert_ne!(text, EXAMPLE, "{from} is not in the example");
            let error = format!("{:#}", check(&text).err().unwrap());
            assert!(error.contains(fault), "{error} does not name {fault}");
        }
    }
}
