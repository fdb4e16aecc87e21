//! The repulsive potential that Wang 2023 adds to A*'s evaluation function.

use nalgebra::Vector3;

use super::map_field::MapField;
use crate::map::ClearanceMap;

/// A round obstacle that repels: a vehicle that stands, or something that moves, where they will meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PotentialObstacle {
    /// Centre (ENU, metres).
    pub centre: Vector3<f64>,
    /// Radius of influence `r`: distance from the centre at which the field ends, metres.
    pub influence_m: f64,
}

/// The sum of the repulsive potentials of the obstacles that a vehicle is heading for.
///
/// `U(n) = sum 1/2 eta (1/rho - 1/r)^2` over the obstacles within whose radius of influence `r` the place `n`
/// lies, `rho` being its distance from the obstacle (Wang 2023, A* combined with APF; the form of `U` is the
/// usual one). Of what the map knows, `rho` counts from the skin, and an obstacle is what hangs together. The value is
/// a cost per metre of path.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Potential {
    obstacles: Vec<PotentialObstacle>,
    map: MapField,
    gain: f64,
}

/// What repels a vehicle, and how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PotentialConfig {
    /// `eta`, metres squared; 0 for no potential.
    pub gain: f64,
    /// Whether what moves and what the map knows repel too, not only vehicles that stand.
    pub of_everything: bool,
    /// `r` of what the map knows, from its skin, metres.
    pub map_influence_m: f64,
    /// The map repels within this distance of the vehicle, metres.
    pub map_reach_m: f64,
    /// Whether only that repels which the vehicle is heading for.
    pub is_gated: bool,
}

impl Default for PotentialConfig {
    fn default() -> Self {
        PotentialConfig {
            gain: 2.0,
            of_everything: false,
            map_influence_m: 2.0,
            map_reach_m: 12.0,
            is_gated: true,
        }
    }
}

/// Distance below which the potential grows no more, metres: it would be infinite at the centre.
const CORE_M: f64 = 0.1;
/// Between two places of a straight way at which the potential is looked up, metres.
const STEP_M: f64 = 0.1;

impl Potential {
    /// The potential of those `obstacles` in whose field a vehicle at `position` is that heads along `heading`, and of
    /// the parts of the `map` that are so, where everything repels.
    pub fn felt(
        position: &Vector3<f64>,
        heading: &Vector3<f64>,
        obstacles: &[PotentialObstacle],
        map: &ClearanceMap,
        config: &PotentialConfig,
    ) -> Potential {
        let PotentialConfig { gain, of_everything, map_influence_m, map_reach_m, is_gated } = *config;
        if gain <= 0.0 {
            return Potential::default();
        }
        let repels =
            |offset: &Vector3<f64>, influence_m: f64| !is_gated || is_in_field(heading, offset, influence_m);
        let is_felt =
            |obstacle: &&PotentialObstacle| repels(&(obstacle.centre - position), obstacle.influence_m);
        let obstacles = obstacles.iter().filter(is_felt).copied().collect();
        let map = if of_everything {
            MapField::of(map, position, [map_reach_m, map_influence_m], |offset| {
                repels(offset, map_influence_m)
            })
        } else {
            MapField::default()
        };
        Potential { obstacles, map, gain }
    }

    /// Whether it is zero everywhere.
    pub fn is_zero(&self) -> bool {
        (self.obstacles.is_empty() && self.map == MapField::default()) || self.gain <= 0.0
    }

    /// `U` at a place.
    pub fn at(&self, place: &Vector3<f64>) -> f64 {
        let mut sum = 0.5 * self.gain * self.map.at(place);
        for obstacle in &self.obstacles {
            let rho = (place - obstacle.centre).norm().max(CORE_M);
            if rho < obstacle.influence_m {
                let closeness = 1.0 / rho - 1.0 / obstacle.influence_m;
                sum += 0.5 * self.gain * closeness * closeness;
            }
        }
        sum
    }
}

impl Potential {
    /// The cost of a straight way: its length, and `U` along it, metres.
    pub fn along(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
        let length_m = (to - from).norm();
        if self.is_zero() {
            return length_m;
        }
        let steps = (length_m / STEP_M).ceil().max(1.0);
        let middles = (0..steps as usize).map(|step| from.lerp(to, (step as f64 + 0.5) / steps));
        length_m + middles.map(|place| self.at(&place)).sum::<f64>() * length_m / steps
    }
}

