//! G2: an event occurs only while a bid in its home's table requests it, and its b-thread has really stated that.
//!
//! That local requests are real is seen by G9's replay, which has no other cause to select anything.

use skein_bp::Origin;

use super::{Findings, Oracle};
use crate::knowledge::{Knowledge, Step};
use crate::promise::Promise;

/// Knows the newest record of each bidder as it has come to each home.
pub(super) struct Cause;

impl Oracle for Cause {
    fn judge(&mut self, step: &Step<'_>, knowledge: &Knowledge, findings: &mut Findings) {
        let home = knowledge.member(step.node);
        for happened in step.happened {
            if happened.origin != Origin::Internal {
                continue;
            }
            let event = &happened.event;
            if happened.requested_by.is_empty() {
                findings.broken(Promise::G2, step.node, format!("{event} occurred, and nobody requested it"));
            }
            for requester in &happened.requested_by {
                let Some((node, bthread)) = requester.split_once('#') else { continue };
                let Some(bidder) = knowledge.number(node) else { continue };
                let heard = home.table.get(&bidder);
                let bid = heard.and_then(|heard| heard.record.bids.iter().find(|bid| bid.bthread == bthread));
                let (Some(heard), Some(bid)) = (heard, bid.filter(|bid| bid.requests.contains(event))) else {
                    let what =
                        format!("{event} occurred for {requester}, whose newest record does not request it");
                    findings.broken(Promise::G2, step.node, what);
                    continue;
                };
                if heard.has_lapsed(step.clock) {
                    let what = format!("{event} occurred for {requester}, whose lease had run out");
                    findings.broken(Promise::G5, step.node, what);
                }
                let stated = knowledge.stated(bidder, heard.record.incarnation, bthread, bid.sync);
                if !stated.is_some_and(|stated| stated.requests().contains(event)) {
                    let sync = bid.sync;
                    let what = format!(
                        "{event} occurred for {requester}, which never stated that at its point {sync}"
                    );
                    findings.broken(Promise::G2, step.node, what);
                }
            }
        }
    }
}
