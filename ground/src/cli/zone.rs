//! Zones from the shell: what the console draws, as commands.

use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant, SystemTime};

use anyhow::{Context as _, anyhow, bail, ensure};
use clap::{Args, Subcommand};
use serde_json::{Value, json};
use skein_wire::event::ZoneKind;
use skein_wire::{Zone, ZoneTable};

use super::caller::{Call, Caller};

/// Whoever has not answered by then is missing.
const ANSWERED_WITHIN: Duration = Duration::from_secs(10);

/// An action on zones.
#[derive(Subcommand)]
pub(super) enum ZoneCommand {
    /// Draw a zone for all vehicles, or draw the one of its name anew. Vehicles keep it on disk, whatever becomes of
    /// the station, until it is removed.
    Add(Box<Add>),
    /// List what is drawn, and which vehicles have regard for it.
    List(Call),
    /// Remove a zone.
    Remove {
        #[arg(value_name = "NAME")]
        name: String,
        #[command(flatten)]
        call: Call,
    },
}

/// A zone, in a file or in arguments.
#[derive(Args)]
pub(super) struct Add {
    /// A JSON file with a zone, or a list of them; without it the zone is described by the options below.
    #[arg(value_name = "FILE")]
    file: Option<String>,
    /// 1 to 32 bytes of letters, digits, `-`, `_` and `.`.
    #[arg(long)]
    name: Option<String>,
    /// no_fly, stay_inside, threat, not_above, not_below or rally.
    #[arg(long, value_parser = kind)]
    kind: Option<ZoneKind>,
    /// Middle of a circle, or place of a rally point: metres east and north.
    #[arg(long, value_name = "X,Y", value_delimiter = ',', num_args = 2, allow_negative_numbers = true)]
    centre: Option<Vec<f64>>,
    /// Radius of a circle, in metres.
    #[arg(long, value_name = "M")]
    radius: Option<f64>,
    /// Corners of a polygon in metres east and north, such as "0,0 10,0 10,10".
    #[arg(long, value_name = "CORNERS", allow_hyphen_values = true)]
    corners: Option<String>,
    /// Lower end of a no-fly zone or of an area to stay inside of, in metres.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    floor: Option<f64>,
    /// Their upper end, in metres.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    ceiling: Option<f64>,
    /// Height of not_above, not_below (everywhere if no area is given) and of a rally point, in metres.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    height: Option<f64>,
    /// It counts from then on: seconds since 1970, or such as +30s, +10m, +2h from now.
    #[arg(long, value_name = "TIME")]
    from: Option<String>,
    /// It counts until then.
    #[arg(long, value_name = "TIME")]
    until: Option<String>,
    #[command(flatten)]
    call: Call,
}

fn kind(word: &str) -> Result<ZoneKind, String> {
    ZoneKind::of_word(word).ok_or_else(|| format!("expected one of {}", ZoneKind::WORDS.join(", ")))
}

/// Does it; 0 if every vehicle has answered, 1 if not.
pub(super) fn run(command: &ZoneCommand, as_json: bool) -> anyhow::Result<ExitCode> {
    match command {
        ZoneCommand::Add(add) => draw(add, as_json),
        ZoneCommand::Remove { name, call } => erase(call, name, as_json),
        ZoneCommand::List(call) => list(call, as_json),
    }
}

fn draw(add: &Add, as_json: bool) -> anyhow::Result<ExitCode> {
    let zones = add.zones()?;
    let mut caller = add.call.connect()?;
    for zone in &zones {
        caller.ask(json!({ "type": "draw", "zone": zone }), "mapped")?;
    }
    let is_meant = |record: &Value| zones.iter().any(|zone| record["zone"]["name"] == zone.name());
    let records = answered(&mut caller, zones.len(), is_meant)?;
    tell(&records, as_json);
    Ok(ExitCode::from(u8::from(!all_acknowledged(&records))))
}

