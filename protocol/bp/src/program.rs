//! Programs: b-threads that run together.

mod asking;
mod config;
mod ended;
mod parts;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use crate::bid::Bid;
use crate::board::{Board, Entry, Owner};
use crate::bthread::{AnyBThread, BThread, Context, Effects};
use crate::event::Event;
use crate::event_set::EventSet;
use crate::index::Place;
use crate::selection::{Names, Origin, Rival, Selection};
use crate::tie::TieBreak;

pub use config::{PASSED_OVER_LIMIT, ProgramConfig, Strategy};
use ended::Ended;
pub(crate) use parts::Rest;

/// Spawns in one selection, or rounds of deadlines in one step, after which they count as endless.
const RUNAWAY_LIMIT: usize = 1000;

/// The reason why a program cannot go on.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProgramError {
    #[error("the superstep did not settle within {limit} selections; look at the b-threads that kept requesting: {}", .bthreads.join(", "))]
    Unsettled { limit: u32, bthreads: Vec<Arc<str>>, selections: Vec<Selection> },
    #[error("b-thread `{bthread}` failed: {message}")]
    Failed { bthread: Arc<str>, message: String },
    #[error("`{event}` is not selectable now; selectable are {selectable:?}")]
    NotSelectable { event: Event, selectable: Vec<Event> },
}

/// A behavioural program: b-threads, the events that wait to happen, and the rules by which they do.
///
/// It has no clock: time comes in with each call, as time since the run began, and must not go backwards. Two programs
/// are equal when their b-threads, proxies and queues are; how ties will be drawn does not count.
#[derive(Clone, Debug)]
pub struct Program {
    config: ProgramConfig,
    board: Board,
    ties: TieBreak,
    /// B-threads that have not reached their first synchronisation point.
    unstarted: VecDeque<Place>,
    /// B-threads spawned in this round; they are named when it is over, and the names of those that ended are free.
    spawned: Vec<(Arc<str>, Box<dyn AnyBThread>)>,
    externals: VecDeque<Event>,
    occurrences: VecDeque<Event>,
    /// Internal selections since an external event last had its turn.
    internal_in_a_row: u32,
    ended: Ended,
    failure: Option<(Arc<str>, String)>,
    daemon: bool,
    revision: u64,
    /// Kept between steps to save allocations.
    offers: Vec<Event>,
    listeners: Vec<Place>,
}

/// Building and feeding a program.
impl Program {
    /// A program without b-threads.
    pub fn new(config: ProgramConfig) -> Self {
        Self {
            board: Board::new(config.strategy, config.protected.clone()),
            ties: TieBreak::new(config.seed, config.passed_over_limit),
            config,
            unstarted: VecDeque::new(),
            spawned: Vec::new(),
            externals: VecDeque::new(),
            occurrences: VecDeque::new(),
            internal_in_a_row: 0,
            ended: Ended::default(),
            failure: None,
            daemon: false,
            revision: 0,
            offers: Vec::new(),
            listeners: Vec::new(),
        }
    }

    /// Adds a b-thread, which runs to its first synchronisation point before the next selection. Gives back its name:
    /// `name`, or `name~2` and so on when that is taken by one that still runs.
    pub fn add(&mut self, name: impl Into<Arc<str>>, bthread: impl BThread) -> Arc<str> {
        self.add_boxed(name.into(), Box::new(bthread))
    }

    /// Takes a b-thread out of the program, wherever it is; `false` when none of this name runs.
    pub fn remove(&mut self, name: &str) -> bool {
        self.board.bthread(name).and_then(|place| self.end(place)).is_some()
    }

    /// Puts `event` at the end of the external queue. One whose home is elsewhere stays there.
    pub fn enqueue(&mut self, event: impl Into<Event>) {
        self.externals.push_back(event.into());
    }

    /// Delivers an event that was selected elsewhere. It happens before anything else and cannot be blocked.
    pub fn occurred(&mut self, event: impl Into<Event>) {
        self.occurrences.push_back(event.into());
    }

    /// Limits what may be selected here to `home`; requests for other events stay open until they occur. All events
    /// unless set.
    pub fn set_home(&mut self, home: impl Into<EventSet>) {
        self.board.home = home.into();
    }

    /// States the bid of a b-thread that runs elsewhere: its requests, blocks and priority count as if it ran here.
    /// When one of its requests is selected the bid becomes empty until it is put again.
    pub fn put_proxy(&mut self, name: impl Into<Arc<str>>, bid: &Bid) {
        let name = name.into();
        let place = match self.board.proxy(&name) {
            Some(place) => place,
            None => self.board.add(name, Owner::Proxy, 0),
        };
        self.restate(place, bid.for_proxy());
    }

