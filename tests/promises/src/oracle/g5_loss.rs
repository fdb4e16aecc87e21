//! G5: what a lost node has blocked lapses with its lease: no event waits for a block that nobody upholds.
//!
//! That its requests lapse is seen by G2's observer, which knows each requester.

use skein_bp::Event;

use super::{Findings, Oracle};
use crate::knowledge::{Knowledge, Step};
use crate::promise::Promise;

/// After each step, asks why each event that is requested at home has not occurred.
pub(super) struct Loss;

impl Oracle for Loss {
    fn judge(&mut self, step: &Step<'_>, knowledge: &Knowledge, findings: &mut Findings) {
        for event in waiting(step, knowledge) {
            if !has_reason_to_wait(step, &event, knowledge) {
                let what = format!("{event} is requested here and blocked by nobody, and yet does not occur");
                findings.broken(Promise::G5, step.node, what);
            }
        }
    }
}

/// The node's own requests for its own events that are still open, and that none of its own b-threads blocks.
pub(super) fn waiting(step: &Step<'_>, knowledge: &Knowledge) -> Vec<Event> {
    let home = &knowledge.member(step.node).home;
    let requests = step.program.bids().flat_map(|(_, bid, _)| bid.requests());
    let here = requests.filter(|event| home.contains(event));
    here.filter(|event| step.program.bids().all(|(_, bid, _)| !bid.blocks().contains(event)))
        .cloned()
        .collect()
}

fn has_reason_to_wait(step: &Step<'_>, event: &Event, knowledge: &Knowledge) -> bool {
    let home = knowledge.member(step.node);
    // G6's observer asks about safety events.
    let safe = home.safety.contains(event);
    let began = home.present().and_then(|life| life.began_clock).unwrap_or(step.clock);
    let guarded = home.guarded.contains(event) && step.clock < began + knowledge.longest_lease;
    let blocked = home.lets_block(event)
        && home.table.values().any(|heard| {
            let who = heard.record.node.as_str();
            !heard.has_lapsed(step.clock)
                && heard
                    .record
                    .bids
                    .iter()
                    .any(|bid| bid.block.contains(event) && home.may_block(who, &bid.block))
        });
    let kept = home.lets_block(event) && home.kept.values().any(|kept| kept.set.contains(event));
    safe || guarded || blocked || kept
}
