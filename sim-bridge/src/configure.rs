//! `configure`: the configuration files of a scenario's swarm, one for each process.
//!
//! They are the examples `agent/agent.toml` and `ground/ground.toml`, with their explanations, filled in.

use std::fmt::{Debug, Write as _};
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use serde_json::json;
use skein_agent::{AgentConfig, AirspaceTable};
use skein_bp::script::Assignment;

use crate::cli::{self, Network, Setup};
use crate::fly::{FLEET, GROUND, agent_configs, ground_config};
use crate::scenario::Scenario;
use crate::world_host::WORLD;

/// The ports of nodes for one another: the world, the ground station or a router, and from there on the vehicles.
const WORLD_PORT: u16 = 7446;
const GROUND_PORT: u16 = 7447;
const FIRST_VEHICLE_PORT: u16 = 7450;
const CONSOLE_PORT: u16 = 8700;
/// The port of vehicle 0's agent for its autopilot.
const COMPANION_PORT: u16 = 14540;

const AGENT: &str = include_str!("../../agent/agent.toml");
const GROUND_STATION: &str = include_str!("../../ground/ground.toml");
const WORLD_EXAMPLE: &str = include_str!("../world.toml");

/// The port of the router, or of the ground station in its place.
#[must_use]
pub fn router_port(port_offset: u16) -> u16 {
    GROUND_PORT + port_offset
}

#[must_use]
pub fn console(port_offset: u16) -> SocketAddr {
    (Ipv4Addr::LOCALHOST, CONSOLE_PORT + port_offset).into()
}

/// The files that a swarm's processes are started with.
#[derive(Debug)]
pub struct Files {
    /// For `skein-sim serve`.
    pub world: PathBuf,
    /// For `skein-ground serve`.
    pub ground: PathBuf,
    /// For `skein-agent run`, in the order of the vehicles.
    pub agents: Vec<PathBuf>,
}

/// Writes the files, and says how to start the swarm.
///
/// # Errors
/// A fault in the scenario; a file that cannot be written.
pub fn run(args: &cli::Configure, as_json: bool) -> anyhow::Result<()> {
    let scenario = args.world.open()?;
    let files = write(&scenario, &args.out, args.setup)?;
    if as_json {
        println!("{}", json!({ "world": files.world, "ground": files.ground, "agents": files.agents }));
    } else {
        print!("{}", instructions(args, &files));
    }
    Ok(())
}

fn instructions(args: &cli::Configure, files: &Files) -> String {
    let mut text = String::from("Start each in a terminal of its own, in any order:\n\n");
    let cli::Configure { world: cli::WorldArgs { scenario, overrides, seed }, setup, .. } = args;
    if setup.network == Network::Zenohd {
        let port = router_port(setup.port_offset);
        let _ = writeln!(text, "  zenohd --listen tcp/127.0.0.1:{port} --no-multicast-scouting");
    }
    let mut world = format!("  skein-sim serve {scenario} --seed {seed}");
    if let Some(vehicles) = overrides.vehicles {
        let _ = write!(world, " --vehicles {vehicles}");
    }
    for (option, files) in [("--world", overrides.world.as_slice()), ("--mission", &overrides.missions)] {
        for file in files {
            let _ = write!(world, " {option} {}", file.display());
        }
    }
    if setup.port_offset > 0 {
        let _ = write!(world, " --port-offset {}", setup.port_offset);
    }
    let _ = writeln!(text, "{world} --config {}", files.world.display());
    let _ = writeln!(text, "  skein-ground serve --config {}", files.ground.display());
    for agent in &files.agents {
        let _ = writeln!(text, "  skein-agent run --config {}", agent.display());
    }
    let _ = writeln!(text, "\nThe console is then at http://{}.", console(setup.port_offset));
    text
}

