//! Where the vehicle stands: on its own pad and on nobody else's, per axis and in height, and inside its
//! fence.

use std::collections::BTreeMap;
use std::time::Duration;

use nalgebra::Vector3;
use skein_dbp::NodeName;
use skein_wire::{Check, Readiness};

use super::check::{fails, passes, waits};
use crate::config::{Envelope, Fence};
use crate::neighbours::Neighbour;
use crate::positioning::Motion;

/// Nearer than this to its pad a vehicle stands on it, m, if its position is that good.
const ON_THE_PAD_M: f64 = 1.0;
/// So many standard deviations may a position be off.
const SIGMAS: f64 = 3.0;
/// The word of others counts for so long, s.
const HEARD_WITHIN: Duration = Duration::from_secs(5);

/// Pads and data of the others by their word, and when they said it last.
pub type Others = BTreeMap<NodeName, (Duration, Readiness)>;

/// Where a vehicle stands, and who else does. World ENU, metres.
#[derive(Clone, Copy, Debug)]
pub struct Pad<'a> {
    pub now: Duration,
    pub motion: &'a Motion,
    /// Its home by its configuration.
    pub home: Vector3<f64>,
    /// Where it landed last, if it has flown in this life of the agent: it may take off from there too.
    pub landed_at: Option<Vector3<f64>>,
    pub fence: &'a Fence,
    pub envelope: &'a Envelope,
    pub neighbours: &'a [Neighbour],
    pub others: &'a Others,
}

impl Pad<'_> {
    /// The vehicle stands on its pad, or where it landed last.
    pub fn home(&self) -> Check {
        let stood = self.landed_at.filter(|place| self.is_at(place));
        match stood {
            Some(_) if !self.is_at(&self.home) => passes("home", "stands where it landed"),
            _ if self.is_at(&self.home) && self.other_pad().is_none() => passes("home", "stands on its pad"),
            _ => fails("home", self.fault(), self.remedy()),
        }
    }

    fn fault(&self) -> String {
        let offset = self.motion.position - self.home;
        let pad = self.other_pad().map_or_else(String::new, |node| format!(", on the pad of {node}"));
        format!("stands {} its home{pad}", offset_words(&offset, &self.tolerance()))
    }

    fn remedy(&self) -> &'static str {
        let [x, y, z] = self.off();
        match (x || y, z) {
            (false, true) => "check `datum.height_m`, and the height that the autopilot tells",
            _ if self.landed_at.is_some() => "carry it to its pad, or let it find its position again",
            _ => "carry it to its pad, or check `mission.home`, `datum` and `autopilot.system_id`",
        }
    }

    fn tolerance(&self) -> Vector3<f64> {
        let sigma = |axis| self.motion.covariance[(axis, axis)].sqrt();
        Vector3::from_fn(|axis, _| ON_THE_PAD_M.max(SIGMAS * sigma(axis)))
    }

    fn off(&self) -> [bool; 3] {
        let (offset, tolerance) = (self.motion.position - self.home, self.tolerance());
        [0, 1, 2].map(|axis| offset[axis].abs() > tolerance[axis])
    }

    fn is_at(&self, place: &Vector3<f64>) -> bool {
        let (offset, tolerance) = (self.motion.position - place, self.tolerance());
        (0..3).all(|axis| offset[axis].abs() <= tolerance[axis])
    }

    fn heard(&self) -> impl Iterator<Item = (&NodeName, &Readiness)> {
        let is_recent = |at: Duration| self.now.saturating_sub(at) <= HEARD_WITHIN;
        self.others.iter().filter(move |(_, (at, _))| is_recent(*at)).map(|(node, (_, said))| (node, said))
    }

    /// The vehicle on whose pad this one stands, if that is nearer than its own.
    fn other_pad(&self) -> Option<&NodeName> {
        let away_m = |pad: Vector3<f64>| (self.motion.position - pad).xy().norm();
        let nearest = self.heard().map(|(node, said)| (away_m(said.home.into()), node));
        let (distance_m, node) = nearest.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let tolerance = self.tolerance();
        (distance_m < away_m(self.home) && distance_m <= tolerance.x.max(tolerance.y)).then_some(node)
    }

    /// Nobody else says that it stands here.
    pub fn pad(&self) -> Check {
        let apart_m = |neighbour: &Neighbour| (neighbour.position() - self.motion.position).xy().norm();
        let is_here = |neighbour: &&Neighbour| {
            neighbour.track.age_s <= HEARD_WITHIN.as_secs_f64()
                && apart_m(neighbour) < self.envelope.hull_m + neighbour.track.radius_m
        };
        match self.neighbours.iter().find(is_here) {
            None => passes("pad", "nobody else stands here"),
            Some(other) => fails(
                "pad",
                format!("{} says that it is here too, {:.1} m away", other.node, apart_m(other)),
                "one of both does not know where it is: compare what their autopilots tell",
            ),
        }
    }

    /// The vehicle stands inside its fence.
    pub fn fence(&self) -> Check {
        let (Fence { min, max }, tolerance) = (self.fence, self.tolerance());
        let position = &self.motion.position;
        let inside = |axis: usize| {
            position[axis] >= min[axis] - tolerance[axis] && position[axis] <= max[axis] + tolerance[axis]
        };
        match (0..3).all(inside) {
            true => passes("fence", "stands inside"),
            false => fails(
                "fence",
                format!("stands outside, at ({:.1}, {:.1}, {:.1})", position.x, position.y, position.z),
                "carry it inside, or widen `fence`",
            ),
        }
    }

    /// All have the same idea of where the world's origin lies.
    pub fn datum(&self, mine: [f64; 3]) -> Check {
        let differs = |other: &[f64; 3]| {
            let [latitude, longitude, height] = [0, 1, 2].map(|i| (mine[i] - other[i]).abs());
            // A hand's breadth.
            latitude > 1e-6 || longitude > 1e-6 || height > 0.1
        };
        let words =
            |[latitude, longitude, height]: [f64; 3]| format!("{latitude:.6}, {longitude:.6}, {height:.1} m");
        match self.heard().find(|(_, said)| differs(&said.datum)) {
            None => passes("datum", words(mine)),
            Some((node, said)) => fails(
                "datum",
                format!("{}, that of {node} {}", words(mine), words(said.datum)),
                "give every vehicle the same `datum`",
            ),
        }
    }
}

