//! Flight: carries out instructions on the autopilot, and reports what the vehicle then does.

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::{Command, CommandResult, Companion, FlightMode, Landed, MavEvent, SetPoint, Telemetry};

use crate::instruction::Instruction;
use crate::report::Report;

/// The command to land is repeated this often while the autopilot does something else.
const REPEAT_LAND: Duration = Duration::from_secs(2);
/// A vehicle that is to land goes to a better place for it for so long at most.
const SETTLES_FOR: Duration = Duration::from_secs(15);
/// A command that brings the vehicle off the ground is given again after this long if it is rejected for now.
const LAUNCH_AGAIN: Duration = Duration::from_secs(1);
/// It is rejected for good once it has been rejected for so long.
const REJECTED_FOR: Duration = Duration::from_secs(10);
/// A failsafe that the autopilot wrote about so long before a change of mode is its reason.
const FAILSAFE_TOLD_WITHIN: Duration = Duration::from_secs(3);
/// Take-off is over this far below the height asked for.
const TAKEOFF_TOLERANCE_M: f64 = 0.3;

/// Where the vehicle is between two stands on the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlightPhase {
    /// On the ground, or not heard of yet.
    Grounded,
    /// Set-points flow, and the commands before the climb are under way.
    Arming,
    /// The last of them is given; the vehicle climbs to the take-off height.
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
    /// Where the vehicle stood before it took off, m ENU.
    stand: Option<Vector3<f64>>,
    /// A pilot flies the vehicle, and the agent as if it did.
    is_shadow: bool,
    phase: FlightPhase,
    heard_of: bool,
    /// Whether the autopilot has shown, since the last command, that it is off the ground.
    left_ground: bool,
    /// Whether its motors have run since.
    was_armed: bool,
    /// The launch command that waits until it is given, and when that is.
    next: Option<(Command, Duration)>,
    /// Since when a launch command has been rejected for now.
    rejected_since: Option<Duration>,
    /// When the command to land is repeated, if the autopilot does not land.
    land_again: Duration,
}

impl Flight {
    /// A vehicle on the ground that will climb to `takeoff_height_m` above home.
    #[must_use]
    pub fn new(takeoff_height_m: f64) -> Self {
        Self {
            takeoff_height_m,
            stand: None,
            is_shadow: false,
            phase: FlightPhase::Grounded,
            heard_of: false,
            left_ground: false,
            was_armed: false,
            next: None,
            rejected_since: None,
            land_again: Duration::ZERO,
        }
    }

    /// From now on a pilot flies, in whatever mode, and the agent as if it did: it follows the vehicle up and down.
    pub fn shadow(&mut self) {
        self.is_shadow = true;
    }

    /// Takes off to this height above home, m, and from where the vehicle stands, m ENU, from now on.
    pub fn climb_to(&mut self, takeoff_height_m: f64, stand: Option<Vector3<f64>>) {
        (self.takeoff_height_m, self.stand) = (takeoff_height_m, stand);
    }

    /// The frame of positions has moved by `shift`, m ENU.
    pub fn shift(&mut self, shift: &Vector3<f64>) {
        self.stand = self.stand.map(|stand| stand + shift);
    }

