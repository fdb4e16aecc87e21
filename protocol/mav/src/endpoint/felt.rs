//! The sum that an inertial unit has felt since it was told.

use std::time::Duration;

use nalgebra::Vector3;

use crate::frame::FrameWriter;
use crate::measured::Inertial;

/// The sums since it was told last.
#[derive(Debug, Clone, Default)]
pub(super) struct Felt {
    rate: Vector3<f64>,
    force: Vector3<f64>,
    samples: u32,
    newest_rate: Vector3<f64>,
}

impl Felt {
    pub(super) fn take_in(&mut self, inertial: &Inertial) {
        self.rate += inertial.rate;
        self.force += inertial.force;
        self.newest_rate = inertial.rate;
        self.samples += 1;
    }

    /// Angular rate by the newest sample, body FLU, rad/s.
    pub(super) fn newest_rate(&self) -> Vector3<f64> {
        self.newest_rate
    }

    /// Writes the mean, and begins anew.
    pub(super) fn write(&mut self, time: Duration, output: &mut FrameWriter) {
        if self.samples == 0 {
            return;
        }
        let count = f64::from(self.samples);
        let mean = Inertial { rate: self.rate / count, force: self.force / count };
        output.write(&mean.encode(time));
        (self.rate, self.force, self.samples) = (Vector3::zeros(), Vector3::zeros(), 0);
    }
}