/// Writes the files of a scenario's swarm into `folder`, which is made if it is missing.
///
/// # Errors
/// A file that cannot be written.
pub fn write(scenario: &Scenario, folder: &Path, setup: Setup) -> anyhow::Result<Files> {
    std::fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))?;
    let save = |name: &str, text: String| {
        let path = folder.join(name);
        std::fs::write(&path, text).with_context(|| format!("{}: cannot be written", path.display()))?;
        anyhow::Ok(path)
    };
    let agents = agent_configs(scenario);
    let world = save("world.toml", setup.world())?;
    let muster = ground_config(scenario, skein_wire::Fleet::new(FLEET)?, cli::Controller::Bp).muster;
    let ground = save("ground.toml", setup.ground(&agents, muster))?;
    let agents = (0..).zip(&agents).map(|(index, agent)| {
        let stem = agent.node.replace('/', "-");
        let mut text = setup.agent(index, agent) + &airspace_tables(agent)?;
        for assignment in &agent.scripts {
            let file = format!("{stem}-{}.json", assignment.name());
            save(&file, serde_json::to_string_pretty(&assignment.script)?)?;
            text += &script_table(&file, assignment);
        }
        save(&format!("{stem}.toml"), text)
    });
    Ok(Files { world, ground, agents: agents.collect::<anyhow::Result<_>>()? })
}

/// The airspace in an agent's configuration.
fn airspace_tables(agent: &AgentConfig) -> anyhow::Result<String> {
    let airspace = AirspaceTable::of(&agent.airspace);
    if airspace == AirspaceTable::default() {
        return Ok(String::new());
    }
    let tables = toml::Table::from_iter([("airspace".to_owned(), toml::Value::try_from(airspace)?)]);
    Ok(format!("\n{}", toml::to_string(&tables)?))
}

/// A script in an agent's configuration. Names, texts, numbers and lists are written in JSON as in TOML.
fn script_table(file: &str, assignment: &Assignment) -> String {
    let with: Vec<String> = assignment.with.iter().map(|(name, value)| format!("{name} = {value}")).collect();
    let name = assignment.name();
    format!("\n[[script]]\nfile = {file:?}\nwith = {{ {} }}\nas = {name:?}\n", with.join(", "))
}

impl Setup {
    fn endpoint(&self, port: u16) -> String {
        format!("tcp/127.0.0.1:{}", port + self.port_offset)
    }

    /// Fills in `[network]` of a node that listens on `port`, and connects to those before it.
    fn join(&self, template: Template, port: u16, before: Vec<u16>) -> Template {
        let router = self.endpoint(GROUND_PORT);
        let (mode, listen, connect) = match self.network {
            Network::Peer => (
                "peer",
                vec![self.endpoint(port)],
                before.into_iter().map(|port| self.endpoint(port)).collect(),
            ),
            Network::Router if port == GROUND_PORT => ("router", vec![router], vec![]),
            Network::Router | Network::Zenohd => ("client", vec![], vec![router]),
        };
        template
            .set("network", "mode", &mode)
            .set("network", "listen", &listen)
            .set("network", "connect", &connect)
    }

    fn world(&self) -> String {
        let template = Template(WORLD_EXAMPLE.to_owned()).set("", "fleet", &FLEET).set("", "node", &WORLD);
        self.join(template, WORLD_PORT, vec![]).0
    }

    fn ground(&self, agents: &[AgentConfig], muster: bool) -> String {
        let vehicles: Vec<&str> = agents.iter().map(|agent| agent.node.as_str()).collect();
        let template = Template(GROUND_STATION.to_owned())
            .set("", "fleet", &FLEET)
            .set("", "node", &GROUND.as_str())
            .set("", "vehicles", &vehicles)
            .set("", "launch", &if self.launch_on_order { "on_order" } else { "at_start" })
            .set("", "muster", &muster)
            .set("", "console", &console(self.port_offset).to_string())
            .set("", "record", &".");
        self.join(template, GROUND_PORT, vec![WORLD_PORT]).0
    }

