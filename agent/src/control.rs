//! Control: from the autopilot's telemetry, scans and neighbours to set-points. It waits for no b-thread and no
//! network.

use std::sync::Arc;
use std::time::Duration;

use nalgebra::Vector3;
use skein_dbp::NodeName;
use skein_mav::{Companion, CompanionConfig, Landed, SetPoint};
use skein_planning::map::MapError;
use skein_wire::{Limits, Scan, State};

use crate::{
    config::AgentConfig,
    failsafes::Failsafes,
    flight::{Flight, FlightPhase},
    instruction::Instruction,
    neighbours::{Neighbour, Neighbours},
    pipeline::{
        allowed::Allowed,
        guidance::Guidance,
        layers::Layers,
        perception::{Other, Perception, Pose},
        set_point::{FRESH_FOR, KeepAlive, keep_alive, oldest_age},
        surroundings::Surroundings,
        touchdown::Descent,
    },
    positioning::{Estimate, Motion, Positioning, excess_m},
    report::Report,
    scripts::Circumstances,
    watches::{Checks, LOCATED_WITHIN, Watches},
};

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

/// One vehicle under control.
#[derive(Debug)]
pub struct Control {
    config: Arc<AgentConfig>,
    name: NodeName,
    companion: Companion,
    failsafes: Failsafes,
    flight: Flight,
    positioning: Box<dyn Positioning>,
    estimate: Estimate,
    /// Why the estimate is none to fly by, if so.
    doubt: Option<String>,
    perception: Perception,
    neighbours: Neighbours,
    watches: Watches,
    guidance: Guidance,
    set_points: SetPointRecord,
}

impl Control {
    /// Control of a vehicle that has not been heard of yet.
    ///
    /// # Errors
    /// The fence is no space to fly in.
    pub fn new(
        config: Arc<AgentConfig>,
        name: NodeName,
        positioning: Box<dyn Positioning>,
        layers: Layers,
    ) -> Result<Self, MapError> {
        Ok(Self {
            companion: Companion::new(CompanionConfig {
                system_id: config.system_id,
                component_id: 191,
                datum: config.datum,
            }),
            failsafes: Failsafes::default(),
            flight: Flight::new(config.takeoff_height_m),
            positioning,
            estimate: Estimate::default(),
            doubt: None,
            perception: Perception::of_mission(&config)?,
            neighbours: Neighbours::new(name.clone(), config.incarnation),
            watches: Watches::default(),
            guidance: Guidance::new(config.envelope, layers),
            set_points: SetPointRecord::default(),
            name,
            config,
        })
    }

    /// Takes in bytes from the autopilot.
    pub fn receive_mavlink(&mut self, now: Duration, bytes: &[u8]) {
        self.companion.receive(now, bytes);
        self.locate(now);
    }

    /// Takes in the newest estimate; what was placed by those before is shifted with it.
    fn locate(&mut self, now: Duration) {
        let before = self.estimate.frame;
        self.estimate = self.positioning.estimate(now, self.companion.telemetry());
        let shift = self.estimate.frame - before;
        if shift != Vector3::zeros() {
            self.perception.shift(&shift);
            self.guidance.steering.shift(&shift);
        }
        self.doubt = self.watches.position(&self.estimate, self.config.sigma_limit_m);
        if let Some(motion) = &self.estimate.motion {
            self.perception.allow_for(excess_m(motion.value.position_sigma_m()));
        }
    }

    /// Bytes for the autopilot.
    pub fn take_mavlink(&mut self) -> Vec<u8> {
        self.companion.take_output()
    }

