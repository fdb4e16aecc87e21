//! Rigid-body dynamics of a quadrotor.

use std::time::Duration;

use nalgebra::{Quaternion, Translation3, UnitQuaternion, Vector3};
use skein_mav::Battery;

use crate::vehicle::{GRAVITY_M_S2, VehicleModel};

/// The simulation's time step: 250 per second.
pub const STEP: Duration = Duration::from_millis(4);

const DT: f64 = 0.004;
/// Friction of the legs on the ground.
const GROUND_FRICTION: f64 = 0.8;
/// Time in which the legs put a tilted vehicle upright, s.
const GROUND_LEVELLING_TIME_S: f64 = 0.05;

/// Position and motion of a rigid body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidState {
    /// Centre of mass, world ENU, m.
    pub position: Vector3<f64>,
    /// World ENU, m/s.
    pub velocity: Vector3<f64>,
    /// Body FLU to world ENU.
    pub attitude: UnitQuaternion<f64>,
    /// Body FLU, rad/s.
    pub angular_rate: Vector3<f64>,
}

/// Thrust demanded of each rotor as a share (0..1) of its full thrust.
///
/// Order: front-right, rear-left (counter-clockwise seen from above), front-left, rear-right
/// (clockwise).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MotorCommands(pub [f64; 4]);

/// The meeting of a vehicle with the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touchdown {
    /// Downward speed just before, m/s.
    pub descent_m_s: f64,
    /// Angle between the body's and the world's z axis, rad.
    pub tilt_rad: f64,
}

impl Touchdown {
    /// Whether the legs would break: faster than 3 m/s or tilted more than 60 degrees.
    pub fn is_crash(&self) -> bool {
        self.descent_m_s > 3.0 || self.tilt_rad > std::f64::consts::FRAC_PI_3
    }
}

/// A quadrotor as physics sees it: six degrees of freedom, rotors that lag, drag against the air,
/// a battery that empties, and the ground (z = 0) to stand on.
#[derive(Debug, Clone)]
pub struct Quadrotor {
    model: VehicleModel,
    state: RigidState,
    rotor_thrust_n: [f64; 4],
    /// Share of a rotor's error that is left after one step.
    rotor_decay: f64,
    specific_force: Vector3<f64>,
    energy_wh: f64,
    on_ground: bool,
    wrecked: bool,
}

