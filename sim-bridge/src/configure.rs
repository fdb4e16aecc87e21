//! `configure`: the configuration files of a scenario's swarm, one for each process.
//!
//! They are the examples `agent/agent.toml` and `ground/ground.toml`, with their explanations, filled in.

use std::fmt::Write as _;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::time::SystemTime;

use anyhow::Context as _;
use serde::Serialize;
use serde_json::json;
use skein_agent::AgentConfig;
use skein_agent::autopilot_link::Address;
use skein_agent::config_file::{AgentFile, EXAMPLE as AGENT_EXAMPLE, ScriptEntry};
use skein_bp::behaviour::Behaviours;
use skein_ground::GroundConfig;
use skein_ground::config_file::{EXAMPLE as GROUND_EXAMPLE, GroundFile};
use skein_wire::{Fleet, NodeName};
use skein_zenoh::{Authority, Holder, Mode, NetworkSettings, Security, ZenohConfig};

use crate::cli::{self, Network, Setup};
use crate::fly::{FLEET, GROUND, agent_configs, ground_config, node_name, vehicle_name};
use crate::mavlink_ports::COMPANION;
use crate::scenario::Scenario;
use crate::world_host::{WORLD, WorldConfig};

/// The ports of nodes for one another: the world, the ground station or a router, and from there on the vehicles.
const WORLD_PORT: u16 = 7446;
const GROUND_PORT: u16 = 7447;
const FIRST_VEHICLE_PORT: u16 = 7450;
const CONSOLE_PORT: u16 = 8700;

/// The folder of certificates, beside the files.
const CERTIFICATES: &str = "certificates";
/// Days for which certificates of a simulated fleet are valid.
const DAYS: u32 = 365;

/// The name of a `zenohd`, which relays.
static ZENOHD: LazyLock<NodeName> = LazyLock::new(|| node_name("router", "zenohd"));

const WORLD_EXAMPLE: &str = include_str!("../world.toml");

/// The port of the router, or of the ground station in its place.
pub fn router_port(port_offset: u16) -> u16 {
    GROUND_PORT + port_offset
}

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
    /// For `zenohd`, where there is one that is to know its members.
    pub zenohd: Option<PathBuf>,
}

/// Writes the files, and says how to start the swarm.
pub fn run(args: &cli::Configure, known: &Behaviours, as_json: bool) -> anyhow::Result<()> {
    let scenario = args.world.open(known)?;
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
    let cli::Configure { world: cli::WorldArgs { scenario, overrides, seed }, setup, autopilots, .. } = args;
    if setup.network == Network::Zenohd {
        let port = router_port(setup.port_offset);
        let _ = match &files.zenohd {
            Some(file) => writeln!(text, "  zenohd --config {}", file.display()),
            None => writeln!(text, "  zenohd --listen tcp/127.0.0.1:{port} --no-multicast-scouting"),
        };
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
    world.push_str(&autopilots.options());
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
pub fn write(scenario: &Scenario, folder: &Path, setup: Setup) -> anyhow::Result<Files> {
    std::fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))?;
    let save = |name: &str, text: String| {
        let path = folder.join(name);
        std::fs::write(&path, text).with_context(|| format!("{}: cannot be written", path.display()))?;
        anyhow::Ok(path)
    };
    let ground = GroundConfig {
        launch_on_order: setup.launch_on_order,
        ..ground_config(scenario, Fleet::new(FLEET)?, cli::Controller::Bp)
    };
    let zenohd = if setup.secure { setup.certify(scenario, &ground, folder)? } else { None };
    let zenohd = zenohd.map(|text| save("zenohd.json5", text)).transpose()?;
    let world = save("world.toml", filled_in(WORLD_EXAMPLE, &setup.world())?)?;
    let ground = save("ground.toml", filled_in(GROUND_EXAMPLE, &setup.ground(&ground))?)?;
    let agents = agent_configs(scenario);
    let agents = (0..).zip(&agents).map(|(index, agent)| {
        let stem = agent.node.replace('/', "-");
        let mut config = setup.agent(index, agent);
        for assignment in &agent.scripts {
            let name = assignment.name();
            let file = format!("{stem}-{name}.json");
            save(&file, serde_json::to_string_pretty(&assignment.script)?)?;
            let with = assignment.with.clone();
            config.script.push(ScriptEntry { file: file.into(), with, called: Some(name.to_owned()) });
        }
        save(&format!("{stem}.toml"), filled_in(AGENT_EXAMPLE, &config)?)
    });
    Ok(Files { world, ground, agents: agents.collect::<anyhow::Result<_>>()?, zenohd })
}