fn erase(call: &Call, name: &str, as_json: bool) -> anyhow::Result<ExitCode> {
    let mut caller = call.connect()?;
    caller.ask(json!({ "type": "erase", "name": name }), "mapped")?;
    let records = answered(&mut caller, 0, |record| record["zone"]["name"] == name)?;
    if as_json {
        println!("{}", json!({ "removed": name, "waiting": records }));
    } else if records.is_empty() {
        println!("{name} is removed");
    } else {
        tell(&records, false);
    }
    Ok(ExitCode::from(u8::from(!records.is_empty())))
}

fn list(call: &Call, as_json: bool) -> anyhow::Result<ExitCode> {
    let zones = call.connect()?.next_of("zones")?;
    let records = zones["zones"].as_array().cloned().unwrap_or_default();
    if records.is_empty() && !as_json {
        println!("no zones are drawn");
    } else {
        tell(&records, as_json);
    }
    Ok(ExitCode::SUCCESS)
}

/// The records that are meant, once there are so many and nobody's answer is open, or after a while.
fn answered(
    caller: &mut Caller,
    count: usize,
    is_meant: impl Fn(&Value) -> bool,
) -> anyhow::Result<Vec<Value>> {
    let deadline = Instant::now() + ANSWERED_WITHIN;
    let mut newest = Vec::new();
    while let Some(zones) = caller.next_of_within("zones", deadline)? {
        newest = zones["zones"].as_array().cloned().unwrap_or_default();
        newest.retain(&is_meant);
        let is_open = |answer: &Value| answer["state"] == "pending" || answer["state"] == "missing";
        let waits = newest.iter().flat_map(answers).any(|(_, answer)| is_open(answer));
        if newest.len() == count && !waits {
            break;
        }
    }
    Ok(newest)
}

fn answers(record: &Value) -> impl Iterator<Item = (&String, &Value)> {
    record["answers"].as_object().into_iter().flatten()
}

fn all_acknowledged(records: &[Value]) -> bool {
    records.iter().flat_map(answers).all(|(_, answer)| answer["state"] == "acknowledged")
}

fn tell(records: &[Value], as_json: bool) {
    if as_json {
        println!("{}", json!({ "zones": records }));
        return;
    }
    records.iter().for_each(|record| print!("{}", in_words(record)));
}

/// A line for the zone, and one for each vehicle that has not acknowledged it.
fn in_words(record: &Value) -> String {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let (name, kind, by) = (&record["zone"]["name"], &record["zone"]["kind"], &record["by"]);
    let count = answers(record).count();
    let open: Vec<_> = answers(record).filter(|(_, answer)| answer["state"] != "acknowledged").collect();
    let verb = if record["going"] == true { "removed from" } else { "kept by" };
    let head = format!(
        "{:<16} {:<12} by {}, {verb} {} of {count}\n",
        text(name),
        text(kind).replace('_', " "),
        text(by),
        count - open.len()
    );
    let line = |(vehicle, answer): &(&String, &Value)| {
        let why = answer["why"].as_str().map(|why| format!(": {why}")).unwrap_or_default();
        format!("  {vehicle} {}{why}\n", text(&answer["state"]))
    };
    std::iter::once(head).chain(open.iter().map(line)).collect()
}

impl Add {
    fn zones(&self) -> anyhow::Result<Vec<Zone>> {
        let Some(file) = &self.file else { return Ok(vec![self.described()?]) };
        let options =
            [self.name.is_some(), self.kind.is_some(), self.centre.is_some(), self.corners.is_some()];
        ensure!(!options.contains(&true), "{file}: a file says all of a zone: leave the other options out");
        let text = std::fs::read_to_string(Path::new(file)).with_context(|| file.clone())?;
        let written: Value = serde_json::from_str(&text).with_context(|| file.clone())?;
        let list = if written.is_array() { written } else { json!([written]) };
        let tables: Vec<ZoneTable> = serde_json::from_value(list).with_context(|| file.clone())?;
        ensure!(!tables.is_empty(), "{file}: no zone is in it");
        tables.into_iter().map(|table| zone(table).with_context(|| file.clone())).collect()
    }