impl Quadrotor {
    /// A quadrotor at rest with a full battery. A `position` below standing height is lifted to
    /// it; one above falls until the rotors carry.
    pub fn new(model: VehicleModel, position: Vector3<f64>, yaw: f64) -> Self {
        let standing = position.z <= model.leg_height_m;
        let position = Vector3::new(position.x, position.y, position.z.max(model.leg_height_m));
        Self {
            rotor_decay: (-DT / model.rotor_time_constant_s).exp(),
            energy_wh: model.battery.capacity_wh,
            model,
            state: RigidState {
                position,
                velocity: Vector3::zeros(),
                attitude: UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw),
                angular_rate: Vector3::zeros(),
            },
            rotor_thrust_n: [0.0; 4],
            specific_force: Vector3::new(0.0, 0.0, GRAVITY_M_S2),
            on_ground: standing,
            wrecked: false,
        }
    }

    /// Moves on by [`STEP`] in air that moves with `wind` (ENU, m/s). Tells when it lands.
    pub fn step(&mut self, commands: &MotorCommands, wind: &Vector3<f64>) -> Option<Touchdown> {
        let wrench = self.spin_rotors(commands);
        self.drain_battery();
        let before = self.state;
        self.state = self.integrate(&wrench, wind);
        let touchdown = self.meet_ground();
        self.specific_force = self.feel(&before.velocity);
        touchdown
    }

    /// Hangs at rest for a step, as if a hand held it, while its rotors follow these commands.
    pub fn hang(&mut self, commands: &MotorCommands) {
        self.spin_rotors(commands);
        (self.state.velocity, self.state.angular_rate) = (Vector3::zeros(), Vector3::zeros());
        self.specific_force = self.state.attitude.inverse() * Vector3::new(0.0, 0.0, GRAVITY_M_S2);
    }

    /// Sets the share of its battery's energy that is left, 0 to 1.
    pub fn charge(&mut self, fraction: f64) {
        self.energy_wh = fraction.clamp(0.0, 1.0) * self.model.battery.capacity_wh;
    }

    pub fn model(&self) -> &VehicleModel {
        &self.model
    }

    /// True position and motion.
    pub fn state(&self) -> &RigidState {
        &self.state
    }

    /// Places the vehicle and sets it in motion.
    pub fn set_state(&mut self, state: RigidState) {
        self.state = state;
        self.on_ground = state.position.z <= self.model.leg_height_m;
    }

    /// Acceleration less gravity of the last step, body FLU, m/s^2.
    pub fn specific_force(&self) -> &Vector3<f64> {
        &self.specific_force
    }

    /// Whether the legs touch the ground.
    pub fn on_ground(&self) -> bool {
        self.on_ground
    }

    pub fn wrecked(&self) -> bool {
        self.wrecked
    }

    /// Energy left and voltage.
    pub fn battery(&self) -> Battery {
        let battery = &self.model.battery;
        let fraction = self.energy_wh / battery.capacity_wh;
        Battery { fraction, voltage_v: battery.empty_v + (battery.full_v - battery.empty_v) * fraction }
    }

    /// Ends the flight: the impact takes the speed away, the rotors give no thrust any more, and
    /// the wreck falls.
    pub fn wreck(&mut self) {
        self.wrecked = true;
        self.rotor_thrust_n = [0.0; 4];
        self.state.velocity = Vector3::new(0.0, 0.0, self.state.velocity.z.min(0.0));
        self.state.angular_rate = Vector3::zeros();
    }

    /// Lets the rotors follow their commands and gives the mean force and torque of the step.
    fn spin_rotors(&mut self, commands: &MotorCommands) -> Wrench {
        let powered = !self.wrecked && self.energy_wh > 0.0;
        let lag_share = (1.0 - self.rotor_decay) * self.model.rotor_time_constant_s / DT;
        let mut mean_n = [0.0; 4];
        for ((thrust, mean), command) in self.rotor_thrust_n.iter_mut().zip(&mut mean_n).zip(commands.0) {
            let share = if powered && command.is_finite() { command.clamp(0.0, 1.0) } else { 0.0 };
            let target = share * self.model.max_thrust_n;
            let error = *thrust - target;
            *mean = target + error * lag_share;
            *thrust = target + error * self.rotor_decay;
        }
        Wrench::of_rotors(&self.model, &mean_n)
    }

    fn drain_battery(&mut self) {
        let battery = &self.model.battery;
        let load = self.rotor_thrust_n.iter().sum::<f64>() / (self.model.mass_kg * GRAVITY_M_S2);
        let power_w = battery.idle_power_w + battery.hover_power_w * load * load.sqrt();
        self.energy_wh = (self.energy_wh - power_w * DT / 3600.0).max(0.0);
    }

    /// One step of the classical Runge-Kutta method of fourth order.
    fn integrate(&self, wrench: &Wrench, wind: &Vector3<f64>) -> RigidState {
        let start = Motion::from(&self.state);
        let k1 = self.derivative(&start, wrench, wind);
        let k2 = self.derivative(&start.moved(&k1, DT / 2.0), wrench, wind);
        let k3 = self.derivative(&start.moved(&k2, DT / 2.0), wrench, wind);
        let k4 = self.derivative(&start.moved(&k3, DT), wrench, wind);
        start.moved(&k1, DT / 6.0).moved(&k2, DT / 3.0).moved(&k3, DT / 3.0).moved(&k4, DT / 6.0).into()
    }

    /// Newton's and Euler's equations.
    fn derivative(&self, motion: &Motion, wrench: &Wrench, wind: &Vector3<f64>) -> Motion {
        let model = &self.model;
        let attitude = UnitQuaternion::new_unchecked(motion.attitude);
        let thrust = attitude * Vector3::new(0.0, 0.0, wrench.thrust_n);
        let airspeed = motion.velocity - wind;
        let drag = airspeed * -(model.linear_drag + model.quadratic_drag * airspeed.norm());
        let gravity = Vector3::new(0.0, 0.0, -GRAVITY_M_S2);

        let inertia = Vector3::from(model.inertia);
        let rate = motion.angular_rate;
        let gyroscopic = rate.cross(&inertia.component_mul(&rate));
        Motion {
            position: motion.velocity,
            velocity: (thrust + drag) / model.mass_kg + gravity,
            attitude: motion.attitude * Quaternion::from_imag(rate) * 0.5,
            angular_rate: (wrench.torque_n_m - gyroscopic).component_div(&inertia),
        }
    }

    /// Ground contact without bounce: the legs carry, rub, and put the body upright.
    fn meet_ground(&mut self) -> Option<Touchdown> {
        let was_on_ground = self.on_ground;
        let state = &mut self.state;
        self.on_ground = state.position.z <= self.model.leg_height_m;
        if !self.on_ground {
            return None;
        }
        let up_in_body = state.attitude.inverse() * Vector3::z();
        let touchdown =
            Touchdown { descent_m_s: -state.velocity.z, tilt_rad: up_in_body.z.clamp(-1.0, 1.0).acos() };
        state.position.z = self.model.leg_height_m;
        let sliding = Vector3::new(state.velocity.x, state.velocity.y, 0.0);
        let speed = sliding.norm();
        let left = (speed - GROUND_FRICTION * GRAVITY_M_S2 * DT).max(0.0);
        state.velocity = if speed > 0.0 { sliding * (left / speed) } else { sliding };
        state.angular_rate = Vector3::z().cross(&up_in_body) / GROUND_LEVELLING_TIME_S;
        (!was_on_ground).then_some(touchdown)
    }

    /// Specific force of the step, contact forces included, as an accelerometer feels it.
    fn feel(&self, velocity_before: &Vector3<f64>) -> Vector3<f64> {
        let acceleration = (self.state.velocity - velocity_before) / DT;
        let gravity = Vector3::new(0.0, 0.0, -GRAVITY_M_S2);
        self.state.attitude.inverse() * (acceleration - gravity)
    }
}

