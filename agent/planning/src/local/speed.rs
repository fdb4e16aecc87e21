//! The speed at which the vector field histogram is flown: speed that follows the scene, and never steps (Xu 2023,
//! speed planning).

use nalgebra::Vector3;

use super::apf::limited;
use super::braking::stopping_speed;

/// The speed planner's numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedConfig {
    /// Speed of the middle phase, m/s.
    pub cruise_m_s: f64,
    /// Way over which the first phase speeds up, metres.
    pub speed_up_m: f64,
    /// Way over which the last phase slows down, metres.
    pub slow_down_m: f64,
    /// `k`: share of the cruising speed wanted at once, so that it does not crawl at the start.
    pub start_share: f64,
    /// `a`: shape of the last phase; speed falls with the remaining way to this power.
    pub slow_down_shape: f64,
    /// Speed beside what is as near as it may be, m/s; the paper flies it as soon as anything is seen.
    pub beside_m_s: f64,
    /// Acceleration that the set-point never exceeds, in any direction, m/s^2. 0.86 is a pitch of 5 degrees.
    pub gentle_m_s2: f64,
    /// Deceleration that slowing down is planned with, m/s^2: what it is less than `gentle_m_s2` is left for turning
    /// meanwhile.
    pub brake_m_s2: f64,
    /// Deceleration that the vehicle is capable of in need, m/s^2.
    pub hard_m_s2: f64,
    /// Time from a thing being there to the vehicle beginning to brake, seconds.
    pub latency_s: f64,
    /// Least distance kept between the vehicle's centre and an obstacle, metres.
    pub clearance_m: f64,
    /// The way is free where nothing is nearer to it than this, metres.
    pub corridor_m: f64,
}

impl SpeedConfig {
    /// The same for another cruising speed: its first and last phases are as long as the same acceleration makes them.
    pub fn cruising_at(self, cruise_m_s: f64) -> SpeedConfig {
        let ratio = cruise_m_s / self.cruise_m_s;
        SpeedConfig {
            cruise_m_s,
            speed_up_m: self.speed_up_m * ratio * ratio,
            slow_down_m: self.slow_down_m * ratio * ratio,
            ..self
        }
    }
}

impl Default for SpeedConfig {
    fn default() -> SpeedConfig {
        SpeedConfig {
            cruise_m_s: 5.0,
            speed_up_m: 20.0,
            slow_down_m: 20.0,
            start_share: 0.3,
            slow_down_shape: 0.8,
            beside_m_s: 0.5,
            gentle_m_s2: 0.5,
            brake_m_s2: 0.35,
            hard_m_s2: 2.5,
            latency_s: 0.3,
            clearance_m: 0.35,
            corridor_m: 0.45,
        }
    }
}

/// The three phases over a leg of which `flown_m` lie behind and `remaining_m` ahead, m/s: from `k v` up to the
/// cruising speed `v` over the first metres, and down over the last by `v (r / d)^a`.
///
/// ```
/// use skein_planning::local::speed::{SpeedConfig, trapezoid};
///
/// let config = SpeedConfig::default();
/// let at = |flown_m: f64| trapezoid(flown_m, 100.0 - flown_m, &config);
/// assert_eq!([at(0.0), at(50.0), at(100.0)], [1.5, 5.0, 0.0]);
/// assert!((at(10.0) - 3.25).abs() < 1e-12);
/// ```
pub fn trapezoid(flown_m: f64, remaining_m: f64, config: &SpeedConfig) -> f64 {
    let share = |way_m: f64, phase_m: f64| (way_m / phase_m).clamp(0.0, 1.0);
    let up = config.start_share + (1.0 - config.start_share) * share(flown_m, config.speed_up_m);
    let down = share(remaining_m, config.slow_down_m).powf(config.slow_down_shape);
    config.cruise_m_s * up.min(down)
}

/// Fastest speed, m/s, at which a vehicle at `place` that goes in the unit direction `ahead` has nothing to fear of
/// the safety [`filter`](crate::separation::filter) for the `obstacles` (ENU, metres; horizontal).
///
/// An obstacle at the distance `d`, the angle `u` off the way, leaves the gap `g = d - clearance`. The vehicle could
/// still stop straight before it, `v cos u <= v_stop(g)`, and its stop along its own way, begun when it may have
/// become faster by `a t`, brings it no nearer than that: `v cos u (t + (v + a t) / 2a) <= g`. The least over all
/// obstacles counts, but never less than [`SpeedConfig::beside_m_s`].
pub fn unhindered_speed(
    place: &Vector3<f64>,
    ahead: &Vector3<f64>,
    obstacles: &[Vector3<f64>],
    config: &SpeedConfig,
) -> f64 {
    let bound = |obstacle: &Vector3<f64>| {
        let offset = (obstacle - place).xy();
        let (along_m, distance_m) = (offset.dot(&ahead.xy()), offset.norm());
        if along_m <= 0.0 {
            return f64::INFINITY;
        }
        let (gap_m, off_way) = (distance_m - config.clearance_m, distance_m / along_m);
        let straight = stopping_speed(gap_m, config.hard_m_s2, config.latency_s) * off_way;
        straight.min(stopping_speed(gap_m * off_way, config.hard_m_s2, 1.5 * config.latency_s))
    };
    obstacles.iter().map(bound).fold(f64::INFINITY, f64::min).max(config.beside_m_s)
}

