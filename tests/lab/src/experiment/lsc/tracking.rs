//! From an itinerary to velocity commands within their limits.
//!
//! A vehicle answers a velocity command late. All answer alike, so all are late together, and where they are relative
//! to one another is as planned. The tracker therefore corrects towards where the vehicle should be by now, late as
//! it is: the itinerary seen through a model of the answer, a dead time and then a damped oscillator of second order
//! on each axis.

use std::collections::VecDeque;

use nalgebra::Vector3;

/// The agents' tick, s.
const TICK_S: f64 = 0.02;
/// Ticks that go by before anything happens.
const DEAD_TICKS: usize = 2;
/// Natural frequency of the answer, rad/s. This and the damping were fitted to flights along random itineraries.
const FREQUENCY_RAD_S: f64 = 5.0;
/// Damping of the answer, 1 at the limit of overshoot.
const DAMPING: f64 = 0.6;
/// Steps of integration in a tick.
const SUBSTEPS: u8 = 10;
/// Rate at which a position error is flown off, 1/s.
const POSITION_GAIN: f64 = 3.0;
/// Share of a velocity error that the command takes up.
const VELOCITY_GAIN: f64 = 0.8;

/// The place where a vehicle is to be, and its velocity there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reference {
    /// World ENU, m.
    pub position: Vector3<f64>,
    /// World ENU, m/s.
    pub velocity: Vector3<f64>,
}

impl Reference {
    /// At a place, and nowhere else.
    pub fn resting(position: Vector3<f64>) -> Self {
        Self { position, velocity: Vector3::zeros() }
    }
}

/// A model of a vehicle's answer to commands.
#[derive(Debug, Clone)]
struct Answer {
    /// Positions of the itinerary that are still without effect, the oldest first.
    pending: VecDeque<Vector3<f64>>,
    position: Vector3<f64>,
    velocity: Vector3<f64>,
}

impl Answer {
    fn resting(position: Vector3<f64>) -> Self {
        Self { pending: vec![position; DEAD_TICKS].into(), position, velocity: Vector3::zeros() }
    }

    /// A tick later. What the velocity does after the commanded one, the position does after the itinerary's.
    fn advance(&mut self, position: Vector3<f64>) {
        self.pending.push_back(position);
        let told = self.pending.pop_front().unwrap_or(position);
        let step_s = TICK_S / f64::from(SUBSTEPS);
        for _ in 0..SUBSTEPS {
            let acceleration = (told - self.position) * (FREQUENCY_RAD_S * FREQUENCY_RAD_S)
                - self.velocity * (2.0 * DAMPING * FREQUENCY_RAD_S);
            self.velocity += acceleration * step_s;
            self.position += self.velocity * step_s;
        }
    }
}

/// Commands velocities, within limits on each axis.
#[derive(Debug, Clone)]
pub struct Tracker {
    max_speed_m_s: Vector3<f64>,
    max_accel_m_s2: Vector3<f64>,
    command: Vector3<f64>,
    expected: Answer,
    error_m: f64,
    greatest_speed_m_s: f64,
    greatest_accel_m_s2: f64,
}

impl Tracker {
    /// A tracker of a vehicle that rests at `start`.
    pub fn new(start: Vector3<f64>, max_speed_m_s: Vector3<f64>, max_accel_m_s2: Vector3<f64>) -> Self {
        Self {
            max_speed_m_s,
            max_accel_m_s2,
            command: Vector3::zeros(),
            expected: Answer::resting(start),
            error_m: f64::INFINITY,
            greatest_speed_m_s: 0.0,
            greatest_accel_m_s2: 0.0,
        }
    }

    /// The velocity to command in this tick, for a vehicle believed to be at `position` with `velocity`.
    pub fn follow(
        &mut self,
        reference: &Reference,
        position: &Vector3<f64>,
        velocity: &Vector3<f64>,
    ) -> Vector3<f64> {
        self.expected.advance(reference.position);
        let error = self.expected.position - position;
        self.error_m = error.xy().norm();
        let wish =
            reference.velocity + error * POSITION_GAIN + (self.expected.velocity - velocity) * VELOCITY_GAIN;
        let before = self.command;
        for axis in 0..3 {
            let (speed, change) = (self.max_speed_m_s[axis], self.max_accel_m_s2[axis] * TICK_S);
            let towards = before[axis] + (wish[axis] - before[axis]).clamp(-change, change);
            self.command[axis] = towards.clamp(-speed, speed);
        }
        self.greatest_speed_m_s = self.greatest_speed_m_s.max(self.command.amax());
        self.greatest_accel_m_s2 = self.greatest_accel_m_s2.max((self.command - before).amax() / TICK_S);
        self.command
    }

    /// Distance over ground from where the vehicle should be by now, m.
    pub fn error_m(&self) -> f64 {
        self.error_m
    }

    /// The place where the vehicle should be by now, world ENU, m.
    pub fn expected(&self) -> Vector3<f64> {
        self.expected.position
    }

    /// The greatest speed commanded on an axis, m/s.
    pub fn greatest_speed_m_s(&self) -> f64 {
        self.greatest_speed_m_s
    }

    /// The greatest change of a command on an axis, m/s^2.
    pub fn greatest_accel_m_s2(&self) -> f64 {
        self.greatest_accel_m_s2
    }
}
