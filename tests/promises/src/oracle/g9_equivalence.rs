//! G9: a node's run is a run of its program alone, in which the bids of others are proxies that the channel moves, and
//! what has occurred elsewhere comes before anything is selected.

use std::sync::Arc;
use std::time::Duration;

use skein_bp::catalogue::Declared as _;
use skein_bp::{Event, EventSet, Origin, Program};
use skein_dbp::{Happened, NewRoster, Roster};

use super::{Findings, Oracle};
use crate::knowledge::{Knowledge, Member, Step};
use crate::promise::Promise;
use crate::run;
use crate::story::{Cast, Story};

/// Runs each node's program a second time, alone.
pub(super) struct Equivalence {
    seed: u64,
    casts: Vec<Cast>,
    programs: Vec<Option<Program>>,
}

impl Equivalence {
    pub(super) fn new(story: &Story) -> Self {
        let programs = story.casts.iter().map(|_| None).collect();
        Self { seed: story.seed, casts: story.casts.clone(), programs }
    }
}

impl Oracle for Equivalence {
    fn starts(&mut self, node: usize, started: &Program, knowledge: &Knowledge) {
        let mut program = run::program(&self.casts[node], self.seed, node);
        program.set_home(home(knowledge.member(node), knowledge.member(node).roster.as_ref()));
        // Blocks that outlive their holders, and those that keep events back after a start, are there from the first.
        started.proxies().for_each(|(proxy, bid)| program.put_proxy(proxy, bid));
        self.programs[node] = Some(program);
    }

    fn judge(&mut self, step: &Step<'_>, knowledge: &Knowledge, findings: &mut Findings) {
        let Some(program) = &mut self.programs[step.node] else { return };
        if let Err(what) = replay(program, step, knowledge) {
            findings.broken(Promise::G9, step.node, what);
        }
    }
}

/// What is selected at a node, as it was told who decides on joint events.
fn home(member: &Member, roster: Option<&Roster>) -> EventSet {
    let homeless = EventSet::from("*").or(EventSet::from("*/*").and(!Roster::joint_events()));
    let home = member.home.clone().or(homeless);
    match roster.filter(|roster| roster.coordinator == member.name) {
        Some(_) => home.or(Roster::joint_events()),
        None => home,
    }
}

fn replay(program: &mut Program, step: &Step<'_>, knowledge: &Knowledge) -> Result<(), String> {
    let member = knowledge.member(step.node);
    let me = &member.name;
    let mut term = member.former_roster.as_ref().map_or(0, |roster| roster.term);
    let mut moves = step.moves.iter().peekable();
    let mut change_board = |program: &mut Program, before: usize| {
        while let Some(next) = moves.next_if(|next| next.after <= before) {
            next.change.apply(program);
        }
    };
    step.enqueued.iter().for_each(|event| program.enqueue(event.clone()));
    let mut selected_here = None;
    for (number, happened) in step.happened.iter().enumerate() {
        change_board(program, number);
        let Happened { event, home, origin, .. } = happened;
        match origin {
            Origin::Occurred => {
                if let Some(selected) = selected_here.filter(|_| home != me) {
                    return Err(format!("{event} was told only after {selected} was selected"));
                }
                program.occurred(event.clone());
            }
            Origin::External | Origin::Internal => selected_here = Some(event),
        }
        expect(program, step.clock, Some(happened))?;
        if home == me
            && event.kind() == NewRoster::NAME
            && let Ok(roster) = Roster::ordered(event)
            && roster.term > term
        {
            term = roster.term;
            program.set_home(self::home(member, Some(&roster)));
        }
    }
    change_board(program, step.happened.len());
    expect(program, step.clock, None)
}

/// Lets the program go on by one selection, which has to be this one.
fn expect(program: &mut Program, now: Duration, happened: Option<&Happened>) -> Result<(), String> {
    let selected = program.step(now).map_err(|error| format!("alone, the program fails: {error}"))?;
    let names = |requesters: &[Arc<str>]| {
        let mut names: Vec<String> = requesters.iter().map(ToString::to_string).collect();
        names.sort_unstable();
        names
    };
    let alone: Option<(&Event, Origin, Vec<String>)> =
        selected.as_ref().map(|selected| (&selected.event, selected.origin, names(&selected.requested_by)));
    let seen = happened.map(|happened| {
        // Who requested what occurred elsewhere is its home's to say.
        let requesters = if happened.origin == Origin::Occurred {
            alone.as_ref().map(|(_, _, requesters)| requesters.clone()).unwrap_or_default()
        } else {
            names(&happened.requested_by)
        };
        (&happened.event, happened.origin, requesters)
    });
    if alone != seen {
        return Err(format!("alone, the program selects {alone:?} where {seen:?} was seen"));
    }
    Ok(())
}