/// Speed, m/s, from which a vehicle at `place` that goes in the unit direction `ahead` stops gently before the first
/// of the `obstacles` that stands in its way.
pub fn speed_to_stop(
    place: &Vector3<f64>,
    ahead: &Vector3<f64>,
    obstacles: &[Vector3<f64>],
    config: &SpeedConfig,
) -> f64 {
    let free_m = |obstacle: &Vector3<f64>| {
        let offset = (obstacle - place).xy();
        let along_m = offset.dot(&ahead.xy());
        let aside_m = (offset - ahead.xy() * along_m).norm();
        let stands = along_m > 0.0 && aside_m < config.corridor_m;
        if stands { along_m - config.corridor_m } else { f64::INFINITY }
    };
    let free_m = obstacles.iter().map(free_m).fold(f64::INFINITY, f64::min);
    stopping_speed(free_m, config.brake_m_s2, config.latency_s)
}

/// Speed, m/s, from which one slows down gently to `speed_m_s` over `way_m`.
pub fn run_up(speed_m_s: f64, way_m: f64, config: &SpeedConfig) -> f64 {
    let lag = config.brake_m_s2 * config.latency_s;
    let way_m = (way_m - speed_m_s * config.latency_s).max(0.0);
    ((lag * lag + speed_m_s * speed_m_s + 2.0 * config.brake_m_s2 * way_m).sqrt() - lag).max(speed_m_s)
}

