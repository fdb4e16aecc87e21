//! Patience with something that moves and stands in the way: it may leave, so the vehicle waits, but not for ever.

use std::time::Duration;

use nalgebra::Vector3;
use skein_planning::separation;

use super::course::Following;
use crate::positioning::Motion;

/// A vehicle waits this long for what moves to leave its way; then it goes around, if there is a way.
const WAITS: Duration = Duration::from_secs(10);
/// It says so after this long: who flies past it does not wait.
const SAYS_SO: Duration = Duration::from_secs(1);
/// It has got on once it is this far from where it began to wait, m: further than it is pushed to and fro.
const GETS_ON_M: f64 = 3.0;
/// What moves is in the way if the path ahead leads this near to it, beyond the distance that is kept, m ...
const NEAR_M: f64 = 0.2;
/// ... within this distance, m.
const AHEAD_M: f64 = 3.5;

/// The vehicle's wait so far, and where it waits.
#[derive(Clone, Debug)]
pub struct Patience {
    /// Centre-to-centre distance that is kept, m.
    separation_m: f64,
    since: Option<(Duration, Vector3<f64>)>,
    waits: bool,
}

impl Patience {
    /// That of a vehicle that keeps so far from what moves, m.
    pub fn new(separation_m: f64) -> Self {
        Self { separation_m, since: None, waits: false }
    }

    /// Whether it waited at the last call.
    pub fn waits(&self) -> bool {
        self.waits
    }

    pub fn forget(&mut self) {
        (self.since, self.waits) = (None, false);
    }

    /// `None` if nothing that moves keeps the vehicle from flying on along its path; else whether it has waited long
    /// enough for it. Then it begins anew.
    pub fn wait(
        &mut self,
        now: Duration,
        following: &Following,
        motion: &Motion,
        movers: &[separation::Neighbour],
    ) -> Option<bool> {
        let near_m = self.separation_m + NEAR_M;
        let is_filled = movers.iter().any(|mover| following.leads_near(&mover.position, near_m, AHEAD_M));
        let (_, place) = self.since.unwrap_or_default();
        if (motion.position - place).norm() > GETS_ON_M {
            self.since = None;
        }
        if !is_filled {
            self.waits = false;
            return None;
        }
        let (since, _) = *self.since.get_or_insert((now, motion.position));
        self.waits = now.saturating_sub(since) >= SAYS_SO;
        let is_over = now.saturating_sub(since) >= WAITS;
        if is_over {
            self.forget();
        }
        Some(is_over)
    }
}

#[cfg(test)]
mod tests {
    use skein_planning::{Path, Region};

    use super::*;
    use crate::pipeline::global::Found;

    /// When the patience of a vehicle ends in whose way something is in these tenths of a second.
    fn ends_at(is_in_the_way: impl Fn(u64) -> bool, place: impl Fn(u64) -> f64) -> Option<u64> {
        let mut patience = Patience::new(1.4);
        let path = Path::new(vec![Vector3::zeros(), Vector3::new(20.0, 0.0, 0.0)]).unwrap();
        let following = Following::new(Found { path, clearance_m: None, is_level: true }, Region::EVERYWHERE);
        (0..300).find(|tenths| {
            let mover = separation::Neighbour {
                id: 1,
                position: Vector3::new(2.0, if is_in_the_way(*tenths) { 0.5 } else { 4.0 }, 0.0),
                velocity: Vector3::zeros(),
                sigma_m: 0.1,
                age_s: 0.0,
                radius_m: 0.25,
                cooperative: false,
            };
            let motion = Motion::new(Vector3::new(place(*tenths), 0.0, 0.0), Vector3::zeros(), [0.05; 3]);
            patience.wait(Duration::from_millis(100 * tenths), &following, &motion, &[mover]) == Some(true)
        })
    }

    #[test]
    fn it_lasts_for_ten_seconds() {
        assert_eq!(ends_at(|_| true, |_| 0.0), Some(100));
    }

    #[test]
    fn what_paces_to_and_fro_is_not_waited_for_any_longer() {
        let ended = ends_at(|tenths| tenths % 30 < 20, |_| 0.0);
        assert!(ended.is_some_and(|tenths| tenths < 130), "{ended:?}");
    }

    #[test]
    fn who_gets_on_begins_anew() {
        assert_eq!(
            ends_at(|tenths| !(60..=80).contains(&tenths), |tenths| if tenths > 70 { 3.5 } else { 0.0 }),
            Some(181)
        );
    }
}
