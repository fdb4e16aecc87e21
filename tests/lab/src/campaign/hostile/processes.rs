//! The same member, with a certificate of its own, beside a swarm of processes that fly in real time over TLS.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use serde::Serialize;
use skein_agent::Outcome;
use skein_agent::config_file::Config;
use skein_bp::behaviour::Behaviours;
use skein_dbp::NodeName;
use skein_sim::autopilots::Autopilots;
use skein_sim::cli::{Network, Setup};
use skein_sim::fly::{GROUND, vehicle_name};
use skein_sim::processes::Processes;
use skein_wire::Fleet;
use skein_zenoh::{ZenohConfig, ZenohSession};

use super::flight::{AT_GOAL_M, FLYING, goals, scenario};
use super::mouth::Mouth;
use super::story::{LAST_TICK, Rank, Story};

const TICK: Duration = Duration::from_millis(20);
/// Time in which they must have arrived.
const PATIENCE: Duration = Duration::from_secs(150);
/// Bytes by which a process may grow while the member speaks, beyond those by which it grows beside a quiet one.
const MOST_GROWTH: u64 = 10 << 20;
/// Words of a log that tell of a lease that has run out.
const LOST_LEASE: [&str; 2] = ["block_lapsed", "peer_lost"];

/// What came of one flight.
#[derive(Debug, Default, Serialize)]
pub struct Trial {
    pub seed: u64,
    pub messages: u64,
    /// The most that a process has grown, bytes, and whose it is.
    pub growth: u64,
    pub grown: String,
    /// The most processor time of a process while the member spoke, for each tick of 20 ms, ms.
    pub tick_ms: f64,
    pub violations: Vec<String>,
}

impl Trial {
    /// Holds it against a flight beside a member that says nothing.
    pub fn judge_growth(&mut self, quiet: &Self) {
        let growth = self.growth.saturating_sub(quiet.growth);
        if growth > MOST_GROWTH {
            self.violations.push(format!("{} has grown by {:.1} MB more", self.grown, growth as f64 / 1e6));
        }
    }
}

/// Flies once; configurations and logs stay in `folder`.
///
/// # Errors
/// The swarm or the member's session cannot be started.
pub fn fly(story: &Story, folder: &Path, port_offset: u16) -> anyhow::Result<Trial> {
    // Left from a run before.
    let _ = std::fs::remove_dir_all(folder);
    let goals = goals(story.seed);
    let scenario = scenario(story, &goals)?;
    let setup = Setup { network: Network::Peer, port_offset, launch_on_order: false, secure: true };
    let mut swarm = Processes::prepare(&scenario, folder, setup, &Autopilots::default())?;
    let honest: Vec<NodeName> = (0..FLYING).map(vehicle_name).chain([GROUND.clone()]).collect();
    honest.iter().try_for_each(|node| swarm.start_node(node))?;
    let mut mouth = mouth(&swarm, folder, &honest)?;
    let mut flight = Flight { swarm, honest, goals, trial: Trial { seed: story.seed, ..Trial::default() } };
    flight.go(story, &mut mouth)?;
    flight.trial.messages = mouth.said.messages;
    flight.swarm.end();
    Ok(flight.trial)
}

/// The mouth of the member, which joins in with the configuration of the last vehicle.
fn mouth(swarm: &Processes, folder: &Path, honest: &[NodeName]) -> anyhow::Result<Mouth> {
    let member = vehicle_name(FLYING);
    let file = folder.join(format!("uav-{}.toml", FLYING + 1));
    let config = Config::read(&file, &Behaviours::default())?;
    let known = config.known();
    let fleet = Fleet::new(&config.agent.fleet)?;
    let session = ZenohSession::open(ZenohConfig::new(fleet, config.network).of(&member, known))?;
    let place = swarm.world().simulation().vehicle(FLYING).map(|state| state.motion.position);
    let link = Box::new(session.link(&member)?);
    Mouth::new(member, Rank::Vehicle, link, honest.to_vec(), place.unwrap_or_default())
}

struct Flight {
    swarm: Processes,
    honest: Vec<NodeName>,
    goals: Vec<[f64; 2]>,
    trial: Trial,
}

impl Flight {
    fn go(&mut self, story: &Story, mouth: &mut Mouth) -> anyhow::Result<()> {
        let began = Instant::now();
        let mut offboard = [false; FLYING];
        let mut spoke = None;
        let mut tick = 0;
        let mut due = began;
        while began.elapsed() < PATIENCE && !self.have_all_landed() {
            self.swarm.step();
            self.look(&mut offboard);
            if Instant::now() < due {
                continue;
            }
            due += TICK;
            // It is quiet until the first is in the air, and tells it all while they fly.
            if spoke.is_none() && offboard.contains(&true) {
                spoke = Some((self.usage()?, self.lost_leases()));
            }
            tick += u64::from(spoke.is_some());
            let habits = if (1..=LAST_TICK).contains(&tick) { story.habits.as_slice() } else { &[] };
            mouth.speak(tick, habits);
            if tick == LAST_TICK
                && let Some((before, leases)) = spoke.take()
            {
                self.judge_usage(&before)?;
                self.judge_leases(&leases);
                spoke = Some((before, leases));
            }
        }
        if tick < LAST_TICK {
            self.found(format!("they flew for {tick} ticks alone"));
        }
        self.judge_end();
        Ok(())
    }

