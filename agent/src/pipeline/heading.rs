//! Where the nose points.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;
use skein_mav::SetPoint;

use super::local::TICK_S;
use crate::config::Nose;

/// A vehicle slower than this keeps its nose where it is, m/s: so slow a velocity points anywhere.
const LEAST_SPEED_M_S: f64 = 0.5;
/// The nose turns no faster than this, rad/s: what a lidar sees meanwhile is placed by a heading that is a little old.
const TURN_RAD_S: f64 = 0.8;

/// Gives each set-point a heading.
#[derive(Clone, Copy, Debug)]
pub struct Heading {
    nose: Nose,
    /// The heading commanded last, radians counter-clockwise from east.
    commanded: Option<f64>,
}

impl Heading {
    /// Points the nose as configured.
    pub fn new(nose: Nose) -> Self {
        Self { nose, commanded: None }
    }

    /// Somebody else turns the vehicle, or nobody.
    pub fn rest(&mut self) {
        self.commanded = None;
    }

    /// The set-point with a heading: it turns along the velocity, or stays what it was when the vehicle, whose nose
    /// points to `yaw` now, was first commanded. Without a known heading none is commanded.
    #[must_use]
    pub fn give(&mut self, set_point: SetPoint, yaw: Option<f64>) -> SetPoint {
        let Some(before) = self.commanded.or(yaw) else { return set_point };
        let along = along(&set_point).filter(|_| self.nose == Nose::Along);
        let turn = along.map_or(0.0, |along| wrapped(along - before));
        let most = TURN_RAD_S * TICK_S;
        let commanded = wrapped(before + turn.clamp(-most, most));
        self.commanded = Some(commanded);
        with_yaw(set_point, commanded)
    }
}

/// The heading of a set-point's velocity, if that has one.
fn along(set_point: &SetPoint) -> Option<f64> {
    let velocity = match *set_point {
        SetPoint::Planar { vx, vy, .. } => Vector3::new(vx, vy, 0.0),
        SetPoint::Velocity { velocity, .. } => velocity,
        SetPoint::Position { .. } => return None,
    };
    (velocity.xy().norm() >= LEAST_SPEED_M_S).then(|| velocity.y.atan2(velocity.x))
}

fn with_yaw(set_point: SetPoint, yaw: f64) -> SetPoint {
    let yaw = Some(yaw);
    match set_point {
        SetPoint::Planar { vx, vy, z, .. } => SetPoint::Planar { vx, vy, z, yaw },
        SetPoint::Velocity { velocity, .. } => SetPoint::Velocity { velocity, yaw },
        SetPoint::Position { position, .. } => SetPoint::Position { position, yaw },
    }
}

/// The same angle in `[-pi, pi)`.
fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flies(bearing: f64, speed_m_s: f64) -> SetPoint {
        SetPoint::Planar { vx: speed_m_s * bearing.cos(), vy: speed_m_s * bearing.sin(), z: 3.0, yaw: None }
    }

    /// The headings that are commanded, one a tick, to a vehicle whose nose pointed to `yaw` at first.
    fn commanded(nose: Nose, yaw: f64, set_point: SetPoint) -> Vec<f64> {
        let mut heading = Heading::new(nose);
        (0..500).filter_map(|_| heading.give(set_point, Some(yaw)).yaw()).collect()
    }

    #[test]
    fn the_nose_turns_along_the_way_by_the_shorter_turn_and_no_faster_than_it_may() {
        let turns = commanded(Nose::Along, 3.0, flies(-3.0, 2.0));
        assert!((turns[0] - 3.016).abs() < 1e-9, "{}", turns[0]);
        assert!((turns[499] + 3.0).abs() < 1e-9, "{}", turns[499]);
        assert!(turns.windows(2).all(|pair| wrapped(pair[1] - pair[0]).abs() < TURN_RAD_S * TICK_S + 1e-9));
    }

    #[test]
    fn a_nose_that_is_held_and_one_of_a_slow_vehicle_stay_where_they_were() {
        assert_eq!(commanded(Nose::Held, 1.0, flies(2.0, 2.0)), vec![1.0; 500]);
        assert_eq!(commanded(Nose::Along, 1.0, flies(2.0, 0.4)), vec![1.0; 500]);
    }

    #[test]
    fn without_a_known_heading_none_is_commanded() {
        assert_eq!(Heading::new(Nose::Along).give(flies(2.0, 2.0), None).yaw(), None);
    }
}