    /// The b-threads that have ended and whose names are remembered.
    pub fn ended_names(&self) -> usize {
        self.ended.len()
    }

    /// Withdraws a proxy's bid; `false` when there was none.
    pub fn remove_proxy(&mut self, name: &str) -> bool {
        let removed = self.board.proxy(name).and_then(|place| self.board.remove(place));
        if let Some(entry) = &removed {
            self.forget_ties(&entry.bid);
        }
        self.compact();
        removed.is_some()
    }

    /// Takes back what a b-thread requests at its present synchronisation point: there it waits for the same events,
    /// should others request them.
    pub fn withdraw_requests(&mut self, name: &str) {
        let Some(place) = self.board.bthread(name) else { return };
        let Some(entry) = self.board.get(place) else { return };
        let (bid, sync) = (entry.bid.only_waiting(), entry.sync);
        self.restate(place, bid);
        if let Some(entry) = self.board.get_mut(place) {
            entry.sync = sync;
        }
        self.revision += 1;
    }

    /// Says whether the program stays when it has nothing to do; see [`Program::is_daemon`].
    pub fn set_daemon(&mut self, daemon: bool) {
        self.daemon = daemon;
    }
}

/// Running a program.
impl Program {
    /// Brings every b-thread to a synchronisation point: starts new ones, and resumes those whose deadline has passed.
    /// [`Program::step`] does this first, so only questions about a program that has not run yet need it.
    ///
    /// # Errors
    /// [`ProgramError::Failed`] when an assertion has failed, now or before.
    pub fn synchronise(&mut self, now: Duration) -> Result<(), ProgramError> {
        self.start_added(now);
        if self.occurrences.is_empty() {
            self.fire_deadlines(now);
        }
        match &self.failure {
            None => Ok(()),
            Some((bthread, message)) => {
                Err(ProgramError::Failed { bthread: bthread.clone(), message: message.clone() })
            }
        }
    }

    /// Selects one event and resumes those it concerns; `None` when nothing can be selected. An assertion that fails on
    /// the way stops the program at the next call; see [`Program::failed`].
    ///
    /// # Errors
    /// [`ProgramError::Failed`] when an assertion had failed before the selection.
    pub fn step(&mut self, now: Duration) -> Result<Option<Selection>, ProgramError> {
        self.synchronise(now)?;
        if let Some(event) = self.occurrences.pop_front() {
            return Ok(Some(self.deliver(event, Origin::Occurred, 0, now)));
        }
        if self.external_has_turn()
            && let Some(event) = self.take_external()
        {
            return Ok(Some(self.deliver(event, Origin::External, 0, now)));
        }
        if let Some((event, tied_with)) = self.draw_internal() {
            return Ok(Some(self.deliver(event, Origin::Internal, tied_with, now)));
        }
        Ok(self.take_external().map(|event| self.deliver(event, Origin::External, 0, now)))
    }

    /// Steps until nothing can be selected or an assertion fails.
    ///
    /// # Errors
    /// [`ProgramError::Unsettled`] past the configured limit; [`ProgramError::Failed`] when an assertion had failed
    /// before anything was selected.
    pub fn superstep(&mut self, now: Duration) -> Result<Vec<Selection>, ProgramError> {
        let mut selections = Vec::new();
        loop {
            match self.step(now) {
                Ok(Some(selection)) => selections.push(selection),
                Ok(None) => return Ok(selections),
                // What happened must not be lost; the next call reports the failure.
                Err(_) if !selections.is_empty() => return Ok(selections),
                Err(error) => return Err(error),
            }
            if let Some(limit) = self.config.settle_limit
                && selections.len() > limit as usize
            {
                return Err(ProgramError::Unsettled {
                    limit,
                    bthreads: busy_bthreads(&selections),
                    selections,
                });
            }
        }
    }

    /// Selects a given event among [`Program::selectable`]: a step for one who explores all runs.
    ///
    /// # Errors
    /// [`ProgramError::NotSelectable`]; [`ProgramError::Failed`] when an assertion had failed before.
    pub fn choose(&mut self, event: &Event, now: Duration) -> Result<Selection, ProgramError> {
        self.synchronise(now)?;
        let selectable = self.selectable();
        if !selectable.contains(event) {
            return Err(ProgramError::NotSelectable { event: event.clone(), selectable });
        }
        let internal = self.board.requests().any(|(_, requested)| requested == event);
        if !internal && let Some(at) = self.externals.iter().position(|queued| queued == event) {
            self.externals.remove(at);
            return Ok(self.deliver(event.clone(), Origin::External, 0, now));
        }
        Ok(self.deliver(event.clone(), Origin::Internal, selectable.len() - 1, now))
    }