    /// Takes in a lidar scan.
    pub fn sense(&mut self, now: Duration, scan: &Scan) {
        // What an old one saw would be drawn where the vehicle is now.
        if now.saturating_sub(scan.stamp) > FRESH_FOR {
            return;
        }
        let Some((position, attitude)) = self.estimate.pose_at(scan.stamp) else { return };
        // From the ground there is little to see, and much of it is the ground.
        if !self.is_airborne() {
            return;
        }
        let sigma_m = self.position_sigma_m();
        let other = |neighbour: Neighbour| Other {
            position: neighbour.position(),
            off_m: excess_m(sigma_m.hypot(neighbour.track.sigma_m)),
        };
        let others: Vec<_> = self.neighbours.at(now).map(other).collect();
        self.perception.take_in(scan, &Pose { position, attitude }, &others);
        let (returns, rays) = (self.perception.returns(), scan.ranges_m.len());
        self.guidance.steering.look(scan.stamp, &position, returns, rays, self.perception.map());
    }

    /// Takes in what other vehicles say of themselves.
    pub fn hear(&mut self, now: Duration, states: Vec<State>) {
        for state in states {
            self.neighbours.hear(now, state);
        }
        self.neighbours.look_around(now);
    }

    /// The agent has not run for `pause`: if it flew the vehicle, it does not any more.
    pub fn wake(&mut self, pause: Duration) -> Option<Report> {
        let report = self.flight.wake(pause)?;
        self.guidance.steering.rest();
        self.neighbours.look_away();
        Some(report)
    }

    /// Begins a tick: finds out what has changed.
    pub fn observe(&mut self, now: Duration) -> Vec<Report> {
        self.companion.tick(now);
        self.locate(now);
        let mut reports = Vec::new();
        self.follow_autopilot(now, &mut reports);
        self.watch(now, &mut reports);
        reports.extend(self.guidance.go_on_planning(self.perception.map_mut()));
        reports
    }

    fn follow_autopilot(&mut self, now: Duration, reports: &mut Vec<Report>) {
        self.failsafes.ask(&mut self.companion);
        while let Some(event) = self.companion.poll_event() {
            self.failsafes.hear(&event, self.companion.dialect());
            reports.extend(self.flight.hear(now, &event, &mut self.companion));
        }
        let position = self.motion().map(|motion| motion.position);
        reports.extend(self.flight.follow(now, position, &mut self.companion));
    }

    fn watch(&mut self, now: Duration, reports: &mut Vec<Report>) {
        let AgentConfig { envelope, fence, home, .. } = &*self.config;
        let (telemetry, estimate) = (self.companion.telemetry(), self.estimate);
        let (around, home) = (self.neighbours.around(), Vector3::from(*home));
        let checks = Checks {
            is_located: estimate.is_fresh(now, LOCATED_WITHIN) && self.doubt.is_none(),
            has_sound_failsafes: self.failsafes.are_sound(),
            is_clear_overhead: !around.iter().any(|neighbour| neighbour.may_be_over(&home, envelope)),
            is_taking_off: self.flight.is_taking_off(),
            has_somewhere_to_fly: self.guidance.has_somewhere_to_fly(),
        };
        reports.extend(self.watches.preflight(telemetry, checks));
        if let (true, Some(motion)) = (self.is_airborne(), estimate.motion) {
            let position = motion.value.position;
            if let Some(battery) = telemetry.battery {
                let seconds_home = (position - home).norm() / envelope.cruise_m_s + 10.0;
                reports.extend(self.watches.battery(now, battery.value, seconds_home));
            }
            let sigma_m = motion.value.position_sigma_m();
            reports.extend(self.watches.doubt(self.doubt.as_deref(), sigma_m));
            reports.extend(self.watches.fence(&motion.value, fence));
            reports.extend(self.watches.separation(position, around));
        } else {
            self.watches.stand();
        }
    }

    /// Begins a navigation cycle: looks along the path.
    pub fn look_ahead(&mut self, now: Duration) -> Vec<Report> {
        let Some(motion) = self.flown_motion() else { return Vec::new() };
        let (map, around) = (self.perception.map(), self.neighbours.around());
        self.guidance.look_ahead(now, &motion, map, around)
    }