/// Wang's gate: whether a vehicle heading along `heading` is in the field of an obstacle at `offset` from it.
///
/// With the radius of influence `r` and the distance `D`, the critical angle is `sin(xi) = r / D`; the
/// vehicle is in the field if its heading and the obstacle's bearing differ by less than `xi`. For `D < r`
/// the angle is undefined, and the vehicle is inside. A vehicle that stands (`heading` zero) is in the field
/// only there.
///
/// ```
/// use nalgebra::Vector3;
/// use skein_planning::global::is_in_field;
///
/// let ahead = Vector3::new(10.0, 0.0, 0.0);
/// assert!(is_in_field(&Vector3::new(1.0, 0.05, 0.0), &ahead, 1.0));
/// assert!(!is_in_field(&Vector3::new(1.0, 0.2, 0.0), &ahead, 1.0));
/// assert!(!is_in_field(&Vector3::new(-1.0, 0.0, 0.0), &ahead, 1.0));
/// ```
pub fn is_in_field(heading: &Vector3<f64>, offset: &Vector3<f64>, influence_m: f64) -> bool {
    let distance = offset.norm();
    if distance < influence_m {
        return true;
    }
    let Some(heading) = heading.try_normalize(1e-9) else { return false };
    // The angle is below xi where its sine is, on the near side; the sine is the share of the offset across
    // the heading.
    let along = offset.dot(&heading);
    let across = (offset - heading * along).norm();
    along > 0.0 && across < influence_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::VoxelMapConfig;

    #[test]
    fn the_gate_opens_at_the_critical_angle() {
        let offset = Vector3::new(4.0, 0.0, 0.0);
        let xi = (1.0_f64 / 4.0).asin();
        for (angle, inside) in
            [(xi - 1e-6, true), (xi + 1e-6, false), (-xi + 1e-6, true), (std::f64::consts::PI, false)]
        {
            let heading = Vector3::new(angle.cos(), angle.sin(), 0.0);
            assert_eq!(is_in_field(&heading, &offset, 1.0), inside, "angle {angle}");
        }
        assert!(
            is_in_field(&-Vector3::x(), &Vector3::new(0.5, 0.0, 0.0), 1.0),
            "inside the radius any heading is"
        );
    }

    /// A pole at (0.1, 0.1) in an open field.
    fn pole() -> ClearanceMap {
        let mut map = open();
        map.insert(&Vector3::new(0.1, 0.1, 3.1));
        map
    }

    fn open() -> ClearanceMap {
        ClearanceMap::new(VoxelMapConfig::default(), Vector3::new(0.0, 0.0, 5.0), 2.5).unwrap()
    }

    fn felt(heading: Vector3<f64>, map: &ClearanceMap, config: PotentialConfig) -> Potential {
        let obstacle = PotentialObstacle { centre: Vector3::new(0.0, 20.0, 3.1), influence_m: 2.0 };
        Potential::felt(&Vector3::new(-5.1, 0.1, 3.1), &heading, &[obstacle], map, &config)
    }

    #[test]
    fn the_potential_is_the_papers() {
        let obstacle = PotentialObstacle { centre: Vector3::zeros(), influence_m: 2.0 };
        let config = PotentialConfig { gain: 3.0, ..PotentialConfig::default() };
        let heading_for = |heading: Vector3<f64>| {
            Potential::felt(&Vector3::new(-5.0, 0.0, 0.0), &heading, &[obstacle], &open(), &config)
        };
        let potential = heading_for(Vector3::x());
        assert!((potential.at(&Vector3::new(1.0, 0.0, 0.0)) - 0.5 * 3.0 * 0.25).abs() < 1e-12);
        assert_eq!(potential.at(&Vector3::new(2.0, 0.0, 0.0)), 0.0);
        assert!(heading_for(-Vector3::x()).is_zero());
    }

    #[test]
    fn what_the_map_knows_repels_from_its_skin_where_it_is_headed_for() {
        let everything = PotentialConfig { of_everything: true, ..PotentialConfig::default() };
        let ahead = felt(Vector3::x(), &pole(), everything);
        // A metre from the middle of the pole's voxel, nine tenths from its skin.
        let there = Vector3::new(0.1, 1.1, 3.1);
        assert!((ahead.at(&there) - (1.0 / 0.9 - 0.5_f64).powi(2)).abs() < 1e-9, "{}", ahead.at(&there));
        assert_eq!(ahead.at(&Vector3::new(0.1, 2.5, 3.1)), 0.0);
        assert_eq!(felt(Vector3::y(), &pole(), everything).at(&there), 0.0, "it passes by");
        let ungated = PotentialConfig { is_gated: false, ..everything };
        assert!(felt(Vector3::y(), &pole(), ungated).at(&there) > 0.0);
        assert_eq!(felt(Vector3::x(), &pole(), PotentialConfig::default()).at(&there), 0.0);
    }

    #[test]
    fn of_two_poles_the_sum_is_felt_and_of_one_obstacle_only_its_nearest_part() {
        let everything = PotentialConfig { of_everything: true, ..PotentialConfig::default() };
        let at_middle = |places: &[f64]| {
            let mut map = open();
            places.iter().for_each(|y| map.insert(&Vector3::new(0.1, *y, 3.1)));
            felt(Vector3::x(), &map, everything).at(&Vector3::new(0.1, 1.1, 3.1))
        };
        assert!((at_middle(&[0.1, 2.1]) - 2.0 * at_middle(&[0.1])).abs() < 1e-9);
        assert!((at_middle(&[0.1, -0.1, -0.3]) - at_middle(&[0.1])).abs() < 1e-9);
    }
}
