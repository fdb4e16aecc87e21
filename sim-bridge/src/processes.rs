//! A swarm as processes: the world here, the ground station and each agent in a process of its own, over Zenoh.

use std::collections::BTreeMap;
use std::fs::File;
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use skein_dbp::NodeName;

use crate::autopilots::Autopilots;
use crate::cli::{Network, Setup};
use crate::configure::{self, Files};
use crate::fly::{GROUND, vehicle_name};
use crate::scenario::Scenario;
use crate::world_host::{WorldConfig, WorldHost};

/// Patience with a process that was asked to end.
const TIME_TO_END: Duration = Duration::from_secs(5);
/// Patience with a router until it listens.
const TIME_TO_LISTEN: Duration = Duration::from_secs(10);

/// The processes of a swarm. They end with this.
pub struct Processes {
    world: WorldHost,
    files: Files,
    logs: PathBuf,
    folder: PathBuf,
    nodes: BTreeMap<NodeName, Running>,
    router: Option<Child>,
    port_offset: u16,
    programs: Programs,
}

/// The programs that are run in place of `skein-agent` and `skein-ground`: those with behaviours of one's own.
#[derive(Clone, Debug, Default)]
pub struct Programs {
    pub agent: Option<PathBuf>,
    pub ground: Option<PathBuf>,
}

/// A node's process.
struct Running {
    child: Child,
    since: Instant,
}

/// A second process of a node. It ends with this.
pub struct Double {
    child: Child,
    pub log: PathBuf,
}

impl Drop for Double {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Processes {
    /// Writes their configurations into `folder`, where their logs and the recording go too, and starts them all.
    pub fn start(scenario: &Scenario, folder: &Path, setup: Setup) -> anyhow::Result<Self> {
        let mut processes = Self::prepare(scenario, folder, setup, &Autopilots::default())?;
        processes.start_all()?;
        Ok(processes)
    }

    /// The same, but starts nothing but the world and, where there is one, the router.
    pub fn prepare(
        scenario: &Scenario,
        folder: &Path,
        setup: Setup,
        autopilots: &Autopilots,
    ) -> anyhow::Result<Self> {
        let Setup { network, port_offset, .. } = setup;
        let files = configure::write(scenario, folder, setup)?;
        let logs = folder.join("logs");
        std::fs::create_dir_all(&logs).with_context(|| format!("{}: cannot be made", logs.display()))?;
        let router = match network {
            Network::Zenohd => {
                Some(start_zenohd(&logs, configure::router_port(port_offset), files.zenohd.as_deref())?)
            }
            Network::Peer | Network::Router => None,
        };
        let config = WorldConfig::read(&files.world)?;
        let world = WorldHost::open(scenario, config, 1.0, port_offset, (autopilots, folder))?;
        let nodes = BTreeMap::new();
        let folder = folder.to_owned();
        Ok(Self { world, files, folder, logs, nodes, router, port_offset, programs: Programs::default() })
    }

    /// The same, of other programs.
    #[must_use]
    pub fn running(mut self, programs: Programs) -> Self {
        self.programs = programs;
        self
    }

    /// Starts the ground station and all agents.
    pub fn start_all(&mut self) -> anyhow::Result<()> {
        self.start_node(&GROUND)?;
        (0..self.files.agents.len()).try_for_each(|index| self.start_node(&vehicle_name(index)))
    }

    /// Leads the agent of vehicle `index` to another port in the place of one that its configuration names; its lidar,
    /// which is on board, keeps the old one.
    ///
    /// # Errors
    /// Its configuration cannot be changed, or does not name that port.
    pub fn reroute(&self, index: usize, from: u16, to: u16) -> anyhow::Result<()> {
        let path = self.files.agents.get(index).context("no such vehicle")?;
        let text = std::fs::read_to_string(path)?;
        let rerouted = text.replace(&format!("tcp/127.0.0.1:{from}"), &format!("tcp/127.0.0.1:{to}"));
        anyhow::ensure!(rerouted != text, "{} does not name port {from}", path.display());
        let on_board = ["#[lidar.network]", "#mode = \"client\"", "#listen = []"];
        let mut rerouted = on_board.iter().fold(rerouted, |text, line| text.replacen(line, &line[1..], 1));
        let connect = format!("connect = [\"tcp/127.0.0.1:{from}\"]");
        rerouted = rerouted.replacen("#connect = [\"tcp/127.0.0.1:7446\"]", &connect, 1);
        Ok(std::fs::write(path, rerouted)?)
    }

