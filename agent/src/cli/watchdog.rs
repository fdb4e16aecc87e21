//! The watchdog: whether control goes on.

/// Between two looks, in milliseconds.
pub const LOOK_MS: u64 = 50;
/// After so many looks without a sign of life, control has let its set-points fall silent: the autopilot's
/// own failsafe acts.
const STALLED: u32 = 1000 / LOOK_MS as u32;
/// After so many, the program ends: whoever watches over it starts it again.
const HUNG: u32 = 10_000 / LOOK_MS as u32;

/// Counts the looks at which nothing had moved. It counts its own looks and not time: a program that was
/// stopped for a while as a whole does not hang.
#[derive(Debug, Default)]
pub struct Watchdog {
    beats: u64,
    idle_looks: u32,
}

/// The result of one look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    Alive,
    /// For the first time since it was alive.
    Stalled,
    /// It goes on again.
    Recovered,
    Hung,
}

impl Watchdog {
    /// Looks at how often control has gone on.
    pub fn look(&mut self, beats: u64) -> Seen {
        let was_stalled = self.idle_looks >= STALLED;
        if std::mem::replace(&mut self.beats, beats) != beats {
            self.idle_looks = 0;
            return if was_stalled { Seen::Recovered } else { Seen::Alive };
        }
        self.idle_looks += 1;
        match self.idle_looks {
            looks if looks >= HUNG => Seen::Hung,
            STALLED => Seen::Stalled,
            _ => Seen::Alive,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_does_not_go_on_is_told_of_once_and_then_ended() {
        let mut watchdog = Watchdog::default();
        assert_eq!(watchdog.look(1), Seen::Alive);
        let stalled: Vec<Seen> = (0..HUNG).map(|_| watchdog.look(1)).collect();
        assert_eq!(stalled.iter().filter(|seen| **seen == Seen::Stalled).count(), 1);
        assert_eq!(stalled.iter().position(|seen| *seen == Seen::Stalled), Some(STALLED as usize - 1));
        assert_eq!(stalled.last(), Some(&Seen::Hung));
        assert_eq!(watchdog.look(2), Seen::Recovered);
        assert_eq!(watchdog.look(3), Seen::Alive);
    }
}
