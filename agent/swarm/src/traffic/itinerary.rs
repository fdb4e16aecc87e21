//! When a vehicle will be where.

use super::lattice::{Move, State};

/// States at consecutive steps, the last of them at rest; there the vehicle stays.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Itinerary {
    first_step: u32,
    states: Vec<State>,
}

impl Itinerary {
    /// At rest, now and for ever.
    pub fn resting(step: u32, state: State) -> Self {
        Self { first_step: step, states: vec![state] }
    }

    /// In one state from `step` until `end`, which is what is known; after that it may go anywhere.
    pub fn waiting(step: u32, state: State, end: u32) -> Self {
        Self { first_step: step, states: vec![state; end.saturating_sub(step) as usize + 1] }
    }

    /// `states` from `first_step` on; a rest is added if the last is none.
    pub fn new(first_step: u32, mut states: Vec<State>) -> Self {
        if let Some(last) = states.last().filter(|last| !last.is_at_rest()) {
            states.push(last.braked());
        }
        Self { first_step, states }
    }

    /// The same, after `state` a step before its first: what is flown already and cannot be changed.
    #[must_use]
    pub fn after(mut self, state: State) -> Self {
        self.first_step = self.first_step.saturating_sub(1);
        self.states.insert(0, state);
        self
    }

    /// The state at a step; before the first the first, after the last the last. `None` of an empty itinerary.
    pub fn at(&self, step: u32) -> Option<State> {
        let index = step.saturating_sub(self.first_step) as usize;
        self.states.get(index).or(self.states.last()).copied()
    }

    /// Its move from `step` to the next.
    pub fn movement(&self, step: u32) -> Option<Move> {
        Some(Move { from: self.at(step)?, to: self.at(step + 1)? })
    }

    /// The step from which on it rests.
    pub fn end(&self) -> u32 {
        self.first_step + u32::try_from(self.states.len().saturating_sub(1)).unwrap_or(u32::MAX)
    }

    /// Its move from `step` to the next, if it keeps to this until `committed` and then brakes.
    pub fn committed(&self, step: u32, committed: u32) -> Option<Move> {
        let at = |step: u32| {
            let state = self.at(step.min(committed))?;
            Some(if step > committed { state.braked() } else { state })
        };
        Some(Move { from: at(step)?, to: at(step + 1)? })
    }

    /// All states, from the first.
    pub fn states(&self) -> &[State] {
        &self.states
    }

    pub fn first_step(&self) -> u32 {
        self.first_step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_plan_leaves_the_step_that_is_being_flown_as_it_is() {
        let start = State::at_rest([0, 0, 0]);
        let east = start.then([1, 0, 0]);
        let plan = Itinerary::new(6, vec![east, east.braked()]).after(start);
        assert_eq!(plan.movement(5), Some(Move { from: start, to: east }));
        assert_eq!(plan.end(), 7);
    }

    #[test]
    fn a_commitment_ends_in_a_rest_where_the_plan_would_go_on() {
        let start = State::at_rest([0, 0, 0]);
        let east = start.then([1, 0, 0]);
        let plan = Itinerary::new(5, vec![start, east, east.then([1, 0, 0])]);
        assert_eq!(plan.end(), 8, "a rest is added");
        assert_eq!(plan.committed(6, 7), plan.movement(6));
        let braking = plan.committed(6, 6).map(|movement| movement.to);
        assert_eq!(braking, Some(State::at_rest([1, 0, 0])));
        assert_eq!(plan.committed(9, 6).map(|movement| movement.from), braking);
    }
}
