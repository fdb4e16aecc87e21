//! The outer loops: a wished position or velocity becomes an attitude and a thrust (P4, cascade PID).
//!
//! Position error -> velocity (proportional, braking in time, with an integral where the vehicle's file says so) -> a
//! reference that moves with limited acceleration and jerk -> acceleration (PI on velocity, reference acceleration
//! ahead) -> thrust vector within the tilt limit.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3};
use skein_mav::axes;

use super::estimator::Estimate;
use super::parameters::Settings;
use crate::quadrotor::STEP;
use crate::vehicle::{GRAVITY_M_S2, PositionIntegral, VehicleModel};

/// Rate at which the velocity reference follows the wish, 1/s.
const REFERENCE_RATE: f64 = 5.0;
/// Integral of the velocity error, relative to its proportional gain, 1/s.
const INTEGRAL_RATE: f64 = 0.6;
/// Integral of the position error, relative to its proportional gain, 1/s.
const POSITION_INTEGRAL_RATE: f64 = 0.5;
/// Fastest that the position integral may ask for, m/s.
const MAX_POSITION_INTEGRAL_M_S: f64 = 2.0;
/// Within this error the variable integral takes in all of it, m.
const WHOLE_INTEGRAL_M: f64 = 1.0;
/// Beyond this error it takes in nothing, m.
const NO_INTEGRAL_M: f64 = 2.0;
/// Largest acceleration the integral may hold against wind, m/s^2.
const MAX_INTEGRAL_M_S2: f64 = 3.0;
/// Largest vertical acceleration demanded, m/s^2.
const MAX_VERTICAL_ACCEL_M_S2: f64 = 4.0;
/// The rotors never give less than this share of the weight in flight, or attitude control would be lost.
const MIN_LIFT_SHARE: f64 = 0.3;
/// Share of the acceleration limit planned for braking; the rest corrects.
const BRAKING_SHARE: f64 = 0.6;
/// Fastest turn of the nose, rad/s.
const MAX_YAW_RATE: f64 = 1.2;
/// Rate at which the heading reference follows the wish, 1/s.
const YAW_REFERENCE_RATE: f64 = 3.0;

/// A wish for east and north.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Horizontal {
    /// m/s.
    Velocity(Vector2<f64>),
    /// A place, m, and the highest speed, m/s.
    Position(Vector2<f64>, f64),
}

/// A wish for up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Vertical {
    /// m/s.
    Velocity(f64),
    /// World height, m, and how fast to climb or descend at most, m/s.
    Height(f64, f64),
}

/// The flight mode's demand on the controllers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Demand {
    pub(super) horizontal: Horizontal,
    pub(super) vertical: Vertical,
    /// Heading, counter-clockwise from east, rad; `None` keeps the one there is.
    pub(super) yaw: Option<f64>,
}

impl Demand {
    /// Whether it leads upward from the ground.
    pub(super) fn lifts_off(&self, position: &Vector3<f64>) -> bool {
        match self.vertical {
            Vertical::Velocity(speed) => speed > 0.1,
            Vertical::Height(height, _) => height > position.z + 0.3,
        }
    }

    /// Whether it leads downward.
    pub(super) fn descends(&self, position: &Vector3<f64>) -> bool {
        match self.vertical {
            Vertical::Velocity(speed) => speed < 0.0,
            Vertical::Height(height, _) => height < position.z,
        }
    }
}

/// The outer loops' demand on the inner ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AttitudeTarget {
    /// Body FLU to world ENU.
    pub(super) attitude: UnitQuaternion<f64>,
    /// Turning speed of the wished heading, rad/s.
    pub(super) yaw_rate: f64,
    /// Thrust along body z, N.
    pub(super) thrust_n: f64,
}

/// The outer loops and their memory.
#[derive(Debug, Clone)]
pub(super) struct PositionControl {
    mass_kg: f64,
    max_thrust_n: f64,
    /// Proportional gain of the velocity loop, 1/s.
    velocity_gain: f64,
    /// Proportional gain of the position loop, 1/s.
    position_gain: f64,
    velocity_reference: Vector3<f64>,
    acceleration_reference: Vector3<f64>,
    integral: Vector3<f64>,
    position_integral: Vector2<f64>,
    learns: PositionIntegral,
    yaw_reference: Option<f64>,
}

