//! The mission's words to control.

use std::time::Duration;

use skein_wire::event::Right;
use skein_wire::{Limits, MissionState, State, Zone};

use super::newest::Newest;
use crate::instruction::Instruction;

/// The mission's decisions.
#[derive(Clone, Debug, Default)]
pub struct Orders {
    /// When it has decided last, even if it was that nothing is to be done.
    pub decided: Duration,
    /// The things to be done, each with the time when that was decided.
    pub instructions: Newest<Instruction>,
    /// The newest, if they have changed; as the rest.
    pub limits: Option<Limits>,
    pub zones: Option<Vec<Zone>>,
    pub words: Option<Words>,
}

/// The mission's part of what a vehicle tells the others.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Words {
    pub task: String,
    pub waiting_for: String,
    pub mission: MissionState,
    pub scripts: Vec<String>,
    /// The names of the zones that are drawn for it.
    pub zones: Vec<String>,
    /// The person who commands the vehicle, and the one who asks to; empty for nobody.
    pub holder: String,
    pub asked_by: String,
    /// The vehicle's right to go first where there is room for one.
    pub right: Right,
}

impl Orders {
    /// Adds what is newer.
    pub fn merge(&mut self, newer: Self) {
        self.decided = self.decided.max(newer.decided);
        self.instructions.extend(newer.instructions);
        self.limits = newer.limits.or(self.limits.take());
        self.zones = newer.zones.or(self.zones.take());
        self.words = newer.words.or(self.words.take());
    }
}

impl Words {
    /// The state of a body, with these words.
    #[must_use]
    pub fn said_of(&self, body: State) -> State {
        let Self { task, waiting_for, mission, scripts, zones, holder, asked_by, right } = self.clone();
        State { task, waiting_for, mission, scripts, zones, holder, asked_by, right, ..body }
    }
}
