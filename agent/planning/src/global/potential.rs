//! The repulsive potential that Wang 2023 adds to A*'s evaluation function.

use nalgebra::Vector3;

/// An obstacle that repels: a standing vehicle, or a part of the map.
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
/// usual one). The value is a cost per metre of path.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Potential {
    obstacles: Vec<PotentialObstacle>,
    gain: f64,
}

/// Distance below which the potential grows no more, metres: it would be infinite at the centre.
const CORE_M: f64 = 0.1;

impl Potential {
    /// The potential, with gain `eta` (metres squared), of those `obstacles` in whose field a vehicle at
    /// `position` is that heads along `heading`.
    pub fn gated(
        position: &Vector3<f64>,
        heading: &Vector3<f64>,
        obstacles: &[PotentialObstacle],
        gain: f64,
    ) -> Potential {
        let in_field = |obstacle: &&PotentialObstacle| {
            is_in_field(heading, &(obstacle.centre - position), obstacle.influence_m)
        };
        Potential { obstacles: obstacles.iter().filter(in_field).copied().collect(), gain }
    }

    /// Whether it is zero everywhere.
    pub fn is_zero(&self) -> bool {
        self.obstacles.is_empty() || self.gain <= 0.0
    }

    /// `U` at a place.
    pub fn at(&self, place: &Vector3<f64>) -> f64 {
        let mut sum = 0.0;
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

    #[test]
    fn the_potential_is_the_papers() {
        let obstacle = PotentialObstacle { centre: Vector3::zeros(), influence_m: 2.0 };
        let potential = Potential::gated(&Vector3::new(-5.0, 0.0, 0.0), &Vector3::x(), &[obstacle], 3.0);
        assert!((potential.at(&Vector3::new(1.0, 0.0, 0.0)) - 0.5 * 3.0 * 0.25).abs() < 1e-12);
        assert_eq!(potential.at(&Vector3::new(2.0, 0.0, 0.0)), 0.0);
        assert!(Potential::gated(&Vector3::new(-5.0, 0.0, 0.0), &-Vector3::x(), &[obstacle], 3.0).is_zero());
    }
}