/// The next velocity of a set-point that was `previous`, on its way to `wanted`, after `step_s`: it turns and changes
/// its speed by no more than `accel_m_s2`. Slowing down comes first: who turns away from what is ahead has not yet
/// passed it.
pub fn step(previous: &Vector3<f64>, wanted: &Vector3<f64>, step_s: f64, accel_m_s2: f64) -> Vector3<f64> {
    let most = accel_m_s2 * step_s;
    let speed = previous.norm();
    let slower = (speed - wanted.norm()).clamp(0.0, most);
    let slowed = if speed > 0.0 { previous * (1.0 - slower / speed) } else { *previous };
    let turned = slowed + limited(wanted - slowed, (most * most - slower * slower).sqrt());
    previous + limited(turned - previous, most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::separation::{FilterConfig, Motion, filter};
    use proptest::prelude::*;

    #[test]
    fn a_start_does_not_crawl_and_a_short_leg_never_cruises() {
        let config = SpeedConfig::default();
        assert_eq!(trapezoid(0.0, 15.0, &config), 1.5);
        let fastest =
            (0..=15).map(|s| trapezoid(f64::from(s), 15.0 - f64::from(s), &config)).fold(0.0, f64::max);
        assert!(fastest < 3.5, "{fastest}");
    }

    #[test]
    fn another_cruising_speed_is_reached_with_the_same_acceleration() {
        let slow = SpeedConfig::default().cruising_at(1.0);
        assert_eq!((slow.speed_up_m, slow.slow_down_m), (0.8, 0.8));
        assert_eq!(trapezoid(1.0, 5.0, &slow), 1.0);
    }

    #[test]
    fn what_is_further_aside_is_passed_faster() {
        let config = SpeedConfig::default();
        let past = |y: f64| {
            let obstacle = [Vector3::new(1.0, y, 3.0)];
            unhindered_speed(&Vector3::new(0.0, 0.0, 3.0), &Vector3::x(), &obstacle, &config)
        };
        let speeds = [0.0, 0.5, 1.0, 2.0, 4.0].map(past);
        assert!(speeds.windows(2).all(|pair| pair[0] < pair[1]), "{speeds:?}");
        assert!((speeds[0] - stopping_speed(0.65, 2.5, 0.45)).abs() < 1e-12);
        let beside = [Vector3::new(0.1, 0.3, 3.0)];
        let slow = unhindered_speed(&Vector3::new(0.0, 0.0, 3.0), &Vector3::x(), &beside, &config);
        assert_eq!(slow, config.beside_m_s);
    }

    #[test]
    fn what_is_ahead_is_stopped_for_and_what_is_beside_or_behind_is_not() {
        let config = SpeedConfig::default();
        let to_stop = |x: f64, y: f64| {
            let obstacle = [Vector3::new(x, y, 3.0)];
            speed_to_stop(&Vector3::new(0.0, 0.0, 3.0), &Vector3::x(), &obstacle, &config)
        };
        assert_eq!(to_stop(0.4, 0.0), 0.0);
        assert!((to_stop(3.45, 0.1) - stopping_speed(3.0, config.brake_m_s2, 0.3)).abs() < 1e-12);
        assert_eq!([to_stop(-1.0, 0.0), to_stop(2.0, 0.5)], [f64::INFINITY; 2]);
    }

    proptest! {
        /// Driven by the planner alone a vehicle stops before what is in its way.
        #[test]
        fn it_stops_in_time(x in 6.0..12.0_f64, aside in 0.0..0.44_f64) {
            let config = SpeedConfig::default();
            let obstacle = [Vector3::new(x, aside, 0.0)];
            let (mut at, mut v, dt) = (Vector3::zeros(), Vector3::zeros(), 0.02);
            for _ in 0..2000 {
                let cap = speed_to_stop(&at, &Vector3::x(), &obstacle, &config).min(config.cruise_m_s);
                v = step(&v, &(Vector3::x() * cap), dt, config.gentle_m_s2);
                at += v * dt;
            }
            prop_assert!(x - at.x >= config.corridor_m - 0.02, "{at:?}");
            prop_assert!(x - at.x <= config.corridor_m + 0.1, "{at:?}");
        }

        /// The filter lets through what the planner takes to be unhindered.
        #[test]
        fn what_is_unhindered_is_not_filtered(x in -3.0..6.0_f64, y in -4.0..4.0_f64, gap in 0.3..4.0_f64) {
            let config = SpeedConfig::default();
            let obstacle = Vector3::new(x, y, 3.0);
            let beside = Vector3::new(y, x, 0.0).normalize() * (config.clearance_m + gap) + Vector3::z() * 3.0;
            let obstacles = [obstacle, beside];
            let place = Vector3::new(0.0, 0.0, 3.0);
            let speed = unhindered_speed(&place, &Vector3::x(), &obstacles, &config).min(config.cruise_m_s);
            prop_assume!(speed > config.beside_m_s && obstacle.xy().norm() > config.clearance_m);
            let velocity = Vector3::x() * speed;
            let (acceleration, sigma_m) = (Vector3::zeros(), 0.0);
            let motion =
                Motion { position: place, velocity, acceleration, sigma_m, desired: velocity, planar: true };
            let filter_config = FilterConfig {
                obstacle_clearance_m: config.clearance_m,
                max_speed_m_s: config.cruise_m_s,
                decel_m_s2: config.hard_m_s2,
                latency_s: config.latency_s,
                ..FilterConfig::default()
            };
            let filtered = filter(&motion, &[], &obstacles, &filter_config);
            prop_assert!((filtered.velocity - velocity).norm() < 1e-9, "{velocity:?} {filtered:?}");
        }

        #[test]
        fn a_run_up_is_slowed_down_from_gently(speed in 0.2..3.0_f64, way in 0.0..20.0_f64) {
            let config = SpeedConfig::default();
            let from = run_up(speed, way, &config);
            let needed_m = from * config.latency_s + (from * from - speed * speed) / (2.0 * config.brake_m_s2);
            prop_assert!(from >= speed);
            prop_assert!(from == speed || needed_m <= way + 1e-9, "{needed_m} m from {from} m/s");
        }

        /// Half a turn to go does not keep it from slowing down as it would without.
        #[test]
        fn slowing_down_comes_before_turning(speed in 0.5..3.0_f64, slower in 0.0..1.0_f64, turn in -3.1..3.1_f64) {
            let (previous, wanted) = (Vector3::x() * speed, Vector3::new(turn.cos(), turn.sin(), 0.0) * (speed * slower));
            let next = step(&previous, &wanted, 0.02, 0.5);
            let slowest = (speed - 0.01).max(wanted.norm());
            prop_assert!(next.norm() <= slowest + 1e-4, "{next:?} of {previous:?}");
        }

        #[test]
        fn a_set_point_never_steps(from in -4.0..4.0_f64, to in -4.0..4.0_f64, across in -4.0..4.0_f64) {
            let (previous, wanted) = (Vector3::new(from, 0.0, 0.0), Vector3::new(to, across, 0.0));
            let next = step(&previous, &wanted, 0.02, 0.6);
            prop_assert!((next - previous).norm() <= 0.012 + 1e-12);
            prop_assert!((wanted - next).norm() <= (wanted - previous).norm());
        }
    }
}
