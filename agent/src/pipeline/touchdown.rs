//! Where a vehicle that is to land goes down: where nobody is below it, nothing that the map knows, and no zone.

use nalgebra::Vector3;
use skein_dbp::NodeName;
use skein_planning::airspace::places_around;
use skein_planning::map::{ClearanceMap, VoxelState};

use super::ground_seen::GroundSeen;
use crate::config::{Envelope, Fence};
use crate::neighbours::Neighbour;

/// An autopilot that lands may drift so far, m.
const DRIFT_M: f64 = 0.3;
/// It may come to a stop this share of the way sooner or later than planned.
const STOPS_WITHIN: f64 = 0.3;
/// A place to go down is looked for within this distance, m.
const REACH_M: f64 = 8.0;
/// Where the ground was seen it goes down up to this far away, m.
const FURTHEST_M: f64 = 20.0;
/// So much higher there may be a way aside, m.
const LIFT_M: f64 = 1.0;
/// What covers the ground reaches this far beyond where it is seen, m.
const COVER_WIDE_M: f64 = 1.5;
/// What the map knows below is looked at every so often, m: no more than a voxel is wide.
const LAYER_M: f64 = 0.2;
/// Nearer than this a place is reached, m.
const ARRIVAL_M: f64 = 0.15;
/// A vehicle that is slower than this goes down where it is, m/s: autopilots land while they brake.
const SLOW_M_S: f64 = 0.3;
/// Places around a hull that are looked at.
const AROUND: u32 = 8;

/// A vehicle in the air, and what it knows of what is around and below. World ENU, metres.
#[derive(Clone, Copy, Debug)]
pub struct Descent<'a> {
    /// The vehicle's name.
    pub name: &'a NodeName,
    /// Where it is.
    pub position: Vector3<f64>,
    /// m/s.
    pub speed_m_s: f64,
    /// Where it would come to a stop: from there it would go down.
    pub stop: Vector3<f64>,
    /// Where it should land, at its height: places near there are tried first.
    pub wanted: Vector3<f64>,
    /// Height of the ground.
    pub ground_m: f64,
    pub envelope: &'a Envelope,
    /// Where it may fly.
    pub fence: &'a Fence,
    /// Its map, with what is closed.
    pub map: &'a ClearanceMap,
    /// The others, in the air and on the ground.
    pub neighbours: &'a [Neighbour],
    /// Where its range finder has seen the ground, and whether it sees it now.
    pub ground_seen: &'a GroundSeen,
}

/// The distance from others at which a vehicle lands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Apart {
    /// As far as it keeps from them in flight.
    AsFlown,
    /// So far that hulls do not touch: where there is no better place.
    Hulls,
}

