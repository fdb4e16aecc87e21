//! The artificial potential field as a local planner: attraction along the path, repulsion from the map.

use nalgebra::Vector3;

use crate::map::ClearanceMap;
use crate::path::Path;

/// Gains and reaches of the field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ApfConfig {
    /// The carrot that attracts lies this far ahead on the path, metres, or nearer where the straight way to
    /// it is not free.
    pub look_ahead_m: f64,
    /// Clearance that the straight way to the carrot must have, metres.
    pub carrot_clearance_m: f64,
    /// `rho0`: distance from an obstacle at which its repulsion begins, metres.
    pub influence_m: f64,
    /// `eta`: repulsion, metres to the fourth per second.
    pub repulsive_gain: f64,
    /// Most that the repulsion of all obstacles together adds to the velocity, m/s.
    pub max_repulsion_m_s: f64,
}

impl Default for ApfConfig {
    fn default() -> Self {
        ApfConfig {
            look_ahead_m: 1.5,
            carrot_clearance_m: 0.4,
            influence_m: 1.0,
            repulsive_gain: 0.05,
            max_repulsion_m_s: 0.8,
        }
    }
}

/// The velocity to fly now, and the place on the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guidance {
    /// Velocity wanted (ENU, m/s), no faster than the speed given.
    pub velocity: Vector3<f64>,
    /// The point of the path that attracts (ENU, metres).
    pub carrot: Vector3<f64>,
    /// The vehicle's place along the path, metres.
    pub station_m: f64,
    /// Its distance from the path, metres.
    pub off_path_m: f64,
    /// The attractive part of the velocity.
    pub attraction: Vector3<f64>,
    /// The repulsive part of the velocity, before the speed was limited.
    pub repulsion: Vector3<f64>,
}

/// Velocity that follows `path` from about `station_m` (where the last call was) at up to `speed_m_s`.
///
/// The attraction is `attraction * speed_m_s` towards the carrot; `attraction` is 1, and less while a local
/// minimum is escaped from (Wang 2023). The repulsion is `-grad U` of `U = 1/2 eta (1/rho - 1/rho0)^2`,
/// summed over the nearest obstacle in each direction, horizontal.
///
/// ```
/// use nalgebra::Vector3;
/// use skein_planning::{Path, local::apf, map::{ClearanceMap, VoxelMapConfig}};
///
/// let map = ClearanceMap::new(VoxelMapConfig::default(), Vector3::new(0.0, 0.0, 5.0), 2.5).unwrap();
/// let path = Path::new(vec![Vector3::new(0.0, 0.0, 3.0), Vector3::new(9.0, 0.0, 3.0)]).unwrap();
/// let guidance = apf::follow(&map, &path, 0.0, &Vector3::new(1.0, 0.0, 3.0), 2.0, 1.0, &apf::ApfConfig::default());
/// assert_eq!(guidance.velocity, Vector3::new(2.0, 0.0, 0.0));
/// assert_eq!(guidance.station_m, 1.0);
/// ```
pub fn follow(
    map: &ClearanceMap,
    path: &Path,
    station_m: f64,
    position: &Vector3<f64>,
    speed_m_s: f64,
    attraction: f64,
    config: &ApfConfig,
) -> Guidance {
    let reach_m = 2.0 * config.look_ahead_m;
    let here = path.project_within(position, station_m - reach_m, station_m + reach_m);
    let carrot = carrot(map, path, here.station_m, position, config);
    let attract = towards(position, &carrot, attraction * speed_m_s);
    let repulsion = repulsion(map, position, config);
    Guidance {
        velocity: limited(attract + repulsion, speed_m_s),
        carrot,
        station_m: here.station_m,
        off_path_m: here.distance_m,
        attraction: attract,
        repulsion,
    }
}

/// The repulsive velocity of the map's obstacles at a place, horizontal (ENU, m/s).
pub fn repulsion(map: &ClearanceMap, position: &Vector3<f64>, config: &ApfConfig) -> Vector3<f64> {
    let mut sum = Vector3::zeros();
    for obstacle in map.obstacles_around(position, config.influence_m).points() {
        let away = position - obstacle;
        let rho = away.norm();
        if rho > 1e-6 && rho < config.influence_m {
            // -dU/drho = eta (1/rho - 1/rho0) / rho^2
            let strength = config.repulsive_gain * (1.0 / rho - 1.0 / config.influence_m) / (rho * rho);
            sum += away / rho * strength.min(config.max_repulsion_m_s);
        }
    }
    limited(sum, config.max_repulsion_m_s)
}

