//! The way of an obstacle that moves: where it is at any time, without a memory, so that equal runs have
//! equal worlds.

use std::time::Duration;

use nalgebra::Vector3;

/// A way through places, each reached at a speed of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Way {
    legs: Vec<Leg>,
    /// Whether it begins again once it is over.
    loops: bool,
}

/// A straight part of a way, and a stop at its end.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Leg {
    from: Vector3<f64>,
    velocity: Vector3<f64>,
    /// Since the run began, s.
    begins_s: f64,
    moves_s: f64,
    ends_s: f64,
}

/// A place on a way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    /// World ENU, m.
    pub at: Vector3<f64>,
    /// Speed on the way there, m/s, above 0.
    pub speed_m_s: f64,
    /// Time that it stands there, s.
    pub waits_s: f64,
}

impl Way {
    /// Straight on for ever; m/s.
    pub fn straight(from: Vector3<f64>, velocity: Vector3<f64>) -> Self {
        let endless = Leg { from, velocity, begins_s: 0.0, moves_s: f64::INFINITY, ends_s: f64::INFINITY };
        Self { legs: vec![endless], loops: false }
    }

    /// From one place to the others in turn; from the last back to the first if it `loops`, else it ends
    /// there.
    pub fn through(from: Vector3<f64>, stops: &[Stop], loops: bool) -> Self {
        let back = stops.last().filter(|_| loops).map(|last| Stop { at: from, waits_s: 0.0, ..*last });
        let (mut from, mut begins_s) = (from, 0.0);
        let leg = |stop: Stop| {
            let offset = stop.at - from;
            let moves_s = offset.norm() / stop.speed_m_s;
            let velocity = if moves_s > 0.0 { offset / moves_s } else { Vector3::zeros() };
            let leg = Leg { from, velocity, begins_s, moves_s, ends_s: begins_s + moves_s + stop.waits_s };
            (from, begins_s) = (stop.at, leg.ends_s);
            leg
        };
        Self { legs: stops.iter().copied().chain(back).map(leg).collect(), loops }
    }

    /// By times since the run began, in order; before the first it stands for `delay` where that is. One that
    /// loops is there again at once when its last time is over.
    pub fn timed(stops: &[(Duration, Vector3<f64>)], delay: Duration, loops: bool) -> Self {
        let Some((first_time, first)) = stops.first().copied() else {
            return Self { legs: Vec::new(), loops };
        };
        let first_s = (delay + first_time).as_secs_f64();
        let stand =
            Leg { from: first, velocity: Vector3::zeros(), begins_s: 0.0, moves_s: 0.0, ends_s: first_s };
        let legs = stops.windows(2).map(|pair| {
            let ((from_time, from), (to_time, to)) = (pair[0], pair[1]);
            let (begins_s, moves_s) =
                ((delay + from_time).as_secs_f64(), (to_time - from_time).as_secs_f64());
            let velocity = if moves_s > 0.0 { (to - from) / moves_s } else { Vector3::zeros() };
            Leg { from, velocity, begins_s, moves_s, ends_s: begins_s + moves_s }
        });
        Self { legs: std::iter::once(stand).chain(legs).collect(), loops }
    }

    /// Where it is so long after the run began; world ENU, m.
    pub fn at(&self, now: Duration) -> Vector3<f64> {
        self.leg(now)
            .map_or_else(Vector3::zeros, |(leg, since_s)| leg.from + leg.velocity * since_s.min(leg.moves_s))
    }

    /// Its velocity then; world ENU, m/s.
    pub fn velocity(&self, now: Duration) -> Vector3<f64> {
        let moving = self.leg(now).filter(|(leg, since_s)| *since_s < leg.moves_s);
        moving.map_or_else(Vector3::zeros, |(leg, _)| leg.velocity)
    }

    /// The leg it is on, and for how long it has been, s.
    fn leg(&self, now: Duration) -> Option<(&Leg, f64)> {
        let (last, now_s) = (self.legs.last()?, now.as_secs_f64());
        let now_s = if self.loops && last.ends_s > 0.0 { now_s % last.ends_s } else { now_s };
        let number = self.legs.partition_point(|leg| leg.ends_s <= now_s);
        let leg = self.legs.get(number).unwrap_or(last);
        Some((leg, now_s - leg.begins_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_s(seconds: f64) -> Duration {
        Duration::from_secs_f64(seconds)
    }

    fn there_and_on(loops: bool) -> Way {
        let stop = |x: f64, y: f64, speed_m_s| Stop { at: Vector3::new(x, y, 1.0), speed_m_s, waits_s: 2.0 };
        Way::through(Vector3::new(0.0, 0.0, 1.0), &[stop(4.0, 0.0, 1.0), stop(4.0, 4.0, 2.0)], loops)
    }

    #[test]
    fn each_leg_has_its_speed_and_each_place_its_stop() {
        let way = there_and_on(false);
        for (seconds, place, speed_m_s) in
            [(1.0, [1.0, 0.0], 1.0), (5.0, [4.0, 0.0], 0.0), (7.0, [4.0, 2.0], 2.0), (99.0, [4.0, 4.0], 0.0)]
        {
            assert!((way.at(at_s(seconds)).xy() - Vector3::new(place[0], place[1], 0.0).xy()).norm() < 1e-9);
            assert!((way.velocity(at_s(seconds)).norm() - speed_m_s).abs() < 1e-9, "at {seconds} s");
        }
    }

    #[test]
    fn a_way_that_loops_leads_back_and_begins_again() {
        let way = there_and_on(true);
        let round_s = 4.0 + 2.0 + 2.0 + 2.0 + 32.0_f64.sqrt() / 2.0;
        for seconds in [0.5, 5.0, 9.0] {
            let later = way.at(at_s(round_s + seconds));
            assert!((later - way.at(at_s(seconds))).norm() < 1e-6, "at {seconds} s: {later:?}");
        }
    }

    #[test]
    fn a_timed_way_is_at_its_places_at_their_times_and_begins_again_at_once() {
        let stops = [(2.0, 0.0), (4.0, 6.0), (5.0, 6.0)].map(|(s, x)| (at_s(s), Vector3::new(x, 0.0, 1.0)));
        let way = Way::timed(&stops, at_s(1.0), true);
        for (seconds, x) in [(0.0, 0.0), (3.0, 0.0), (4.0, 3.0), (5.5, 6.0), (6.5, 0.0), (10.0, 3.0)] {
            assert!(
                (way.at(at_s(seconds)).x - x).abs() < 1e-9,
                "at {seconds} s: {:?}",
                way.at(at_s(seconds))
            );
        }
        let once = Way::timed(&stops, at_s(0.0), false);
        assert_eq!((once.at(at_s(99.0)).x, once.velocity(at_s(3.0)).x), (6.0, 3.0));
    }

    #[test]
    fn straight_on_has_no_end() {
        let way = Way::straight(Vector3::zeros(), Vector3::new(0.5, -1.0, 0.0));
        assert_eq!(way.at(at_s(1000.0)), Vector3::new(500.0, -1000.0, 0.0));
    }
}
