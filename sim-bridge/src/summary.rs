//! The result of a run: `summary.json` and the table at its end.

use std::fmt::Write as _;
use std::io;
use std::path::Path;

use comfy_table::presets::UTF8_BORDERS_ONLY;
use comfy_table::{CellAlignment, Table};
use serde::{Deserialize, Serialize};

/// The outcome of a run, in SI units. Its JSON form is the program's contract with scripts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    pub scenario: String,
    /// The source of every random number.
    pub seed: u64,
    pub vehicles: usize,
    /// Every vehicle reached its goal and landed, without a collision.
    pub succeeded: bool,
    /// Why not; `None` on success.
    pub reason: Option<String>,
    /// Simulated time from the start to the last landing.
    pub sim_time_s: f64,
    pub wall_time_s: f64,
    /// Simulated time over wall time.
    pub realtime_factor: f64,
    /// Contacts, each episode counted once.
    pub collisions: Collisions,
    /// Least distance centre to centre while either vehicle was airborne; `None` for a single vehicle.
    pub min_separation_m: Option<f64>,
    /// Least distance from a flying hull to an obstacle; `None` where there are none.
    pub min_clearance_m: Option<f64>,
    /// Time from take-off to landing, over the vehicles that flew.
    pub flight_time_s: Spread,
    /// Way flown, over the vehicles that flew.
    pub path_length_m: Spread,
    /// Wall time of single path plans.
    pub plan_ms: PlanTimes,
    pub events: EventCounts,
    /// Traffic between nodes.
    pub network: Traffic,
    /// Hash over every selected event and every pose: equal hashes mean equal runs. None for runs that do not
    /// replay: in several processes, or with autopilots that run by themselves.
    pub trace_hash: Option<String>,
    /// One entry a vehicle, in order.
    pub per_vehicle: Vec<VehicleSummary>,
}

/// Contacts of vehicles.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Collisions {
    /// With obstacles, and leaving the bounds.
    pub obstacle: u64,
    /// With one another.
    pub vehicle: u64,
}

/// Mean and largest of some values; 0 where there are none.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    pub mean: f64,
    pub max: f64,
}

impl Spread {
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let (mut count, mut sum, mut max) = (0_u32, 0.0, 0.0_f64);
        for value in values {
            count += 1;
            sum += value;
            max = max.max(value);
        }
        if count == 0 { Self::default() } else { Self { mean: sum / f64::from(count), max } }
    }
}

/// Times of path planning, in milliseconds on the wall; 0 where nothing was planned.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanTimes {
    pub mean: f64,
    /// 99 of 100 plans took at most this long.
    pub p99: f64,
    pub max: f64,
}

impl PlanTimes {
    /// Of these times, in any order; the percentile is the nearest-rank one.
    pub fn of(mut times_ms: Vec<f64>) -> Self {
        times_ms.sort_by(f64::total_cmp);
        let Spread { mean, max } = Spread::of(times_ms.iter().copied());
        let rank = (times_ms.len() * 99).div_ceil(100);
        let p99 = times_ms.get(rank.saturating_sub(1)).copied().unwrap_or_default();
        Self { mean, p99, max }
    }
}

/// Events of all nodes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EventCounts {
    /// Selected at their homes.
    pub occurred: u64,
    /// Of these, requested by another node.
    pub remote: u64,
}

/// Traffic between nodes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Traffic {
    pub messages: u64,
    /// Their payloads, in bytes.
    pub bytes: u64,
}

/// The end of a vehicle's mission.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Landed at its goal.
    Arrived,
    /// Landed elsewhere; the reason says why.
    LandedEarly,
    /// Hit something, or left the world.
    Crashed,
    /// Never took off.
    Grounded,
    /// Still in the air at the end of the run.
    Airborne,
}

