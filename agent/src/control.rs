//! Control: from the autopilot's telemetry, scans and neighbours to set-points. It waits for no b-thread and no
//! network.

use std::sync::Arc;
use std::time::Duration;

use nalgebra::Vector3;
use skein_bp::Bound;
use skein_dbp::NodeName;
use skein_mav::{Companion, CompanionConfig, Landed, MavEvent, SetPoint, Station, Telemetry, Text, axes};
use skein_planning::map::MapError;
use skein_positioning::PoseFix;
use skein_wire::event::Right;
use skein_wire::{Limits, Readiness, Scan, State, Zone};

use crate::{
    apart::decisions::{Decisions, Standing, is_too_late},
    arrival,
    autopilot_words::AutopilotWords,
    config::AgentConfig,
    energy::{Energy, known_charge},
    flight::{Flight, FlightPhase},
    instruction::{Instruction, Waypoint},
    living_airspace::LivingAirspace,
    neighbours::{Neighbour, Neighbours},
    pipeline::{
        allowed::Allowed,
        ground_seen::GroundSeen,
        guidance::Guidance,
        heading::Heading,
        headroom::{Headroom, Look},
        layers::Layers,
        perception::{Other, Perception, Pose, ZONE_MARGIN_M},
        set_point::{FRESH_FOR, KeepAlive, keep_alive, oldest_age},
        surroundings::Surroundings,
        touchdown::Descent,
    },
    positioning::{Estimate, Motion, Positioning, Sensed, excess_m},
    preflight::{Failsafes, HandlingParameters, Others, Preflight, Situation, degrees},
    rank::goes_before,
    refuge::Refuge,
    report::Report,
    scripts::Circumstances,
    watches::Watches,
};

/// The checks before take-off are told this often, for those who have come since.
const READINESS_PERIOD: Duration = Duration::from_secs(1);

/// The inputs of set-points: the keep-alive rule, observed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SetPointRecord {
    /// Set-points of the pipeline.
    pub commands: u64,
    /// Zero velocities for want of fresh inputs.
    pub stops: u64,
    /// Age of the oldest input that a command was made from.
    pub oldest_input: Duration,
    /// Stops that the safety filter asked for beyond a tilt of 5 degrees.
    pub hard_brakes: u64,
}

const STOP: SetPoint = SetPoint::Velocity { velocity: Vector3::new(0.0, 0.0, 0.0), yaw: None };

