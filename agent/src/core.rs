//! The agent core: one vehicle's mission around its control, without I/O.
//!
//! [`Control`] flies the vehicle and [`Mission`] decides what for. They know nothing of one another: control says
//! what it has found out in [reports](crate::report::Report), the mission what is to be done in
//! [instructions](crate::instruction::Instruction), and this core carries both to and fro in a fixed order.

use std::sync::Arc;
use std::time::Duration;

use nalgebra::Vector3;
use skein_dbp::{Happened, NodeName};
use skein_mav::{SetPoint, Text};
use skein_positioning::PoseFix;
use skein_wire::event::What;
use skein_wire::{KeptScript, Link, NodeLink, Scan, Store, VehicleLink};

use crate::{
    agent_error::AgentError,
    apart::{ControlSide, MissionSide},
    config::AgentConfig,
    control::{Control, SetPointRecord},
    mission::{Mission, Outcome},
    parts::Parts,
    positioning::{Estimate, Motion},
    scripts::RunningScript,
};

/// Planning answers a decision with a new report, which deserves its turn in the same tick; so often.
const ROUNDS: usize = 4;

/// One line about a vehicle, for people.
#[derive(Clone, Debug, PartialEq)]
pub struct Status {
    /// Flight mode as the autopilot tells it.
    pub mode: String,
    pub task: String,
    pub waiting_for: String,
    /// Energy left, 0 to 1.
    pub battery: f64,
    /// Nearest neighbour and its distance in metres.
    pub nearest: Option<(NodeName, f64)>,
}

/// One vehicle's agent. Feed it bytes and scans, tick it every 20 ms, carry its bytes away.
#[derive(Debug)]
pub struct AgentCore {
    side: ControlSide,
    mission: Mission,
}

impl AgentCore {
    /// An agent for a vehicle that has not been heard of yet.
    pub fn new(config: AgentConfig) -> Result<Self, AgentError> {
        let parts = Parts::of(&config);
        Self::with_parts(config, parts, None)
    }

    /// An agent that keeps what it promises in `store`, so that blocks on its events can outlive whoever stated them.
    pub fn durable(config: AgentConfig, store: Box<dyn Store>) -> Result<Self, AgentError> {
        let parts = Parts::of(&config);
        Self::with_parts(config, parts, Some(store))
    }

    /// An agent of these parts. With a `store`, as [`durable`](Self::durable).
    pub fn with_parts(
        config: AgentConfig,
        parts: Parts,
        store: Option<Box<dyn Store>>,
    ) -> Result<Self, AgentError> {
        let config = Arc::new(config);
        let Parts { mind, positioning, layers } = parts;
        let mission = Mission::new(config.clone(), mind, store)?;
        let control = Control::new(config, mission.name().clone(), positioning, layers)?;
        let members = mission.node().node().peers().map(|(member, _)| member.clone());
        let vehicles = VehicleLink::new(mission.name().clone(), mission.node().fleet().clone(), members);
        Ok(Self { side: ControlSide::new(control, vehicles), mission })
    }

    /// Control and mission, to run each at its own pace.
    #[must_use]
    pub fn split(mut self) -> (ControlSide, MissionSide) {
        self.side.speak(self.mission.words(None));
        (self.side, MissionSide::new(self.mission))
    }

    /// The same agent, which keeps the scripts that are sent to it in `store`. Of those `kept` by a former life, each
    /// runs again from its beginning if it passes all checks anew, once the vehicle is ready on the ground or an
    /// operator lets it go on in the air; one that does not is refused, and forgotten.
    #[must_use]
    pub fn keeping_scripts(mut self, store: Box<dyn Store<Vec<KeptScript>>>, kept: &[KeptScript]) -> Self {
        self.mission.keep_scripts(store, kept);
        self
    }

    /// The same agent, whose promises of a former life are lost, and `why`: it stands, or holds, until an
    /// operator says that it may go on.
    #[must_use]
    pub fn having_lost_promises(mut self, why: &str) -> Self {
        self.mission.forget_promises(why);
        self
    }

    /// The same agent as the shadow of a pilot: it plans and makes set-points while somebody else flies the
    /// vehicle, and nothing leaves that the vehicle would obey.
    #[must_use]
    pub fn shadowing(mut self) -> Self {
        self.side.control.shadow();
        self
    }

    /// The newest set-point, when it was made, and the motion of the vehicle as it is now; none before the first.
    #[must_use]
    pub fn last_set_point(&self) -> Option<(Duration, SetPoint, Motion)> {
        self.side.control.last_set_point()
    }

    /// Takes in bytes from the autopilot.
    pub fn receive_mavlink(&mut self, now: Duration, bytes: &[u8]) {
        self.side.control.receive_mavlink(now, bytes);
    }

    /// Bytes for the autopilot.
    pub fn take_mavlink(&mut self) -> Vec<u8> {
        self.side.control.take_mavlink()
    }

    /// Takes in what another station says to the autopilot through this agent: an order of it takes the vehicle over.
    pub fn overhear(&mut self, now: Duration, bytes: &[u8]) {
        if let Some(report) = self.side.control.overhear(bytes) {
            self.mission.hear(now, report);
        }
    }

    /// Takes the lines that the autopilot has written since the last call.
    pub fn take_texts(&mut self) -> Vec<Text> {
        self.side.control.take_texts()
    }

    /// Takes in an order of whoever is at this vehicle's own computer.
    pub fn order(&mut self, what: What) {
        self.mission.order(what);
    }