    /// Starts a second process with a vehicle's own configuration.
    pub fn start_double(&self, node: &NodeName) -> anyhow::Result<Double> {
        let log = self.logs.join(format!("{}-double.log", node.as_str().replace('/', "-")));
        // With a place of its own to listen: only its name is that of the other.
        let config = self.config_of(node)?;
        let text = std::fs::read_to_string(config)?;
        let double = config.with_extension("double.toml");
        std::fs::write(&double, elsewhere(&text))?;
        let mut command = self.program_of(node)?;
        command.arg("--config").arg(double);
        Ok(Double { child: spawn(command, &log)?, log })
    }

    /// The folder of configurations, logs and the recording.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The distance of all network ports from the usual ones.
    pub fn port_offset(&self) -> u16 {
        self.port_offset
    }

    /// For how long a node's process has run.
    pub fn age_of(&self, node: &NodeName) -> Option<Duration> {
        self.nodes.get(node).map(|running| running.since.elapsed())
    }

    /// The number by which the operating system knows a node's process.
    pub fn process(&self, node: &NodeName) -> Option<u32> {
        self.nodes.get(node).map(|running| running.child.id())
    }

    fn config_of(&self, node: &NodeName) -> anyhow::Result<&Path> {
        match node.as_str().strip_prefix("uav/").and_then(|number| number.parse::<usize>().ok()) {
            None => Ok(&self.files.ground),
            Some(number) => Ok(self.files.agents.get(number.saturating_sub(1)).context("no such vehicle")?),
        }
    }

    /// The program that a node runs, but for its configuration.
    fn program_of(&self, node: &NodeName) -> anyhow::Result<Command> {
        let (own, skeins, verb) = if *node == *GROUND {
            (&self.programs.ground, "skein-ground", "serve")
        } else {
            (&self.programs.agent, "skein-agent", "run")
        };
        let mut command = Command::new(own.clone().map_or_else(|| beside(skeins), Ok)?);
        command.arg(verb);
        Ok(command)
    }

    /// Starts a node, for the first time or again.
    pub fn start_node(&mut self, node: &NodeName) -> anyhow::Result<()> {
        let mut command = self.program_of(node)?;
        command.arg("--config").arg(self.config_of(node)?);
        let child = spawn(command, &self.log_of(node))?;
        self.nodes.insert(node.clone(), Running { child, since: Instant::now() });
        Ok(())
    }

    pub fn log_of(&self, node: &NodeName) -> PathBuf {
        self.logs.join(format!("{}.log", node.as_str().replace('/', "-")))
    }

    /// Moves the world on by one step, in time with the clock.
    pub fn step(&mut self) {
        self.world.step();
    }

    pub fn world(&self) -> &WorldHost {
        &self.world
    }

    pub fn console(&self) -> SocketAddr {
        configure::console(self.port_offset)
    }

    /// Sends a signal to a node's process.
    pub fn signal(&self, node: &NodeName, signal: Signal) -> anyhow::Result<()> {
        let running = self.nodes.get(node).context("no such process")?;
        kill(pid(&running.child), signal).with_context(|| format!("{node} cannot be sent {signal}"))
    }

    /// Ends a node's process without warning.
    pub fn kill(&mut self, node: &NodeName) -> anyhow::Result<()> {
        let mut running = self.nodes.remove(node).context("no such process")?;
        running.child.kill()?;
        running.child.wait()?;
        Ok(())
    }

