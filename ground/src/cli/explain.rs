//! `explain`: a moment of a recorded mission, in words.

use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context as _;
use serde_json::json;
use skein_dbp::NodeName;

use crate::explain::{Evidence, Explanation, Recorded, explain};

/// Explains one vehicle, or all of them, `at_s` seconds into the mission. Exits with 1 when there is nothing to
/// explain.
pub fn run(file: &Path, at_s: Option<f64>, vehicle: Option<&str>, json: bool) -> anyhow::Result<ExitCode> {
    let recorded = Recorded::open(file)?;
    let nothing = |why: &str| {
        let reason = format!("{}: {why}", file.display());
        if json {
            println!("{}", json!({ "error": reason }));
        }
        eprintln!("skein-ground: {reason}");
        Ok(ExitCode::FAILURE)
    };
    let Some(span) = recorded.span() else { return nothing("it holds nothing") };
    let at = moment(at_s, span).with_context(|| file.display().to_string())?;
    if !recorded.has_boards() {
        return nothing("it does not tell what b-threads requested and blocked; record the mission anew");
    }
    let evidence = recorded.evidence_at(at);
    let vehicles: Vec<NodeName> = match vehicle {
        Some(given) => vec![find(&evidence, given).with_context(|| file.display().to_string())?],
        None => evidence.vehicles().cloned().collect(),
    };
    if vehicles.is_empty() {
        return nothing("no vehicle was heard");
    }
    let explanations: Vec<Explanation> =
        vehicles.iter().filter_map(|vehicle| explain(&evidence, at, vehicle)).collect();
    if json {
        let complete = recorded.is_complete();
        println!("{}", json!({ "at_s": at.as_secs_f64(), "complete": complete, "vehicles": explanations }));
        return Ok(ExitCode::SUCCESS);
    }
    if !recorded.is_complete() {
        println!("The recording was cut short: it goes to {:.1} s.", span.1.as_secs_f64());
    }
    println!("At {:.1} s", at.as_secs_f64());
    for explanation in &explanations {
        // Of many, those that move need no more than a line.
        if vehicle.is_none() && explanation.changes.is_empty() {
            println!("{}", explanation.headline());
        } else {
            print!("{explanation}");
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The moment meant, within what was recorded.
fn moment(at_s: Option<f64>, (first, last): (Duration, Duration)) -> anyhow::Result<Duration> {
    let at_s = match at_s {
        None => return Ok(last),
        Some(back) if back.is_sign_negative() => last.as_secs_f64() + back,
        Some(at_s) => at_s,
    };
    let at = Duration::try_from_secs_f64(at_s).ok().filter(|at| (first..=last).contains(at));
    at.with_context(|| {
        let (first, last) = (first.as_secs_f64(), last.as_secs_f64());
        format!("--at {at_s}: the recording goes from {first:.3} to {last:.3} s")
    })
}

/// The vehicle of this number or name.
fn find(evidence: &Evidence, given: &str) -> anyhow::Result<NodeName> {
    let is_meant = |name: &&NodeName| name.as_str() == given || name.id() == given;
    evidence.vehicles().find(is_meant).cloned().with_context(|| {
        let names: Vec<&str> = evidence.vehicles().map(NodeName::as_str).collect();
        format!("--vehicle {given}: there is no such vehicle, but {}", names.join(", "))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moment_is_counted_from_either_end_and_lies_within() {
        let span = (Duration::from_secs(1), Duration::from_secs(61));
        let at = |at_s| moment(at_s, span).map(|at| at.as_secs_f64());
        assert_eq!(at(None).unwrap(), 61.0);
        assert_eq!(at(Some(18.5)).unwrap(), 18.5);
        assert_eq!(at(Some(-60.0)).unwrap(), 1.0);
        for outside in [0.5, 61.5, -60.5, -100.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let error = at(Some(outside)).unwrap_err().to_string();
            assert!(error.contains("from 1.000 to 61.000 s"), "{error}");
        }
    }

    #[test]
    fn a_vehicle_is_meant_by_number_or_name_and_others_are_named_in_its_place() {
        let mut evidence = Evidence::default();
        for name in ["uav/1", "uav/12"] {
            evidence.note_vehicle(&NodeName::new(name).unwrap());
        }
        assert_eq!(find(&evidence, "1").unwrap().as_str(), "uav/1");
        assert_eq!(find(&evidence, "uav/12").unwrap().as_str(), "uav/12");
        let error = find(&evidence, "2").unwrap_err().to_string();
        assert!(error.contains("uav/1, uav/12"), "{error}");
    }
}
