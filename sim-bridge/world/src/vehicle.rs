//! Kinds of multirotor, read from TOML.
//!
//! The built-in kinds are the files of `vehicles/`; a scenario may bring its own.

use nalgebra::Vector3;
use serde::Deserialize;
use thiserror::Error;

/// Standard gravity, m/s^2.
pub const GRAVITY_M_S2: f64 = 9.806_65;

const BUILT_IN: [(&str, &str); 4] = [
    ("x500", include_str!("../vehicles/x500.toml")),
    ("x500-vertical-scanner", include_str!("../vehicles/x500-vertical-scanner.toml")),
    ("crazyflie", include_str!("../vehicles/crazyflie.toml")),
    ("crazyflie-indoor", include_str!("../vehicles/crazyflie-indoor.toml")),
];

/// A quadrotor in X configuration, its limits and its sensors.
///
/// Masses and lengths are those of the real thing; `max_*` are what the built-in autopilot may
/// demand of it, well inside what the rotors could give.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VehicleModel {
    pub name: String,
    /// Take-off mass, kg.
    pub mass_kg: f64,
    /// Centre to each rotor axis, m; the rotors stand at 45 degrees to the body axes.
    pub arm_m: f64,
    /// Principal moments of inertia about body x, y, z, kg m^2.
    pub inertia: [f64; 3],
    /// Thrust of one rotor at full command, N.
    pub max_thrust_n: f64,
    /// Reaction torque about the rotor axis per newton of thrust, m.
    pub torque_per_thrust_m: f64,
    /// Time constant of a rotor's first-order answer to its command, s.
    pub rotor_time_constant_s: f64,
    /// Drag force per speed through the air, N s/m.
    pub linear_drag: f64,
    /// Drag force per squared speed through the air, N s^2/m^2.
    pub quadratic_drag: f64,
    /// Radius of the sphere that counts as the vehicle in collisions, m.
    #[serde(default = "default_hull_radius_m")]
    pub hull_radius_m: f64,
    /// Height of the centre above the ground when the vehicle stands, m.
    pub leg_height_m: f64,
    /// Largest tilt the autopilot demands, rad.
    pub max_tilt_rad: f64,
    /// Largest horizontal speed the autopilot demands, m/s.
    pub max_speed_m_s: f64,
    /// Largest horizontal acceleration the autopilot demands, m/s^2.
    pub max_accel_m_s2: f64,
    /// Largest rate of climb the autopilot demands, m/s.
    pub max_climb_m_s: f64,
    /// Largest rate of descent the autopilot demands, m/s, positive.
    pub max_descent_m_s: f64,
    #[serde(default)]
    pub control: ControlModel,
    pub battery: BatteryModel,
    /// Planar laser scanner with its range finders up and down, if it has one; and a second, upright scanner.
    pub lidar: Option<LidarModel>,
    /// Satellite receiver, if it has one.
    pub gps: Option<GpsModel>,
    /// Accelerometer and gyroscope.
    pub imu: ImuModel,
    pub baro: BaroModel,
    /// Heading from the magnetic field.
    pub compass: CompassModel,
    /// Range finder that looks down, for the autopilot.
    pub rangefinder: RangefinderModel,
    /// Camera that looks down on markers, if it has one.
    pub floor_camera: Option<FloorCameraModel>,
    /// Optical flow sensor that looks down, if it has one.
    pub flow: Option<FlowModel>,
}

fn default_hull_radius_m() -> f64 {
    0.25
}

/// The built-in autopilot's outer loop.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ControlModel {
    /// The position loop's integral.
    pub position_integral: PositionIntegral,
}

/// The share of a lasting error that the position loop learns.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PositionIntegral {
    /// Nothing: wind is left to the velocity loop's integral, and what moves is followed with a lag.
    #[default]
    None,
    /// The whole error, as a plain PID does.
    Plain,
    /// The whole error within 1 m, nothing beyond 2 m, and between them a falling share (Zhang 2019, variable
    /// integral).
    Variable,
}

/// An energy store that empties with thrust: `P = hover_power (T / T_hover)^1.5`, the momentum
/// theory of a hovering rotor.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BatteryModel {
    /// Usable energy when full, Wh.
    pub capacity_wh: f64,
    /// Electrical power in hover, W.
    pub hover_power_w: f64,
    /// Power that flows always, W.
    pub idle_power_w: f64,
    /// Open-circuit voltage when full, V.
    pub full_v: f64,
    /// Open-circuit voltage when empty, V.
    pub empty_v: f64,
}

/// Of the range to what is white, that to what is black.
const DARK_SHARE: f64 = 0.25;

