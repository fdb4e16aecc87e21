//! A rule in one vehicle: `cargo run -p skein-bp --example low_battery`.
//!
//! Prints what happens without the rule and with it. [docs/guide.md](../../../docs/guide.md) explains it.

use std::time::Duration;

use serde::Serialize;
use skein_bp::script::{Op, Script};
use skein_bp::{BThread, Bid, Context, Event, Program, ProgramConfig};

/// Keeps a vehicle out of the gate while its battery is low.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum LowBattery {
    Charged,
    Low,
}

impl BThread for LowBattery {
    fn bid(&self) -> Option<Bid> {
        Some(match self {
            Self::Charged => Bid::new().wait_for("uav/1/battery_low"),
            Self::Low => Bid::new().wait_for("uav/1/charged").block("uav/1/enter"),
        })
    }

    fn resume(&mut self, _: &Event, _: &mut Context) {
        *self = match self {
            Self::Charged => Self::Low,
            Self::Low => Self::Charged,
        };
    }
}

/// A mission that flies through the gate, and knows of no battery.
fn vehicle() -> Result<Program, Box<dyn std::error::Error>> {
    let mut program = Program::new(ProgramConfig::vehicle(1));
    let step = |event: &str| Op::Sync(Bid::new().request(event));
    program.add("mission", Script::new(&["uav/1/approach", "uav/1/enter", "uav/1/leave"].map(step))?);
    Ok(program)
}

/// What happens when the battery is found low, and charged a minute later.
fn fly(mut program: Program) -> Result<String, Box<dyn std::error::Error>> {
    let mut told = String::new();
    for (seconds, news) in [(0, "uav/1/battery_low"), (60, "uav/1/charged")] {
        // The battery's report comes first, as on a vehicle that finds it low before it sets out.
        program.occurred(news);
        for selection in program.superstep(Duration::from_secs(seconds))? {
            told += &format!("  {seconds:>2} s  {}\n", selection.event);
        }
        let enter = program.explain("uav/1/enter");
        if !enter.requested.is_empty() {
            told += &enter.to_string();
        }
    }
    Ok(told)
}

fn report() -> Result<String, Box<dyn std::error::Error>> {
    let mut with_rule = vehicle()?;
    with_rule.add("low battery", LowBattery::Charged);
    Ok(format!("without the rule\n{}with the rule\n{}", fly(vehicle()?)?, fly(with_rule)?))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    print!("{}", report()?);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alone_it_blocks_enter_from_battery_low_to_charged() {
        let mut rule = LowBattery::Charged;
        assert!(rule.bid().unwrap().blocks().is_none());
        rule.resume(&Event::new("uav/1/battery_low"), &mut Context::at(Duration::ZERO));
        assert!(rule.bid().unwrap().blocks().contains(&Event::new("uav/1/enter")));
        rule.resume(&Event::new("uav/1/charged"), &mut Context::at(Duration::from_secs(60)));
        assert_eq!(rule, LowBattery::Charged);
    }

    #[test]
    fn in_a_program_the_mission_waits_for_it() {
        let mut program = vehicle().unwrap();
        program.add("low battery", LowBattery::Low);
        program.superstep(Duration::ZERO).unwrap();
        assert!(program.selectable().is_empty());
        program.enqueue("uav/1/charged");
        let selections = program.superstep(Duration::ZERO).unwrap();
        let names: Vec<_> = selections.iter().map(|selection| selection.event.name()).collect();
        assert_eq!(names, ["uav/1/charged", "uav/1/enter", "uav/1/leave"]);
    }

    #[test]
    fn the_guide_shows_what_it_prints() {
        assert!(include_str!("../../../docs/guide.md").contains(&report().unwrap()));
    }
}