/// `velocity`, no longer than `speed_m_s`.
pub fn limited(velocity: Vector3<f64>, speed_m_s: f64) -> Vector3<f64> {
    let speed = velocity.norm();
    if speed > speed_m_s { velocity * (speed_m_s.max(0.0) / speed) } else { velocity }
}

/// The furthest of a few points ahead on the path to which the straight way is free.
pub(super) fn carrot(
    map: &ClearanceMap,
    path: &Path,
    station_m: f64,
    position: &Vector3<f64>,
    config: &ApfConfig,
) -> Vector3<f64> {
    let mut carrot = path.point_at(station_m);
    for share in [1.0, 0.66, 0.33] {
        carrot = path.point_at(station_m + share * config.look_ahead_m);
        if map.is_segment_clear(position, &carrot, config.carrot_clearance_m) {
            break;
        }
    }
    carrot
}

/// Velocity of at most `speed_m_s` towards `target` that comes to rest at it: within half a metre it falls
/// with the distance.
fn towards(position: &Vector3<f64>, target: &Vector3<f64>, speed_m_s: f64) -> Vector3<f64> {
    const NEAR_M: f64 = 0.5;
    let offset = target - position;
    let distance = offset.norm();
    if distance < 1e-9 {
        return Vector3::zeros();
    }
    offset / distance * speed_m_s * (distance / NEAR_M).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::VoxelMapConfig;

    fn map() -> ClearanceMap {
        ClearanceMap::new(VoxelMapConfig::default(), Vector3::new(0.0, 0.0, 5.0), 2.5).unwrap()
    }

    fn straight() -> Path {
        Path::new(vec![Vector3::new(0.0, 0.1, 3.1), Vector3::new(10.0, 0.1, 3.1)]).unwrap()
    }

    #[test]
    fn an_obstacle_beside_the_path_pushes_away_from_it() {
        let mut map = map();
        map.insert(&Vector3::new(3.1, 0.7, 3.1));
        let guidance =
            follow(&map, &straight(), 3.0, &Vector3::new(3.1, 0.1, 3.1), 2.0, 1.0, &ApfConfig::default());
        assert!(guidance.velocity.y < -0.05 && guidance.velocity.x > 1.5, "{:?}", guidance.velocity);
        assert!(guidance.velocity.norm() <= 2.0 + 1e-12);
    }

    #[test]
    fn beyond_the_influence_nothing_repels() {
        let mut map = map();
        map.insert(&Vector3::new(3.1, 1.5, 3.1));
        assert_eq!(repulsion(&map, &Vector3::new(3.1, 0.1, 3.1), &ApfConfig::default()), Vector3::zeros());
    }

    #[test]
    fn less_attraction_is_a_slower_pull() {
        let at = Vector3::new(2.0, 0.1, 3.1);
        let full = follow(&map(), &straight(), 2.0, &at, 2.0, 1.0, &ApfConfig::default());
        let reduced = follow(&map(), &straight(), 2.0, &at, 2.0, 0.4, &ApfConfig::default());
        assert!((reduced.velocity.x / full.velocity.x - 0.4).abs() < 1e-9);
    }

    #[test]
    fn the_carrot_does_not_pull_through_a_corner() {
        let mut map = map();
        for k in 0..14 {
            for j in 0..14 {
                map.insert(&Vector3::new(-1.3 - 0.2 * f64::from(k), 0.7 + 0.2 * f64::from(j), 3.1));
            }
        }
        let path = Path::new(vec![
            Vector3::new(-3.1, 0.1, 3.1),
            Vector3::new(-0.5, 0.1, 3.1),
            Vector3::new(-0.5, 4.1, 3.1),
        ]);
        let position = Vector3::new(-1.5, 0.1, 3.1);
        let guidance = follow(&map, &path.unwrap(), 1.6, &position, 2.0, 1.0, &ApfConfig::default());
        assert!(map.is_segment_clear(&position, &guidance.carrot, 0.4), "carrot {:?}", guidance.carrot);
    }

    #[test]
    fn at_the_end_the_velocity_is_zero() {
        let guidance = follow(&map(), &straight(), 10.0, &straight().end(), 2.0, 1.0, &ApfConfig::default());
        assert_eq!(guidance.velocity, Vector3::zeros());
    }
}
