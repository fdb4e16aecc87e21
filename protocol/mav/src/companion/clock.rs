//! The autopilot's clock: where it stands, as its answers to `TIMESYNC` tell, and whether its time stamps go on.

use std::time::Duration;

use mavlink::dialects::common::TIMESYNC_DATA;

/// The time is asked for this often.
const ASK_EVERY: Duration = Duration::from_millis(200);
/// Both clocks drift apart by no more than this, s/s: a simulator in slow motion is an autopilot with a slow clock.
const DRIFT: f64 = 0.2;
/// An answer that took longer tells nothing.
const LONGEST_ROUND_TRIP: Duration = Duration::from_secs(5);
/// Messages overtake one another by no more than this; whose clock goes back further has begun anew.
const OVERTAKES: Duration = Duration::from_millis(500);

/// Of an autopilot that does not answer, a pause longer than this is its own and no delay.
const LONGEST_WAIT: Duration = Duration::from_secs(1);
/// Its clock goes slower than the companion's by no more than this, s/s.
const SLIPS: f64 = 0.01;

/// A time stamp after those before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stamp {
    Newer,
    /// As the last one.
    Same,
    /// Of a message that another has overtaken.
    Overtaken,
    /// The clock has begun anew.
    Restarted,
}

/// The content of an answer.
#[derive(Debug, Clone, Copy)]
struct Reading {
    /// Its clock less the companion's, s.
    ahead_s: f64,
    round_trip_s: f64,
    at: Duration,
}

impl Reading {
    /// By how much it may be wrong, s.
    fn error_s(&self, now: Duration) -> f64 {
        0.5 * self.round_trip_s + DRIFT * now.saturating_sub(self.at).as_secs_f64()
    }
}

#[derive(Debug, Clone, Default)]
pub(super) struct Clock {
    ask_at: Duration,
    reading: Option<Reading>,
    /// As far as an autopilot that does not answer lets itself be known: by the position that came soonest.
    soonest: Option<Reading>,
    /// The newest time stamp, and when it came.
    newest: Option<(Duration, Duration)>,
}

impl Clock {
    /// The question, if it is due.
    pub(super) fn ask(&mut self, now: Duration) -> Option<TIMESYNC_DATA> {
        if now < self.ask_at {
            return None;
        }
        self.ask_at = now + ASK_EVERY;
        // 0 marks no time of one's own; 292 years fit.
        Some(TIMESYNC_DATA { tc1: 0, ts1: now.as_nanos() as i64, ..Default::default() })
    }

    /// Takes in an answer; a question of somebody else's is none.
    pub(super) fn hear(&mut self, now: Duration, answer: &TIMESYNC_DATA) {
        let (Ok(its_ns), Ok(asked_ns)) = (u64::try_from(answer.tc1), u64::try_from(answer.ts1)) else {
            return;
        };
        let Some(round_trip) = now.checked_sub(Duration::from_nanos(asked_ns)) else { return };
        if its_ns == 0 || round_trip > LONGEST_ROUND_TRIP {
            return;
        }
        let round_trip_s = round_trip.as_secs_f64();
        let answered_s = now.as_secs_f64() - 0.5 * round_trip_s;
        let ahead_s = Duration::from_nanos(its_ns).as_secs_f64() - answered_s;
        let heard = Reading { ahead_s, round_trip_s, at: now };
        if self.reading.is_none_or(|known| heard.error_s(now) <= known.error_s(now)) {
            self.reading = Some(heard);
        }
    }

    /// Takes in the time stamp of a position.
    pub(super) fn stamp(&mut self, now: Duration, time: Duration) -> Stamp {
        let stamp = match self.newest {
            Some((newest, _)) if time == newest => Stamp::Same,
            Some((newest, _)) if time + OVERTAKES < newest => Stamp::Restarted,
            Some((newest, _)) if time < newest => return Stamp::Overtaken,
            _ => Stamp::Newer,
        };
        if stamp == Stamp::Restarted {
            (self.reading, self.soonest) = (None, None);
        }
        self.compare(now, time);
        self.newest = Some((time, now));
        stamp
    }

    /// Learns where the clock stands from when a time stamp came. A pause of both is none of the messages.
    fn compare(&mut self, now: Duration, time: Duration) {
        let paused = self.newest.is_some_and(|(newest, came)| {
            now.saturating_sub(came) > time.saturating_sub(newest) + LONGEST_WAIT
        });
        let heard = Reading { ahead_s: time.as_secs_f64() - now.as_secs_f64(), round_trip_s: 0.0, at: now };
        let known = self.soonest.filter(|known| {
            let slipped_s = SLIPS * now.saturating_sub(known.at).as_secs_f64();
            !paused && heard.ahead_s < known.ahead_s - slipped_s
        });
        self.soonest = known.or(Some(heard));
    }

