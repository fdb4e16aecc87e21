//! The faults of a single state.

use std::sync::Arc;

use crate::verify::bits::{has, union};
use crate::verify::locals::{Kind, Local};
use crate::verify::product::Product;
use crate::verify::report::{Fault, Inspection, ViolationKind};

impl Product {
    /// The b-thread whose assertion has failed, and what it said.
    pub(in crate::verify) fn failure(&self, state: &[u32]) -> Option<(&Arc<str>, &str)> {
        self.beside(state)?.failure.as_ref().map(|(bthread, message)| (bthread, &**message))
    }

    /// Whether the b-threads among themselves allow nothing, as [`Program::is_deadlocked`] has it.
    fn is_deadlocked(&self, state: &[u32]) -> bool {
        let mut blocked = Vec::new();
        let ids = state.get(1..).unwrap_or_default();
        let own = |id: &&u32| self.locals.get(**id).is_some_and(|local| !local.is_proxy());
        union(
            &mut blocked,
            self.locals.width(),
            ids.iter().filter(own).map(|id| self.locals.bits(*id, Kind::Blocks)),
        );
        let stuck = |event: &u32| has(&blocked, *event);
        let home = |event: &&u32| {
            self.locals.events.get(**event).is_some_and(|e| self.locals.rules.home.contains(e))
        };
        let Some(beside) = self.beside(state) else { return false };
        self.locals.of(state).any(|local| !local.is_proxy() && !local.requests.is_empty())
            && self.locals.of(state).flat_map(|local| &local.requests).all(stuck)
            && beside.externals.iter().filter(home).all(stuck)
    }

    pub(super) fn fault_by(&self, inspection: &Inspection, state: &[u32], stuck: bool) -> Option<Fault> {
        let names = |is: &dyn Fn(&Local) -> bool| -> Vec<Arc<str>> {
            self.locals.of(state).filter(|local| is(local)).map(|local| local.name.clone()).collect()
        };
        let failure = self.failure(state);
        let at_rest =
            stuck && failure.is_none() && !self.locals.of(state).any(|l| l.bid.given_deadline().is_some());
        match inspection {
            Inspection::FailedAssertion => failure.map(|(bthread, message)| Fault {
                kind: ViolationKind::FailedAssertion { message: message.to_owned() },
                violators: vec![bthread.clone()],
            }),
            Inspection::Deadlock if at_rest && self.is_deadlocked(state) => Some(Fault {
                kind: ViolationKind::Deadlock,
                violators: names(&|local| !local.is_proxy() && !local.requests.is_empty()),
            }),
            Inspection::HotTermination if at_rest => {
                let violators = names(&|local| local.bid.is_hot());
                (!violators.is_empty()).then_some(Fault { kind: ViolationKind::HotTermination, violators })
            }
            _ => None,
        }
    }

    pub(super) fn broken_by_bid(&self, state: &[u32]) -> Option<Fault> {
        let (name, (rule, message)) =
            self.locals.of(state).find_map(|local| Some((&local.name, local.fault.as_ref()?)))?;
        let kind = ViolationKind::Invariant { invariant: rule.clone(), message: message.clone() };
        Some(Fault { kind, violators: vec![name.clone()] })
    }

    pub(super) fn broken_invariant(&self, state: &[u32]) -> Option<Fault> {
        let view = self.view(state);
        self.invariants.iter().find_map(|invariant| {
            let message = (invariant.holds)(&view).err()?;
            let kind = ViolationKind::Invariant { invariant: invariant.name.clone(), message };
            Some(Fault { kind, violators: Vec::new() })
        })
    }
}