impl Descent<'_> {
    /// Where to go first, at the vehicle's height: `None` if it is slow and can go down where it is, or nowhere within
    /// reach. `chosen` is kept as long as it will do.
    pub fn detour(&self, chosen: Option<Vector3<f64>>) -> Option<Vector3<f64>> {
        let find = |apart: Apart| {
            let mut places = chosen.into_iter().chain(self.places());
            places.find(|place| self.is_free_below(place, apart) && self.can_be_reached(place))
        };
        let place = find(Apart::AsFlown).or_else(|| find(Apart::Hulls))?;
        let is_there = self.speed_m_s < SLOW_M_S && (place - self.stop).xy().norm() <= ARRIVAL_M;
        (!is_there).then_some(place)
    }

    /// Places to go down, in the order in which they are tried. Above a cover first those where the ground was seen;
    /// and then from higher up, as what is next below leaves no way aside.
    fn places(&self) -> impl Iterator<Item = Vector3<f64>> {
        let is_covered = self.ground_seen.is_covered();
        let seen = if is_covered { self.ground_seen.places(&self.stop) } else { Vec::new() };
        let is_near = |place: &Vector3<f64>| (place - self.stop).xy().norm() <= FURTHEST_M;
        let level: Vec<_> =
            seen.into_iter().filter(is_near).chain(places_around(&self.wanted, REACH_M)).collect();
        let lifts = if is_covered { 2 } else { 1 };
        (0..lifts).flat_map(move |lift| {
            let lift = Vector3::z() * (f64::from(lift) * LIFT_M);
            level.clone().into_iter().map(move |place| place + lift)
        })
    }

    /// Whether nobody and nothing known is below a place, nor beside it on the ground.
    fn is_free_below(&self, place: &Vector3<f64>, apart: Apart) -> bool {
        let drift_m = DRIFT_M + STOPS_WITHIN * (self.stop - self.position).xy().norm();
        let is_apart = |neighbour: &Neighbour| {
            let hulls_m = self.envelope.hull_m + neighbour.track.radius_m;
            let kept_m = match apart {
                Apart::AsFlown => neighbour.kept_m(self.envelope).max(hulls_m),
                Apart::Hulls => hulls_m,
            };
            (neighbour.position() - place).xy().norm() >= kept_m + drift_m
        };
        self.neighbours.iter().filter(|neighbour| self.gives_way_to(neighbour)).all(is_apart)
            && self.map.keep_out().is_none_or(|zones| zones.room_below_m(place, self.ground_m) >= 0.0)
            && self.is_empty_below(place)
            && !self.is_covered(place)
    }

    /// Whether a place is over what the range finder sees between the vehicle and the ground: that is wider than what
    /// it sees of it.
    fn is_covered(&self, place: &Vector3<f64>) -> bool {
        self.ground_seen.is_covered() && (place - self.position).xy().norm() < COVER_WIDE_M
    }

    /// Of two above one another the lower goes first; at the same height the one whose name comes first.
    fn gives_way_to(&self, neighbour: &Neighbour) -> bool {
        let height_m = neighbour.position().z;
        height_m < self.position.z || (height_m == self.position.z && neighbour.node < *self.name)
    }

    fn is_empty_below(&self, place: &Vector3<f64>) -> bool {
        let layers = ((place.z - self.ground_m) / LAYER_M).max(0.0) as u32;
        let around = (0..AROUND).map(|k| {
            let (sin, cos) = (f64::from(k) / f64::from(AROUND) * std::f64::consts::TAU).sin_cos();
            Vector3::new(cos, sin, 0.0) * self.envelope.hull_m
        });
        std::iter::once(Vector3::zeros()).chain(around).all(|offset| {
            (0..=layers).all(|layer| {
                let point = place + offset - Vector3::z() * (f64::from(layer) * LAYER_M);
                self.map.voxels().state(&point) != VoxelState::Occupied
            })
        })
    }

    /// Whether the way to a place at the same height, or from straight above to a higher one, is free, and nobody is
    /// there.
    fn can_be_reached(&self, place: &Vector3<f64>) -> bool {
        let Descent { position, map, .. } = self;
        let position = &position.xy().push(place.z.max(position.z));
        let Fence { min, max } = self.fence;
        let is_lifted = place.z > self.position.z;
        let mut axes = if is_lifted { 0..3 } else { 0..2 };
        let is_inside = axes.all(|axis| (min[axis]..=max[axis]).contains(&place[axis]));
        let clearance_m = self.envelope.hull_m.min(map.clearance(position));
        let is_taken = |neighbour: &Neighbour| {
            neighbour.armed && (neighbour.position() - place).norm() < self.envelope.separation_m
        };
        let leads_out = map.keep_out().is_some_and(|zones| zones.room_m(position) < 0.0);
        *place == self.stop
            || is_inside
                && !self.neighbours.iter().any(is_taken)
                && map.is_segment_clear(position, place, clearance_m)
                && (leads_out || map.is_open(position, place))
    }
}

#[cfg(test)]
mod tests {
    use skein_planning::map::VoxelMapConfig;
    use skein_planning::separation::Neighbour as Track;
    use skein_wire::event::Right;

    use super::*;

    const FENCE: Fence = Fence { min: [-20.0, -20.0, 0.0], max: [20.0, 20.0, 12.0] };
    const HERE: Vector3<f64> = Vector3::new(0.0, 0.0, 3.0);

    fn name(text: &str) -> NodeName {
        NodeName::new(text).unwrap()
    }

    fn other(node: &str, position: [f64; 3], armed: bool) -> Neighbour {
        let track = Track {
            id: 0,
            position: position.into(),
            velocity: Vector3::zeros(),
            sigma_m: 0.05,
            age_s: 0.0,
            radius_m: 0.25,
            cooperative: true,
        };
        Neighbour { node: name(node), armed, goal: None, track, way: None, right: Right::Free, to_go_s: None }
    }

    fn map() -> ClearanceMap {
        ClearanceMap::new(VoxelMapConfig::default(), HERE, 1.0).unwrap()
    }

    /// Where `uav/5` goes before it lands.
    fn detour(
        map: &ClearanceMap,
        neighbours: &[Neighbour],
        chosen: Option<Vector3<f64>>,
    ) -> Option<Vector3<f64>> {
        detour_over(&GroundSeen::default(), map, neighbours, chosen)
    }

    fn detour_over(
        ground_seen: &GroundSeen,
        map: &ClearanceMap,
        neighbours: &[Neighbour],
        chosen: Option<Vector3<f64>>,
    ) -> Option<Vector3<f64>> {
        let (me, envelope) = (name("uav/5"), Envelope::default());
        let descent = Descent {
            name: &me,
            position: HERE,
            speed_m_s: 0.0,
            stop: HERE,
            wanted: HERE,
            ground_m: 0.0,
            envelope: &envelope,
            fence: &FENCE,
            map,
            neighbours,
            ground_seen,
        };
        descent.detour(chosen)
    }

    #[test]
    fn over_free_ground_there_is_no_detour() {
        assert_eq!(detour(&map(), &[], None), None);
        assert_eq!(detour(&map(), &[other("uav/1", [1.8, 0.0, 0.1], false)], None), None, "it stands aside");
    }

