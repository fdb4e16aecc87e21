//! An autopilot's state as MAVLink messages.

use std::time::Duration;

use mavlink::MessageData;
use mavlink::dialects::common::{
    ATTITUDE_DATA, ATTITUDE_QUATERNION_DATA, AUTOPILOT_VERSION_DATA, BATTERY_STATUS_DATA,
    ESTIMATOR_STATUS_DATA, EXTENDED_SYS_STATE_DATA, EstimatorStatusFlags, GLOBAL_POSITION_INT_DATA,
    GPS_GLOBAL_ORIGIN_DATA, GPS_RAW_INT_DATA, GpsFixType, HEARTBEAT_DATA, HOME_POSITION_DATA,
    LOCAL_POSITION_NED_DATA, MISSION_CURRENT_DATA, MavAutopilot, MavBatteryChargeState, MavBatteryFunction,
    MavBatteryType, MavLandedState, MavModeFlag, MavProtocolCapability, MavState, MavSysStatusSensor,
    MavType, MissionState, SYS_STATUS_DATA, VFR_HUD_DATA,
};
use nalgebra::{UnitQuaternion, Vector3};

use crate::axes;
use crate::dialects::px4;
use crate::frame::FrameWriter;
use crate::geodesy::{Datum, Geodetic, LocalFrame};
use crate::mode::FlightMode;
use crate::telemetry::{Battery, Landed};

/// An autopilot's state, as it reports it. Vectors are in the world's ENU frame unless they say body.
#[derive(Debug, Clone, PartialEq)]
pub struct VehicleState {
    /// When position, velocity and attitude were measured, since the run began.
    pub measured: Duration,
    pub mode: FlightMode,
    /// The motors may turn.
    pub armed: bool,
    pub landed: Landed,
    /// Position, m; `None` while it does not know.
    pub position: Option<Vector3<f64>>,
    /// Velocity, m/s.
    pub velocity: Vector3<f64>,
    /// Standard deviations of the position, horizontal and vertical, m.
    pub position_sigma_m: [f64; 2],
    /// Whether satellites tell its position.
    pub has_fix: bool,
    /// Attitude, body FLU to world ENU.
    pub attitude: UnitQuaternion<f64>,
    /// Angular rate, body FLU, rad/s.
    pub angular_rate: Vector3<f64>,
    pub battery: Battery,
    /// Home, m; `None` until it has been set.
    pub home: Option<Vector3<f64>>,
    /// Whether all sensors are healthy.
    pub sensors_ok: bool,
    /// Whether an arm command would be accepted.
    pub ready_to_arm: bool,
    /// Whether a failsafe is acting.
    pub failsafe: bool,
    /// Collective thrust, 0..1.
    pub throttle: f64,
    /// Mission item under way, counted from 0.
    pub mission_item: u16,
}

/// Everything a message needs.
pub(super) struct Report<'a> {
    pub(super) now: Duration,
    /// When its clock began.
    pub(super) booted: Duration,
    pub(super) state: &'a VehicleState,
    pub(super) datum: &'a Datum,
    /// Where its local frame is.
    pub(super) origin: Geodetic,
    pub(super) local: &'a LocalFrame,
    pub(super) mission_len: usize,
}