impl Setup {
    fn endpoint(&self, port: u16) -> String {
        let protocol = if self.secure { "tls" } else { "tcp" };
        format!("{protocol}/127.0.0.1:{}", port + self.port_offset)
    }

    /// Makes the certificates of all members, and gives the text of the file of the router that is none of them.
    fn certify(
        &self,
        scenario: &Scenario,
        ground: &GroundConfig,
        folder: &Path,
    ) -> anyhow::Result<Option<String>> {
        let folder = folder.canonicalize().context(folder.display().to_string())?.join(CERTIFICATES);
        let now = SystemTime::now();
        let mut authority = Authority::open(&folder, FLEET, now)?;
        let agents = agent_configs(scenario).into_iter().map(|agent| NodeName::new(&agent.node));
        let others = ground.operators.iter().cloned().map(Ok).chain([NodeName::new(WORLD)]);
        let members = agents.chain(others).map(|node| Ok(Holder::here(node?)));
        let mut members = members.collect::<anyhow::Result<Vec<_>>>()?;
        let relays = self.network == Network::Router;
        members.push(Holder { relays, ..Holder::here(GROUND.clone()) });
        if self.network == Network::Zenohd {
            members.push(Holder { relays: true, ..Holder::here(ZENOHD.clone()) });
        }
        authority.issue(&members, DAYS, false, now)?;
        let router = NetworkSettings {
            mode: Mode::Router,
            listen: vec![self.endpoint(GROUND_PORT)],
            connect: vec![],
            security: Some(authority.security(&ZENOHD)),
        };
        let zenohd = ZenohConfig::new(Fleet::new(FLEET)?, router).of(&ZENOHD, []);
        Ok((self.network == Network::Zenohd).then(|| zenohd.to_file()).transpose()?)
    }

    /// The network settings of `node`, which listens on `port` and connects to those before it.
    fn join(&self, node: &NodeName, port: u16, before: impl IntoIterator<Item = u16>) -> NetworkSettings {
        let router = vec![self.endpoint(GROUND_PORT)];
        let (mode, listen, connect) = match self.network {
            Network::Peer => {
                let connect = before.into_iter().map(|port| self.endpoint(port)).collect();
                (Mode::Peer, vec![self.endpoint(port)], connect)
            }
            Network::Router if port == GROUND_PORT => (Mode::Router, router, vec![]),
            Network::Router | Network::Zenohd => (Mode::Client, vec![], router),
        };
        let security = self.secure.then(|| Security::in_folder(Path::new(CERTIFICATES), node));
        NetworkSettings { mode, listen, connect, security }
    }

    fn world(&self) -> WorldConfig {
        WorldConfig {
            network: self.join(&node_name("sim", "world"), WORLD_PORT, []),
            ..WorldConfig::default()
        }
    }

    fn ground(&self, station: &GroundConfig) -> GroundFile {
        let network = self.join(&GROUND, GROUND_PORT, [WORLD_PORT]);
        let mut file = GroundFile::of(station, console(self.port_offset), network);
        file.record = ".".into();
        file
    }

    fn agent(&self, index: u16, agent: &AgentConfig) -> AgentFile {
        let vehicles = (0..index).map(|index| FIRST_VEHICLE_PORT + index);
        let network = self.join(
            &vehicle_name(index.into()),
            FIRST_VEHICLE_PORT + index,
            [WORLD_PORT, GROUND_PORT].into_iter().chain(vehicles),
        );
        let companion = (Ipv4Addr::LOCALHOST, COMPANION.1 + index + self.port_offset).into();
        AgentFile::of(agent, Address::UdpIn(companion), WORLD, network)
    }
}