impl PositionControl {
    /// `attitude_gain`: the bandwidth of the attitude loop, 1/s. Each loop is about 2.3 times slower than the
    /// one within.
    pub(super) fn new(model: &VehicleModel, attitude_gain: f64) -> Self {
        let velocity_gain = attitude_gain / 2.3;
        Self {
            mass_kg: model.mass_kg,
            max_thrust_n: 4.0 * model.max_thrust_n,
            velocity_gain,
            position_gain: velocity_gain / 2.3,
            velocity_reference: Vector3::zeros(),
            acceleration_reference: Vector3::zeros(),
            integral: Vector3::zeros(),
            position_integral: Vector2::zeros(),
            learns: model.control.position_integral,
            yaw_reference: None,
        }
    }

    /// Forgets everything, as when standing on the ground.
    pub(super) fn reset(&mut self) {
        self.velocity_reference = Vector3::zeros();
        self.acceleration_reference = Vector3::zeros();
        self.integral = Vector3::zeros();
        self.position_integral = Vector2::zeros();
        self.yaw_reference = None;
    }

    pub(super) fn step(
        &mut self,
        estimate: &Estimate,
        demand: &Demand,
        settings: &Settings,
    ) -> AttitudeTarget {
        self.learn_position(estimate, demand);
        let wish = self.wished_velocity(estimate, demand, settings);
        self.move_reference(&wish, settings);
        let force = self.specific_force(estimate, settings);
        let yaw_rate = self.turn_yaw_reference(estimate, demand);
        let yaw = self.yaw_reference.unwrap_or_else(|| estimate.yaw());
        let body_z = estimate.attitude * Vector3::z();
        AttitudeTarget {
            attitude: attitude_along(&force, yaw),
            yaw_rate,
            thrust_n: (self.mass_kg * force.dot(&body_z)).clamp(0.0, self.max_thrust_n),
        }
    }

    fn wished_velocity(&self, estimate: &Estimate, demand: &Demand, settings: &Settings) -> Vector3<f64> {
        let horizontal = match demand.horizontal {
            Horizontal::Velocity(velocity) => velocity,
            Horizontal::Position(position, max_speed) => {
                let way = position - estimate.position.xy();
                let distance = way.norm();
                let braking = BRAKING_SHARE * settings.max_accel_m_s2;
                let speed = approach_speed(distance, self.position_gain, braking).min(max_speed);
                let approach = if distance > 0.0 { way * (speed / distance) } else { way };
                approach + self.position_integral
            }
        };
        let vertical = match demand.vertical {
            Vertical::Velocity(speed) => speed,
            Vertical::Height(height, max_speed) => {
                let way = height - estimate.position.z;
                let braking = BRAKING_SHARE * MAX_VERTICAL_ACCEL_M_S2;
                let speed = approach_speed(way.abs(), self.position_gain, braking).min(max_speed);
                speed.copysign(way)
            }
        };
        let horizontal = horizontal.cap_magnitude(settings.max_speed_m_s);
        let vertical = vertical.clamp(-settings.max_descent_m_s, settings.max_climb_m_s);
        Vector3::new(horizontal.x, horizontal.y, vertical)
    }

    /// Takes the position error into the integral, as far as it counts. What is flown by velocity has none.
    fn learn_position(&mut self, estimate: &Estimate, demand: &Demand) {
        let Horizontal::Position(position, _) = demand.horizontal else {
            self.position_integral = Vector2::zeros();
            return;
        };
        let error = position - estimate.position.xy();
        let growth =
            error * (integral_share(self.learns, error.norm()) * self.position_gain * POSITION_INTEGRAL_RATE);
        let integral = self.position_integral + growth * STEP.as_secs_f64();
        self.position_integral = integral.cap_magnitude(MAX_POSITION_INTEGRAL_M_S);
    }

    /// Moves the velocity reference towards the wish, with limited acceleration and jerk.
    fn move_reference(&mut self, wish: &Vector3<f64>, settings: &Settings) {
        let dt = STEP.as_secs_f64();
        let wanted = (wish - self.velocity_reference) * REFERENCE_RATE;
        let horizontal = wanted.xy().cap_magnitude(settings.max_accel_m_s2);
        let vertical = wanted.z.clamp(-MAX_VERTICAL_ACCEL_M_S2, MAX_VERTICAL_ACCEL_M_S2);
        let wanted = Vector3::new(horizontal.x, horizontal.y, vertical);
        let change = wanted - self.acceleration_reference;
        self.acceleration_reference += change.cap_magnitude(settings.max_jerk_m_s3 * dt);
        self.velocity_reference += self.acceleration_reference * dt;
    }