impl Report<'_> {
    /// Writes the message with this id, if the state has what it needs.
    pub(super) fn write(&self, message_id: u32, output: &mut FrameWriter) {
        match message_id {
            HEARTBEAT_DATA::ID => output.write(&self.heartbeat()),
            ATTITUDE_QUATERNION_DATA::ID => output.write(&self.attitude_quaternion()),
            ATTITUDE_DATA::ID => output.write(&self.attitude()),
            EXTENDED_SYS_STATE_DATA::ID => output.write(&self.extended_state()),
            SYS_STATUS_DATA::ID => output.write(&self.system_status()),
            BATTERY_STATUS_DATA::ID => output.write(&self.battery()),
            GPS_GLOBAL_ORIGIN_DATA::ID => output.write(&self.origin()),
            MISSION_CURRENT_DATA::ID => output.write(&self.mission_current()),
            AUTOPILOT_VERSION_DATA::ID => output.write(&version()),
            HOME_POSITION_DATA::ID => write_some(self.home(), output),
            LOCAL_POSITION_NED_DATA::ID => write_some(self.local_position(), output),
            GLOBAL_POSITION_INT_DATA::ID => write_some(self.global_position(), output),
            GPS_RAW_INT_DATA::ID => write_some(self.gps(), output),
            ESTIMATOR_STATUS_DATA::ID => output.write(&self.estimator_status()),
            VFR_HUD_DATA::ID => write_some(self.head_up_display(), output),
            _ => {}
        }
    }

    fn time_boot_ms(&self) -> u32 {
        self.state.measured.saturating_sub(self.booted).as_millis() as u32
    }

    fn heartbeat(&self) -> HEARTBEAT_DATA {
        let state = self.state;
        let mut base_mode =
            MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | MavModeFlag::MAV_MODE_FLAG_STABILIZE_ENABLED;
        if state.armed {
            base_mode |= MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
        }
        base_mode |= match state.mode {
            FlightMode::Manual => MavModeFlag::MAV_MODE_FLAG_MANUAL_INPUT_ENABLED,
            FlightMode::Offboard => MavModeFlag::MAV_MODE_FLAG_GUIDED_ENABLED,
            _ => MavModeFlag::MAV_MODE_FLAG_AUTO_ENABLED | MavModeFlag::MAV_MODE_FLAG_GUIDED_ENABLED,
        };
        HEARTBEAT_DATA {
            custom_mode: px4::custom_mode(state.mode),
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: MavAutopilot::MAV_AUTOPILOT_PX4,
            base_mode,
            system_status: if state.failsafe {
                MavState::MAV_STATE_CRITICAL
            } else if state.armed {
                MavState::MAV_STATE_ACTIVE
            } else if state.sensors_ok {
                MavState::MAV_STATE_STANDBY
            } else {
                MavState::MAV_STATE_BOOT
            },
            mavlink_version: 3,
        }
    }

    fn attitude_quaternion(&self) -> ATTITUDE_QUATERNION_DATA {
        let attitude = axes::attitude_to_ned(&self.state.attitude);
        let rate = axes::flu_to_frd(&self.state.angular_rate);
        ATTITUDE_QUATERNION_DATA {
            time_boot_ms: self.time_boot_ms(),
            q1: attitude.w as f32,
            q2: attitude.i as f32,
            q3: attitude.j as f32,
            q4: attitude.k as f32,
            rollspeed: rate.x as f32,
            pitchspeed: rate.y as f32,
            yawspeed: rate.z as f32,
            ..Default::default()
        }
    }

    fn attitude(&self) -> ATTITUDE_DATA {
        let (roll, pitch, yaw) = axes::attitude_to_ned(&self.state.attitude).euler_angles();
        let rate = axes::flu_to_frd(&self.state.angular_rate);
        ATTITUDE_DATA {
            time_boot_ms: self.time_boot_ms(),
            roll: roll as f32,
            pitch: pitch as f32,
            yaw: yaw as f32,
            rollspeed: rate.x as f32,
            pitchspeed: rate.y as f32,
            yawspeed: rate.z as f32,
        }
    }

    fn extended_state(&self) -> EXTENDED_SYS_STATE_DATA {
        EXTENDED_SYS_STATE_DATA {
            landed_state: match self.state.landed {
                Landed::Unknown => MavLandedState::MAV_LANDED_STATE_UNDEFINED,
                Landed::OnGround => MavLandedState::MAV_LANDED_STATE_ON_GROUND,
                Landed::TakingOff => MavLandedState::MAV_LANDED_STATE_TAKEOFF,
                Landed::InAir => MavLandedState::MAV_LANDED_STATE_IN_AIR,
                Landed::Landing => MavLandedState::MAV_LANDED_STATE_LANDING,
            },
            ..Default::default()
        }
    }

    fn system_status(&self) -> SYS_STATUS_DATA {
        let sensors = MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_3D_GYRO
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_3D_ACCEL
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_3D_MAG
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_GPS;
        let pre_arm = MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK;
        let mut health = MavSysStatusSensor::empty();
        if self.state.sensors_ok {
            health |= sensors;
        }
        if self.state.ready_to_arm {
            health |= pre_arm;
        }
        SYS_STATUS_DATA {
            onboard_control_sensors_present: sensors | pre_arm,
            onboard_control_sensors_enabled: sensors | pre_arm,
            onboard_control_sensors_health: health,
            voltage_battery: millivolts(&self.state.battery),
            current_battery: -1,
            battery_remaining: percent(&self.state.battery),
            ..Default::default()
        }
    }

    fn battery(&self) -> BATTERY_STATUS_DATA {
        // The pack's voltage as that of its first cell; u16::MAX marks cells that are not measured.
        let none = u16::MAX;
        let pack = millivolts(&self.state.battery);
        let voltages = [pack, none, none, none, none, none, none, none, none, none];
        BATTERY_STATUS_DATA {
            current_consumed: -1,
            energy_consumed: -1,
            temperature: i16::MAX,
            voltages,
            current_battery: -1,
            battery_function: MavBatteryFunction::MAV_BATTERY_FUNCTION_ALL,
            mavtype: MavBatteryType::MAV_BATTERY_TYPE_LIPO,
            battery_remaining: percent(&self.state.battery),
            charge_state: MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_UNDEFINED,
            ..Default::default()
        }
    }

    fn origin(&self) -> GPS_GLOBAL_ORIGIN_DATA {
        let origin = self.origin;
        GPS_GLOBAL_ORIGIN_DATA {
            latitude: origin.latitude_e7(),
            longitude: origin.longitude_e7(),
            altitude: origin.height_mm(),
            time_usec: self.now.as_micros() as u64,
        }
    }

    fn home(&self) -> Option<HOME_POSITION_DATA> {
        let home = self.state.home?;
        let place = self.datum.to_geodetic(&home);
        let ned = self.local.position_to_local(&home);
        Some(HOME_POSITION_DATA {
            latitude: place.latitude_e7(),
            longitude: place.longitude_e7(),
            altitude: place.height_mm(),
            x: ned.x as f32,
            y: ned.y as f32,
            z: ned.z as f32,
            q: [1.0, 0.0, 0.0, 0.0],
            time_usec: self.now.as_micros() as u64,
            ..Default::default()
        })
    }

    fn local_position(&self) -> Option<LOCAL_POSITION_NED_DATA> {
        let position = self.local.position_to_local(&self.state.position?);
        let velocity = axes::enu_to_ned(&self.state.velocity);
        Some(LOCAL_POSITION_NED_DATA {
            time_boot_ms: self.time_boot_ms(),
            x: position.x as f32,
            y: position.y as f32,
            z: position.z as f32,
            vx: velocity.x as f32,
            vy: velocity.y as f32,
            vz: velocity.z as f32,
        })
    }

    fn global_position(&self) -> Option<GLOBAL_POSITION_INT_DATA> {
        let position = self.state.position?;
        let place = self.datum.to_geodetic(&position);
        let velocity = axes::enu_to_ned(&self.state.velocity).map(|speed| (speed * 100.0) as i16);
        let above_home = position.z - self.state.home.map_or(0.0, |home| home.z);
        Some(GLOBAL_POSITION_INT_DATA {
            time_boot_ms: self.time_boot_ms(),
            lat: place.latitude_e7(),
            lon: place.longitude_e7(),
            alt: place.height_mm(),
            relative_alt: (above_home * 1000.0).round() as i32,
            vx: velocity.x,
            vy: velocity.y,
            vz: velocity.z,
            hdg: (self.heading_deg() * 100.0) as u16,
        })
    }

    fn gps(&self) -> Option<GPS_RAW_INT_DATA> {
        let [horizontal_m, vertical_m] = self.state.position_sigma_m;
        let place = self.datum.to_geodetic(&self.state.position?);
        Some(GPS_RAW_INT_DATA {
            time_usec: self.now.as_micros() as u64,
            lat: place.latitude_e7(),
            lon: place.longitude_e7(),
            alt: place.height_mm(),
            eph: u16::MAX,
            epv: u16::MAX,
            vel: (self.state.velocity.xy().norm() * 100.0) as u16,
            cog: u16::MAX,
            fix_type: match self.state.has_fix {
                true => GpsFixType::GPS_FIX_TYPE_RTK_FIXED,
                false => GpsFixType::GPS_FIX_TYPE_NO_FIX,
            },
            satellites_visible: if self.state.has_fix { 12 } else { 0 },
            h_acc: millimetres(horizontal_m),
            v_acc: millimetres(vertical_m),
            ..Default::default()
        })
    }

    fn estimator_status(&self) -> ESTIMATOR_STATUS_DATA {
        let [horizontal_m, vertical_m] = self.state.position_sigma_m;
        let mut flags = EstimatorStatusFlags::ESTIMATOR_ATTITUDE
            | EstimatorStatusFlags::ESTIMATOR_VELOCITY_HORIZ
            | EstimatorStatusFlags::ESTIMATOR_VELOCITY_VERT
            | EstimatorStatusFlags::ESTIMATOR_POS_HORIZ_REL
            | EstimatorStatusFlags::ESTIMATOR_POS_VERT_ABS;
        flags.set(EstimatorStatusFlags::ESTIMATOR_POS_HORIZ_ABS, self.state.has_fix);
        ESTIMATOR_STATUS_DATA {
            time_usec: self.state.measured.saturating_sub(self.booted).as_micros() as u64,
            pos_horiz_accuracy: horizontal_m as f32,
            pos_vert_accuracy: vertical_m as f32,
            flags,
            ..Default::default()
        }
    }

    fn head_up_display(&self) -> Option<VFR_HUD_DATA> {
        let position = self.state.position?;
        let speed = self.state.velocity.xy().norm() as f32;
        Some(VFR_HUD_DATA {
            airspeed: speed,
            groundspeed: speed,
            alt: (self.datum.height_m + position.z) as f32,
            climb: self.state.velocity.z as f32,
            heading: self.heading_deg() as i16,
            throttle: (self.state.throttle * 100.0) as u16,
        })
    }

    fn mission_current(&self) -> MISSION_CURRENT_DATA {
        let flying = self.state.mode == FlightMode::Mission;
        MISSION_CURRENT_DATA {
            seq: self.state.mission_item,
            total: self.mission_len as u16,
            mission_state: match (self.mission_len, flying) {
                (0, _) => MissionState::MISSION_STATE_NO_MISSION,
                (_, true) => MissionState::MISSION_STATE_ACTIVE,
                (_, false) if self.state.mission_item == 0 => MissionState::MISSION_STATE_NOT_STARTED,
                (_, false) => MissionState::MISSION_STATE_PAUSED,
            },
            ..Default::default()
        }
    }

    /// Degrees clockwise from north, 0..360.
    fn heading_deg(&self) -> f64 {
        let yaw = axes::swap_yaw(axes::yaw(&self.state.attitude));
        yaw.to_degrees().rem_euclid(360.0)
    }
}

fn write_some<D: MessageData>(message: Option<D>, output: &mut FrameWriter) {
    if let Some(message) = message {
        output.write(&message);
    }
}

fn millimetres(metres: f64) -> u32 {
    (metres * 1000.0).round() as u32
}

fn millivolts(battery: &Battery) -> u16 {
    (battery.voltage_v * 1000.0).round() as u16
}

fn percent(battery: &Battery) -> i8 {
    (battery.fraction.clamp(0.0, 1.0) * 100.0).round() as i8
}

fn version() -> AUTOPILOT_VERSION_DATA {
    AUTOPILOT_VERSION_DATA {
        capabilities: MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MISSION_INT
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2,
        flight_sw_version: px4::RELEASE,
        ..Default::default()
    }
}
