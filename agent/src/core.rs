//! The agent core: one vehicle's program around its pipeline, without I/O.

use std::time::Duration;

use nalgebra::{UnitQuaternion, Vector3};
use skein_bp::script::Assignment;
use skein_bp::{Event, Origin, Program, ProgramConfig};
use skein_dbp::{Happened, Node, NodeConfig, NodeName};
use skein_mav::{Companion, CompanionConfig, Landed, SetPoint};
use skein_planning::airspace::{Airspace, KeepOut};
use skein_planning::map::MapError;
use skein_wire::event::{
    Advance, Complete, Declared as _, Enter, Failed, Goto, Hold, Homeward, Land, Load, OrderTaken, Plan,
    PlanReason, Return, ScriptNews, Takeoff, Unload, What,
};
use skein_wire::{Fleet, Link, MissionState, NodeLink, State, Store, event, joint_roster};

use crate::{
    bthreads,
    config::{AgentConfig, Controller, Envelope},
    error::AgentError,
    failsafes::Failsafes,
    flight::{Flight, FlightPhase},
    me::Me,
    neighbours::{Neighbour, Neighbours},
    pipeline::{
        guidance::{Guidance, Motion, Report, Surroundings},
        perception::{Perception, Pose, Scan},
        set_point::{FRESH_FOR, KeepAlive, SILENT_AFTER, keep_alive, oldest_age},
        touchdown::Descent,
    },
    precedence,
    safety::safety_events,
    scripts::{
        Begins, CONFIGURATION, Circumstances, KeptScript, RunningScript, ScriptFacts, ScriptStore, Scripts,
    },
    sequential::Sequential,
    verify::check_script,
    watches::Watches,
};

/// Standard deviation of the position that a vehicle tells others, m.
const POSITION_SIGMA_M: f64 = 0.05;
/// The map reaches this far above the highest waypoint, m: as far as a path may climb over something, and more.
const ABOVE_WAYPOINTS_M: f64 = 4.0;
/// A path may pass under something, this far below the lowest waypoint, m.
const BELOW_WAYPOINTS_M: f64 = 1.0;
/// No path is lower than this above the take-off place, m.
const LEAST_HEIGHT_M: f64 = 0.6;
/// Paths keep this far out of zones, m: what a vehicle strays from its path, the error of its position, and its hull.
const ZONE_MARGIN_M: f64 = 1.0;
/// Paths keep this high above terrain that is known, m.
const TERRAIN_CLEARANCE_M: f64 = 1.0;
/// An agent that has not run for this long has let its set-points fall silent, and does not take them up by itself.
const LONGEST_PAUSE: Duration = SILENT_AFTER;
/// Neighbours are heard this often at least, while they are, s.
const NEIGHBOUR_PERIOD_S: f64 = 0.5;
/// One that is silent may fly anywhere, from its last word until this vehicle is up, s.
const CLIMB_S: f64 = 4.0;
/// Beyond this it may be anywhere in the arena, s.
const MOST_UNSEEN_S: f64 = 4.0;
/// After so long a silence, s, its failsafe has landed it, or its mission is over.
const SURELY_DOWN_S: f64 = 45.0;
/// How many states of a script and the vehicle's program are looked at before it runs: no more than there is time for between
/// two ticks. `skein-agent verify --script` looks at all.
const STATES_TRIED: usize = 500;
/// Who requested what the sequential navigator does, in the trace.
const SEQUENTIAL: &str = "sequential";
/// A navigation cycle and a state message to the others begin this often.
const CYCLE_PERIOD: Duration = Duration::from_millis(100);

/// How a vehicle's mission ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It reached its last waypoint and landed.
    Complete,
    /// It did not, and this is why.
    Failed(String),
}

/// What set-points were made from: the keep-alive rule, observed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SetPointRecord {
    /// Set-points of the pipeline.
    pub commands: u64,
    /// Zero velocities for want of fresh inputs.
    pub stops: u64,
    /// Age of the oldest input that a command was made from.
    pub oldest_input: Duration,
}