    /// The set-point by which the vehicle climbs, for an autopilot that set-points lift off. They flow from before it
    /// is armed: so the autopilot lands it if its agent dies, at whatever height.
    #[must_use]
    pub fn climb(&self, companion: &Companion) -> Option<SetPoint> {
        let lifts_by_command = |command: &Command| matches!(command, Command::Takeoff { .. });
        let launch = companion.dialect().launch(self.takeoff_height_m);
        let height_m = companion.telemetry().home?.z + self.takeoff_height_m;
        let place = self.stand.filter(|_| self.is_taking_off() && !launch.iter().any(lifts_by_command))?;
        Some(SetPoint::Position { position: place.xy().push(height_m), yaw: None })
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

    /// Whether what this agent has begun has not brought the vehicle off the ground yet.
    #[must_use]
    pub fn is_on_the_ground(&self) -> bool {
        self.phase == FlightPhase::Grounded || self.is_taking_off() && !self.left_ground
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
                (self.left_ground, self.was_armed, self.rejected_since) = (false, false, None);
                let dialect = companion.dialect();
                let first = dialect.launch(self.takeoff_height_m).into_iter().next();
                self.next = first.map(|command| (command, now + dialect.set_points_before_offboard()));
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

    /// Gives a command on the way from the ground to the climb.
    fn launch(&mut self, now: Duration, command: Command, companion: &mut Companion) {
        self.next = None;
        if companion.dialect().launch(self.takeoff_height_m).last() == Some(&command) {
            self.phase = FlightPhase::Climbing;
        }
        companion.command(now, command);
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
                self.rejected_since = None;
                let launch = companion.dialect().launch(self.takeoff_height_m);
                let following = launch.into_iter().skip_while(|given| given != command).nth(1);
                if let Some(following) = following.filter(|_| self.phase == FlightPhase::Arming) {
                    self.launch(now, following, companion);
                }
                None
            }
            MavEvent::CommandAcked { command, result } => {
                if self.may_be_given_again(now, *command, *result) {
                    return None;
                }
                self.command_failed(now, *command, &result.to_string(), companion)
            }
            MavEvent::CommandTimedOut { command } => {
                self.command_failed(now, *command, "no answer", companion)
            }
            MavEvent::ModeChanged { from, to } if self.is_foreign(*from, *to, companion) => {
                // Control ends with the mode change itself; the b-threads hear of it afterwards.
                self.phase = FlightPhase::Taken;
                Some(Report::Taken { mode: *to, by: changed_by(now, companion.telemetry()) })
            }
            _ => None,
        }
    }

    /// Whether this agent did not ask for a change of mode.
    fn is_foreign(&self, from: FlightMode, to: FlightMode, companion: &Companion) -> bool {
        let telemetry = companion.telemetry();
        match self.phase {
            _ if self.is_shadow => false,
            FlightPhase::Climbing | FlightPhase::Flying | FlightPhase::Settling { .. } => {
                to != FlightMode::Offboard
            }
            FlightPhase::Engaging { .. } => match to {
                FlightMode::Hold => from == FlightMode::Offboard,
                _ => to != FlightMode::Offboard,
            },
            // On the ground the autopilot leaves its landing by itself.
            FlightPhase::Landing if !telemetry.armed || telemetry.landed == Landed::OnGround => false,
            // Until it lands it may hold, for want of set-points.
            FlightPhase::Landing => {
                from == FlightMode::Land
                    || !matches!(to, FlightMode::Land | FlightMode::Offboard | FlightMode::Hold)
            }
            FlightPhase::Adopted => to != FlightMode::Hold,
            FlightPhase::Grounded | FlightPhase::Arming | FlightPhase::Taken => false,
        }
    }

    /// Whether a command on the ground was rejected as one may be that is accepted soon.
    fn may_be_given_again(&mut self, now: Duration, command: Command, result: CommandResult) -> bool {
        let is_for_now = matches!(result, CommandResult::TemporarilyRejected | CommandResult::Failed);
        if !(self.is_taking_off() && !self.left_ground && is_for_now) {
            return false;
        }
        self.next = Some((command, now + LAUNCH_AGAIN));
        now < *self.rejected_since.get_or_insert(now) + REJECTED_FOR
    }

    /// On the ground a refused command ends the flight, and the motors stop; in the air it is tried again.
    fn command_failed(
        &mut self,
        now: Duration,
        command: Command,
        why: &str,
        companion: &mut Companion,
    ) -> Option<Report> {
        match self.phase {
            FlightPhase::Arming | FlightPhase::Climbing if !self.left_ground => {
                Some(self.stay_down(now, format!("{command:?}: {why}"), companion))
            }
            FlightPhase::Engaging { .. } if command == Command::Offboard => {
                self.engage(now);
                None
            }
            _ => None,
        }
    }