/// The check of a vehicle that does not know yet where it is.
pub fn unknown() -> Check {
    waits("home", "no position yet", "see `position`")
}

/// `12 m east and 3 m north of`, `10 m above`: the axes that are off.
fn offset_words(offset: &Vector3<f64>, tolerance: &Vector3<f64>) -> String {
    let off = |axis: usize| offset[axis].abs() > tolerance[axis];
    let words = [["east", "west"], ["north", "south"]];
    let aside: Vec<_> = (0..2)
        .filter(|axis| off(*axis))
        .map(|axis| format!("{:.0} m {}", offset[axis].abs(), words[axis][usize::from(offset[axis] < 0.0)]))
        .collect();
    let height =
        off(2).then(|| format!("{:.0} m {}", offset.z.abs(), if offset.z > 0.0 { "above" } else { "below" }));
    match (aside.is_empty(), height) {
        (true, Some(height)) => height,
        (true, None) => format!("{:.1} m from", offset.norm()),
        (false, None) => format!("{} of", aside.join(" and ")),
        (false, Some(height)) => format!("{} of, and {height},", aside.join(" and ")),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A test fails by panicking.
mod tests {
    use skein_planning::separation::Neighbour as Track;
    use skein_wire::CheckState;
    use skein_wire::event::Right;

    use super::*;

    const NOW: Duration = Duration::from_secs(100);
    const DATUM: [f64; 3] = [47.397742, 8.545594, 488.0];
    const FENCE: Fence = Fence { min: [-20.0, -20.0, 0.0], max: [20.0, 20.0, 12.0] };

    /// A vehicle whose home is the origin, and which stands at `place`, good to `sigma_m`.
    struct Stand {
        motion: Motion,
        landed_at: Option<Vector3<f64>>,
        neighbours: Vec<Neighbour>,
        others: Others,
        envelope: Envelope,
    }

    impl Stand {
        fn at(place: [f64; 3], sigma_m: f64) -> Self {
            Self {
                motion: Motion::new(place.into(), Vector3::zeros(), [sigma_m, sigma_m, 0.1]),
                landed_at: None,
                neighbours: Vec::new(),
                others: Others::new(),
                envelope: Envelope::default(),
            }
        }

        /// Vehicle 2 said so many seconds ago that this is its home, and this its datum.
        fn beside(mut self, home: [f64; 3], datum: [f64; 3], ago_s: u64) -> Self {
            let node = NodeName::new("uav/2").unwrap();
            let said = Readiness {
                node: node.clone(),
                incarnation: 1,
                home,
                datum,
                checks: Vec::new(),
                mission: Vec::new(),
            };
            self.others.insert(node, (NOW - Duration::from_secs(ago_s), said));
            self
        }

        /// Vehicle 2 said so many seconds ago that it is there.
        fn hears_of_one_at(mut self, position: [f64; 3], age_s: f64) -> Self {
            let track = Track {
                id: 0,
                position: position.into(),
                velocity: Vector3::zeros(),
                sigma_m: 0.05,
                age_s,
                radius_m: 0.25,
                cooperative: true,
            };
            self.neighbours.push(Neighbour {
                node: NodeName::new("uav/2").unwrap(),
                armed: false,
                goal: None,
                track,
                way: None,
                right: Right::Free,
                to_go_s: None,
            });
            self
        }

        fn pad(&self) -> Pad<'_> {
            Pad {
                now: NOW,
                motion: &self.motion,
                home: Vector3::zeros(),
                landed_at: self.landed_at,
                fence: &FENCE,
                envelope: &self.envelope,
                neighbours: &self.neighbours,
                others: &self.others,
            }
        }

        fn fault(&self) -> Option<String> {
            let check = self.pad().home();
            (check.state == CheckState::Fails).then_some(check.value)
        }
    }

    #[test]
    fn a_vehicle_off_its_pad_says_by_how_much_and_to_which_side() {
        for (place, sigma_m, fault) in [
            ([0.0, 0.0, 0.0], 0.05, None),
            ([0.99, -0.99, 0.99], 0.05, None),
            ([12.0, 0.5, 0.0], 0.05, Some("stands 12 m east of its home")),
            ([-12.0, 3.0, 0.0], 0.05, Some("stands 12 m west and 3 m north of its home")),
            ([0.0, -4.0, 2.0], 0.05, Some("stands 4 m south of, and 2 m above, its home")),
            ([0.0, 0.0, 10.0], 0.05, Some("stands 10 m above its home")),
            ([0.0, 0.0, -10.0], 0.05, Some("stands 10 m below its home")),
            // Three standard deviations are allowed.
            ([2.9, -2.9, 2.9], 1.0, None),
            ([3.1, 0.0, 0.0], 1.0, Some("stands 3 m east of its home")),
            ([f64::NAN, 0.0, 0.0], 1.0, Some("stands NaN m from its home")),
        ] {
            assert_eq!(Stand::at(place, sigma_m).fault().as_deref(), fault, "{place:?}");
        }
    }

    #[test]
    fn a_height_that_alone_is_off_points_to_the_datum() {
        let advice = |place| Stand::at(place, 0.05).pad().home().advice;
        assert!(advice([0.0, 0.0, 10.0]).contains("`datum.height_m`"));
        assert!(advice([12.0, 0.0, 0.0]).contains("`mission.home`"));
    }

    #[test]
    fn on_the_pad_of_another_it_says_whose() {
        let stand = Stand::at([12.0, 0.0, 0.0], 0.05).beside([12.0, 0.2, 0.0], DATUM, 1);
        assert_eq!(stand.fault().as_deref(), Some("stands 12 m east of its home, on the pad of uav/2"));
        // However uncertain it is where it stands.
        let stand = Stand::at([1.5, 0.0, 0.0], 1.0).beside([2.0, 0.0, 0.0], DATUM, 1);
        assert!(stand.fault().is_some_and(|fault| fault.ends_with("on the pad of uav/2")));
        let stand = Stand::at([0.9, 0.0, 0.0], 1.0).beside([2.0, 0.0, 0.0], DATUM, 1);
        assert_eq!(stand.fault(), None, "it is nearer to its own");
        assert_eq!(Stand::at([1.5, 0.0, 0.0], 1.0).beside([2.0, 0.0, 0.0], DATUM, 9).fault(), None);
    }

    #[test]
    fn it_may_take_off_again_from_where_it_landed_but_not_from_elsewhere() {
        let mut stand = Stand::at([15.0, 3.0, 0.0], 0.05);
        assert!(stand.fault().is_some());
        stand.landed_at = Some(Vector3::new(15.2, 2.8, 0.1));
        assert_eq!(stand.fault(), None);
        stand.landed_at = Some(Vector3::new(10.0, 3.0, 0.1));
        assert_eq!(stand.fault().as_deref(), Some("stands 15 m east and 3 m north of its home"));
    }

    #[test]
    fn nobody_else_may_say_that_it_stands_there() {
        let state = |stand: Stand| stand.pad().pad().state;
        let here = || Stand::at([0.0, 0.0, 0.0], 0.05);
        assert_eq!(state(here().hears_of_one_at([0.3, 0.0, 0.0], 0.1)), CheckState::Fails);
        assert_eq!(state(here().hears_of_one_at([0.6, 0.0, 0.0], 0.1)), CheckState::Passes);
        assert_eq!(state(here().hears_of_one_at([0.3, 0.0, 0.0], 9.0)), CheckState::Passes, "long ago");
    }

    #[test]
    fn it_stands_inside_its_fence() {
        let state = |place| Stand::at(place, 0.05).pad().fence().state;
        assert_eq!(state([19.0, 0.0, -0.2]), CheckState::Passes);
        assert_eq!(state([21.5, 0.0, 0.0]), CheckState::Fails);
        assert_eq!(state([0.0, 0.0, -2.0]), CheckState::Fails);
        assert_eq!(state([f64::NAN, 0.0, 0.0]), CheckState::Fails);
    }

    #[test]
    fn all_have_the_same_datum() {
        let [latitude, longitude, height] = DATUM;
        let datum = |datum, ago_s| {
            Stand::at([0.0; 3], 0.05).beside([9.0, 0.0, 0.0], datum, ago_s).pad().datum(DATUM).state
        };
        assert_eq!(datum(DATUM, 1), CheckState::Passes);
        for other in [
            [latitude + 1e-5, longitude, height],
            [latitude, longitude - 1e-5, height],
            [latitude, longitude, height - 10.0],
        ] {
            assert_eq!(datum(other, 1), CheckState::Fails, "{other:?}");
            assert_eq!(datum(other, 9), CheckState::Passes, "it has said nothing for long");
        }
    }
}
