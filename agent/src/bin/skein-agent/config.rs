//! The configuration file of an agent. `agent/agent.toml` explains every field.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context as _, ensure};
use serde::Deserialize;
use skein_agent::bthreads::LinkLossPolicy;
use skein_agent::{AgentConfig, AirspaceTable, Envelope, Fence, GlobalPlanner, LocalPlanner, Planners};
use skein_bp::script::{Argument, Assignment, ScriptFile};
use skein_dbp::{Authority, Kept};
use skein_mav::Datum;
use skein_planning::airspace::{Airspace, KeepOut};
use skein_wire::{NodeName, standard_authority};
use skein_zenoh::NetworkSettings;

use crate::autopilot_link::Address;

/// Everything that the agent must know, checked.
pub struct Config {
    pub agent: AgentConfig,
    pub name: NodeName,
    pub autopilot: Address,
    pub lidar: Option<LidarSource>,
    pub network: NetworkSettings,
    pub state: PathBuf,
}

/// Where the lidar's scans come from.
pub struct LidarSource {
    /// The node that reads it.
    pub sensor: NodeName,
    /// A way of its own, if it has one.
    pub network: Option<NetworkSettings>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    fleet: String,
    node: String,
    ground: String,
    roster: Vec<String>,
    #[serde(default = "state")]
    state: PathBuf,
    #[serde(default = "lease_ms")]
    lease_ms: u64,
    #[serde(default)]
    seed: u64,
    autopilot: Autopilot,
    lidar: Option<Lidar>,
    datum: DatumTable,
    mission: Mission,
    #[serde(default)]
    script: Vec<ScriptTable>,
    fence: FenceTable,
    #[serde(default)]
    airspace: AirspaceTable,
    #[serde(default)]
    envelope: EnvelopeTable,
    #[serde(default)]
    planners: PlannersTable,
    network: NetworkSettings,
    authority: Option<Authority>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Autopilot {
    link: String,
    system_id: u8,
    #[serde(default)]
    cable_is_private: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Lidar {
    sensor: String,
    network: Option<NetworkSettings>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DatumTable {
    latitude_deg: f64,
    longitude_deg: f64,
    height_m: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Mission {
    home: [f64; 3],
    waypoints: Vec<[f64; 3]>,
    #[serde(default = "takeoff_height_m")]
    takeoff_height_m: f64,
    #[serde(default = "return_altitude_m")]
    return_altitude_m: f64,
    #[serde(default)]
    without_ground: WithoutGround,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScriptTable {
    file: PathBuf,
    #[serde(default)]
    with: BTreeMap<String, Argument>,
    #[serde(rename = "as")]
    called: Option<String>,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "snake_case")]
enum WithoutGround {
    #[default]
    Continue,
    Return,
    Land,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FenceTable {
    min: [f64; 3],
    max: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct EnvelopeTable {
    cruise_m_s: f64,
    climb_m_s: f64,
    brake_m_s2: f64,
    latency_s: f64,
    hull_m: f64,
    margin_m: f64,
    separation_m: f64,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct PlannersTable {
    global: GlobalPlanner,
    local: LocalPlanner,
}

impl Default for EnvelopeTable {
    fn default() -> Self {
        let Envelope { cruise_m_s, climb_m_s, brake_m_s2, latency_s, hull_m, margin_m, separation_m } =
            Envelope::default();
        Self { cruise_m_s, climb_m_s, brake_m_s2, latency_s, hull_m, margin_m, separation_m }
    }
}

fn state() -> PathBuf {
    "state".into()
}

fn lease_ms() -> u64 {
    1000
}

fn takeoff_height_m() -> f64 {
    2.5
}

fn return_altitude_m() -> f64 {
    4.0
}

impl Config {
    /// Reads and checks a configuration file.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::parse(&text, folder).with_context(|| path.display().to_string())
    }

    /// The configuration that `agent/agent.toml` shows.
    pub fn example() -> anyhow::Result<Self> {
        Self::parse(EXAMPLE, Path::new("")).context("agent/agent.toml")
    }

    fn parse(text: &str, folder: &Path) -> anyhow::Result<Self> {
        toml::from_str::<File>(text)?.check(folder)
    }
}

const EXAMPLE: &str = include_str!("../../../agent.toml");

impl File {
    fn check(self, folder: &Path) -> anyhow::Result<Config> {
        let name = NodeName::new(&self.node).context("`node`")?;
        ensure!(self.roster.contains(&self.node), "`roster` lacks this vehicle, {name}");
        ensure!(self.roster.contains(&self.ground), "`roster` lacks the ground station, {}", self.ground);
        ensure!(
            (100..=10_000).contains(&self.lease_ms),
            "`lease_ms` is {}: expected 100 to 10000",
            self.lease_ms
        );
        ensure!(self.autopilot.system_id > 0, "`autopilot.system_id` is 0: expected 1 to 255");
        let autopilot: Address = self.autopilot.link.parse().context("`autopilot.link`")?;
        autopilot.check(self.autopilot.cable_is_private).context("`autopilot.link`")?;
        let lidar = self.lidar.map(|lidar| lidar.check(folder)).transpose()?;
        let fence = Fence { min: self.fence.min, max: self.fence.max };
        self.mission.check(&fence)?;
        let airspace = self.airspace.check()?;
        self.mission.check_zones(&airspace)?;
        let agent = AgentConfig {
            fleet: self.fleet,
            node: self.node,
            ground: self.ground,
            roster: self.roster,
            incarnation: 0,
            system_id: self.autopilot.system_id,
            datum: self.datum.check()?,
            home: self.mission.home,
            waypoints: self.mission.waypoints,
            takeoff_height_m: self.mission.takeoff_height_m,
            return_altitude_m: self.mission.return_altitude_m,
            lidar: lidar.is_some(),
            fence,
            airspace,
            envelope: self.envelope.check()?,
            planners: Planners { global: self.planners.global, local: self.planners.local },
            link_loss: match self.mission.without_ground {
                WithoutGround::Continue => LinkLossPolicy::Continue,
                WithoutGround::Return => LinkLossPolicy::Return,
                WithoutGround::Land => LinkLossPolicy::Land,
            },
            scripts: self.script.iter().map(|script| script.read(folder)).collect::<anyhow::Result<_>>()?,
            lease: Duration::from_millis(self.lease_ms),
            authority: self.authority.unwrap_or_else(standard_authority),
            kept: Kept::default(),
            seed: self.seed,
        };
        let network = self.network.relative_to(folder);
        Ok(Config { agent, name, autopilot, lidar, network, state: folder.join(self.state) })
    }
}

impl ScriptTable {
    fn read(&self, folder: &Path) -> anyhow::Result<Assignment> {
        let path = folder.join(&self.file);
        let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        let script = ScriptFile::parse(&path.display().to_string(), &text)?;
        Ok(Assignment { script, with: self.with.clone(), called: self.called.clone() })
    }
}

impl Lidar {
    fn check(self, folder: &Path) -> anyhow::Result<LidarSource> {
        let sensor = NodeName::new(&self.sensor).context("`lidar.sensor`")?;
        Ok(LidarSource { sensor, network: self.network.map(|network| network.relative_to(folder)) })
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
        let inside = |[x, y, z]: [f64; 3]| {
            [x, y, z]
                .iter()
                .zip(fence.min.iter().zip(&fence.max))
                .all(|(c, (min, max))| (min..=max).contains(&c))
        };
        ensure!(
            !self.waypoints.is_empty(),
            "`mission.waypoints` is empty: name at least the point to land at"
        );
        for (number, point) in (1..).zip(&self.waypoints) {
            ensure!(inside(*point), "`mission.waypoints`: number {number}, {point:?}, is outside the fence");
        }
        ensure!(inside(self.home), "`mission.home`, {:?}, is outside the fence", self.home);
        positive("mission.takeoff_height_m", self.takeoff_height_m)?;
        positive("mission.return_altitude_m", self.return_altitude_m)?;
        let [x, y, z] = self.home;
        for (field, height_m) in
            [("takeoff_height_m", z + self.takeoff_height_m), ("return_altitude_m", self.return_altitude_m)]
        {
            ensure!(
                inside([x, y, height_m]),
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

impl DatumTable {
    fn check(&self) -> anyhow::Result<Datum> {
        let Self { latitude_deg, longitude_deg, height_m } = *self;
        ensure!(
            (-89.0..=89.0).contains(&latitude_deg),
            "`datum.latitude_deg` is {latitude_deg}: expected -89 to 89"
        );
        ensure!(
            (-180.0..=180.0).contains(&longitude_deg),
            "`datum.longitude_deg` is {longitude_deg}: expected -180 to 180"
        );
        ensure!(height_m.is_finite(), "`datum.height_m` is {height_m}: expected a number");
        Ok(Datum::from_degrees(latitude_deg, longitude_deg, height_m))
    }
}

impl EnvelopeTable {
    fn check(&self) -> anyhow::Result<Envelope> {
        Ok(Envelope {
            cruise_m_s: positive("envelope.cruise_m_s", self.cruise_m_s)?,
            climb_m_s: positive("envelope.climb_m_s", self.climb_m_s)?,
            brake_m_s2: positive("envelope.brake_m_s2", self.brake_m_s2)?,
            latency_s: positive("envelope.latency_s", self.latency_s)?,
            hull_m: positive("envelope.hull_m", self.hull_m)?,
            margin_m: positive("envelope.margin_m", self.margin_m)?,
            separation_m: positive("envelope.separation_m", self.separation_m)?,
        })
    }
}

fn positive(field: &str, number: f64) -> anyhow::Result<f64> {
    ensure!(number.is_finite() && number > 0.0, "`{field}` is {number}: expected a number above 0");
    Ok(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str) -> anyhow::Result<Config> {
        Config::parse(text, Path::new("/etc/skein"))
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
        ] {
            let text = EXAMPLE.replace(from, to);
            assert_ne!(text, EXAMPLE, "{from} is not in the example");
            let error = format!("{:#}", check(&text).err().expect(fault));
            assert!(error.contains(fault), "{error} does not name {fault}");
        }
    }
}
