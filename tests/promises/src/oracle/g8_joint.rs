//! G8: the decisions of a term are one sequence, which every node learns in order; each is taken by the term's
//! coordinator, when every member has learned those before it and has been heard within the lease.

use std::collections::BTreeMap;
use std::time::Duration;

use skein_bp::{Event, Origin, Program};
use skein_dbp::{Happened, Roster};

use super::{Findings, Oracle};
use crate::knowledge::{Knowledge, Step};
use crate::promise::Promise;
use crate::story::Story;

/// Follows all decisions.
pub(super) struct Joint {
    /// Those of each term.
    decided: BTreeMap<u64, Vec<Event>>,
    /// How many of a term's each node has learned in its present life, and in any.
    learned: BTreeMap<(usize, u64), u64>,
    ever: BTreeMap<(usize, u64), u64>,
    /// When each node went on last, true time.
    last_step: Vec<Duration>,
}

impl Joint {
    pub(super) fn new(story: &Story) -> Self {
        let last_step = vec![Duration::ZERO; story.casts.len()];
        Self { decided: BTreeMap::new(), learned: BTreeMap::new(), ever: BTreeMap::new(), last_step }
    }
}

impl Oracle for Joint {
    fn starts(&mut self, node: usize, _: &Program, _: &Knowledge) {
        self.learned.retain(|(learner, _), _| *learner != node);
    }

    fn judge(&mut self, step: &Step<'_>, knowledge: &Knowledge, findings: &mut Findings) {
        for happened in step.happened.iter().filter(|happened| happened.term > 0) {
            if let Err(what) = self.learns(step, happened, knowledge) {
                findings.broken(Promise::G8, step.node, what);
            }
        }
        self.last_step[step.node] = step.at;
    }

    fn ends(&mut self, _: Duration, knowledge: &Knowledge, findings: &mut Findings) {
        let terms: Vec<u64> =
            knowledge.members.iter().filter_map(|member| Some(member.roster.as_ref()?.term)).collect();
        let Some(term) = terms.first().copied().filter(|term| terms.iter().all(|other| other == term)) else {
            return;
        };
        let decided = self.decided.get(&term).map_or(0, |decided| decided.len() as u64);
        for node in 0..knowledge.members.len() {
            let learned = self.learned.get(&(node, term)).copied().unwrap_or(0);
            // The last one may still be on its way.
            if learned + 1 < decided {
                let what = format!("{learned} of {decided} decisions of term {term} were learned here");
                findings.broken(Promise::G8, node, what);
            }
        }
    }
}

impl Joint {
    fn learns(&mut self, step: &Step<'_>, happened: &Happened, knowledge: &Knowledge) -> Result<(), String> {
        let Happened { event, seq, term, .. } = happened;
        let me = knowledge.member(step.node);
        // Orders of new terms may have come within this step.
        let roster = me.rosters.iter().find(|roster| roster.term == *term);
        let Some(roster) = roster.filter(|roster| roster.coordinator == happened.home) else {
            return Err(format!(
                "{event} of {}, term {term}, counts here, where that is not the term",
                happened.home
            ));
        };
        let learned = self.learned.entry((step.node, *term)).or_default();
        if *seq != *learned + 1 {
            return Err(format!("decision {seq} of term {term}, {event}, comes after {learned}"));
        }
        *learned = *seq;
        if happened.origin == Origin::Internal {
            self.is_decided(step, happened, roster, knowledge)?;
        }
        let ever = self.ever.entry((step.node, *term)).or_default();
        *ever = (*ever).max(*seq);
        let at = usize::try_from(seq - 1).unwrap_or(usize::MAX);
        let truth = self.decided.get(term).and_then(|decided| decided.get(at));
        if truth != Some(event) {
            return Err(format!("decision {seq} of term {term} is {event} here, and was {truth:?}"));
        }
        Ok(())
    }

    fn is_decided(
        &mut self,
        step: &Step<'_>,
        happened: &Happened,
        roster: &Roster,
        knowledge: &Knowledge,
    ) -> Result<(), String> {
        let Happened { event, seq, term, .. } = happened;
        let before = self.decided.entry(*term).or_default();
        if before.len() as u64 + 1 != *seq {
            return Err(format!("{event} is decided as number {seq} of term {term}, after {}", before.len()));
        }
        before.push(event.clone());
        let oldest = step.at.saturating_sub(knowledge.member(step.node).cast.lease.mul_f64(1.01));
        let others = roster.members.iter().filter_map(|name| knowledge.number(name.as_str()));
        for member in others.filter(|member| *member != step.node) {
            let name = &knowledge.member(member).name;
            if self.ever.get(&(member, *term)).copied().unwrap_or(0) + 1 < *seq {
                return Err(format!(
                    "{event} is decided before {name} has learned what was decided before it"
                ));
            }
            if self.last_step[member] < oldest {
                return Err(format!(
                    "{event} is decided, and {name} cannot have been heard within the lease"
                ));
            }
        }
        Ok(())
    }
}
