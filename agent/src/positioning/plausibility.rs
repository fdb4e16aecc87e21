//! Plausibility: whether an estimate goes on as its own velocity and time stamps say that it must.
//!
//! Velocity comes from instruments that know no place, so a position that runs away from the integral of its velocity
//! has jumped. Of such a jump nobody knows which side of it is right: the vehicle stops, and what it tells of its error
//! is at least the jump, less and less as the estimate goes on soundly. Once that is within its limits, it goes on in
//! the new frame.

use std::collections::VecDeque;
use std::fmt;
use std::time::Duration;

use nalgebra::Vector3;
use skein_mav::{Geodetic, Telemetry};

/// Positions are compared with velocities over so long.
const WINDOW: Duration = Duration::from_secs(1);
/// What a position may run away from the integral of its velocity in a window, m, and more of one that is uncertain, as
/// a share of its standard deviation.
const TOLERANCE_M: f64 = 1.0;
const TOLERANCE_OF_SIGMA: f64 = 0.5;
/// Acceleration between two positions that nothing tells of, m/s2.
const UNKNOWN_M_S2: f64 = 2.0;
/// Nothing is said of a gap longer than this.
const LONGEST_GAP: Duration = Duration::from_secs(2);
/// A jump counts for half as much after each such time without another one.
const HALVES_AFTER: Duration = Duration::from_secs(3);
/// A jumped estimate is doubted for so long at least.
const DOUBTED_FOR: Duration = Duration::from_secs(3);
/// An estimate that has not changed for so long in motion is frozen.
const FROZEN_AFTER: Duration = Duration::from_millis(300);
/// Slower than this, it may be standing, m/s.
const MOVES_M_S: f64 = 0.3;
/// An estimate older than this is late.
const LATE_AFTER: Duration = Duration::from_millis(200);

/// The reason not to believe an estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Doubt {
    /// It jumped, by so much, m.
    Jumped(f64),
    /// The origin it counts from moved; with it jumped, by so much, m.
    OriginMoved(f64),
    /// The autopilot or its estimator began anew.
    Restarted,
    /// The same is told again and again.
    Frozen,
    /// It is so old when it arrives.
    Late(Duration),
    /// There are no satellites any more.
    GpsLost,
    /// The inertial unit is silent.
    Unfelt,
    /// No source has told the position for too long, or it has become too uncertain without one.
    Alone,
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Jumped(by_m) => write!(f, "the position jumped by {by_m:.1} m"),
            Self::OriginMoved(by_m) => {
                write!(f, "the autopilot's origin moved, and the position by {by_m:.1} m")
            }
            Self::Restarted => f.write_str("the autopilot's clock began anew"),
            Self::Frozen => f.write_str("the position is frozen"),
            Self::Late(age) => write!(f, "the position is {:.1} s late", age.as_secs_f64()),
            Self::GpsLost => f.write_str("the autopilot has lost its satellites"),
            Self::Unfelt => f.write_str("the autopilot tells nothing of its inertial unit"),
            Self::Alone => f.write_str("nothing but inertia and flow has told the position for too long"),
        }
    }
}

/// A position, and what it is beside the integral of the velocities so far.
#[derive(Clone, Copy, Debug)]
struct Sample {
    /// When it arrived, and on the autopilot's clock.
    stamp: Duration,
    time: Option<Duration>,
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    /// The position less the integral of the velocity, m; its beginning counts for nothing.
    residual: Vector3<f64>,
}

/// Watches one vehicle's estimate.
#[derive(Clone, Debug, Default)]
pub struct Plausibility {
    /// The samples of a window, oldest first.
    samples: VecDeque<Sample>,
    /// When the position last changed.
    changed: Duration,
    origin: Option<Geodetic>,
    /// The origin has moved, and no position from there has come yet.
    awaits_origin: bool,
    restarts: u32,
    had_gps: bool,
    /// The last jump or restart that is not forgotten yet, and when it was found.
    shock: Option<(Duration, Doubt)>,
    /// The jumps since there was none to remember, together, m.
    jumped: Vector3<f64>,
    /// All jumps since the beginning, together, m.
    frame: Vector3<f64>,
}

