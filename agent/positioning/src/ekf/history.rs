//! The recent past of a filter, so that what comes late is taken in where it belongs.

use std::collections::VecDeque;
use std::time::Duration;

use super::health::Weighed;
use super::measurement::Measurement;
use super::state::State;
use super::{Inertial, Noise};

/// The past reaches so far back: later than that nothing is taken in.
const REACHES: Duration = Duration::from_millis(500);

/// A time, the motion that led to it, and what was measured then.
#[derive(Clone, Debug)]
struct Moment {
    /// After the measurement.
    state: State,
    motion: Inertial,
    measured: Option<Measurement>,
}

/// The fate of a measurement.
pub(super) enum Taken {
    TooLate,
    /// It holds something that is no number, or no covariance.
    Senseless,
    Weighed(Weighed),
}

/// The moments of late, oldest first; there is always one.
#[derive(Clone, Debug)]
pub(super) struct History {
    noise: Noise,
    newest: State,
    moments: VecDeque<Moment>,
}

impl History {
    pub(super) fn new(noise: Noise, state: State) -> Self {
        Self { noise, newest: state, moments: VecDeque::new() }
    }

    pub(super) fn newest(&self) -> &State {
        &self.newest
    }

    /// Goes on from this state; there is no past.
    pub(super) fn begin_anew(&mut self, state: State) {
        self.newest = state;
        self.moments.clear();
    }

    pub(super) fn feel(&mut self, motion: Inertial) {
        self.newest.go_on(&motion, &self.noise);
        self.moments.push_back(Moment { state: self.newest.clone(), motion, measured: None });
        while self.moments.front().is_some_and(|oldest| oldest.state.stamp + REACHES < motion.stamp) {
            self.moments.pop_front();
        }
    }

    /// Weighs a measurement at its time, and goes on from there with it if it is to be fused.
    pub(super) fn insert(&mut self, measured: Measurement, is_fused: bool) -> Taken {
        let stamp = measured.stamp();
        let after = self.moments.partition_point(|moment| moment.state.stamp <= stamp);
        let Some(before) = after.checked_sub(1).and_then(|index| self.moments.get(index)) else {
            return Taken::TooLate;
        };
        let mut state = before.state.clone();
        let motion = self.moments.get(after).map_or(before.motion, |next| next.motion);
        let motion = Inertial { stamp, ..motion };
        state.go_on(&motion, &self.noise);
        let Some(weighed) = measured.apply(&mut state, is_fused) else { return Taken::Senseless };
        if is_fused && weighed.passed {
            self.moments.insert(after, Moment { state, motion, measured: Some(measured) });
            self.replay_after(after);
        }
        Taken::Weighed(weighed)
    }

    fn replay_after(&mut self, index: usize) {
        let Some(first) = self.moments.get(index) else { return };
        let mut state = first.state.clone();
        for moment in self.moments.iter_mut().skip(index + 1) {
            state.go_on(&moment.motion, &self.noise);
            if let Some(measured) = &moment.measured {
                // What was believed once may not fit any more: then it is left out.
                let _ = measured.apply(&mut state, true);
            }
            moment.state = state.clone();
        }
        self.newest = state;
    }
}