/// A planar laser scanner in the body's xy plane, one full turn.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LidarModel {
    /// Rays in a turn.
    pub rays: u32,
    /// Largest range, to what is white, m.
    pub range_m: f64,
    /// Range to what is black, m; a quarter of the largest if left out.
    #[serde(default)]
    pub dark_range_m: Option<f64>,
    /// Standard deviation of a range, m.
    pub sigma_m: f64,
    /// Scans per second; must divide the simulation's 250 steps per second.
    pub rate_hz: f64,
    /// Largest range of the finders that look up and down, m.
    pub vertical_range_m: f64,
    /// Full opening of the cone of the finders that look up and down, rad.
    pub vertical_cone_rad: f64,
    /// Rays in a turn of a second scanner, in the body's xz plane; 0 without one.
    #[serde(default)]
    pub upright_rays: u32,
}

impl LidarModel {
    /// How far it sees what sends back such a share of light, m: the light that comes back falls with the square of the
    /// distance.
    pub fn range_to(&self, reflectivity: f64) -> f64 {
        let dark_m = self.dark_range_m.unwrap_or(DARK_SHARE * self.range_m);
        (self.range_m * reflectivity.clamp(0.0, 1.0).sqrt()).max(dark_m).min(self.range_m)
    }
}

/// A satellite receiver with white noise on position and velocity.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GpsModel {
    /// Standard deviation east and north, m.
    pub sigma_horizontal_m: f64,
    /// Standard deviation of height, m.
    pub sigma_vertical_m: f64,
    /// Standard deviation of each velocity axis, m/s.
    pub sigma_velocity_m_s: f64,
    /// Fixes per second; must divide 250.
    pub rate_hz: f64,
}

/// An inertial unit with white noise and a constant bias drawn at power-on.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuModel {
    /// Standard deviation of each angular rate sample, rad/s.
    pub gyro_sigma_rad_s: f64,
    /// Standard deviation of the constant gyroscope bias, rad/s.
    pub gyro_bias_rad_s: f64,
    /// Standard deviation of each specific force sample, m/s^2.
    pub accel_sigma_m_s2: f64,
    /// Standard deviation of the constant accelerometer bias, m/s^2.
    pub accel_bias_m_s2: f64,
}

/// A barometer with white noise and a constant offset drawn at power-on.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BaroModel {
    /// Standard deviation of a sample, m.
    pub sigma_m: f64,
    /// Standard deviation of the constant offset, m.
    pub offset_m: f64,
    /// Samples per second; must divide 250.
    pub rate_hz: f64,
}

/// A heading sensor with white noise.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompassModel {
    /// Standard deviation of a sample, rad.
    pub sigma_rad: f64,
    /// Samples per second; must divide 250.
    pub rate_hz: f64,
}

/// A single-beam range finder along body -z.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangefinderModel {
    /// Largest range, m.
    pub range_m: f64,
    /// Standard deviation of a range, m.
    pub sigma_m: f64,
    /// Samples per second; must divide 250.
    pub rate_hz: f64,
}

/// A camera along body -z that finds markers.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FloorCameraModel {
    /// Pictures per second; must divide 250.
    pub rate_hz: f64,
    /// Half of its angle of view, to all four sides, rad.
    pub half_view_rad: f64,
    /// Standard deviation of a corner in the picture, as an angle, rad.
    pub corner_sigma_rad: f64,
    /// Time from a picture to its pose, s.
    pub latency_s: f64,
    /// Nearer than this nothing is sharp, m.
    pub least_m: f64,
}

/// An optical flow sensor along body -z.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlowModel {
    /// Readings per second; must divide 250.
    pub rate_hz: f64,
    /// Standard deviation of a reading, rad/s.
    pub sigma_rad_s: f64,
    /// Standard deviation of the share by which it tells too much, drawn at power-on.
    pub scale_sigma: f64,
    /// Between these distances it sees the ground, m.
    pub least_m: f64,
    pub most_m: f64,
}

/// Why a vehicle file was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum VehicleError {
    #[error("{source_name}:{line}:{column}: {message}")]
    Syntax { source_name: String, line: usize, column: usize, message: String },
    #[error("{source_name}: field `{field}` is {found}; expected {expected}")]
    Range { source_name: String, field: &'static str, found: f64, expected: &'static str },
    #[error("no built-in vehicle `{name}`; there are: {known}")]
    Unknown { name: String, known: String },
}

impl VehicleModel {
    /// Reads a vehicle file; `source_name` is what messages call it.
    pub fn from_toml(text: &str, source_name: &str) -> Result<Self, VehicleError> {
        let model: Self = toml::from_str(text).map_err(|error| {
            let (line, column) = line_and_column(text, error.span().map_or(0, |span| span.start));
            VehicleError::Syntax {
                source_name: source_name.to_owned(),
                line,
                column,
                message: error.message().to_owned(),
            }
        })?;
        model.check(source_name)?;
        Ok(model)
    }

