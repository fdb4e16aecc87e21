//! Vehicles on a circle swap places through its centre: all arrive, and all keep their distance.

use super::kinematics::{Flight, Swarm, Vehicle, uniform};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn circle(count: u32, radius_m: f64, seed: u64, planar: bool) -> Flight {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x5eed);
    let vehicles = (0..count)
        .map(|k| {
            let angle = f64::from(k) * std::f64::consts::TAU / f64::from(count);
            let height = 3.0 + uniform(&mut rng, -0.5, 0.5);
            let start = Vector3::new(radius_m * angle.cos(), radius_m * angle.sin(), height);
            Vehicle::new(start, Vector3::new(-start.x, -start.y, height))
        })
        .collect();
    let mut swarm = Swarm::new(vehicles, seed);
    swarm.planar = planar;
    swarm.fly_home(90.0)
}

fn report(name: &str, flights: &[Flight]) {
    let worst = flights.iter().map(|f| f.min_separation_m).fold(f64::INFINITY, f64::min);
    let slowest = flights.iter().map(|f| f.time_s).fold(0.0, f64::max);
    let mean = flights.iter().map(|f| f.time_s).sum::<f64>() / flights.len() as f64;
    let infeasible: u32 = flights.iter().map(|f| f.infeasible_ticks).sum();
    let arrived = flights.iter().filter(|f| f.arrived).count();
    println!(
        "{name}: {arrived}/{} arrived, separation {worst:.3} m, time mean {mean:.1} s max {slowest:.1} s, infeasible ticks {infeasible}",
        flights.len()
    );
}

#[test]
fn eight_swap_places_for_a_hundred_seeds() {
    let flights: Vec<_> = (0..100).map(|seed| circle(8, 8.0, seed, true)).collect();
    report("8 planar", &flights);
    for (seed, flight) in flights.iter().enumerate() {
        assert!(flight.arrived, "seed {seed}: {flight:?}");
        assert!(flight.min_separation_m >= 1.05, "seed {seed}: {flight:?}");
    }
}

#[test]
fn eight_swap_places_in_three_dimensions() {
    let flights: Vec<_> = (0..30).map(|seed| circle(8, 8.0, seed, false)).collect();
    report("8 in space", &flights);
    for (seed, flight) in flights.iter().enumerate() {
        assert!(flight.arrived && flight.min_separation_m >= 1.05, "seed {seed}: {flight:?}");
    }
}

#[test]
fn any_number_swaps_places() {
    for count in [2, 3, 4, 5, 6, 7, 10, 12] {
        let flights: Vec<_> = (0..20).map(|seed| circle(count, 8.0, seed, true)).collect();
        report(&format!("{count} planar"), &flights);
        for (seed, flight) in flights.iter().enumerate() {
            assert!(flight.arrived && flight.min_separation_m >= 1.05, "{count}, seed {seed}: {flight:?}");
        }
    }
}
