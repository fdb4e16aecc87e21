//! The safety filter's answers, one velocity at a time.

use nalgebra::Vector3;
use proptest::prelude::*;
use skein_planning::local::apf::limited;
use skein_planning::separation::{FilterConfig, Motion, Neighbour, Outcome, filter};

fn hovering(desired: Vector3<f64>) -> Motion {
    Motion {
        position: Vector3::new(0.0, 0.0, 3.0),
        velocity: Vector3::zeros(),
        acceleration: Vector3::zeros(),
        sigma_m: 0.0,
        desired,
        planar: true,
    }
}

fn neighbour(position: [f64; 3], age_s: f64) -> Neighbour {
    Neighbour {
        id: 7,
        position: Vector3::from(position),
        velocity: Vector3::zeros(),
        sigma_m: 0.0,
        age_s,
        radius_m: 0.25,
        cooperative: true,
    }
}

#[test]
fn with_nothing_near_the_velocity_is_untouched() {
    let desired = Vector3::new(1.5, -1.0, 0.2);
    let filtered = filter(&hovering(desired), &[], &[], &FilterConfig::default());
    assert_eq!((filtered.velocity, filtered.outcome), (desired, Outcome::Clear));
}

#[test]
fn the_bounds_are_those_of_the_documented_formula() {
    let config = FilterConfig { max_speed_m_s: 10.0, ..FilterConfig::default() };
    let (a, t) = (config.decel_m_s2, config.latency_s);
    let east = hovering(Vector3::new(9.0, 0.0, 0.0));
    let lag = a * t;
    let wall = [Vector3::new(2.45, 0.0, 3.0)];
    let to_wall = filter(&east, &[], &wall, &config).velocity.x;
    assert!((to_wall - ((lag * lag + 2.0 * a * 2.0).sqrt() - lag)).abs() < 1e-9);
    let to_neighbour = filter(&east, &[neighbour([3.2, 0.0, 3.0], 0.0)], &[], &config).velocity.x;
    assert!((to_neighbour - ((lag * lag + a * 2.0).sqrt() - lag)).abs() < 1e-9);
    let braking = to_neighbour * t + to_neighbour * to_neighbour / (2.0 * a);
    assert!((braking - 1.0).abs() < 1e-9, "half of the gap of 2 m is enough to stop in");
}

#[test]
fn too_near_a_neighbour_the_vehicle_leaves() {
    let filtered =
        filter(&hovering(Vector3::x()), &[neighbour([0.9, 0.0, 3.0], 0.0)], &[], &FilterConfig::default());
    assert!(filtered.velocity.x < -0.2, "{filtered:?}");
}

#[test]
fn a_silent_neighbour_is_kept_further_away_the_longer_it_is_silent() {
    let config = FilterConfig::default();
    let speed = |age| {
        filter(&hovering(Vector3::x() * 3.0), &[neighbour([4.0, 0.0, 3.0], age)], &[], &config).velocity.x
    };
    assert!(speed(2.0) > speed(4.0));
    assert!(speed(4.0) > speed(8.0));
    assert!(speed(8.0) < 0.0, "its ghost has reached us");
    assert!((speed(20.0) - speed(60.0)).abs() < 1e-12, "it stops growing");
}

#[test]
fn less_certain_and_larger_neighbours_are_kept_further_away() {
    let config = FilterConfig::default();
    let speed = |neighbour| filter(&hovering(Vector3::x() * 3.0), &[neighbour], &[], &config).velocity.x;
    let sure = neighbour([3.0, 0.0, 3.0], 0.0);
    assert!(speed(Neighbour { sigma_m: 0.5, ..sure }) < speed(sure));
    assert!(speed(Neighbour { radius_m: 0.6, ..sure }) < speed(sure));
}

#[test]
fn downwash_makes_vehicles_taller_than_wide() {
    let config = FilterConfig::default();
    let climb = Motion { planar: false, ..hovering(Vector3::z() * 2.0) };
    let up = filter(&climb, &[neighbour([0.0, 0.0, 5.5], 0.0)], &[], &config).velocity.z;
    let across =
        filter(&hovering(Vector3::x() * 2.0), &[neighbour([2.5, 0.0, 3.0], 0.0)], &[], &config).velocity.x;
    assert!(up < across);
}

