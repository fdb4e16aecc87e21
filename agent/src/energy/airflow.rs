//! Airflow: the wind, as a multirotor feels it. To stand or fly in moving air it leans, and the more so the faster
//! the air goes by.

use std::time::Duration;

use nalgebra::{UnitQuaternion, Vector2, Vector3};

use crate::config::Envelope;

const GRAVITY_M_S2: f64 = 9.81;
/// Lean and velocity are smoothed over this time.
const SMOOTHED_OVER: Duration = Duration::from_secs(5);
/// The wind is the mean of what is felt over this time, and known after some of it.
const MEAN_OVER: Duration = Duration::from_secs(30);
const KNOWN_AFTER: Duration = Duration::from_secs(10);
/// A vehicle that lies on its side tells nothing: the least upward part of its axis.
const LEAST_UPRIGHT: f64 = 0.2;
/// Drag grows with this power of the speed through the air: between that of rotors, 1, and of hulls, 2.
const DRAG_POWER: f64 = 1.5;
/// A way is flown at this share of the top airspeed: who leans as far as it may has nothing left to steer with.
const USABLE: f64 = 0.95;
/// And less by this share of the gusts' deviation: the mean of the way home may be stronger than that of the way out.
const OF_GUSTS: f64 = 0.5;
/// A rotor's power grows with this power of its thrust (momentum theory, in hover).
const POWER_OF_THRUST: f64 = 1.5;

/// The wind, m/s ENU, and the standard deviation of its gusts of some seconds, m/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wind {
    pub mean: Vector2<f64>,
    pub gust_m_s: f64,
}

/// The air as one vehicle has felt it in this flight.
#[derive(Clone, Copy, Debug, Default)]
pub struct Airflow {
    felt: Option<Felt>,
}

#[derive(Clone, Copy, Debug)]
struct Felt {
    since: Duration,
    last: Duration,
    /// Over the ground, m/s, ENU: the newest, and smoothed.
    newest: Vector2<f64>,
    velocity: Vector2<f64>,
    /// The horizontal part of the thrust per mass, m/s², smoothed.
    lean: Vector2<f64>,
    /// The mean of the wind and of its square, once both are smooth.
    wind: Option<(Vector2<f64>, f64)>,
    /// The power in units of that in hover, summed over time, s.
    effort_s: f64,
}

impl Airflow {
    /// Takes in the velocity over the ground, m/s ENU, and the attitude of a vehicle of this envelope in the air.
    pub fn feel(
        &mut self,
        now: Duration,
        velocity: &Vector3<f64>,
        body_to_world: &UnitQuaternion<f64>,
        envelope: &Envelope,
    ) {
        let up = body_to_world * Vector3::z();
        if up.z < LEAST_UPRIGHT {
            return;
        }
        let (newest, lean) = (velocity.xy(), up.xy() * (GRAVITY_M_S2 / up.z));
        let first = Felt { since: now, last: now, newest, velocity: newest, lean, wind: None, effort_s: 0.0 };
        let felt = self.felt.get_or_insert(first);
        let passed = now.saturating_sub(felt.last);
        felt.effort_s += passed.as_secs_f64() * up.z.recip().powf(POWER_OF_THRUST);
        let share = share_of(passed, SMOOTHED_OVER);
        felt.last = now;
        felt.newest = newest;
        felt.velocity += (newest - felt.velocity) * share;
        felt.lean += (lean - felt.lean) * share;
        felt.average(passed, envelope);
    }

    /// The wind, once it has been felt for long enough.
    pub fn wind(&self) -> Option<Wind> {
        let (mean, square) = self.felt.filter(|felt| felt.lasted() >= KNOWN_AFTER)?.wind?;
        Some(Wind { mean, gust_m_s: (square - mean.norm_squared()).max(0.0).sqrt() })
    }

