//! The Earth's magnetic field.

use nalgebra::Vector3;
use skein_mav::{Datum, axes};
use world_magnetic_model::GeomagneticField;
use world_magnetic_model::time::Date;
use world_magnetic_model::uom::si::{
    angle::radian, f32::Angle, f32::Length, length::meter, magnetic_flux_density::tesla,
};

/// Gauss in a tesla.
const GAUSS: f64 = 1e4;
/// The day for which the model is asked; autopilots have tables that are some years old.
const DAY: (i32, u16) = (2025, 1);

/// The field at the datum, world ENU, gauss, by the World Magnetic Model.
pub(super) fn field(datum: &Datum) -> anyhow::Result<Vector3<f64>> {
    let place = datum.place();
    let field = GeomagneticField::new(
        Length::new::<meter>(place.height_m as f32),
        Angle::new::<radian>(place.latitude_rad as f32),
        Angle::new::<radian>(place.longitude_rad as f32),
        Date::from_ordinal_date(DAY.0, DAY.1)?,
    )
    .map_err(|error| anyhow::anyhow!("the magnetic field at the world's datum: {error:?}"))?;
    let ned = [field.x(), field.y(), field.z()].map(|part| f64::from(part.get::<tesla>()) * GAUSS);
    Ok(axes::ned_to_enu(&ned.into()))
}
