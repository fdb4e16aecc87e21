//! Thrust and torques become the four rotors' shares, within what a rotor can give.

use nalgebra::Vector3;

use crate::quadrotor::MotorCommands;
use crate::vehicle::VehicleModel;

/// Signs with which roll, pitch and yaw torque enter each rotor: front-right, rear-left (counter-clockwise),
/// front-left, rear-right (clockwise).
const SIGNS: [[f64; 3]; 4] = [[-1.0, -1.0, -1.0], [1.0, 1.0, -1.0], [1.0, -1.0, 1.0], [-1.0, 1.0, 1.0]];

/// The geometry that turns newtons and newton-metres into shares.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mixer {
    share_per_newton: f64,
    share_per_tilt_torque: f64,
    share_per_turn_torque: f64,
}

impl Mixer {
    pub(super) fn new(model: &VehicleModel) -> Self {
        let share_per_newton = 1.0 / (4.0 * model.max_thrust_n);
        let lever_m = model.arm_m * std::f64::consts::FRAC_1_SQRT_2;
        Self {
            share_per_newton,
            share_per_tilt_torque: share_per_newton / lever_m,
            share_per_turn_torque: share_per_newton / model.torque_per_thrust_m,
        }
    }

    /// Mixes. What does not fit is given up in this order: turning, thrust, tilt; losing tilt is losing the
    /// vehicle.
    pub(super) fn mix(&self, thrust_n: f64, torque: &Vector3<f64>) -> MotorCommands {
        let tilt = torque.xy() * self.share_per_tilt_torque;
        let tilt = SIGNS.map(|[roll, pitch, _]| roll * tilt.x + pitch * tilt.y);
        let span = max(&tilt) - min(&tilt);
        let tilt = tilt.map(|share| if span > 1.0 { share / span } else { share });
        // Rounding may leave the interval empty by a hair, so no `clamp`, which would panic.
        let thrust = (thrust_n * self.share_per_newton).min(1.0 - max(&tilt)).max(-min(&tilt));

        let turn = torque.z * self.share_per_turn_torque;
        let room = tilt.iter().zip(SIGNS).map(|(share, [_, _, sign])| {
            let (share, wish) = (share + thrust, sign * turn);
            if wish > 0.0 { (1.0 - share) / wish } else { share / -wish }
        });
        let scale = room.filter(|room| room.is_finite()).fold(1.0, f64::min).max(0.0);

        let mut shares = tilt;
        for (share, [_, _, sign]) in shares.iter_mut().zip(SIGNS) {
            *share = (*share + thrust + sign * turn * scale).clamp(0.0, 1.0);
        }
        MotorCommands(shares)
    }
}

fn max(shares: &[f64; 4]) -> f64 {
    shares.iter().copied().fold(f64::MIN, f64::max)
}

fn min(shares: &[f64; 4]) -> f64 {
    shares.iter().copied().fold(f64::MAX, f64::min)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::vehicle::VehicleModel;

    fn x500() -> VehicleModel {
        VehicleModel::built_in("x500").unwrap()
    }

    /// Thrust and torque that the shares really make.
    fn wrench(model: &VehicleModel, commands: &MotorCommands) -> (f64, Vector3<f64>) {
        let reaction = [-1.0, -1.0, 1.0, 1.0];
        let mut torque = Vector3::zeros();
        let mut thrust = 0.0;
        for ((place, share), reaction) in model.rotor_positions().iter().zip(commands.0).zip(reaction) {
            let newtons = share * model.max_thrust_n;
            thrust += newtons;
            torque += place.cross(&Vector3::new(0.0, 0.0, newtons))
                + Vector3::new(0.0, 0.0, reaction * model.torque_per_thrust_m * newtons);
        }
        (thrust, torque)
    }

    #[test]
    fn what_fits_is_given_exactly() {
        let model = x500();
        let wish = Vector3::new(0.3, -0.2, 0.05);
        let (thrust, torque) = wrench(&model, &Mixer::new(&model).mix(19.6, &wish));
        assert!((thrust - 19.6).abs() < 1e-9);
        assert!((torque - wish).norm() < 1e-9);
    }

    #[test]
    fn turning_is_given_up_before_tilt() {
        let model = x500();
        let wish = Vector3::new(0.5, 0.0, 5.0);
        let (_, torque) = wrench(&model, &Mixer::new(&model).mix(19.6, &wish));
        assert!((torque.x - 0.5).abs() < 1e-9);
        assert!(torque.z < 1.0);
    }

    #[test]
    fn thrust_is_given_up_before_tilt() {
        let model = x500();
        let wish = Vector3::new(0.0, 1.0, 0.0);
        let (thrust, torque) = wrench(&model, &Mixer::new(&model).mix(1000.0, &wish));
        assert!((torque.y - 1.0).abs() < 1e-9);
        assert!(thrust < 40.0);
    }

    proptest! {
        #[test]
        fn shares_stay_within_a_rotor(
            thrust in -50.0..200.0_f64,
            x in -20.0..20.0_f64,
            y in -20.0..20.0_f64,
            z in -20.0..20.0_f64,
        ) {
            let commands = Mixer::new(&x500()).mix(thrust, &Vector3::new(x, y, z));
            prop_assert!(commands.0.iter().all(|share| (0.0..=1.0).contains(share)));
        }
    }
}
