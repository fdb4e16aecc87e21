//! Energy: whether the battery still holds the way home, or the mission at all.
//!
//! Of what is not known the worst counts: a charge that nobody tells is a reason to return, and a drain that is not
//! measured yet is the greatest that the charges told so far leave possible.

mod airflow;
mod drain;
mod way_home;

use std::sync::Arc;
use std::time::Duration;

use nalgebra::{UnitQuaternion, Vector3};
use skein_mav::{Battery, Stamped};

use self::{
    airflow::{Airflow, Wind},
    drain::Drain,
    way_home::WayHome,
};
use crate::config::{AgentConfig, Envelope};
use crate::positioning::Motion;

/// A charge that was told longer ago than this is unknown.
const TOLD_WITHIN: Duration = Duration::from_secs(10);
/// Energy kept in reserve over what a way needs.
const RESERVE: f64 = 0.15;
/// Time to brake, turn around and pick up speed, s.
const TURN_S: f64 = 10.0;
/// Autopilots land at this speed, and above this height twice as fast: m/s, m.
const LANDING_M_S: f64 = 0.5;
const LANDING_SLOWLY_BELOW_M: f64 = 10.0;
/// Slower than this over the ground a vehicle does not come home, m/s.
const LEAST_M_S: f64 = 0.1;
/// On the ground a charge that grows by more is of another battery, or of one that was charged.
const CHANGED_BY: f64 = 0.1;

/// The charge, 0 to 1, as long as it is known.
#[must_use]
pub fn known_charge(now: Duration, battery: Option<Stamped<Battery>>) -> Option<f64> {
    battery.filter(|battery| battery.age(now) <= TOLD_WITHIN).map(|battery| battery.value.fraction)
}

/// A battery that was changed on the ground: the charges before and after, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Changed {
    pub from: f64,
    pub to: f64,
}

/// One vehicle's energy.
#[derive(Debug)]
pub struct Energy {
    config: Arc<AgentConfig>,
    flight: Option<Flight>,
    /// The last charge in the air, or the least since on the ground.
    least: Option<f64>,
    /// The drain of the last flight, if it was with the battery that the vehicle has now: share per second.
    former_drain: Option<f64>,
    /// The charge with which the mission was thought over on the ground, and why it does not begin, if so.
    thought_over: Option<(f64, Option<String>)>,
}

/// The measurements of one flight.
#[derive(Debug)]
struct Flight {
    began: Duration,
    drain: Drain,
    airflow: Airflow,
    way_home: WayHome,
}

/// The cost of a way: its time, and the time in hover that takes as much energy, s.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cost {
    seconds: f64,
    effort_s: f64,
}

impl Energy {
    pub fn new(config: Arc<AgentConfig>) -> Self {
        Self { config, flight: None, least: None, former_drain: None, thought_over: None }
    }

    /// The vehicle stands on the ground at `now`, with this charge if it is known.
    pub fn rest(&mut self, now: Duration, charge: Option<f64>) -> Option<Changed> {
        if let Some(flight) = self.flight.take() {
            self.former_drain = flight.drain.worst_per_s(now);
            self.thought_over = None;
        }
        let Some(charge) = charge else {
            self.thought_over = None;
            return None;
        };
        let changed = self.note_change(charge);
        if self.thought_over.as_ref().is_none_or(|(thought_of, _)| *thought_of != charge) {
            self.thought_over = Some((charge, self.shortfall(charge)));
        }
        changed
    }

    fn note_change(&mut self, charge: f64) -> Option<Changed> {
        let least = *self.least.get_or_insert(charge);
        let is_other = charge > least + CHANGED_BY;
        self.least = Some(if is_other { charge } else { least.min(charge) });
        is_other.then(|| {
            self.former_drain = None;
            Changed { from: least, to: charge }
        })
    }

