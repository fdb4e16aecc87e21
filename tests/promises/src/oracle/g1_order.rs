//! G1: each node sees each home's occurrences as they occurred there, in order, none twice; what is missing is told as
//! a gap, and only what cannot be had any more.

use std::collections::BTreeMap;

use skein_bp::catalogue::Declared as _;
use skein_bp::{Event, Program};
use skein_dbp::Happened;
use skein_dbp::facts::{Gap, PeerJoined};

use super::{Findings, Oracle};
use crate::knowledge::{Knowledge, Step};
use crate::promise::Promise;

/// How far each node has come in each home's stream.
pub(super) struct Order {
    /// By observer, in its present life.
    observers: Vec<Observer>,
}

#[derive(Default)]
struct Observer {
    /// How many occurrences it has numbered itself.
    own: u64,
    positions: BTreeMap<usize, Position>,
}

/// A place in a home's stream.
#[derive(Clone, Copy)]
struct Position {
    incarnation: u64,
    /// The number of the last one seen; none while the first may be any.
    at: Option<u64>,
}

impl Order {
    pub(super) fn new(nodes: usize) -> Self {
        Self { observers: (0..nodes).map(|_| Observer::default()).collect() }
    }
}

impl Oracle for Order {
    fn starts(&mut self, node: usize, _: &Program, _: &Knowledge) {
        self.observers[node] = Observer::default();
    }

    fn judge(&mut self, step: &Step<'_>, knowledge: &Knowledge, findings: &mut Findings) {
        let observer = &mut self.observers[step.node];
        for happened in step.happened {
            if let Err(what) = observer.sees(step.node, happened, knowledge) {
                findings.broken(Promise::G1, step.node, what);
            }
        }
    }
}

impl Observer {
    fn sees(&mut self, me: usize, happened: &Happened, knowledge: &Knowledge) -> Result<(), String> {
        if happened.term > 0 {
            // The decisions of a term are numbered on their own: G8.
            return Ok(());
        }
        let member = knowledge.member(me);
        if happened.home != member.name {
            return self.hears(happened, knowledge);
        }
        if happened.seq > 0 {
            self.own += 1;
            if happened.seq != self.own {
                return Err(format!("{} is number {} here, not {}", happened.event, happened.seq, self.own));
            }
        }
        if !member.is_fact(happened) {
            return Ok(());
        }
        match happened.event.kind() {
            PeerJoined::NAME => self.meets(me, &happened.event, knowledge),
            Gap::NAME => self.is_told_of_a_gap(&happened.event, knowledge),
            _ => Ok(()),
        }
    }

    /// A life of a home begins for this node.
    fn meets(&mut self, me: usize, fact: &Event, knowledge: &Knowledge) -> Result<(), String> {
        let joined = PeerJoined::read(fact);
        let member =
            joined.and_then(|joined| Some((knowledge.number(joined.node.as_str())?, joined.incarnation)));
        let Some((home, incarnation)) = member else {
            return Err(format!("{fact} names no member"));
        };
        let Some(life) = knowledge.member(home).life(incarnation) else {
            return Err(format!("{fact} tells of a life that nobody has lived"));
        };
        let known = self.positions.get(&home).copied();
        if known.is_some_and(|known| known.incarnation == incarnation) {
            return Ok(());
        }
        if known.is_some_and(|known| known.incarnation > incarnation) {
            return Err(format!("{fact} goes back to a life that is over"));
        }
        // Of a home that was known, or that has started after this node's first step, nothing may be missed. A
        // process that has not run yet cannot know that others have started meanwhile.
        let ran = knowledge.member(me).present().and_then(|life| life.ran);
        let from_start = known.is_some() || ran.is_some_and(|ran| life.began >= ran);
        self.positions.insert(home, Position { incarnation, at: from_start.then_some(0) });
        Ok(())
    }

    fn hears(&mut self, happened: &Happened, knowledge: &Knowledge) -> Result<(), String> {
        let (event, home, seq) = (&happened.event, &happened.home, happened.seq);
        let number = knowledge.number(home.as_str());
        let Some((number, position)) = number.and_then(|home| Some((home, self.positions.get_mut(&home)?)))
        else {
            return Err(format!("{event} comes from {home}, which has not been met"));
        };
        let life = knowledge.member(number).life(position.incarnation);
        let at = usize::try_from(seq).ok().and_then(|seq| seq.checked_sub(1));
        let truth = at.and_then(|at| life?.occurred.get(at));
        if truth != Some(event) {
            let truth = truth.map_or("nothing".to_owned(), Event::to_string);
            return Err(format!("number {seq} of {home} is told as {event}, and was {truth}"));
        }
        if let Some(at) = position.at
            && seq != at + 1
        {
            return Err(format!("number {seq} of {home}, {event}, is told after number {at}"));
        }
        position.at = Some(seq);
        Ok(())
    }

    fn is_told_of_a_gap(&mut self, fact: &Event, knowledge: &Knowledge) -> Result<(), String> {
        let stream = Gap::read(fact).and_then(|Gap { home, from, to }| {
            let home = knowledge.number(home.as_str())?;
            Some((home, self.positions.get_mut(&home)?, from, to))
        });
        let Some((home, position, from, to)) = stream else {
            return Err(format!("{fact} is about no stream"));
        };
        if to < from || position.at.is_some_and(|at| from != at + 1) {
            return Err(format!("{fact} does not follow number {:?}", position.at));
        }
        position.at = Some(to);
        let home = knowledge.member(home);
        let Some(life) = home.life(position.incarnation) else { return Ok(()) };
        let latest = life.occurred.len() as u64;
        let forgotten = to + home.cast.history as u64 <= latest;
        if to > latest || !(life.over || forgotten) {
            return Err(format!("{fact} gives up what {} still keeps, up to {latest}", home.name));
        }
        Ok(())
    }
}
