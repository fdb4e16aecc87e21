//! The verdicts that a verifier must reach about a case's program.

use std::collections::BTreeSet;
use std::sync::Arc;

use serde::Deserialize;
use skein_bp::Event;
use skein_bp::verify::{Inspection, Report, Search, Verifier, Violation, ViolationKind};

use super::{Case, expect, template_name};

/// States after which a case counts as too large.
const MOST_STATES: usize = 5_000_000;

/// A *verify* expectation.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Verification {
    inspections: Vec<Asked>,
    verdict: Verdict,
    /// The only counter-example, its cycle included.
    trace: Option<Vec<Event>>,
    /// Length of the shortest counter-example.
    shortest: Option<usize>,
    violators: Option<Vec<String>>,
    cycle_length: Option<usize>,
    /// The event that closes the cycle.
    cycle_to_event: Option<Event>,
    /// States and edges of the whole graph.
    states: Option<usize>,
    edges: Option<u64>,
    full_graph: Option<Size>,
}

/// An inspection's name; a hot run may name its group.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Asked {
    Plain(Verdict),
    OfGroup { hot_run: BTreeSet<Arc<str>> },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Verdict {
    None,
    Deadlock,
    Assertion,
    HotTermination,
    #[serde(rename = "hot_bthread")]
    HotBThread,
    HotRun,
    HotSystem,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Size {
    states: usize,
    edges: u64,
}

impl Verification {
    pub(super) fn check(&self, case: &Case) -> Result<(), String> {
        let report = self.run(case, &self.inspections()?, Search::BreadthFirst)?;
        let verdict = report.verdict.as_ref();
        expect("the verdict", &self.verdict_of(verdict), &Some(self.verdict))?;
        self.check_violation(verdict)?;
        let depth_first = self.run(case, &self.inspections()?, Search::DepthFirst)?;
        expect(
            "the verdict depth first",
            &self.verdict_of(depth_first.verdict.as_ref()),
            &Some(self.verdict),
        )?;
        let whole = self.run(case, &[], Search::BreadthFirst)?;
        if !whole.is_complete() {
            return Err(format!("not all could be explored: {whole}"));
        }
        let full = self.full_graph.as_ref();
        let states = [("states", self.states), ("states of the full graph", full.map(|size| size.states))];
        for (what, states) in states.into_iter().filter_map(|(what, states)| Some((what, states?))) {
            expect(what, &whole.states, &states)?;
        }
        let edges = [("edges", self.edges), ("edges of the full graph", full.map(|size| size.edges))];
        for (what, edges) in edges.into_iter().filter_map(|(what, edges)| Some((what, edges?))) {
            expect(what, &whole.edges, &edges)?;
        }
        Ok(())
    }

    fn run(&self, case: &Case, inspections: &[Inspection], order: Search) -> Result<Report, String> {
        let program = case.program(0).map_err(|error| error.to_string())?;
        let verifier = Verifier::new(program).inspect(inspections.iter().cloned()).order(order);
        Ok(verifier.feed(case.feed.iter().cloned()).most_states(MOST_STATES).run())
    }

    fn inspections(&self) -> Result<Vec<Inspection>, String> {
        let inspection = |asked: &Asked| match asked {
            Asked::Plain(Verdict::None) => Err("`none` is not an inspection".to_owned()),
            Asked::Plain(Verdict::Deadlock) => Ok(Inspection::Deadlock),
            Asked::Plain(Verdict::Assertion) => Ok(Inspection::FailedAssertion),
            Asked::Plain(Verdict::HotTermination) => Ok(Inspection::HotTermination),
            Asked::Plain(Verdict::HotBThread) => Ok(Inspection::HotBThread),
            Asked::Plain(Verdict::HotSystem) => Ok(Inspection::HotSystem),
            Asked::Plain(Verdict::HotRun) => match &self.violators {
                Some(group) => {
                    Ok(Inspection::HotRun(group.iter().map(|name| name.as_str().into()).collect()))
                }
                // Of a group that is not named, everybody is: a hot run of all is a hot system.
                None => Ok(Inspection::HotSystem),
            },
            Asked::OfGroup { hot_run } => Ok(Inspection::HotRun(hot_run.clone())),
        };
        self.inspections.iter().map(inspection).collect()
    }

    fn check_violation(&self, violation: Option<&Violation>) -> Result<(), String> {
        let trace = violation.map_or(&[][..], |violation| &violation.trace);
        if let Some(expected) = &self.trace
            && !(trace.len() == expected.len()
                && expected.iter().zip(trace).all(|(wanted, got)| fits(got, wanted)))
        {
            return Err(format!("the trace is {trace:?}, expected {expected:?}"));
        }
        if let Some(shortest) = self.shortest {
            expect("the length of the trace", &trace.len(), &shortest)?;
        }
        if let Some(expected) = &self.violators {
            let violators = violation.map_or(&[][..], |violation| &violation.violators);
            let names: BTreeSet<&str> = violators.iter().map(|name| template_name(name)).collect();
            expect("the set of violators", &names, &expected.iter().map(String::as_str).collect())?;
        }
        if self.cycle_length.is_some() {
            expect(
                "cycle_length",
                &violation.and_then(|violation| violation.cycle_length),
                &self.cycle_length,
            )?;
        }
        if let Some(expected) = &self.cycle_to_event {
            let last = violation.and_then(|violation| violation.cycle()?.last());
            if !last.is_some_and(|last| fits(last, expected)) {
                return Err(format!("the cycle closes with {last:?}, expected {expected:?}"));
            }
        }
        Ok(())
    }

    fn verdict_of(&self, violation: Option<&Violation>) -> Option<Verdict> {
        let asked = |verdict| self.inspections.iter().any(|a| matches!(a, Asked::Plain(v) if *v == verdict));
        Some(match violation.map(|violation| &violation.kind) {
            None => Verdict::None,
            Some(ViolationKind::Deadlock) => Verdict::Deadlock,
            Some(ViolationKind::FailedAssertion { .. }) => Verdict::Assertion,
            Some(ViolationKind::HotTermination) => Verdict::HotTermination,
            Some(ViolationKind::HotBThread) => Verdict::HotBThread,
            Some(ViolationKind::HotSystem) if asked(Verdict::HotSystem) => Verdict::HotSystem,
            Some(ViolationKind::HotRun | ViolationKind::HotSystem) => Verdict::HotRun,
            Some(_) => return None,
        })
    }
}

/// Whether an event is the one that is written; where only a name is, its data do not count.
fn fits(event: &Event, written: &Event) -> bool {
    event == written || (written.data().len() == 0 && event.name() == written.name())
}
