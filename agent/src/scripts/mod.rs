//! Scripts: b-threads that come to a vehicle as data, with its configuration or from the ground in flight.
//!
//! A script runs in the vehicle's program under the name `script/<name>`, so that it is explained like any other
//! b-thread. It is checked before ([`ScriptRights`]), and can do no harm while it runs ([`Runner`]). What becomes of
//! it is an event: `uav/3/script{name, state, why}`. Scripts that were sent are kept ([`Store`]) for the agent's next
//! life.

mod facts;
mod rights;
mod runner;
mod vocabulary;

use std::{collections::BTreeMap, time::Duration};

use skein_bp::script::{Argument, Assignment, BoundScript};
use skein_bp::{Event, EventSet, Program};
use skein_wire::event::{Advance, Ahead, Catalogue, Declared as _, SCRIPT_FACTS, ScriptNews, ScriptState};
use skein_wire::{KeptScript, Saver, Store};

pub use self::{
    facts::{Circumstances, ScriptFacts},
    rights::ScriptRights,
    runner::Runner,
};
use crate::me::Me;

/// The most scripts that may run at once.
const MOST_SCRIPTS: usize = skein_wire::State::MAX_SCRIPTS;

/// The sender of the scripts that come with the vehicle's configuration.
pub const CONFIGURATION: &str = "configuration";

/// When a script that is taken in begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begins {
    AtOnce,
    /// When the vehicle is ready on the ground, or an operator lets it go on or takes it back in the air: one that is
    /// there when the agent starts cannot know what has become of the vehicle, and must not end its hold by itself.
    WhenReleased,
}

/// A script that runs.
#[derive(Clone, Debug, PartialEq)]
pub struct RunningScript {
    pub about: String,
    /// The values of its parameters.
    pub with: BTreeMap<String, Argument>,
    /// Its sender: [`CONFIGURATION`], or as in [`KeptScript::from`].
    pub from: String,
    assignment: Assignment,
    listens: Vec<&'static str>,
}

/// The scripts of one vehicle.
#[derive(Debug)]
pub struct Scripts {
    me: Me,
    rights: ScriptRights,
    running: BTreeMap<String, RunningScript>,
    store: Option<Saver<Vec<KeptScript>>>,
    /// Those that run once they are kept.
    waiting: Vec<(String, Runner)>,
    now: Duration,
}

/// The fate of a script that was taken in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loaded {
    Runs,
    /// It runs once it is kept: see [`Scripts::catch_up`].
    Waits,
}

/// How many states of a script a vehicle looks at: no more than there is time for between two ticks. The ground looks
/// at many more before it sends one, and nothing that is for the vehicle's safety hangs on it.
const STATES_TRIED: usize = 200;

impl Scripts {
    /// No scripts yet, on a vehicle whose fleet is `roster` and knows these events.
    pub fn new(me: Me, roster: &[String], events: &Catalogue) -> Self {
        Self {
            rights: ScriptRights::usual(&me, roster, events),
            me,
            running: BTreeMap::new(),
            store: None,
            waiting: Vec::new(),
            now: Duration::ZERO,
        }
    }

    /// Keeps in `store` from now on which scripts were sent and run.
    pub fn keep_in(&mut self, store: Box<dyn Store<Vec<KeptScript>>>) {
        self.store = Some(Saver::new(store));
        self.save();
    }

    /// Adds a script that `from` has sent to the vehicle's program; if it is not kept at once, [as soon as it
    /// is](Self::catch_up).
    pub fn load(
        &mut self,
        program: &mut Program,
        assignment: &Assignment,
        from: &str,
        begins: Begins,
    ) -> Result<Loaded, String> {
        let name = assignment.name();
        match self.running.get(name) {
            // It was sent twice, and arrived twice.
            Some(running) if running.assignment == *assignment => return Ok(self.state_of(name)),
            Some(_) => return Err("another script of this name runs; withdraw it first".to_owned()),
            None if self.running.len() >= MOST_SCRIPTS => {
                return Err(format!("{MOST_SCRIPTS} scripts run already; withdraw one first"));
            }
            None => {}
        }
        let script = self.examine(assignment)?;
        let runner = match begins {
            Begins::AtOnce => self.runner(&script),
            Begins::WhenReleased => self.runner(&script).asleep(),
        };
        let BoundScript { name, about, with, bthread } = script;
        let listens =
            SCRIPT_FACTS.iter().map(|fact| fact.name).filter(|fact| self.listens(&bthread, fact)).collect();
        let from = from.to_owned();
        let running = RunningScript { about, with, from, assignment: assignment.clone(), listens };
        self.running.insert(name.clone(), running);
        if self.save() {
            program.add(Runner::bthread_name(&name), runner);
            return Ok(Loaded::Runs);
        }
        if let Some(why) = self.unsaved() {
            let why = cannot_be_kept(why);
            self.give_up(&name);
            return Err(why);
        }
        self.waiting.push((name, runner));
        Ok(Loaded::Waits)
    }