    /// The mean power of this flight in units of that in hover.
    pub fn mean_effort(&self) -> f64 {
        let mean = |felt: Felt| felt.effort_s / felt.lasted().as_secs_f64();
        self.felt.map(mean).filter(|effort| effort.is_finite()).unwrap_or(1.0)
    }
}

impl Felt {
    fn lasted(&self) -> Duration {
        self.last.saturating_sub(self.since)
    }

    /// The wind of the last seconds, m/s ENU.
    fn recent_wind(&self, envelope: &Envelope) -> Vector2<f64> {
        // What the thrust does not explain of the acceleration, the air does.
        let acceleration = (self.newest - self.velocity) / SMOOTHED_OVER.as_secs_f64();
        let push = acceleration - self.lean;
        let pushed = push.try_normalize(1e-9).unwrap_or_default();
        self.velocity + pushed * envelope.airspeed_of_drag(push.norm())
    }

    fn average(&mut self, passed: Duration, envelope: &Envelope) {
        if self.lasted() < SMOOTHED_OVER {
            return;
        }
        let recent = self.recent_wind(envelope);
        let (mean, square) = self.wind.get_or_insert((recent, recent.norm_squared()));
        let share = share_of(passed, MEAN_OVER.min(self.last.saturating_sub(self.since + SMOOTHED_OVER)));
        *mean += (recent - *mean) * share;
        *square += (recent.norm_squared() - *square) * share;
    }
}

/// The share of a new value in a mean over some time, after so much more of it.
fn share_of(passed: Duration, over: Duration) -> f64 {
    1.0 - (-passed.as_secs_f64() / over.as_secs_f64().max(1e-3)).exp()
}

impl Envelope {
    /// The drag per mass at top speed through the air, m/s².
    fn top_drag_m_s2(&self) -> f64 {
        GRAVITY_M_S2 * self.tilt_rad.tan()
    }

    /// The speed through the air at which the drag per mass is this much, m/s.
    fn airspeed_of_drag(&self, drag_m_s2: f64) -> f64 {
        self.airspeed_m_s * (drag_m_s2 / self.top_drag_m_s2()).powf(DRAG_POWER.recip())
    }

    /// The power at this speed through the air, in units of that in hover.
    pub fn effort_at(&self, airspeed_m_s: f64) -> f64 {
        let drag_m_s2 = self.top_drag_m_s2() * (airspeed_m_s / self.airspeed_m_s).powf(DRAG_POWER);
        (drag_m_s2 / GRAVITY_M_S2).hypot(1.0).powf(POWER_OF_THRUST)
    }

