//! G7: a bid beyond its sender's rights counts for nothing, its sender is told, and its home notes it.
//!
//! That such a block holds nothing back is seen by G5's observer, and that it is never confirmed by G3's.

use std::collections::BTreeSet;
use std::time::Duration;

use skein_bp::Origin;
use skein_dbp::facts;

use super::{Findings, Oracle};
use crate::knowledge::{Knowledge, Step};
use crate::promise::Promise;

/// Follows who was told of which refusals: sender, its b-thread, and home.
#[derive(Default)]
pub(super) struct Rights {
    told: BTreeSet<(usize, String, usize)>,
    noted: BTreeSet<(usize, String, usize)>,
}

impl Oracle for Rights {
    fn judge(&mut self, step: &Step<'_>, knowledge: &Knowledge, findings: &mut Findings) {
        let me = knowledge.member(step.node);
        for happened in step.happened {
            let event = &happened.event;
            let named = |key: &str| event.text(key).and_then(|name| knowledge.number(name));
            let bthread = || event.text("bthread").unwrap_or_default().to_owned();
            if me.is_fact(happened) {
                match (event.kind(), named("home"), named("node")) {
                    (facts::REFUSED, Some(home), _) => drop(self.told.insert((step.node, bthread(), home))),
                    (facts::DENIED, _, Some(node)) => drop(self.noted.insert((node, bthread(), step.node))),
                    _ => {}
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
                        && !(self.told.contains(&key) && self.noted.contains(&key))
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
