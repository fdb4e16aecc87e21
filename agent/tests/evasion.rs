//! A vehicle that others have come too near to on all sides leaves its height.

use std::time::Duration;

use nalgebra::Vector3;
use skein_agent::pipeline::guidance::Guidance;
use skein_agent::pipeline::layers::Layers;
use skein_agent::pipeline::perception::Perception;
use skein_agent::pipeline::surroundings::Surroundings;
use skein_agent::positioning::Motion;
use skein_agent::{Envelope, Fence, Planners};
use skein_mav::SetPoint;
use skein_planning::airspace::{Airspace, KeepOut, NoFlyPrism};
use skein_planning::separation::Neighbour;

const FENCE: Fence = Fence { min: [-20.0, -20.0, 0.0], max: [20.0, 20.0, 12.0] };

fn around(place: Vector3<f64>, count: u32, distance_m: f64) -> Vec<Neighbour> {
    let neighbour = |id: u32| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(id) / f64::from(count)).sin_cos();
        Neighbour {
            id,
            position: place + Vector3::new(cos, sin, 0.0) * distance_m,
            velocity: Vector3::zeros(),
            sigma_m: 0.05,
            age_s: 0.0,
            radius_m: 0.25,
            cooperative: true,
        }
    };
    (0..count).map(neighbour).collect()
}

fn perception() -> Perception {
    Perception::new(&FENCE, Vector3::zeros(), [0.6, 8.0]).unwrap()
}

/// The set-points of the first second at `place`, among neighbours that stand around it.
fn second_among(place: Vector3<f64>, neighbours: &[Neighbour], rank: u32) -> Vec<SetPoint> {
    second_in(&perception(), place, neighbours, rank)
}

/// The same in a world of which something is known.
fn second_in(
    perception: &Perception,
    place: Vector3<f64>,
    neighbours: &[Neighbour],
    rank: u32,
) -> Vec<SetPoint> {
    let envelope = Envelope::default();
    let mut guidance = Guidance::new(envelope, Layers::of(&envelope, FENCE, Planners::default()));
    let motion = Motion::new(place, Vector3::zeros(), [0.05, 0.05, 0.1]);
    let surroundings = Surroundings {
        map: perception.map(),
        sees: true,
        rays: perception.rays(),
        obstacles: &[],
        neighbours,
        first: neighbours,
        rank,
    };
    (0..50).map(|tick| guidance.steer(Duration::from_millis(20 * tick), &motion, &surroundings)).collect()
}

fn climb(set_point: &SetPoint) -> f64 {
    match set_point {
        SetPoint::Velocity { velocity, .. } => velocity.z,
        _ => 0.0,
    }
}

#[test]
fn hemmed_in_it_brakes_and_then_climbs_or_sinks_by_rank() {
    let place = Vector3::new(0.0, 0.0, 4.0);
    let close = around(place, 3, 0.8);
    let climbs = second_among(place, &close, 0);
    assert!(climbs[..24].iter().all(|set_point| climb(set_point) == 0.0), "it brakes first");
    assert!(climb(&climbs[49]) > 0.5, "{:?}", climbs[49]);
    assert!(climb(&second_among(place, &close, 3)[49]) < -0.5);
}

#[test]
fn near_the_ground_it_does_not_sink_and_under_the_ceiling_it_does_not_climb() {
    let low = Vector3::new(0.0, 0.0, 1.2);
    assert!(climb(&second_among(low, &around(low, 3, 0.8), 3)[49]) > 0.5);
    let high = Vector3::new(0.0, 0.0, 7.8);
    assert!(climb(&second_among(high, &around(high, 3, 0.8), 0)[49]) < -0.5);
}

#[test]
fn with_room_between_the_others_it_keeps_its_height() {
    let place = Vector3::new(0.0, 0.0, 4.0);
    assert!(second_among(place, &around(place, 3, 2.5), 0).iter().all(|set_point| climb(set_point) == 0.0));
}

#[test]
fn it_enters_a_zone_rather_than_touch_somebody() {
    // A narrow bay, open to the west.
    let bay = [[-9, -9], [9, -9], [9, 9], [-9, 9]].map(|corner| corner.map(f64::from));
    let shore = [[-9.0, 0.3], [0.3, 0.3], [0.3, -0.3], [-9.0, -0.3]];
    let zone = NoFlyPrism {
        corners: bay.into_iter().chain(shore).map(Into::into).collect(),
        floor_m: f64::NEG_INFINITY,
        ceiling_m: f64::INFINITY,
    };
    let airspace = Airspace { prisms: vec![zone], ..Airspace::default() };
    let knowing = perception().with_keep_out(KeepOut::new(airspace, 0.0, 1.0));
    let place = Vector3::new(0.0, 0.0, 4.0);
    // Somebody who does not give way comes into the bay.
    let mut intruder = around(place, 2, 2.0)[1];
    (intruder.velocity, intruder.cooperative) = (Vector3::new(1.0, 0.0, 0.0), false);
    let first = second_in(&knowing, place, &[intruder], 0)[0];
    assert!(matches!(first, SetPoint::Planar { vx, .. } if vx > 0.2), "{first:?}");
    assert_eq!(first, second_among(place, &[intruder], 0)[0], "the zone does not count then");
}
