//! Orders from the shell, to a station that runs: the console's buttons as commands.

use std::io::{IsTerminal as _, Write as _};
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use clap::{Args, Subcommand};
use serde_json::{Value, json};
use skein_wire::event::{OrderGiven, What};
use skein_wire::{Route, UnfitRoute};

use super::caller::{Call, Caller};

/// Whoever has not answered an order by then is missing.
const ANSWERED_WITHIN: Duration = Duration::from_secs(10);

/// The orders that the shell gives.
#[derive(Subcommand)]
pub(super) enum OrderCommand {
    /// Vehicles stop and stay until resumed.
    Hold(Addressed),
    /// Vehicles go on.
    Resume(Addressed),
    /// Vehicles fly home and land there.
    Return(Addressed),
    /// Vehicles land where they are.
    Land(Addressed),
    /// Everyone lands where it is, decided together.
    Abort(Call),
    /// Vehicles go to a place and hover there until resumed.
    Goto {
        #[command(flatten)]
        to: Addressed,
        /// Metres east, north, and up; without the last each keeps its height.
        #[arg(long, value_name = "X,Y[,Z]", value_delimiter = ',', num_args = 2..=3, allow_negative_numbers = true, required = true)]
        place: Vec<f64>,
    },
    /// A vehicle flies these points instead of what is left of its mission, and lands under the last. It refuses those
    /// outside its fence or in a zone, and an end beside another vehicle's place.
    Route {
        /// Points in metres east, north and up, such as "0,20,3 15,20,3", or a file with one on each line.
        #[arg(value_name = "POINTS|FILE", allow_hyphen_values = true)]
        route: String,
        /// Number or name of the vehicle, such as 3 or uav/3.
        #[arg(long, value_name = "VEHICLE")]
        vehicle: String,
        #[command(flatten)]
        call: Call,
    },
    /// Vehicles fly by themselves again: the pilot has let go.
    HandBack(Addressed),
    /// Take off. First says who would, and which checks do not pass; then asks, and launches within 10 s or not at all.
    Launch {
        #[command(flatten)]
        call: Call,
        /// All at once, when everyone is there and ready, and not in turn.
        #[arg(long)]
        together: bool,
        /// Launch without asking.
        #[arg(long)]
        yes: bool,
    },
    /// Ask whoever holds vehicles for them.
    Ask(Addressed),
    /// Give vehicles that you hold to somebody else.
    Give {
        #[command(flatten)]
        to: Addressed,
        /// The person who shall hold them.
        #[arg(long, value_name = "NAME")]
        to_whom: String,
    },
    /// Hold vehicles from now on, whoever holds them.
    Take(Addressed),
    /// Hold vehicles no more.
    Release(Addressed),
}

/// An order to some vehicles.
#[derive(Args)]
pub(super) struct Addressed {
    /// The vehicles, such as uav/3, or `all`.
    #[arg(value_name = "VEHICLE", required = true)]
    vehicles: Vec<String>,
    #[command(flatten)]
    call: Call,
}

impl Addressed {
    fn request(&self, what: What) -> (&Call, Value) {
        let to = if self.vehicles.iter().any(|vehicle| vehicle == OrderGiven::ALL) {
            json!(OrderGiven::ALL)
        } else {
            json!(self.vehicles)
        };
        (&self.call, json!({ "type": "order", "what": what.word(), "to": to }))
    }
}

/// Gives the order; 0 if everyone has taken it in, 1 if not.
pub(super) fn run(order: &OrderCommand, as_json: bool) -> anyhow::Result<ExitCode> {
    let (call, request) = match order {
        OrderCommand::Hold(to) => to.request(What::Hold),
        OrderCommand::Resume(to) => to.request(What::Resume),
        OrderCommand::Return(to) => to.request(What::Return),
        OrderCommand::Land(to) => to.request(What::Land),
        OrderCommand::HandBack(to) => to.request(What::HandBack),
        OrderCommand::Ask(to) => to.request(What::Ask),
        OrderCommand::Take(to) => to.request(What::Take),
        OrderCommand::Release(to) => to.request(What::Release),
        OrderCommand::Abort(call) => (call, for_all(What::Abort)),
        OrderCommand::Goto { to, place } => {
            let (call, mut request) = to.request(What::GoTo);
            request["point"] = json!([place[0], place[1], place.get(2)]);
            (call, request)
        }
        OrderCommand::Route { route, vehicle, call } => {
            let points = route_points(route)?;
            let vehicle = vehicle_name(vehicle);
            let what = What::Route.word();
            (call, json!({ "type": "order", "what": what, "to": [vehicle], "points": points.points() }))
        }
        OrderCommand::Give { to, to_whom } => {
            let (call, mut request) = to.request(What::Give);
            request["name"] = json!(to_whom);
            (call, request)
        }
        OrderCommand::Launch { call, together, yes } => {
            let what = if *together { What::LaunchTogether } else { What::Launch };
            return launch(call, what, *yes, as_json);
        }
    };
    let mut caller = call.connect()?;
    let number = caller.ask(request, "ordered")?["id"].clone();
    let order = answered(&mut caller, &number)?;
    tell(&order, as_json);
    Ok(ExitCode::from(u8::from(!all_acknowledged(&order))))
}

