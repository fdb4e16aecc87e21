//! Flying an uploaded mission, item by item.

use std::time::Duration;

use nalgebra::{Vector2, Vector3};
use skein_mav::messages::MavCmd;
use skein_mav::{Datum, MissionItem};

use super::Situation;
use super::position_control::{Demand, Horizontal, Vertical};

/// From this far off a place is flown to nose first, m.
const NOSE_FIRST_M: f64 = 2.0;

/// Whether an item can be flown; an upload with another one is refused.
pub(super) fn accepts(item: &MissionItem) -> bool {
    // Any datum will do: what matters is that there is a place, not where.
    let datum = Datum::from_degrees(0.0, 0.0, 0.0);
    match item.command {
        MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH => true,
        MavCmd::MAV_CMD_DO_CHANGE_SPEED => wished_speed(item).is_some(),
        MavCmd::MAV_CMD_NAV_TAKEOFF | MavCmd::MAV_CMD_NAV_LAND => item.z.is_finite(),
        MavCmd::MAV_CMD_NAV_WAYPOINT | MavCmd::MAV_CMD_NAV_LOITER_UNLIM | MavCmd::MAV_CMD_NAV_LOITER_TIME => {
            item.position(&datum, 0.0).is_some()
        }
        _ => false,
    }
}

/// The speed that a `MAV_CMD_DO_CHANGE_SPEED` asks for, m/s.
fn wished_speed(item: &MissionItem) -> Option<f64> {
    let [_, speed, ..] = item.params;
    (speed.is_finite() && speed > 0.0).then(|| f64::from(speed))
}

/// A mission's demand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum MissionStep {
    Fly(Demand),
    /// From now on fly this fast, m/s.
    ChangeSpeed(f64),
    /// The item has been reached; the next one is under way.
    Reached,
    Land,
    /// Fly home and land.
    Return,
    /// There is no further item.
    Complete,
}

/// A mission under way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MissionFlight {
    /// The item under way, counted from 0.
    pub(super) item: usize,
    /// The first climb of a mission that begins on the ground.
    lift_off: Option<Vector3<f64>>,
    /// When the place of the item was reached.
    arrived: Option<Duration>,
    /// The vehicle's place when the item began: a take-off climbs straight up from there, a landing comes at
    /// that height.
    begun_at: Vector3<f64>,
}

impl MissionFlight {
    /// Begins with an item; `lift_off` is where to climb to first.
    pub(super) fn new(item: usize, position: &Vector3<f64>, lift_off: Option<Vector3<f64>>) -> Self {
        Self { item, lift_off, arrived: None, begun_at: *position }
    }

    /// The demand now. After [`MissionStep::Reached`] and [`MissionStep::ChangeSpeed`] ask again.
    pub(super) fn step(&mut self, items: &[MissionItem], situation: &Situation<'_>) -> MissionStep {
        let position = &situation.estimate.position;
        if let Some(target) = self.lift_off {
            if position.z < target.z - situation.settings.waypoint_radius_m {
                return MissionStep::Fly(straight_up(target.xy(), target.z, situation));
            }
            self.lift_off = None;
        }
        let Some(item) = items.get(self.item) else {
            return MissionStep::Complete;
        };
        let home_height_m = situation.datum.height_m + situation.home.z;
        let place = item.position(situation.datum, home_height_m);
        match item.command {
            MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH => MissionStep::Return,
            MavCmd::MAV_CMD_DO_CHANGE_SPEED => {
                self.next(position);
                MissionStep::ChangeSpeed(wished_speed(item).unwrap_or(situation.settings.cruise_speed_m_s))
            }
            MavCmd::MAV_CMD_NAV_TAKEOFF => {
                let z = place.map_or(situation.home.z + f64::from(item.z), |place| place.z);
                let target = Vector3::new(self.begun_at.x, self.begun_at.y, z);
                self.reach(&target, Some(Duration::ZERO), situation)
                    .unwrap_or_else(|| MissionStep::Fly(straight_up(self.begun_at.xy(), z, situation)))
            }
            MavCmd::MAV_CMD_NAV_LAND => {
                let Some(place) = place else {
                    return MissionStep::Land;
                };
                if (place - position).xy().norm() < situation.settings.waypoint_radius_m {
                    return MissionStep::Land;
                }
                let overhead = Vector3::new(place.x, place.y, self.begun_at.z.max(place.z));
                MissionStep::Fly(towards(&overhead, situation))
            }
            _ => {
                let Some(place) = place else {
                    self.next(position);
                    return MissionStep::Reached;
                };
                let [hold_s, ..] = item.params;
                let hold_s = if hold_s.is_finite() { hold_s.clamp(0.0, 1e6) } else { 0.0 };
                let stay = (item.command != MavCmd::MAV_CMD_NAV_LOITER_UNLIM)
                    .then(|| Duration::from_secs_f32(hold_s));
                self.reach(&place, stay, situation)
                    .unwrap_or_else(|| MissionStep::Fly(towards(&place, situation)))
            }
        }
    }

    /// Begins the next item once the place has been reached and held for so long (`None`: for ever).
    fn reach(
        &mut self,
        place: &Vector3<f64>,
        stay: Option<Duration>,
        situation: &Situation<'_>,
    ) -> Option<MissionStep> {
        let position = &situation.estimate.position;
        if (place - position).norm() < situation.settings.waypoint_radius_m {
            self.arrived.get_or_insert(situation.now);
        }
        let stayed = situation.now.saturating_sub(self.arrived?);
        if stayed < stay? {
            return None;
        }
        self.next(position);
        Some(MissionStep::Reached)
    }

    fn next(&mut self, position: &Vector3<f64>) {
        self.item += 1;
        self.arrived = None;
        self.begun_at = *position;
    }
}

/// Flies to a place at cruising speed, nose first.
pub(super) fn towards(place: &Vector3<f64>, situation: &Situation<'_>) -> Demand {
    let settings = situation.settings;
    let way = place.xy() - situation.estimate.position.xy();
    Demand {
        horizontal: Horizontal::Position(place.xy(), settings.cruise_speed_m_s),
        vertical: Vertical::Height(place.z, settings.max_climb_m_s),
        yaw: (way.norm() > NOSE_FIRST_M).then(|| way.y.atan2(way.x)),
    }
}

/// Climbs on the spot.
pub(super) fn straight_up(over: Vector2<f64>, z: f64, situation: &Situation<'_>) -> Demand {
    Demand {
        horizontal: Horizontal::Position(over, situation.settings.cruise_speed_m_s),
        vertical: Vertical::Height(z, situation.settings.takeoff_speed_m_s),
        yaw: None,
    }
}