    /// Whether external events have waited long enough.
    fn external_has_turn(&self) -> bool {
        self.config.externals_after.is_some_and(|limit| self.internal_in_a_row >= limit)
    }

    fn next_external(&self) -> Option<usize> {
        if self.board.is_empty() {
            return None;
        }
        self.externals.iter().position(|event| self.board.is_home(event) && !self.board.is_blocked(event))
    }

    fn take_external(&mut self) -> Option<Event> {
        let event = self.externals.remove(self.next_external()?)?;
        self.internal_in_a_row = 0;
        Some(event)
    }

    /// The internal event to select, and how many others tied with it.
    fn draw_internal(&mut self) -> Option<(Event, usize)> {
        self.board.offers(&mut self.offers);
        let others = self.offers.len().checked_sub(1)?;
        let winner = self.ties.choose(&self.offers);
        if !self.externals.is_empty() {
            self.internal_in_a_row += 1;
        }
        Some((self.offers.swap_remove(winner), others))
    }

    /// Ends those whom `event` interrupts, then resumes those who requested it or wait for it.
    fn deliver(&mut self, event: Event, origin: Origin, tied_with: usize, now: Duration) -> Selection {
        let mut resuming = std::mem::take(&mut self.listeners);
        self.board.listeners(&event, &mut resuming);
        let has_rivals = origin == Origin::Internal && self.config.rivals > 0;
        let rivals = if has_rivals { self.rivals(&event) } else { Vec::new() };
        let mut requested_by = Names::new();
        let (mut ending, mut priority) = (Vec::new(), None);
        resuming.retain(|place| {
            let Some(Entry { name, bid, .. }) = self.board.get(*place) else { return false };
            let requested = bid.requests().contains(&event);
            if requested {
                requested_by.push(name.clone());
                priority = priority.max(bid.given_priority());
            }
            let interrupted = bid.interrupts().contains(&event);
            if interrupted {
                ending.push(*place);
            }
            !interrupted && (requested || bid.waits().contains(&event))
        });

        let mut interrupted = Names::new();
        for place in ending {
            interrupted.extend(self.interrupt(place, &event, now));
        }
        let mut resumed = Names::with_capacity(resuming.len());
        for place in &resuming {
            if let Some(name) = self.resume(*place, &event, now) {
                resumed.push(name);
            }
        }
        self.listeners = resuming;
        self.start_added(now);
        self.compact();
        Selection { event, origin, requested_by, resumed, interrupted, tied_with, priority, rivals }
    }

    /// The other requests while `event` is selected.
    fn rivals(&self, event: &Event) -> Vec<Rival> {
        let others = self.board.requests().filter(|(_, requested)| *requested != event);
        let rival = |(entry, requested): (&Entry, &Event)| Rival {
            bthread: entry.name.clone(),
            event: requested.clone(),
            priority: entry.bid.given_priority(),
            blocked: self.board.is_blocked(requested),
        };
        others.take(self.config.rivals).map(rival).collect()
    }

    fn interrupt(&mut self, place: Place, event: &Event, now: Duration) -> Option<Arc<str>> {
        let mut cx = Context::at(now);
        if let Owner::BThread(bthread) = &mut self.board.get_mut(place)?.owner {
            bthread.interrupted(event, &mut cx);
        }
        let name = self.end(place);
        self.absorb(cx, name.as_ref());
        name
    }

    /// Runs one b-thread to its next synchronisation point and gives back its name; a proxy is served instead.
    fn resume(&mut self, place: Place, event: &Event, now: Duration) -> Option<Arc<str>> {
        let entry = self.board.get_mut(place)?;
        let Owner::BThread(bthread) = &mut entry.owner else {
            self.restate(place, Bid::new());
            return None;
        };
        let name = entry.name.clone();
        let mut cx = Context::at(now);
        bthread.resume(event, &mut cx);
        let bid = bthread.bid();
        self.arrive(place, bid, cx, &name);
        Some(name)
    }

    /// Runs new b-threads, if there are any, to their first synchronisation point, and those that they spawn.
    fn start_added(&mut self, now: Duration) {
        if !(self.unstarted.is_empty() && self.spawned.is_empty()) {
            self.start_all(now);
        }
    }

