//! Scripts: b-threads that come to a vehicle as data, with its configuration or from the ground in flight.
//!
//! A script runs in the vehicle's program under the name `script/<name>`, so that it is explained like any other b-thread. It
//! is checked before ([`ScriptRights`]), and can do no harm while it runs ([`Runner`]). What becomes of it is an
//! event: `uav/3/script{name, state, why}`.

mod facts;
mod rights;
mod runner;

use std::collections::BTreeMap;

use skein_bp::script::{Argument, Assignment, BoundScript};
use skein_bp::{Event, EventSet, Program};
use skein_wire::vocabulary::{
    ACCEPTED, ADVANCE, AHEAD, AT, BATTERY, ENDED, NEIGHBOUR, REFUSED, SCRIPT, WITHDRAWN,
};

pub use self::{
    facts::{Circumstances, ScriptFacts},
    rights::ScriptRights,
    runner::Runner,
};
use crate::me::Me;

/// How many scripts may run at once.
const MOST_SCRIPTS: usize = skein_wire::State::MAX_SCRIPTS;

/// A script that runs.
#[derive(Clone, Debug, PartialEq)]
pub struct RunningScript {
    /// What it is for.
    pub about: String,
    /// The values of its parameters.
    pub with: BTreeMap<String, Argument>,
    /// Who has sent it: a node, or `configuration`.
    pub from: String,
    assignment: Assignment,
    /// The facts that it listens to.
    listens: Vec<&'static str>,
}

/// The scripts of one vehicle.
#[derive(Debug)]
pub struct Scripts {
    me: Me,
    rights: ScriptRights,
    running: BTreeMap<String, RunningScript>,
}

/// How many states of a script a vehicle looks at: no more than there is time for between two ticks. The ground looks at
/// many more before it sends one, and nothing that is for the vehicle's safety hangs on it.
const STATES_TRIED: usize = 200;

/// The facts that are told only while a script listens.
const FACTS: [&str; 4] = [AT, AHEAD, NEIGHBOUR, BATTERY];

impl Scripts {
    /// No scripts yet, on a vehicle whose fleet is `roster`.
    #[must_use]
    pub fn new(me: Me, roster: &[String]) -> Self {
        Self { rights: ScriptRights::usual(&me, roster), me, running: BTreeMap::new() }
    }

    /// Adds a script that `from` has sent to the vehicle's program.
    ///
    /// # Errors
    /// Why it is not run.
    pub fn load(&mut self, program: &mut Program, assignment: &Assignment, from: &str) -> Result<(), String> {
        let name = assignment.name();
        match self.running.get(name) {
            // It was sent twice, and arrived twice.
            Some(running) if running.assignment == *assignment => return Ok(()),
            Some(_) => return Err("another script of this name runs; withdraw it first".to_owned()),
            None if self.running.len() >= MOST_SCRIPTS => {
                return Err(format!("{MOST_SCRIPTS} scripts run already; withdraw one first"));
            }
            None => {}
        }
        let script = self.examine(assignment)?;
        let runner = self.runner(&script);
        let BoundScript { name, about, with, bthread } = script;
        let listens = FACTS.into_iter().filter(|fact| self.listens(&bthread, fact)).collect();
        program.add(Runner::bthread_name(&name), runner);
        let from = from.to_owned();
        self.running
            .insert(name, RunningScript { about, with, from, assignment: assignment.clone(), listens });
        Ok(())
    }

    /// A script with its parameters, once it has passed what can be said of it alone: its rights, and that it neither blocks
    /// something for ever nor goes round by itself.
    ///
    /// # Errors
    /// Why it is not run.
    pub fn examine(&self, assignment: &Assignment) -> Result<BoundScript, String> {
        let script = assignment.bind(self.me.name()).map_err(|error| error.to_string())?;
        self.rights.check(&script.bthread)?;
        script.bthread.try_out(STATES_TRIED).map_err(|fault| fault.to_string())?;
        Ok(script)
    }

    /// The b-thread that runs a script within its rights.
    #[must_use]
    pub fn runner(&self, script: &BoundScript) -> Runner {
        let may_block = self.rights.block().clone();
        Runner::new(self.me.clone(), &script.name, script.bthread.clone(), may_block)
    }

    /// Whether a script asks about a fact. Whoever blocks some leave to move, and not all, must know where it leads.
    fn listens(&self, script: &skein_bp::script::Script, fact: &str) -> bool {
        let [name, advance] = [fact, ADVANCE].map(|verb| format!("{}/{verb}", self.me.name()));
        let asks = |set: &EventSet| set.may_hold_named(&name);
        script.bids().any(|bid| {
            let partly = bid.blocks().may_hold_named(&advance) && !bid.blocks().holds_all_named(&advance);
            asks(bid.waits()) || asks(bid.interrupts()) || fact == AHEAD && partly
        })
    }

    /// Takes in what has become of a script.
    pub fn hear(&mut self, event: &Event) {
        if self.me.heard(event, SCRIPT)
            && matches!(event.text("state"), Some(WITHDRAWN | ENDED))
            && let Some(name) = event.text("name")
        {
            self.running.remove(name);
        }
    }

    /// The event that says what has become of a script.
    #[must_use]
    pub fn verdict(&self, name: &str, outcome: Result<(), String>) -> Event {
        match outcome {
            Ok(()) => report(&self.me, name, ACCEPTED, ""),
            Err(why) => report(&self.me, name, REFUSED, &why),
        }
    }

    /// Whether a script runs under this name.
    #[must_use]
    pub fn runs(&self, name: &str) -> bool {
        self.running.contains_key(name)
    }

    /// Whether a script listens to a fact.
    #[must_use]
    pub fn listen_to(&self, fact: &str) -> bool {
        self.running.values().any(|script| script.listens.contains(&fact))
    }

    /// The scripts that run, by name.
    pub fn running(&self) -> impl Iterator<Item = (&str, &RunningScript)> {
        self.running.iter().map(|(name, script)| (name.as_str(), script))
    }
}

/// `uav/3/script{name, state, why}`.
fn report(me: &Me, name: &str, state: &str, why: &str) -> Event {
    me.because(SCRIPT, why).with("name", name).with("state", state)
}