    fn described(&self) -> anyhow::Result<Zone> {
        let pair = |numbers: &Vec<f64>| [numbers[0], numbers[1]];
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let time = |given: &Option<String>| given.as_deref().map(|text| time_s(text, now)).transpose();
        zone(ZoneTable {
            name: self.name.clone().context("`--name` is missing: say how the zone is called")?,
            kind: self
                .kind
                .context("`--kind` is missing: no_fly, stay_inside, threat, not_above, not_below or rally")?,
            centre_m: self.centre.as_ref().map(pair),
            radius_m: self.radius,
            corners_m: self.corners.as_deref().map(corners).transpose()?,
            floor_m: self.floor,
            ceiling_m: self.ceiling,
            height_m: self.height,
            from_s: time(&self.from).context("`--from`")?,
            until_s: time(&self.until).context("`--until`")?,
        })
    }
}

fn zone(table: ZoneTable) -> anyhow::Result<Zone> {
    let name = table.name.clone();
    Zone::try_from(table).with_context(|| format!("zone `{name}`"))
}

fn corners(text: &str) -> anyhow::Result<Vec<[f64; 2]>> {
    let corner = |word: &str| {
        let (x, y) = word.split_once(',')?;
        Some([x.parse().ok()?, y.parse().ok()?])
    };
    text.split_whitespace()
        .map(|word| {
            corner(word).ok_or_else(|| anyhow!("`--corners`: `{word}`: expected metres such as \"3,-4.5\""))
        })
        .collect()
}

/// Seconds since 1970.
fn time_s(text: &str, now: Duration) -> anyhow::Result<f64> {
    let Some(ahead) = text.strip_prefix('+') else {
        return text.parse().map_err(|_| anyhow!("{text}: expected seconds since 1970, or such as +10m"));
    };
    let (number, unit_s) = match ahead.char_indices().last() {
        Some((at, 's')) => (&ahead[..at], 1.0),
        Some((at, 'm')) => (&ahead[..at], 60.0),
        Some((at, 'h')) => (&ahead[..at], 3600.0),
        _ => bail!("{text}: expected such as +30s, +10m or +2h"),
    };
    let number: f64 = number.parse().map_err(|_| anyhow!("{text}: expected such as +30s, +10m or +2h"))?;
    Ok(now.as_secs_f64() + number * unit_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_count_from_1970_or_from_now() {
        let now = Duration::from_secs(1000);
        assert_eq!(time_s("1234.5", now).unwrap(), 1234.5);
        assert_eq!(["+30s", "+2m", "+1.5h"].map(|text| time_s(text, now).unwrap()), [1030.0, 1120.0, 6400.0]);
        for wrong in ["noon", "+", "+5", "+m", "+xh"] {
            assert!(time_s(wrong, now).unwrap_err().to_string().contains(wrong), "{wrong}");
        }
    }

    #[test]
    fn corners_are_read_and_a_wrong_one_is_named() {
        assert_eq!(corners("0,0 -3,4.5").unwrap(), [[0.0, 0.0], [-3.0, 4.5]]);
        assert!(corners("0,0 3;4").unwrap_err().to_string().contains("`3;4`"));
    }

    #[test]
    fn a_zone_has_a_line_and_whoever_has_not_acknowledged_it_another() {
        let record = json!({
            "zone": { "name": "pond", "kind": "no_fly" }, "by": "Anna", "going": false,
            "answers": { "uav/1": { "state": "acknowledged" }, "uav/2": { "state": "missing" },
                         "uav/3": { "state": "refused", "why": "its disk does not take it" } }
        });
        let lines = "pond             no fly       by Anna, kept by 1 of 3\n  uav/2 missing\n  \
                     uav/3 refused: its disk does not take it\n";
        assert_eq!(in_words(&record), lines);
    }
}
