//! The configuration file of an agent. `agent/agent.toml` explains every field.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context as _, bail, ensure};
use serde::{Deserialize, Deserializer, Serialize};
use skein_bp::behaviour::{Behaviours, Settings};
use skein_bp::configuration;
use skein_bp::script::{Argument, Assignment, ScriptFile};
use skein_dbp::{Authority, Kept};
use skein_mav::{Datum, Signing, SigningKey, SigningTime};
use skein_planning::airspace::{Airspace, AirspaceTable, KeepOut};
use skein_wire::{NodeName, standard_authority};
use skein_zenoh::NetworkSettings;

use crate::autopilot_link::Address;
use crate::bthreads::LinkLossPolicy;
use crate::config::{
    AgentConfig, DEFAULT_SIGMA_LIMIT_M, Envelope, Fence, Planners, PositionSource, position_sources,
};
use crate::errand::Errand;
use crate::field;

/// The file, field by field. What is never written keeps its default in files that are made.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AgentFile {
    pub fleet: String,
    pub node: String,
    pub ground: String,
    pub roster: Vec<String>,
    #[serde(default = "state", skip_serializing)]
    state: PathBuf,
    #[serde(default = "lease_ms", skip_serializing, deserialize_with = "field::lease_ms")]
    lease_ms: f64,
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "field::optional_positive")]
    radio_range_m: Option<f64>,
    #[serde(default)]
    pub seed: u64,
    #[serde(default = "position", deserialize_with = "position_sources")]
    position: Vec<PositionSource>,
    #[serde(default = "sigma_limit_m", deserialize_with = "field::positive")]
    sigma_limit_m: f64,
    pub autopilot: Autopilot,
    pub lidar: Option<Lidar>,
    pub datum: DatumTable,
    pub mission: Mission,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub script: Vec<ScriptEntry>,
    #[serde(default, skip_serializing_if = "Settings::is_empty")]
    pub behaviours: Settings,
    pub fence: Fence,
    #[serde(default)]
    pub airspace: AirspaceTable,
    #[serde(default)]
    pub envelope: Envelope,
    #[serde(default)]
    pub planners: Planners,
    pub network: NetworkSettings,
    #[serde(skip_serializing)]
    authority: Option<Authority>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Autopilot {
    pub link: Address,
    pub system_id: u8,
    #[serde(default, skip_serializing)]
    pub cable_is_private: bool,
    /// Other stations that share its line.
    #[serde(default, skip_serializing)]
    stations: Vec<Address>,
    #[serde(skip_serializing)]
    signing: Option<SigningTable>,
}

/// Signatures of MAVLink 2 frames, with a key from a file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct SigningTable {
    key_file: Option<PathBuf>,
    passphrase_file: Option<PathBuf>,
    #[serde(default)]
    link_id: u8,
    #[serde(default = "refuse_unsigned")]
    refuse_unsigned: bool,
}

/// Where the lidar's scans come from.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lidar {
    /// The node that reads it.
    pub sensor: String,
    /// A way of its own, if it has one.
    pub network: Option<NetworkSettings>,
}

/// A [`Datum`] in degrees.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DatumTable {
    #[serde(deserialize_with = "latitude_deg")]
    latitude_deg: f64,
    #[serde(deserialize_with = "longitude_deg")]
    longitude_deg: f64,
    #[serde(deserialize_with = "field::finite")]
    height_m: f64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mission {
    pub home: [f64; 3],
    pub waypoints: Vec<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rally: Vec<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub arrives_with: Vec<String>,
    #[serde(default = "takeoff_height_m", deserialize_with = "field::positive")]
    pub takeoff_height_m: f64,
    #[serde(default = "return_altitude_m", deserialize_with = "field::positive")]
    pub return_altitude_m: f64,
    #[serde(default)]
    pub without_ground: LinkLossPolicy,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub errand: Vec<Errand>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScriptEntry {
    pub file: PathBuf,
    #[serde(default)]
    pub with: BTreeMap<String, Argument>,
    #[serde(rename = "as")]
    pub called: Option<String>,
}

fn state() -> PathBuf {
    "state".into()
}

fn position() -> Vec<PositionSource> {
    vec![PositionSource::default()]
}

fn sigma_limit_m() -> f64 {
    DEFAULT_SIGMA_LIMIT_M
}

fn refuse_unsigned() -> bool {
    true
}

fn lease_ms() -> f64 {
    1000.0
}

fn takeoff_height_m() -> f64 {
    2.5
}

fn return_altitude_m() -> f64 {
    4.0
}

fn latitude_deg<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    field::within(deserializer, "-89 to 89", -89.0..=89.0)
}

