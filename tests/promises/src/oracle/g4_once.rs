//! G4: each request is satisfied at most once, over all lives of its home; those open at a restart become `unknown`.

use std::collections::{BTreeMap, BTreeSet};

use skein_bp::catalogue::Declared as _;
use skein_bp::{Event, Origin, Program};
use skein_dbp::Happened;
use skein_dbp::facts::{PeerJoined, Unknown};

use super::{Findings, Oracle};
use crate::knowledge::{Knowledge, Member, Step};
use crate::promise::Promise;

/// A b-thread's stay at a synchronisation point: its node, life, name and the point.
type Stay = (usize, u64, String, u64);

/// Keeps account of all requests.
#[derive(Default)]
pub(super) struct Once {
    served: BTreeSet<Stay>,
    /// The newest stay of each b-thread for which a request came to a home, and for which life of it.
    addressed: BTreeMap<(usize, usize, String), (u64, u64, u64)>,
    /// The life in which each node last met each other one.
    met: BTreeMap<(usize, usize), u64>,
}

impl Oracle for Once {
    fn starts(&mut self, node: usize, _: &Program, _: &Knowledge) {
        self.met.retain(|(observer, _), _| *observer != node);
    }

    fn judge(&mut self, step: &Step<'_>, knowledge: &Knowledge, findings: &mut Findings) {
        self.note_addressed(step, knowledge);
        for happened in step.happened {
            if happened.origin == Origin::Internal {
                self.serves(step, happened, knowledge, findings);
            } else if knowledge.member(step.node).is_fact(happened)
                && happened.event.kind() == PeerJoined::NAME
            {
                self.meets(step, happened, knowledge, findings);
            }
        }
    }
}

impl Once {
    fn note_addressed(&mut self, step: &Step<'_>, knowledge: &Knowledge) {
        for record in step.received {
            let Some(bidder) = knowledge.number(record.node.as_str()) else { continue };
            let Some(life) = record.home_incarnation else { continue };
            for bid in record.bids.iter().filter(|bid| !bid.requests.is_empty()) {
                let newest = self.addressed.entry((bidder, step.node, bid.bthread.clone())).or_default();
                *newest = (*newest).max((record.incarnation, bid.sync, life));
            }
        }
    }

    fn serves(
        &mut self,
        step: &Step<'_>,
        happened: &Happened,
        knowledge: &Knowledge,
        findings: &mut Findings,
    ) {
        let home = knowledge.member(step.node);
        let event = &happened.event;
        for requester in &happened.requested_by {
            let Some((node, bthread)) = requester.split_once('#') else {
                self.serves_itself(step, event, requester, home, findings);
                continue;
            };
            let heard = knowledge.number(node).and_then(|bidder| Some((bidder, home.table.get(&bidder)?)));
            let Some((bidder, heard)) = heard else { continue };
            let record = &heard.record;
            let Some(bid) = record.bids.iter().find(|bid| bid.bthread == bthread) else { continue };
            let mut broken = |what: String| {
                let what = format!("{event} occurred for {requester} at its point {}, {what}", bid.sync);
                findings.broken(Promise::G4, step.node, what);
            };
            if !self.served.insert((bidder, record.incarnation, bthread.to_owned(), bid.sync)) {
                broken("which had been served".to_owned());
            }
            if record.home_incarnation != Some(home.incarnation()) {
                broken(format!("which was meant for life {:?} of its home", record.home_incarnation));
            }
            // What has occurred since the record was sent resumes the b-thread: it asks no more.
            let since = usize::try_from(record.applied).unwrap_or(usize::MAX);
            let until = usize::try_from(happened.seq.saturating_sub(1)).unwrap_or(usize::MAX);
            let occurred =
                home.present().and_then(|life| life.occurred.get(since..until)).unwrap_or_default();
            if happened.term == 0 && occurred.iter().any(|occurred| bid.requests.contains(occurred)) {
                broken("which an earlier occurrence had satisfied".to_owned());
            }
        }
    }

    /// A node decides at its own request; it may have asked another one before, when that was the coordinator.
    fn serves_itself(
        &self,
        step: &Step<'_>,
        event: &Event,
        bthread: &str,
        home: &Member,
        findings: &mut Findings,
    ) {
        let stated = home.bids.get(bthread).filter(|stated| stated.bid.requests().contains(event));
        let Some(sync) = stated.map(|stated| stated.sync) else { return };
        if self.served.contains(&(step.node, home.incarnation(), bthread.to_owned(), sync)) {
            let what =
                format!("{event} occurred for {bthread} at its point {sync}, which was served elsewhere");
            findings.broken(Promise::G4, step.node, what);
        }
    }

    /// A node hears that a home has restarted: whatever it asked of the former life has to be told as unknown.
    fn meets(
        &mut self,
        step: &Step<'_>,
        happened: &Happened,
        knowledge: &Knowledge,
        findings: &mut Findings,
    ) {
        let me = knowledge.member(step.node);
        let Some(PeerJoined { node, incarnation }) = PeerJoined::read(&happened.event) else { return };
        let Some(home) = knowledge.number(node.as_str()) else { return };
        let known = self.met.insert((step.node, home), incarnation);
        if known.is_none_or(|known| known == incarnation) {
            return;
        }
        for (bthread, stated) in &me.bids {
            let asked = self.addressed.get(&(step.node, home, bthread.clone()));
            let open = asked.is_some_and(|(life, sync, meant_for)| {
                *life == me.incarnation() && *sync == stated.sync && *meant_for < incarnation
            });
            let stays = step.program.bids().any(|(name, _, sync)| name == bthread && sync == stated.sync);
            let told = step.happened.iter().any(|told| {
                me.is_fact(told)
                    && Unknown::read(&told.event).is_some_and(|unknown| *unknown.bthread == **bthread)
            });
            if open && stays && !told {
                let home = &knowledge.member(home).name;
                let what =
                    format!("{home} has restarted, and what {bthread} asks of it was not told as unknown");
                findings.broken(Promise::G4, step.node, what);
            }
        }
    }
}