    fn start_all(&mut self, now: Duration) {
        let mut spawners = 0;
        while let Some(place) = self.next_unstarted() {
            let Some(entry) = self.board.get_mut(place) else { continue };
            let Owner::BThread(bthread) = &mut entry.owner else { continue };
            let name = entry.name.clone();
            let mut cx = Context::at(now);
            bthread.start(&mut cx);
            let bid = bthread.bid();
            spawners += usize::from(cx.has_spawned());
            if spawners > RUNAWAY_LIMIT {
                cx = Context::at(now);
                cx.fail("spawned b-threads that spawn b-threads without end");
            }
            self.arrive(place, bid, cx, &name);
        }
    }

    fn next_unstarted(&mut self) -> Option<Place> {
        if !self.spawned.is_empty() {
            for (name, bthread) in std::mem::take(&mut self.spawned) {
                self.add_boxed(name, bthread);
            }
        }
        self.unstarted.pop_front()
    }

    fn fire_deadlines(&mut self, now: Duration) {
        for _ in 0..RUNAWAY_LIMIT {
            let overdue = self.board.next_deadline().is_some_and(|at| at <= now);
            if !overdue || self.failure.is_some() {
                return;
            }
            for place in self.board.overdue(now) {
                self.resume(place, &Event::timeout(), now);
            }
            self.start_added(now);
            self.compact();
        }
        if let Some(entry) = self.board.overdue(now).first().and_then(|place| self.board.get(*place)) {
            self.failure = Some((entry.name.clone(), "keeps setting deadlines that have passed".to_owned()));
        }
    }

    /// Takes note of a b-thread that has reached a synchronisation point or its end.
    fn arrive(&mut self, place: Place, bid: Option<Bid>, cx: Context, name: &Arc<str>) {
        match bid {
            Some(bid) => {
                self.restate(place, bid);
                self.revision += 1;
            }
            None => {
                self.end(place);
            }
        }
        if cx.effects.is_some() {
            self.absorb(cx, Some(name));
        }
    }

    fn restate(&mut self, place: Place, bid: Bid) {
        if let Some(old) = self.board.restate(place, bid) {
            self.forget_ties(&old);
        }
    }

    fn end(&mut self, place: Place) -> Option<Arc<str>> {
        let entry = self.board.remove(place)?;
        self.forget_ties(&entry.bid);
        self.ended.note(entry.name.clone(), entry.sync);
        self.revision += 1;
        Some(entry.name)
    }

    /// Drops the record of lost ties for events that a replaced bid requested and nobody requests any more.
    fn forget_ties(&mut self, old: &Bid) {
        for event in old.requests() {
            if self.ties.is_owed(event) && !self.board.is_requested(event) {
                self.ties.forget(event);
            }
        }
    }

    /// Carries out what a b-thread asked of its context.
    fn absorb(&mut self, cx: Context, name: Option<&Arc<str>>) {
        let Some(effects) = cx.effects else { return };
        let Effects { enqueued, spawned, failure, daemon } = *effects;
        self.externals.extend(enqueued);
        self.spawned.extend(spawned);
        if let (Some(message), Some(name), None) = (failure, name, &self.failure) {
            self.failure = Some((name.clone(), message));
        }
        self.daemon = daemon.unwrap_or(self.daemon);
    }

    fn add_boxed(&mut self, name: Arc<str>, bthread: Box<dyn AnyBThread>) -> Arc<str> {
        let name = self.free_name(name);
        let sync = self.ended.take(&name);
        let place = self.board.add(name.clone(), Owner::BThread(bthread), sync);
        self.unstarted.push_back(place);
        name
    }

    fn free_name(&self, name: Arc<str>) -> Arc<str> {
        if self.board.bthread(&name).is_none() {
            return name;
        }
        let mut numbered = (2_u64..).map(|n| format!("{name}~{n}"));
        numbered.find(|candidate| self.board.bthread(candidate).is_none()).map_or(name, Arc::from)
    }

    fn compact(&mut self) {
        if self.unstarted.is_empty() {
            self.board.compact();
        }
    }
}

/// The b-threads that requested the events in the second half of a superstep: those that keep it going.
fn busy_bthreads(selections: &[Selection]) -> Vec<Arc<str>> {
    let recent = selections.get(selections.len() / 2..).unwrap_or_default();
    let mut bthreads: Vec<Arc<str>> =
        recent.iter().flat_map(|selection| selection.requested_by.iter().cloned()).collect();
    bthreads.sort();
    bthreads.dedup();
    bthreads
}
