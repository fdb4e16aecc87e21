//! A plan for the fleet: shown, and sent if that is asked for.

use std::process::ExitCode;

use clap::Args;
use serde_json::{Value, json};
use skein_wire::event::{OrderGiven, What};

use super::caller::{Call, Caller};
use super::order::{all_acknowledged, answered, answers, route_points, vehicle_name};

/// The way in which vehicles would reach targets together.
#[derive(Args)]
pub(super) struct PlanCommand {
    /// Targets in metres east, north and up, such as "90,20,8 90,40,8", or a file with one on each line.
    #[arg(value_name = "TARGETS|FILE", allow_hyphen_values = true)]
    targets: String,
    /// Numbers or names of the vehicles to plan for, such as 1,2,uav/3 [default: all that have a mission].
    #[arg(long, value_name = "VEHICLES", value_delimiter = ',')]
    vehicles: Vec<String>,
    /// Send each vehicle its route, unless two of them would come too near to one another.
    #[arg(long)]
    send: bool,
    #[command(flatten)]
    call: Call,
}

/// Shows the plan; 0 if it can be flown and, if it is to be sent, every vehicle has taken its route.
pub(super) fn run(command: &PlanCommand, as_json: bool) -> anyhow::Result<ExitCode> {
    let targets = route_points(&command.targets)?;
    let vehicles: Vec<_> = command.vehicles.iter().map(|vehicle| vehicle_name(vehicle)).collect();
    let to = if vehicles.is_empty() { json!(OrderGiven::ALL) } else { json!(vehicles) };
    let mut caller = command.call.connect()?;
    let plan = caller.ask(json!({ "type": "plan", "to": to, "targets": targets.points() }), "plan")?;
    if !as_json {
        print!("{}", in_words(&plan));
    }
    let is_clear = plan["encounters"].as_array().is_some_and(Vec::is_empty);
    let sent = if command.send && is_clear { Some(send(&plan, &mut caller)?) } else { None };
    let is_taken = sent.as_ref().is_none_or(|sent| sent.iter().all(all_acknowledged));
    if as_json {
        println!("{}", json!({ "plan": plan, "orders": sent }));
    } else if let Some(sent) = &sent {
        print!("{}", sent.iter().flat_map(answers).map(answer_line).collect::<String>());
    } else if command.send {
        println!("nothing is sent");
    }
    Ok(ExitCode::from(u8::from(!(is_clear && is_taken))))
}

/// Sends every vehicle its route; gives back what has become of each.
fn send(plan: &Value, caller: &mut Caller) -> anyhow::Result<Vec<Value>> {
    let mut numbers = Vec::new();
    for journey in array(&plan["journeys"]) {
        let order = json!({
            "type": "order", "what": What::Route.word(), "to": [journey["vehicle"]], "points": journey["points"],
            "stops": journey["stops"],
        });
        numbers.push(caller.ask(order, "ordered")?["id"].clone());
    }
    numbers.iter().map(|number| answered(caller, number)).collect()
}

fn array(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

fn answer_line((vehicle, answer): (&String, &Value)) -> String {
    let why = answer["why"].as_str().map(|why| format!(": {why}")).unwrap_or_default();
    format!("{vehicle} {}{why}\n", answer["state"].as_str().unwrap_or_default())
}

fn in_words(plan: &Value) -> String {
    let number = |value: &Value| value.as_f64().unwrap_or_default();
    let mut text = String::new();
    for journey in array(&plan["journeys"]) {
        let targets: Vec<_> = array(&journey["targets"]).map(Value::to_string).collect();
        let cost = &journey["cost"];
        let second = journey["second"]["cost"]["cost_m"].as_f64();
        let second = second.map(|cost_m| format!(" (other: {cost_m:.0})")).unwrap_or_default();
        text += &format!(
            "{:<8} to target {:<6}{:>6.0} m{:>5.0} s{:>4.0} % of battery, cost {:.0}{second}\n",
            journey["vehicle"].as_str().unwrap_or_default(),
            targets.join(", "),
            number(&cost["length_m"]),
            number(&cost["time_s"]) * number(&journey["slowed"]),
            number(&cost["energy"]) * 100.0,
            number(&cost["cost_m"]),
        );
    }
    for (vehicle, why) in plan["left_out"].as_object().into_iter().flatten() {
        text += &format!("{vehicle:<8} stays out: it {}\n", why.as_str().unwrap_or_default());
    }
    for near in array(&plan["encounters"]) {
        let who: Vec<_> = array(&near["who"]).filter_map(Value::as_str).collect();
        let (at_s, distance_m) = (number(&near["at_s"]), number(&near["distance_m"]));
        text += &format!("too near: {} after {at_s:.0} s, {distance_m:.1} m apart\n", who.join(" and "));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_is_told_in_lines_that_fit_a_terminal() {
        let plan = json!({
            "journeys": [{
                "vehicle": "uav/1", "targets": [2], "slowed": 1.25,
                "cost": { "length_m": 100.4, "time_s": 40.0, "energy": 0.12, "cost_m": 151.0 },
                "second": { "cost": { "cost_m": 163.0 } },
            }],
            "left_out": { "uav/2": "has 15 % left in its battery" },
            "encounters": [{ "who": ["uav/1", "uav/3"], "at_s": 12.3, "distance_m": 1.26 }],
        });
        let text = in_words(&plan);
        assert_eq!(
            text,
            "uav/1    to target 2        100 m   50 s  12 % of battery, cost 151 (other: 163)\n\
             uav/2    stays out: it has 15 % left in its battery\n\
             too near: uav/1 and uav/3 after 12 s, 1.3 m apart\n"
        );
        assert!(text.lines().all(|line| line.len() <= 80), "{text}");
    }
}
