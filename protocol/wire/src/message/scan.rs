//! One turn of a vehicle's lidar, on `scan/<sensor>/<vehicle>`. Only the vehicle's agent listens.

use std::time::Duration;

use skein_bp::Bound;
use skein_dbp::NodeName;

use super::field::{Result, at_most, finite, not_negative, ns};
use super::record::{Addressee, Kind, Record};
use crate::decode_error::DecodeError;
use crate::proto;

/// One turn of a planar lidar in the vehicle's xy plane, with range finders up and down; and of an upright
/// one, in its xz plane, if it has one.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// When it was measured, on the clock of the program that holds it: time since its run began. Between programs it
    /// is the time since 1970, on the clock of the sensor's computer, which the agent's keeps to; the drivers at both
    /// ends convert it.
    pub stamp: Duration,
    /// Angle of the first ray from the vehicle's nose, radians, counter-clockwise.
    pub angle_min: f64,
    /// From one ray to the next, radians.
    pub angle_step: f64,
    /// The lidar sees so far, metres.
    pub max_range_m: f64,
    /// Metres, at most [`Scan::MAX_RAYS`]; infinite where nothing came back.
    pub ranges_m: Vec<f32>,
    /// To what is above, metres; none if nothing is in range.
    pub up_m: Option<f32>,
    /// To what is below, metres; none if nothing is in range.
    pub down_m: Option<f32>,
    /// Of the upright lidar, evenly around: the first ray to the nose, the next above it. Metres, at most
    /// [`Scan::MAX_RAYS`]; infinite where nothing came back, empty without one.
    pub upright_m: Vec<f32>,
}

impl Scan {
    /// A scan has at most so many rays.
    pub const MAX_RAYS: usize = 4096;
}

impl Record for Scan {
    const KIND: Kind =
        Kind { word: "scan", addressee: Addressee::One, every_node_listens: false, bytes: Bound::ScanBytes };

    /// The key alone names the sensor.
    fn sender(&self) -> Option<&NodeName> {
        None
    }
}

impl From<&Scan> for proto::Scan {
    fn from(scan: &Scan) -> Self {
        Self {
            measured_unix_ns: ns(scan.stamp),
            angle_min: scan.angle_min,
            angle_step: scan.angle_step,
            max_range_m: scan.max_range_m,
            ranges_m: scan.ranges_m.clone(),
            up_m: scan.up_m,
            down_m: scan.down_m,
            upright_m: scan.upright_m.clone(),
        }
    }
}

impl TryFrom<proto::Scan> for Scan {
    type Error = DecodeError;

    fn try_from(scan: proto::Scan) -> Result<Self> {
        at_most("Scan.ranges_m", scan.ranges_m.len(), Self::MAX_RAYS, "at most 4096 rays")?;
        at_most("Scan.upright_m", scan.upright_m.len(), Self::MAX_RAYS, "at most 4096 rays")?;
        let range = |field, given: Option<f32>| match given {
            Some(given) => not_negative(field, f64::from(given)).map(|_| Some(given)),
            None => Ok(None),
        };
        Ok(Self {
            stamp: Duration::from_nanos(scan.measured_unix_ns),
            angle_min: finite("Scan.angle_min", scan.angle_min)?,
            angle_step: finite("Scan.angle_step", scan.angle_step)?,
            max_range_m: not_negative("Scan.max_range_m", scan.max_range_m)?,
            ranges_m: scan.ranges_m,
            up_m: range("Scan.up_m", scan.up_m)?,
            down_m: range("Scan.down_m", scan.down_m)?,
            upright_m: scan.upright_m,
        })
    }
}
