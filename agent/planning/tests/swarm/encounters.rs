//! The safety filter under lag, delay and position errors: distances are kept whatever the planners want.

use super::kinematics::{Flight, Swarm, Vehicle, uniform};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// What lag and noise may take of the separation of 1.2 m.
const SEPARATION_M: f64 = 1.05;
/// The hull, from obstacle points.
const HULL_M: f64 = 0.25;

fn place(rng: &mut ChaCha8Rng, half_m: f64, taken: &[Vehicle], obstacles: &[Vector3<f64>]) -> Vector3<f64> {
    loop {
        let place = Vector3::new(
            uniform(rng, -half_m, half_m),
            uniform(rng, -half_m, half_m),
            uniform(rng, 2.5, 3.5),
        );
        let clear = |other: &Vector3<f64>| (place - other).xy().norm() > 1.8;
        if taken.iter().all(|other| clear(&other.position)) && obstacles.iter().all(clear) {
            return place;
        }
    }
}

/// How vehicles hear one another.
struct Hearing {
    /// Share of broadcasts that reach nobody.
    loss: f64,
    /// Ticks of 20 ms that a broadcast takes.
    delay_ticks: u32,
}

fn chaos(count: usize, half_m: f64, planar: bool, posts: usize, loss: f64, seed: u64) -> Flight {
    chaos_heard(count, half_m, planar, posts, Hearing { loss, delay_ticks: 5 }, seed)
}

/// Vehicles in a small space that are given new goals all the time, with nothing but the filter between them.
fn chaos_heard(count: usize, half_m: f64, planar: bool, posts: usize, hearing: Hearing, seed: u64) -> Flight {
    let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(0x9e37_79b9));
    let mut obstacles: Vec<Vector3<f64>> = Vec::new();
    for _ in 0..posts {
        let post = Vector3::new(uniform(&mut rng, -half_m, half_m), uniform(&mut rng, -half_m, half_m), 3.0);
        for k in 0..24 {
            let angle = f64::from(k) * std::f64::consts::TAU / 24.0;
            obstacles.push(post + Vector3::new(0.4 * angle.cos(), 0.4 * angle.sin(), 0.0));
        }
    }
    let mut vehicles = Vec::new();
    for _ in 0..count {
        let start = place(&mut rng, half_m, &vehicles, &obstacles);
        vehicles.push(Vehicle::new(start, start));
    }
    let mut swarm = Swarm::new(vehicles, seed);
    swarm.repulsion = None;
    swarm.planar = planar;
    swarm.obstacles = obstacles;
    swarm.loss = hearing.loss;
    swarm.delay_ticks = hearing.delay_ticks;
    let mut flight = Flight::default();
    for _ in 0..30 {
        for vehicle in &mut swarm.vehicles {
            vehicle.goal = Vector3::new(
                uniform(&mut rng, -half_m, half_m),
                uniform(&mut rng, -half_m, half_m),
                uniform(&mut rng, 2.5, 3.5),
            );
        }
        swarm.fly_on(2.0, &mut flight);
    }
    flight
}

fn report(name: &str, flights: &[Flight]) {
    let least = |value: fn(&Flight) -> f64| flights.iter().map(value).fold(f64::INFINITY, f64::min);
    println!(
        "{name}: separation {:.3} m, clearance {:.3} m, infeasible ticks {}",
        least(|f| f.min_separation_m),
        least(|f| f.min_clearance_m),
        flights.iter().map(|f| f.infeasible_ticks).sum::<u32>(),
    );
}

#[test]
fn vehicles_that_chase_random_goals_keep_their_distance() {
    for (count, half_m) in [(2, 3.0), (4, 3.0), (6, 4.0), (10, 6.0)] {
        let flights: Vec<_> = (0..8).map(|seed| chaos(count, half_m, true, 0, 0.0, seed)).collect();
        report(&format!("{count} in {half_m} m, planar"), &flights);
        for (seed, flight) in flights.iter().enumerate() {
            assert!(
                flight.min_separation_m >= SEPARATION_M,
                "{count} in {half_m} m, seed {seed}: {flight:?}"
            );
        }
    }
}

#[test]
fn vehicles_in_space_keep_their_distance() {
    for (count, half_m) in [(2, 3.0), (6, 4.0), (10, 6.0)] {
        let flights: Vec<_> = (0..8).map(|seed| chaos(count, half_m, false, 0, 0.0, seed)).collect();
        report(&format!("{count} in {half_m} m, in space"), &flights);
        for (seed, flight) in flights.iter().enumerate() {
            assert!(
                flight.min_separation_m >= SEPARATION_M,
                "{count} in {half_m} m, seed {seed}: {flight:?}"
            );
        }
    }
}

#[test]
fn vehicles_among_posts_touch_neither_posts_nor_one_another() {
    for planar in [true, false] {
        let flights: Vec<_> = (0..10).map(|seed| chaos(6, 6.0, planar, 8, 0.0, seed)).collect();
        report(&format!("6 among 8 posts, planar {planar}"), &flights);
        for (seed, flight) in flights.iter().enumerate() {
            assert!(flight.min_separation_m >= SEPARATION_M, "planar {planar}, seed {seed}: {flight:?}");
            assert!(flight.min_clearance_m >= HULL_M + 0.05, "planar {planar}, seed {seed}: {flight:?}");
        }
    }
}

#[test]
fn one_that_flies_straight_on_is_got_out_of_the_way_of() {
    let mut flights = Vec::new();
    for seed in 0..100 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let angle = uniform(&mut rng, 0.0, std::f64::consts::TAU);
        let aside = uniform(&mut rng, -1.0, 1.0);
        let from = Vector3::new(angle.cos(), angle.sin(), 0.0) * 12.0;
        let across = Vector3::new(-from.y, from.x, 0.0).normalize() * aside;
        let up = Vector3::new(0.0, 0.0, 3.0);
        let mut stubborn = Vehicle::new(from + across + up, -from + across + up);
        stubborn.stubborn = true;
        let mut swarm = Swarm::new(vec![Vehicle::new(up, up), stubborn], seed);
        swarm.repulsion = None;
        let mut flight = Flight::default();
        swarm.fly_on(14.0, &mut flight);
        flights.push(flight);
    }
    report("a stubborn one", &flights);
    for (at, flight) in flights.iter().enumerate() {
        assert!(flight.min_separation_m >= 0.9, "seed {at}: {flight:?}");
    }
}

#[test]
fn vehicles_keep_their_distance_when_half_of_what_they_say_is_lost() {
    let flights: Vec<_> = (0..8).map(|seed| chaos(6, 5.0, true, 0, 0.5, seed)).collect();
    report("6 in 5 m, half lost", &flights);
    for (seed, flight) in flights.iter().enumerate() {
        assert!(flight.min_separation_m >= SEPARATION_M, "seed {seed}: {flight:?}");
    }
}

#[test]
fn vehicles_keep_their_distance_when_they_hear_late_and_lose_a_third() {
    for (planar, count) in [(true, 6), (false, 8)] {
        let flights: Vec<_> = (0..6)
            .map(|seed| chaos_heard(count, 5.0, planar, 0, Hearing { loss: 0.3, delay_ticks: 15 }, seed))
            .collect();
        report(&format!("{count} in 5 m, 300 ms late, planar {planar}"), &flights);
        for (seed, flight) in flights.iter().enumerate() {
            assert!(flight.min_separation_m >= SEPARATION_M, "planar {planar}, seed {seed}: {flight:?}");
        }
    }
}
