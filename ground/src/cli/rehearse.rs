//! A rehearsal from the shell: what would come of it if the fleet flew on from here.

use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context as _;
use clap::Args;
use serde_json::{Map, Value, json};

use super::caller::Call;
use super::order::{route_points, vehicle_name};
use crate::rehearsal::{Played, Range, Rehearsed};

/// A station breaks off a rehearsal before.
const PATIENCE: Duration = Duration::from_secs(150);

/// A rehearsal of the fleet.
#[derive(Args)]
pub(super) struct RehearseCommand {
    /// A route that a vehicle is to fly in place of what it has to, such as "uav/3=0,20,3 15,20,3", or a file of points
    /// after the `=`. Once for each vehicle.
    #[arg(long = "route", value_name = "VEHICLE=POINTS|FILE")]
    routes: Vec<String>,
    /// The number of flights, with other gusts and errors each time: 1 to 10.
    #[arg(long, value_name = "N", default_value_t = 5)]
    flights: usize,
    #[command(flatten)]
    call: Call,
}

/// Shows what comes of it; 0 if everyone arrives, 1 if not.
pub(super) fn run(command: &RehearseCommand, as_json: bool) -> anyhow::Result<ExitCode> {
    let mut routes = Map::new();
    for given in &command.routes {
        let (vehicle, points) = given.split_once('=').with_context(|| {
            format!("`--route` is {given:?}: expected VEHICLE=POINTS, such as \"uav/3=0,20,3 15,20,3\"")
        })?;
        let points = route_points(points).with_context(|| format!("`--route` of {vehicle}"))?;
        routes.insert(vehicle_name(vehicle), json!(points.points()));
    }
    let mut caller = command.call.connect()?;
    let request = json!({ "type": "rehearse", "routes": routes, "flights": command.flights });
    let answer = caller.ask_within(request, "rehearsed", PATIENCE)?;
    let rehearsed: Rehearsed = serde_json::from_value(answer["rehearsed"].clone())?;
    if as_json {
        println!("{}", json!({ "rehearsed": rehearsed, "left_out": answer["left_out"] }));
    } else {
        print!("{}", in_words(&rehearsed, &answer["left_out"]));
    }
    Ok(ExitCode::from(u8::from(!rehearsed.succeeded)))
}

fn in_words(rehearsed: &Rehearsed, left_out: &Value) -> String {
    let flights = rehearsed.seeds.len();
    let mut text = String::new();
    for played in &rehearsed.vehicles {
        text += &line(played, flights);
        for fails in &played.fails {
            text += &format!("         in {} of {flights}: {}\n", fails.seeds, fails.why);
        }
        for wait in played.waits.iter().filter(|wait| wait.mean_s >= 0.5) {
            text += &format!("         waits {:.0} s for {}\n", wait.mean_s, wait.waits_for);
        }
    }
    for (vehicle, why) in left_out.as_object().into_iter().flatten() {
        text += &format!("{vehicle:<8} has no part in it: it {}\n", why.as_str().unwrap_or_default());
    }
    for near in rehearsed.nearest.iter().take(3) {
        let [one, other] = &near.who;
        text += &format!("nearest: {one} and {other}, {:.1} m after {:.0} s\n", near.distance_m, near.at_s);
    }
    if let Some(clearance_m) = rehearsed.clearance_m {
        text += &format!("nearest obstacle: {clearance_m:.1} m from a hull\n");
    }
    let [obstacles, vehicles] = rehearsed.collisions;
    if rehearsed.collisions != [0, 0] {
        text += &format!("COLLISIONS: {obstacles} with obstacles, {vehicles} between vehicles\n");
    }
    let verdict = if rehearsed.succeeded { "everyone arrives" } else { "NOT everyone arrives" };
    let ends =
        rehearsed.ends_s.map(|range| format!(", the last after {}", seconds(&range))).unwrap_or_default();
    text + &format!("{flights} flights: {verdict}{ends}\n")
}

fn line(played: &Played, flights: usize) -> String {
    let lands = played.lands_s.map(|range| format!(", lands after {}", seconds(&range))).unwrap_or_default();
    let left = played.battery.map(|range| format!(", {:.0} % left", range.least * 100.0)).unwrap_or_default();
    format!("{:<8} arrives in {} of {flights}{lands}{left}\n", played.vehicle, played.arrives)
}

fn seconds(range: &Range) -> String {
    format!("{:.0} to {:.0} s", range.least, range.most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rehearsal::{Failure, Nearness, Wait};

    #[test]
    fn a_rehearsal_is_told_in_lines_that_fit_a_terminal() {
        let range = |least, most| Some(Range { least, mean: (least + most) / 2.0, most });
        let rehearsed = Rehearsed {
            seeds: vec![1, 2],
            succeeded: false,
            vehicles: vec![Played {
                vehicle: "uav/1".into(),
                arrives: 1,
                lands_s: range(20.2, 24.6),
                battery: range(0.42, 0.5),
                waits: vec![
                    Wait { waits_for: "uav/2#right_of_way".into(), mean_s: 3.2 },
                    Wait { waits_for: "a moment".into(), mean_s: 0.2 },
                ],
                fails: vec![Failure { why: "battery low".into(), seeds: 1 }],
            }],
            ends_s: range(24.0, 31.0),
            nearest: vec![Nearness {
                who: ["uav/1".into(), "uav/2".into()],
                distance_m: 1.84,
                at_s: 12.3,
                seed: 2,
            }],
            clearance_m: Some(0.71),
            collisions: [0, 0],
            realtime_factor: 20.0,
            notes: Vec::new(),
        };
        let text = in_words(&rehearsed, &json!({ "uav/3": "is silent" }));
        assert_eq!(
            text,
            "uav/1    arrives in 1 of 2, lands after 20 to 25 s, 42 % left\n         \
             in 1 of 2: battery low\n         \
             waits 3 s for uav/2#right_of_way\n\
             uav/3    has no part in it: it is silent\n\
             nearest: uav/1 and uav/2, 1.8 m after 12 s\n\
             nearest obstacle: 0.7 m from a hull\n\
             2 flights: NOT everyone arrives, the last after 24 to 31 s\n"
        );
        assert!(text.lines().all(|line| line.len() <= 80), "{text}");
    }
}