    /// The age of a measurement of `time` on the autopilot's clock; `None` while it is not known where
    /// that stands.
    pub(super) fn age(&self, now: Duration, time: Duration) -> Option<Duration> {
        let age_s = now.as_secs_f64() + self.reading.or(self.soonest)?.ahead_s - time.as_secs_f64();
        Duration::try_from_secs_f64(age_s.max(0.0)).ok().filter(|age| *age <= LONGEST_ROUND_TRIP)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    /// A clock that was asked at `at` by an autopilot that is 70 s ahead; the way takes `there` and `back`.
    fn asked(clock: &mut Clock, at: Duration, there: Duration, back: Duration) {
        let mut question = clock.ask(at).unwrap();
        question.tc1 = (at + there + ms(70_000)).as_nanos() as i64;
        clock.hear(at + there + back, &question);
    }

    #[test]
    fn an_estimate_is_as_old_as_it_was_long_on_the_way() {
        let mut clock = Clock::default();
        assert_eq!(clock.age(ms(900), ms(70_700)), None, "nothing is known yet");
        asked(&mut clock, ms(1000), ms(5), ms(5));
        assert_eq!(clock.age(ms(1500), ms(71_200)), Some(ms(300)));
        // What lies in a queue is told late, and so are the answers.
        asked(&mut clock, ms(2000), ms(5), ms(505));
        let age = clock.age(ms(2510), ms(72_005)).unwrap();
        assert!(age >= ms(250) && age <= ms(700), "{age:?}");
    }

    #[test]
    fn a_slow_clock_is_no_late_message() {
        let mut clock = Clock::default();
        for second in 0..50_u64 {
            // A simulator at 0.8 times real time.
            let (now, its) = (ms(1000 + 200 * second), ms(70_000 + 160 * second));
            let mut question = clock.ask(now).unwrap();
            question.tc1 = its.as_nanos() as i64;
            clock.hear(now + ms(2), &question);
            assert!(clock.age(now + ms(2), its).unwrap() < ms(60));
        }
    }

    #[test]
    fn of_an_autopilot_that_does_not_answer_a_growing_delay_is_known_and_a_pause_is_none() {
        let mut clock = Clock::default();
        let age = |clock: &mut Clock, now, its| {
            clock.stamp(ms(now), ms(its));
            clock.age(ms(now), ms(its)).unwrap()
        };
        assert_eq!(age(&mut clock, 1000, 70_000), ms(0));
        assert_eq!(age(&mut clock, 1030, 70_020), ms(10));
        // A queue that grows by half of each second.
        let late: Vec<_> = (1..=50).map(|n| age(&mut clock, 1030 + 40 * n, 70_020 + 20 * n)).collect();
        assert!(late[49] > ms(900) && late[49] < ms(1050), "{:?}", late[49]);
        // A simulator that stands still for five seconds.
        assert_eq!(age(&mut clock, 9000, 71_040), ms(0));
        // What was held back for as long comes in at once.
        age(&mut clock, 15_000, 71_060);
        assert_eq!(age(&mut clock, 15_000, 77_000), ms(0));
        assert!(age(&mut clock, 15_500, 77_020) > ms(450));
    }

    #[test]
    fn a_question_and_an_answer_to_nobody_tell_nothing() {
        let mut clock = Clock::default();
        for (tc1, ts1) in [(0, 500_000_000), (-5, 500_000_000), (7, -1), (7, i64::MAX), (i64::MAX, 7)] {
            clock.hear(ms(1000), &TIMESYNC_DATA { tc1, ts1, ..Default::default() });
        }
        assert_eq!(clock.age(ms(1000), ms(70_000)), None);
    }

    #[test]
    fn time_stamps_go_on_stay_overtake_or_begin_anew() {
        let mut clock = Clock::default();
        let stamps = [5000, 5020, 5020, 5010, 5040, 100, 120].map(|time| clock.stamp(ms(9000), ms(time)));
        use Stamp::{Newer, Overtaken, Restarted, Same};
        assert_eq!(stamps, [Newer, Newer, Same, Overtaken, Newer, Restarted, Newer]);
    }
}
