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

use crate::cli::Network;
use crate::configure::{self, Files};
use crate::fly::{GROUND, vehicle_name};
use crate::scenario::Scenario;
use crate::world_host::{WorldConfig, WorldHost};

/// How long a process that was asked to end may take.
const TIME_TO_END: Duration = Duration::from_secs(5);
/// How long a router may take to listen.
const TIME_TO_LISTEN: Duration = Duration::from_secs(10);

/// The processes of a swarm. They end with this.
pub struct Processes {
    world: WorldHost,
    files: Files,
    logs: PathBuf,
    nodes: BTreeMap<NodeName, Child>,
    router: Option<Child>,
    port_offset: u16,
}

/// How the processes are set up.
#[derive(Clone, Copy, Debug)]
pub struct Setup {
    /// How they are joined.
    pub network: Network,
    /// How much further up than by convention all network ports are.
    pub port_offset: u16,
    /// Whether the swarm waits on the ground for an operator.
    pub launch_on_order: bool,
}

impl Processes {
    /// Writes their configurations into `folder`, where their logs and the recording go too, and starts them all.
    ///
    /// # Errors
    /// A program that is missing, a port that is taken, a file that cannot be written.
    pub fn start(scenario: &Scenario, folder: &Path, setup: Setup) -> anyhow::Result<Self> {
        let Setup { network, port_offset, launch_on_order } = setup;
        let files = configure::write(scenario, folder, network, port_offset, launch_on_order)?;
        let logs = folder.join("logs");
        std::fs::create_dir_all(&logs).with_context(|| format!("{}: cannot be made", logs.display()))?;
        let router = match network {
            Network::Zenohd => Some(start_zenohd(&logs, configure::router_port(port_offset))?),
            Network::Peer | Network::Router => None,
        };
        let world = WorldHost::open(scenario, WorldConfig::read(&files.world)?, 1.0, port_offset)?;
        let nodes = BTreeMap::new();
        let mut processes = Self { world, files, logs, nodes, router, port_offset };
        processes.start_node(&GROUND)?;
        for index in 0..scenario.vehicles.len() {
            processes.start_node(&vehicle_name(index))?;
        }
        Ok(processes)
    }

    /// Starts a node, for the first time or again.
    ///
    /// # Errors
    /// Its program is missing.
    pub fn start_node(&mut self, node: &NodeName) -> anyhow::Result<()> {
        let config = match node.as_str().strip_prefix("uav/").and_then(|number| number.parse::<usize>().ok())
        {
            None => &self.files.ground,
            Some(number) => self.files.agents.get(number.saturating_sub(1)).context("no such vehicle")?,
        };
        let (program, verb) =
            if *node == *GROUND { ("skein-ground", "serve") } else { ("skein-agent", "run") };
        let mut command = Command::new(beside(program)?);
        command.arg(verb).arg("--config").arg(config);
        let child = spawn(command, &self.log_of(node))?;
        self.nodes.insert(node.clone(), child);
        Ok(())
    }

    /// Where a node writes what it has to say.
    #[must_use]
    pub fn log_of(&self, node: &NodeName) -> PathBuf {
        self.logs.join(format!("{}.log", node.as_str().replace('/', "-")))
    }

    /// Moves the world on by one step, in time with the clock.
    pub fn step(&mut self) {
        self.world.step();
    }

    /// The world.
    #[must_use]
    pub fn world(&self) -> &WorldHost {
        &self.world
    }

    /// Where the console is served.
    #[must_use]
    pub fn console(&self) -> SocketAddr {
        configure::console(self.port_offset)
    }

    /// Sends a signal to a node's process.
    ///
    /// # Errors
    /// There is no such process any more.
    pub fn signal(&self, node: &NodeName, signal: Signal) -> anyhow::Result<()> {
        let child = self.nodes.get(node).context("no such process")?;
        kill(pid(child), signal).with_context(|| format!("{node} cannot be sent {signal}"))
    }

    /// Ends a node's process without warning.
    ///
    /// # Errors
    /// There is no such process any more.
    pub fn kill(&mut self, node: &NodeName) -> anyhow::Result<()> {
        let mut child = self.nodes.remove(node).context("no such process")?;
        child.kill()?;
        child.wait()?;
        Ok(())
    }

    /// A node whose process has ended by itself, with how.
    pub fn ended(&mut self) -> Option<String> {
        self.nodes.iter_mut().find_map(|(node, child)| {
            let status = child.try_wait().ok()??;
            Some(format!("{node} has ended by itself, {status}"))
        })
    }

    /// Asks the agents to land.
    pub fn call_off(&self) {
        for (_, child) in self.nodes.iter().filter(|(node, _)| **node != *GROUND) {
            // Whoever has ended already needs no asking.
            let _ = kill(pid(child), Signal::SIGTERM);
        }
    }

    /// Asks all processes to end, and waits until they have: agents land first what still flies.
    pub fn end(mut self) {
        for child in self.nodes.values() {
            // Whoever has ended already needs no asking.
            let _ = kill(pid(child), Signal::SIGTERM);
        }
        let deadline = Instant::now() + TIME_TO_END;
        while Instant::now() < deadline
            && self.nodes.values_mut().any(|child| matches!(child.try_wait(), Ok(None)))
        {
            self.world.step();
        }
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        for child in self.nodes.values_mut().chain(&mut self.router) {
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

fn start_zenohd(logs: &Path, port: u16) -> anyhow::Result<Child> {
    let mut command = Command::new("zenohd");
    command.arg("--listen").arg(format!("tcp/127.0.0.1:{port}")).arg("--no-multicast-scouting");
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