fn longitude_deg<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    field::within(deserializer, "-180 to 180", -180.0..=180.0)
}

/// Everything that the agent must know, checked.
pub struct Config {
    pub agent: AgentConfig,
    pub name: NodeName,
    pub autopilot: Address,
    /// Other stations that the autopilot's line is shared with.
    pub stations: Vec<Address>,
    /// The node that reads the lidar, and the way of its scans if they have one of their own.
    pub lidar: Option<(NodeName, Option<NetworkSettings>)>,
    pub network: NetworkSettings,
    pub state: PathBuf,
}

/// The example, with an explanation of every field.
pub const EXAMPLE: &str = include_str!("../agent.toml");

impl Config {
    /// Reads and checks a configuration file for a program with these behaviours.
    pub fn read(path: &Path, known: &Behaviours) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::parse(&text, folder, known).with_context(|| path.display().to_string())
    }

    /// The nodes that this one knows of: those of its roster, and its lidar's.
    pub fn known(&self) -> Vec<NodeName> {
        let roster = self.agent.roster.iter().filter_map(|node| NodeName::new(node).ok());
        roster.chain(self.lidar.iter().map(|(sensor, _)| sensor.clone())).collect()
    }

    /// The configuration that `agent/agent.toml` shows.
    pub fn example() -> anyhow::Result<Self> {
        Self::parse(EXAMPLE, Path::new(""), &Behaviours::default()).context("agent/agent.toml")
    }

    /// Reads and checks the text of a configuration file whose paths are relative to `folder`.
    pub fn parse(text: &str, folder: &Path, known: &Behaviours) -> anyhow::Result<Self> {
        configuration::read::<AgentFile>(text)?.check(folder, known)
    }
}

impl AgentFile {
    /// The file of a vehicle whose autopilot and lidar are reached in these ways. The files of its scripts are still
    /// to be named.
    pub fn of(agent: &AgentConfig, link: Address, sensor: &str, network: NetworkSettings) -> Self {
        Self {
            fleet: agent.fleet.clone(),
            node: agent.node.clone(),
            ground: agent.ground.clone(),
            roster: agent.roster.clone(),
            state: state(),
            lease_ms: lease_ms(),
            radio_range_m: agent.radio_range_m,
            // TOML has no greater number.
            seed: agent.seed.min(i64::MAX.unsigned_abs()),
            position: agent.position.clone(),
            sigma_limit_m: agent.sigma_limit_m,
            autopilot: Autopilot {
                link,
                system_id: agent.system_id,
                cable_is_private: false,
                stations: Vec::new(),
                signing: None,
            },
            lidar: agent.lidar.then(|| Lidar { sensor: sensor.to_owned(), network: None }),
            datum: agent.datum.into(),
            mission: Mission {
                home: agent.home,
                waypoints: agent.waypoints.clone(),
                rally: agent.rally.clone(),
                arrives_with: agent.arrives_with.clone(),
                takeoff_height_m: agent.takeoff_height_m,
                return_altitude_m: agent.return_altitude_m,
                without_ground: agent.link_loss,
                errand: agent.errands.clone(),
            },
            script: Vec::new(),
            behaviours: agent.behaviours.settings(&agent.node),
            fence: agent.fence,
            airspace: AirspaceTable::of(&agent.airspace),
            envelope: agent.envelope,
            planners: agent.planners,
            network,
            authority: None,
        }
    }