    /// A node whose process has ended by itself, with how.
    pub fn ended(&mut self) -> Option<String> {
        self.nodes.iter_mut().find_map(|(node, running)| {
            let status = running.child.try_wait().ok()??;
            Some(format!("{node} has ended by itself, {status}"))
        })
    }

    /// Asks the agents to land.
    pub fn call_off(&self) {
        for (_, running) in self.nodes.iter().filter(|(node, _)| **node != *GROUND) {
            // Whoever has ended already needs no asking.
            let _ = kill(pid(&running.child), Signal::SIGTERM);
        }
    }

    /// Asks all processes to end, and waits until they have: agents land first what still flies.
    pub fn end(mut self) {
        for running in self.nodes.values() {
            // Whoever has ended already needs no asking.
            let _ = kill(pid(&running.child), Signal::SIGTERM);
        }
        let deadline = Instant::now() + TIME_TO_END;
        while Instant::now() < deadline
            && self.nodes.values_mut().any(|running| matches!(running.child.try_wait(), Ok(None)))
        {
            self.world.step();
        }
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        let nodes = self.nodes.values_mut().map(|running| &mut running.child);
        for child in nodes.chain(&mut self.router) {
            // Nothing is left behind, whatever state it is in.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

fn pid(child: &Child) -> Pid {
    Pid::from_raw(i32::try_from(child.id()).unwrap_or(i32::MAX))
}

/// A program of Skein's, which was built beside this one.
fn beside(program: &str) -> anyhow::Result<PathBuf> {
    let own = std::env::current_exe().context("where this program is")?;
    // Tests run from a folder within.
    let folders = own.ancestors().skip(1).take(2);
    let found = folders.map(|folder| folder.join(program)).find(|path| path.is_file());
    found.with_context(|| {
        format!(
            "{program} is not beside {}: build all with `cargo build --release --workspace`",
            own.display()
        )
    })
}

fn spawn(mut command: Command, log: &Path) -> anyhow::Result<Child> {
    let file = File::options().create(true).append(true).open(log);
    let file = file.with_context(|| format!("{}: cannot be written", log.display()))?;
    let errors = file.try_clone()?;
    command.stdin(Stdio::null()).stdout(file).stderr(errors);
    let program = command.get_program().to_owned();
    command.spawn().with_context(|| format!("{} cannot be started", program.display()))
}

/// The configuration of a node, but that it listens elsewhere, and connects to the place where the node listens.
fn elsewhere(config: &str) -> String {
    let place =
        config.lines().find_map(|line| line.strip_prefix("listen = [")?.strip_suffix(']')).unwrap_or("");
    let elsewhere = |line: &str| match line.split_once(" = [") {
        Some(("listen", _)) if !place.is_empty() => {
            format!("listen = [{}:0\"]", place.rsplit_once(':').map_or("", |(host, _)| host))
        }
        Some(("connect", rest)) if !place.is_empty() && rest != "]" => format!("connect = [{place}, {rest}"),
        Some(("connect", _)) => format!("connect = [{place}]"),
        _ => line.to_owned(),
    };
    config.lines().map(elsewhere).collect::<Vec<_>>().join("\n")
}

fn start_zenohd(logs: &Path, port: u16, config: Option<&Path>) -> anyhow::Result<Child> {
    let mut command = Command::new("zenohd");
    match config {
        Some(config) => command.arg("--config").arg(config),
        None => command.arg("--listen").arg(format!("tcp/127.0.0.1:{port}")).arg("--no-multicast-scouting"),
    };
    command.arg("--rest-http-port").arg("none");
    let mut child = spawn(command, &logs.join("zenohd.log"))
        .context("`zenohd` is needed for --network zenohd: cargo install zenohd")?;
    let deadline = Instant::now() + TIME_TO_LISTEN;
    while TcpStream::connect((Ipv4Addr::LOCALHOST, port)).is_err() {
        let ended = child.try_wait()?;
        anyhow::ensure!(
            ended.is_none() && Instant::now() < deadline,
            "zenohd does not listen on port {port}: see {}",
            logs.join("zenohd.log").display()
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok(child)
}
