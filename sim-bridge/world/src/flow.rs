//! An optical flow sensor that looks down, and takes the vehicle's own turning out by a gyroscope of its own.

use std::time::Duration;

use nalgebra::{Vector2, Vector3};
use skein_mav::Flow;

use crate::lidar::{Surroundings, cast_ray};
use crate::noise::Noise;
use crate::quadrotor::{Quadrotor, STEP};
use crate::vehicle::FlowModel;

/// The sum of one sensor since its last reading.
#[derive(Debug, Clone)]
pub(crate) struct FlowSensor {
    model: FlowModel,
    noise: Noise,
    /// By which share it tells too much.
    scale: f64,
    seen: Vector2<f64>,
    steps: u32,
}

impl FlowSensor {
    pub(crate) fn new(model: FlowModel, mut noise: Noise) -> Self {
        let scale = noise.normal(model.scale_sigma);
        Self { model, noise, scale, seen: Vector2::zeros(), steps: 0 }
    }

    pub(crate) fn rate_hz(&self) -> f64 {
        self.model.rate_hz
    }

    /// Looks for one step; the ground is `distance_m` away along the body's axis, if it is seen.
    fn look(&mut self, quadrotor: &Quadrotor, distance_m: Option<f64>) {
        let state = quadrotor.state();
        let velocity = state.attitude.inverse() * state.velocity;
        self.steps += 1;
        if let Some(distance_m) = distance_m {
            self.seen += velocity.xy() * ((1.0 + self.scale) / distance_m);
        }
    }

    /// One step; gives a reading when one is due. A sensor that is lost sees nothing.
    pub(crate) fn step(
        &mut self,
        is_due: bool,
        is_lost: bool,
        quadrotor: &Quadrotor,
        surroundings: &Surroundings<'_>,
    ) -> Option<Flow> {
        let state = quadrotor.state();
        let down = state.attitude * -Vector3::z();
        let distance_m = cast_ray(surroundings, &state.position.into(), &down, self.model.most_m)
            .filter(|distance_m| !is_lost && *distance_m >= self.model.least_m);
        self.look(quadrotor, distance_m);
        if !is_due {
            return None;
        }
        let noise = Vector2::new(1.0, 1.0).map(|_: f64| self.noise.normal(self.model.sigma_rad_s));
        let seen = std::mem::take(&mut self.seen) / f64::from(self.steps.max(1));
        let over = STEP * std::mem::take(&mut self.steps);
        let quality = if distance_m.is_some() { 1.0 } else { 0.0 };
        let over = over.max(Duration::from_millis(1));
        Some(Flow { rate: seen + noise, over, quality, distance_m: None })
    }
}
