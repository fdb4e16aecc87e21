//! The age of decisions: what control does when the mission is silent.

use std::time::Duration;

use crate::instruction::Instruction;

/// A decision older than this sets nothing going any more: the vehicle hovers, and avoids.
pub const HOVER_AFTER: Duration = Duration::from_millis(500);
/// After so long without a decision the vehicle lands.
pub const LAND_AFTER: Duration = Duration::from_secs(10);

/// When the mission has decided last, even if it was that nothing is to be done.
#[derive(Debug, Default)]
pub struct Decisions {
    newest: Option<Duration>,
}

/// The consequence of the age of the newest decision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    Fresh,
    /// Hover, and avoid.
    Old,
    /// Land.
    TooOld,
}

impl Decisions {
    /// The mission has decided at this time.
    pub fn note(&mut self, at: Duration) {
        self.newest = self.newest.max(Some(at));
    }

    /// The age of the newest decision. Before the first, time counts from the first call.
    pub fn age(&mut self, now: Duration) -> Duration {
        now.saturating_sub(*self.newest.get_or_insert(now))
    }

    /// The consequence of it.
    pub fn standing(&mut self, now: Duration) -> Standing {
        match self.age(now) {
            age if age > LAND_AFTER => Standing::TooOld,
            age if age > HOVER_AFTER => Standing::Old,
            _ => Standing::Fresh,
        }
    }
}

/// Whether an instruction that was decided at `at` comes too late to be carried out. What brings the vehicle
/// to a stop or down never does.
pub fn is_too_late(now: Duration, at: Duration, instruction: &Instruction) -> bool {
    let sets_going = matches!(
        instruction,
        Instruction::TakeOff | Instruction::TakeBack | Instruction::Resume | Instruction::GrantLeave
    );
    sets_going && now.saturating_sub(at) > HOVER_AFTER
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    #[test]
    fn a_silent_mission_means_hovering_and_then_landing() {
        let mut decisions = Decisions::default();
        assert_eq!(decisions.standing(ms(70_000)), Standing::Fresh, "it has not had its chance yet");
        decisions.note(ms(80_000));
        decisions.note(ms(79_000));
        for (now, standing) in [
            (80_500, Standing::Fresh),
            (80_501, Standing::Old),
            (90_000, Standing::Old),
            (90_001, Standing::TooOld),
        ] {
            assert_eq!(decisions.standing(ms(now)), standing, "at {now} ms");
        }
        decisions.note(ms(90_100));
        assert_eq!(decisions.standing(ms(90_101)), Standing::Fresh);
    }

    #[test]
    fn an_old_decision_sets_nothing_going_but_brings_down() {
        let late = |instruction, age: u64| is_too_late(ms(1000 + age), ms(1000), &instruction);
        for going in
            [Instruction::TakeOff, Instruction::TakeBack, Instruction::Resume, Instruction::GrantLeave]
        {
            assert!(!late(going, 500) && late(going, 501), "{going:?}");
        }
        assert!(!late(Instruction::Hold, 60_000) && !late(Instruction::Land, 60_000));
    }
}