    /// The vehicle is in the air with this charge; `is_clear` tells whether the way straight from one place to another
    /// is.
    pub fn fly(
        &mut self,
        now: Duration,
        charge: Option<f64>,
        motion: &Motion,
        body_to_world: Option<&UnitQuaternion<f64>>,
        is_clear: impl Fn(&Vector3<f64>, &Vector3<f64>) -> bool,
    ) {
        let [x, y, _] = self.config.home;
        let above_home = Vector3::new(x, y, self.config.return_altitude_m);
        self.thought_over = None;
        let flight = self.flight.get_or_insert_with(|| Flight {
            began: now,
            drain: Drain::default(),
            airflow: Airflow::default(),
            way_home: WayHome::new(above_home),
        });
        if let Some(charge) = charge {
            flight.drain.take_in(now, charge);
            self.least = Some(charge);
        }
        if let Some(body_to_world) = body_to_world {
            flight.airflow.feel(now, &motion.velocity, body_to_world, &self.config.envelope);
        }
        flight.way_home.follow(now, motion.position, is_clear);
    }

    /// Why a vehicle that is `here` with this charge has to return now, if it does; metres ENU.
    #[must_use]
    pub fn reason_to_return(&self, now: Duration, charge: Option<f64>, here: Vector3<f64>) -> Option<String> {
        let flight = self.flight.as_ref()?;
        let Some(charge) = charge else {
            let was_time_to_tell = now.saturating_sub(flight.began) > TOLD_WITHIN;
            return was_time_to_tell.then(|| "battery charge unknown".to_owned());
        };
        let wind = flight.airflow.wind().unwrap_or_default();
        let calm = self.way_home(flight, here, &Wind::default());
        let windy = self.way_home(flight, here, &wind);
        let is_held =
            |cost: Option<Cost>| cost.is_some_and(|cost| charge > flight.needs(now, cost) + RESERVE);
        let wind_m_s = wind.mean.norm();
        match windy {
            _ if is_held(windy) => None,
            _ if !is_held(calm) => Some("battery low".to_owned()),
            Some(Cost { seconds, .. }) => {
                Some(format!("battery low: {seconds:.0} s home in a wind of {wind_m_s:.0} m/s"))
            }
            None => Some(format!("battery low: no way home against a wind of {wind_m_s:.0} m/s")),
        }
    }

    /// The way home from `here`, and down; `None` if the wind lets nobody through.
    fn way_home(&self, flight: &Flight, here: Vector3<f64>, wind: &Wind) -> Option<Cost> {
        let descent_m = self.config.return_altitude_m - self.config.home[2];
        let way = cost(flight.way_home.from(here), descent_m, wind, &self.config.envelope)?;
        Some(way.and(standing(TURN_S, wind, &self.config.envelope)))
    }

    /// Why the mission does not begin, of a vehicle on the ground whose battery does not hold it in still air, as far
    /// as can be told: from the drain of the last flight, or from the endurance that is configured.
    #[must_use]
    pub fn reason_to_stay(&self) -> Option<&str> {
        self.thought_over.as_ref()?.1.as_deref()
    }

    fn shortfall(&self, charge: f64) -> Option<String> {
        let AgentConfig { envelope, home, waypoints, takeoff_height_m, .. } = &*self.config;
        let endurance_s = Some(envelope.endurance_s).filter(|endurance_s| *endurance_s > 0.0);
        let drain = self.former_drain.or(endurance_s.map(f64::recip))?;
        let home = Vector3::from(*home);
        let up = home + Vector3::z() * *takeoff_height_m;
        let way = [home, up].into_iter().chain(waypoints.iter().map(|point| Vector3::from(*point)));
        let landing_m = waypoints.last().map_or(up.z, |[.., z]| *z) - home.z;
        let mission = cost(way, landing_m, &Wind::default(), envelope)?;
        let needed = drain * mission.effort_s;
        (charge < needed + RESERVE).then(|| {
            format!(
                "the mission takes {:.0} s and {:.0} % of the battery, which holds {:.0} %, {:.0} % of it in reserve: \
                 charge it, or make the mission shorter",
                mission.seconds,
                needed * 100.0,
                charge * 100.0,
                RESERVE * 100.0
            )
        })
    }
}