/// Force along body z and torque in the body frame.
struct Wrench {
    thrust_n: f64,
    torque_n_m: Vector3<f64>,
}

impl Wrench {
    fn of_rotors(model: &VehicleModel, thrust_n: &[f64; 4]) -> Self {
        // A rotor that turns counter-clockwise turns the body clockwise.
        const REACTION: [f64; 4] = [-1.0, -1.0, 1.0, 1.0];
        let mut wrench = Self { thrust_n: 0.0, torque_n_m: Vector3::zeros() };
        for ((place, &thrust), reaction) in model.rotor_positions().iter().zip(thrust_n).zip(REACTION) {
            wrench.thrust_n += thrust;
            wrench.torque_n_m += Vector3::new(
                place.y * thrust,
                -place.x * thrust,
                reaction * model.torque_per_thrust_m * thrust,
            );
        }
        wrench
    }
}

/// A rigid state, or its derivative, as plain numbers that can be added.
#[derive(Clone, Copy)]
struct Motion {
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    attitude: Quaternion<f64>,
    angular_rate: Vector3<f64>,
}

impl Motion {
    fn moved(&self, derivative: &Self, dt: f64) -> Self {
        Self {
            position: self.position + derivative.position * dt,
            velocity: self.velocity + derivative.velocity * dt,
            attitude: self.attitude + derivative.attitude * dt,
            angular_rate: self.angular_rate + derivative.angular_rate * dt,
        }
    }
}

impl From<&RigidState> for Motion {
    fn from(state: &RigidState) -> Self {
        Self {
            position: state.position,
            velocity: state.velocity,
            attitude: state.attitude.into_inner(),
            angular_rate: state.angular_rate,
        }
    }
}

impl From<Motion> for RigidState {
    fn from(motion: Motion) -> Self {
        Self {
            position: motion.position,
            velocity: motion.velocity,
            attitude: UnitQuaternion::new_normalize(motion.attitude),
            angular_rate: motion.angular_rate,
        }
    }
}

impl RigidState {
    /// Body FLU to world ENU, with the position.
    pub fn pose(&self) -> nalgebra::Isometry3<f64> {
        nalgebra::Isometry3::from_parts(Translation3::from(self.position), self.attitude)
    }
}
