//! The flight modes' demands.

use std::time::Duration;

use nalgebra::{Vector2, Vector3};
use skein_mav::{SetPoint, Severity};

use super::{HEIGHT_REACHED_M, Modes, ReturnLeg, Task};
use crate::autopilot::Situation;
use crate::autopilot::mission::{MissionFlight, MissionStep, straight_up, towards};
use crate::autopilot::position_control::{Demand, Horizontal, Vertical, stopping_way};

/// Within this of home a return lands straight away, m.
const AT_HOME_M: f64 = 1.0;
/// Above this over ground a descent is as fast as allowed, m.
const SLOW_DESCENT_BELOW_M: f64 = 3.0;
/// A range to the ground older than this is not used.
const RANGE_TIMEOUT: Duration = Duration::from_millis(500);
/// A full stick turns the nose this far ahead of where it is, rad.
const STICK_YAW_LEAD: f64 = 0.4;

impl Modes {
    /// Begins a task that a station asked for.
    pub(super) fn begin(&mut self, task: Task) {
        self.failsafe = None;
        self.task = task;
    }

    pub(super) fn hold(&mut self, situation: &Situation<'_>) {
        let estimate = situation.estimate;
        let way = if self.airborne {
            stopping_way(&estimate.velocity, situation.settings)
        } else {
            Vector3::zeros()
        };
        self.task = Task::Hold { position: estimate.position + way };
    }

    pub(super) fn land(&mut self, situation: &Situation<'_>) {
        let estimate = situation.estimate;
        let way = stopping_way(&estimate.velocity, situation.settings);
        self.task = Task::Land { over: (estimate.position + way).xy() };
    }

    pub(super) fn fly_home(&mut self, situation: &Situation<'_>) {
        if !self.airborne {
            self.land(situation);
            return;
        }
        let position = situation.estimate.position;
        let away_m = |place: &Vector2<f64>| (position.xy() - place).norm();
        let places = situation.rally.iter().copied().chain([situation.home.xy()]);
        let end = places.min_by(|a, b| away_m(a).total_cmp(&away_m(b))).unwrap_or(position.xy());
        self.returns_to = end;
        let leg = if away_m(&end) < AT_HOME_M {
            ReturnLeg::Descend
        } else {
            let way = stopping_way(&situation.estimate.velocity, situation.settings);
            ReturnLeg::Climb {
                over: (position + way).xy(),
                z: position.z.max(situation.home.z + situation.settings.return_height_m),
            }
        };
        self.task = Task::Return(leg);
    }

    pub(super) fn pursue(&mut self, situation: &Situation<'_>) -> Demand {
        match self.task {
            Task::Hold { position } => stay_at(&position, situation),
            Task::Takeoff { target } => self.climb(situation, &target),
            Task::Offboard => self.follow_set_point(situation),
            Task::Land { over } => self.descend(situation, over),
            Task::Return(leg) => self.return_home(situation, leg),
            Task::Mission(flight) => self.fly_mission(situation, flight),
            Task::Manual => self.follow_sticks(situation),
        }
    }

    fn climb(&mut self, situation: &Situation<'_>, target: &Vector3<f64>) -> Demand {
        if (target.z - situation.estimate.position.z).abs() < HEIGHT_REACHED_M && self.airborne {
            self.task = Task::Hold { position: *target };
            self.tell(Severity::Info, "Takeoff complete");
        }
        straight_up(target.xy(), target.z, situation)
    }

    fn follow_set_point(&self, situation: &Situation<'_>) -> Demand {
        let settings = situation.settings;
        let Some(set_point) = self.set_point else {
            return stay_at(&situation.estimate.position, situation);
        };
        let (horizontal, vertical) = match set_point.value {
            SetPoint::Velocity { velocity, .. } => {
                (Horizontal::Velocity(velocity.xy()), Vertical::Velocity(velocity.z))
            }
            SetPoint::Planar { vx, vy, z, .. } => {
                (Horizontal::Velocity(Vector2::new(vx, vy)), Vertical::Height(z, settings.max_climb_m_s))
            }
            SetPoint::Position { position, .. } => (
                Horizontal::Position(position.xy(), settings.max_speed_m_s),
                Vertical::Height(position.z, settings.max_climb_m_s),
            ),
        };
        Demand { horizontal, vertical, yaw: set_point.value.yaw() }
    }