/// A file that explains its fields, with those of `config` filled in where they stand, commented out or not; what has
/// no place there follows at the end.
fn filled_in(example: &str, config: &impl Serialize) -> anyhow::Result<String> {
    let mut config = toml::Table::try_from(config)?;
    let (mut text, mut table) = (String::new(), None);
    for line in example.lines() {
        if let Some(name) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
            table = Some(name);
        }
        let field = line.strip_prefix('#').unwrap_or(line).split_once(" = ").map(|(field, _)| field);
        let place = match table {
            None => Some(&mut config),
            Some(table) => config.get_mut(table).and_then(toml::Value::as_table_mut),
        };
        let filled = field.zip(place).and_then(|(field, place)| place.remove_entry(field));
        match filled {
            Some((field, value)) => writeln!(text, "{field} = {value}")?,
            None => writeln!(text, "{line}")?,
        }
    }
    config.retain(|_, value| value.as_table().is_none_or(|table| !table.is_empty()));
    if !config.is_empty() {
        write!(text, "\n{}", toml::to_string(&config)?)?;
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use skein_agent::bthreads::LinkLossPolicy;
    use skein_agent::config_file::Config;
    use skein_agent::{Errand, PayloadCommand};
    use skein_bp::behaviour::Behaviours;

    use super::*;

    #[test]
    fn a_field_is_filled_in_where_it_stands_and_in_its_table_only() {
        let example = "# Why.\n#a = 1\nab = 2\n[one]\na = 3\n[two]\n#a = 4\n";
        let config = json!({ "a": "x", "two": { "a": [1.5, 2.0] }, "three": { "b": 5 } });
        let expected = "# Why.\na = \"x\"\nab = 2\n[one]\na = 3\n[two]\na = [1.5, 2.0]\n\n[three]\nb = 5\n";
        assert_eq!(filled_in(example, &config).unwrap(), expected);
    }

    #[test]
    fn every_field_that_is_filled_in_is_one_of_the_example() {
        let without_ground = Some(LinkLossPolicy::Land);
        let overrides = crate::scenario::Overrides { without_ground, ..Default::default() };
        let scenario = Scenario::open("window", &overrides, 3).unwrap();
        let agents = agent_configs(&scenario);
        let station = ground_config(&scenario, Fleet::new(FLEET).unwrap(), cli::Controller::Bp);
        let station = GroundConfig { muster: true, ..station };
        for network in [Network::Peer, Network::Router, Network::Zenohd] {
            let setup = Setup { network, port_offset: 100, launch_on_order: false, secure: false };
            let agent: toml::Table =
                filled_in(AGENT_EXAMPLE, &setup.agent(1, &agents[1])).unwrap().parse().unwrap();
            assert_eq!(agent["mission"]["waypoints"].as_array().unwrap().len(), agents[1].waypoints.len());
            assert_eq!(agent["autopilot"]["link"].as_str(), Some("udp:127.0.0.1:14641"));
            assert_eq!(agent["envelope"].as_table().unwrap().len(), 10);
            assert_eq!(agent["mission"]["without_ground"].as_str(), Some("land"));
            assert_eq!(agent["planners"]["global"].as_str(), Some("astar"));
            assert_eq!(agent["planners"]["local"].as_str(), Some("apf"));
            let ground: toml::Table =
                filled_in(GROUND_EXAMPLE, &setup.ground(&station)).unwrap().parse().unwrap();
            assert_eq!(ground["vehicles"].as_array().unwrap().len(), agents.len());
            assert_eq!(
                (ground["muster"].as_bool(), ground["launch"].as_str()),
                (Some(true), Some("at_start"))
            );
            let world: toml::Table = filled_in(WORLD_EXAMPLE, &setup.world()).unwrap().parse().unwrap();
            let mode = |table: &toml::Table| table["network"]["mode"].as_str().unwrap().to_owned();
            let modes = [mode(&world), mode(&ground), mode(&agent)];
            match network {
                Network::Peer => assert_eq!(modes, ["peer", "peer", "peer"]),
                Network::Router => assert_eq!(modes, ["client", "router", "client"]),
                Network::Zenohd => assert_eq!(modes, ["client", "client", "client"]),
            }
        }
    }

    #[test]
    fn errands_and_rally_points_are_written_and_read_again() {
        let mut scenario = Scenario::built_in("window", None, 3).unwrap();
        scenario.rally = vec![scenario.vehicles[0].goal()];
        let mut params = [f64::NAN; 7];
        params[0] = 5.0;
        let payload = vec![PayloadCommand { command: 206, params }; 2];
        scenario.vehicles[0].errands = vec![Errand { before: 0, stay_s: 3.0, speed_m_s: Some(1.5), payload }];
        let agents = agent_configs(&scenario);
        let setup = Setup { network: Network::Peer, port_offset: 100, launch_on_order: false, secure: false };
        let text = filled_in(AGENT_EXAMPLE, &setup.agent(0, &agents[0])).unwrap();
        let read = Config::parse(&text, Path::new(""), &Behaviours::default()).unwrap().agent;
        let [errand] = &read.errands[..] else { panic!("one errand: {text}") };
        assert_eq!((errand.before, errand.stay_s, errand.speed_m_s), (0, 3.0, Some(1.5)));
        assert_eq!((errand.payload[1].command, errand.payload[1].params[0]), (206, 5.0));
        assert!(errand.payload[1].params[6].is_nan());
        assert_eq!(read.rally, agents[0].rally);
    }
}
