//! Nothing hangs for ever: once the faults have ended, every stream converges and every request that nobody blocks is
//! served. That blocks are confirmed is seen by G3's observer, which knows which are.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use skein_bp::catalogue::Declared as _;
use skein_bp::{Event, Program};
use skein_dbp::facts::Refused;
use skein_dbp::{NewRoster, RefusalReason, Roster};

use super::{Findings, Oracle};
use crate::knowledge::{Knowledge, Member, Step};
use crate::promise::Promise;
use crate::story::Story;

/// Looks at the run's end.
pub(super) struct GoesOn {
    calm: Duration,
    /// How many occurrences each home had one lease after the calm had come: by then everybody hears everybody.
    begun: Option<Vec<u64>>,
    /// The same one lease later.
    marks: Option<Vec<u64>>,
    /// How far each node has come in each home's present life: by observer and home.
    heard: BTreeMap<(usize, usize), u64>,
    /// Which b-threads have been told that they may not request a safety event: by node and b-thread.
    refused: BTreeSet<(usize, String)>,
}

impl GoesOn {
    pub(super) fn new(story: &Story) -> Self {
        let calm = story.calm + story.longest_lease();
        Self { calm, begun: None, marks: None, heard: BTreeMap::new(), refused: BTreeSet::new() }
    }
}

impl Oracle for GoesOn {
    fn starts(&mut self, node: usize, _: &Program, _: &Knowledge) {
        self.heard.retain(|(observer, home), _| *observer != node && *home != node);
        self.refused.retain(|(observer, _)| *observer != node);
    }

    fn judge(&mut self, step: &Step<'_>, knowledge: &Knowledge, _: &mut Findings) {
        let me = knowledge.member(step.node);
        for happened in step.happened.iter().filter(|happened| happened.term == 0) {
            if happened.home != me.name {
                if let Some(home) = knowledge.number(happened.home.as_str()) {
                    self.heard.insert((step.node, home), happened.seq);
                }
            } else if me.is_fact(happened)
                && let Some(refused) = Refused::read(&happened.event)
                && refused.reason == RefusalReason::Safety
            {
                self.refused.insert((step.node, refused.bthread.to_string()));
            }
        }
        for (marks, since) in
            [(&mut self.begun, self.calm), (&mut self.marks, self.calm + knowledge.longest_lease)]
        {
            if step.at >= since && marks.is_none() {
                *marks = Some(knowledge.members.iter().map(occurred).collect());
            }
        }
    }

    fn ends(&mut self, at: Duration, knowledge: &Knowledge, findings: &mut Findings) {
        let (Some(begun), Some(marks)) = (&self.begun, &self.marks) else { return };
        for observer in 0..marks.len() {
            for (home, mark) in marks.iter().enumerate().filter(|(home, _)| *home != observer) {
                let heard = self.heard.get(&(observer, home)).copied();
                // Who comes late hears what occurs from then on.
                let begins = if came_after(observer, home, knowledge) { begun[home] } else { 0 };
                let heard = heard.unwrap_or(begins);
                if heard < *mark {
                    let name = &knowledge.member(home).name;
                    let what = format!("{heard} of {mark} occurrences of {name} have come here");
                    findings.broken(Promise::GoesOn, observer, what);
                }
            }
        }
        let settled = at.saturating_sub(4 * knowledge.longest_lease);
        for (node, member) in knowledge.members.iter().enumerate() {
            for (bthread, stated) in member.bids.iter().filter(|(_, stated)| stated.since < settled) {
                for event in stated.bid.requests() {
                    let Some(home) = knowledge.home_of(event, node).filter(|home| *home != node) else {
                        continue;
                    };
                    if keeps_to_a_former_term(node, home, knowledge) {
                        continue;
                    }
                    if knowledge.member(home).safety.contains(event) {
                        if !self.refused.contains(&(node, bthread.clone())) {
                            let what = format!("{bthread} was not told that {event} is refused");
                            findings.broken(Promise::G6, node, what);
                        }
                    } else if knowledge.member(home).may_request(member.name.as_str(), event)
                        && is_free(event, home, knowledge)
                    {
                        let what =
                            format!("{event} of {bthread} is blocked by nobody, and yet does not occur");
                        findings.broken(Promise::GoesOn, node, what);
                    }
                }
            }
        }
    }
}

/// How much has occurred at a home in its present life.
fn occurred(member: &Member) -> u64 {
    member.present().map_or(0, |life| life.occurred.len() as u64)
}

/// Whether a home was there before `observer` was.
fn came_after(observer: usize, home: usize, knowledge: &Knowledge) -> bool {
    let present = |node| knowledge.member(node).present();
    let ran = present(observer).and_then(|life| life.ran);
    present(home).zip(ran).is_some_and(|(life, ran)| life.began < ran)
}

/// Whether a node takes no part since it is in a former term, of its own doing: its b-threads block the order that
/// would tell it of the new one.
fn keeps_to_a_former_term(node: usize, home: usize, knowledge: &Knowledge) -> bool {
    let member = knowledge.member(node);
    let term = |member: &Member| member.roster.as_ref().map_or(0, |roster| roster.term);
    let order = Event::new(member.name.event_name(NewRoster::NAME));
    term(member) < term(knowledge.member(home)) && !is_free(&order, node, knowledge)
}

/// Whether no b-thread of the story ever blocks `event`.
fn is_free(event: &Event, home: usize, knowledge: &Knowledge) -> bool {
    knowledge.members.iter().enumerate().all(|(node, member)| {
        let joint = Roster::joint_events().contains(event);
        let counts = node == home || joint || knowledge.member(home).lets_block(event);
        !counts || member.cast.roles.iter().all(|(_, role)| !role.ever_blocks(event))
    })
}