/// One vehicle under control.
#[derive(Debug)]
pub struct Control {
    config: Arc<AgentConfig>,
    name: NodeName,
    companion: Companion,
    /// Another station on the autopilot's line.
    station: Station,
    /// Lines that the autopilot wrote, until they are taken.
    texts: Vec<Text>,
    words: AutopilotWords,
    preflight: Preflight,
    failsafes: Failsafes,
    handling: HandlingParameters,
    /// The checks of the others, by their own word.
    others: Others,
    look: Option<Look>,
    ground_seen: GroundSeen,
    /// Where the vehicle landed last.
    landed_at: Option<Vector3<f64>>,
    flight: Flight,
    positioning: Box<dyn Positioning>,
    estimate: Estimate,
    /// Why the estimate is none to fly by, if so.
    doubt: Option<String>,
    perception: Perception,
    living: LivingAirspace,
    /// The limits that its b-threads state.
    stated: Limits,
    neighbours: Neighbours,
    watches: Watches,
    refuge: Refuge,
    energy: Energy,
    guidance: Guidance,
    heading: Heading,
    set_points: SetPointRecord,
    /// The newest set-point, and when it was made.
    last_set_point: Option<(Duration, SetPoint)>,
    decisions: Decisions,
    told_readiness: Option<(Duration, Readiness)>,
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
                wants_measured: positioning.wants_measured(),
                signing: config.signing,
            }),
            station: Station::of(config.system_id),
            texts: Vec::new(),
            words: AutopilotWords::default(),
            preflight: Preflight::default(),
            failsafes: Failsafes::new(config.system_id),
            handling: HandlingParameters::default(),
            others: Others::new(),
            look: None,
            ground_seen: GroundSeen::default(),
            landed_at: None,
            flight: Flight::new(config.takeoff_height_m),
            positioning,
            estimate: Estimate::default(),
            doubt: None,
            perception: Perception::of_mission(&config)?,
            living: LivingAirspace::new(&config),
            stated: Limits::default(),
            neighbours: Neighbours::new(name.clone(), config.incarnation, config.roster.len())
                .within_radio_range(config.radio_range_m),
            watches: Watches::default(),
            refuge: Refuge::new([config.home[0], config.home[1], config.return_altitude_m], &config.rally),
            energy: Energy::new(config.clone()),
            guidance: Guidance::new(config.envelope, layers),
            heading: Heading::new(config.planners.nose),
            set_points: SetPointRecord::default(),
            last_set_point: None,
            decisions: Decisions::default(),
            told_readiness: None,
            name,
            config,
        })
    }

    /// From now on a pilot flies, and nothing leaves that the vehicle would obey.
    pub fn shadow(&mut self) {
        self.companion.only_listen();
        self.flight.shadow();
    }

    /// Takes in bytes from the autopilot.
    pub fn receive_mavlink(&mut self, now: Duration, bytes: &[u8]) {
        self.companion.receive(now, bytes);
        self.locate(now);
    }

    /// Takes in a pose by markers.
    pub fn see_markers(&mut self, now: Duration, fix: &PoseFix) {
        self.positioning.sense(now, &Sensed::Markers(*fix));
    }

    /// Takes in the newest estimate; what was placed by those before is shifted with it.
    fn locate(&mut self, now: Duration) {
        for reading in self.companion.take_measured() {
            self.positioning.sense(now, &Sensed::Instrument(reading));
        }
        let before = self.estimate.frame;
        self.estimate = self.positioning.estimate(now, self.companion.telemetry());
        let shift = self.estimate.frame - before;
        if shift != Vector3::zeros() {
            self.perception.shift(&shift);
            self.guidance.steering.shift(&shift);
            self.flight.shift(&shift);
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

    /// Takes in what a station says to the autopilot through this agent: an order of it takes the vehicle over.
    pub fn overhear(&mut self, bytes: &[u8]) -> Option<Report> {
        let order = self.station.hear(bytes)?;
        self.flight.yield_to_station(&order, self.companion.telemetry().mode)
    }

    /// Takes the lines that the autopilot has written since the last call.
    pub fn take_texts(&mut self) -> Vec<Text> {
        std::mem::take(&mut self.texts)
    }

    /// Takes in a lidar scan.
    pub fn sense(&mut self, now: Duration, scan: &Scan) {
        // What an old one saw would be drawn where the vehicle is now.
        if now.saturating_sub(scan.stamp) > FRESH_FOR {
            return;
        }
        self.positioning.scan(scan);
        let [up_m, down_m] = [scan.up_m, scan.down_m].map(|range| range.map(f64::from));
        self.look = Some(Look { stamp: scan.stamp, up_m, down_m });
        let Some((position, attitude)) = self.estimate.pose_at(scan.stamp) else { return };
        // From the ground there is little to see, and much of it is the ground.
        if !self.is_airborne() {
            return;
        }
        self.ground_seen.look(&position, self.config.home[2], down_m);
        let sigma_m = self.position_sigma_m();
        let other = |neighbour: Neighbour| Other {
            position: neighbour.position(),
            off_m: excess_m(sigma_m.hypot(neighbour.track.sigma_m)),
        };
        let others: Vec<_> = self.neighbours.at(now).map(other).collect();
        let movers = self.guidance.steering.movers();
        if !self.perception.take_in(scan, &Pose { position, attitude }, &others, movers) {
            return;
        }
        let (returns, rays) = (self.perception.returns(), scan.ranges_m.len());
        self.guidance.steering.look(scan.stamp, &position, returns, rays, self.perception.map());
    }

    /// Takes in what other vehicles say of themselves.
    pub fn hear(&mut self, now: Duration, states: Vec<State>) {
        self.neighbours.listen_at(self.motion().map(|motion| motion.position));
        for state in states {
            self.neighbours.hear(now, state);
        }
        self.neighbours.look_around(now);
    }

    /// Takes in what other vehicles say of their checks before take-off.
    pub fn hear_readiness(&mut self, now: Duration, readiness: Vec<Readiness>) {
        let most = self.config.roster.len().max(Bound::Strangers.most());
        for said in readiness {
            if self.others.len() < most || self.others.contains_key(&said.node) {
                self.others.insert(said.node.clone(), (now, said));
            }
        }
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
        self.look_at_airspace(now);
        if let Some(external) = self.positioning.external(now) {
            self.companion.external(now, &external);
        }
        let mut reports: Vec<_> =
            self.positioning.take_news().into_iter().map(Report::PositionSource).collect();
        self.follow_autopilot(now, &mut reports);
        self.watch(now, &mut reports);
        reports.extend(self.heed_silence(now));
        let planned = self.guidance.go_on_planning(self.perception.map_mut());
        reports.extend(planned.map(|report| self.with_zone(report)));
        reports
    }

    /// Has regard for these zones from now on, and for no others that are drawn.
    pub fn draw(&mut self, now: Duration, zones: Vec<Zone>) {
        self.living.draw(zones);
        self.look_at_airspace(now);
    }

    fn look_at_airspace(&mut self, now: Duration) {
        let position = self.motion().map(|motion| motion.position);
        if !self.living.look(now, position.as_ref()) {
            return;
        }
        self.perception.close(self.living.closed().clone());
        self.guidance.steering.look_for_a_place();
        self.perception.reach(self.living.rally().map(|[.., z]| z));
        self.refuge.set_rally(self.config.rally.iter().copied().chain(self.living.rally()));
        self.keep_to_limits();
    }

    fn keep_to_limits(&mut self) {
        let limits = self.living.limits(&self.stated);
        let ([.., low_m], [.., high_m]) = limits.region();
        self.perception.reach([low_m, high_m]);
        self.guidance.limit(Allowed::from(&limits));
    }

    /// Where there is no path, the zone that is in the way.
    fn with_zone(&self, report: Report) -> Report {
        let Report::Unplannable { leg, why, .. } = report else { return report };
        let ends = self.motion().zip(self.guidance.course.waypoint);
        let zone = ends.and_then(|(motion, waypoint)| {
            self.living.in_the_way(&motion.position, &waypoint.target, ZONE_MARGIN_M)
        });
        Report::Unplannable { leg, why, zone: zone.map(str::to_owned) }
    }

    fn follow_autopilot(&mut self, now: Duration, reports: &mut Vec<Report>) {
        self.failsafes.ask(now, &mut self.companion);
        self.handling.ask(&mut self.companion);
        while let Some(event) = self.companion.poll_event() {
            self.failsafes.hear(&event, self.companion.dialect());
            self.handling.hear(&event, self.companion.dialect());
            reports.extend(self.flight.hear(now, &event, &mut self.companion));
            if let MavEvent::Text(text) = event {
                self.words.hear(&text);
                if self.texts.len() < Telemetry::MAX_TEXTS {
                    self.texts.push(text);
                }
            }
        }
        reports.extend(self.words.tell(now));
        let envelope = self.handling.within(self.config.envelope, self.companion.dialect());
        if envelope != *self.guidance.envelope() {
            self.guidance.handle(envelope);
            self.perception.handle(&envelope);
        }
        let position = self.motion().map(|motion| motion.position);
        let report = self.flight.follow(now, position, self.preflight.is_ready(), &mut self.companion);
        if report == Some(Report::Landed) {
            self.landed_at = position;
        }
        reports.extend(report);
    }

    fn watch(&mut self, now: Duration, reports: &mut Vec<Report>) {
        let charge = known_charge(now, self.companion.telemetry().battery);
        self.watch_energy(now, charge, reports);
        let fence = &self.config.fence;
        let (telemetry, estimate) = (self.companion.telemetry(), self.estimate);
        let around = self.neighbours.around();
        reports.extend(self.preflight.update(&Situation {
            now,
            config: &self.config,
            telemetry,
            make: self.companion.dialect().name(),
            estimate,
            doubt: self.doubt.as_deref(),
            failsafes: &self.failsafes,
            envelope: self.handling.check(self.guidance.envelope(), self.companion.dialect()),
            look: self.look,
            keep_out: self.perception.map().keep_out(),
            neighbours: around,
            others: &self.others,
            landed_at: self.landed_at,
            charge,
            shortfall: self.energy.reason_to_stay(),
            is_taking_off: self.flight.is_taking_off(),
            is_flown: self.flight.is_committed(),
            has_somewhere_to_fly: self.guidance.has_somewhere_to_fly(),
        }));
        if let (true, Some(motion)) = (self.is_airborne(), estimate.motion) {
            let position = motion.value.position;
            let sigma_m = motion.value.position_sigma_m();
            reports.extend(self.watches.doubt(self.doubt.as_deref(), sigma_m));
            reports.extend(self.watches.fence(&motion.value, fence, &self.living.closed().stay_inside));
            reports.extend(self.living.watch(&position));
            reports.extend(self.watches.separation(position, around));
            reports.extend(self.refuge.look(&self.name, &position, around, self.guidance.goes_home()));
        } else {
            self.watches.stand();
        }
    }

    fn watch_energy(&mut self, now: Duration, charge: Option<f64>, reports: &mut Vec<Report>) {
        if !self.is_airborne() {
            reports.extend(self.energy.rest(now, charge).map(Report::BatteryChanged));
            return;
        }
        let Estimate { motion: Some(motion), attitude, .. } = self.estimate else { return };
        let (map, clearance_m) = (self.perception.map(), self.config.envelope.obstacle_clearance_m());
        // What the map does not reach to, or has forgotten, is not known to be clear.
        let is_mapped = |place: &_| map.voxels().index_of(place).is_some();
        let is_clear = |from: &_, to: &_| {
            is_mapped(from) && map.is_segment_clear(from, to, clearance_m) && map.is_open(from, to)
        };
        let body_to_world = attitude.map(|attitude| attitude.value.body_to_world);
        self.energy.fly(now, charge, &motion.value, body_to_world.as_ref(), is_clear);
        let why_low = self.energy.reason_to_return(now, charge, motion.value.position);
        reports.extend(self.watches.battery(charge, why_low));
    }

    /// Begins a navigation cycle: looks along the path.
    pub fn look_ahead(&mut self, now: Duration) -> Vec<Report> {
        self.guidance.arrival_m_s = self.arrival_m_s();
        let Some(motion) = self.flown_motion() else { return Vec::new() };
        let (map, around) = (self.perception.map_mut(), self.neighbours.around());
        let found = self.guidance.look_ahead(now, &motion, map, around);
        found.into_iter().map(|report| self.with_zone(report)).collect()
    }

    /// The time that the vehicle has to go at cruise speed until it arrives together with others, s; none if it does
    /// not.
    fn to_go_s(&self) -> Option<f64> {
        let (motion, course) = (self.flown_motion()?, &self.guidance.course);
        let is_there = |waypoint: &Waypoint| course.has_arrived && waypoint.lands;
        let is_alone = self.config.arrives_with.is_empty();
        let waypoint = course.waypoint.filter(|waypoint| !is_alone && !is_there(waypoint))?;
        let ahead = course.following.as_ref().map(|following| following.ahead().collect::<Vec<_>>());
        let ahead = ahead.unwrap_or_else(|| vec![motion.position]).into_iter();
        let way = ahead.chain([waypoint.target]);
        Some(arrival::to_go_s(way, self.guidance.envelope()) + waypoint.beyond_s?)
    }

    /// The speed at which it does, m/s; infinite if it arrives by itself.
    fn arrival_m_s(&self) -> f64 {
        let Some(own_s) = self.to_go_s() else { return f64::INFINITY };
        let with = &self.config.arrives_with;
        let arrives_too = |other: &&Neighbour| with.iter().any(|node| node == other.node.as_str());
        let others = self.neighbours.around().iter().filter(arrives_too);
        arrival::speed_m_s(own_s, others, self.guidance.envelope())
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

    /// This vehicle's word to the others about its body, ten times a second.
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
            incarnation: self.config.incarnation,
            path: self.guidance.way_ahead().take(State::MAX_PATH).collect(),
            echo: self.neighbours.echo(now),
            to_go_s: self.to_go_s(),
            ..State::new(self.name.clone())
        })
    }

    /// Keeps to these limits from now on.
    pub fn limit(&mut self, limits: &Limits) {
        self.stated = limits.clone();
        self.keep_to_limits();
    }

    /// The mission has decided at this time, even if it was that nothing is to be done.
    pub fn note_decision(&mut self, at: Duration) {
        self.decisions.note(at);
    }

    /// For how long the mission has not decided, if that is too long to fly on.
    pub fn mission_silence(&mut self, now: Duration) -> Option<Duration> {
        (self.decisions.standing(now) != Standing::Fresh).then(|| self.decisions.age(now))
    }

    /// Without fresh decisions there is no leave to move, so that the vehicle hovers and avoids; what does
    /// not fly yet is called off, and after a while it lands.
    fn heed_silence(&mut self, now: Duration) -> Option<Report> {
        let standing = self.decisions.standing(now);
        let why = format!("nothing was decided on board for {:.1} s", self.decisions.age(now).as_secs_f64());
        match standing {
            Standing::Fresh => None,
            Standing::Old | Standing::TooOld if self.flight.is_on_the_ground() => {
                self.flight.call_off(now, &why, &mut self.companion)
            }
            Standing::Old => None,
            Standing::TooOld => self.land(now, &why),
        }
    }

    /// Lands of its own accord a vehicle that it flies, unless it does already; gives what the mission should
    /// hear.
    pub fn land(&mut self, now: Duration, why: &str) -> Option<Report> {
        if !self.flight.is_committed() || self.flight.is_landing() || self.flight.is_on_the_ground() {
            return None;
        }
        self.carry_out(now, now, Instruction::Land);
        Some(Report::Lands(why.to_owned()))
    }

    /// Carries out an instruction that was decided at `at`.
    pub fn carry_out(&mut self, now: Duration, at: Duration, instruction: Instruction) -> Option<Report> {
        if is_too_late(now, at, &instruction) {
            return self.flight.decline(instruction, self.companion.telemetry().mode);
        }
        if instruction == Instruction::TakeOff {
            let height_m = self.guidance.takeoff_height_m(self.config.takeoff_height_m, self.config.home[2]);
            self.flight.climb_to(height_m, self.motion().map(|motion| motion.position));
        }
        self.flight.carry_out(now, instruction, &mut self.companion);
        match instruction {
            Instruction::GoTo(waypoint) => {
                // One that was sent on the way may be higher than all of the mission.
                self.perception.reach(Some(waypoint.target.z).filter(|_| !waypoint.lands));
                self.guidance.head_for(waypoint);
            }
            Instruction::Plan { is_stuck } => {
                let (motion, map) = (self.motion()?, self.perception.map_mut());
                let report = self.guidance.plan(is_stuck, &motion, map, self.neighbours.around());
                return report.map(|report| self.with_zone(report));
            }
            Instruction::GrantLeave => self.guidance.grant_leave(at),
            Instruction::MakeWay => {
                let (motion, map) = (self.motion()?, self.perception.map());
                return self.guidance.make_way(now, &motion, map, self.neighbours.around());
            }
            Instruction::Land => self.settle(now),
            Instruction::EndFlight => self.guidance.forget(),
            Instruction::Hold => self.guidance.hold(),
            Instruction::FlyBy(source) => self.positioning.fly_by(source),
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
            let stop = self.guidance.stop(&motion);
            let spot = self.guidance.course.landing_place();
            let spot = spot.map(|place| place.xy().push(motion.position.z));
            let descent = Descent {
                name: &self.name,
                position: motion.position,
                speed_m_s: motion.velocity.xy().norm(),
                stop,
                wanted: spot.unwrap_or(stop),
                ground_m: self.config.home[2],
                envelope: &self.config.envelope,
                fence: &self.config.fence,
                map: self.perception.map(),
                neighbours: self.neighbours.around(),
                ground_seen: &self.ground_seen,
            };
            descent.detour(self.guidance.steering.settles_at.or(spot))
        });
        self.guidance.steering.settles_at = place;
        if place.is_none() {
            self.flight.touch_down(now, &mut self.companion);
        }
    }

    /// Ends a tick: sends a set-point, if one may be sent.
    pub fn steer(&mut self, now: Duration) {
        let look = self.look.filter(|look| now.saturating_sub(look.stamp) <= FRESH_FOR);
        self.guidance.headroom =
            look.map_or(Headroom::OPEN, |look| Headroom::of(&look, &self.config.envelope));
        self.settle(now);
        if !self.flight.sends_set_points() {
            self.guidance.steering.rest();
            self.heading.rest();
            self.climb(now);
            return;
        }
        let Some(motion) = self.motion() else { return };
        match self.keep_alive(now) {
            KeepAlive::Command => {
                let around = self.neighbours.around();
                let armed = || around.iter().filter(|neighbour| neighbour.armed);
                let me = (self.name.as_str(), Right::Inside);
                let goes_first = |other: &&Neighbour| {
                    !other.track.cooperative || goes_before((other.node.as_str(), other.right), me)
                };
                let surroundings = Surroundings {
                    map: self.perception.map(),
                    sees: self.config.lidar,
                    rays: self.perception.rays(),
                    obstacles: self.perception.obstacles(),
                    neighbours: &armed().map(|neighbour| neighbour.track).collect::<Vec<_>>(),
                    first: &armed().filter(goes_first).map(|first| first.track).collect::<Vec<_>>(),
                    rank: self.rank(around),
                };
                let set_point = self.guidance.steer(now, &motion, &surroundings);
                self.set_points.commands += 1;
                let age = oldest_age(now, &self.inputs()).unwrap_or_default();
                self.set_points.oldest_input = self.set_points.oldest_input.max(age);
                let attitude = self.estimate.attitude.map(|attitude| attitude.value.body_to_world);
                let set_point = self.heading.give(set_point, attitude.as_ref().map(axes::yaw));
                self.send(now, set_point);
            }
            KeepAlive::Stop => {
                self.set_points.stops += 1;
                self.guidance.steering.rest();
                self.send(now, STOP);
            }
            KeepAlive::Silence => self.guidance.steering.rest(),
        }
    }

    /// Climbs to where flight begins. From the ground there is little to see, so that hangs on the position alone.
    fn climb(&mut self, now: Duration) {
        let Some(set_point) = self.flight.climb(&self.companion) else { return };
        match keep_alive(now, &self.estimate.stamps()) {
            KeepAlive::Command => self.send(now, set_point),
            KeepAlive::Stop => self.send(now, STOP),
            KeepAlive::Silence => {}
        }
    }

    fn send(&mut self, now: Duration, set_point: SetPoint) {
        if self.companion.set_point(now, set_point) {
            self.last_set_point = Some((now, set_point));
        }
    }

    /// The newest set-point and when it was made, and the motion of the vehicle.
    #[must_use]
    pub fn last_set_point(&self) -> Option<(Duration, SetPoint, Motion)> {
        let (at, set_point) = self.last_set_point?;
        Some((at, set_point, self.motion()?))
    }

    /// The number of neighbours whose names come before this vehicle's.
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

    /// The vehicle's node name.
    #[must_use]
    pub fn name(&self) -> &NodeName {
        &self.name
    }

    /// Whether an autopilot is heard that does not fly.
    #[must_use]
    pub fn may_be_spoken_to(&self) -> bool {
        let telemetry = self.companion.telemetry();
        telemetry.connected && !telemetry.armed
    }

    #[must_use]
    pub fn flight(&self) -> &Flight {
        &self.flight
    }

    #[must_use]
    pub fn neighbours(&self) -> &Neighbours {
        &self.neighbours
    }

    #[must_use]
    pub fn guidance(&self) -> &Guidance {
        &self.guidance
    }

    /// The vehicle's state by its own belief.
    #[must_use]
    pub fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    /// Standard deviation of the position, m; 0 while there is none.
    #[must_use]
    pub fn position_sigma_m(&self) -> f64 {
        self.motion().map_or(0.0, |motion| motion.position_sigma_m())
    }

    /// The inputs of set-points so far.
    #[must_use]
    pub fn set_points(&self) -> SetPointRecord {
        SetPointRecord { hard_brakes: self.guidance.steering.hard_brakes.count, ..self.set_points }
    }

    /// The checks before take-off, as others should know them.
    #[must_use]
    pub fn readiness(&self) -> Readiness {
        Readiness {
            node: self.name.clone(),
            incarnation: self.config.incarnation,
            home: self.config.home,
            datum: degrees(&self.config.datum),
            checks: self.preflight.checks().to_vec(),
            mission: self.config.waypoints.clone(),
        }
    }

    /// The same, if it is to be told now: every second, and when one has changed its state.
    pub fn readiness_to_tell(&mut self, now: Duration) -> Option<Readiness> {
        let readiness = self.readiness();
        let states = |said: &Readiness| said.checks.iter().map(|check| check.state).collect::<Vec<_>>();
        let told = self.told_readiness.as_ref();
        let is_due =
            told.is_none_or(|(at, told)| now >= *at + READINESS_PERIOD || states(told) != states(&readiness));
        is_due.then(|| self.told_readiness.insert((now, readiness)).1.clone())
    }

    /// Why a vehicle on the ground is not ready to take off, or for what one in the air waits.
    #[must_use]
    pub fn complaint(&self) -> Option<String> {
        self.preflight.complaint().or_else(|| self.guidance.waits_for().map(str::to_owned))
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
