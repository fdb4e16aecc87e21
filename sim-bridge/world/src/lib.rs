//! The simulated world: obstacles, vehicles, sensors, the built-in autopilot and collision truth.
//!
//! A [`Scene`] is what stands or moves there whatever the vehicles do, built in code or read from a Gazebo world
//! ([`Scene::from_sdf`]) or a table of boxes ([`Scene::from_csv`]). A [`VehicleModel`] describes a
//! kind of quadrotor. A [`Simulation`] puts vehicles into a scene and moves everything on in steps
//! of 4 ms: dynamics with rotor lag, drag and wind; noisy instruments; a planar lidar; an autopilot
//! per vehicle that speaks MAVLink; and a referee that counts collisions and measures separation.
//!
//! The world reads no clock, file, socket or global random generator. Equal configurations give
//! equal runs, bit for bit. World frame: east-north-up, metres; body frame: forward-left-up.
//!
//! ```
//! use skein_world::{
//!     MotorCommands, Obstacle, PositionErrors, Scene, Simulation, SimulationConfig, VehicleModel,
//!     VehicleSetup, WindConfig,
//! };
//!
//! let model = VehicleModel::built_in("x500")?;
//! let climb = MotorCommands([model.hover_share() * 1.1; 4]);
//! let mut simulation = Simulation::new(SimulationConfig {
//!     scene: Scene::new("glade", vec![Obstacle::trunk("oak", 5.0, 0.0, 0.3, 12.0)]),
//!     vehicles: vec![VehicleSetup {
//!         model,
//!         position: [0.0; 3].into(),
//!         yaw: 0.0,
//!         system_id: 1,
//!         position_errors: PositionErrors::default(),
//!     }],
//!     seed: 1,
//!     wind: WindConfig::default(),
//! });
//! simulation.drive(0, climb); // by hand, in place of the built-in autopilot
//! for _ in 0..500 {
//!     simulation.step();
//! }
//! let vehicle = simulation.vehicle(0).ok_or("no vehicle")?;
//! assert!(vehicle.airborne && vehicle.motion.position.z > 1.0);
//! let (_, scan) = &simulation.take_scans()[0];
//! let ahead = scan.ranges_m[360];
//! assert!((ahead - 4.7).abs() < 0.2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod aabb;
pub mod autopilot;
pub mod cloud;
pub mod csv;
pub mod files;
pub mod floor_camera;
mod floor_image;
mod flow;
pub mod lidar;
pub mod mesh;
mod noise;
pub mod obstacle;
pub mod pilot;
pub mod position_error;
pub mod quadrotor;
mod round;
pub mod scene;
pub mod sdf;
pub mod sensors;
pub mod simulation;
pub mod truth;
pub mod vehicle;
pub mod way;
pub mod wind;

pub use aabb::Aabb;
pub use cloud::CloudError;
pub use csv::CsvError;
pub use files::{Files, Found, NoFiles};
pub use floor_camera::MarkerFloor;
pub use floor_image::{FloorCamera, Glare, ImageFaults, Picture, View};
pub use lidar::{Hull, Lidar, Surroundings};
pub use mesh::Mesh;
pub use obstacle::{Obstacle, Shape};
pub use pilot::Pilot;
pub use position_error::{Drift, PositionErrors, PositionFault, PositionFaultKind};
pub use quadrotor::{MotorCommands, Quadrotor, RigidState, STEP};
pub use scene::{Nearest, Scene};
pub use sdf::{Account, Lacking, Reading, SdfError, Verdict};
pub use sensors::{Gps, Imu, SensorReadings};
pub use simulation::{HANGS, Simulation, SimulationConfig, VehicleSetup, VehicleState};
pub use skein_mav::Battery;
pub use truth::Truth;
pub use vehicle::{ControlModel, PositionIntegral, VehicleError, VehicleModel};
pub use way::{Stop, Way};
pub use wind::{Wind, WindConfig};
