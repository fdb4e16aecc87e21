//! Speed limits: no faster than one can stop (a correction of Xu 2023).

use crate::path::Path;

/// A vehicle's speeds and how it brakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrakingConfig {
    /// Speed with nothing in the way, m/s.
    pub cruise_m_s: f64,
    /// Never slower than this unless at the goal or with no free space ahead, m/s.
    pub creep_m_s: f64,
    /// Deceleration that can be relied on, m/s2.
    pub decel_m_s2: f64,
    /// Acceleration when speeding up, m/s2.
    pub accel_m_s2: f64,
    /// Time from a thing being there to the vehicle beginning to brake, seconds: sensing, planning,
    /// autopilot.
    pub latency_s: f64,
    /// Distance kept to the end of the sensed free space, metres.
    pub margin_m: f64,
    /// The distance by which a corner may be cut or overshot, metres.
    pub corner_tolerance_m: f64,
}

impl Default for BrakingConfig {
    fn default() -> Self {
        BrakingConfig {
            cruise_m_s: 2.5,
            creep_m_s: 0.3,
            decel_m_s2: 2.0,
            accel_m_s2: 2.0,
            latency_s: 0.5,
            margin_m: 0.6,
            corner_tolerance_m: 0.4,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpeedLimit {
    /// Nothing: cruise.
    Cruise,
    /// The end of the sensed free space.
    Sensed,
    /// A corner ahead.
    Corner,
    /// The end of the path.
    Goal,
}

/// Fastest speed, m/s, from which a vehicle stops within `distance_m` if it brakes with `decel_m_s2` after
/// `latency_s`: `v t + v^2 / 2a = d`. Zero for no distance.
///
/// At 10 m, 0.86 m/s2 (a pitch of 5 degrees) and half a second it is 3.7 m/s, not the 5 m/s of Xu 2023.
///
/// ```
/// let speed = skein_planning::local::braking::stopping_speed(10.0, 0.86, 0.5);
/// assert!((speed - 3.74).abs() < 0.01);
/// ```
pub fn stopping_speed(distance_m: f64, decel_m_s2: f64, latency_s: f64) -> f64 {
    if distance_m.is_nan() || distance_m <= 0.0 {
        return 0.0;
    }
    let lag = decel_m_s2 * latency_s;
    (lag * lag + 2.0 * decel_m_s2 * distance_m).sqrt() - lag
}

/// The speed cap at `station_m` of a path, m/s, and what sets it. `sensed_free_m` is how far ahead the way is
/// known to be free.
///
/// Towards corners and the goal the cap falls as the braking trapezoid `v^2 = v_c^2 + 2 a s` does; a corner
/// is rounded at the radius that stays within the tolerance, with `decel_m_s2` across.
pub fn speed_cap(
    path: &Path,
    station_m: f64,
    sensed_free_m: f64,
    config: &BrakingConfig,
) -> (f64, SpeedLimit) {
    let BrakingConfig { decel_m_s2, latency_s, .. } = *config;
    let mut cap = (config.cruise_m_s, SpeedLimit::Cruise);
    let mut lower = |speed: f64, limit: SpeedLimit| {
        if speed < cap.0 {
            cap = (speed, limit);
        }
    };
    for corner in path.corners().filter(|corner| corner.station_m >= station_m) {
        let through = corner_speed(corner.turn_cos, config).max(config.creep_m_s);
        let run_up = corner.station_m - station_m - through * latency_s;
        let lag = decel_m_s2 * latency_s;
        let before = (lag * lag + through * through + 2.0 * decel_m_s2 * run_up.max(0.0)).sqrt() - lag;
        lower(before.max(through), SpeedLimit::Corner);
    }
    let remaining = path.length_m() - station_m;
    lower(stopping_speed(remaining, decel_m_s2, latency_s), SpeedLimit::Goal);
    lower(sensed_cap(sensed_free_m, config), SpeedLimit::Sensed);
    cap
}

/// Fastest speed, m/s, from which a vehicle stops short of the end of what is known to be free.
pub fn sensed_cap(sensed_free_m: f64, config: &BrakingConfig) -> f64 {
    let free_m = sensed_free_m - config.margin_m;
    let sensed = stopping_speed(free_m, config.decel_m_s2, config.latency_s);
    if free_m > 0.0 { sensed.max(config.creep_m_s.min(free_m)) } else { 0.0 }
}

/// The next speed of a set-point that was `previous_m_s`: down to the cap at once, up to it by the
/// acceleration over `step_s`, and from rest at a share `k = 0.3` of the cap at once, so that it does not
/// crawl (Xu 2023, speed planning).
pub fn ramp(previous_m_s: f64, cap_m_s: f64, step_s: f64, config: &BrakingConfig) -> f64 {
    const START_FLOOR: f64 = 0.3;
    let risen = previous_m_s.max(0.0) + config.accel_m_s2 * step_s;
    cap_m_s.min(risen.max(START_FLOOR * cap_m_s))
}

/// Speed through a corner: `v^2 = a R`, with the radius `R` of the arc that touches both legs and passes the
/// corner at the tolerance `e`: `R = e / (1 / cos(turn / 2) - 1)`.
fn corner_speed(turn_cos: f64, config: &BrakingConfig) -> f64 {
    let half_cos = ((1.0 + turn_cos.clamp(-1.0, 1.0)) / 2.0).sqrt();
    if half_cos >= 1.0 {
        return f64::INFINITY;
    }
    let radius = config.corner_tolerance_m * half_cos / (1.0 - half_cos);
    (config.decel_m_s2 * radius).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use proptest::prelude::*;

    fn path(points: &[[f64; 2]]) -> Path {
        Path::new(points.iter().map(|p| Vector3::new(p[0], p[1], 3.0)).collect()).unwrap()
    }

    proptest! {
        #[test]
        fn what_can_be_stopped_within_is_the_inverse_of_what_is_needed(
            distance in 0.01..60.0_f64, decel in 0.3..6.0_f64, latency in 0.0..1.5_f64,
        ) {
            let speed = stopping_speed(distance, decel, latency);
            let needed = speed * latency + speed * speed / (2.0 * decel);
            prop_assert!((needed - distance).abs() < 1e-9);
        }

        #[test]
        fn a_vehicle_that_keeps_to_the_cap_stops_before_the_unknown(ahead in 2.0..30.0_f64) {
            let config = BrakingConfig::default();
            let path = path(&[[0.0, 0.0], [1000.0, 0.0]]);
            let (mut x, mut v, dt) = (0.0, 0.0, 0.02);
            for _ in 0..3000 {
                let (cap, _) = speed_cap(&path, x, ahead - x, &config);
                let command = ramp(v, cap, dt, &config);
                v += (command - v).clamp(-config.decel_m_s2 * dt, config.decel_m_s2 * dt);
                x += v * dt;
            }
            prop_assert!(x <= ahead - config.margin_m + 0.05, "stopped at {x} of {ahead}");
            prop_assert!(x >= ahead - config.margin_m - 0.4, "stopped early, at {x} of {ahead}");
        }
    }

    #[test]
    fn long_free_legs_are_flown_at_cruise() {
        let config = BrakingConfig::default();
        assert_eq!(
            speed_cap(&path(&[[0.0, 0.0], [50.0, 0.0]]), 10.0, 20.0, &config),
            (2.5, SpeedLimit::Cruise)
        );
    }

    #[test]
    fn sharper_corners_are_slower_and_the_goal_is_a_stop() {
        let config = BrakingConfig::default();
        let right_angle = path(&[[0.0, 0.0], [10.0, 0.0], [10.0, 20.0]]);
        let gentle = path(&[[0.0, 0.0], [10.0, 0.0], [30.0, 4.0]]);
        let (sharp, limit) = speed_cap(&right_angle, 9.9, 20.0, &config);
        assert_eq!(limit, SpeedLimit::Corner);
        assert!(sharp < 1.5, "{sharp}");
        assert_eq!(speed_cap(&gentle, 9.9, 20.0, &config).0, 2.5);
        assert_eq!(speed_cap(&gentle, gentle.length_m(), 20.0, &config), (0.0, SpeedLimit::Goal));
    }

    #[test]
    fn no_sensed_space_is_no_speed() {
        let config = BrakingConfig::default();
        assert_eq!(
            speed_cap(&path(&[[0.0, 0.0], [50.0, 0.0]]), 0.0, 0.5, &config),
            (0.0, SpeedLimit::Sensed)
        );
    }

    #[test]
    fn a_start_does_not_crawl_and_braking_is_not_delayed() {
        let config = BrakingConfig::default();
        assert_eq!(ramp(0.0, 2.5, 0.02, &config), 0.75);
        assert_eq!(ramp(2.5, 0.4, 0.02, &config), 0.4);
        assert!((ramp(1.0, 2.5, 0.02, &config) - 1.04).abs() < 1e-12);
    }
}