    /// Calls off what has not brought the vehicle off the ground yet.
    pub fn call_off(&mut self, now: Duration, why: &str, companion: &mut Companion) -> Option<Report> {
        let is_under_way = self.is_taking_off() && !self.left_ground;
        is_under_way.then(|| self.stay_down(now, why.to_owned(), companion))
    }

    fn stay_down(&mut self, now: Duration, why: String, companion: &mut Companion) -> Report {
        self.phase = FlightPhase::Grounded;
        self.next = None;
        if companion.telemetry().armed {
            companion.command(now, Command::Disarm);
        }
        Report::CommandFailed(why)
    }

    /// Does not carry out an instruction that has come too late; gives what the mission should hear, which
    /// takes it for carried out.
    pub fn decline(&mut self, instruction: Instruction, mode: FlightMode) -> Option<Report> {
        match (instruction, self.phase) {
            (Instruction::TakeOff, FlightPhase::Grounded) => {
                Some(Report::CommandFailed("the decision to take off has come too late".to_owned()))
            }
            (Instruction::TakeBack, FlightPhase::Taken) => {
                Some(self.leave_to(mode, "its agent: it was given back too late".to_owned()))
            }
            (Instruction::Resume, FlightPhase::Adopted) => Some(Report::FoundAirborne),
            _ => None,
        }
    }

    /// A vehicle that was in the air before its agent: held if nobody flies it, else left to who does.
    fn adopt(&mut self, mode: FlightMode) -> Report {
        if matches!(mode, FlightMode::Offboard | FlightMode::Hold) {
            self.phase = FlightPhase::Adopted;
            Report::FoundAirborne
        } else {
            self.leave_to(mode, "pilot".to_owned())
        }
    }

    fn leave_to(&mut self, mode: FlightMode, by: String) -> Report {
        self.phase = FlightPhase::Taken;
        Report::Taken { mode, by }
    }

    /// A station on the autopilot's line has given this order: the vehicle is its, if this agent flew it.
    pub fn yield_to_station(&mut self, order: &str, mode: FlightMode) -> Option<Report> {
        (self.is_committed() && !self.is_shadow).then(|| self.leave_to(mode, format!("station: {order}")))
    }