    fn agent(&self, index: u16, agent: &AgentConfig) -> String {
        let datum = &agent.datum;
        let envelope = &agent.envelope;
        let template = Template(AGENT.to_owned())
            .set("", "fleet", &agent.fleet)
            .set("", "node", &agent.node)
            .set("", "ground", &agent.ground)
            .set("", "roster", &agent.roster)
            .set("", "seed", &i64::try_from(agent.seed).unwrap_or(i64::MAX))
            .set("autopilot", "link", &format!("udp:127.0.0.1:{}", COMPANION_PORT + index + self.port_offset))
            .set("autopilot", "system_id", &agent.system_id)
            .set("lidar", "sensor", &WORLD)
            .set("datum", "latitude_deg", &datum.latitude_rad.to_degrees())
            .set("datum", "longitude_deg", &datum.longitude_rad.to_degrees())
            .set("datum", "height_m", &datum.height_m)
            .set("mission", "home", &agent.home)
            .set("mission", "waypoints", &agent.waypoints)
            .set("mission", "takeoff_height_m", &agent.takeoff_height_m)
            .set("mission", "return_altitude_m", &agent.return_altitude_m)
            .set("fence", "min", &agent.fence.min)
            .set("fence", "max", &agent.fence.max)
            .set("envelope", "cruise_m_s", &envelope.cruise_m_s)
            .set("envelope", "climb_m_s", &envelope.climb_m_s)
            .set("envelope", "brake_m_s2", &envelope.brake_m_s2)
            .set("envelope", "latency_s", &envelope.latency_s)
            .set("envelope", "hull_m", &envelope.hull_m)
            .set("envelope", "margin_m", &envelope.margin_m)
            .set("envelope", "separation_m", &envelope.separation_m)
            .set("planners", "global", &agent.planners.global.name())
            .set("planners", "local", &agent.planners.local.name());
        let before =
            [WORLD_PORT, GROUND_PORT].into_iter().chain((0..index).map(|index| FIRST_VEHICLE_PORT + index));
        self.join(template, FIRST_VEHICLE_PORT + index, before.collect()).0
    }
}

/// A configuration file with explanations, in which fields are filled in where they stand, commented out or not.
struct Template(String);

impl Template {
    /// Sets a field of a table; `""` is what stands before the first. Rust writes texts, numbers and lists as TOML does.
    fn set(self, table: &str, field: &str, value: &impl Debug) -> Self {
        let mut inside = "";
        let mut lines = Vec::new();
        for line in self.0.lines() {
            if let Some(name) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
                inside = name;
            }
            let bare = line.strip_prefix('#').unwrap_or(line);
            let is_field =
                inside == table && bare.strip_prefix(field).is_some_and(|rest| rest.starts_with(" ="));
            lines.push(if is_field { format!("{field} = {value:?}") } else { line.to_owned() });
        }
        Self(lines.join("\n") + "\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_is_filled_in_where_it_stands_and_in_its_table_only() {
        let example = "# Why.\n#a = 1\nab = 2\n[one]\na = 3\n[two]\n#a = 4\n";
        let filled = Template(example.to_owned()).set("", "a", &"x").set("two", "a", &[1.5, 2.0]).0;
        assert_eq!(filled, "# Why.\na = \"x\"\nab = 2\n[one]\na = 3\n[two]\na = [1.5, 2.0]\n");
    }

    #[test]
    fn every_field_that_is_filled_in_is_one_of_the_example() {
        let scenario = Scenario::open("window", &crate::scenario::Overrides::default(), 3).unwrap();
        let agents = agent_configs(&scenario);
        for network in [Network::Peer, Network::Router, Network::Zenohd] {
            let setup = Setup { network, port_offset: 100, launch_on_order: false };
            let agent: toml::Table = setup.agent(1, &agents[1]).parse().unwrap();
            assert_eq!(agent["mission"]["waypoints"].as_array().unwrap().len(), agents[1].waypoints.len());
            assert_eq!(agent["autopilot"]["link"].as_str(), Some("udp:127.0.0.1:14641"));
            assert_eq!(agent["envelope"].as_table().unwrap().len(), 7);
            assert_eq!(agent["planners"]["global"].as_str(), Some("astar"));
            assert_eq!(agent["planners"]["local"].as_str(), Some("apf"));
            let ground: toml::Table = setup.ground(&agents, true).parse().unwrap();
            assert_eq!(ground["vehicles"].as_array().unwrap().len(), agents.len());
            assert_eq!(
                (ground["muster"].as_bool(), ground["launch"].as_str()),
                (Some(true), Some("at_start"))
            );
            let world: toml::Table = setup.world().parse().unwrap();
            let mode = |table: &toml::Table| table["network"]["mode"].as_str().unwrap().to_owned();
            let modes = [mode(&world), mode(&ground), mode(&agent)];
            match network {
                Network::Peer => assert_eq!(modes, ["peer", "peer", "peer"]),
                Network::Router => assert_eq!(modes, ["client", "router", "client"]),
                Network::Zenohd => assert_eq!(modes, ["client", "client", "client"]),
            }
        }
    }
}
