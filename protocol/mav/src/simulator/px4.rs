//! PX4's hardware in the loop: one `HIL_SENSOR` a step, answered by one `HIL_ACTUATOR_CONTROLS` with the same time.

use std::time::Duration;

use mavlink::dialects::common::{
    HIL_GPS_DATA, HIL_SENSOR_DATA, HilSensorUpdatedFlags, MavMessage, MavModeFlag,
};
use nalgebra::Vector3;

use super::Instruments;
use crate::address::Address;
use crate::axes;
use crate::frame::{FrameReader, FrameWriter};
use crate::geodesy::Datum;

/// PX4's clock is never at 0.
const BEFORE_THE_RUN: Duration = Duration::from_secs(1);
/// Air pressure at sea level, hPa, and how it falls with height (ICAO standard atmosphere).
const SEA_LEVEL_HPA: f64 = 1013.25;
const LAPSE_PER_M: f64 = 2.255_77e-5;
const LAPSE_EXPONENT: f64 = 5.255_88;
const TEMPERATURE_C: f32 = 15.0;
/// The quality of a good receiver's fixes.
const FIX_3D: u8 = 3;
const SATELLITES: u8 = 14;
/// Dilution of precision, in hundredths.
const DILUTION: u16 = 80;

/// The simulator's end of one PX4.
#[derive(Debug, Clone)]
pub struct Px4Link {
    datum: Datum,
    reader: FrameReader,
    writer: FrameWriter,
    /// The last readings of instruments that have nothing new.
    magnetic_field: Vector3<f64>,
    pressure_height_m: f64,
}

/// PX4's answer to one step's readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Px4Commands {
    /// The time of the readings that it answers, since the run began.
    pub at: Duration,
    /// Shares of full thrust: front-right, rear-left, front-left, rear-right. All 0 unless it is armed.
    pub motors: [f64; 4],
}

impl Px4Link {
    /// A link in a world about this datum.
    pub fn new(datum: Datum) -> Self {
        Self {
            datum,
            reader: FrameReader::default(),
            writer: FrameWriter::new(Address { system_id: 1, component_id: 200 }),
            magnetic_field: Vector3::zeros(),
            pressure_height_m: 0.0,
        }
    }

    /// Tells what the instruments read `now`, since the run began.
    pub fn sense(&mut self, now: Duration, read: &Instruments) {
        let time_usec = (now + BEFORE_THE_RUN).as_micros() as u64;
        use HilSensorUpdatedFlags as New;
        let mut fields_updated = New::HIL_SENSOR_UPDATED_XACC
            | New::HIL_SENSOR_UPDATED_YACC
            | New::HIL_SENSOR_UPDATED_ZACC
            | New::HIL_SENSOR_UPDATED_XGYRO
            | New::HIL_SENSOR_UPDATED_YGYRO
            | New::HIL_SENSOR_UPDATED_ZGYRO;
        if let Some(field) = read.magnetic_field {
            self.magnetic_field = field;
            fields_updated |=
                New::HIL_SENSOR_UPDATED_XMAG | New::HIL_SENSOR_UPDATED_YMAG | New::HIL_SENSOR_UPDATED_ZMAG;
        }
        if let Some(height_m) = read.pressure_height_m {
            self.pressure_height_m = self.datum.place().height_m + height_m;
            fields_updated |= New::HIL_SENSOR_UPDATED_ABS_PRESSURE
                | New::HIL_SENSOR_UPDATED_PRESSURE_ALT
                | New::HIL_SENSOR_UPDATED_TEMPERATURE;
        }
        let [force, rate, field] = [&read.specific_force, &read.angular_rate, &self.magnetic_field]
            .map(|vector| axes::flu_to_frd(vector).map(|part| part as f32));
        let pressure = SEA_LEVEL_HPA * (1.0 - LAPSE_PER_M * self.pressure_height_m).powf(LAPSE_EXPONENT);
        self.writer.write(&HIL_SENSOR_DATA {
            time_usec,
            xacc: force.x,
            yacc: force.y,
            zacc: force.z,
            xgyro: rate.x,
            ygyro: rate.y,
            zgyro: rate.z,
            xmag: field.x,
            ymag: field.y,
            zmag: field.z,
            abs_pressure: pressure as f32,
            diff_pressure: 0.0,
            pressure_alt: self.pressure_height_m as f32,
            temperature: TEMPERATURE_C,
            fields_updated,
            ..Default::default()
        });
        if let Some([position, velocity]) = &read.satellite {
            self.fix(time_usec, position, velocity);
        }
    }

    fn fix(&mut self, time_usec: u64, position: &Vector3<f64>, velocity: &Vector3<f64>) {
        let place = self.datum.to_geodetic(position);
        let ned = axes::enu_to_ned(velocity) * 100.0;
        let [vn, ve, vd] = [ned.x, ned.y, ned.z].map(|part| part.round() as i16);
        let course = ned.y.atan2(ned.x).to_degrees().rem_euclid(360.0) * 100.0;
        self.writer.write(&HIL_GPS_DATA {
            time_usec,
            lat: place.latitude_e7(),
            lon: place.longitude_e7(),
            alt: place.height_mm(),
            eph: DILUTION,
            epv: DILUTION,
            vel: ned.xy().norm().round() as u16,
            vn,
            ve,
            vd,
            cog: course.round() as u16 % 36_000,
            fix_type: FIX_3D,
            satellites_visible: SATELLITES,
            ..Default::default()
        });
    }

    /// Takes in bytes from PX4, in whatever pieces they came.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.reader.push(bytes);
    }

    /// Takes the bytes that are for PX4.
    pub fn take_output(&mut self) -> Vec<u8> {
        self.writer.take()
    }

    /// The next answer that has come; what else PX4 says on this link is left alone.
    pub fn next_commands(&mut self) -> Option<Px4Commands> {
        while let Some(frame) = self.reader.next_frame() {
            if let MavMessage::HIL_ACTUATOR_CONTROLS(answer) = frame.message {
                let armed = answer.mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED);
                let [a, b, c, d, ..] = answer.controls;
                let share = |control: f32| {
                    if armed && control.is_finite() { f64::from(control).clamp(0.0, 1.0) } else { 0.0 }
                };
                return Some(Px4Commands {
                    at: Duration::from_micros(answer.time_usec).saturating_sub(BEFORE_THE_RUN),
                    motors: [a, b, c, d].map(share),
                });
            }
        }
        None
    }
}