    /// Moves on to the next phase when the telemetry says so; returns what the b-threads should hear of it.
    /// `position` is the vehicle's, m ENU; `is_ready` tells whether it passes the checks before take-off.
    pub fn follow(
        &mut self,
        now: Duration,
        position: Option<Vector3<f64>>,
        is_ready: bool,
        companion: &mut Companion,
    ) -> Option<Report> {
        let telemetry = companion.telemetry();
        let (landed, armed, mode) = (telemetry.landed, telemetry.armed, telemetry.mode);
        let height_m = position.zip(telemetry.home).map_or(0.0, |(position, home)| position.z - home.z);
        // Whether it is in the air may be told before the first heartbeat, which tells who flies it.
        if !telemetry.connected {
            return None;
        }
        if self.phase == FlightPhase::Grounded && !matches!(landed, Landed::OnGround | Landed::Unknown) {
            // In the air before its agent, or by a pilot's hand.
            let found = !std::mem::replace(&mut self.heard_of, true);
            return Some(if found {
                self.adopt(mode)
            } else {
                self.leave_to(mode, changed_by(now, telemetry))
            });
        }
        self.heard_of |= landed != Landed::Unknown;
        self.left_ground |= !matches!(landed, Landed::OnGround | Landed::Unknown);
        let stopped = std::mem::replace(&mut self.was_armed, armed) && !armed;
        match self.phase {
            FlightPhase::Arming | FlightPhase::Climbing
                if let Some((command, at)) = self.next
                    && now >= at =>
            {
                if !is_ready {
                    return self.command_failed(now, command, "not ready any more", companion);
                }
                self.launch(now, command, companion);
            }
            FlightPhase::Climbing if stopped && !self.left_ground => {
                return self.command_failed(
                    now,
                    Command::Arm,
                    "disarmed again before it left the ground",
                    companion,
                );
            }
            FlightPhase::Climbing if height_m >= self.takeoff_height_m - TAKEOFF_TOLERANCE_M => {
                self.phase = FlightPhase::Flying;
                return Some(Report::Airborne);
            }
            FlightPhase::Engaging { since, asked: false }
                if now >= since + companion.dialect().set_points_before_offboard() =>
            {
                companion.command(now, Command::Offboard);
                self.phase = FlightPhase::Engaging { since, asked: true };
            }
            FlightPhase::Engaging { asked: true, .. } if self.is_shadow || mode == FlightMode::Offboard => {
                self.phase = FlightPhase::Flying;
                return Some(Report::Airborne);
            }
            FlightPhase::Climbing
            | FlightPhase::Settling { .. }
            | FlightPhase::Landing
            | FlightPhase::Taken
            | FlightPhase::Flying
            | FlightPhase::Adopted
                if landed == Landed::OnGround
                    && !armed
                    && (self.left_ground || self.phase != FlightPhase::Climbing) =>
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

/// The one that has changed the flight mode just now, if not this agent: the autopilot, as far as it tells of a
/// failsafe.
fn changed_by(now: Duration, telemetry: &Telemetry) -> String {
    match telemetry.failsafe_text(now, FAILSAFE_TOLD_WITHIN) {
        Some(text) => format!("autopilot: {text}"),
        None if telemetry.failsafe => "autopilot: a failsafe".to_owned(),
        None => "pilot".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use skein_mav::messages::{
        COMMAND_ACK_DATA, EXTENDED_SYS_STATE_DATA, HEARTBEAT_DATA, HOME_POSITION_DATA, MavAutopilot, MavCmd,
        MavLandedState, MavMessage, MavModeFlag, MavResult, STATUSTEXT_DATA,
    };
    use skein_mav::{Address, CompanionConfig, Datum, FrameReader, FrameWriter};

    use super::*;

    const HOLD: u32 = 4 << 16 | 3 << 24;
    const LAND: u32 = 4 << 16 | 6 << 24;
    const OFFBOARD: u32 = 6 << 16;
    const GUIDED: u32 = 4;

    fn taken(by: &str) -> Report {
        Report::Taken { mode: FlightMode::Hold, by: by.to_owned() }
    }

    /// A flight on a PX4 that does what a test says.
    struct Stand {
        flight: Flight,
        companion: Companion,
        autopilot: FrameWriter,
        reader: FrameReader,
        now: Duration,
        height_m: f64,
        make: MavAutopilot,
        is_ready: bool,
        reports: Vec<Report>,
    }

    impl Stand {
        fn new() -> Self {
            let datum = Datum::from_degrees(47.4, 8.5, 0.0);
            let mut stand = Self {
                flight: Flight::new(3.0),
                companion: Companion::new(CompanionConfig::new(1, datum)),
                autopilot: FrameWriter::new(Address::autopilot(1)),
                reader: FrameReader::default(),
                now: Duration::ZERO,
                height_m: 0.0,
                make: MavAutopilot::MAV_AUTOPILOT_PX4,
                is_ready: true,
                reports: Vec::new(),
            };
            let place = datum.place();
            stand.autopilot.write(&HOME_POSITION_DATA {
                latitude: place.latitude_e7(),
                longitude: place.longitude_e7(),
                ..Default::default()
            });
            stand.is(MavLandedState::MAV_LANDED_STATE_ON_GROUND);
            stand.beats(HOLD, false);
            stand
        }

        fn autopilot_is_ardupilot(&mut self) {
            self.make = MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA;
            self.beats(GUIDED, false);
        }

        fn is(&mut self, landed_state: MavLandedState) {
            self.autopilot.write(&EXTENDED_SYS_STATE_DATA { landed_state, ..Default::default() });
        }

        fn beats(&mut self, custom_mode: u32, armed: bool) {
            let armed = if armed { MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED } else { MavModeFlag::empty() };
            self.autopilot.write(&HEARTBEAT_DATA {
                custom_mode,
                autopilot: self.make,
                base_mode: armed,
                ..Default::default()
            });
            self.goes_on(0);
        }

        fn acks(&mut self, command: MavCmd, result: MavResult) -> Vec<(MavCmd, f32)> {
            let (target_system, target_component) = (1, 191);
            self.autopilot.write(&COMMAND_ACK_DATA {
                command,
                result,
                target_system,
                target_component,
                ..Default::default()
            });
            self.goes_on(0)
        }

        /// Some time passes in which the autopilot says nothing new; returns the commands given meanwhile.
        fn goes_on(&mut self, ms: u64) -> Vec<(MavCmd, f32)> {
            self.now += Duration::from_millis(ms);
            self.companion.receive(self.now, &self.autopilot.take());
            while let Some(event) = self.companion.poll_event() {
                self.reports.extend(self.flight.hear(self.now, &event, &mut self.companion));
            }
            let position = Some(Vector3::z() * self.height_m);
            self.reports.extend(self.flight.follow(self.now, position, self.is_ready, &mut self.companion));
            self.reader.push(&self.companion.take_output());
            std::iter::from_fn(|| self.reader.next_frame())
                .filter_map(|frame| match frame.message {
                    MavMessage::COMMAND_LONG(command) => Some((command.command, command.param1)),
                    _ => None,
                })
                .collect()
        }

        /// Is told to take off; returns what it asks for once set-points have flown long enough.
        fn is_told_to_take_off(&mut self) -> Vec<(MavCmd, f32)> {
            self.flight.carry_out(self.now, Instruction::TakeOff, &mut self.companion);
            self.goes_on(300)
        }

        fn takes_off(&mut self) {
            self.is_told_to_take_off();
            self.acks(MavCmd::MAV_CMD_DO_SET_MODE, MavResult::MAV_RESULT_ACCEPTED);
            self.acks(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, MavResult::MAV_RESULT_ACCEPTED);
            self.beats(OFFBOARD, true);
            self.is(MavLandedState::MAV_LANDED_STATE_IN_AIR);
        }

        fn lands(&mut self) {
            self.height_m = 3.0;
            self.is(MavLandedState::MAV_LANDED_STATE_IN_AIR);
            self.beats(OFFBOARD, true);
            assert_eq!(self.reports.drain(..).collect::<Vec<_>>(), [Report::Airborne]);
            self.flight.touch_down(self.now, &mut self.companion);
        }
    }

    #[test]
    fn an_arm_command_that_is_rejected_for_now_is_given_again_for_ten_seconds() {
        let mut stand = Stand::new();
        let (arm, mode) = (MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, MavCmd::MAV_CMD_DO_SET_MODE);
        assert_eq!(stand.is_told_to_take_off(), [(mode, 1.0)]);
        assert_eq!(stand.acks(mode, MavResult::MAV_RESULT_ACCEPTED), [(arm, 1.0)]);
        for second in 0..10 {
            stand.acks(arm, MavResult::MAV_RESULT_TEMPORARILY_REJECTED);
            assert_eq!(stand.goes_on(1000), [(arm, 1.0)], "at {second} s");
            assert_eq!(stand.reports, []);
        }
        stand.acks(arm, MavResult::MAV_RESULT_TEMPORARILY_REJECTED);
        assert!(
            matches!(&stand.reports[..], [Report::CommandFailed(why)] if why.starts_with("Arm: rejected"))
        );
        assert_eq!(stand.goes_on(5000), []);
        // Nor is it given to a vehicle that is not ready any more.
        stand.is_told_to_take_off();
        stand.acks(mode, MavResult::MAV_RESULT_TEMPORARILY_REJECTED);
        stand.is_ready = false;
        assert_eq!((stand.goes_on(1000), stand.flight.phase()), (vec![], FlightPhase::Grounded));
        stand.is_ready = true;
        // Once accepted, it climbs.
        stand.is_told_to_take_off();
        stand.acks(mode, MavResult::MAV_RESULT_ACCEPTED);
        stand.acks(arm, MavResult::MAV_RESULT_TEMPORARILY_REJECTED);
        stand.goes_on(1000);
        stand.acks(arm, MavResult::MAV_RESULT_ACCEPTED);
        assert_eq!(stand.flight.phase(), FlightPhase::Climbing);
        assert_eq!(stand.goes_on(3000), []);
    }

    #[test]
    fn a_vehicle_whose_take_off_is_denied_is_disarmed() {
        let mut stand = Stand::new();
        stand.autopilot_is_ardupilot();
        stand.is_told_to_take_off();
        stand.acks(MavCmd::MAV_CMD_DO_SET_MODE, MavResult::MAV_RESULT_ACCEPTED);
        stand.acks(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, MavResult::MAV_RESULT_ACCEPTED);
        stand.beats(GUIDED, true);
        let disarm = (MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, 0.0);
        assert_eq!(stand.acks(MavCmd::MAV_CMD_NAV_TAKEOFF, MavResult::MAV_RESULT_DENIED), [disarm]);
        assert!(matches!(&stand.reports[..], [Report::CommandFailed(_)]));
        assert_eq!(stand.flight.phase(), FlightPhase::Grounded);
    }

    #[test]
    fn set_points_lift_a_px4_off_from_before_it_is_armed_and_no_ardupilot() {
        let mut stand = Stand::new();
        stand.flight.climb_to(3.0, Some(Vector3::new(4.0, 5.0, 0.1)));
        assert_eq!(stand.flight.climb(&stand.companion), None);
        stand.flight.carry_out(stand.now, Instruction::TakeOff, &mut stand.companion);
        stand.flight.shift(&Vector3::new(1.0, 0.0, 0.5));
        let position = Vector3::new(5.0, 5.0, 3.0);
        let climb = Some(SetPoint::Position { position, yaw: None });
        assert_eq!(stand.flight.climb(&stand.companion), climb);
        stand.takes_off();
        assert_eq!(
            (stand.flight.phase(), stand.flight.climb(&stand.companion)),
            (FlightPhase::Climbing, climb)
        );
        stand.height_m = 2.8;
        stand.goes_on(20);
        assert_eq!(
            (stand.flight.climb(&stand.companion), &stand.reports[..]),
            (None, &[Report::Airborne][..])
        );

        let mut stand = Stand::new();
        stand.autopilot_is_ardupilot();
        stand.flight.climb_to(3.0, Some(Vector3::zeros()));
        stand.is_told_to_take_off();
        assert_eq!((stand.flight.phase(), stand.flight.climb(&stand.companion)), (FlightPhase::Arming, None));
    }

    #[test]
    fn a_vehicle_that_disarms_itself_before_it_has_left_the_ground_has_failed_to_take_off() {
        let mut stand = Stand::new();
        stand.is_told_to_take_off();
        stand.acks(MavCmd::MAV_CMD_DO_SET_MODE, MavResult::MAV_RESULT_ACCEPTED);
        stand.acks(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, MavResult::MAV_RESULT_ACCEPTED);
        stand.beats(OFFBOARD, true);
        stand.beats(OFFBOARD, false);
        assert!(matches!(&stand.reports[..], [Report::CommandFailed(why)] if why.contains("disarmed")));
        assert_eq!(stand.flight.phase(), FlightPhase::Grounded);
    }

    #[test]
    fn a_pilots_hold_wins_in_the_climb_and_in_the_landing() {
        let mut stand = Stand::new();
        stand.takes_off();
        stand.height_m = 1.0;
        stand.beats(HOLD, true);
        assert_eq!(stand.reports, [taken("pilot")]);
        assert_eq!(stand.flight.phase(), FlightPhase::Taken);

        let mut stand = Stand::new();
        stand.takes_off();
        stand.lands();
        stand.beats(LAND, true);
        assert_eq!(stand.reports, []);
        stand.beats(HOLD, true);
        assert_eq!(stand.reports, [taken("pilot")]);
        assert_eq!(stand.goes_on(3000), [], "landing does not take it back");
    }

    #[test]
    fn an_autopilot_that_has_landed_leaves_that_mode_by_itself() {
        let mut stand = Stand::new();
        stand.takes_off();
        stand.lands();
        stand.beats(LAND, true);
        stand.is(MavLandedState::MAV_LANDED_STATE_ON_GROUND);
        stand.beats(HOLD, false);
        assert_eq!(stand.reports, [Report::Landed]);
    }

    #[test]
    fn a_failsafe_of_the_autopilot_is_no_pilot_and_a_stations_order_neither() {
        let mut stand = Stand::new();
        stand.takes_off();
        let text = "Low battery, failsafe: hold".into();
        stand.autopilot.write(&STATUSTEXT_DATA { text, ..Default::default() });
        stand.beats(HOLD, true);
        assert_eq!(stand.reports, [taken("autopilot: Low battery, failsafe: hold")]);

        let mut stand = Stand::new();
        stand.takes_off();
        let order = stand.flight.yield_to_station("DO_REPOSITION", FlightMode::Hold);
        assert_eq!(order, Some(taken("station: DO_REPOSITION")));
        assert_eq!(stand.flight.yield_to_station("DO_REPOSITION", FlightMode::Hold), None, "it has it");
    }

    #[test]
    fn a_shadow_follows_a_pilot_up_and_down_and_tells_the_autopilot_nothing() {
        let mut stand = Stand::new();
        stand.companion.only_listen();
        stand.flight.shadow();
        stand.is_told_to_take_off();
        assert_eq!(stand.goes_on(60_000), [], "until the pilot takes off");
        assert_eq!(stand.flight.phase(), FlightPhase::Climbing);
        const POSCTL: u32 = 3 << 16;
        stand.beats(POSCTL, true);
        stand.is(MavLandedState::MAV_LANDED_STATE_IN_AIR);
        stand.height_m = 3.0;
        assert_eq!([20, 500, 20].map(|ms| stand.goes_on(ms)).concat(), []);
        assert_eq!(
            (stand.flight.phase(), &stand.reports[..]),
            (FlightPhase::Flying, &[Report::Airborne][..])
        );
        stand.flight.touch_down(stand.now, &mut stand.companion);
        assert_eq!(stand.goes_on(5000), []);
        stand.is(MavLandedState::MAV_LANDED_STATE_ON_GROUND);
        stand.beats(POSCTL, false);
        assert_eq!(stand.reports.last(), Some(&Report::Landed));
    }

    #[test]
    fn the_hold_before_a_landing_is_no_pilots() {
        let mut stand = Stand::new();
        stand.takes_off();
        stand.lands();
        stand.beats(HOLD, true);
        assert_eq!(stand.flight.phase(), FlightPhase::Landing);
        assert_eq!(stand.goes_on(2000), [(MavCmd::MAV_CMD_DO_SET_MODE, 1.0)], "and it is told again");
        assert_eq!(stand.reports, []);
    }

    #[test]
    fn whoever_is_in_the_air_before_its_first_heartbeat_is_left_until_it_says_who_flies_it() {
        let mut stand = Stand::new();
        stand.companion = Companion::new(CompanionConfig::new(1, Datum::from_degrees(47.4, 8.5, 0.0)));
        stand.flight = Flight::new(3.0);
        stand.is(MavLandedState::MAV_LANDED_STATE_IN_AIR);
        stand.goes_on(0);
        assert_eq!(stand.reports, []);
        stand.beats(OFFBOARD, true);
        assert_eq!(stand.reports, [Report::FoundAirborne]);
    }
}
