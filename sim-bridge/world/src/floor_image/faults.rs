//! Faults of an image.

use nalgebra::{Isometry3, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

/// A patch of light that a floor throws back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glare {
    /// Its middle on the floor, world ENU, m.
    pub at: Vector3<f64>,
    /// Where it is 0.61 times as strong as in the middle, m.
    pub radius_m: f64,
    /// The light it adds in the middle, grey levels: with 255 nothing else is seen.
    pub strength: f64,
}

/// Faults of an image. The default is a perfect one.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageFaults {
    /// Exposure, s: what moves meanwhile is blurred.
    pub exposure_s: f64,
    /// Defocus: the width of a point, pixels.
    pub defocus_px: f64,
    /// Brightness beside a good exposure.
    pub brightness: f64,
    /// Noise of each pixel, standard deviation, grey levels.
    pub noise: f64,
    /// Patches of glare.
    pub glare: Vec<Glare>,
}

impl Default for ImageFaults {
    fn default() -> Self {
        Self { exposure_s: 0.0, defocus_px: 0.0, brightness: 1.0, noise: 0.0, glare: Vec::new() }
    }
}

impl ImageFaults {
    /// The pixels of the light that came through the lens.
    pub(super) fn develop(
        &self,
        rays: &[Option<Vector2<f64>>],
        camera_to_world: &Isometry3<f64>,
        light: Vec<f32>,
        seed: u64,
    ) -> Vec<u8> {
        let mut noise = ChaCha8Rng::seed_from_u64(seed);
        let (brightness, sigma) = (self.brightness as f32, self.noise as f32);
        let mut pixels = Vec::with_capacity(light.len());
        for (light, ray) in light.into_iter().zip(rays) {
            let Some(ray) = ray else {
                pixels.push(0);
                continue;
            };
            let mut level = light * brightness;
            for glare in &self.glare {
                level += glare.on(camera_to_world, ray);
            }
            if sigma > 0.0 {
                // The heads of 64 coins: nearly normal, 32 and a standard deviation of 4.
                level += sigma * (noise.next_u64().count_ones() as f32 - 32.0) / 4.0;
            }
            pixels.push((level + 0.5) as u8);
        }
        pixels
    }
}

impl Glare {
    /// Its addition to the pixel of a ray.
    fn on(&self, camera_to_world: &Isometry3<f64>, ray: &Vector2<f64>) -> f32 {
        let way = camera_to_world.rotation * Vector3::new(ray.x, ray.y, 1.0);
        let from = camera_to_world.translation.vector - self.at;
        let far = -from.z / way.z;
        if far.is_nan() || far <= 0.0 {
            return 0.0;
        }
        let off = (from.xy() + way.xy() * far).norm_squared();
        (self.strength * (-off / (2.0 * self.radius_m * self.radius_m)).exp()) as f32
    }
}
