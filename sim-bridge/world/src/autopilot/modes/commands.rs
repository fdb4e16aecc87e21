//! Commands of stations, and the reasons to refuse them.

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::{AutopilotCommand, CommandResult, FlightMode, Severity};

use super::{HEIGHT_REACHED_M, Modes, Task};
use crate::autopilot::Situation;
use crate::autopilot::mission::MissionFlight;

/// Set-points must come at least this often for offboard to be entered (PX4: more than 2 Hz).
const OFFBOARD_ENTRY_INTERVAL: Duration = Duration::from_millis(500);

impl Modes {
    /// Whether an arm command would be accepted; if not, why.
    pub(in crate::autopilot) fn arming_check(&self, situation: &Situation<'_>) -> Result<(), &'static str> {
        situation.readiness?;
        if situation.readings.battery.fraction <= situation.settings.battery_critical {
            return Err("battery is critical");
        }
        if !situation.readings.contact {
            return Err("not on the ground");
        }
        Ok(())
    }

    /// A command arrived. An accepted change of mode ends whatever failsafe was acting: a station has taken
    /// over.
    pub(in crate::autopilot) fn command(
        &mut self,
        situation: &Situation<'_>,
        command: AutopilotCommand,
    ) -> CommandResult {
        let outcome = match command {
            AutopilotCommand::Arm { force } => self.arm(situation, force),
            AutopilotCommand::Disarm { force } => self.disarm_on_command(force),
            AutopilotCommand::Takeoff { z_m } => self.take_off(situation, z_m),
            AutopilotCommand::SetMode(mode) => self.set_mode(situation, mode),
            AutopilotCommand::GoTo { position } => self.go_to(situation, position),
            AutopilotCommand::SetSpeed { speed_m_s } => {
                self.speed = Some(speed_m_s);
                Ok(())
            }
            AutopilotCommand::SetHome { position } => {
                self.home = Some(position.unwrap_or(situation.estimate.position));
                Ok(())
            }
            AutopilotCommand::SetMissionItem(item) => self.set_mission_item(situation, item),
        };
        match outcome {
            Ok(()) => CommandResult::Accepted,
            Err((result, reason)) => {
                self.tell(Severity::Critical, reason);
                result
            }
        }
    }

    fn arm(&mut self, situation: &Situation<'_>, force: bool) -> Outcome {
        if self.armed {
            return Ok(());
        }
        if let Err(reason) = self.arming_check(situation)
            && !force
        {
            return refuse_for_now(format!("Arming denied: {reason}"));
        }
        self.armed = true;
        self.standing = Some((situation.now, false));
        self.home = Some(situation.estimate.position);
        self.tell(Severity::Info, "Armed");
        Ok(())
    }

    fn disarm_on_command(&mut self, force: bool) -> Outcome {
        if self.airborne && !force {
            return refuse_for_now("Disarming denied: not landed");
        }
        self.disarm("Disarmed by command");
        Ok(())
    }

    pub(super) fn disarm(&mut self, text: &str) {
        if self.armed {
            self.armed = false;
            self.airborne = false;
            self.standing = None;
            self.failsafe = None;
            // Whatever was under way must not begin anew by itself at the next arming.
            self.task = Task::default();
            self.tell(Severity::Info, text);
        }
    }

    fn take_off(&mut self, situation: &Situation<'_>, z_m: Option<f64>) -> Outcome {
        let position = situation.estimate.position;
        let home_z = self.home.map_or(position.z, |home| home.z);
        let z = z_m.unwrap_or(home_z + situation.settings.takeoff_height_m);
        if z < position.z + HEIGHT_REACHED_M && !self.airborne {
            return refuse_for_now("Takeoff denied: height is not above the vehicle");
        }
        self.begin(Task::Takeoff { target: Vector3::new(position.x, position.y, z) });
        Ok(())
    }

    fn set_mode(&mut self, situation: &Situation<'_>, mode: FlightMode) -> Outcome {
        match mode {
            FlightMode::Offboard => {
                let now = situation.now;
                let steady = self.set_point_interval.is_some_and(|it| it <= OFFBOARD_ENTRY_INTERVAL)
                    && self.set_point.is_some_and(|it| it.age(now) <= OFFBOARD_ENTRY_INTERVAL);
                if !steady {
                    return refuse_for_now("Offboard denied: no stream of set-points");
                }
                self.begin(Task::Offboard);
            }
            FlightMode::Takeoff => return self.take_off(situation, None),
            FlightMode::Hold => {
                self.failsafe = None;
                self.hold(situation);
            }
            FlightMode::Land => {
                self.failsafe = None;
                self.land(situation);
            }
            FlightMode::Return => {
                self.failsafe = None;
                self.fly_home(situation);
            }
            FlightMode::Mission => return self.start_mission(situation),
            FlightMode::Manual => self.begin(Task::Manual),
            FlightMode::Other(_) => return Err((CommandResult::Denied, "Unknown mode".to_owned())),
        }
        Ok(())
    }

    fn go_to(&mut self, situation: &Situation<'_>, position: Vector3<f64>) -> Outcome {
        if !self.airborne {
            return refuse_for_now("Reposition denied: not flying");
        }
        if situation.fence.is_left_at(&position) {
            return refuse_for_now("Reposition denied: off the fence");
        }
        self.begin(Task::Hold { position });
        Ok(())
    }

    fn set_mission_item(&mut self, situation: &Situation<'_>, item: u16) -> Outcome {
        let item = usize::from(item);
        if item >= situation.mission.len() {
            let text = format!("No mission item {item} of {}", situation.mission.len());
            return Err((CommandResult::Denied, text));
        }
        self.mission_item = item;
        if matches!(self.task, Task::Mission(_)) {
            return self.start_mission(situation);
        }
        Ok(())
    }

    fn start_mission(&mut self, situation: &Situation<'_>) -> Outcome {
        if situation.mission.is_empty() {
            return refuse_for_now("Mission denied: there is none");
        }
        let home_height_m = situation.datum.height_m + situation.home.z;
        let places = situation.mission.iter().map(|item| item.position(situation.datum, home_height_m));
        let leaves = |place: Option<Vector3<f64>>| place.is_some_and(|at| situation.fence.is_left_at(&at));
        if let Some(item) = places.map(leaves).position(|leaves| leaves) {
            return refuse_for_now(format!("Mission denied: item {item} is off the fence"));
        }
        let position = situation.estimate.position;
        let lift_off = (!self.airborne).then(|| {
            let z = position.z + situation.settings.takeoff_height_m;
            Vector3::new(position.x, position.y, z)
        });
        self.begin(Task::Mission(MissionFlight::new(self.mission_item, &position, lift_off)));
        Ok(())
    }
}

/// The result of a command that was not obeyed, and the text that says why.
type Outcome = Result<(), (CommandResult, String)>;

fn refuse_for_now(reason: impl Into<String>) -> Outcome {
    Err((CommandResult::TemporarilyRejected, reason.into()))
}
