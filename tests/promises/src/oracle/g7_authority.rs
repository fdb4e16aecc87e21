//! G7: a bid beyond its sender's rights counts for nothing, its sender is told, and its home notes it.
//!
//! That such a block holds nothing back is seen by G5's observer, and that it is never confirmed by G3's.

use skein_bp::catalogue::Declared as _;
use skein_dbp::facts::{Denied, Refused};
use std::collections::BTreeSet;
use std::time::Duration;

use skein_bp::Origin;

use super::{Findings, Oracle};
use crate::knowledge::{Knowledge, Step};
use crate::promise::Promise;

/// Follows who was told of which refusals: sender, its b-thread, and home.
#[derive(Default)]
pub(super) struct Rights {
    told: BTreeSet<(usize, String, usize)>,
    /// Of several in one record the home notes one, and how many more there are.
    noted: BTreeSet<(usize, usize)>,
}

impl Oracle for Rights {
    fn judge(&mut self, step: &Step<'_>, knowledge: &Knowledge, findings: &mut Findings) {
        let me = knowledge.member(step.node);
        for happened in step.happened {
            let event = &happened.event;
            if me.is_fact(happened) {
                if let Some(refused) = Refused::read(event)
                    && let Some(home) = knowledge.number(refused.home.as_str())
                {
                    self.told.insert((step.node, refused.bthread.to_string(), home));
                } else if let Some(denied) = Denied::read(event)
                    && let Some(node) = knowledge.number(denied.node.as_str())
                {
                    self.noted.insert((node, step.node));
                }
            } else if happened.origin == Origin::Internal {
                let remote = happened.requested_by.iter().filter_map(|name| name.split_once('#'));
                for (node, bthread) in remote.filter(|(node, _)| !me.may_request(node, event)) {
                    let what = format!("{event} occurred for {bthread} of {node}, which may not request it");
                    findings.broken(Promise::G7, step.node, what);
                }
            }
        }
    }

    fn ends(&mut self, at: Duration, knowledge: &Knowledge, findings: &mut Findings) {
        let settled = at.saturating_sub(4 * knowledge.longest_lease);
        for (node, member) in knowledge.members.iter().enumerate() {
            for (bthread, stated) in member.bids.iter().filter(|(_, stated)| stated.since < settled) {
                for (home, at_home) in knowledge.members.iter().enumerate() {
                    let name = member.name.as_str();
                    let asks = stated.bid.requests().iter().any(|event| {
                        knowledge.home_of(event, node) == Some(home) && !at_home.may_request(name, event)
                    });
                    let blocks = stated.bid.blocks();
                    let holds = member.concerns(blocks, &at_home.name) && !at_home.may_block(name, blocks);
                    let key = (node, bthread.clone(), home);
                    if home != node
                        && (asks || holds)
                        && !(self.told.contains(&key) && self.noted.contains(&(node, home)))
                    {
                        let what =
                            format!("what {bthread} may not bid at {} was not told to both", at_home.name);
                        findings.broken(Promise::G7, node, what);
                    }
                }
            }
        }
    }
}
