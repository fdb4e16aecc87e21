//! Flight modes: the vehicle's task, the commands that change it, and the failsafes.

mod commands;
mod failsafes;
mod ground;
mod tasks;

use std::time::Duration;

use nalgebra::{Vector2, Vector3};
use skein_mav::{FlightMode, Landed, SetPoint, Severity, Stamped};

use super::Situation;
use super::mission::MissionFlight;
use super::parameters::FailsafeAction;
use super::position_control::Demand;

/// Within this of its height a climb is over, m.
const HEIGHT_REACHED_M: f64 = 0.25;

/// A pilot's sticks, each -1..1.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Sticks {
    pub(super) forward: f64,
    pub(super) left: f64,
    pub(super) up: f64,
    pub(super) turn_left: f64,
}

/// The vehicle's task, with all that it needs for it.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Task {
    Hold { position: Vector3<f64> },
    Takeoff { target: Vector3<f64> },
    Offboard,
    Land { over: Vector2<f64> },
    Return(ReturnLeg),
    Mission(MissionFlight),
    Manual,
}

impl Default for Task {
    fn default() -> Self {
        Self::Hold { position: Vector3::zeros() }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum ReturnLeg {
    Climb { over: Vector2<f64>, z: f64 },
    Home { z: f64 },
    Descend,
}

/// A failsafe that acts.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Failsafe {
    /// Holding until then, then the action.
    Holding { until: Duration, action: FailsafeAction },
    /// The action is under way.
    Acting,
}

/// Stages of the battery.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
enum Charge {
    #[default]
    Good,
    Low,
    Critical,
    Emergency,
}

/// The motors' task.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Drive {
    Stopped,
    /// Armed on the ground.
    Idle,
    /// Flying, or lifting off.
    Fly(Demand),
}

/// The state machine.
#[derive(Debug, Clone, Default)]
pub(super) struct Modes {
    task: Task,
    armed: bool,
    airborne: bool,
    home: Option<Vector3<f64>>,
    /// Where the return under way ends, ENU, m.
    returns_to: Vector2<f64>,
    failsafe: Option<Failsafe>,
    charge: Charge,
    outside_fence: bool,
    set_point: Option<Stamped<SetPoint>>,
    /// Time between the newest set-point and the one before.
    set_point_interval: Option<Duration>,
    sticks: Option<Stamped<Sticks>>,
    ground_distance: Option<Stamped<f64>>,
    /// Since when the legs have touched the ground.
    contact_since: Option<Duration>,
    /// Since when the vehicle has stood armed on the ground, and whether that followed a flight.
    standing: Option<(Duration, bool)>,
    /// Speed asked for by a station or the mission in place of the parameter, m/s.
    speed: Option<f64>,
    mission_item: usize,
    texts: Vec<(Severity, String)>,
    items_reached: Vec<usize>,
}

impl Modes {
    pub(super) fn mode(&self) -> FlightMode {
        match self.task {
            Task::Hold { .. } => FlightMode::Hold,
            Task::Takeoff { .. } => FlightMode::Takeoff,
            Task::Offboard => FlightMode::Offboard,
            Task::Land { .. } => FlightMode::Land,
            Task::Return(_) => FlightMode::Return,
            Task::Mission(_) => FlightMode::Mission,
            Task::Manual => FlightMode::Manual,
        }
    }

    pub(super) fn armed(&self) -> bool {
        self.armed
    }

    pub(super) fn failsafe(&self) -> bool {
        self.failsafe.is_some()
    }

    pub(super) fn home(&self) -> Option<Vector3<f64>> {
        self.home
    }

    pub(super) fn mission_item(&self) -> usize {
        self.mission_item
    }

    /// The speed that is flown in place of the parameter's, m/s.
    pub(super) fn speed(&self) -> Option<f64> {
        self.speed
    }

    pub(super) fn landed(&self) -> Landed {
        match (self.airborne, self.task) {
            (false, _) => Landed::OnGround,
            (true, Task::Takeoff { .. }) => Landed::TakingOff,
            (true, Task::Land { .. } | Task::Return(ReturnLeg::Descend)) => Landed::Landing,
            (true, _) => Landed::InAir,
        }
    }

    /// Takes the texts for the stations.
    pub(super) fn take_texts(&mut self) -> Vec<(Severity, String)> {
        std::mem::take(&mut self.texts)
    }

    /// Takes the mission items that have been reached.
    pub(super) fn take_items_reached(&mut self) -> Vec<usize> {
        std::mem::take(&mut self.items_reached)
    }

    /// In the air from the start, armed.
    pub(super) fn begin_in_air(&mut self, home: Vector3<f64>) {
        (self.armed, self.airborne, self.home) = (true, true, Some(home));
    }

    /// Holds the vehicle where it is, unless a station has asked for something else.
    pub(super) fn stay(&mut self, situation: &Situation<'_>) {
        if matches!(self.task, Task::Hold { .. }) {
            self.hold(situation);
        }
    }

    /// A set-point arrived.
    pub(super) fn on_set_point(&mut self, now: Duration, set_point: SetPoint) {
        let arrived = Stamped { stamp: now, value: set_point };
        let before = self.set_point.replace(arrived);
        self.set_point_interval = before.map(|before| before.age(now));
    }

    /// A pilot's sticks arrived.
    pub(super) fn on_sticks(&mut self, now: Duration, sticks: Sticks) {
        self.sticks = Some(Stamped { stamp: now, value: sticks });
    }

    /// The mission was replaced.
    pub(super) fn on_mission_changed(&mut self, situation: &Situation<'_>) {
        self.mission_item = 0;
        if matches!(self.task, Task::Mission(_)) {
            self.hold(situation);
        }
    }

    /// One step: failsafes, progress of the task, and what the motors are to do.
    pub(super) fn step(&mut self, situation: &Situation<'_>) -> Drive {
        self.sense_ground(situation);
        self.watch_battery(situation);
        if self.armed {
            self.watch_set_points(situation);
            self.watch_sticks(situation);
            self.watch_fence(situation);
            self.finish_hold_of_failsafe(situation);
        } else {
            self.rest(situation);
            return Drive::Stopped;
        }
        let demand = self.pursue(situation);
        self.judge_flight(situation, &demand);
        self.disarm_when_standing(situation);
        let lifts_off = demand.lifts_off(&situation.estimate.position);
        match (self.armed, self.airborne || lifts_off) {
            (false, _) => Drive::Stopped,
            (true, false) => Drive::Idle,
            (true, true) => Drive::Fly(demand),
        }
    }

    fn tell(&mut self, severity: Severity, text: impl Into<String>) {
        self.texts.push((severity, text.into()));
    }
}
