//! Ground and air: when a flight begins, when it has ended, and when the motors stop by themselves.

use std::time::Duration;

use skein_mav::{Severity, Stamped};

use super::{Modes, Task};
use crate::autopilot::Situation;
use crate::autopilot::position_control::Demand;

/// Legs on the ground this long on the way down: landed.
const TOUCHDOWN_TIME: Duration = Duration::from_millis(250);

impl Modes {
    pub(super) fn sense_ground(&mut self, situation: &Situation<'_>) {
        if situation.readings.contact {
            self.contact_since.get_or_insert(situation.now);
        } else {
            self.contact_since = None;
        }
        if let Some(range) = situation.readings.rangefinder_down_m {
            self.ground_distance = Some(Stamped { stamp: situation.now, value: range });
        }
    }

    /// Disarmed: wait where we are for what comes. A mode chosen on the ground in advance is kept.
    pub(super) fn rest(&mut self, situation: &Situation<'_>) {
        self.airborne = false;
        match self.task {
            Task::Hold { .. } | Task::Land { .. } | Task::Return(_) => self.hold(situation),
            Task::Takeoff { .. } | Task::Offboard | Task::Mission(_) | Task::Manual => {}
        }
        if self.home.is_none() && situation.readiness.is_ok() {
            self.home = Some(situation.estimate.position);
        }
    }

    /// Flying begins when the legs leave the ground and ends when they have stood on it on the way down.
    pub(super) fn judge_flight(&mut self, situation: &Situation<'_>, demand: &Demand) {
        let touching = self.contact_since.map(|since| situation.now.saturating_sub(since));
        if touching.is_none() && !self.airborne {
            self.airborne = true;
            self.standing = None;
        }
        let down = demand.descends(&situation.estimate.position);
        if self.airborne && down && touching.is_some_and(|time| time >= TOUCHDOWN_TIME) {
            self.airborne = false;
            self.standing = Some((situation.now, true));
            self.tell(Severity::Info, "Landing detected");
        }
    }

    pub(super) fn disarm_when_standing(&mut self, situation: &Situation<'_>) {
        let Some((since, after_flight)) = self.standing else {
            return;
        };
        let landing = matches!(self.task, Task::Land { .. } | Task::Return(_));
        let patience = if after_flight || landing {
            situation.settings.disarm_after_landing
        } else {
            situation.settings.disarm_before_takeoff
        };
        if patience.is_some_and(|patience| situation.now.saturating_sub(since) >= patience) {
            let text = if after_flight { "Disarmed by landing" } else { "Disarmed: no take-off" };
            self.disarm(text);
        }
    }
}