impl Flight {
    /// The share of the battery that a way needs, as drained so far, or more.
    fn needs(&self, now: Duration, way: Cost) -> f64 {
        let as_flown_s = way.effort_s / self.airflow.mean_effort();
        self.drain.worst_per_s(now).unwrap_or_default() * as_flown_s.max(way.seconds)
    }
}

impl Cost {
    fn and(self, more: Self) -> Self {
        Self { seconds: self.seconds + more.seconds, effort_s: self.effort_s + more.effort_s }
    }
}

/// The energy that it takes to fly from place to place, and to come down by `landing_m` in the end; `None` if the wind
/// lets nobody through.
fn cost(
    places: impl Iterator<Item = Vector3<f64>>,
    landing_m: f64,
    wind: &Wind,
    envelope: &Envelope,
) -> Option<Cost> {
    let slow_m = landing_m.clamp(0.0, LANDING_SLOWLY_BELOW_M);
    let landing_s = (slow_m + (landing_m - slow_m).max(0.0) / 2.0) / LANDING_M_S;
    let mut total = standing(landing_s, wind, envelope);
    let mut before: Option<Vector3<f64>> = None;
    for place in places {
        let leg = before.replace(place).map_or(Vector3::zeros(), |before| place - before);
        total = total.and(leg_cost(&leg, wind, envelope)?);
    }
    Some(total)
}

/// The energy that it takes to stay at a place, or to climb or sink there, for so long.
fn standing(seconds: f64, wind: &Wind, envelope: &Envelope) -> Cost {
    Cost { seconds, effort_s: seconds * envelope.effort_at(wind.mean.norm()) }
}

fn leg_cost(leg: &Vector3<f64>, wind: &Wind, envelope: &Envelope) -> Option<Cost> {
    let climb_s = leg.z.abs() / envelope.climb_m_s;
    let Some(direction) = leg.xy().try_normalize(1e-6) else {
        return Some(standing(climb_s, wind, envelope));
    };
    let speed_m_s = envelope.ground_speed_m_s(&direction, wind);
    if speed_m_s < LEAST_M_S {
        return None;
    }
    let seconds = climb_s.max(leg.xy().norm() / speed_m_s);
    let airspeed_m_s = (direction * speed_m_s - wind.mean).norm();
    Some(Cost { seconds, effort_s: seconds * envelope.effort_at(airspeed_m_s) })
}

#[cfg(feature = "zenoh")]
#[cfg(test)]
mod tests {
    use super::*;
    use crate::config_file::Config;

    const S: Duration = Duration::from_secs(1);

    /// A vehicle at the origin whose mission leads 100 m east and back, and that flies 9 m/s at most.
    fn energy(endurance_s: f64) -> Energy {
        let example = Config::example().unwrap().agent;
        let envelope =
            Envelope { cruise_m_s: 4.0, airspeed_m_s: 9.0, tilt_rad: 0.2, endurance_s, ..Envelope::DEFAULT };
        let waypoints = vec![[100.0, 0.0, 4.0], [0.0, 0.0, 4.0]];
        Energy::new(Arc::new(AgentConfig { home: [0.0; 3], waypoints, envelope, ..example }))
    }