impl Outcome {
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Arrived => "arrived",
            Self::LandedEarly => "landed early",
            Self::Crashed => "crashed",
            Self::Grounded => "grounded",
            Self::Airborne => "airborne",
        }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VehicleSummary {
    /// Name of its node, such as `uav/3`.
    pub id: String,
    pub outcome: Outcome,
    /// Why it did not arrive; `None` if it did.
    pub reason: Option<String>,
    /// From take-off to landing; 0 if it never flew.
    pub flight_time_s: f64,
    pub path_length_m: f64,
    /// Set-points made from fresh inputs, and the greatest age of an input to one of them, which must not exceed 200
    /// ms.
    pub set_points: u64,
    /// See `set_points`.
    pub oldest_input_ms: f64,
    /// Stops that the safety filter asked for beyond a tilt of 5 degrees.
    pub hard_brakes: u64,
    /// Share of the battery's energy left, 0 to 1.
    pub battery: f64,
}

impl Summary {
    /// The object that `--json` prints and `summary.json` holds, indented, with a newline at its end.
    pub fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self).map(|text| text + "\n")
    }

    /// Writes `summary.json`.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        std::fs::write(path, self.to_json()?)
    }

    /// For people: what happened, in a few lines, and a row for each vehicle.
    pub fn render(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = self.render_to(&mut text);
        text
    }

    fn render_to(&self, out: &mut String) -> std::fmt::Result {
        let verdict = if self.succeeded { "succeeded" } else { "FAILED" };
        writeln!(out, "{} (seed {}): {verdict} with {} vehicles", self.scenario, self.seed, self.vehicles)?;
        if let Some(reason) = &self.reason {
            writeln!(out, "  reason      {reason}")?;
        }
        let (sim, wall, factor) = (self.sim_time_s, self.wall_time_s, self.realtime_factor);
        writeln!(out, "  time        {sim:.1} s simulated in {wall:.1} s ({factor:.1} x real time)")?;
        let Collisions { obstacle, vehicle } = self.collisions;
        writeln!(out, "  collisions  {obstacle} with obstacles, {vehicle} between vehicles")?;
        let (separation, clearance) = (metres(self.min_separation_m), metres(self.min_clearance_m));
        writeln!(out, "  closest     {separation} between centres, {clearance} from hull to obstacle")?;
        let PlanTimes { mean, p99, max } = self.plan_ms;
        // Other processes keep theirs to themselves.
        if max > 0.0 {
            writeln!(out, "  planning    {mean:.2} ms mean, {p99:.2} ms p99, {max:.2} ms max")?;
        }
        let EventCounts { occurred, remote } = self.events;
        writeln!(out, "  events      {occurred}, of which {remote} requested by another node")?;
        let Traffic { messages, bytes } = self.network;
        writeln!(out, "  network     {messages} messages, {:.1} kB", bytes as f64 / 1000.0)?;
        if let Some(trace_hash) = &self.trace_hash {
            writeln!(out, "  trace       {trace_hash}")?;
        }
        writeln!(out, "{}", self.table())
    }

    fn table(&self) -> Table {
        let mut table = Table::new();
        table.load_style(UTF8_BORDERS_ONLY);
        let header =
            ["vehicle", "outcome", "flight", "path", "set-points", "oldest input", "battery", "reason"];
        table.set_header(header);
        for vehicle in &self.per_vehicle {
            table.add_row([
                vehicle.id.clone(),
                vehicle.outcome.as_str().to_owned(),
                format!("{:.1} s", vehicle.flight_time_s),
                format!("{:.1} m", vehicle.path_length_m),
                if vehicle.set_points > 0 { vehicle.set_points.to_string() } else { "-".into() },
                if vehicle.set_points > 0 {
                    format!("{:.0} ms", vehicle.oldest_input_ms)
                } else {
                    "-".into()
                },
                format!("{:.0} %", vehicle.battery * 100.0),
                vehicle.reason.clone().unwrap_or_default(),
            ]);
        }
        for column in table.column_iter_mut().skip(2).take(5) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        table
    }
}

