//! Vehicles that fly their routes as points: at cruise along straight legs, no faster than they climb, and no faster up
//! to that than they brake. They tell one another ten times a second how long they have to go, and keep the pace that
//! vehicles keep ([`skein_agent::arrival`]).

use nalgebra::Vector3;
use skein_agent::{Envelope, arrival};

/// Seconds of a step.
pub const STEP_S: f64 = 0.1;
/// A vehicle is where its leg ends if it is as near, metres.
const THERE_M: f64 = 1e-6;

/// A vehicle in flight.
#[derive(Clone, Debug)]
pub struct Flyer {
    pub at: Vector3<f64>,
    speed_m_s: f64,
    /// The points ahead (ENU, metres), each with whether it is a stop.
    pub ahead: Vec<(Vector3<f64>, bool)>,
    /// The points where it was.
    pub flown: Vec<Vector3<f64>>,
    /// The stops where it was.
    pub visited: Vec<Vector3<f64>>,
    pub arrived_s: Option<f64>,
    pub is_lost: bool,
}

impl Flyer {
    /// One that is about to set out.
    pub fn new(at: Vector3<f64>) -> Self {
        Self {
            at,
            speed_m_s: 0.0,
            ahead: Vec::new(),
            flown: vec![at],
            visited: Vec::new(),
            arrived_s: None,
            is_lost: false,
        }
    }

    /// Flies these points from now on; `stops` are the numbers of those that are stops.
    pub fn send(&mut self, points: impl IntoIterator<Item = Vector3<f64>>, stops: &[usize]) {
        self.flown.push(self.at);
        let points = points.into_iter().enumerate();
        self.ahead = points.map(|(index, point)| (point, stops.contains(&index))).collect();
        self.arrived_s = None;
    }

    pub fn flies(&self) -> bool {
        !self.is_lost && self.arrived_s.is_none()
    }

    /// Where it is and will be.
    pub fn way(&self) -> Vec<Vector3<f64>> {
        std::iter::once(self.at).chain(self.ahead.iter().map(|(point, _)| *point)).collect()
    }

    /// Where it still has to be.
    pub fn stops(&self) -> Vec<Vector3<f64>> {
        self.ahead.iter().filter(|(_, is_stop)| *is_stop).map(|(point, _)| *point).collect()
    }

    fn step(&mut self, pace_m_s: f64, envelope: &Envelope, now_s: f64) {
        let most = envelope.brake_m_s2 * STEP_S;
        self.speed_m_s += (pace_m_s - self.speed_m_s).clamp(-most, most);
        let mut left_s = STEP_S;
        while let Some(&(next, is_stop)) = self.ahead.first() {
            let leg = next - self.at;
            let (length_m, climb_m) = (leg.norm(), leg.z.abs());
            // As slow as its climb needs, at the pace that is kept.
            let steep = (envelope.climb_m_s * length_m / (envelope.cruise_m_s * climb_m)).min(1.0);
            let reach_m = self.speed_m_s * if steep.is_finite() { steep } else { 1.0 } * left_s;
            if reach_m + THERE_M < length_m {
                self.at += leg * (reach_m / length_m);
                return;
            }
            left_s *= if reach_m > 0.0 { (1.0 - length_m / reach_m).max(0.0) } else { 0.0 };
            self.at = next;
            self.flown.push(next);
            if is_stop {
                self.visited.push(next);
            }
            self.ahead.remove(0);
        }
        self.arrived_s = Some(now_s);
    }
}

/// The nearest that two have been while both flew, metres.
pub fn step(flyers: &mut [Flyer], envelope: &Envelope, now_s: f64) -> f64 {
    let words: Vec<Option<f64>> =
        flyers.iter().map(|flyer| flyer.flies().then(|| arrival::to_go_s(flyer.way(), envelope))).collect();
    for (index, flyer) in flyers.iter_mut().enumerate() {
        let Some(own_s) = words[index] else { continue };
        let others = words.iter().enumerate().filter(|(other, _)| *other != index);
        let last_s = others.filter_map(|(_, word)| *word).fold(0.0, f64::max);
        flyer.step(arrival::pace_m_s(own_s, last_s, envelope), envelope, now_s);
    }
    let mut least_m = f64::INFINITY;
    for (index, one) in flyers.iter().enumerate().filter(|(_, flyer)| flyer.flies()) {
        for other in flyers[index + 1..].iter().filter(|flyer| flyer.flies()) {
            least_m = least_m.min((one.at - other.at).norm());
        }
    }
    least_m
}