    /// The facts that whoever listens may be told, once the vehicle's place is known.
    #[must_use]
    pub fn circumstances(&self) -> Option<Circumstances<'_>> {
        Some(Circumstances {
            position: self.motion()?.position,
            is_flown: self.flown_motion().is_some(),
            ahead: self.guidance.place_ahead(),
            battery: self.companion.telemetry().battery.map(|battery| battery.value.fraction),
            neighbours: self.neighbours.around(),
        })
    }

    /// What this vehicle tells the others of its body, ten times a second.
    pub fn state(&mut self, now: Duration) -> Option<State> {
        let Estimate { motion, attitude, .. } = self.estimate;
        let Motion { position, velocity, .. } = motion?.value;
        let telemetry = self.companion.telemetry();
        Some(State {
            time: now,
            position,
            velocity,
            yaw_rad: attitude.map_or(0.0, |attitude| attitude.value.body_to_world.euler_angles().2),
            position_sigma_m: motion?.value.position_sigma_m(),
            radius_m: self.config.envelope.hull_m,
            mode: telemetry.mode.to_string(),
            battery: self.battery(),
            armed: telemetry.armed,
            path: self.guidance.course.path_ahead().take(State::MAX_PATH).collect(),
            echo: self.neighbours.echo(now),
            ..State::new(self.name.clone())
        })
    }

    /// Keeps to these limits from now on.
    pub fn limit(&mut self, limits: &Limits) {
        let ([.., low_m], [.., high_m]) = limits.region();
        self.perception.reach([low_m, high_m]);
        self.guidance.limit(Allowed::from(limits));
    }

    /// Carries out an instruction.
    pub fn carry_out(&mut self, now: Duration, instruction: Instruction) -> Option<Report> {
        if instruction == Instruction::TakeOff {
            let height_m = self.guidance.takeoff_height_m(self.config.takeoff_height_m, self.config.home[2]);
            self.flight.climb_to(height_m);
        }
        self.flight.carry_out(now, instruction, &mut self.companion);
        match instruction {
            Instruction::GoTo(waypoint) => self.guidance.head_for(waypoint),
            Instruction::Plan { is_stuck } => {
                let (motion, map) = (self.motion()?, self.perception.map_mut());
                return self.guidance.plan(is_stuck, &motion, map, self.neighbours.around());
            }
            Instruction::GrantLeave => self.guidance.grant_leave(now),
            Instruction::Land => self.settle(now),
            Instruction::EndFlight => self.guidance.forget(),
            Instruction::Hold => self.guidance.hold(),
            Instruction::TakeOff | Instruction::TakeBack | Instruction::Resume => {}
        }
        None
    }

    /// A vehicle that is to land goes to where it can, and lands there; wherever it is in the end, or if it does not
    /// see.
    fn settle(&mut self, now: Duration) {
        let FlightPhase::Settling { until } = self.flight.phase() else { return };
        let sees = self.keep_alive(now) == KeepAlive::Command && self.doubt.is_none();
        let place = self.motion().filter(|_| sees && now < until).and_then(|motion| {
            let descent = Descent {
                name: &self.name,
                position: motion.position,
                stop: self.guidance.stop(&motion),
                ground_m: self.config.home[2],
                envelope: &self.config.envelope,
                fence: &self.config.fence,
                map: self.perception.map(),
                neighbours: self.neighbours.around(),
            };
            descent.detour(self.guidance.steering.settles_at)
        });
        self.guidance.steering.settles_at = place;
        if place.is_none() {
            self.flight.touch_down(now, &mut self.companion);
        }
    }

    /// Ends a tick: sends a set-point, if one may be sent.
    pub fn steer(&mut self, now: Duration) {
        self.settle(now);
        if !self.flight.sends_set_points() {
            self.guidance.steering.rest();
            return;
        }
        let Some(motion) = self.motion() else { return };
        match self.keep_alive(now) {
            KeepAlive::Command => {
                let around = self.neighbours.around();
                let armed = around.iter().filter(|neighbour| neighbour.armed);
                let surroundings = Surroundings {
                    map: self.perception.map(),
                    obstacles: self.perception.obstacles(),
                    neighbours: &armed.map(|neighbour| neighbour.track).collect::<Vec<_>>(),
                    rank: self.rank(around),
                };
                let set_point = self.guidance.steer(now, &motion, &surroundings);
                self.set_points.commands += 1;
                let age = oldest_age(now, &self.inputs()).unwrap_or_default();
                self.set_points.oldest_input = self.set_points.oldest_input.max(age);
                self.companion.set_point(now, set_point);
            }
            KeepAlive::Stop => {
                self.set_points.stops += 1;
                self.guidance.steering.rest();
                self.companion.set_point(now, SetPoint::Velocity { velocity: Vector3::zeros(), yaw: None });
            }
            KeepAlive::Silence => self.guidance.steering.rest(),
        }
    }

    /// How many of the neighbours have names that come before this vehicle's.
    fn rank(&self, neighbours: &[Neighbour]) -> u32 {
        let before = neighbours.iter().filter(|neighbour| neighbour.node < self.name);
        u32::try_from(before.count()).unwrap_or(u32::MAX)
    }

    /// When what set-points are made from was measured.
    fn inputs(&self) -> Vec<Option<Duration>> {
        let scan = self.config.lidar.then(|| self.perception.last_scan());
        self.estimate.stamps().into_iter().chain(scan).collect()
    }

    /// The keep-alive rule. While the autopilot is heard and only its position is doubted, it is told to stand still
    /// until it is told to land: there is nothing that its own failsafe would know better.
    fn keep_alive(&self, now: Duration) -> KeepAlive {
        match keep_alive(now, &self.inputs()) {
            KeepAlive::Silence if self.doubt.is_some() => {
                let others: Vec<_> = self.inputs().into_iter().skip(1).collect();
                keep_alive(now, &others).at_most_stop()
            }
            kept => kept,
        }
    }

    fn motion(&self) -> Option<Motion> {
        self.estimate.motion.map(|motion| motion.value)
    }

    /// The motion of a vehicle that this agent flies.
    fn flown_motion(&self) -> Option<Motion> {
        self.motion().filter(|_| self.flight.phase() == FlightPhase::Flying)
    }

    /// Whether the vehicle is in the air, as far as its autopilot has told.
    fn is_airborne(&self) -> bool {
        let telemetry = self.companion.telemetry();
        telemetry.armed && telemetry.landed != Landed::OnGround
    }

    #[must_use]
    pub fn flight(&self) -> &Flight {
        &self.flight
    }

    #[must_use]
    pub fn guidance(&self) -> &Guidance {
        &self.guidance
    }

    /// Standard deviation of the position, m; 0 while there is none.
    #[must_use]
    pub fn position_sigma_m(&self) -> f64 {
        self.motion().map_or(0.0, |motion| motion.position_sigma_m())
    }

    /// What set-points were made from so far.
    #[must_use]
    pub fn set_points(&self) -> SetPointRecord {
        self.set_points
    }

    /// What makes the autopilot's own failsafes unsafe, or its position none to fly by, if something does.
    #[must_use]
    pub fn complaint(&self) -> Option<&str> {
        self.failsafes.complaint().or(self.doubt.as_deref())
    }

    /// Flight mode as the autopilot tells it.
    #[must_use]
    pub fn mode(&self) -> String {
        self.companion.telemetry().mode.to_string()
    }

    /// Energy left, 0 to 1.
    #[must_use]
    pub fn battery(&self) -> f64 {
        self.companion.telemetry().battery.map_or(0.0, |battery| battery.value.fraction)
    }

    /// Nearest neighbour and its distance in metres.
    #[must_use]
    pub fn nearest(&self, now: Duration) -> Option<(NodeName, f64)> {
        self.neighbours.nearest(now, self.motion()?.position)
    }
}