#[test]
fn between_a_wall_and_an_intruder_the_wall_does_not_give_way() {
    let config = FilterConfig::default();
    let wall: Vec<_> = (-20..=20).map(|k| Vector3::new(-0.5, f64::from(k) * 0.1, 3.0)).collect();
    let intruders =
        [neighbour([0.8, 0.0, 3.0], 0.0), neighbour([0.5, 0.9, 3.0], 0.0), neighbour([0.5, -0.9, 3.0], 0.0)];
    let filtered = filter(&hovering(-Vector3::x()), &intruders, &wall, &config);
    assert!(
        matches!(filtered.outcome, Outcome::Infeasible { excess_m_s, .. } if excess_m_s > 0.0),
        "{filtered:?}"
    );
    assert!(filtered.velocity.x > -0.11, "no faster towards the wall than it allows: {filtered:?}");
}

#[test]
fn nonsense_in_is_standstill_out() {
    let config = FilterConfig::default();
    let nan = filter(&hovering(Vector3::new(f64::NAN, 0.0, 0.0)), &[], &[], &config);
    assert_eq!((nan.velocity, nan.outcome), (Vector3::zeros(), Outcome::Unsound));
    let lost = filter(&hovering(Vector3::x()), &[neighbour([f64::INFINITY, 0.0, 0.0], 0.0)], &[], &config);
    assert_eq!((lost.velocity, lost.outcome), (Vector3::zeros(), Outcome::Unsound));
    let odd_point = filter(&hovering(Vector3::x()), &[], &[Vector3::new(f64::NAN, 0.0, 0.0)], &config);
    assert_eq!(odd_point.outcome, Outcome::Clear, "a lidar ray without return is no obstacle");
}

/// Where a vehicle is that flies on for the latency and then brakes along its own velocity.
fn braking(
    start: &Vector3<f64>,
    velocity: &Vector3<f64>,
    after_s: f64,
    config: &FilterConfig,
) -> Vector3<f64> {
    let (a, speed) = (config.decel_m_s2, velocity.norm());
    let brakes_s = (after_s - config.latency_s).clamp(0.0, speed / a);
    let straight_s = after_s.min(config.latency_s);
    let braked = if speed > 0.0 { brakes_s - a * brakes_s * brakes_s / (2.0 * speed) } else { 0.0 };
    start + velocity * (straight_s + braked)
}

proptest! {
    #[test]
    fn whatever_the_filter_lets_through_all_can_brake_at_once_and_keep_their_distance(
        places in prop::collection::vec(prop::array::uniform3(-3.0..3.0_f64), 2..6),
        goals in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 6),
    ) {
        let tick_s = 0.1;
        let config = FilterConfig { vertical_stretch: 1.0, latency_s: tick_s, ..FilterConfig::default() };
        let mut places: Vec<Vector3<f64>> = places.into_iter().map(Vector3::from).collect();
        let least_m = |places: &[Vector3<f64>]| places.iter().enumerate()
            .flat_map(|(at, one)| places[..at].iter().map(move |other| (one - other).norm()))
            .fold(f64::INFINITY, f64::min);
        prop_assume!(least_m(&places) >= config.separation_m);
        let mut velocities = vec![Vector3::zeros(); places.len()];
        // They crowd together, as fast as they are let.
        for _ in 0..25 {
            let all: Vec<Neighbour> = places.iter().zip(&velocities).map(|(position, velocity)| Neighbour {
                sigma_m: 0.0, position: *position, velocity: *velocity, ..neighbour([0.0; 3], 0.0)
            }).collect();
            velocities = (0..places.len()).map(|at| {
                let mut others = all.clone();
                others.remove(at);
                let desired = limited((Vector3::from(goals[at]) - places[at]) * 9.0, config.max_speed_m_s);
                let (position, velocity) = (places[at], velocities[at]);
                let motion = Motion { position, velocity, acceleration: Vector3::zeros(), sigma_m: 0.0, desired, planar: false };
                let change = filter(&motion, &others, &[], &config).velocity - velocity;
                velocity + limited(change, config.decel_m_s2 * tick_s)
            }).collect();
            for after in 0..40 {
                let after_s = 0.05 * f64::from(after);
                let braking: Vec<_> = places.iter().zip(&velocities)
                    .map(|(place, velocity)| braking(place, velocity, after_s, &config)).collect();
                let least_m = least_m(&braking);
                prop_assert!(least_m >= config.separation_m - 0.01, "{least_m} m, {after_s} s after");
            }
            for (place, velocity) in places.iter_mut().zip(&velocities) {
                *place += velocity * tick_s;
            }
        }
    }
}