/// One line about a vehicle, for people.
#[derive(Clone, Debug, PartialEq)]
pub struct Status {
    /// Flight mode as the autopilot tells it.
    pub mode: String,
    /// What it is doing.
    pub task: String,
    /// What it waits for, and who holds it.
    pub waiting_for: String,
    /// Energy left, 0 to 1.
    pub battery: f64,
    /// Nearest neighbour and its distance in metres.
    pub nearest: Option<(NodeName, f64)>,
}

/// One vehicle's agent. Feed it bytes and scans, tick it every 20 ms, carry its bytes away.
pub struct AgentCore {
    config: AgentConfig,
    me: Me,
    name: NodeName,
    companion: Companion,
    node: NodeLink,
    /// What decides in place of the node's program.
    sequential: Option<Sequential>,
    neighbours: Neighbours,
    perception: Perception,
    watches: Watches,
    failsafes: Failsafes,
    flight: Flight,
    guidance: Guidance,
    scripts: Scripts,
    script_facts: ScriptFacts,
    next_cycle: Duration,
    last_tick: Option<Duration>,
    task: String,
    outcome: Option<Outcome>,
    selections: Vec<Happened>,
    set_points: SetPointRecord,
    fault: Option<String>,
}

impl AgentCore {
    /// An agent for a vehicle that has not been heard of yet.
    ///
    /// # Errors
    /// [`AgentError`] names the field of the configuration at fault.
    pub fn new(config: AgentConfig) -> Result<Self, AgentError> {
        Self::with_store(config, None)
    }