    /// Flies for so many seconds from home east at 4 m/s, leaning for wind, with a charge that falls by `per_s`;
    /// returns the first reason to return, with the second in which there is one.
    fn flies_out(
        energy: &mut Energy,
        lean_rad: f64,
        charge: impl Fn(f64) -> Option<f64>,
    ) -> Option<(u32, String)> {
        let attitude = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), lean_rad);
        (0..200).find_map(|second| {
            let now = S * second;
            let here = Vector3::new(4.0 * f64::from(second), 0.0, 4.0);
            let motion = Motion::new(here, Vector3::new(4.0, 0.0, 0.0), [0.0; 3]);
            let charge = charge(f64::from(second));
            energy.fly(now, charge, &motion, Some(&attitude), |_, _| true);
            energy.reason_to_return(now, charge, here).map(|why| (second, why))
        })
    }

    /// A battery that lasts so long, in whole per cents.
    fn lasts(seconds: f64) -> impl Fn(f64) -> Option<f64> {
        move |at_s| Some(((1.0 - at_s / seconds) * 100.0).round() / 100.0)
    }

    /// The lean of a vehicle that flies east at 4 m/s in a westerly wind, rad.
    fn lean_rad(wind_m_s: f64) -> f64 {
        -(((wind_m_s - 4.0) / 9.0).powf(1.5) * 0.2_f64.tan()).atan()
    }

    #[test]
    fn a_vehicle_turns_while_the_battery_holds_the_way_home() {
        for seconds in [150.0, 300.0] {
            let (turns_at, why) = flies_out(&mut energy(0.0), 0.0, lasts(seconds)).unwrap();
            assert_eq!(why, "battery low");
            let home_s = f64::from(turns_at) + TURN_S + 8.0;
            let spare = (seconds - f64::from(turns_at) - home_s) / seconds;
            assert!((RESERVE..RESERVE + 0.05).contains(&spare), "of {seconds} s, {spare} to spare");
        }
    }

    #[test]
    fn a_vehicle_turns_at_once_if_the_wind_lets_nobody_home() {
        let (turns_at, why) = flies_out(&mut energy(0.0), lean_rad(9.0), lasts(300.0)).unwrap();
        assert_eq!(turns_at, 10, "as soon as the wind is known");
        assert_eq!(why, "battery low: no way home against a wind of 9 m/s");
    }

    #[test]
    fn the_wind_that_is_the_reason_is_named() {
        let (calm_s, calm) = flies_out(&mut energy(0.0), 0.0, lasts(300.0)).unwrap();
        let (windy_s, windy) = flies_out(&mut energy(0.0), lean_rad(7.0), lasts(300.0)).unwrap();
        assert_eq!(calm, "battery low");
        assert!(windy.contains("s home in a wind of 7 m/s"), "{windy}");
        assert!(windy_s < calm_s * 2 / 3, "{windy_s} s with wind, {calm_s} s without");
    }

    #[test]
    fn a_charge_that_nobody_tells_is_a_reason_to_return_after_ten_seconds() {
        let (after_s, why) = flies_out(&mut energy(0.0), 0.0, |_| None).unwrap();
        assert_eq!((after_s, why.as_str()), (11, "battery charge unknown"));
        let told = Some(Stamped { stamp: S, value: Battery { fraction: 0.7, voltage_v: 15.0 } });
        assert_eq!(known_charge(11 * S, told), Some(0.7));
        assert_eq!(known_charge(12 * S, told), None);
        assert_eq!(known_charge(S, None), None);
    }

    #[test]
    fn a_mission_that_the_battery_does_not_hold_is_not_begun() {
        // 200 m at 4 m/s, the climb, and the descent: 60 s.
        let stays = |endurance_s: f64, charge: f64| {
            let mut energy = energy(endurance_s);
            energy.rest(S, Some(charge));
            energy.reason_to_stay().map(str::to_owned)
        };
        assert_eq!(stays(0.0, 0.3), None, "nothing is known of the drain");
        assert_eq!(stays(300.0, 0.9), None);
        let why = stays(80.0, 0.85).unwrap();
        assert!(why.contains("takes 60 s") && why.contains("holds 85 %") && why.contains("shorter"), "{why}");
        assert!(stays(300.0, 0.3).is_some());
    }

    #[test]
    fn what_the_last_flight_drained_tells_until_the_battery_is_changed() {
        let mut energy = energy(0.0);
        let charge = lasts(100.0);
        let (turns_at, _) = flies_out(&mut energy, 0.0, &charge).unwrap();
        let left = charge(f64::from(turns_at)).unwrap();
        assert_eq!(energy.rest(turns_at * S, Some(left)), None);
        assert!(energy.reason_to_stay().is_some());
        // At rest a battery recovers a little.
        assert_eq!(energy.rest(40 * S, Some(left + 0.04)), None);
        assert_eq!(energy.rest(50 * S, Some(1.0)), Some(Changed { from: left, to: 1.0 }));
        assert_eq!(energy.reason_to_stay(), None);
        assert_eq!(energy.rest(51 * S, Some(1.0)), None);
    }
}