/// How near a vehicle comes to a wall that it sees first at this distance, m, while it flies there at 1.9 m/s and
/// accelerates at 1.7 m/s2, which changes by 5 m/s3 at the most towards what a stiff velocity loop asks for.
fn least_distance_m(wall_m: f64, jerk_m_s3: Option<f64>) -> f64 {
    const STEP_S: f64 = 0.02;
    let config = FilterConfig { jerk_m_s3, decel_m_s2: 2.5, latency_s: 0.5, ..FilterConfig::default() };
    let wall = [Vector3::new(wall_m, 0.0, 3.0)];
    let mut motion = hovering(Vector3::new(3.0, 0.0, 0.0));
    (motion.velocity.x, motion.acceleration.x) = (1.9, 1.7);
    let mut least_m = wall_m;
    for _ in 0..200 {
        let command = filter(&motion, &[], &wall, &config).velocity.x;
        let wanted = ((command - motion.velocity.x) / 0.35).clamp(-2.5, 2.5);
        motion.acceleration.x += (wanted - motion.acceleration.x).clamp(-5.0 * STEP_S, 5.0 * STEP_S);
        motion.velocity += motion.acceleration * STEP_S;
        motion.position += motion.velocity * STEP_S;
        least_m = least_m.min(wall_m - motion.position.x);
    }
    least_m
}

#[test]
fn a_vehicle_that_cannot_cease_to_accelerate_at_once_begins_to_brake_sooner() {
    let clearance_m = FilterConfig::default().obstacle_clearance_m;
    for room_m in [2.6, 3.0, 3.4, 4.0, 6.0] {
        let left_m = |jerk_m_s3| least_distance_m(clearance_m + room_m, jerk_m_s3) - clearance_m;
        assert!(left_m(Some(5.0)) >= 0.0, "{} m left of {room_m} m", left_m(Some(5.0)));
        assert!(room_m != 3.4 || left_m(None) < -0.05, "it makes no difference");
    }
}

#[test]
fn who_is_walked_up_to_gives_way_however_late_it_is_seen() {
    let config = FilterConfig::default();
    for distance_m in [2.0, 1.5, 1.0, 0.7] {
        let comes = Neighbour {
            velocity: Vector3::new(-1.5, 0.0, 0.0),
            cooperative: false,
            ..neighbour([distance_m, 0.0, 3.0], 0.0)
        };
        let filtered = filter(&hovering(Vector3::x()), &[comes], &[], &config);
        assert!(filtered.velocity.x < -0.3, "at {distance_m} m: {filtered:?}");
    }
}

#[test]
fn who_is_squeezed_against_a_pillar_is_not_pushed_into_it() {
    let config = FilterConfig::default();
    let pillar = [Vector3::new(-0.3, 0.0, 3.0)];
    for distance_m in [1.0, 0.8, 0.6] {
        let comes = Neighbour {
            velocity: Vector3::new(-1.5, 0.0, 0.0),
            cooperative: false,
            ..neighbour([distance_m, 0.0, 3.0], 0.0)
        };
        let filtered = filter(&hovering(Vector3::zeros()), &[comes], &pillar, &config);
        assert!(matches!(filtered.outcome, Outcome::Infeasible { .. }), "{filtered:?}");
        assert!(filtered.velocity.x > -0.05, "at {distance_m} m: {filtered:?}");
    }
}
