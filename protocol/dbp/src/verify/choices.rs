//! The ways in which a node's ties may fall, one after the other.

use std::time::Duration;

use skein_bp::{Program, ProgramError, Selection};

/// One selection among several.
#[derive(Clone, Copy, Debug)]
struct Choice {
    taken: usize,
    of: usize,
}

/// The selections of one way, in order; beyond their end the first event is taken each time, and that is noted.
#[derive(Debug, Default)]
pub(super) struct Choices {
    script: Vec<Choice>,
    at: usize,
}

impl Choices {
    pub(super) fn step(
        &mut self,
        program: &mut Program,
        now: Duration,
    ) -> Result<Option<Selection>, ProgramError> {
        program.synchronise(now)?;
        let selectable = program.selectable();
        let mut taken = 0;
        if selectable.len() > 1 {
            if self.at == self.script.len() {
                self.script.push(Choice { taken: 0, of: selectable.len() });
            }
            taken = self.script.get(self.at).map_or(0, |choice| choice.taken);
            self.at += 1;
        }
        selectable.get(taken).map(|event| program.choose(event, now)).transpose()
    }

    /// The next way; none after the last.
    pub(super) fn next_way(mut self) -> Option<Self> {
        while self.script.last().is_some_and(|choice| choice.taken + 1 >= choice.of) {
            self.script.pop();
        }
        self.script.last_mut()?.taken += 1;
        Some(Self { script: self.script, at: 0 })
    }
}