    /// Acceleration against gravity and towards the reference, within what tilt and thrust allow, m/s^2.
    fn specific_force(&mut self, estimate: &Estimate, settings: &Settings) -> Vector3<f64> {
        let error = self.velocity_reference - estimate.velocity;
        let wanted = self.acceleration_reference
            + error * self.velocity_gain
            + self.integral
            + Vector3::new(0.0, 0.0, GRAVITY_M_S2);
        let strongest = self.max_thrust_n / self.mass_kg;
        let lift = wanted.z.clamp(MIN_LIFT_SHARE * GRAVITY_M_S2, strongest);
        let sideways = wanted.xy().cap_magnitude(lift * settings.max_tilt_rad.tan());
        let force = Vector3::new(sideways.x, sideways.y, lift);
        // Only what can be given is learnt, or the integral winds up against the limits.
        if force == wanted {
            let growth = error * (self.velocity_gain * INTEGRAL_RATE * STEP.as_secs_f64());
            self.integral = (self.integral + growth).cap_magnitude(MAX_INTEGRAL_M_S2);
        }
        force
    }

    /// Turns the heading reference towards the wish; returns how fast it turns, rad/s.
    fn turn_yaw_reference(&mut self, estimate: &Estimate, demand: &Demand) -> f64 {
        let reference = *self.yaw_reference.get_or_insert_with(|| estimate.yaw());
        let Some(wish) = demand.yaw else {
            return 0.0;
        };
        let error = axes::wrap_angle(wish - reference);
        let rate = (error * YAW_REFERENCE_RATE).clamp(-MAX_YAW_RATE, MAX_YAW_RATE);
        self.yaw_reference = Some(axes::wrap_angle(reference + rate * STEP.as_secs_f64()));
        rate
    }
}

fn integral_share(learns: PositionIntegral, error_m: f64) -> f64 {
    match learns {
        PositionIntegral::None => 0.0,
        PositionIntegral::Plain => 1.0,
        PositionIntegral::Variable => {
            ((NO_INTEGRAL_M - error_m) / (NO_INTEGRAL_M - WHOLE_INTEGRAL_M)).clamp(0.0, 1.0)
        }
    }
}

/// Speed at which a point `distance` away is approached: proportional near it, farther off as fast as can be
/// braked with `braking` m/s^2, and smooth where the two meet.
fn approach_speed(distance: f64, gain: f64, braking: f64) -> f64 {
    let linear_range = braking / (gain * gain);
    if distance <= linear_range {
        gain * distance
    } else {
        (2.0 * braking * (distance - 0.5 * linear_range)).sqrt()
    }
}

/// The way that a vehicle with this velocity still flies when it brakes at once.
pub(super) fn stopping_way(velocity: &Vector3<f64>, settings: &Settings) -> Vector3<f64> {
    let horizontal = velocity.xy();
    let braking = BRAKING_SHARE * settings.max_accel_m_s2;
    let way = horizontal * (horizontal.norm() / (2.0 * braking));
    let vertical_braking = BRAKING_SHARE * MAX_VERTICAL_ACCEL_M_S2;
    let rise = velocity.z * velocity.z.abs() / (2.0 * vertical_braking);
    Vector3::new(way.x, way.y, rise)
}

/// The attitude whose body z is along `force` and whose nose points to `yaw` as far as that allows.
fn attitude_along(force: &Vector3<f64>, yaw: f64) -> UnitQuaternion<f64> {
    let z = force.normalize();
    let nose = Vector3::new(yaw.cos(), yaw.sin(), 0.0);
    let y = z.cross(&nose).normalize();
    let x = y.cross(&z);
    let axes = Matrix3::from_columns(&[x, y, z]);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variable_integral_takes_in_what_was_published() {
        // 0 for |e| > 200 cm, (200 - |e|) / 100 between, 1 for |e| < 100 cm.
        let published =
            [(0.0, 1.0), (0.99, 1.0), (1.0, 1.0), (1.25, 0.75), (1.5, 0.5), (2.0, 0.0), (7.0, 0.0)];
        for (error_m, share) in published {
            assert!((integral_share(PositionIntegral::Variable, error_m) - share).abs() < 1e-12, "{error_m}");
            assert_eq!(integral_share(PositionIntegral::Plain, error_m), 1.0);
            assert_eq!(integral_share(PositionIntegral::None, error_m), 0.0);
        }
    }
}
