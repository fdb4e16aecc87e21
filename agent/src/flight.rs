//! Flight: carries out instructions on the autopilot, and reports what the vehicle then does.

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::{Command, CommandResult, Companion, FlightMode, Landed, MavEvent};

use crate::instruction::Instruction;
use crate::report::Report;

/// The command to land is repeated this often while the autopilot does something else.
const REPEAT_LAND: Duration = Duration::from_secs(2);
/// A vehicle that is to land goes to a better place for it for so long at most.
const SETTLES_FOR: Duration = Duration::from_secs(15);
/// Take-off is over this far below the height asked for.
const TAKEOFF_TOLERANCE_M: f64 = 0.3;

/// Where the vehicle is between two stands on the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlightPhase {
    /// On the ground, or not heard of yet.
    Grounded,
    /// The arm command is under way.
    Arming,
    /// The autopilot climbs to the take-off height.
    Climbing,
    /// Set-points flow; offboard mode is being asked for.
    Engaging {
        /// Since when set-points have been flowing.
        since: Duration,
        /// Whether offboard mode has been asked for.
        asked: bool,
    },
    /// The agent flies the vehicle.
    Flying,
    /// The agent flies the vehicle, which is to land, to where it can.
    Settling {
        /// It lands then, wherever it is.
        until: Duration,
    },
    /// The autopilot lands the vehicle.
    Landing,
    /// Somebody else flies the vehicle.
    Taken,
    /// In the air when the agent started; the autopilot holds it.
    Adopted,
}

/// The vehicle's flight as the agent conducts it.
#[derive(Debug)]
pub struct Flight {
    takeoff_height_m: f64,
    phase: FlightPhase,
    heard_of: bool,
    /// Whether the autopilot has shown, since the last command, that it is off the ground.
    left_ground: bool,
    /// When the command to land is repeated, if the autopilot does not land.
    land_again: Duration,
}

impl Flight {
    /// A vehicle on the ground that will climb to `takeoff_height_m` above home.
    #[must_use]
    pub fn new(takeoff_height_m: f64) -> Self {
        Self {
            takeoff_height_m,
            phase: FlightPhase::Grounded,
            heard_of: false,
            left_ground: false,
            land_again: Duration::ZERO,
        }
    }

    /// Takes off to this height above home from now on, m.
    pub fn climb_to(&mut self, takeoff_height_m: f64) {
        self.takeoff_height_m = takeoff_height_m;
    }

    /// Where the vehicle is between two stands on the ground.
    #[must_use]
    pub fn phase(&self) -> FlightPhase {
        self.phase
    }

    /// Whether set-points may leave the agent at all.
    #[must_use]
    pub fn sends_set_points(&self) -> bool {
        matches!(
            self.phase,
            FlightPhase::Engaging { .. } | FlightPhase::Flying | FlightPhase::Settling { .. }
        )
    }

    /// Whether the vehicle is on its way down.
    #[must_use]
    pub fn is_landing(&self) -> bool {
        matches!(self.phase, FlightPhase::Settling { .. } | FlightPhase::Landing)
    }

    /// Whether this agent has armed the vehicle, and it is not up yet.
    #[must_use]
    pub fn is_taking_off(&self) -> bool {
        matches!(self.phase, FlightPhase::Arming | FlightPhase::Climbing)
    }

    /// Whether this agent, and nobody else, has the vehicle off the ground or on its way.
    #[must_use]
    pub fn is_committed(&self) -> bool {
        !matches!(self.phase, FlightPhase::Grounded | FlightPhase::Taken)
    }

    /// Carries out one instruction, as far as it concerns the flight.
    pub fn carry_out(&mut self, now: Duration, instruction: Instruction, companion: &mut Companion) {
        match (instruction, self.phase) {
            (Instruction::TakeOff, FlightPhase::Grounded) => {
                self.phase = FlightPhase::Arming;
                self.left_ground = false;
                self.launch(now, None, companion);
            }
            // Where, is seen before the tick is over: see `touch_down`.
            (Instruction::Land, FlightPhase::Flying) => {
                self.phase = FlightPhase::Settling { until: now + SETTLES_FOR };
            }
            // Said again it changes nothing: to come down upon somebody is worse than some seconds more of an empty
            // battery.
            (Instruction::Land, FlightPhase::Grounded | FlightPhase::Settling { .. }) => {}
            (Instruction::Land, _) => self.touch_down(now, companion),
            (Instruction::Hold, FlightPhase::Adopted) => companion.command(now, Command::Hold),
            (Instruction::TakeBack, FlightPhase::Taken) | (Instruction::Resume, FlightPhase::Adopted) => {
                self.engage(now);
            }
            _ => {}
        }
    }

    /// Gives the command that follows `done` on the way from the ground to the climb, in the order of the autopilot.
    fn launch(&mut self, now: Duration, done: Option<Command>, companion: &mut Companion) {
        let commands = companion.dialect().launch(self.takeoff_height_m);
        let next = match done {
            None => commands.first(),
            Some(done) => commands.iter().skip_while(|command| **command != done).nth(1),
        };
        if let Some(next) = next {
            if matches!(next, Command::Takeoff { .. }) {
                self.phase = FlightPhase::Climbing;
            }
            companion.command(now, *next);
        }
    }

    /// Has the autopilot land the vehicle where it is.
    pub fn touch_down(&mut self, now: Duration, companion: &mut Companion) {
        self.phase = FlightPhase::Landing;
        self.land_again = now + REPEAT_LAND;
        companion.command(now, Command::Land);
    }