    fn state_of(&self, name: &str) -> Loaded {
        match self.waiting.iter().any(|(waiting, _)| waiting == name) {
            true => Loaded::Waits,
            false => Loaded::Runs,
        }
    }

    fn give_up(&mut self, name: &str) {
        self.running.remove(name);
        self.save();
    }

    /// A script with its parameters, once it has passed what can be said of it alone: its rights, and that it neither
    /// blocks something for ever nor goes round by itself.
    pub fn examine(&self, assignment: &Assignment) -> Result<BoundScript, String> {
        let script = assignment.bind(self.me.name()).map_err(|error| error.to_string())?;
        self.rights.check(&script.bthread)?;
        script.bthread.try_out(STATES_TRIED).map_err(|fault| fault.to_string())?;
        Ok(script)
    }

    /// The b-thread that runs a script within its rights.
    pub fn runner(&self, script: &BoundScript) -> Runner {
        let may_block = self.rights.block().clone();
        Runner::new(self.me.clone(), &script.name, script.bthread.clone(), may_block)
    }

    /// Whether a script asks about a fact. Whoever blocks some leave to move, and not all, must know where it leads.
    fn listens(&self, script: &skein_bp::script::Script, fact: &str) -> bool {
        let [name, advance] = [fact, Advance::NAME].map(|verb| self.me.event_name(verb));
        let asks = |set: &EventSet| set.may_hold_named(&name);
        script.bids().any(|bid| {
            let partly = bid.blocks().may_hold_named(&advance) && !bid.blocks().holds_all_named(&advance);
            asks(bid.waits()) || asks(bid.interrupts()) || fact == Ahead::NAME && partly
        })
    }

    /// Takes in what has become of a script.
    pub fn hear(&mut self, event: &Event) {
        if let Some(news) = self.me.read::<ScriptNews>(event)
            && matches!(news.state, ScriptState::Withdrawn | ScriptState::Ended)
        {
            self.running.remove(&*news.name);
            self.save();
        }
    }

    /// Goes on with keeping. Adds the scripts that waited for it to the program, or gives them up; gives what
    /// has become of each.
    pub fn catch_up(&mut self, now: Duration, program: &mut Program) -> Vec<(String, Result<(), String>)> {
        self.now = now;
        let is_kept = self.store.as_mut().is_none_or(|store| store.go_on(now));
        if !is_kept && self.unsaved().is_none() {
            return Vec::new();
        }
        let why = self.unsaved().map(cannot_be_kept);
        let waiting = std::mem::take(&mut self.waiting).into_iter();
        let outcomes = waiting.map(|(name, runner)| {
            let outcome = match &why {
                None => {
                    program.add(Runner::bthread_name(&name), runner);
                    Ok(())
                }
                Some(why) => {
                    self.give_up(&name);
                    Err(why.clone())
                }
            };
            (name, outcome)
        });
        outcomes.collect()
    }

    /// Why the agent's next life would not run the scripts that run now, if so: the store does not take them in.
    pub fn unsaved(&self) -> Option<&str> {
        self.store.as_ref().and_then(Saver::trouble)
    }

    /// Keeps the scripts that were sent; gives whether they are kept by now.
    fn save(&mut self) -> bool {
        let Some(store) = &mut self.store else { return true };
        let sent = self.running.values().filter(|script| script.from != CONFIGURATION);
        let kept = sent
            .map(|script| KeptScript { from: script.from.clone(), assignment: script.assignment.clone() })
            .collect();
        store.put(self.now, kept);
        store.go_on(self.now)
    }

    /// The event that says what has become of a script.
    pub fn verdict(&self, name: &str, outcome: Result<(), String>) -> Event {
        match outcome {
            Ok(()) => report(&self.me, name, ScriptState::Accepted, ""),
            Err(why) => report(&self.me, name, ScriptState::Refused, &why),
        }
    }

    /// Whether a script runs under this name.
    pub fn runs(&self, name: &str) -> bool {
        self.running.contains_key(name)
    }

    pub fn listen_to(&self, fact: &str) -> bool {
        self.running.values().any(|script| script.listens.contains(&fact))
    }

    /// The scripts that run, by name.
    pub fn running(&self) -> impl Iterator<Item = (&str, &RunningScript)> {
        self.running.iter().map(|(name, script)| (name.as_str(), script))
    }
}

fn cannot_be_kept(why: &str) -> String {
    format!("it cannot be kept for the agent's next life: {why}")
}

/// `uav/3/script{name, state, why}`.
fn report(me: &Me, name: &str, state: ScriptState, why: &str) -> Event {
    me.event(ScriptNews { name: name.into(), state, why: why.into() })
}
