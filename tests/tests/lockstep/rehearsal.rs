//! What is rehearsed from a present state is what is then flown.

use std::time::Duration;

use skein_ground::rehearsal::Rehearsal;
use skein_sim::rehearse::{read, rehearse};
use skein_tests::Lockstep;

/// From the second flight on, times and distances are of what flies after the moment of the rehearsal.
struct Flown {
    lands_s: f64,
    nearest_m: f64,
}

/// Steps until every mission is over, and tells how.
fn flown(field: &mut Lockstep) -> Flown {
    let began = field.swarm.now();
    let mut nearest_m = f64::INFINITY;
    while !(field.swarm.is_over() && field.swarm.is_grounded()) {
        assert!(field.swarm.now() < began + Duration::from_secs(200), "the flight does not end");
        if !field.step().ticked {
            continue;
        }
        let states: Vec<_> =
            (0..field.scenario.vehicles.len()).filter_map(|i| field.swarm.simulation().vehicle(i)).collect();
        for (i, one) in states.iter().enumerate() {
            for other in &states[..i] {
                if one.airborne || other.airborne {
                    nearest_m = nearest_m.min((one.motion.position - other.motion.position).norm());
                }
            }
        }
    }
    assert!(field.swarm.outcomes().all(|outcome| outcome == Some(&skein_agent::Outcome::Complete)));
    Flown { lands_s: (field.swarm.now() - began).as_secs_f64(), nearest_m }
}

/// The state of the swarm now, each vehicle with what it still has to fly.
fn present(field: &Lockstep, routes: &[Vec<[f64; 3]>], more: serde_json::Value) -> Rehearsal {
    let vehicles: Vec<_> = routes
        .iter()
        .enumerate()
        .map(|(index, route)| {
            let state = field.swarm.simulation().vehicle(index).unwrap();
            serde_json::json!({
                "node": field.nodes[index].as_str(),
                "position_m": <[f64; 3]>::from(state.motion.position),
                "airborne": state.airborne,
                "home_m": <[f64; 3]>::from(field.scenario.vehicles[index].start),
                "battery": state.battery.fraction,
                "route_m": route,
            })
        })
        .collect();
    let bounds = field.scenario.scene.bounds();
    let mut rehearsal = serde_json::json!({
        "vehicles": vehicles,
        "min_m": <[f64; 3]>::from(bounds.min),
        "max_m": <[f64; 3]>::from(bounds.max),
        // None of them is the flight's.
        "seeds": [11, 12, 13, 14, 15],
    });
    for (field, value) in more.as_object().unwrap() {
        rehearsal[field] = value.clone();
    }
    read(&rehearsal.to_string()).unwrap()
}

/// The flight's time is within the rehearsed range widened by 5 %, and nobody is 0.2 m nearer than rehearsed.
fn assert_as_rehearsed(rehearsal: &Rehearsal, field: &mut Lockstep) {
    let rehearsed = rehearse(rehearsal).unwrap();
    assert!(rehearsed.succeeded, "{rehearsed:?}");
    let flown = flown(field);
    let range = rehearsed.ends_s.unwrap();
    let width = 0.05 * flown.lands_s;
    let (least_s, most_s) = (range.least - width, range.most + width);
    assert!((least_s..most_s).contains(&flown.lands_s), "{} is not in {range:?}", flown.lands_s);
    let nearest_m = rehearsed.nearest.first().unwrap().distance_m;
    assert!(flown.nearest_m > nearest_m - 0.2, "{} is nearer than {nearest_m}", flown.nearest_m);
}

const CROSSING: &str = "time_limit_s = 120.0\n[bounds]\nmin_m = [-10.0, -40.0, -1.0]\nmax_m = [80.0, 40.0, 15.0]\n\
    [[obstacle]]\ncentre_m = [35.0, 3.0, 4.0]\ncylinder = { radius_m = 0.6, height_m = 8.0 }\n\
    [[obstacle]]\ncentre_m = [38.0, -4.0, 4.0]\nbox_m = [2.0, 3.0, 8.0]\n\
    [[vehicle]]\nstart_m = [0.0, 0.0]\nwaypoints_m = [[60.0, 8.0, 3.0]]\n\
    [[vehicle]]\nstart_m = [0.0, 8.0]\nwaypoints_m = [[60.0, 0.0, 3.0]]\n\
    [[vehicle]]\nstart_m = [60.0, -14.0]\nwaypoints_m = [[20.0, -8.0, 3.0], [0.0, -8.0, 3.0]]\n";

