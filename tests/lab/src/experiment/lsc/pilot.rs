//! One vehicle: its autopilot over MAVLink, its place in traffic, and the velocity it commands.

use std::time::Duration;

use skein_mav::{Command, Companion, CompanionConfig, Datum, FlightMode, SetPoint};
use skein_swarm::traffic::{Move, Traveller};

use super::tracking::{Reference, Tracker};
use skein_sim::mission::LscAgent;

/// A command that is not obeyed is repeated after this long.
const REPEAT_AFTER: Duration = Duration::from_secs(1);
/// A vehicle hovers at its start, to within this, m, and slower than this, m/s, as far as its autopilot can tell.
const HOVERING: (f64, f64) = (0.04, 0.15);

/// A vehicle with its agent.
pub struct Pilot {
    /// Its place in traffic.
    pub traveller: Traveller,
    companion: Companion,
    tracker: Tracker,
    agent: LscAgent,
    /// Its height is given by the mission and never changes.
    level: bool,
    asked: Option<Duration>,
}

impl Pilot {
    /// A vehicle on the ground.
    pub fn new(index: usize, traveller: Traveller, agent: LscAgent, datum: Datum, level: bool) -> Self {
        let system_id = u8::try_from(index + 1).unwrap_or(u8::MAX);
        Self {
            traveller,
            companion: Companion::new(CompanionConfig::new(system_id, datum)),
            tracker: Tracker::new(agent.start, agent.max_speed_m_s, agent.max_accel_m_s2),
            agent,
            level,
            asked: None,
        }
    }

    /// Takes in bytes from the autopilot.
    pub fn receive(&mut self, now: Duration, bytes: &[u8]) {
        self.companion.receive(now, bytes);
        // Its telemetry tells all that is wanted.
        while self.companion.poll_event().is_some() {}
    }

    /// Bytes for the autopilot.
    pub fn take_output(&mut self) -> Vec<u8> {
        self.companion.take_output()
    }

    /// Before the clock runs: up to the start, and there into the hands of the agent. Returns whether it hovers there.
    pub fn prepare(&mut self, now: Duration) -> bool {
        self.companion.tick(now);
        let telemetry = self.companion.telemetry();
        let wish = match telemetry.mode {
            _ if !telemetry.armed => telemetry.ready_to_arm.then_some(Command::Arm),
            FlightMode::Takeoff | FlightMode::Offboard => None,
            FlightMode::Hold if self.is_up() => Some(Command::Offboard),
            _ => Some(Command::Takeoff { height_m: self.agent.start.z }),
        };
        let may_ask = self.asked.is_none_or(|asked| now.saturating_sub(asked) >= REPEAT_AFTER);
        if let Some(command) = wish.filter(|_| may_ask) {
            self.companion.command(now, command);
            self.asked = Some(now);
        }
        let flies = self.companion.telemetry().mode == FlightMode::Offboard;
        if flies || self.is_up() {
            self.steer(now, &Reference::resting(self.agent.start));
        }
        flies && self.tracker.error_m() < HOVERING.0 && self.speed_m_s() < HOVERING.1
    }

    /// While the clock runs: one tick along its itinerary. `step` has been flown by `phase`, 0 to 1; it takes `step_s`.
    pub fn fly(&mut self, now: Duration, step: u32, phase: f64, step_s: f64) {
        self.companion.tick(now);
        let Some(movement) = self.traveller.movement(step) else { return };
        let reference = self.reference(&movement, phase, step_s);
        self.steer(now, &reference);
    }

    fn reference(&self, movement: &Move, phase: f64, step_s: f64) -> Reference {
        let lattice = self.traveller.roads().lattice();
        Reference {
            position: lattice.point(&movement.place(phase)),
            velocity: movement.speed(phase) * (lattice.cell_m() / step_s),
        }
    }

    fn steer(&mut self, now: Duration, reference: &Reference) {
        let telemetry = self.companion.telemetry();
        let Some((position, velocity)) = telemetry.position.zip(telemetry.velocity) else { return };
        let velocity = self.tracker.follow(reference, &position.value, &velocity.value);
        let set_point = if self.level {
            SetPoint::Planar { vx: velocity.x, vy: velocity.y, z: self.agent.start.z, yaw: None }
        } else {
            SetPoint::Velocity { velocity, yaw: None }
        };
        self.companion.set_point(now, set_point);
    }

    fn is_up(&self) -> bool {
        let position = self.companion.telemetry().position;
        position.is_some_and(|position| (position.value.z - self.agent.start.z).abs() < 0.15)
    }

    fn speed_m_s(&self) -> f64 {
        self.companion.telemetry().velocity.map_or(f64::INFINITY, |velocity| velocity.value.norm())
    }

    /// Its record of limits and itinerary.
    pub fn tracker(&self) -> &Tracker {
        &self.tracker
    }
}