    fn descend(&self, situation: &Situation<'_>, over: Vector2<f64>) -> Demand {
        let settings = situation.settings;
        let above_home = situation.estimate.position.z - situation.home.z;
        let height = self
            .ground_distance
            .filter(|range| range.age(situation.now) < RANGE_TIMEOUT)
            .map_or(above_home, |range| range.value);
        // From the fastest descent down to the landing speed over the last metres.
        let share = ((height - 1.0) / (SLOW_DESCENT_BELOW_M - 1.0)).clamp(0.0, 1.0);
        let slow = settings.landing_speed_m_s;
        let speed = slow + (settings.max_descent_m_s - slow).max(0.0) * share;
        Demand {
            horizontal: Horizontal::Position(over, settings.cruise_speed_m_s),
            vertical: Vertical::Velocity(-speed),
            yaw: None,
        }
    }

    fn return_home(&mut self, situation: &Situation<'_>, leg: ReturnLeg) -> Demand {
        let position = situation.estimate.position;
        match leg {
            ReturnLeg::Climb { over, z } => {
                if position.z > z - HEIGHT_REACHED_M {
                    self.task = Task::Return(ReturnLeg::Home { z });
                }
                stay_at(&Vector3::new(over.x, over.y, z), situation)
            }
            ReturnLeg::Home { z } => {
                if (position.xy() - self.returns_to).norm() < HEIGHT_REACHED_M {
                    self.task = Task::Return(ReturnLeg::Descend);
                }
                towards(&self.returns_to.push(z), situation)
            }
            ReturnLeg::Descend => self.descend(situation, self.returns_to),
        }
    }

    fn fly_mission(&mut self, situation: &Situation<'_>, mut flight: MissionFlight) -> Demand {
        // Each turn of the loop is one item further, so it ends.
        loop {
            let item = flight.item;
            let step = flight.step(situation.mission, situation);
            self.mission_item = flight.item;
            self.task = Task::Mission(flight);
            match step {
                MissionStep::Fly(demand) => return demand,
                MissionStep::ChangeSpeed(speed_m_s) => self.speed = Some(speed_m_s),
                MissionStep::Reached => self.items_reached.push(item),
                MissionStep::Land => {
                    self.mission_item = 0;
                    self.land(situation);
                    return self.pursue(situation);
                }
                MissionStep::Return => {
                    self.mission_item = 0;
                    self.fly_home(situation);
                    return self.pursue(situation);
                }
                MissionStep::Complete => {
                    self.mission_item = 0;
                    self.hold(situation);
                    self.tell(Severity::Info, "Mission complete");
                    return self.pursue(situation);
                }
            }
        }
    }

    /// Sticks as velocities along the nose; centred, or none, they keep the vehicle where it is.
    fn follow_sticks(&self, situation: &Situation<'_>) -> Demand {
        let settings = situation.settings;
        let sticks = self.sticks.map(|sticks| sticks.value).unwrap_or_default();
        let yaw = situation.estimate.yaw();
        let (sin, cos) = yaw.sin_cos();
        let (forward, left) = (sticks.forward, sticks.left);
        let wish = Vector2::new(forward * cos - left * sin, forward * sin + left * cos);
        let climb = if sticks.up > 0.0 { settings.max_climb_m_s } else { settings.max_descent_m_s };
        Demand {
            horizontal: Horizontal::Velocity(wish * settings.cruise_speed_m_s),
            vertical: Vertical::Velocity(sticks.up * climb),
            yaw: (sticks.turn_left != 0.0).then_some(yaw + sticks.turn_left * STICK_YAW_LEAD),
        }
    }
}

/// Flies to a place as it is turned now, and stays there.
fn stay_at(position: &Vector3<f64>, situation: &Situation<'_>) -> Demand {
    let settings = situation.settings;
    Demand {
        horizontal: Horizontal::Position(position.xy(), settings.cruise_speed_m_s),
        vertical: Vertical::Height(position.z, settings.max_climb_m_s),
        yaw: None,
    }
}