    /// The built-in vehicle of that name: `x500` (2 kg), `x500-vertical-scanner`, which sees cables too,
    /// `crazyflie` (27 g), or `crazyflie-indoor`, which has no satellite receiver.
    pub fn built_in(name: &str) -> Result<Self, VehicleError> {
        match BUILT_IN.iter().find(|(known, _)| *known == name) {
            Some((known, text)) => Self::from_toml(text, &format!("vehicles/{known}.toml")),
            None => Err(VehicleError::Unknown {
                name: name.to_owned(),
                known: BUILT_IN.map(|(known, _)| known).join(", "),
            }),
        }
    }

    /// Names of the built-in vehicles.
    pub fn built_in_names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.iter().map(|(name, _)| *name)
    }

    /// Positions of the rotors in the body frame (FLU, m), in the order of
    /// [`MotorCommands`](crate::quadrotor::MotorCommands).
    pub fn rotor_positions(&self) -> [Vector3<f64>; 4] {
        let reach = self.arm_m * std::f64::consts::FRAC_1_SQRT_2;
        [
            Vector3::new(reach, -reach, 0.0),
            Vector3::new(-reach, reach, 0.0),
            Vector3::new(reach, reach, 0.0),
            Vector3::new(-reach, -reach, 0.0),
        ]
    }

    /// Share of full thrust (0..1) that carries the weight.
    pub fn hover_share(&self) -> f64 {
        self.mass_kg * GRAVITY_M_S2 / (4.0 * self.max_thrust_n)
    }

    /// The tilt that the autopilot demands at most and the rotors can hold at this height, rad.
    pub fn top_tilt_rad(&self) -> f64 {
        self.max_tilt_rad.min(self.hover_share().acos())
    }

    /// Speed through still air at that tilt, m/s: at most 100.
    pub fn top_airspeed_m_s(&self) -> f64 {
        let force_n = self.mass_kg * GRAVITY_M_S2 * self.top_tilt_rad().tan();
        let root = self.linear_drag.powi(2) + 4.0 * self.quadratic_drag * force_n;
        (2.0 * force_n / (self.linear_drag + root.sqrt())).min(100.0)
    }

    /// Time in hover from full to empty, s.
    pub fn endurance_s(&self) -> f64 {
        self.battery.capacity_wh * 3600.0 / (self.battery.hover_power_w + self.battery.idle_power_w)
    }

    fn check(&self, source_name: &str) -> Result<(), VehicleError> {
        let [ixx, iyy, izz] = self.inertia;
        let positive = [
            ("mass_kg", self.mass_kg),
            ("arm_m", self.arm_m),
            ("inertia[0]", ixx),
            ("inertia[1]", iyy),
            ("inertia[2]", izz),
            ("max_thrust_n", self.max_thrust_n),
            ("torque_per_thrust_m", self.torque_per_thrust_m),
            ("rotor_time_constant_s", self.rotor_time_constant_s),
            ("hull_radius_m", self.hull_radius_m),
            ("leg_height_m", self.leg_height_m),
            ("max_tilt_rad", self.max_tilt_rad),
            ("max_speed_m_s", self.max_speed_m_s),
            ("max_accel_m_s2", self.max_accel_m_s2),
            ("max_climb_m_s", self.max_climb_m_s),
            ("max_descent_m_s", self.max_descent_m_s),
            ("battery.capacity_wh", self.battery.capacity_wh),
            ("battery.hover_power_w", self.battery.hover_power_w),
            ("battery.empty_v", self.battery.empty_v),
            ("rangefinder.range_m", self.rangefinder.range_m),
        ];
        let not_negative = [
            ("linear_drag", self.linear_drag),
            ("quadratic_drag", self.quadratic_drag),
            ("battery.idle_power_w", self.battery.idle_power_w),
            ("imu.gyro_sigma_rad_s", self.imu.gyro_sigma_rad_s),
            ("imu.gyro_bias_rad_s", self.imu.gyro_bias_rad_s),
            ("imu.accel_sigma_m_s2", self.imu.accel_sigma_m_s2),
            ("imu.accel_bias_m_s2", self.imu.accel_bias_m_s2),
            ("baro.sigma_m", self.baro.sigma_m),
            ("baro.offset_m", self.baro.offset_m),
            ("compass.sigma_rad", self.compass.sigma_rad),
            ("rangefinder.sigma_m", self.rangefinder.sigma_m),
        ];
        let rates = [
            ("baro.rate_hz", self.baro.rate_hz),
            ("compass.rate_hz", self.compass.rate_hz),
            ("rangefinder.rate_hz", self.rangefinder.rate_hz),
        ];
        let range = |field, found: f64, sound: bool, expected| {
            if sound && found.is_finite() {
                return Ok(());
            }
            Err(VehicleError::Range { source_name: source_name.to_owned(), field, found, expected })
        };
        let of_gps = |field, of: fn(&GpsModel) -> f64| self.gps.iter().map(move |gps| (field, of(gps)));
        let not_negative = not_negative
            .into_iter()
            .chain(of_gps("gps.sigma_horizontal_m", |gps| gps.sigma_horizontal_m))
            .chain(of_gps("gps.sigma_vertical_m", |gps| gps.sigma_vertical_m))
            .chain(of_gps("gps.sigma_velocity_m_s", |gps| gps.sigma_velocity_m_s));
        let rates = rates.into_iter().chain(of_gps("gps.rate_hz", |gps| gps.rate_hz));
        let of_camera = |field, of: fn(&FloorCameraModel) -> f64| {
            self.floor_camera.iter().map(move |camera| (field, of(camera)))
        };
        let of_flow = |field, of: fn(&FlowModel) -> f64| self.flow.iter().map(move |flow| (field, of(flow)));
        let positive = positive
            .into_iter()
            .chain(of_camera("floor_camera.corner_sigma_rad", |camera| camera.corner_sigma_rad))
            .chain(of_camera("floor_camera.least_m", |camera| camera.least_m))
            .chain(of_flow("flow.least_m", |flow| flow.least_m))
            .chain(of_flow("flow.most_m", |flow| flow.most_m));
        let not_negative = not_negative
            .chain(of_camera("floor_camera.latency_s", |camera| camera.latency_s))
            .chain(of_flow("flow.sigma_rad_s", |flow| flow.sigma_rad_s))
            .chain(of_flow("flow.scale_sigma", |flow| flow.scale_sigma));
        let rates = rates
            .chain(of_camera("floor_camera.rate_hz", |camera| camera.rate_hz))
            .chain(of_flow("flow.rate_hz", |flow| flow.rate_hz));
        for (field, half_view_rad) in of_camera("floor_camera.half_view_rad", |camera| camera.half_view_rad) {
            range(field, half_view_rad, (0.05..1.5).contains(&half_view_rad), "an angle of 0.05 to 1.5 rad")?;
        }
        let of_lidar =
            |field, of: fn(&LidarModel) -> f64| self.lidar.iter().map(move |lidar| (field, of(lidar)));
        let positive = positive.chain(of_lidar("lidar.range_m", |lidar| lidar.range_m));
        let positive = positive.chain(of_lidar("lidar.vertical_range_m", |lidar| lidar.vertical_range_m));
        let positive = positive.chain(of_lidar("lidar.dark_range_m", |lidar| lidar.range_to(0.0)));
        let not_negative = not_negative.chain(of_lidar("lidar.sigma_m", |lidar| lidar.sigma_m));
        let rates = rates.chain(of_lidar("lidar.rate_hz", |lidar| lidar.rate_hz));
        for (field, found) in positive {
            range(field, found, found > 0.0, "a number above 0")?;
        }
        for (field, found) in not_negative {
            range(field, found, found >= 0.0, "0 or more")?;
        }
        for (field, found) in rates {
            let divides = found > 0.0 && (250.0 / found).fract() == 0.0;
            range(field, found, divides, "a rate that divides 250, such as 10")?;
        }
        if let Some(LidarModel { rays, vertical_cone_rad: cone, upright_rays, .. }) = self.lidar {
            let upright = upright_rays == 0 || (4..=4096).contains(&upright_rays);
            range("lidar.upright_rays", f64::from(upright_rays), upright, "0, or 4 to 4096")?;
            range("lidar.rays", f64::from(rays), (4..=10_000).contains(&rays), "4 to 10000")?;
            range("lidar.vertical_cone_rad", cone, (0.0..=3.0).contains(&cone), "an angle of 0 to 3 rad")?;
        }
        range(
            "battery.full_v",
            self.battery.full_v,
            self.battery.full_v >= self.battery.empty_v,
            "at least battery.empty_v",
        )?;
        range(
            "max_thrust_n",
            self.max_thrust_n,
            self.hover_share() < 0.9,
            "four rotors that lift the mass with a tenth to spare",
        )
    }
}

/// Line and column, both from 1, of a byte offset.
fn line_and_column(text: &str, offset: usize) -> (usize, usize) {
    let before = text.get(..offset).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, str::len) + 1;
    (line, column)
}
