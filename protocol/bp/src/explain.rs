//! Explanations: who wanted what, and who forbade it.

use std::fmt;
use std::sync::Arc;

use crate::board::{Board, Entry};
use crate::event::Event;
use crate::event_set::EventSet;

/// Why the events of a set can or cannot happen at this moment. Proxies are named beside b-threads.
///
/// When some of the events are requested or queued, blockers and waiters are those of these events; otherwise those
/// whose sets may concern the question.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Explanation {
    /// The events asked about.
    pub question: EventSet,
    /// The b-threads that request any of them, each with the event.
    pub requested: Vec<(Arc<str>, Event)>,
    /// Those in the external queue, next one first.
    pub queued: Vec<Event>,
    /// The b-threads that block them, with the whole blocked set.
    pub blocked: Vec<(Arc<str>, EventSet)>,
    /// The b-threads that wait for them, with the whole awaited set.
    pub waiting: Vec<(Arc<str>, EventSet)>,
    /// Those that could be selected now.
    pub selectable: Vec<Event>,
}

impl Explanation {
    pub(crate) fn of<'a>(
        question: EventSet,
        board: &Board,
        queue: impl Iterator<Item = &'a Event>,
        selectable: Vec<Event>,
    ) -> Self {
        let asked = |event: &&Event| question.contains(event);
        let wanted = |entry: &Entry| {
            let name = entry.name.clone();
            entry
                .bid
                .requests()
                .iter()
                .filter(asked)
                .map(move |event| (name.clone(), event.clone()))
                .collect::<Vec<_>>()
        };
        let requested: Vec<_> = board.entries().flat_map(wanted).collect();
        let queued: Vec<Event> = queue.filter(asked).cloned().collect();
        let events: Vec<&Event> = requested.iter().map(|(_, event)| event).chain(&queued).collect();

        let mut blocked = Vec::new();
        let mut waiting = Vec::new();
        for entry in board.entries() {
            let (blocks, waits) = (entry.bid.blocks(), entry.bid.waits());
            let (stops, awaits) = match events.is_empty() {
                true => (blocks.may_overlap(&question), waits.may_overlap(&question)),
                false => {
                    (events.iter().any(|e| board.blocks(entry, e)), events.iter().any(|e| waits.contains(e)))
                }
            };
            if stops {
                blocked.push((entry.name.clone(), blocks.clone()));
            }
            if awaits {
                waiting.push((entry.name.clone(), waits.clone()));
            }
        }
        let selectable = selectable.into_iter().filter(|event| question.contains(event)).collect();
        Self { question, requested, queued, blocked, waiting, selectable }
    }
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.question)?;
        if self.requested.is_empty() && self.queued.is_empty() {
            writeln!(f, "  requested by nobody")?;
        }
        for (bthread, event) in &self.requested {
            writeln!(f, "  requested by {bthread}: {event}")?;
        }
        for event in &self.queued {
            writeln!(f, "  queued: {event}")?;
        }
        for (bthread, set) in &self.blocked {
            writeln!(f, "  blocked by {bthread}: {set}")?;
        }
        for (bthread, set) in &self.waiting {
            writeln!(f, "  waited for by {bthread}: {set}")?;
        }
        for event in &self.selectable {
            writeln!(f, "  selectable now: {event}")?;
        }
        Ok(())
    }
}