    /// The speed over the ground in a horizontal direction (of length 1) in this wind, m/s: at most the cruise speed;
    /// 0 or less if the wind is too strong.
    pub fn ground_speed_m_s(&self, direction: &Vector2<f64>, wind: &Wind) -> f64 {
        let usable_m_s = (USABLE * self.airspeed_m_s - OF_GUSTS * wind.gust_m_s).max(0.0);
        let across_m_s = wind.mean.perp(direction);
        let left = usable_m_s.powi(2) - across_m_s.powi(2);
        if left < 0.0 { 0.0 } else { (wind.mean.dot(direction) + left.sqrt()).min(self.cruise_m_s) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ENVELOPE: Envelope =
        Envelope { cruise_m_s: 4.0, airspeed_m_s: 9.0, tilt_rad: 0.2, ..Envelope::DEFAULT };
    const TICK: Duration = Duration::from_millis(20);

    /// The acceleration that a wind gives a vehicle whose drag per mass is `linear` and `quadratic` in its airspeed,
    /// and whose velocity follows `course` over 60 s.
    fn felt(wind: Vector2<f64>, [linear, quadratic]: [f64; 2], course: fn(f64) -> Vector2<f64>) -> Airflow {
        let mut airflow = Airflow::default();
        for tick in 0..3000 {
            let at_s = f64::from(tick) * 0.02;
            let velocity = course(at_s);
            let acceleration = (course(at_s + 0.01) - course(at_s - 0.01)) / 0.02;
            let flow = wind - velocity;
            let thrust = acceleration - flow * (linear + quadratic * flow.norm());
            let up = Vector3::new(thrust.x, thrust.y, GRAVITY_M_S2);
            let attitude = UnitQuaternion::rotation_between(&Vector3::z(), &up).unwrap();
            airflow.feel(TICK * tick, &velocity.push(0.0), &attitude, &ENVELOPE);
        }
        airflow
    }

    /// Drags of vehicles that fly 9 m/s at a tilt of 0.2: of rotors alone, mixed, and of a hull alone.
    fn drags() -> [[f64; 2]; 3] {
        let top = ENVELOPE.top_drag_m_s2();
        [[top / 9.0, 0.0], [top / 18.0, top / 162.0], [0.0, top / 81.0]]
    }

    #[test]
    fn wind_is_felt_in_hover_in_flight_and_in_turns() {
        let courses: [fn(f64) -> Vector2<f64>; 3] = [
            |_| Vector2::zeros(),
            |_| Vector2::new(4.0, 0.0),
            |at_s| Vector2::new((at_s / 3.0).cos(), (at_s / 3.0).sin()) * 3.0,
        ];
        for wind in [Vector2::new(7.0, 0.0), Vector2::new(-3.0, 5.0), Vector2::new(0.0, 8.5)] {
            for (drag, within_m_s) in drags().into_iter().zip([1.6, 0.5, 1.3]) {
                for course in courses {
                    let found = felt(wind, drag, course).wind().unwrap().mean;
                    assert!((found - wind).norm() < within_m_s, "{wind:?} with {drag:?}: {found:?}");
                }
            }
        }
    }

    #[test]
    fn nothing_is_known_before_it_has_been_felt_for_ten_seconds() {
        let mut airflow = Airflow::default();
        for at in 0..10 {
            airflow.feel(Duration::from_secs(at), &Vector3::zeros(), &UnitQuaternion::identity(), &ENVELOPE);
            assert_eq!(airflow.wind(), None);
        }
        airflow.feel(Duration::from_secs(10), &Vector3::zeros(), &UnitQuaternion::identity(), &ENVELOPE);
        assert_eq!(airflow.wind(), Some(Wind::default()));
    }

    #[test]
    fn leaning_takes_power() {
        let hover = felt(Vector2::zeros(), [0.1, 0.0], |_| Vector2::zeros());
        assert!((hover.mean_effort() - 1.0).abs() < 1e-9);
        let top = felt(Vector2::new(9.0, 0.0), drags()[1], |_| Vector2::zeros());
        assert!((top.mean_effort() - 0.2_f64.cos().powf(-1.5)).abs() < 1e-3, "{}", top.mean_effort());
        assert!((ENVELOPE.effort_at(9.0) - top.mean_effort()).abs() < 1e-3);
        assert_eq!(Airflow::default().mean_effort(), 1.0);
    }

    #[test]
    fn the_ground_speed_is_what_the_wind_leaves() {
        let gusty = |gust_m_s: f64, wind: [f64; 2]| {
            ENVELOPE.ground_speed_m_s(&-Vector2::x(), &Wind { mean: wind.into(), gust_m_s })
        };
        let speed = |wind: [f64; 2]| gusty(0.0, wind);
        assert!((speed([7.0, 0.0]) - gusty(1.0, [7.0, 0.0]) - 0.5).abs() < 1e-9);
        assert_eq!(speed([0.0, 0.0]), 4.0);
        assert!((speed([7.0, 0.0]) - (8.55 - 7.0)).abs() < 1e-9);
        assert_eq!(speed([-7.0, 0.0]), 4.0);
        assert!(
            (speed([5.0, 5.0]) - ((8.55_f64.powi(2) - 25.0).sqrt() - 5.0)).abs() < 1e-9,
            "across it as well"
        );
        assert!(speed([9.5, 0.0]) < 0.0 && speed([0.0, 9.5]) <= 0.0);
    }
}
