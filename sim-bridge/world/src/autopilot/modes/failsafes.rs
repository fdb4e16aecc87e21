//! Failsafes: set-points, sticks or the battery are lost, or the fence is left.

use std::time::Duration;

use skein_mav::Severity;

use super::{Charge, Failsafe, Modes, Task};
use crate::autopilot::Situation;
use crate::autopilot::parameters::FailsafeAction;

/// After set-points are lost the vehicle holds this long before it does what is configured.
const HOLD_BEFORE_ACTION: Duration = Duration::from_secs(1);

impl Modes {
    pub(super) fn watch_set_points(&mut self, situation: &Situation<'_>) {
        let timeout = situation.settings.set_point_timeout;
        let lost = self.set_point.is_none_or(|it| it.age(situation.now) > timeout);
        if self.task == Task::Offboard && lost {
            self.fail(situation, situation.settings.set_point_loss_action, "Offboard set-points lost");
        }
    }

    pub(super) fn watch_sticks(&mut self, situation: &Situation<'_>) {
        let timeout = situation.settings.stick_timeout;
        let lost = self.sticks.is_some_and(|it| it.age(situation.now) > timeout);
        if self.task == Task::Manual && lost {
            self.sticks = None;
            self.fail(situation, situation.settings.stick_loss_action, "Manual control lost");
        }
    }

    pub(super) fn watch_battery(&mut self, situation: &Situation<'_>) {
        let settings = situation.settings;
        let fraction = situation.readings.battery.fraction;
        let charge = if fraction < settings.battery_emergency {
            Charge::Emergency
        } else if fraction < settings.battery_critical {
            Charge::Critical
        } else if fraction < settings.battery_low {
            Charge::Low
        } else {
            Charge::Good
        };
        // It only ever gets worse in flight; each stage is told, and acted on, once.
        if charge <= self.charge {
            return;
        }
        self.charge = charge;
        let action = match (charge, settings.battery_critical_action) {
            (Charge::Good | Charge::Low, _) => FailsafeAction::Warn,
            (Charge::Emergency, FailsafeAction::Return) => FailsafeAction::Land,
            (_, action) => action,
        };
        let text = match charge {
            Charge::Good | Charge::Low => "Battery is low",
            Charge::Critical => "Battery is critical",
            Charge::Emergency => "Battery is nearly empty",
        };
        if self.armed && action != FailsafeAction::Warn {
            self.act(situation, action, text);
        } else {
            self.tell(Severity::Warning, text);
        }
    }

    pub(super) fn watch_fence(&mut self, situation: &Situation<'_>) {
        let settings = situation.settings;
        let away = situation.estimate.position - situation.home;
        let beyond = |distance: f64, limit: f64| limit > 0.0 && distance > limit;
        let outside = beyond(away.xy().norm(), settings.fence_radius_m)
            || beyond(away.z, settings.fence_height_m)
            || situation.fence.is_left_at(&situation.estimate.position);
        let left = !std::mem::replace(&mut self.outside_fence, outside) && outside;
        if let Some(action) = settings.fence_action.filter(|_| left && self.airborne) {
            self.act(situation, action, "Geofence left");
        }
    }

    /// Something that commands the vehicle is lost: hold for a moment, then act.
    fn fail(&mut self, situation: &Situation<'_>, action: FailsafeAction, text: &str) {
        self.hold(situation);
        self.failsafe = Some(Failsafe::Holding { until: situation.now + HOLD_BEFORE_ACTION, action });
        self.tell(Severity::Critical, text);
    }

    pub(super) fn finish_hold_of_failsafe(&mut self, situation: &Situation<'_>) {
        if let Some(Failsafe::Holding { until, action }) = self.failsafe
            && situation.now >= until
        {
            self.act(situation, action, "Failsafe activated");
        }
    }

    fn act(&mut self, situation: &Situation<'_>, action: FailsafeAction, text: &str) {
        self.tell(Severity::Critical, text);
        match action {
            FailsafeAction::Warn => return,
            FailsafeAction::Hold => self.hold(situation),
            FailsafeAction::Return => self.fly_home(situation),
            FailsafeAction::Land => self.land(situation),
            FailsafeAction::Disarm => {
                self.disarm("Disarmed by failsafe");
                return;
            }
        }
        self.failsafe = Some(Failsafe::Acting);
    }
}
