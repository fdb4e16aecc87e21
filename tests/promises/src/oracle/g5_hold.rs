//! G5, for blocks that are to outlive their holders: once confirmed, they stay through the loss of the holder and the
//! restart of the home, until they are withdrawn or an authority lifts them.

use skein_bp::catalogue::Declared as _;
use skein_dbp::facts::Confirmed;
use std::collections::BTreeSet;

use skein_bp::Origin;

use super::{Findings, Oracle};
use crate::knowledge::{Knowledge, Step};
use crate::promise::Promise;

/// Knows which blocks were confirmed: holder, its life, b-thread and synchronisation point.
#[derive(Default)]
pub(super) struct Hold {
    confirmed: BTreeSet<(usize, u64, String, u64)>,
}

impl Oracle for Hold {
    fn judge(&mut self, step: &Step<'_>, knowledge: &Knowledge, findings: &mut Findings) {
        let me = knowledge.member(step.node);
        for happened in step.happened {
            let event = &happened.event;
            if me.is_fact(happened)
                && let Some(Confirmed { bthread, sync }) = Confirmed::read(event)
            {
                self.confirmed.insert((step.node, me.incarnation(), bthread.to_string(), sync));
            }
            if happened.origin == Origin::Occurred || !me.lets_block(event) {
                continue;
            }
            for ((holder, bthread), kept) in me.kept.iter().filter(|(_, kept)| kept.set.contains(event)) {
                let stay = (*holder, kept.incarnation, bthread.clone(), kept.sync);
                if self.confirmed.contains(&stay) {
                    let holder = &knowledge.member(*holder).name;
                    let what =
                        format!("{event} occurred, which {bthread} of {holder} blocks even when it is lost");
                    findings.broken(Promise::G5, step.node, what);
                }
            }
        }
    }
}