    #[test]
    fn a_fast_vehicle_first_comes_to_where_it_stops() {
        let (me, envelope, map, seen) = (name("uav/5"), Envelope::default(), map(), GroundSeen::default());
        let flies = |speed_m_s, chosen| {
            let stop = HERE + Vector3::x();
            let (name, envelope, fence, map, ground_seen) = (&me, &envelope, &FENCE, &map, &seen);
            let at = Descent {
                name,
                position: HERE,
                speed_m_s,
                stop,
                wanted: stop,
                ground_m: 0.0,
                envelope,
                fence,
                map,
                neighbours: &[],
                ground_seen,
            };
            at.detour(chosen)
        };
        assert_eq!(flies(2.0, None), Some(HERE + Vector3::x()));
        assert_eq!(flies(2.0, Some(HERE)), Some(HERE), "or goes back to where it was to land");
        assert_eq!(flies(0.1, None), None);
        assert_eq!(flies(0.1, Some(HERE)), Some(HERE));
    }

    #[test]
    fn of_two_above_one_another_the_higher_makes_way_and_at_one_height_the_later_name() {
        let with = |node, z| detour(&map(), &[other(node, [0.2, 0.0, z], true)], None);
        assert_eq!(with("uav/1", 4.0), None);
        assert!(with("uav/9", 2.9).is_some());
        assert!(with("uav/1", 3.0).is_some());
        assert_eq!(with("uav/9", 3.0), None);
    }

    #[test]
    fn the_place_is_near_and_kept_while_it_will_do() {
        let below = other("uav/1", [0.0, 0.0, 0.1], false);
        let place = detour(&map(), std::slice::from_ref(&below), None).unwrap();
        assert!((1.7..2.6).contains(&(place - HERE).norm()), "as far off as it flies: {place}");
        let chosen = HERE + Vector3::new(-3.0, 2.0, 0.0);
        assert_eq!(detour(&map(), std::slice::from_ref(&below), Some(chosen)), Some(chosen));
        let taken = other("uav/2", [-3.2, 2.0, 0.1], false);
        assert_eq!(detour(&map(), &[below, taken], Some(chosen)), Some(place));
    }

    #[test]
    fn nobody_goes_to_where_another_flies_at_any_height() {
        let below = other("uav/1", [0.0, 0.0, 0.1], false);
        let place = detour(&map(), std::slice::from_ref(&below), None).unwrap();
        let there = other("uav/9", [place.x, place.y, place.z + 0.5], true);
        let elsewhere = detour(&map(), &[below, there], None).unwrap();
        assert!((elsewhere - place).norm() > 1.0);
    }

    #[test]
    fn what_the_map_knows_below_is_not_landed_on() {
        let mut map = map();
        map.insert(&Vector3::new(0.1, 0.1, 1.5));
        let place = detour(&map, &[], None).unwrap();
        assert!((place - HERE).xy().norm() > 0.3, "{place}");
    }

    #[test]
    fn where_there_is_no_better_place_within_reach_it_lands_where_it_is() {
        let standing = |n: i32| {
            other(
                &format!("uav/{}", n + 10),
                [f64::from(n % 25) - 12.0, f64::from(n / 25) - 12.0, 0.1],
                false,
            )
        };
        let everywhere: Vec<Neighbour> = (0..625).map(standing).collect();
        assert_eq!(detour(&map(), &everywhere, None), None);
    }

    #[test]
    fn over_what_covers_the_ground_it_goes_back_to_where_it_has_seen_it() {
        let mut seen = GroundSeen::default();
        seen.look(&Vector3::new(9.0, 0.0, 3.0), 0.0, Some(3.0));
        seen.look(&Vector3::new(6.0, 0.0, 3.0), 0.0, Some(3.0));
        assert_eq!(detour_over(&seen, &map(), &[], None), None, "the ground is below");
        seen.look(&HERE, 0.0, Some(1.5));
        let chosen = detour_over(&seen, &map(), &[], None);
        assert_eq!(chosen, Some(Vector3::new(6.0, 0.0, 3.0)));
        assert_eq!(detour_over(&seen, &map(), &[], chosen), chosen);
        let other = [other("uav/1", [6.0, 0.0, 0.1], false)];
        assert_eq!(detour_over(&seen, &map(), &other, chosen), Some(Vector3::new(9.0, 0.0, 3.0)));
    }

    #[test]
    fn over_what_covers_the_ground_everywhere_so_far_it_goes_some_way_aside() {
        let mut seen = GroundSeen::default();
        seen.look(&HERE, 0.0, Some(1.5));
        let place = detour_over(&seen, &map(), &[], None).unwrap();
        assert!((1.5..2.6).contains(&(place - HERE).norm()), "{place}");
    }

    #[test]
    fn from_close_above_a_deck_it_goes_up_first() {
        let mut seen = GroundSeen::default();
        seen.look(&Vector3::new(5.0, 0.0, 3.0), 0.0, Some(3.0));
        seen.look(&HERE, 0.0, Some(0.4));
        let mut map = map();
        for (x, y) in (-10..=10).flat_map(|x| (-10..=10).map(move |y| (x, y))) {
            map.insert(&Vector3::new(f64::from(x) * 0.2, f64::from(y) * 0.2, 2.8));
        }
        assert_eq!(detour_over(&seen, &map, &[], None), Some(Vector3::new(5.0, 0.0, 4.0)));
    }
}
