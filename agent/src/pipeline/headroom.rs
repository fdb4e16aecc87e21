//! Headroom: a vehicle climbs and sinks no faster than it can stop below and above what its range finders
//! see. The lidar sees neither a roof nor a bridge's deck from below or above.

use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::SetPoint;

use crate::config::Envelope;

/// Deceleration of a climb or a descent, m/s².
const BRAKE_M_S2: f64 = 1.5;

/// The newest look of the vehicle's range finders, on the ground too.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    pub stamp: Duration,
    /// To what is above, m; none if nothing is in range.
    pub up_m: Option<f64>,
    /// To what is below, m; none if nothing is in range.
    pub down_m: Option<f64>,
}

/// The room that the hull has to climb and to sink, m; negative if it is too near already.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Headroom {
    up_m: f64,
    down_m: f64,
    latency_s: f64,
}

impl Headroom {
    /// Nothing is in the way.
    pub const OPEN: Self = Self { up_m: f64::INFINITY, down_m: f64::INFINITY, latency_s: 0.0 };

    /// The room that a vehicle of this envelope sees.
    pub fn of(look: &Look, envelope: &Envelope) -> Self {
        let room_m =
            |seen_m: Option<f64>, kept_m: f64| seen_m.map_or(f64::INFINITY, |seen_m| seen_m - kept_m);
        Self {
            up_m: room_m(look.up_m, envelope.hull_m + envelope.margin_m),
            down_m: room_m(look.down_m, envelope.hull_m),
            latency_s: envelope.latency_s,
        }
    }

    /// The set-point with no more climb or descent than there is room for.
    pub fn keep(&self, set_point: SetPoint, position: &Vector3<f64>) -> SetPoint {
        let [down_m, up_m] = [self.down_m.max(0.0), self.up_m.max(0.0)];
        match set_point {
            SetPoint::Planar { vx, vy, z, yaw } => {
                SetPoint::Planar { vx, vy, z: z.clamp(position.z - down_m, position.z + up_m), yaw }
            }
            SetPoint::Velocity { velocity, yaw } => {
                let climb = velocity.z.clamp(-self.fastest(down_m), self.fastest(up_m));
                SetPoint::Velocity { velocity: velocity.xy().push(climb), yaw }
            }
            SetPoint::Position { .. } => set_point,
        }
    }

    /// The speed from which it stops within this room, m/s.
    fn fastest(&self, room_m: f64) -> f64 {
        if room_m.is_infinite() {
            return f64::INFINITY;
        }
        BRAKE_M_S2 * ((self.latency_s.powi(2) + 2.0 * room_m / BRAKE_M_S2).sqrt() - self.latency_s)
    }

    /// Whether the room ends before a place that is so much higher, or lower if that is negative, m.
    pub fn ends_before(&self, climb_m: f64) -> bool {
        if climb_m >= 0.0 { self.up_m < climb_m } else { self.down_m < -climb_m }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: Vector3<f64> = Vector3::new(1.0, 2.0, 3.0);

    /// The room with a roof and a floor at these distances.
    fn between(up_m: Option<f64>, down_m: Option<f64>) -> Headroom {
        Headroom::of(&Look { stamp: Duration::ZERO, up_m, down_m }, &Envelope::default())
    }

    fn climb(headroom: Headroom, wanted_m_s: f64) -> f64 {
        let wanted = SetPoint::Velocity { velocity: Vector3::new(1.0, 0.0, wanted_m_s), yaw: None };
        match headroom.keep(wanted, &HERE) {
            SetPoint::Velocity { velocity, .. } => velocity.z,
            other => panic!("{other:?}"),
        }
    }

    fn height(headroom: Headroom, wanted_m: f64) -> f64 {
        match headroom.keep(SetPoint::Planar { vx: 1.0, vy: 0.0, z: wanted_m, yaw: None }, &HERE) {
            SetPoint::Planar { z, .. } => z,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn in_the_open_nothing_changes() {
        assert_eq!((climb(Headroom::OPEN, 1.5), height(Headroom::OPEN, 9.0)), (1.5, 9.0));
        assert_eq!(climb(between(Some(9.0), Some(9.0)), -1.5), -1.5);
    }

    #[test]
    fn it_climbs_and_sinks_so_that_it_stops_in_time() {
        let Envelope { hull_m, margin_m, latency_s, .. } = Envelope::default();
        for room_m in [0.1, 0.3, 1.0] {
            let up = climb(between(Some(room_m + hull_m + margin_m), None), 9.0);
            let stop_m = up * latency_s + up * up / (2.0 * BRAKE_M_S2);
            assert!((stop_m - room_m).abs() < 1e-9, "{stop_m} of {room_m}");
            assert!((climb(between(None, Some(room_m + hull_m)), -9.0) + up).abs() < 1e-9);
        }
        assert_eq!(climb(between(Some(0.3), Some(0.2)), 1.0), 0.0, "too near already");
        assert_eq!(climb(between(Some(0.3), Some(0.2)), -1.0), 0.0);
        assert!((height(between(Some(1.5), None), 9.0) - 4.0).abs() < 1e-9);
        assert!((height(between(None, Some(1.25)), 0.0) - 2.0).abs() < 1e-9);
    }

    #[test]
    fn the_room_ends_before_what_is_beyond_the_roof_or_the_floor() {
        let headroom = between(Some(2.5), Some(1.25));
        assert!(headroom.ends_before(2.1) && !headroom.ends_before(1.9));
        assert!(headroom.ends_before(-1.1) && !headroom.ends_before(-0.9));
        assert!(!Headroom::OPEN.ends_before(100.0));
    }
}
