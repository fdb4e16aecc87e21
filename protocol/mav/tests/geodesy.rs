//! The conversions between the world and the Earth, and between the world's axes and MAVLink's.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;
use skein_mav::{Datum, Geodetic, LocalFrame, axes};

fn near(a: &Vector3<f64>, b: &Vector3<f64>, tolerance: f64) -> bool {
    (a - b).norm() < tolerance
}

fn place(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> Geodetic {
    Datum::from_degrees(latitude_deg, longitude_deg, height_m).place()
}

#[test]
fn the_ellipsoid_has_its_known_axes() {
    assert!(near(&place(0.0, 0.0, 0.0).to_ecef(), &Vector3::new(6_378_137.0, 0.0, 0.0), 1e-6));
    assert!(near(&place(0.0, 90.0, 10.0).to_ecef(), &Vector3::new(0.0, 6_378_147.0, 0.0), 1e-6));
    let pole = place(90.0, 0.0, 0.0).to_ecef();
    assert!(near(&pole, &Vector3::new(0.0, 0.0, 6_356_752.314_245), 1e-5));
}

#[test]
fn a_degree_is_as_long_as_the_tables_say() {
    // Meridian and parallel at 45 degrees: 111 131.7 m and 78 846.8 m a degree (WGS-84).
    let datum = Datum::from_degrees(45.0, 7.0, 0.0);
    let north = datum.to_enu(&place(45.000_05, 7.0, 0.0)) - datum.to_enu(&place(44.999_95, 7.0, 0.0));
    assert!((north.y * 1e4 - 111_131.7).abs() < 1.0, "{north}");
    let east = datum.to_enu(&place(45.0, 7.000_05, 0.0)) - datum.to_enu(&place(45.0, 6.999_95, 0.0));
    assert!((east.x * 1e4 - 78_846.8).abs() < 1.0, "{east}");
}

#[test]
fn up_is_up_and_the_earth_curves_down() {
    let datum = Datum::from_degrees(47.4, 8.5, 488.0);
    let above = datum.to_enu(&place(47.4, 8.5, 500.0));
    assert!(near(&above, &Vector3::new(0.0, 0.0, 12.0), 1e-6));
    // A kilometre away the ellipsoid has fallen by d^2 / 2R, about 8 cm.
    let away = datum.to_geodetic(&Vector3::new(0.0, 1000.0, 0.0));
    assert!((away.height_m - 488.0 - 0.0785).abs() < 0.002, "{}", away.height_m);
}

#[test]
fn attitudes_and_headings_agree_in_both_conventions() {
    // Level, nose to the north: yaw 90 degrees in ENU, no rotation at all in NED.
    let nose_north = UnitQuaternion::from_euler_angles(0.0, 0.0, FRAC_PI_2);
    assert!(axes::attitude_to_ned(&nose_north).angle() < 1e-12);
    assert!((axes::swap_yaw(FRAC_PI_2)).abs() < 1e-12);
    assert!((axes::swap_yaw(0.0) - FRAC_PI_2).abs() < 1e-12, "east is 90 degrees clockwise from north");
    // Nose up in NED is a positive pitch, and lifts the nose in ENU as well.
    let nose_up = axes::attitude_from_ned(&UnitQuaternion::from_euler_angles(0.0, 0.3, 0.0));
    let nose = nose_up * Vector3::x();
    assert!(near(&nose, &Vector3::new(0.0, 0.3_f64.cos(), 0.3_f64.sin()), 1e-12));
    // Right wing down in NED is a positive roll; the left wing then points up.
    let right_down = axes::attitude_from_ned(&UnitQuaternion::from_euler_angles(0.2, 0.0, FRAC_PI_4));
    assert!((right_down * Vector3::y()).z > 0.19);
}

proptest! {
    #[test]
    fn a_position_goes_to_the_earth_and_back(
        latitude in -89.0..89.0_f64, longitude in -180.0..180.0_f64, height in -100.0..5000.0_f64,
        x in -5000.0..5000.0_f64, y in -5000.0..5000.0_f64, z in -100.0..1000.0_f64,
    ) {
        let datum = Datum::from_degrees(latitude, longitude, height);
        let position = Vector3::new(x, y, z);
        prop_assert!(near(&datum.to_enu(&datum.to_geodetic(&position)), &position, 1e-6));
    }

    #[test]
    fn integers_of_mavlink_come_back(lat in -900_000_000..900_000_000_i32, lon: i32, mm in -1_000_000..9_000_000_i32) {
        let lon = lon % 1_800_000_000;
        let place = Geodetic::from_e7(lat, lon, mm);
        prop_assert_eq!((place.latitude_e7(), place.longitude_e7(), place.height_mm()), (lat, lon, mm));
    }

    #[test]
    fn a_local_frame_about_another_origin_agrees_with_the_earth(
        origin_x in -2000.0..2000.0_f64, origin_y in -2000.0..2000.0_f64,
        x in -500.0..500.0_f64, y in -500.0..500.0_f64, z in 0.0..100.0_f64,
    ) {
        let datum = Datum::from_degrees(47.4, 8.5, 488.0);
        let origin = datum.to_geodetic(&Vector3::new(origin_x, origin_y, 3.0));
        let local = LocalFrame::new(&datum, &origin);
        let position = Vector3::new(x, y, z);
        let ned = local.position_to_local(&position);
        prop_assert!(near(&local.position_to_world(&ned), &position, 1e-6));
        // Seen from the origin's own tangent plane, it is the same place on Earth.
        let own = Datum { latitude_rad: origin.latitude_rad, longitude_rad: origin.longitude_rad, height_m: origin.height_m };
        prop_assert!(near(&own.to_enu(&datum.to_geodetic(&position)), &axes::ned_to_enu(&ned), 1e-6));
    }

    #[test]
    fn rotations_and_vectors_are_converted_alike(
        roll in -PI..PI, pitch in -1.5..1.5_f64, yaw in -PI..PI,
        v in prop::array::uniform3(-10.0..10.0_f64),
    ) {
        let attitude = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let v = Vector3::from(v);
        let in_ned = axes::attitude_to_ned(&attitude) * axes::flu_to_frd(&v);
        prop_assert!(near(&in_ned, &axes::enu_to_ned(&(attitude * v)), 1e-9));
        prop_assert!(axes::attitude_from_ned(&axes::attitude_to_ned(&attitude)).angle_to(&attitude) < 1e-7);
    }

    #[test]
    fn angles_wrap_into_one_turn(angle in -100.0..100.0_f64) {
        let wrapped = axes::wrap_angle(angle);
        prop_assert!(wrapped > -PI - 1e-12 && wrapped <= PI);
        prop_assert!((wrapped.sin() - angle.sin()).abs() < 1e-9);
    }
}