/// Every vehicle that an order is for has taken it in.
pub(super) fn all_acknowledged(order: &Value) -> bool {
    answers(order).all(|(_, answer)| answer["state"] == "acknowledged")
}

/// The name of the vehicle with this number or name.
pub(super) fn vehicle_name(vehicle: &str) -> String {
    if vehicle.contains('/') { vehicle.to_owned() } else { format!("uav/{vehicle}") }
}

/// The points that the argument names, or those of the file whose path it is.
pub(super) fn route_points(given: &str) -> anyhow::Result<Route> {
    let path = Path::new(given);
    if !path.is_file() {
        return points_in(given.split_whitespace()).with_context(|| {
            format!("{given}: expected points such as \"0,20,3 15,20,3\", or a file with one on each line")
        });
    }
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
    points_in(lines.filter(|line| !line.is_empty())).with_context(|| path.display().to_string())
}

fn points_in<'a>(points: impl Iterator<Item = &'a str>) -> Result<Route, UnfitRoute> {
    points.map(|point| point.replace(',', " ")).collect::<Vec<_>>().join("; ").parse()
}

fn for_all(what: What) -> Value {
    json!({ "type": "order", "what": what.word(), "to": OrderGiven::ALL })
}

/// The order of this number, once nobody's answer is open, or after a while.
pub(super) fn answered(caller: &mut Caller, number: &Value) -> anyhow::Result<Value> {
    let deadline = Instant::now() + ANSWERED_WITHIN;
    let mut newest = Value::Null;
    while Instant::now() < deadline {
        let is_open = |(_, answer): (_, &Value)| answer["state"] == "pending" || answer["state"] == "missing";
        if !newest.is_null() && !answers(&newest).any(is_open) {
            break;
        }
        let orders = caller.next_of_within("orders", deadline)?;
        let found = orders.as_ref().and_then(|orders| orders["orders"].as_array()).into_iter().flatten();
        newest = found.into_iter().find(|order| order["id"] == *number).cloned().unwrap_or(newest);
    }
    Ok(newest)
}

pub(super) fn answers(order: &Value) -> impl Iterator<Item = (&String, &Value)> {
    order["answers"].as_object().into_iter().flatten()
}

fn tell(order: &Value, as_json: bool) {
    if as_json {
        println!("{order}");
        return;
    }
    for (vehicle, answer) in answers(order) {
        let why = answer["why"].as_str().map(|why| format!(": {why}")).unwrap_or_default();
        println!("{vehicle} {}{why}", answer["state"].as_str().unwrap_or_default());
    }
}

fn launch(call: &Call, what: What, yes: bool, as_json: bool) -> anyhow::Result<ExitCode> {
    let mut caller = call.connect()?;
    let mut request = for_all(what);
    let offer = caller.ask(request.clone(), "offer")?;
    if !as_json {
        show(&offer);
    }
    if !yes && !confirmed(&offer)? {
        anyhow::bail!("nobody is launched: it was not confirmed");
    }
    request["token"] = offer["token"].clone();
    let number = caller.ask(request, "ordered")?["id"].clone();
    if as_json {
        let vehicles = &offer["vehicles"];
        println!("{}", json!({ "id": number, "what": what.word(), "by": caller.name, "vehicles": vehicles }));
    } else {
        println!("ordered: {what}, by {}", caller.name);
    }
    Ok(ExitCode::SUCCESS)
}

fn show(offer: &Value) {
    println!("{}:", offer["what"].as_str().unwrap_or_default().replace('_', " "));
    for vehicle in offer["vehicles"].as_array().into_iter().flatten() {
        let [name, task] = ["name", "task"].map(|field| vehicle[field].as_str().unwrap_or_default());
        println!("  {name}  {task}");
        for doubt in vehicle["doubts"].as_array().into_iter().flatten() {
            println!("    not passed: {}", doubt.as_str().unwrap_or_default());
        }
    }
}

fn confirmed(offer: &Value) -> anyhow::Result<bool> {
    anyhow::ensure!(std::io::stdin().is_terminal(), "a launch is confirmed at a terminal, or with `--yes`");
    print!("Arm motors and take off? Within {} s, y or n: ", offer["lasts_s"]);
    std::io::stdout().flush()?;
    let mut answer = String::new();
    std::io::stdin().read_line(&mut answer)?;
    Ok(matches!(answer.trim(), "y" | "yes"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_route_is_read_from_the_line_or_from_a_file() {
        let points = [[-3.0, 4.5, 3.0], [6.0, 7.0, 8.0]];
        assert_eq!(route_points("-3,4.5,3 6,7,8").unwrap().points(), points);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("route.csv");
        std::fs::write(&path, "# Round the hut.\n-3, 4.5, 3\n\n6, 7, 8 # back\n").unwrap();
        assert_eq!(route_points(path.to_str().unwrap()).unwrap().points(), points);
        std::fs::write(&path, "1, 2\n").unwrap();
        let error = format!("{:#}", route_points(path.to_str().unwrap()).unwrap_err());
        assert!(error.contains("route.csv: point 1, `1  2`"), "{error}");
        let error = format!("{:#}", route_points("nowhere.csv").unwrap_err());
        assert!(error.contains("nowhere.csv: expected points such as"), "{error}");
    }
}