fn metres(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |m| format!("{m:.2} m"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn summary() -> Summary {
        Summary {
            scenario: "forest".into(),
            seed: 7,
            vehicles: 1,
            succeeded: false,
            reason: Some("uav/1 found no way to its goal".into()),
            sim_time_s: 61.25,
            wall_time_s: 2.0,
            realtime_factor: 30.6,
            collisions: Collisions { obstacle: 0, vehicle: 0 },
            min_separation_m: None,
            min_clearance_m: Some(0.42),
            flight_time_s: Spread::of([20.0, 40.0]),
            path_length_m: Spread::of([]),
            plan_ms: PlanTimes::of((1..=200).rev().map(f64::from).collect()),
            events: EventCounts { occurred: 812, remote: 40 },
            network: Traffic { messages: 9000, bytes: 812_345 },
            trace_hash: Some("00ff".into()),
            per_vehicle: vec![VehicleSummary {
                id: "uav/1".into(),
                outcome: Outcome::LandedEarly,
                reason: Some("no path".into()),
                flight_time_s: 40.0,
                path_length_m: 71.5,
                set_points: 1830,
                oldest_input_ms: 120.0,
                hard_brakes: 0,
                battery: 0.875,
            }],
        }
    }

    #[test]
    fn the_json_has_the_keys_that_scripts_rely_on_in_their_order() -> serde_json::Result<()> {
        let json = summary().to_json()?;
        let keys = [
            "scenario",
            "seed",
            "vehicles",
            "succeeded",
            "reason",
            "sim_time_s",
            "wall_time_s",
            "realtime_factor",
            "collisions",
            "min_separation_m",
            "min_clearance_m",
            "flight_time_s",
            "path_length_m",
            "plan_ms",
            "events",
            "network",
            "trace_hash",
            "per_vehicle",
        ];
        let top_level = json.lines().filter_map(|line| line.strip_prefix("  \"")?.split('"').next());
        assert_eq!(top_level.collect::<Vec<_>>(), keys);
        let value: serde_json::Value = serde_json::from_str(&json)?;
        let members = |key: &str| -> Vec<String> {
            value[key].as_object().map(|o| o.keys().cloned().collect()).unwrap_or_default()
        };
        assert_eq!(members("collisions"), ["obstacle", "vehicle"]);
        assert_eq!(members("flight_time_s"), ["max", "mean"]);
        assert_eq!(members("plan_ms"), ["max", "mean", "p99"]);
        assert_eq!(members("events"), ["occurred", "remote"]);
        assert_eq!(members("network"), ["bytes", "messages"]);
        assert_eq!(value["per_vehicle"][0]["outcome"], "landed_early");
        assert!(value["min_separation_m"].is_null());
        Ok(())
    }

    #[test]
    fn the_json_reads_back_as_the_same_summary() -> serde_json::Result<()> {
        assert_eq!(serde_json::from_str::<Summary>(&summary().to_json()?)?, summary());
        Ok(())
    }

    #[test]
    fn mean_percentile_and_maximum_are_right() {
        let summary = summary();
        assert_eq!(summary.flight_time_s, Spread { mean: 30.0, max: 40.0 });
        assert_eq!(summary.path_length_m, Spread { mean: 0.0, max: 0.0 });
        assert_eq!(summary.plan_ms, PlanTimes { mean: 100.5, p99: 198.0, max: 200.0 });
        assert_eq!(PlanTimes::of(vec![3.0]), PlanTimes { mean: 3.0, p99: 3.0, max: 3.0 });
        assert_eq!(PlanTimes::of(Vec::new()), PlanTimes::default());
    }

    #[test]
    fn people_read_the_reason_and_each_vehicles_outcome() {
        let text = summary().render();
        assert!(text.contains("FAILED") && text.contains("uav/1 found no way to its goal"));
        assert!(text.contains("landed early") && text.contains("88 %") && text.contains("0.42 m"), "{text}");
    }
}