impl Plausibility {
    /// Takes in what the autopilot tells at `now`; `sigma_m` is the standard deviation that it tells of its position.
    pub fn look(&mut self, now: Duration, telemetry: &Telemetry, sigma_m: f64) {
        self.had_gps |= telemetry.has_gps_fix == Some(true);
        if self.shock.is_some_and(|(at, _)| self.faded_m(now) < TOLERANCE_M / 10.0 && now >= at + DOUBTED_FOR)
        {
            (self.shock, self.jumped) = (None, Vector3::zeros());
        }
        let has_restarted = std::mem::replace(&mut self.restarts, telemetry.restarts) != telemetry.restarts;
        self.awaits_origin |= self.origin.is_some() && self.origin != telemetry.local_origin;
        self.origin = telemetry.local_origin;
        let last = self.newest();
        let jump = self.follow(telemetry, sigma_m);
        let origin_moved = self.newest() != last && std::mem::take(&mut self.awaits_origin);
        self.jumped += jump.unwrap_or_default();
        self.frame += jump.unwrap_or_default();
        let by_m = self.jumped.norm();
        let recent_origin = matches!(self.shock, Some((at, Doubt::OriginMoved(_))) if now < at + WINDOW);
        let found = if has_restarted {
            Some(Doubt::Restarted)
        } else if origin_moved || (jump.is_some() && recent_origin) {
            Some(Doubt::OriginMoved(by_m))
        } else {
            jump.map(|_| Doubt::Jumped(by_m))
        };
        if let Some(doubt) = found {
            self.shock = Some((now, doubt));
        }
    }

    /// When the newest position came.
    fn newest(&self) -> Option<Duration> {
        self.samples.back().map(|sample| sample.stamp)
    }

    /// The jump that the newest position shows, if it is new and does.
    fn follow(&mut self, telemetry: &Telemetry, sigma_m: f64) -> Option<Vector3<f64>> {
        let (position, velocity) = telemetry.position.zip(telemetry.velocity)?;
        let last = self.samples.back().copied();
        if last.is_some_and(|last| last.stamp == position.stamp) {
            return None;
        }
        let mut sample = Sample {
            stamp: position.stamp,
            time: telemetry.position_time,
            position: position.value,
            velocity: velocity.value,
            residual: Vector3::zeros(),
        };
        if last.is_none_or(|last| last.position != sample.position || sample.velocity.norm() < MOVES_M_S) {
            self.changed = sample.stamp;
        }
        let Some(last) = last else {
            self.samples.push_back(sample);
            return None;
        };
        let gap = sample.since(&last);
        let gap_s = gap.as_secs_f64();
        sample.residual = last.residual + sample.position
            - last.position
            - (last.velocity + sample.velocity) * (0.5 * gap_s);
        while self.samples.front().is_some_and(|oldest| oldest.stamp + WINDOW < sample.stamp) {
            self.samples.pop_front();
        }
        let from = self.samples.front().map_or(last.residual, |oldest| oldest.residual);
        self.samples.push_back(sample);
        if gap > LONGEST_GAP {
            self.samples = VecDeque::from([sample]);
            return None;
        }
        let jump = sample.residual - from;
        let unknown_m = if gap_s > 0.1 { 0.5 * UNKNOWN_M_S2 * gap_s * gap_s } else { 0.0 };
        (jump.norm() > TOLERANCE_M + TOLERANCE_OF_SIGMA * sigma_m + unknown_m).then(|| {
            self.samples = VecDeque::from([sample]);
            jump
        })
    }

    /// The rest of the jumps, m.
    fn faded_m(&self, now: Duration) -> f64 {
        self.shock.map_or(0.0, |(at, _)| {
            let halves = now.saturating_sub(at).as_secs_f64() / HALVES_AFTER.as_secs_f64();
            self.jumped.norm() * (-halves).exp2()
        })
    }

    /// The standard deviation to add to what is told of the position, m.
    pub fn sigma_m(&self, now: Duration) -> f64 {
        self.faded_m(now)
    }

    /// All jumps since the beginning, together, m ENU: what was placed by the estimate before is shifted by
    /// as much.
    pub fn frame(&self) -> Vector3<f64> {
        self.frame
    }

    /// The reason not to believe the estimate now, if there is one.
    pub fn doubt(&self, now: Duration, telemetry: &Telemetry) -> Option<Doubt> {
        let position = telemetry.position?;
        let is_heard = telemetry.attitude.is_some_and(|attitude| attitude.age(now) < LATE_AFTER);
        let is_still = position.stamp >= self.changed + FROZEN_AFTER;
        let age = telemetry.position_age.filter(|age| *age > LATE_AFTER);
        if is_still || is_heard && position.age(now) > FROZEN_AFTER {
            Some(Doubt::Frozen)
        } else if let Some(age) = age {
            Some(Doubt::Late(age))
        } else if self.had_gps && telemetry.has_gps_fix == Some(false) {
            Some(Doubt::GpsLost)
        } else {
            self.shock.filter(|(at, _)| now < *at + DOUBTED_FOR).map(|(_, doubt)| doubt)
        }
    }

