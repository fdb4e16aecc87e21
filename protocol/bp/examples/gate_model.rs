//! A gate that takes one vehicle at a time, verified: `cargo run -p skein-bp --example gate_model`.
//!
//! Two vehicles and the network between them are one program here. [docs/guide.md](../../../docs/guide.md) explains it.

use std::collections::VecDeque;

use serde::Serialize;
use skein_bp::script::{Op, Script, ScriptError};
use skein_bp::verify::{Report, Verifier};
use skein_bp::{BThread, Bid, Context, Event, Program, ProgramConfig};

/// Tells one vehicle what happens to the other, later: `heard/1/enter` some time after `uav/2/enter`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Air {
    from: u8,
    to: u8,
    under_way: VecDeque<String>,
}

impl BThread for Air {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new()
            .wait_for(format!("uav/{}/enter", self.from))
            .wait_for(format!("uav/{}/leave", self.from));
        Some(match self.under_way.front() {
            Some(kind) => bid.request(format!("heard/{}/{kind}", self.to)),
            None => bid,
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        match event.home().starts_with("uav/") {
            true => self.under_way.push_back(event.kind().to_owned()),
            false => drop(self.under_way.pop_front()),
        }
    }
}

/// Holds the vehicle back while it has heard that the other is inside. The naive rule.
fn looks(me: u8) -> Result<Script, ScriptError> {
    let entered = Bid::new().wait_for(format!("heard/{me}/enter"));
    let left = Bid::new().wait_for(format!("heard/{me}/leave")).block(format!("uav/{me}/enter"));
    Script::new(&[Op::forever([Op::Sync(entered), Op::Sync(left)])])
}

/// Keeps the other out, from approach to leave.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Claims {
    me: u8,
    other: u8,
    /// Whether it gives way to the other's claim while it is outside.
    yields: bool,
    phase: Phase,
    other_claims: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
enum Phase {
    Away,
    Claiming,
    Inside,
}

impl Claims {
    fn new(me: u8, other: u8, yields: bool) -> Self {
        Self { me, other, yields, phase: Phase::Away, other_claims: false }
    }
}

impl BThread for Claims {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().wait_for(["uav/*/approach", "uav/*/enter", "uav/*/leave"]);
        let holds = match self.phase {
            Phase::Away => false,
            Phase::Claiming => !(self.yields && self.other_claims),
            Phase::Inside => true,
        };
        Some(if holds { bid.block(format!("uav/{}/enter", self.other)) } else { bid })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        if event.home() == format!("uav/{}", self.other) {
            self.other_claims = event.kind() != "leave";
            return;
        }
        self.phase = match event.kind() {
            "approach" => Phase::Claiming,
            "enter" => Phase::Inside,
            _ => Phase::Away,
        };
    }
}

/// The requirement: fails when a vehicle enters while another is inside.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum OneAtATime {
    Empty,
    Taken,
}

impl BThread for OneAtATime {
    fn bid(&self) -> Option<Bid> {
        Some(Bid::new().wait_for(["uav/*/enter", "uav/*/leave"]))
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        *self = match (&*self, event.kind()) {
            (Self::Empty, _) => Self::Taken,
            (Self::Taken, "leave") => Self::Empty,
            (Self::Taken, _) => return cx.fail("two are inside"),
        };
    }
}

/// Two vehicles that fly through the gate again and again, and what must hold.
fn gate() -> Result<Program, ScriptError> {
    let mut program = Program::new(ProgramConfig::default());
    for me in [1, 2] {
        let step = |what: &str| Op::Sync(Bid::new().request(format!("uav/{me}/{what}")));
        program.add(
            format!("mission {me}"),
            Script::new(&[Op::forever(["approach", "enter", "leave"].map(step))])?,
        );
    }
    program.add("one at a time", OneAtATime::Empty);
    Ok(program)
}

/// The naive rule: each vehicle looks, then enters.
fn naive() -> Result<Report, ScriptError> {
    let mut program = gate()?;
    for (me, other) in [(1, 2), (2, 1)] {
        program.add(format!("air to {me}"), Air { from: other, to: me, under_way: VecDeque::new() });
        program.add(format!("look {me}"), looks(me)?);
    }
    Ok(Verifier::new(program).run())
}

/// Each vehicle keeps the other out; the second gives way if told to.
fn guarded(second_yields: bool) -> Result<Report, ScriptError> {
    let mut program = gate()?;
    program.add("claim 1", Claims::new(1, 2, false));
    program.add("claim 2", Claims::new(2, 1, second_yields));
    Ok(Verifier::new(program).run())
}

fn report() -> Result<String, ScriptError> {
    let (naive, stubborn, yielding) = (naive()?, guarded(false)?, guarded(true)?);
    Ok(format!(
        "look, then enter\n{naive}\n\nblock, then enter\n{stubborn}\n\nblock, and the second yields\n{yielding}\n"
    ))
}

fn main() -> Result<(), ScriptError> {
    print!("{}", report()?);
    Ok(())
}

#[cfg(test)]
mod tests {
    use skein_bp::verify::ViolationKind;

    use super::*;

    #[test]
    fn who_only_looks_may_find_another_inside() {
        let violation = naive().unwrap().verdict.unwrap();
        assert_eq!(violation.kind, ViolationKind::FailedAssertion { message: "two are inside".into() });
    }

    #[test]
    fn two_that_keep_each_other_out_are_stuck() {
        let violation = guarded(false).unwrap().verdict.unwrap();
        assert_eq!(violation.kind, ViolationKind::Deadlock);
        assert_eq!(violation.trace, [Event::new("uav/1/approach"), Event::new("uav/2/approach")]);
    }

    #[test]
    fn with_one_that_yields_nothing_goes_wrong_in_any_run() {
        let report = guarded(true).unwrap();
        assert!(report.verdict.is_none() && report.is_complete(), "{report}");
    }

    #[test]
    fn the_guide_shows_what_it_prints() {
        assert!(include_str!("../../../docs/guide.md").contains(&report().unwrap()));
    }
}
