//! G6: a safety event that a node wants itself occurs at once, and nobody else can bring it about.

use skein_bp::Origin;

use super::g5_loss::waiting;
use super::{Findings, Oracle};
use crate::knowledge::{Knowledge, Step};
use crate::promise::Promise;

/// Watches each node's safety events.
pub(super) struct SafeAlone;

impl Oracle for SafeAlone {
    fn judge(&mut self, step: &Step<'_>, knowledge: &Knowledge, findings: &mut Findings) {
        let home = knowledge.member(step.node);
        for event in waiting(step, knowledge) {
            if home.safety.contains(&event) {
                let what = format!("{event} is requested here, and has not occurred within the step");
                findings.broken(Promise::G6, step.node, what);
            }
        }
        for happened in step.happened.iter().filter(|happened| happened.origin == Origin::Internal) {
            let event = &happened.event;
            if home.safety.contains(event) && !home.gateway.contains(event) {
                for requester in happened.requested_by.iter().filter(|name| name.contains('#')) {
                    let what = format!("{event} occurred at the request of {requester}, past the gateway");
                    findings.broken(Promise::G6, step.node, what);
                }
            }
        }
    }
}
