//! The estimate that the autopilot tells: its own, unless a fault makes it an old one.

use std::collections::VecDeque;
use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::VehicleState;

use crate::position_error::{PositionFault, PositionFaultKind};

/// What is told late falls behind by a second in so many: no time stamp goes back.
const FALLS_BEHIND: u32 = 2;

/// The faults of one autopilot's telling.
#[derive(Debug, Clone)]
pub(super) struct Telling {
    faults: Vec<PositionFault>,
    /// The state told last, as long as it is told again.
    frozen: Option<VehicleState>,
    /// The states of late, oldest first, as far back as the latest of the faults needs them.
    past: VecDeque<VehicleState>,
    keeps: Duration,
    /// When it was last asked whether it begins anew.
    asked: Duration,
}

impl Telling {
    /// Of all faults those of an autopilot count.
    pub(super) fn new(faults: &[PositionFault]) -> Self {
        let faults: Vec<_> = faults.iter().copied().filter(|fault| fault.kind.is_of_autopilot()).collect();
        let lateness = |fault: &PositionFault| match fault.kind {
            PositionFaultKind::Late(by) => by,
            _ => Duration::ZERO,
        };
        let keeps = faults.iter().map(lateness).max().unwrap_or_default();
        Self { faults, frozen: None, past: VecDeque::new(), keeps, asked: Duration::ZERO }
    }

    /// The origin's move from where it was at first, ENU, m.
    pub(super) fn origin(&self, now: Duration) -> Vector3<f64> {
        let moves = self.faults.iter().filter(|fault| fault.is_on(now));
        moves.fold(Vector3::zeros(), |moved, fault| match fault.kind {
            PositionFaultKind::OriginMoves(by) => moved + by,
            _ => moved,
        })
    }

    /// Whether the autopilot begins anew now; once for each such fault.
    pub(super) fn begins_anew(&mut self, now: Duration) -> bool {
        let since = std::mem::replace(&mut self.asked, now);
        let is_due = |fault: &PositionFault| fault.kind == PositionFaultKind::Resets && fault.at > since;
        self.faults.iter().any(|fault| is_due(fault) && fault.at <= now)
    }

    /// What is told in place of `state`, the true one: its motion may be an old one.
    pub(super) fn told(&mut self, now: Duration, state: VehicleState) -> VehicleState {
        if self.faults.is_empty() {
            return state;
        }
        if self.keeps > Duration::ZERO {
            while self.past.get(1).is_some_and(|next| next.measured + self.keeps <= now) {
                self.past.pop_front();
            }
            self.past.push_back(state.clone());
        }
        let (mut late, mut freezes) = (Duration::ZERO, false);
        for fault in self.faults.iter().filter(|fault| fault.is_on(now)) {
            match fault.kind {
                PositionFaultKind::Late(by) => late = late.max(by.min((now - fault.at) / FALLS_BEHIND)),
                PositionFaultKind::Freezes => freezes = true,
                _ => {}
            }
        }
        let old = self.past.iter().rev().find(|past| past.measured + late <= now);
        let motion = old.filter(|_| late > Duration::ZERO).unwrap_or(&state).clone();
        let motion = match self.frozen.take() {
            Some(frozen) if freezes => frozen,
            _ => motion,
        };
        self.frozen = freezes.then(|| motion.clone());
        VehicleState {
            measured: motion.measured,
            position: motion.position,
            velocity: motion.velocity,
            ..state
        }
    }
}
