//! Walkers: people who go from one place to another and look at no vehicle.

use nalgebra::{Vector2, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use serde::de::{Deserializer, Error, Unexpected};
use skein_world::{Obstacle, Scene, Stop, Way};

use super::field::{ground_point, positive};
use super::layout::uniform;
use super::placement::way_is_clear;

/// Places that a walker goes to, one after another: enough for longer than any flight.
const PLACES: usize = 400;
/// Draws of a place before the walker turns back.
const DRAWS: usize = 60;
/// From a walker's skin to what stands, m.
const ROOM_M: f64 = 0.3;
/// Walkers keep so far from where vehicles take off and land, m: nobody looks around on the way up and down.
const FROM_PADS_M: f64 = 3.0;
/// Shortest way between two places, m.
const SHORTEST_M: f64 = 3.0;
/// From the bounds to where walkers go, m, where no area is given.
const FROM_BOUNDS_M: f64 = 2.0;
/// The stream of the first walker, beyond those of the generators.
const STREAM: u64 = 1 << 16;

/// A `[[walker]]` table: so many people, each with places of its own from the seed.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Walker {
    pub number: usize,
    /// Least and greatest speed, m/s; drawn anew for each way.
    #[serde(deserialize_with = "speed_range")]
    pub speed_m_s: [f64; 2],
    #[serde(deserialize_with = "positive")]
    pub radius_m: f64,
    #[serde(deserialize_with = "positive")]
    pub height_m: f64,
    /// South-west and north-east corner of where they walk; 2 m inside the bounds if left out.
    #[serde(deserialize_with = "optional_corner")]
    pub min_m: Option<Vector3<f64>>,
    #[serde(deserialize_with = "optional_corner")]
    pub max_m: Option<Vector3<f64>>,
}

impl Default for Walker {
    fn default() -> Self {
        Self { number: 1, speed_m_s: [0.5, 1.5], radius_m: 0.25, height_m: 1.8, min_m: None, max_m: None }
    }
}

fn optional_corner<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vector3<f64>>, D::Error> {
    ground_point(deserializer).map(Some)
}

fn speed_range<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 2], D::Error> {
    let [least, most] = <[f64; 2]>::deserialize(deserializer)?;
    if least > 0.0 && least <= most && most.is_finite() {
        return Ok([least, most]);
    }
    let expected = "the least and the greatest speed, above 0 m/s";
    Err(D::Error::invalid_value(Unexpected::Float(least), &expected))
}

impl Walker {
    /// The people of this table, of whom the first has this number from 0 among all of the scenario. They go around
    /// what stands in the scene, and not near the `pads`.
    pub fn people(&self, first: usize, scene: &Scene, pads: &[Vector3<f64>], seed: u64) -> Vec<Obstacle> {
        let walk = |number: usize| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(STREAM + number as u64);
            let (from, stops) = Ground { table: self, scene, pads }.walk(&mut rng)?;
            let person = Obstacle::trunk(
                format!("walker {}", number + 1),
                from.x,
                from.y,
                self.radius_m,
                self.height_m,
            );
            Some(person.on(Way::through(from, &stops, false)))
        };
        (first..first + self.number).filter_map(walk).collect()
    }
}

/// Where people may walk.
struct Ground<'a> {
    table: &'a Walker,
    scene: &'a Scene,
    pads: &'a [Vector3<f64>],
}

impl Ground<'_> {
    /// A place to begin at and the places after it; `None` where there is no room for anybody.
    fn walk(&self, rng: &mut ChaCha8Rng) -> Option<(Vector3<f64>, Vec<Stop>)> {
        let first = (0..DRAWS).map(|_| self.draw(rng)).find(|place| self.leads_clear(place, place))?;
        let [least, most] = self.table.speed_m_s;
        let (mut before, mut here) = (first, first);
        let mut stop = |_| {
            let drawn = (0..DRAWS)
                .map(|_| self.draw(rng))
                .find(|place| (place - here).norm() >= SHORTEST_M && self.leads_clear(&here, place));
            (before, here) = (here, drawn.unwrap_or(before));
            Stop { at: here, speed_m_s: uniform(rng, least, most), waits_s: 0.0 }
        };
        Some((first, (0..PLACES).map(&mut stop).collect()))
    }

    fn draw(&self, rng: &mut ChaCha8Rng) -> Vector3<f64> {
        let bounds = self.scene.bounds();
        let inside = Vector3::repeat(FROM_BOUNDS_M);
        let min = self.table.min_m.unwrap_or(bounds.min + inside);
        let max = self.table.max_m.unwrap_or(bounds.max - inside);
        let height_m = self.table.height_m / 2.0;
        Vector3::new(uniform(rng, min.x, max.x), uniform(rng, min.y, max.y), height_m)
    }

    fn leads_clear(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
        let is_far = |pad: &Vector3<f64>| distance_m(&pad.xy(), &from.xy(), &to.xy()) >= FROM_PADS_M;
        self.pads.iter().all(is_far) && way_is_clear(self.scene, from, to, self.table.radius_m + ROOM_M)
    }
}

/// From a point to a segment, m.
fn distance_m(point: &Vector2<f64>, from: &Vector2<f64>, to: &Vector2<f64>) -> f64 {
    let (offset, along) = (point - from, to - from);
    let share = offset.dot(&along) / along.norm_squared().max(1e-12);
    (offset - along * share.clamp(0.0, 1.0)).norm()
}