    fn check(self, folder: &Path, known: &Behaviours) -> anyhow::Result<Config> {
        let name = NodeName::new(&self.node).context("`node`")?;
        ensure!(self.roster.contains(&self.node), "`roster` lacks this vehicle, {name}");
        ensure!(self.roster.contains(&self.ground), "`roster` lacks the ground station, {}", self.ground);
        ensure!(self.autopilot.system_id > 0, "`autopilot.system_id` is 0: expected 1 to 255");
        self.autopilot.link.check(self.autopilot.cable_is_private).context("`autopilot.link`")?;
        for station in &self.autopilot.stations {
            station.check(self.autopilot.cable_is_private).context("`autopilot.stations`")?;
            ensure!(
                station.brings_whole_frames(),
                "`autopilot.stations`: `{station}` brings frames in pieces, expected `udp:` or `udpout:`"
            );
        }
        let lidar = self.lidar.map(|lidar| lidar.check(folder)).transpose()?;
        self.mission.check(&self.fence)?;
        for other in &self.mission.arrives_with {
            ensure!(self.roster.contains(other), "`mission.arrives_with`: `{other}` is not in `roster`");
        }
        let airspace = self.airspace.check()?;
        self.mission.check_zones(&airspace)?;
        let agent = AgentConfig {
            behaviours: known.choose_for(&self.node, &self.behaviours)?,
            fleet: self.fleet,
            node: self.node,
            ground: self.ground,
            roster: self.roster,
            incarnation: 0,
            system_id: self.autopilot.system_id,
            signing: self.autopilot.signing.map(|it| it.read(folder)).transpose()?,
            datum: self.datum.into(),
            home: self.mission.home,
            waypoints: self.mission.waypoints,
            errands: self.mission.errand,
            rally: self.mission.rally,
            arrives_with: self.mission.arrives_with,
            takeoff_height_m: self.mission.takeoff_height_m,
            return_altitude_m: self.mission.return_altitude_m,
            position: self.position,
            sigma_limit_m: self.sigma_limit_m,
            lidar: lidar.is_some(),
            fence: self.fence,
            epoch: Duration::ZERO,
            airspace,
            envelope: self.envelope,
            planners: self.planners,
            link_loss: self.mission.without_ground,
            scripts: self.script.iter().map(|script| script.read(folder)).collect::<anyhow::Result<_>>()?,
            lease: Duration::from_secs_f64(self.lease_ms / 1000.0),
            radio_range_m: self.radio_range_m,
            authority: self.authority.unwrap_or_else(standard_authority),
            kept: Kept::default(),
            seed: self.seed,
        };
        let network = self.network.relative_to(folder);
        Ok(Config {
            agent,
            name,
            autopilot: self.autopilot.link,
            stations: self.autopilot.stations,
            lidar,
            network,
            state: folder.join(self.state),
        })
    }
}

impl SigningTable {
    /// The part of this end, whose clock has not been read yet.
    fn read(&self, folder: &Path) -> anyhow::Result<Signing> {
        let content = |field: &str, file: &Path| {
            let path = folder.join(file);
            let content = std::fs::read(&path);
            content.with_context(|| format!("`autopilot.signing.{field}`: `{}`", path.display()))
        };
        let key = match (&self.key_file, &self.passphrase_file) {
            (Some(file), None) => SigningKey::of_file(&content("key_file", file)?).with_context(|| {
                format!(
                    "`autopilot.signing.key_file`: `{}` holds no key: expected 32 bytes, or 64 hexadecimal digits",
                    folder.join(file).display()
                )
            })?,
            (None, Some(file)) => {
                let content = content("passphrase_file", file)?;
                let passphrase = std::str::from_utf8(&content).unwrap_or_default().trim_end_matches(['\r', '\n']);
                ensure!(
                    !passphrase.is_empty(),
                    "`autopilot.signing.passphrase_file`: `{}` holds no passphrase: expected one line of text in UTF-8",
                    folder.join(file).display()
                );
                SigningKey::of_passphrase(passphrase)
            }
            _ => bail!("`autopilot.signing`: expected either `key_file` or `passphrase_file`"),
        };
        let Self { link_id, refuse_unsigned, .. } = *self;
        Ok(Signing { key, link_id, refuses_unsigned: refuse_unsigned, began: SigningTime::default() })
    }
}