    /// Takes in a lidar scan.
    pub fn sense(&mut self, now: Duration, scan: &Scan) {
        self.side.control.sense(now, scan);
    }

    /// The vehicle's state by its own belief.
    #[must_use]
    pub fn estimate(&self) -> &Estimate {
        self.side.control.estimate()
    }

    /// Takes in a pose by markers.
    pub fn see_markers(&mut self, now: Duration, fix: &PoseFix) {
        self.side.control.see_markers(now, fix);
    }

    /// One tick, every 20 ms: hears, decides, and answers with a set-point.
    pub fn tick(&mut self, now: Duration, link: &mut dyn Link) {
        if let Some(report) = self.side.note_pause(now) {
            self.mission.hear(now, report);
            // Before anything that was said meanwhile is heard.
            self.decide(now);
        }
        self.hear(now, link);
        for report in self.side.control.observe(now) {
            self.mission.hear(now, report);
        }
        if self.side.begins_cycle(now) {
            self.begin_cycle(now, link);
        }
        self.decide(now);
        self.side.control.steer(now);
        self.mission.send(link);
        self.mission.put_board(now, link);
    }

    /// One tick of a vehicle whose mission is silent, as it would be on a thread of its own that hangs.
    pub fn tick_without_mission(&mut self, now: Duration, link: &mut dyn Link) {
        self.side.speak(self.mission.words(None));
        self.side.tick(now, link);
        for (_, report) in self.side.take_news().reports {
            self.mission.hear(now, report);
        }
    }

    /// Between two ticks: answers at once what other nodes say, without a set-point. Makes the swarm quick to hold.
    pub fn respond(&mut self, now: Duration, link: &mut dyn Link) {
        self.hear(now, link);
        self.decide(now);
        self.mission.send(link);
    }

    fn hear(&mut self, now: Duration, link: &mut dyn Link) {
        let states = self.mission.receive(now, link);
        self.side.control.hear(now, states);
        self.side.control.hear_readiness(now, self.mission.take_readiness());
    }

    /// A navigation cycle: looks along the path, and tells the others where this vehicle is.
    fn begin_cycle(&mut self, now: Duration, link: &mut dyn Link) {
        let control = &mut self.side.control;
        for report in control.look_ahead(now) {
            self.mission.hear(now, report);
        }
        if let Some(circumstances) = control.circumstances() {
            self.mission.tell_scripts(&circumstances);
        }
        self.mission.catch_up(now);
        if let Some(readiness) = control.readiness_to_tell(now) {
            self.mission.put_readiness(&readiness, link);
        }
        if let Some(state) = control.state(now) {
            self.mission.put_state(state, control.complaint(), link);
        }
    }

    /// Lets whoever decides do so until nothing new comes of it, and carries out what was decided.
    fn decide(&mut self, now: Duration) {
        let control = &mut self.side.control;
        for _ in 0..ROUNDS {
            let decided = self.mission.decide(now);
            if decided.is_empty() {
                break;
            }
            for happened in &decided {
                let instruction = self.mission.follow(happened, control.flight().is_landing());
                while let Some(trial) = self.mission.next_trial() {
                    self.mission.note_trial(trial.run());
                }
                let report = instruction.and_then(|instruction| control.carry_out(now, now, instruction));
                if let Some(report) = report {
                    self.mission.hear(now, report);
                }
            }
            self.mission.record(decided);
        }
        control.note_decision(now);
        if let Some(limits) = self.mission.changed_limits() {
            control.limit(limits);
        }
        if let Some(zones) = self.mission.changed_zones() {
            control.draw(now, zones);
        }
    }

    /// Whether this agent has the vehicle in the air, or on its way there.
    pub fn is_committed(&self) -> bool {
        self.side.control.flight().is_committed()
    }

    /// One line about this vehicle.
    pub fn status(&self, now: Duration) -> Status {
        Status {
            mode: self.side.control.mode(),
            task: self.mission.task().to_owned(),
            waiting_for: self.mission.waiting_for(self.side.control.complaint()),
            battery: self.side.control.battery(),
            nearest: self.side.control.nearest(now),
        }
    }

    /// Everything selected here or heard of since the last call, in order.
    pub fn take_selections(&mut self) -> Vec<Happened> {
        self.mission.take_selections()
    }

    /// The scripts that run, by name.
    pub fn scripts(&self) -> impl Iterator<Item = (&str, &RunningScript)> {
        self.mission.scripts().running()
    }

    /// The outcome of the mission, once it has ended.
    pub fn outcome(&self) -> Option<&Outcome> {
        self.mission.outcome()
    }

    pub fn set_points(&self) -> SetPointRecord {
        self.side.control.set_points()
    }

    /// Standard deviation of the position, as others are told, m; 0 while there is none.
    pub fn position_sigma_m(&self) -> f64 {
        self.side.control.position_sigma_m()
    }

    /// The path ahead, from the vehicle to its waypoint; empty without one.
    pub fn path_ahead(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        self.side.control.guidance().way_ahead()
    }

    /// The vehicle's node: its program, its peers, and what has come in that was not understood.
    pub fn node(&self) -> &NodeLink {
        self.mission.node()
    }

    /// Whether a path is being searched for that the last tick was not enough for.
    pub fn is_planning(&self) -> bool {
        self.side.control.guidance().planning.is_under_way()
    }

    /// The other vehicles that it remembers.
    pub fn known_vehicles(&self) -> usize {
        self.side.control.neighbours().remembered()
    }

    /// The vehicle's node name.
    pub fn name(&self) -> &NodeName {
        self.mission.name()
    }
}