    /// An agent that keeps what it promises in `store`, so that blocks on its events can outlive whoever stated them.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn durable(config: AgentConfig, store: Box<dyn Store>) -> Result<Self, AgentError> {
        Self::with_store(config, Some(store))
    }

    /// The same agent, which keeps the scripts that are sent to it in `store`. Of those `kept` by a former life, each runs
    /// again from its beginning if it passes all checks anew, once the vehicle is ready on the ground or an operator lets it
    /// go on in the air; one that does not is refused, and forgotten.
    #[must_use]
    pub fn keeping_scripts(mut self, store: Box<dyn ScriptStore>, kept: &[KeptScript]) -> Self {
        for KeptScript { from, assignment } in kept {
            let outcome = self
                .admit(assignment, from, Begins::WhenReleased)
                .map_err(|why| format!("it was kept from the agent's last life, and passes no more: {why}"));
            self.node.node_mut().enqueue(self.scripts.verdict(assignment.name(), outcome));
        }
        self.scripts.keep_in(store);
        self
    }

    fn with_store(config: AgentConfig, store: Option<Box<dyn Store>>) -> Result<Self, AgentError> {
        let name = |field, value: &str| {
            NodeName::new(value).map_err(|source| AgentError::Name { field, value: value.to_owned(), source })
        };
        let (me, events) = (Me::new(&config.node), config.events());
        let mut program = Program::new(ProgramConfig {
            protected: safety_events(&me, &events),
            ..ProgramConfig::vehicle(config.seed)
        });
        if config.controller == Controller::Bp {
            bthreads::load(&mut program, &config);
        }
        let mut scripts = Scripts::new(me.clone(), &config.roster, &events);
        for assignment in &config.scripts {
            scripts
                .load(&mut program, assignment, CONFIGURATION, Begins::WhenReleased)
                .and_then(|()| check_script(&config, assignment, STATES_TRIED))
                .map_err(|why| AgentError::Script { name: assignment.name().to_owned(), why })?;
        }
        let roster: Vec<_> =
            config.roster.iter().map(|node| name("roster", node)).collect::<Result<_, _>>()?;
        let own_name = name("node", &config.node)?;
        let neighbours = Neighbours::new(own_name.clone(), config.incarnation);
        let node_config = NodeConfig {
            lease: config.lease,
            safety: safety_events(&me, &events),
            gateway: me.any_in(events.gateway()),
            // What comes from afar never outranks a vehicle's own b-threads for its safety.
            remote_priority: precedence::MISSION..=precedence::LINK,
            authority: config.authority.clone(),
            joint: Some(joint_roster(name("ground", &config.ground)?, &roster)),
            durable: store.is_some(),
            kept: config.kept.clone(),
            ..NodeConfig::new(own_name.clone(), config.incarnation, roster)
        };
        let fleet = Fleet::new(&config.fleet)
            .map_err(|source| AgentError::Fleet { value: config.fleet.clone(), source })?;
        let home = Vector3::from(config.home);
        Ok(Self {
            companion: Companion::new(CompanionConfig {
                system_id: config.system_id,
                component_id: 191,
                datum: config.datum,
            }),
            node: match store {
                Some(store) => NodeLink::durable(Node::new(node_config, program), fleet, store),
                None => NodeLink::new(Node::new(node_config, program), fleet),
            },
            sequential: (config.controller == Controller::Sequential).then(|| {
                Sequential::new(me.clone(), &config.waypoints, [home.x, home.y, config.return_altitude_m])
            }),
            name: own_name,
            neighbours,
            perception: perception(&config)?,
            watches: Watches::new(me.clone()),
            failsafes: Failsafes::default(),
            flight: Flight::new(me.clone(), config.takeoff_height_m),
            guidance: Guidance::new(config.envelope, config.fence, config.planners),
            scripts,
            script_facts: ScriptFacts::default(),
            next_cycle: Duration::ZERO,
            last_tick: None,
            task: "on the ground".to_owned(),
            outcome: None,
            selections: Vec::new(),
            set_points: SetPointRecord::default(),
            fault: None,
            me,
            config,
        })
    }

    /// Takes in bytes from the autopilot.
    pub fn receive_mavlink(&mut self, now: Duration, bytes: &[u8]) {
        self.companion.receive(now, bytes);
    }

    /// Bytes for the autopilot.
    pub fn take_mavlink(&mut self) -> Vec<u8> {
        self.companion.take_output()
    }

    /// An order of whoever is at this vehicle's own computer.
    pub fn order(&mut self, what: What) {
        self.node.node_mut().enqueue(OrderTaken::plain(what).at(&self.name));
    }

    /// Takes in a lidar scan.
    pub fn sense(&mut self, now: Duration, scan: &Scan) {
        // What an old one saw would be drawn where the vehicle is now.
        if now.saturating_sub(scan.stamp) > FRESH_FOR {
            return;
        }
        let Some(pose) = self.pose_at(scan.stamp) else { return };
        // From the ground there is little to see, and much of it is the ground.
        if !self.is_airborne() {
            return;
        }
        let others: Vec<_> = self.neighbours.at(now).map(|neighbour| neighbour.position()).collect();
        self.perception.take_in(scan, &pose, &others);
        let (returns, rays) = (self.perception.returns(), scan.ranges_m.len());
        self.guidance.look(scan.stamp, &pose.position, returns, rays, self.perception.map());
    }

    /// The vehicle's estimated pose at a time near the newest telemetry.
    fn pose_at(&self, at: Duration) -> Option<Pose> {
        let telemetry = self.companion.telemetry();
        let (position, velocity) = (telemetry.position?, telemetry.velocity?);
        let (attitude, rate) = (telemetry.attitude?, telemetry.angular_rate?);
        let lead_s = |stamp: Duration| (at.as_secs_f64() - stamp.as_secs_f64()).clamp(-0.2, 0.2);
        // A degree of tilt is a hand's breadth at the far wall of a room.
        let turned = UnitQuaternion::from_scaled_axis(rate.value * lead_s(attitude.stamp));
        Some(Pose {
            position: position.value + velocity.value * lead_s(position.stamp),
            attitude: attitude.value * turned,
        })
    }

    /// One tick, every 20 ms: hears, decides, and answers with a set-point.
    pub fn tick(&mut self, now: Duration, link: &mut dyn Link) {
        self.note_pause(now);
        self.companion.tick(now);
        self.hear(now, link);
        let neighbours: Vec<Neighbour> = self.neighbours.at(now).collect();
        self.follow_autopilot(now);
        self.watch(now, &neighbours);
        let report = self.guidance.go_on_planning(self.perception.map_mut());
        self.hear_of_path(now, report);
        if now >= self.next_cycle {
            self.next_cycle = now + CYCLE_PERIOD;
            self.begin_cycle(now, &neighbours, link);
        }
        self.decide(now, &neighbours);
        self.steer(now, &neighbours);
        self.node.send(link);
        self.node.put_board(now, link);
    }

    /// Between two ticks: answers at once what other nodes say, without a set-point. Makes the swarm quick to hold.
    pub fn respond(&mut self, now: Duration, link: &mut dyn Link) {
        self.hear(now, link);
        let neighbours: Vec<Neighbour> = self.neighbours.at(now).collect();
        self.decide(now, &neighbours);
        self.node.send(link);
    }

    fn hear(&mut self, now: Duration, link: &mut dyn Link) {
        self.node.receive(now, link);
        for state in self.node.take_states() {
            self.neighbours.hear(now, state);
        }
    }

    fn note_pause(&mut self, now: Duration) {
        let pause = self.last_tick.replace(now).map_or(Duration::ZERO, |last| now.saturating_sub(last));
        if pause > LONGEST_PAUSE
            && let Some(event) = self.flight.wake(pause)
        {
            self.guidance.rest();
            self.report(now, event);
            // Before anything that was said meanwhile is heard.
            self.decide(now, &[]);
        }
    }

    fn follow_autopilot(&mut self, now: Duration) {
        self.failsafes.ask(&mut self.companion);
        while let Some(event) = self.companion.poll_event() {
            let autopilot = self.companion.telemetry().autopilot;
            self.failsafes.hear(&event, autopilot);
            if let Some(event) = self.flight.hear(now, &event, &mut self.companion) {
                self.report(now, event);
            }
        }
        if let Some(event) = self.flight.follow(now, &mut self.companion) {
            self.report(now, event);
        }
    }

    /// Tells whoever decides what the vehicle's body has found out.
    fn report(&mut self, now: Duration, event: Event) {
        match &mut self.sequential {
            Some(sequential) => sequential.hear(now, &event),
            None => self.node.node_mut().enqueue(event),
        }
    }

    fn watch(&mut self, now: Duration, neighbours: &[Neighbour]) {
        let telemetry = self.companion.telemetry();
        let mut events = Vec::new();
        events.extend(self.watches.preflight(
            now,
            telemetry,
            self.failsafes.are_sound(),
            self.is_overhead_clear(neighbours),
            self.flight.is_taking_off(),
        ));
        if let (true, Some(position)) = (self.is_airborne(), telemetry.position) {
            if let Some(battery) = telemetry.battery {
                let home = Vector3::from(self.config.home);
                let seconds_home = (position.value - home).norm() / self.config.envelope.cruise_m_s + 10.0;
                events.extend(self.watches.battery(now, battery.value, seconds_home));
            }
            events.extend(self.watches.fence(position.value, &self.config.fence));
            events.extend(self.watches.separation(position.value, neighbours));
        }
        for event in events {
            self.report(now, event);
        }
    }

    /// Whether nobody flies where this vehicle would climb, as far as can be known: one that is silent may have come
    /// closer meanwhile.
    fn is_overhead_clear(&self, neighbours: &[Neighbour]) -> bool {
        let Envelope { separation_m, cruise_m_s, .. } = self.config.envelope;
        let [x, y, _] = self.config.home;
        neighbours.iter().filter(|neighbour| neighbour.armed).all(|neighbour| {
            let unseen_s = match neighbour.track.age_s {
                age_s if !(NEIGHBOUR_PERIOD_S..=SURELY_DOWN_S).contains(&age_s) => 0.0,
                age_s => age_s.min(MOST_UNSEEN_S) + CLIMB_S,
            };
            let offset = neighbour.position().xy() - nalgebra::Vector2::new(x, y);
            offset.norm() > separation_m + unseen_s * cruise_m_s
        })
    }

    /// Tells whoever decides what came of a plan, if something did.
    fn hear_of_path(&mut self, now: Duration, report: Option<Report>) {
        if let Some(report) = report {
            self.report(now, report.into_event(&self.me));
            self.script_facts.forget_path();
        }
    }

    /// A navigation cycle: looks along the path, and tells the others where this vehicle is.
    fn begin_cycle(&mut self, now: Duration, neighbours: &[Neighbour], link: &mut dyn Link) {
        if let (FlightPhase::Flying, Some(motion)) = (self.flight.phase(), self.motion()) {
            let map = self.perception.map();
            for report in self.guidance.look_ahead(now, &motion, map, neighbours) {
                self.report(now, report.into_event(&self.me));
            }
            self.tell_scripts(&motion, neighbours);
        }
        self.scripts.catch_up(now);
        if let Some(state) = self.state(now) {
            let state = State { echo: self.neighbours.echo(now), ..state };
            self.node.put_state(&state, link);
        }
    }

    /// Tells scripts what they listen to.
    fn tell_scripts(&mut self, motion: &Motion, neighbours: &[Neighbour]) {
        let circumstances = Circumstances {
            position: motion.position,
            ahead: self.guidance.place_ahead(),
            battery: self.companion.telemetry().battery.map(|battery| battery.value.fraction),
            neighbours,
        };
        for event in self.script_facts.tell(&self.me, &self.scripts, &circumstances) {
            self.node.node_mut().enqueue(event);
        }
    }

    /// Lets whoever decides do so until nothing new comes of it, and carries out what was decided.
    fn decide(&mut self, now: Duration, neighbours: &[Neighbour]) {
        // Planning answers a decision with a new report, which deserves its turn in the same tick.
        for _ in 0..4 {
            let selections = self.decisions(now);
            if selections.is_empty() {
                break;
            }
            for selection in &selections {
                if selection.home == self.name {
                    self.carry_out(now, &selection.event, neighbours);
                    self.look_after_scripts(selection);
                }
            }
            self.selections.extend(selections);
        }
    }

    /// One step of whoever decides.
    fn decisions(&mut self, now: Duration) -> Vec<Happened> {
        if let Err(error) = self.node.node_mut().step(now) {
            // Without fresh leave the vehicle hovers; its b-threads may yet recover.
            self.fault = Some(error.to_string());
        }
        let selections = self.node.node_mut().take_selections();
        let Some(sequential) = &mut self.sequential else { return selections };
        let decided = sequential.step(now).into_iter().map(|event| Happened {
            event,
            home: self.name.clone(),
            seq: 0,
            term: 0,
            origin: Origin::Internal,
            requested_by: vec![SEQUENTIAL.into()],
            choice: None,
            at: now,
        });
        decided.collect()
    }

    fn carry_out(&mut self, now: Duration, event: &Event, neighbours: &[Neighbour]) {
        self.flight.carry_out(now, event, &mut self.companion);
        let why = event::why(event).unwrap_or_default();
        match self.me.verb(event) {
            Some(Goto::NAME) => {
                self.guidance.head_for(event);
                self.task = match Goto::read(event).map_or(0, |goto| goto.leg) {
                    bthreads::HOME_LEG => "flying home".to_owned(),
                    bthreads::OPERATOR_LEG => "going where the operator points".to_owned(),
                    leg => format!("leg {} of {}", leg + 1, self.config.waypoints.len()),
                };
            }
            Some(Plan::NAME) => {
                if let Some(motion) = self.motion() {
                    let why = Plan::read(event).map_or(PlanReason::Waypoint, |plan| plan.why);
                    let report = self.guidance.plan(why, &motion, self.perception.map_mut(), neighbours);
                    self.hear_of_path(now, report);
                }
            }
            Some(Advance::NAME | Homeward::NAME) => self.guidance.grant_leave(now),
            Some(Land::NAME) => {
                self.task = format!("landing: {why}");
                self.settle(now, neighbours);
            }
            Some(Return::NAME) if !self.flight.is_landing() => {
                self.task = format!("returning: {why}");
            }
            Some(Hold::NAME) => self.task = "holding".to_owned(),
            Some(event::Landed::NAME) => self.guidance.forget(),
            Some(Takeoff::NAME) => self.task = "taking off".to_owned(),
            Some(OrderTaken::NAME) if OrderTaken::read(event).is_some_and(|order| order.what.releases()) => {
                self.flight.resume(now);
            }
            Some(Complete::NAME) => self.end(Outcome::Complete, "arrived"),
            Some(Failed::NAME) => self.end(Outcome::Failed(why.to_owned()), why),
            _ => {}
        }
    }

    /// Runs the scripts that are sent, and answers what cannot be done.
    fn look_after_scripts(&mut self, selection: &Happened) {
        let event = &selection.event;
        let verdict = match self.me.verb(event) {
            Some(Load::NAME) => {
                let (name, outcome) = self.load_script(selection);
                self.scripts.verdict(&name, outcome)
            }
            Some(Unload::NAME) => {
                let name = Unload::read(event).map(|unload| unload.name).unwrap_or_default();
                if self.scripts.runs(&name) {
                    return;
                }
                self.scripts.verdict(&name, Err("no script of this name runs".to_owned()))
            }
            Some(ScriptNews::NAME) => return self.scripts.hear(event),
            _ => return,
        };
        self.node.node_mut().enqueue(verdict);
    }

    /// Runs a script that is sent; gives back its name, and why it is not run if it is not.
    fn load_script(&mut self, selection: &Happened) -> (String, Result<(), String>) {
        let text = Load::read(&selection.event).map(|load| load.script).unwrap_or_default();
        let assignment = match Assignment::from_json(&text) {
            Ok(assignment) => assignment,
            Err(error) => return (String::new(), Err(error.to_string())),
        };
        let sender = selection.requested_by.iter().find(|bthread| bthread.contains('#'));
        let from = sender.map_or(self.name.as_str(), |bthread| bthread).to_owned();
        let outcome = self.admit(&assignment, &from, Begins::AtOnce);
        (assignment.name().to_owned(), outcome)
    }

    /// Runs a script that `from` has sent, now or to a former life of this agent, if it passes all checks.
    fn admit(&mut self, assignment: &Assignment, from: &str, begins: Begins) -> Result<(), String> {
        if !self.may_send(assignment, from)? {
            let node = from.split_once('#').map_or(from, |(node, _)| node);
            return Err(format!(
                "{node} may not send scripts: that is for the ground station and its operators"
            ));
        }
        if !self.scripts.runs(assignment.name()) {
            check_script(&self.config, assignment, STATES_TRIED)?;
        }
        self.script_facts.forget();
        self.scripts.load(self.node.node_mut().program_mut(), assignment, from, begins)
    }

    /// Whether `from` has the right to send this script: the vehicle itself, or a b-thread of another node that is a member
    /// and no vehicle.
    fn may_send(&self, assignment: &Assignment, from: &str) -> Result<bool, String> {
        let Some((node, bthread)) = from.split_once('#') else { return Ok(from == self.name.as_str()) };
        let text = assignment.to_json().map_err(|error| error.to_string())?;
        let load = self.me.event(Load { name: None, script: text.into() });
        let is_member = self.config.roster.iter().any(|member| member == node);
        let may_request = |node| self.config.authority.may_request(&node, bthread, &load);
        Ok(is_member && !node.starts_with("uav/") && NodeName::new(node).is_ok_and(may_request))
    }

    fn end(&mut self, outcome: Outcome, task: &str) {
        self.outcome = Some(outcome);
        self.task = task.to_owned();
    }

    /// When what set-points are made from was measured.
    fn inputs(&self) -> Vec<Option<Duration>> {
        let telemetry = self.companion.telemetry();
        let position = telemetry.position.map(|position| position.stamp);
        let attitude = telemetry.attitude.map(|attitude| attitude.stamp);
        let scan = self.config.lidar.then(|| self.perception.last_scan());
        [position, attitude].into_iter().chain(scan).collect()
    }

    /// A vehicle that is to land goes to where it can, and lands there; wherever it is in the end, or if it does not see.
    fn settle(&mut self, now: Duration, neighbours: &[Neighbour]) {
        let FlightPhase::Settling { until } = self.flight.phase() else { return };
        let sees = keep_alive(now, &self.inputs()) == KeepAlive::Command;
        let place = self.motion().filter(|_| sees && now < until).and_then(|motion| {
            let descent = Descent {
                name: &self.name,
                position: motion.position,
                stop: self.guidance.stop(&motion),
                ground_m: self.config.home[2],
                envelope: &self.config.envelope,
                fence: &self.config.fence,
                map: self.perception.map(),
                neighbours,
            };
            descent.detour(self.guidance.settles_at())
        });
        self.guidance.settle_at(place);
        if place.is_none() {
            self.flight.touch_down(now, &mut self.companion);
        }
    }

    /// The control loop: it waits for no b-thread and no network.
    fn steer(&mut self, now: Duration, neighbours: &[Neighbour]) {
        self.settle(now, neighbours);
        if !self.flight.sends_set_points() {
            self.guidance.rest();
            return;
        }
        let Some(motion) = self.motion() else { return };
        let tracks: Vec<_> =
            neighbours.iter().filter(|neighbour| neighbour.armed).map(|neighbour| neighbour.track).collect();
        let inputs = self.inputs();
        match keep_alive(now, &inputs) {
            KeepAlive::Command => {
                let surroundings = Surroundings {
                    map: self.perception.map(),
                    obstacles: self.perception.obstacles(),
                    neighbours: &tracks,
                    rank: self.rank(neighbours),
                };
                let set_point = self.guidance.steer(now, &motion, &surroundings);
                self.set_points.commands += 1;
                let age = oldest_age(now, &inputs).unwrap_or_default();
                self.set_points.oldest_input = self.set_points.oldest_input.max(age);
                self.companion.set_point(now, set_point);
            }
            KeepAlive::Stop => {
                self.set_points.stops += 1;
                self.guidance.rest();
                self.companion.set_point(now, SetPoint::Velocity { velocity: Vector3::zeros(), yaw: None });
            }
            KeepAlive::Silence => self.guidance.rest(),
        }
    }

    /// How many of the neighbours have names that come before this vehicle's.
    fn rank(&self, neighbours: &[Neighbour]) -> u32 {
        let before = neighbours.iter().filter(|neighbour| neighbour.node < self.name);
        u32::try_from(before.count()).unwrap_or(u32::MAX)
    }

    fn motion(&self) -> Option<Motion> {
        let telemetry = self.companion.telemetry();
        Some(Motion { position: telemetry.position?.value, velocity: telemetry.velocity?.value })
    }

    /// What this vehicle tells the others, ten times a second.
    fn state(&self, now: Duration) -> Option<State> {
        let telemetry = self.companion.telemetry();
        let motion = self.motion()?;
        let status = self.status(now);
        Some(State {
            incarnation: self.config.incarnation,
            time: now,
            position: motion.position,
            velocity: motion.velocity,
            yaw_rad: telemetry.attitude.map_or(0.0, |attitude| attitude.value.euler_angles().2),
            position_sigma_m: POSITION_SIGMA_M,
            radius_m: self.config.envelope.hull_m,
            mode: status.mode,
            battery: status.battery,
            armed: telemetry.armed,
            task: status.task,
            waiting_for: status.waiting_for,
            mission: match &self.outcome {
                None => MissionState::UnderWay,
                Some(Outcome::Complete) => MissionState::Complete,
                Some(Outcome::Failed(_)) => MissionState::Failed,
            },
            path: self.guidance.path_ahead().take(State::MAX_PATH).collect(),
            scripts: self.scripts.running().map(|(name, _)| name.to_owned()).collect(),
            ..State::new(self.name.clone())
        })
    }

    /// Whether this agent has the vehicle in the air, or on its way there.
    #[must_use]
    pub fn is_committed(&self) -> bool {
        self.flight.is_committed()
    }

    /// Whether the vehicle is in the air, as far as its autopilot has told.
    fn is_airborne(&self) -> bool {
        let telemetry = self.companion.telemetry();
        telemetry.armed && telemetry.landed != Landed::OnGround
    }

    /// One line about this vehicle.
    #[must_use]
    pub fn status(&self, now: Duration) -> Status {
        let telemetry = self.companion.telemetry();
        let nearest = telemetry.position.and_then(|position| self.neighbours.nearest(now, position.value));
        Status {
            mode: telemetry.mode.to_string(),
            task: self.task.clone(),
            waiting_for: self.waiting_for(),
            battery: telemetry.battery.map_or(0.0, |battery| battery.value.fraction),
            nearest,
        }
    }

    /// Who keeps this vehicle from moving on or taking off.
    fn waiting_for(&self) -> String {
        if let Some(fault) = &self.fault {
            return fault.clone();
        }
        if let Some(complaint) = self.failsafes.complaint() {
            return complaint.to_owned();
        }
        let question = self.me.any::<(Advance, Enter, Takeoff)>();
        let explanation = self.node.node().explain(question).local;
        if explanation.requested.is_empty() {
            return String::new();
        }
        let blockers: std::collections::BTreeSet<&str> =
            explanation.blocked.iter().map(|(bthread, _)| &**bthread).collect();
        blockers.into_iter().collect::<Vec<_>>().join(", ")
    }

    /// Everything selected here or heard of since the last call, in order.
    pub fn take_selections(&mut self) -> Vec<Happened> {
        std::mem::take(&mut self.selections)
    }

    /// The scripts that run, by name.
    pub fn scripts(&self) -> impl Iterator<Item = (&str, &RunningScript)> {
        self.scripts.running()
    }

    /// Why this agent's next life would not run the scripts that run now, if so: they could not be written down yet.
    #[must_use]
    pub fn unsaved_scripts(&self) -> Option<&str> {
        self.scripts.unsaved()
    }

    /// How the mission ended, once it has.
    #[must_use]
    pub fn outcome(&self) -> Option<&Outcome> {
        self.outcome.as_ref()
    }

    /// What set-points were made from so far.
    #[must_use]
    pub fn set_points(&self) -> SetPointRecord {
        self.set_points
    }

    /// The path ahead, from the vehicle to its waypoint; empty without one.
    pub fn path_ahead(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        self.guidance.path_ahead()
    }

    /// The vehicle's node: its program, its peers, and what has come in that was not understood.
    #[must_use]
    pub fn node(&self) -> &NodeLink {
        &self.node
    }

    /// Whether a path is being searched for that the last tick was not enough for.
    #[must_use]
    pub fn is_planning(&self) -> bool {
        self.guidance.is_planning()
    }

    /// The vehicle's node name.
    #[must_use]
    pub fn name(&self) -> &NodeName {
        &self.name
    }
}

/// An empty map of where this mission may fly.
fn perception(config: &AgentConfig) -> Result<Perception, MapError> {
    let perception = Perception::new(&config.fence, Vector3::from(config.home), heights(config))?;
    if config.airspace == Airspace::default() {
        return Ok(perception);
    }
    Ok(perception.with_keep_out(KeepOut::new(config.airspace.clone(), ZONE_MARGIN_M, TERRAIN_CLEARANCE_M)))
}

/// The least and the greatest height in the world at which this mission may fly, metres.
fn heights(config: &AgentConfig) -> [f64; 2] {
    let [_, _, home_m] = config.home;
    let waypoints = config.waypoints.iter().map(|[_, _, z]| *z);
    let heights = || waypoints.clone().chain([config.return_altitude_m, home_m + config.takeoff_height_m]);
    let lowest_m = heights().fold(f64::INFINITY, f64::min) - BELOW_WAYPOINTS_M;
    [lowest_m.max(home_m + LEAST_HEIGHT_M), heights().fold(0.0, f64::max) + ABOVE_WAYPOINTS_M]
}