fn crossing_routes() -> Vec<Vec<[f64; 3]>> {
    vec![vec![[60.0, 8.0, 3.0]], vec![[60.0, 0.0, 3.0]], vec![[20.0, -8.0, 3.0], [0.0, -8.0, 3.0]]]
}

fn crossing_map() -> serde_json::Value {
    serde_json::json!({ "obstacles": [
        { "form": "cylinder", "radius": 0.6, "height": 8.0, "position": [35.0, 3.0, 4.0] },
        { "form": "box", "size": [2.0, 3.0, 8.0], "position": [38.0, -4.0, 4.0] },
    ]})
}

#[test]
fn vehicles_in_the_air_fly_on_as_rehearsed() {
    let mut field = Lockstep::from_text(CROSSING);
    field.run_until(Duration::from_secs(17));
    assert!((0..3).all(|index| field.swarm.simulation().vehicle(index).unwrap().airborne));
    let rehearsal = present(&field, &crossing_routes(), crossing_map());
    assert_as_rehearsed(&rehearsal, &mut field);
}

#[test]
fn vehicles_on_the_ground_take_off_and_fly_as_rehearsed_in_the_wind_that_there_is() {
    let wind = "[wind]\nmean_m_s = [2.0, -1.0, 0.0]\ngust_m_s = 0.4\n";
    let mut field = Lockstep::from_text(&CROSSING.replace("[bounds]", &format!("{wind}[bounds]")));
    let mut more = crossing_map();
    more["wind"] = serde_json::json!({ "mean_m_s": [2.0, -1.0, 0.0], "gust_m_s": 0.4 });
    let rehearsal = present(&field, &crossing_routes(), more);
    assert_as_rehearsed(&rehearsal, &mut field);
}

#[test]
fn a_zone_is_flown_round_as_rehearsed() {
    let mut field = Lockstep::from_text(CROSSING);
    field.run_until(Duration::from_secs(17));
    let zone =
        serde_json::json!({ "name": "pond", "kind": "no_fly", "centre_m": [48.0, 4.0], "radius_m": 5.0 });
    let mut more = crossing_map();
    more["zones"] = serde_json::json!([zone]);
    let rehearsal = present(&field, &crossing_routes(), more);
    let by = skein_ground::Giver::new("Anna").unwrap();
    field.swarm.ground_mut().draw(&by, rehearsal.zones[0].clone()).unwrap();
    assert_as_rehearsed(&rehearsal, &mut field);
}

#[test]
fn who_does_not_arrive_is_told_with_the_reason_and_who_is_held_stays() {
    let field = Lockstep::from_text(CROSSING);
    let mut rehearsal = present(&field, &crossing_routes(), serde_json::json!({ "seeds": [1, 2] }));
    for (vehicle, height) in rehearsal.vehicles.iter_mut().zip([3.0, 3.0, 3.0]) {
        vehicle.position_m[2] = height;
        vehicle.airborne = true;
    }
    // The first has too little left, the second is held before the third's goal.
    rehearsal.vehicles[0].battery = 0.16;
    rehearsal.vehicles[1].held = true;
    let rehearsed = rehearse(&rehearsal).unwrap();
    assert!(!rehearsed.succeeded);
    let [first, second, third] = &rehearsed.vehicles[..] else { panic!("{rehearsed:?}") };
    assert_eq!((first.arrives, second.arrives, third.arrives), (0, 0, 2), "{rehearsed:?}");
    assert!(first.fails[0].why.starts_with("battery low"), "{first:?}");
    assert_eq!((second.fails[0].why.as_str(), second.lands_s), ("it is held", None));
    // One seed is one flight.
    let mut again = rehearse(&rehearsal).unwrap();
    again.realtime_factor = rehearsed.realtime_factor;
    assert_eq!(again, rehearsed);
}