    /// The estimate's last trouble, as long as it is not forgotten.
    pub fn shock(&self) -> Option<Doubt> {
        self.shock.map(|(_, doubt)| doubt)
    }
}

impl Sample {
    /// Time since an earlier sample: on the autopilot's clock, unless that has begun anew.
    fn since(&self, earlier: &Self) -> Duration {
        let on_its_clock = self.time.zip(earlier.time).and_then(|(time, before)| time.checked_sub(before));
        on_its_clock
            .filter(|passed| *passed > Duration::ZERO)
            .unwrap_or_else(|| self.stamp.saturating_sub(earlier.stamp))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;
    use skein_mav::Stamped;

    use super::*;

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    /// An autopilot that tells where it is every 20 ms.
    struct Told {
        now: Duration,
        telemetry: Telemetry,
        plausibility: Plausibility,
        position: Vector3<f64>,
        velocity: Vector3<f64>,
        sigma_m: f64,
    }

    impl Told {
        fn flying(velocity: [f64; 3]) -> Self {
            let mut told = Self {
                now: ms(60_000),
                telemetry: Telemetry { has_gps_fix: Some(true), ..Telemetry::default() },
                plausibility: Plausibility::default(),
                position: Vector3::new(3.0, 4.0, 5.0),
                velocity: velocity.into(),
                sigma_m: 0.05,
            };
            told.run(3000);
            told
        }

        fn run(&mut self, milliseconds: u64) {
            for _ in 0..milliseconds / 20 {
                self.now += ms(20);
                self.position += self.velocity * 0.02;
                self.tell(self.now, self.position);
            }
        }

        fn tell(&mut self, now: Duration, position: Vector3<f64>) {
            let telemetry = &mut self.telemetry;
            telemetry.position = Some(Stamped { stamp: now, value: position });
            telemetry.velocity = Some(Stamped { stamp: now, value: self.velocity });
            telemetry.position_time = Some(now);
            self.look(now);
        }

        fn look(&mut self, now: Duration) {
            self.telemetry.attitude = Some(Stamped { stamp: now, value: UnitQuaternion::identity() });
            self.plausibility.look(now, &self.telemetry, self.sigma_m);
        }

        fn doubt(&self) -> Option<Doubt> {
            self.plausibility.doubt(self.now, &self.telemetry)
        }

        fn sigma_m(&self) -> f64 {
            self.plausibility.sigma_m(self.now)
        }
    }

    #[test]
    fn an_estimate_that_goes_as_its_velocity_says_is_believed() {
        let mut told = Told::flying([2.0, -1.0, 0.3]);
        told.velocity = Vector3::new(-3.0, 0.0, 0.0);
        told.run(5000);
        assert_eq!((told.doubt(), told.sigma_m(), told.plausibility.frame()), (None, 0.0, Vector3::zeros()));
    }

    #[test]
    fn a_jump_is_noticed_by_its_size_and_believed_once_it_has_faded() {
        for by_m in [2.0, 8.0] {
            let mut told = Told::flying([2.0, 0.0, 0.0]);
            told.position.y += by_m;
            told.run(20);
            assert!(matches!(told.doubt(), Some(Doubt::Jumped(m)) if (m - by_m).abs() < 0.1), "{by_m}");
            assert!((told.sigma_m() - by_m).abs() < 0.1 && (told.plausibility.frame().y - by_m).abs() < 0.1);
            told.run(2900);
            assert!(told.doubt().is_some(), "it is doubted for 3 s at least");
            told.run(3100);
            assert_eq!(told.doubt(), None);
            assert!((told.sigma_m() - by_m / 4.0).abs() < 0.1, "halved twice: {}", told.sigma_m());
            told.run(30_000);
            assert_eq!((told.sigma_m(), told.plausibility.shock()), (0.0, None));
        }
    }

    #[test]
    fn a_glitch_that_goes_back_leaves_no_doubt_about_the_place() {
        let mut told = Told::flying([0.0, 1.0, 0.0]);
        told.position.x += 8.0;
        told.run(5000);
        told.position.x -= 8.0;
        told.run(20);
        assert!(told.sigma_m() < 0.1, "{}", told.sigma_m());
        assert!(told.plausibility.frame().norm() < 0.1);
        told.run(3100);
        assert_eq!(told.doubt(), None);
    }

    #[test]
    fn a_position_that_is_pulled_aside_within_a_second_has_jumped() {
        let mut told = Told::flying([0.0, 0.0, 0.0]);
        for _ in 0..50 {
            told.position.x += 0.05;
            told.run(20);
        }
        assert!(matches!(told.doubt(), Some(Doubt::Jumped(_))));
        assert!((1.0..2.6).contains(&told.plausibility.frame().x), "{}", told.plausibility.frame());
    }

    #[test]
    fn the_drift_of_an_uncertain_estimate_is_no_jump() {
        let mut told = Told::flying([1.0, 0.0, 0.0]);
        told.sigma_m = 1.0;
        for _ in 0..500 {
            // Half a metre in a second: more than a drift of 1 m and 60 s does.
            told.position.x += 0.01;
            told.run(20);
        }
        assert_eq!(told.doubt(), None);
    }

    #[test]
    fn after_a_pause_a_position_is_not_compared_with_a_velocity_of_long_ago() {
        let mut told = Told::flying([3.0, 0.0, 0.0]);
        told.now += ms(5000);
        told.position.x += 4.0;
        told.run(20);
        assert_eq!(told.doubt(), None);
        // A simulator that pauses stops the autopilot's clock too.
        told.now += ms(5000);
        let time = told.telemetry.position_time.unwrap() + ms(20);
        told.position.x += 0.06;
        told.run(20);
        assert!(time < told.now && told.doubt().is_none());
    }

    #[test]
    fn a_moved_origin_is_named() {
        let origin = |latitude_e7| Some(Geodetic::from_e7(latitude_e7, 85_455_940, 488_000));
        let mut told = Told::flying([0.0, 1.0, 0.0]);
        told.telemetry.local_origin = origin(473_977_420);
        told.run(1000);
        assert_eq!(told.doubt(), None, "the first origin is none that moved");
        told.telemetry.local_origin = origin(473_978_620);
        told.look(told.now);
        assert_eq!(told.doubt(), None, "how far is not known before a position from there");
        told.position.y += 13.0;
        told.run(20);
        assert!(matches!(told.doubt(), Some(Doubt::OriginMoved(m)) if (m - 13.0).abs() < 0.1));
        assert!((told.sigma_m() - 13.0).abs() < 0.2);
    }

    #[test]
    fn a_clock_that_begins_anew_is_a_restart() {
        let mut told = Told::flying([0.0, 0.0, 0.0]);
        told.telemetry.restarts = 1;
        told.run(20);
        assert_eq!(told.doubt(), Some(Doubt::Restarted));
        told.run(3100);
        assert_eq!(told.doubt(), None);
    }

    #[test]
    fn what_does_not_change_in_motion_is_frozen_and_what_hovers_is_not() {
        let mut told = Told::flying([1.0, 0.0, 0.0]);
        let place = told.position;
        for _ in 0..20 {
            told.now += ms(20);
            told.tell(told.now, place);
        }
        assert_eq!(told.doubt(), Some(Doubt::Frozen));
        told.velocity = Vector3::zeros();
        told.run(1000);
        assert!(told.doubt() != Some(Doubt::Frozen));
        // Nothing new comes, though the autopilot is heard.
        let last = told.now;
        for _ in 0..20 {
            told.now += ms(20);
            told.look(told.now);
        }
        assert_eq!(told.doubt(), Some(Doubt::Frozen), "{last:?}");
    }

    #[test]
    fn late_estimates_and_lost_satellites_are_doubted_as_long_as_they_are() {
        let mut told = Told::flying([0.0, 0.0, 0.0]);
        told.telemetry.position_age = Some(ms(450));
        assert_eq!(told.doubt(), Some(Doubt::Late(ms(450))));
        told.telemetry.position_age = Some(ms(40));
        told.telemetry.has_gps_fix = Some(false);
        assert_eq!(told.doubt(), Some(Doubt::GpsLost));
        told.telemetry.has_gps_fix = Some(true);
        assert_eq!(told.doubt(), None);
        // One that has never had satellites has none to lose.
        let mut indoors = Told::flying([0.0, 0.0, 0.0]);
        indoors.plausibility = Plausibility::default();
        indoors.telemetry.has_gps_fix = Some(false);
        indoors.run(1000);
        assert_eq!(indoors.doubt(), None);
    }
}
