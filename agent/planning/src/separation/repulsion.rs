//! Repulsion between vehicles, with a turn to the right that resolves encounters.

use nalgebra::Vector3;

use super::Neighbour;

/// Reach and strength of the repulsion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RepulsionConfig {
    /// `rho0`: distance at which the repulsion begins, metres.
    pub influence_m: f64,
    /// `eta`: metres to the fourth per second.
    pub gain: f64,
    /// Most that the radial part adds, m/s.
    pub max_radial_m_s: f64,
    /// Share of the velocity towards a close neighbour that is turned to the right of it.
    pub keep_right: f64,
    /// Distance at which the turn to the right is full, metres; it begins at `influence_m`.
    pub keep_right_full_m: f64,
    /// Vertical distances count for as much less: a vehicle, with the air below its rotors, is this much
    /// taller than wide.
    pub vertical_stretch: f64,
}

impl Default for RepulsionConfig {
    fn default() -> Self {
        RepulsionConfig {
            influence_m: 4.0,
            gain: 4.0,
            max_radial_m_s: 1.5,
            keep_right: 1.0,
            keep_right_full_m: 2.0,
            vertical_stretch: 1.5,
        }
    }
}

/// The addition to the velocity `desired` of a vehicle at `position` (ENU, m/s), so that encounters resolve.
/// Horizontal.
///
/// The radial part is `-grad U` of `U = 1/2 eta (1/rho - 1/rho0)^2` for `rho <= rho0` (the repulsion between
/// vehicles of P3). It alone lets vehicles that meet head-on push one another to a halt. The other part turns
/// the share of `desired` that leads towards a neighbour to the right of it: what is taken from the approach
/// is given to the turn, so that a crowd does not press itself into a knot. Since all vehicles do, two that
/// meet pass with the other on their left, and many that meet at one point go round it counter-clockwise. It
/// ends once the way is free, so vehicles that part are not bent.
///
/// It makes encounters smooth, not safe: that is [`super::filter`]'s part.
pub fn repulsion(
    position: &Vector3<f64>,
    desired: &Vector3<f64>,
    neighbours: &[Neighbour],
    config: &RepulsionConfig,
) -> Vector3<f64> {
    let mut radial = Vector3::zeros();
    let mut turn = Vector3::zeros();
    for neighbour in neighbours.iter().filter(|neighbour| neighbour.is_sound()) {
        let offset = neighbour.predicted() - position;
        let stretched = Vector3::new(offset.x, offset.y, offset.z / config.vertical_stretch);
        let rho = stretched.norm().max(0.1);
        let Some(towards) = Vector3::new(offset.x, offset.y, 0.0).try_normalize(1e-6) else { continue };
        if rho >= config.influence_m {
            continue;
        }
        // -dU/drho = eta (1/rho - 1/rho0) / rho^2
        let strength = config.gain * (1.0 / rho - 1.0 / config.influence_m) / (rho * rho);
        radial -= towards * strength.min(config.max_radial_m_s);
        let closing = desired.dot(&towards);
        if closing > 0.0 {
            let right = Vector3::new(towards.y, -towards.x, 0.0);
            let span = (config.influence_m - config.keep_right_full_m).max(1e-3);
            let nearness = ((config.influence_m - rho) / span).min(1.0);
            turn += (right - towards) * (config.keep_right * nearness * closing);
        }
    }
    // A quarter turn changes a velocity by the square root of two of its length; several neighbours ask for
    // no more.
    let quarter_turn = desired.norm() * config.keep_right * std::f64::consts::SQRT_2;
    limited(radial, config.max_radial_m_s) + limited(turn, quarter_turn)
}

fn limited(vector: Vector3<f64>, length: f64) -> Vector3<f64> {
    let norm = vector.norm();
    if norm > length { vector * (length / norm) } else { vector }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn neighbour(position: [f64; 3]) -> Neighbour {
        Neighbour {
            id: 2,
            position: Vector3::from(position),
            velocity: Vector3::zeros(),
            sigma_m: 0.05,
            age_s: 0.0,
            radius_m: 0.25,
            cooperative: true,
        }
    }

    #[test]
    fn two_that_meet_head_on_both_turn_right() {
        let config = RepulsionConfig::default();
        let eastbound = repulsion(&Vector3::zeros(), &Vector3::x(), &[neighbour([2.0, 0.0, 0.0])], &config);
        let westbound =
            repulsion(&Vector3::new(2.0, 0.0, 0.0), &-Vector3::x(), &[neighbour([0.0; 3])], &config);
        assert!(eastbound.y < -0.5 && westbound.y > 0.5);
        assert!(eastbound.x < 0.0 && westbound.x > 0.0, "and slow down");
    }

    #[test]
    fn one_that_leaves_is_not_bent() {
        let config = RepulsionConfig::default();
        let away = repulsion(&Vector3::zeros(), &-Vector3::x(), &[neighbour([3.0, 0.0, 0.0])], &config);
        assert_eq!(away.y, 0.0);
        assert!(away.x < 0.0);
    }

    #[test]
    fn beyond_the_influence_there_is_none() {
        let config = RepulsionConfig::default();
        let far = repulsion(&Vector3::zeros(), &Vector3::x(), &[neighbour([4.0, 0.0, 0.0])], &config);
        assert_eq!(far, Vector3::zeros());
    }

    #[test]
    fn a_neighbour_above_counts_as_nearer_than_it_is() {
        let config = RepulsionConfig { keep_right: 0.0, ..RepulsionConfig::default() };
        let at = |z: f64, stretch: f64| {
            let config = RepulsionConfig { vertical_stretch: stretch, ..config };
            repulsion(&Vector3::zeros(), &Vector3::x(), &[neighbour([2.0, 0.0, z])], &config).norm()
        };
        assert!(at(2.0, 1.5) > at(2.0, 1.0));
        assert!(at(0.0, 1.5) > at(2.0, 1.5));
    }
}