    /// The agent has not run for `pause`: if it flew the vehicle, it does not any more. Returns what the b-threads
    /// should hear of it.
    pub fn wake(&mut self, pause: Duration) -> Option<Report> {
        let flew = matches!(
            self.phase,
            FlightPhase::Arming
                | FlightPhase::Climbing
                | FlightPhase::Engaging { .. }
                | FlightPhase::Flying
                | FlightPhase::Settling { .. }
        );
        flew.then(|| {
            self.phase = FlightPhase::Taken;
            Report::Slept(pause)
        })
    }

    fn engage(&mut self, now: Duration) {
        self.phase = FlightPhase::Engaging { since: now, asked: false };
    }

    /// Hears what the autopilot reports; returns what the b-threads should hear of it.
    pub fn hear(&mut self, now: Duration, event: &MavEvent, companion: &mut Companion) -> Option<Report> {
        match event {
            MavEvent::CommandAcked { command, result: CommandResult::Accepted } => {
                if self.phase == FlightPhase::Arming {
                    self.launch(now, Some(*command), companion);
                }
                None
            }
            MavEvent::CommandAcked { command, result } => {
                self.command_failed(now, *command, &result.to_string())
            }
            MavEvent::CommandTimedOut { command } => self.command_failed(now, *command, "no answer"),
            MavEvent::ModeChanged { to, .. } if self.is_foreign(*to) => {
                // Control ends with the mode change itself; the b-threads hear of it afterwards.
                self.phase = FlightPhase::Taken;
                Some(Report::Pilot(*to))
            }
            _ => None,
        }
    }

    /// Whether a change to `mode` is none that this agent asked for.
    fn is_foreign(&self, mode: FlightMode) -> bool {
        match self.phase {
            FlightPhase::Flying | FlightPhase::Settling { .. } => mode != FlightMode::Offboard,
            FlightPhase::Engaging { .. } | FlightPhase::Climbing => {
                !matches!(mode, FlightMode::Offboard | FlightMode::Takeoff | FlightMode::Hold)
            }
            FlightPhase::Landing => {
                !matches!(mode, FlightMode::Land | FlightMode::Offboard | FlightMode::Hold)
            }
            FlightPhase::Adopted => mode != FlightMode::Hold,
            FlightPhase::Grounded | FlightPhase::Arming | FlightPhase::Taken => false,
        }
    }

    /// On the ground a refused command ends the flight; in the air it is tried again.
    fn command_failed(&mut self, now: Duration, command: Command, why: &str) -> Option<Report> {
        match self.phase {
            FlightPhase::Arming | FlightPhase::Climbing if !self.left_ground => {
                self.phase = FlightPhase::Grounded;
                Some(Report::CommandFailed(format!("{command:?}: {why}")))
            }
            FlightPhase::Engaging { .. } if command == Command::Offboard => {
                self.engage(now);
                None
            }
            _ => None,
        }
    }

    /// A vehicle that was in the air before its agent: held if nobody flies it, else left to who does.
    fn adopt(&mut self, mode: FlightMode) -> Report {
        if matches!(mode, FlightMode::Offboard | FlightMode::Hold) {
            self.phase = FlightPhase::Adopted;
            Report::FoundAirborne
        } else {
            self.leave_to_pilot(mode)
        }
    }

    fn leave_to_pilot(&mut self, mode: FlightMode) -> Report {
        self.phase = FlightPhase::Taken;
        Report::Pilot(mode)
    }

    /// Moves on to the next phase when the telemetry says so; returns what the b-threads should hear of it.
    /// `position` is the vehicle's, m ENU.
    pub fn follow(
        &mut self,
        now: Duration,
        position: Option<Vector3<f64>>,
        companion: &mut Companion,
    ) -> Option<Report> {
        let telemetry = companion.telemetry();
        let (landed, armed, mode) = (telemetry.landed, telemetry.armed, telemetry.mode);
        let height_m = position.zip(telemetry.home).map_or(0.0, |(position, home)| position.z - home.z);
        if self.phase == FlightPhase::Grounded && !matches!(landed, Landed::OnGround | Landed::Unknown) {
            // In the air before its agent, or by a pilot's hand.
            let found = !std::mem::replace(&mut self.heard_of, true);
            return Some(if found { self.adopt(mode) } else { self.leave_to_pilot(mode) });
        }
        self.heard_of |= landed != Landed::Unknown;
        self.left_ground |= !matches!(landed, Landed::OnGround | Landed::Unknown);
        match self.phase {
            FlightPhase::Climbing if height_m >= self.takeoff_height_m - TAKEOFF_TOLERANCE_M => {
                self.engage(now)
            }
            FlightPhase::Engaging { since, asked: false }
                if now >= since + companion.dialect().set_points_before_offboard() =>
            {
                companion.command(now, Command::Offboard);
                self.phase = FlightPhase::Engaging { since, asked: true };
            }
            FlightPhase::Engaging { asked: true, .. } if mode == FlightMode::Offboard => {
                self.phase = FlightPhase::Flying;
                return Some(Report::Airborne);
            }
            FlightPhase::Settling { .. }
            | FlightPhase::Landing
            | FlightPhase::Taken
            | FlightPhase::Flying
            | FlightPhase::Adopted
                if landed == Landed::OnGround && !armed =>
            {
                self.phase = FlightPhase::Grounded;
                return Some(Report::Landed);
            }
            FlightPhase::Landing if mode != FlightMode::Land && now >= self.land_again => {
                self.land_again = now + REPEAT_LAND;
                companion.command(now, Command::Land);
            }
            _ => {}
        }
        None
    }
}