    fn found(&mut self, what: String) {
        if !self.trial.violations.contains(&what) {
            self.trial.violations.push(what);
        }
    }

    fn have_all_landed(&self) -> bool {
        self.swarm.world().account().outcomes.iter().take(FLYING).all(Option::is_some)
    }

    /// Nobody leaves offboard but to land at its goal, and no process ends.
    fn look(&mut self, offboard: &mut [bool; FLYING]) {
        if let Some(ended) = self.swarm.ended() {
            self.found(ended);
        }
        for (index, was_offboard) in offboard.iter_mut().enumerate() {
            let world = self.swarm.world();
            let Some(mode) = world.heard(index).map(|state| state.mode.clone()) else { continue };
            let place = world.simulation().vehicle(index).map(|state| state.motion.position);
            let [x, y] = self.goals[index];
            let off = place.map_or(0.0, |place| (place.x - x).hypot(place.y - y));
            if *was_offboard && mode != "offboard" && off > AT_GOAL_M {
                self.found(format!(
                    "{} left offboard for {mode}, {off:.1} m from its goal",
                    vehicle_name(index)
                ));
            }
            *was_offboard |= mode == "offboard";
        }
    }

    /// Bytes in memory and processor time of each process.
    fn usage(&self) -> anyhow::Result<BTreeMap<NodeName, (u64, Duration)>> {
        let usage = |node: &NodeName| {
            let process = self.swarm.process(node).context("its process has ended")?;
            Ok((node.clone(), (resident_bytes(process)?, processor_time(process)?)))
        };
        self.honest.iter().map(usage).collect()
    }

    fn judge_usage(&mut self, before: &BTreeMap<NodeName, (u64, Duration)>) -> anyhow::Result<()> {
        for (node, (bytes, time)) in self.usage()? {
            let (bytes_before, time_before) = before.get(&node).copied().unwrap_or_default();
            let growth = bytes.saturating_sub(bytes_before);
            let tick_ms = (time - time_before).as_secs_f64() * 1000.0 / LAST_TICK as f64;
            if growth > self.trial.growth {
                (self.trial.growth, self.trial.grown) = (growth, node.to_string());
            }
            self.trial.tick_ms = self.trial.tick_ms.max(tick_ms);
        }
        Ok(())
    }

    /// How often each has lost a lease of another.
    fn lost_leases(&self) -> BTreeMap<NodeName, usize> {
        let count = |node: &NodeName| {
            let log = std::fs::read_to_string(self.swarm.log_of(node)).unwrap_or_default();
            let member = vehicle_name(FLYING);
            let is_lost = |line: &&str| {
                LOST_LEASE.iter().any(|words| line.contains(words)) && !line.contains(member.as_str())
            };
            (node.clone(), log.lines().filter(is_lost).count())
        };
        self.honest.iter().map(count).collect()
    }

    fn judge_leases(&mut self, before: &BTreeMap<NodeName, usize>) {
        for (node, lost) in self.lost_leases() {
            let lost = lost.saturating_sub(before.get(&node).copied().unwrap_or(0));
            if lost > 0 {
                self.found(format!("{node} has lost {lost} leases"));
            }
        }
    }

    fn judge_end(&mut self) {
        let account = self.swarm.world().account();
        let truth = account.simulation.truth();
        let collisions = truth.collisions_vehicle + truth.collisions_obstacle;
        let late = account.outcomes.iter().take(FLYING).enumerate();
        let late = late.filter(|(_, outcome)| **outcome != Some(Outcome::Complete));
        let mut found: Vec<String> = late
            .map(|(index, outcome)| format!("{} has not arrived: {outcome:?}", vehicle_name(index)))
            .collect();
        if collisions > 0 {
            found.push(format!("{collisions} collisions"));
        }
        found.into_iter().for_each(|what| self.found(what));
    }
}

fn resident_bytes(process: u32) -> anyhow::Result<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status"))?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).context("no VmRSS")?;
    Ok(line.trim().trim_end_matches("kB").trim().parse::<u64>()? << 10)
}

/// User and system time, which the kernel counts in hundredths of a second.
fn processor_time(process: u32) -> anyhow::Result<Duration> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat"))?;
    let fields = stat.rsplit_once(')').context("no name")?.1.split_whitespace();
    let ticks: Vec<u64> = fields.skip(11).take(2).map(str::parse).collect::<Result<_, _>>()?;
    Ok(Duration::from_millis(10 * ticks.iter().sum::<u64>()))
}
