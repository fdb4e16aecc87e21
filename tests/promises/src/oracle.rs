//! The observers: one for each promise. They see all nodes and the true time, and believe no node.

mod g1_order;
mod g2_cause;
mod g3_confirmed_block;
mod g4_once;
mod g5_hold;
mod g5_loss;
mod g6_safe_alone;
mod g7_authority;
mod g8_joint;
mod g9_equivalence;
mod goes_on;

use std::time::Duration;

use skein_bp::Program;

use crate::knowledge::{Knowledge, Step};
use crate::promise::{Promise, Violation};
use crate::story::Story;

/// Watches over one promise.
trait Oracle {
    /// A node begins a life, with this program.
    fn starts(&mut self, node: usize, program: &Program, knowledge: &Knowledge) {
        let _ = (node, program, knowledge);
    }

    /// A node has made a step: what it received is known already, what its b-threads state now is not yet.
    fn judge(&mut self, step: &Step<'_>, knowledge: &Knowledge, findings: &mut Findings);

    /// The run is over at `at`.
    fn ends(&mut self, at: Duration, knowledge: &Knowledge, findings: &mut Findings) {
        let _ = (at, knowledge, findings);
    }
}

/// What the observers have found in one step.
#[derive(Default)]
pub(crate) struct Findings(Vec<(Promise, usize, String)>);

impl Findings {
    fn broken(&mut self, promise: Promise, node: usize, what: String) {
        self.0.push((promise, node, what));
    }
}

pub(crate) struct Court {
    knowledge: Knowledge,
    oracles: Vec<Box<dyn Oracle>>,
}

impl Court {
    pub(crate) fn new(story: &Story) -> Self {
        let nodes = story.casts.len();
        Self {
            knowledge: Knowledge::new(story),
            oracles: vec![
                Box::new(g1_order::Order::new(nodes)),
                Box::new(g2_cause::Cause),
                Box::new(g3_confirmed_block::ConfirmedBlock::default()),
                Box::new(g4_once::Once::default()),
                Box::new(g5_loss::Loss),
                Box::new(g6_safe_alone::SafeAlone),
                Box::new(g5_hold::Hold::default()),
                Box::new(g7_authority::Rights::default()),
                Box::new(g8_joint::Joint::new(story)),
                Box::new(g9_equivalence::Equivalence::new(story)),
                Box::new(goes_on::GoesOn::new(story)),
            ],
        }
    }

    /// A node begins a life with this program.
    pub(crate) fn starts(&mut self, node: usize, at: Duration, program: &Program) {
        self.knowledge.starts(node, at);
        self.oracles.iter_mut().for_each(|oracle| oracle.starts(node, program, &self.knowledge));
    }

    pub(crate) fn dies(&mut self, node: usize) {
        self.knowledge.dies(node);
    }

    /// A node stands still, until its next step.
    pub(crate) fn pauses(&mut self, node: usize) {
        self.knowledge.members[node].paused = true;
    }

    /// Judges a step; the first violation, if there is one.
    pub(crate) fn judge(&mut self, step: &Step<'_>) -> Option<Violation> {
        self.knowledge.receive(step);
        let mut findings = Findings::default();
        for oracle in &mut self.oracles {
            oracle.judge(step, &self.knowledge, &mut findings);
        }
        self.knowledge.conclude(step);
        self.knowledge.members[step.node].paused = false;
        self.first(step.at, findings)
    }

    /// Judges the run as a whole.
    pub(crate) fn ends(&mut self, at: Duration) -> Option<Violation> {
        let mut findings = Findings::default();
        self.oracles.iter_mut().for_each(|oracle| oracle.ends(at, &self.knowledge, &mut findings));
        self.first(at, findings)
    }

    fn first(&self, at: Duration, findings: Findings) -> Option<Violation> {
        let (promise, node, what) = findings.0.into_iter().next()?;
        Some(Violation { promise, at, node: self.knowledge.member(node).name.clone(), what })
    }
}
