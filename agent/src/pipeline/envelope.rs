//! The envelope in the planners' terms.

use skein_planning::{local::braking::BrakingConfig, separation::FilterConfig};

use crate::config::Envelope;

/// Clearance that the safety filter keeps between hull and obstacles, m: less than paths do, so that it does not
/// fight them.
const OBSTACLE_MARGIN_M: f64 = 0.1;

impl Envelope {
    /// Distance that the safety filter keeps from the vehicle's centre to obstacles, m.
    pub fn obstacle_clearance_m(&self) -> f64 {
        self.hull_m + OBSTACLE_MARGIN_M
    }

    /// The distances that the safety filter keeps.
    pub fn filter(&self) -> FilterConfig {
        FilterConfig {
            separation_m: self.separation_m,
            obstacle_clearance_m: self.obstacle_clearance_m(),
            max_speed_m_s: self.cruise_m_s,
            decel_m_s2: self.brake_m_s2,
            latency_s: self.latency_s,
            jerk_m_s3: self.jerk_m_s3,
            hull_radius_m: self.hull_m,
            ..FilterConfig::default()
        }
    }

    /// The settings of a local planner that brakes and accelerates with `accel_m_s2`.
    pub fn braking(&self, accel_m_s2: f64) -> BrakingConfig {
        BrakingConfig {
            cruise_m_s: self.cruise_m_s,
            decel_m_s2: accel_m_s2,
            accel_m_s2,
            latency_s: self.latency_s,
            ..BrakingConfig::default()
        }
    }
}
