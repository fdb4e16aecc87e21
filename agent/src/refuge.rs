//! Refuge: where a return would end, home or the nearest rally point, each point for one vehicle.

use nalgebra::Vector3;
use skein_dbp::NodeName;

use crate::neighbours::Neighbour;
use crate::report::Report;

/// Home and a point take turns no sooner than this, m.
const NEARER_M: f64 = 2.0;
/// A vehicle whose way ends, or that stands, so near to a point has it, m.
const HAS_M: f64 = 2.0;

/// The places where a vehicle may land when it returns.
#[derive(Debug)]
pub struct Refuge {
    /// World ENU, m: home, then the rally points.
    places: Vec<Vector3<f64>>,
    told: usize,
    /// The place that was told is a place no more.
    is_gone: bool,
}

impl Refuge {
    /// Home at the height of the way there, and rally points with theirs, which is no lower; world ENU, m.
    pub fn new(home: [f64; 3], rally: &[[f64; 3]]) -> Self {
        let mut refuge = Self { places: vec![home.into()], told: 0, is_gone: false };
        refuge.set_rally(rally.iter().copied());
        refuge
    }

    /// These are the rally points from now on.
    pub fn set_rally(&mut self, rally: impl IntoIterator<Item = [f64; 3]>) {
        let (home, told) = (self.places[0], self.places[self.told]);
        let at_height = |[x, y, z]: [f64; 3]| Vector3::new(x, y, z.max(home.z));
        self.places = std::iter::once(home).chain(rally.into_iter().map(at_height)).collect();
        let stays = self.places.iter().position(|place| *place == told);
        self.told = stays.unwrap_or(0);
        self.is_gone |= stays.is_none();
    }

    /// Looks which place is nearest and not another's; says when that has changed. Who is on the way to one
    /// stays with it, unless another vehicle takes it.
    pub fn look(
        &mut self,
        me: &NodeName,
        position: &Vector3<f64>,
        neighbours: &[Neighbour],
        is_on_the_way: bool,
    ) -> Option<Report> {
        if std::mem::take(&mut self.is_gone) {
            return Some(Report::Refuge(self.places[0]));
        }
        let stays = is_on_the_way && !neighbours.iter().any(|other| self.takes(me, other, self.told));
        if self.places.len() < 2 || stays {
            return None;
        }
        let nearest = self.nearest(me, position, neighbours);
        let changed = nearest != std::mem::replace(&mut self.told, nearest);
        self.places.get(nearest).filter(|_| changed).map(|place| Report::Refuge(*place))
    }

    /// Whoever is nearest to a point has it; of those that are left the next nearest has another, and so on.
    /// All vehicles come to the same, as they know of one another.
    fn nearest(&self, me: &NodeName, position: &Vector3<f64>, neighbours: &[Neighbour]) -> usize {
        let away_m = |place: usize, from: &Vector3<f64>| (self.places[place] - from).xy().norm();
        // Home is this vehicle's own, so that nobody else need know which of the two it prefers.
        let home_m = away_m(0, position) - if self.told == 0 { NEARER_M } else { 0.0 };
        let is_had = |place: &usize| neighbours.iter().any(|other| self.takes(me, other, *place));
        let mut free: Vec<usize> = (1..self.places.len()).filter(|place| !is_had(place)).collect();
        let settled = |other: &&Neighbour| (1..self.places.len()).any(|place| self.has(other, place));
        let looking = neighbours.iter().filter(|other| other.armed && other.track.cooperative);
        let mut others: Vec<_> = looking.filter(|other| !settled(other)).collect();
        loop {
            let own = free.iter().map(|place| (away_m(*place, position), me, *place));
            let pairs = others.iter().flat_map(|other| {
                let there = other.position();
                free.iter().map(move |place| ((self.places[*place] - there).xy().norm(), &other.node, *place))
            });
            let first = own.chain(pairs).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(b.1)));
            match first {
                None => return 0,
                Some((away, who, place)) if who == me => {
                    return if home_m <= away { 0 } else { place };
                }
                Some((_, who, place)) => {
                    free.retain(|other| *other != place);
                    others.retain(|other| other.node != *who);
                }
            }
        }
    }

    /// Whether another vehicle has a place that this one cannot have any more: of two on their way, the first
    /// by name has it.
    fn takes(&self, me: &NodeName, other: &Neighbour, place: usize) -> bool {
        let is_down = !other.armed;
        place > 0 && self.has(other, place) && (is_down || place != self.told || other.node < *me)
    }

    /// Whether another vehicle stands at a place, or is on its way there.
    fn has(&self, other: &Neighbour, place: usize) -> bool {
        let is_near = |at: &Vector3<f64>| (self.places[place] - at).xy().norm() < HAS_M;
        other.goal.as_ref().is_some_and(is_near) || other.stands() && is_near(&other.position())
    }
}

#[cfg(test)]
mod tests {
    use skein_planning::separation::Neighbour as Track;
    use skein_wire::event::Right;

    use super::*;