impl ScriptEntry {
    fn read(&self, folder: &Path) -> anyhow::Result<Assignment> {
        let path = folder.join(&self.file);
        let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        let script = ScriptFile::parse(&path.display().to_string(), &text)?;
        Ok(Assignment { script, with: self.with.clone(), called: self.called.clone() })
    }
}

impl Lidar {
    fn check(self, folder: &Path) -> anyhow::Result<(NodeName, Option<NetworkSettings>)> {
        let sensor = NodeName::new(&self.sensor).context("`lidar.sensor`")?;
        Ok((sensor, self.network.map(|network| network.relative_to(folder))))
    }
}

impl Mission {
    fn check(&self, fence: &Fence) -> anyhow::Result<()> {
        for axis in 0..3 {
            ensure!(
                fence.min[axis] < fence.max[axis],
                "`fence`: `min` is {:?} and `max` {:?}: each of `max` must be greater",
                fence.min,
                fence.max
            );
        }
        ensure!(
            !self.waypoints.is_empty(),
            "`mission.waypoints` is empty: name at least the point to land at"
        );
        for (number, point) in (1..).zip(&self.waypoints) {
            ensure!(
                fence.holds(point),
                "`mission.waypoints`: number {number}, {point:?}, is outside the fence"
            );
        }
        for (number, point) in (1..).zip(&self.rally) {
            ensure!(fence.holds(point), "`mission.rally`: number {number}, {point:?}, is outside the fence");
        }
        ensure!(fence.holds(&self.home), "`mission.home`, {:?}, is outside the fence", self.home);
        let [x, y, z] = self.home;
        for (field, height_m) in
            [("takeoff_height_m", z + self.takeoff_height_m), ("return_altitude_m", self.return_altitude_m)]
        {
            ensure!(
                fence.holds(&[x, y, height_m]),
                "`mission.{field}` leads to {height_m} m above the origin, outside the fence"
            );
        }
        Ok(())
    }

    /// No path leads into a zone. Home may be in one: the vehicle leaves, and lands beside it in the end.
    fn check_zones(&self, airspace: &Airspace) -> anyhow::Result<()> {
        let zones = KeepOut::new(airspace.clone(), 0.0, 0.0);
        for (number, point) in (1..).zip(&self.waypoints) {
            ensure!(
                zones.room_m(&(*point).into()) >= 0.0,
                "`mission.waypoints`: number {number}, {point:?}, is in a zone or in the ground of `airspace`"
            );
        }
        Ok(())
    }
}

impl From<Datum> for DatumTable {
    fn from(datum: Datum) -> Self {
        Self {
            latitude_deg: datum.latitude_rad.to_degrees(),
            longitude_deg: datum.longitude_rad.to_degrees(),
            height_m: datum.height_m,
        }
    }
}

impl From<DatumTable> for Datum {
    fn from(table: DatumTable) -> Self {
        Self::from_degrees(table.latitude_deg, table.longitude_deg, table.height_m)
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
        assert_eq!(config.state, Path::new("/etc/skein/state"));
        // Every field that is commented out is one, and has the value that counts without it.
        let all: Vec<&str> = EXAMPLE
            .lines()
            .map(|line| line.strip_prefix('#').filter(|line| !line.starts_with(' ')).unwrap_or(line))
            .collect();
        let full = check(&all.join("\n")).unwrap();
        assert_eq!(full.agent, config.agent);
        assert_eq!(full.network.listen, config.network.listen);
        assert!(full.network.security.is_some());
    }

