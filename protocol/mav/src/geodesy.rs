//! Geodesy: latitude, longitude and height on the WGS-84 ellipsoid, and the metres of the world around a
//! datum.

use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::axes;

/// Semi-major axis of the WGS-84 ellipsoid, metres.
const SEMI_MAJOR_M: f64 = 6_378_137.0;
/// Flattening of the WGS-84 ellipsoid.
const FLATTENING: f64 = 1.0 / 298.257_223_563;
/// First eccentricity squared.
const ECCENTRICITY_2: f64 = FLATTENING * (2.0 - FLATTENING);

/// A place on Earth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Geodetic {
    /// Latitude, radians, north positive.
    pub latitude_rad: f64,
    /// Longitude, radians, east positive.
    pub longitude_rad: f64,
    /// Height, metres, up positive. Whatever vertical reference the autopilots report (mean sea level for
    /// PX4 and ArduPilot) serves, as long as all of them and the [`Datum`] share it.
    pub height_m: f64,
}

impl Geodetic {
    /// From MAVLink's integers: 1e-7 degrees and millimetres.
    pub fn from_e7(latitude_e7: i32, longitude_e7: i32, height_mm: i32) -> Self {
        Self {
            latitude_rad: (f64::from(latitude_e7) * 1e-7).to_radians(),
            longitude_rad: (f64::from(longitude_e7) * 1e-7).to_radians(),
            height_m: f64::from(height_mm) * 1e-3,
        }
    }

    /// Latitude in MAVLink's 1e-7 degrees.
    pub fn latitude_e7(&self) -> i32 {
        (self.latitude_rad.to_degrees() * 1e7).round() as i32
    }

    /// Longitude in MAVLink's 1e-7 degrees.
    pub fn longitude_e7(&self) -> i32 {
        (self.longitude_rad.to_degrees() * 1e7).round() as i32
    }

    /// Height in MAVLink's millimetres.
    pub fn height_mm(&self) -> i32 {
        (self.height_m * 1e3).round() as i32
    }

    /// Earth-centred, Earth-fixed coordinates, metres.
    pub fn to_ecef(&self) -> Vector3<f64> {
        let (sin_lat, cos_lat) = self.latitude_rad.sin_cos();
        let (sin_lon, cos_lon) = self.longitude_rad.sin_cos();
        let normal = SEMI_MAJOR_M / (1.0 - ECCENTRICITY_2 * sin_lat * sin_lat).sqrt();
        Vector3::new(
            (normal + self.height_m) * cos_lat * cos_lon,
            (normal + self.height_m) * cos_lat * sin_lon,
            (normal * (1.0 - ECCENTRICITY_2) + self.height_m) * sin_lat,
        )
    }

    /// The place with these Earth-centred coordinates (metres), by fixed-point iteration on the latitude;
    /// to well under a millimetre anywhere an aircraft flies.
    pub fn from_ecef(ecef: &Vector3<f64>) -> Self {
        let from_axis = ecef.x.hypot(ecef.y);
        let mut latitude = ecef.z.atan2(from_axis * (1.0 - ECCENTRICITY_2));
        let mut height = 0.0;
        for _ in 0..6 {
            let (sin_lat, cos_lat) = latitude.sin_cos();
            let normal = SEMI_MAJOR_M / (1.0 - ECCENTRICITY_2 * sin_lat * sin_lat).sqrt();
            // Projecting on the ellipsoid's normal stays accurate at the poles, where 1 / cos does not.
            height = from_axis * cos_lat + ecef.z * sin_lat - SEMI_MAJOR_M * SEMI_MAJOR_M / normal;
            let shrink = 1.0 - ECCENTRICITY_2 * normal / (normal + height);
            latitude = ecef.z.atan2(from_axis * shrink);
        }
        Self { latitude_rad: latitude, longitude_rad: ecef.y.atan2(ecef.x), height_m: height }
    }

    /// Rotation from the local east-north-up axes at this place to Earth-centred axes.
    fn enu_to_ecef(&self) -> Rotation3<f64> {
        let (sin_lat, cos_lat) = self.latitude_rad.sin_cos();
        let (sin_lon, cos_lon) = self.longitude_rad.sin_cos();
        Rotation3::from_matrix_unchecked(Matrix3::new(
            -sin_lon,
            -sin_lat * cos_lon,
            cos_lat * cos_lon, //
            cos_lon,
            -sin_lat * sin_lon,
            cos_lat * sin_lon, //
            0.0,
            cos_lat,
            sin_lat,
        ))
    }
}

/// The agreed origin of the world's east-north-up frame: the plane that touches the ellipsoid there.
///
/// ```
/// use nalgebra::Vector3;
/// use skein_mav::Datum;
///
/// let datum = Datum::from_degrees(47.397742, 8.545594, 488.0);
/// let place = datum.to_geodetic(&Vector3::new(100.0, 50.0, 3.0));
/// assert!((datum.to_enu(&place) - Vector3::new(100.0, 50.0, 3.0)).norm() < 1e-6);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Datum {
    /// Latitude, radians, north positive.
    pub latitude_rad: f64,
    /// Longitude, radians, east positive.
    pub longitude_rad: f64,
    /// Height, metres; see [`Geodetic::height_m`].
    pub height_m: f64,
}

impl Datum {
    /// A datum from degrees and metres.
    pub fn from_degrees(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> Self {
        Self { latitude_rad: latitude_deg.to_radians(), longitude_rad: longitude_deg.to_radians(), height_m }
    }

    /// The datum as a place.
    pub fn place(&self) -> Geodetic {
        Geodetic {
            latitude_rad: self.latitude_rad,
            longitude_rad: self.longitude_rad,
            height_m: self.height_m,
        }
    }

    /// World position (ENU, metres) of a place.
    pub fn to_enu(&self, place: &Geodetic) -> Vector3<f64> {
        let origin = self.place();
        origin.enu_to_ecef().inverse() * (place.to_ecef() - origin.to_ecef())
    }

    /// The place at a world position (ENU, metres).
    pub fn to_geodetic(&self, enu: &Vector3<f64>) -> Geodetic {
        let origin = self.place();
        Geodetic::from_ecef(&(origin.to_ecef() + origin.enu_to_ecef() * enu))
    }
}

/// An autopilot's local frame, north-east-down about its own origin, seen from the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalFrame {
    origin: Vector3<f64>,
    /// Local ENU to world ENU: the Earth curves between the two origins.
    rotation: Rotation3<f64>,
}

impl LocalFrame {
    /// The local frame whose origin is at `origin`, for a world with this datum.
    pub fn new(datum: &Datum, origin: &Geodetic) -> Self {
        Self {
            origin: datum.to_enu(origin),
            rotation: datum.place().enu_to_ecef().inverse() * origin.enu_to_ecef(),
        }
    }

    /// World position (ENU) of a local position (NED), metres.
    pub fn position_to_world(&self, ned: &Vector3<f64>) -> Vector3<f64> {
        self.origin + self.rotation * axes::ned_to_enu(ned)
    }

    /// Local position (NED) of a world position (ENU), metres.
    pub fn position_to_local(&self, enu: &Vector3<f64>) -> Vector3<f64> {
        axes::enu_to_ned(&(self.rotation.inverse() * (enu - self.origin)))
    }
}
