//! The seam between a vehicle's body and whatever flies it.

use std::time::Duration;

use nalgebra::Vector3;

use crate::autopilot::Autopilot;
use crate::quadrotor::{MotorCommands, Quadrotor};
use crate::sensors::SensorReadings;

/// An autopilot, as the world knows it: instruments in, motor commands out, MAVLink beside.
///
/// In every step of the world all pilots first [`sense`](Self::sense) and then [command](Self::commands), so that those
/// in processes of their own work at the same time.
pub trait Pilot: Send {
    /// Takes in the newest readings at `now`. `body` is the truth, for simulators of instruments that the readings
    /// lack.
    fn sense(&mut self, now: Duration, readings: &SensorReadings, body: &Quadrotor);

    /// The commands for the step that begins now.
    fn commands(&mut self) -> MotorCommands;

    /// Holds the vehicle in the air from the start, above `home` (ENU, m); until then it hangs still.
    fn begin_in_air(&mut self, _home: Vector3<f64>, _hangs_until: Duration) {}

    /// Takes in MAVLink from any station.
    fn receive(&mut self, _bytes: &[u8]) {}

    /// Takes the MAVLink that is for every station.
    fn take_output(&mut self) -> Vec<u8> {
        Vec::new()
    }
}

/// The built-in autopilot and what it commands in this step.
pub(crate) struct BuiltIn {
    autopilot: Box<Autopilot>,
    commands: MotorCommands,
}

impl BuiltIn {
    pub(crate) fn new(autopilot: Autopilot) -> Self {
        Self { autopilot: Box::new(autopilot), commands: MotorCommands::default() }
    }
}

impl Pilot for BuiltIn {
    fn sense(&mut self, now: Duration, readings: &SensorReadings, _: &Quadrotor) {
        self.commands = self.autopilot.step(now, readings);
    }

    fn commands(&mut self) -> MotorCommands {
        self.commands
    }

    fn begin_in_air(&mut self, home: Vector3<f64>, hangs_until: Duration) {
        self.autopilot.begin_in_air(home, hangs_until);
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.autopilot.receive(bytes);
    }

    fn take_output(&mut self) -> Vec<u8> {
        self.autopilot.take_output()
    }
}

/// The same commands always. Nobody hears MAVLink.
pub(crate) struct Fixed(pub(crate) MotorCommands);

impl Pilot for Fixed {
    fn sense(&mut self, _: Duration, _: &SensorReadings, _: &Quadrotor) {}

    fn commands(&mut self) -> MotorCommands {
        self.0
    }
}