    #[test]
    fn a_key_comes_from_one_file_which_is_named_if_it_holds_none() {
        let folder = tempfile::tempdir().unwrap();
        let write = |file: &str, content: &[u8]| std::fs::write(folder.path().join(file), content).unwrap();
        write("hex", "0f".repeat(32).as_bytes());
        write("words", b"swarm of geese\n");
        write("empty", b"\n");
        let read = |table: &str| {
            let text = EXAMPLE.replacen("[autopilot]", &format!("[autopilot]\nsigning = {{ {table} }}"), 1);
            Config::parse(&text, folder.path(), &Behaviours::default())
                .map(|config| config.agent.signing.unwrap())
        };
        let of_digits = read("key_file = 'hex', link_id = 7").unwrap();
        assert_eq!((of_digits.key, of_digits.link_id), (SigningKey::new([0x0f; 32]), 7));
        assert!(of_digits.refuses_unsigned);
        let of_words = read("passphrase_file = 'words', refuse_unsigned = false").unwrap();
        assert_eq!(of_words.key, SigningKey::of_passphrase("swarm of geese"));
        assert!(!of_words.refuses_unsigned);
        for (table, fault) in [
            ("link_id = 1", "expected either `key_file` or `passphrase_file`"),
            ("key_file = 'hex', passphrase_file = 'words'", "expected either"),
            ("key_file = 'words'", "64 hexadecimal digits"),
            ("key_file = 'nowhere'", "nowhere"),
            ("passphrase_file = 'empty'", "expected one line"),
            ("key_file = 'hex', link_id = 256", "expected u8"),
            ("key_file = 'hex', secret = 1", "secret"),
        ] {
            let error = format!("{:#}", read(table).unwrap_err());
            assert!(error.contains(fault), "{table}: {error}");
        }
    }

    #[test]
    fn what_is_written_is_what_was_read() {
        let config = check(EXAMPLE).unwrap();
        let file = AgentFile::of(&config.agent, config.autopilot, "sim/world", config.network);
        let again = check(&toml::to_string(&file).unwrap()).unwrap();
        assert_eq!(again.agent, config.agent);
        assert_eq!(again.lidar.unwrap().0.as_str(), "sim/world");
    }

    #[test]
    fn faults_are_named() {
        for (from, to, fault) in [
            ("node = \"uav/1\"", "node = \"uav\"", "`node`"),
            ("\"uav/1\", \"uav/2\", \"gr", "\"uav/2\", \"gr", "`roster` lacks this vehicle"),
            (", \"ground/main\", \"sc", ", \"sc", "`roster` lacks the ground"),
            ("udp:127.0.0.1:14540\"\n", "udp:14540\"\n", "`autopilot.link`"),
            ("udp:127.0.0.1:14540\"\n", "udp:0.0.0.0:14540\"\n", "cable_is_private"),
            ("system_id = 1", "system_id = 0", "`autopilot.system_id`"),
            ("system_id = 1", "system_id = 256", "expected u8"),
            ("[15.0, 20.0, 3.0]", "[15.0, 20.0, 300.0]", "number 2"),
            ("[15.0, 20.0, 3.0]", "[nan, 20.0, 3.0]", "number 2"),
            ("#arrives_with = []", "arrives_with = [\"uav/7\"]", "`mission.arrives_with`: `uav/7`"),
            ("max = [30.0", "max = [-30.0", "`fence`"),
            ("[envelope]", "[[airspace.no_fly]]\ncentre_m = [1.0, 2.0]\n[envelope]", "`airspace.no_fly[0]`"),
            (
                "[envelope]",
                "[[airspace.no_fly]]\ncorners_m = [[9.0, 9.0], [20.0, 9.0], [20.0, 25.0], [9.0, 25.0]]\n[envelope]",
                "`mission.waypoints`: number 2",
            ),
            ("#return_altitude_m = 4.0", "return_altitude_m = 40.0", "`mission.return_altitude_m`"),
            ("47.397742", "147.0", "`datum.latitude_deg`"),
            ("#cruise_m_s = 3.0", "cruise_m_s = -1.0", "`envelope.cruise_m_s`"),
            ("#cruise_m_s = 3.0", "cruise = 3.0", "unknown field `cruise`"),
            ("\"sim/world\"", "\"world\"", "`lidar.sensor`"),
            ("[fence]", "[behaviours]\nwell = {}\n[fence]", "`behaviours.well`"),
        ] {
            let text = EXAMPLE.replace(from, to);
            assert_ne!(text, EXAMPLE, "{from} is not in the example");
            let error = format!("{:#}", check(&text).err().expect(fault));
            assert!(error.contains(fault), "{error} does not name {fault}");
        }
    }
}
