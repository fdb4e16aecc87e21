//! The swarm as the station sees it, in a line for each vehicle.

use std::process::ExitCode;

use serde_json::Value;

use super::caller::Call;

/// Prints what the station tells of its vehicles now.
pub(super) fn run(call: &Call, as_json: bool) -> anyhow::Result<ExitCode> {
    let fleet = call.connect()?.next_of("fleet")?;
    if as_json {
        println!("{fleet}");
    } else {
        print!("{}", in_words(&fleet));
    }
    Ok(ExitCode::SUCCESS)
}

/// A line for each vehicle, and one for how the mission ended, if it has.
fn in_words(fleet: &Value) -> String {
    let vehicles = fleet["vehicles"].as_array().into_iter().flatten().map(line);
    let outcome = match &fleet["outcome"]["succeeded"] {
        Value::Bool(true) => "the mission is complete\n",
        Value::Bool(false) => "the mission is over, and not every vehicle did what it was sent for\n",
        _ => "",
    };
    vehicles.chain([outcome.to_owned()]).collect()
}

fn line(vehicle: &Value) -> String {
    let text = |field: &str| vehicle[field].as_str().unwrap_or_default();
    if vehicle["heard"] != true {
        return format!("{:<8} not heard\n", text("name"));
    }
    let silent = if vehicle["link"]["alive"] == true { "" } else { "SILENT, last: " };
    let [x, y, z] = [0, 1, 2].map(|axis| vehicle["position"][axis].as_f64().unwrap_or_default());
    let percent = vehicle["battery"].as_f64().unwrap_or_default() * 100.0;
    let waiting = Some(text("waiting_for")).filter(|who| !who.is_empty());
    let waiting = waiting.map(|who| format!(", waiting for {who}")).unwrap_or_default();
    let holder = Some(text("holder")).filter(|who| !who.is_empty());
    let holder = holder.map(|who| format!(", held by {who}")).unwrap_or_default();
    format!(
        "{:<8} {:<9} {percent:>3.0} %  at {x:.1}, {y:.1}, {z:.1}  {silent}{}{waiting}{holder}\n",
        text("name"),
        text("mode"),
        text("task")
    )
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn each_vehicle_has_a_line_with_place_battery_task_and_whom_it_waits_for() {
        let fleet = json!({ "outcome": { "succeeded": true }, "vehicles": [
            { "name": "uav/1", "heard": true, "link": { "alive": true }, "mode": "offboard", "battery": 0.876,
              "position": [1.04, -2.0, 3.0], "task": "leg 1 of 2", "waiting_for": "uav/2#right_of_way", "holder": "Anna" },
            { "name": "uav/2", "heard": true, "link": { "alive": false }, "mode": "land", "battery": 0.5,
              "position": [0.0, 0.0, 0.0], "task": "landing", "waiting_for": "", "holder": "" },
            { "name": "uav/3", "heard": false }
        ]});
        let lines = "uav/1    offboard   88 %  at 1.0, -2.0, 3.0  leg 1 of 2, waiting for uav/2#right_of_way, held by Anna\n\
                     uav/2    land       50 %  at 0.0, 0.0, 0.0  SILENT, last: landing\n\
                     uav/3    not heard\n\
                     the mission is complete\n";
        assert_eq!(in_words(&fleet), lines);
    }
}