    fn name(text: &str) -> NodeName {
        NodeName::new(text).unwrap()
    }

    fn other(node: &str, position: [f64; 3], goal: Option<[f64; 3]>) -> Neighbour {
        let track = Track {
            id: 0,
            position: position.into(),
            velocity: Vector3::x(),
            sigma_m: 0.05,
            age_s: 0.0,
            radius_m: 0.25,
            cooperative: true,
        };
        let goal = goal.map(Vector3::from);
        Neighbour { node: name(node), armed: true, goal, track, way: None, right: Right::Free, to_go_s: None }
    }

    /// Home is at the origin; points are 40 and 60 m east of it.
    fn refuge(from: [f64; 3], neighbours: &[Neighbour]) -> usize {
        let refuge = Refuge::new([0.0, 0.0, 4.0], &[[40.0, 0.0, 5.0], [60.0, 0.0, 5.0]]);
        refuge.nearest(&name("uav/2"), &from.into(), neighbours)
    }

    #[test]
    fn the_nearest_of_home_and_the_rally_points_is_returned_to() {
        assert_eq!(refuge([65.0, 0.0, 3.0], &[]), 2);
        assert_eq!(refuge([45.0, 5.0, 3.0], &[]), 1);
        assert_eq!(refuge([15.0, 0.0, 3.0], &[]), 0);
    }

    #[test]
    fn each_point_is_for_one_vehicle() {
        let nearer = other("uav/3", [61.0, 1.0, 3.0], None);
        assert_eq!(refuge([65.0, 0.0, 3.0], std::slice::from_ref(&nearer)), 1);
        let both = [nearer, other("uav/4", [42.0, 1.0, 3.0], None)];
        assert_eq!(refuge([65.0, 0.0, 3.0], &both), 0, "home is its own");
        let on_its_way = other("uav/3", [0.0, 30.0, 3.0], Some([60.0, 0.0, 5.0]));
        assert_eq!(refuge([65.0, 0.0, 3.0], &[on_its_way]), 1, "who goes there has it");
        let twin = other("uav/1", [65.0, 0.0, 3.0], None);
        assert_eq!(refuge([65.0, 0.0, 3.0], &[twin]), 1, "of two as near, the first by name has it");
    }

    #[test]
    fn a_change_is_told_once_and_not_back_and_forth() {
        let mut refuge = Refuge::new([0.0, 0.0, 4.0], &[[40.0, 0.0, 5.0]]);
        let mut look = |x| refuge.look(&name("uav/2"), &Vector3::new(x, 0.0, 3.0), &[], false);
        assert_eq!([look(10.0), look(20.4)], [None, None]);
        assert_eq!(look(25.0), Some(Report::Refuge(Vector3::new(40.0, 0.0, 5.0))));
        assert_eq!([look(25.0), look(20.6)], [None, None]);
        assert_eq!(look(19.0), Some(Report::Refuge(Vector3::new(0.0, 0.0, 4.0))));
    }

    #[test]
    fn a_rally_point_that_is_removed_is_returned_to_no_more_and_one_that_is_added_is() {
        let mut refuge = Refuge::new([0.0, 0.0, 4.0], &[[40.0, 0.0, 5.0]]);
        let look =
            |refuge: &mut Refuge| refuge.look(&name("uav/2"), &Vector3::new(38.0, 0.0, 3.0), &[], true);
        let to = |x, z| Some(Report::Refuge(Vector3::new(x, 0.0, z)));
        assert_eq!(refuge.look(&name("uav/2"), &Vector3::new(38.0, 0.0, 3.0), &[], false), to(40.0, 5.0));
        refuge.set_rally([[36.0, 0.0, 1.0], [40.0, 0.0, 5.0]]);
        assert_eq!(look(&mut refuge), None, "it stays with the place that it flies to");
        refuge.set_rally([]);
        assert_eq!([look(&mut refuge), look(&mut refuge)], [to(0.0, 4.0), None]);
    }

    #[test]
    fn who_is_on_the_way_stays_with_its_place_unless_another_takes_it() {
        let mut refuge = Refuge::new([0.0, 0.0, 4.0], &[[40.0, 0.0, 5.0], [60.0, 0.0, 5.0]]);
        let mut look = |x, others: &[Neighbour]| {
            refuge.look(&name("uav/2"), &Vector3::new(x, 0.0, 3.0), others, x < 70.0)
        };
        assert_eq!(look(75.0, &[]), Some(Report::Refuge(Vector3::new(60.0, 0.0, 5.0))));
        assert_eq!(look(45.0, &[]), None, "though it passes another place");
        let to_the_same = |node| other(node, [80.0, 0.0, 3.0], Some([60.0, 0.0, 5.0]));
        assert_eq!(look(65.0, &[to_the_same("uav/3")]), None, "the second by name looks elsewhere");
        assert_eq!(look(65.0, &[to_the_same("uav/1")]), Some(Report::Refuge(Vector3::new(40.0, 0.0, 5.0))));
    }
}
