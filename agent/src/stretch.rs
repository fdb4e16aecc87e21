//! A narrow stretch of a vehicle's way, as b-threads claim it: places and the headings in which they are flown through.
//!
//! Vehicles that see a place from different sides place it differently by some decimetres, and begin to count
//! elsewhere. So two stretches meet where a place of one is near a place of the other, and are flown the same way where
//! the headings are alike, too: those who go the same way may be inside together, one behind the other.

use nalgebra::Vector3;
use serde::Serialize;
use skein_bp::{Event, EventSet};
use skein_planning::passage::Piece;
use skein_wire::event::{Declared as _, Enter, Passage};

use crate::me::Me;

/// Two places nearer than this, per horizontal axis, are one for two vehicles, m.
const NEAR_M: f64 = 1.3;
/// Whoever stands somewhere keeps others so far away per horizontal axis, m: across, that is the separation, within which
/// it is in their way.
const KEPT_M: f64 = 1.0;
/// The same for heights: vehicles pass over one another beyond it.
const NEAR_HEIGHT_M: f64 = 2.2;
/// A place nearer than this, per axis, to one of a stretch is of that stretch, m.
const SAME_PLACE_M: f64 = 0.9;
/// Headings that differ by less are the same way, degrees.
const SAME_WAY_DEG: f64 = 60.0;
/// Headings that differ by so much are those of a bend, degrees; less is straight on, and more is back.
const BEND_DEG: std::ops::Range<f64> = 20.0..120.0;
/// Boxes around places become one box if that is no wider than this across, m.
const STRAIGHT_M: f64 = 2.0 * NEAR_M + 0.5;

/// Narrow places in the order in which they are flown through.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize)]
pub struct Stretch {
    places: Vec<Place>,
    /// Where the vehicle itself is, if that is narrow.
    here: Option<Place>,
}

/// A narrow place. Whole decimetres and degrees tell all that matters, and can be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Place {
    at_dm: [i32; 3],
    /// Counter-clockwise from east, 0 to 359 degrees; unknown where nobody said.
    heading_deg: Option<i32>,
}

impl Stretch {
    /// The stretch of these pieces; the vehicle is outside.
    pub fn of(pieces: &[Piece]) -> Self {
        pieces.iter().map(Place::of).collect()
    }

    /// The same, and the vehicle is in it, there.
    #[must_use]
    pub fn from(self, here: Option<&Piece>) -> Self {
        Self { here: here.map(Place::of), ..self }
    }

    /// Where the vehicle is, alone.
    #[must_use]
    pub fn here(&self) -> Self {
        Self { places: Vec::new(), here: self.here }
    }

    /// The stretch that is announced, if the event is a `passage`.
    pub fn read(event: &Event) -> Option<Self> {
        let Passage { x, y, z, way, here } = Passage::read(event)?;
        let places =
            way.as_deref().and_then(|way| way.split("; ").map(Place::parse).collect::<Option<Vec<_>>>());
        let places = places.unwrap_or_else(|| vec![Place::new(&Vector3::new(x, y, z), None)]);
        Some(Self { places, here: here.as_deref().and_then(Place::parse) })
    }

    /// The announcement of the stretch; none of an empty one.
    pub fn passage(&self) -> Option<Passage> {
        let [x, y, z] = self.places.first()?.at_m();
        let way = self.places.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
        let here = self.here.map(|here| here.to_string().into());
        Some(Passage { x, y, z, way: Some(way.into()), here })
    }

    pub fn is_empty(&self) -> bool {
        self.places.is_empty() && self.here.is_none()
    }

    /// With the first so many places of another stretch.
    #[must_use]
    pub fn and_first(&self, places: usize, other: &Self) -> Self {
        let more = other.places.iter().take(places).filter(|place| !self.places.contains(place));
        Self { places: self.places.iter().chain(more).copied().collect(), here: self.here }
    }

    /// The number of its places.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether it is more than where the vehicle is.
    pub fn is_entered(&self) -> bool {
        !self.places.is_empty()
    }

    /// The `enter` of its place number `index`, counted from 0.
    pub fn enter(&self, index: usize, me: &Me) -> Option<Event> {
        self.places.get(index).map(|place| me.event(place.enter()))
    }

    /// Whether each of its places is of another stretch, and flown through the same way.
    pub fn is_part_of(&self, other: &Self) -> bool {
        self.first_outside(other, 0).is_none()
    }

    /// The number of its first place, from `index` on, that is none of another stretch or flown through another way.
    pub fn first_outside(&self, other: &Self, index: usize) -> Option<usize> {
        let same = other.same_way(SAME_PLACE_M);
        let is_inside =
            |place: &Place| other.places.contains(place) || same.contains(&place.enter().at("uav/0"));
        self.places
            .iter()
            .enumerate()
            .skip(index)
            .find(|(_, place)| !is_inside(place))
            .map(|(index, _)| index)
    }

    /// Those of its places that are places of another stretch, too, whichever way that is flown through; the vehicle is
    /// where that says.
    #[must_use]
    pub fn at(&self, other: &Self) -> Self {
        let is_there = |place: &&Place| other.places.iter().any(|there| there.is_same(place));
        Self { places: self.places.iter().filter(is_there).copied().collect(), here: other.here }
    }

    /// Whether one of its places is entered by this event, whichever way.
    pub fn is_at(&self, enter: &Event) -> bool {
        let Some(Enter { x, y, z, .. }) = Enter::read(enter) else { return false };
        let entered = Place::new(&Vector3::new(x, y, z), None);
        self.places.iter().any(|place| place.is_same(&entered))
    }

    /// `enter` events, whosever, that go against it, or across.
    pub fn against(&self) -> EventSet {
        let boxes = EventSet::any_of(self.boxes().map(|[min, max]| EventSet::region(min, max)));
        let places = boxes.and(self.same_way(NEAR_M).not());
        let here = self.here.map(|here| here.around(KEPT_M).and(here.same_way(KEPT_M).not()));
        here.into_iter().fold(places, EventSet::or)
    }

    /// Whether this vehicle, flying through it, would go against another stretch or across.
    pub fn leads_against(&self, other: &Self, me: &Me) -> bool {
        let against = other.against();
        self.places.iter().any(|place| against.contains(&me.event(place.enter())))
    }

    /// `enter` events so near to a place of it, per horizontal axis, m, and flown through the same way; in a bend, as the
    /// stretch goes before or behind it.
    fn same_way(&self, near_m: f64) -> EventSet {
        let along = |index: usize, place: &Place| {
            let neighbours = self.places.iter().take(index + 2).skip(index.saturating_sub(1));
            let bends = neighbours.filter(|other| place.bends_to(other));
            let bent = bends.map(|other| Place { heading_deg: other.heading_deg, ..*place });
            EventSet::any_of([*place].into_iter().chain(bent).map(|place| place.same_way(near_m)))
        };
        EventSet::any_of(self.places.iter().enumerate().map(|(index, place)| along(index, place)))
    }

    /// Boxes around all its places, as few as its bends allow, m.
    fn boxes(&self) -> impl Iterator<Item = [[f64; 3]; 2]> {
        let mut boxes: Vec<[Vector3<f64>; 2]> = Vec::new();
        for place in &self.places {
            let at = Vector3::from(place.at_m());
            let margin = Vector3::new(NEAR_M, NEAR_M, NEAR_HEIGHT_M);
            let [min, max] = [at - margin, at + margin];
            let joined = boxes.last().map(|[low, high]| [low.inf(&min), high.sup(&max)]);
            match (boxes.last_mut(), joined.filter(|[low, high]| (high - low).xy().min() <= STRAIGHT_M)) {
                (Some(last), Some(joined)) => *last = joined,
                _ => boxes.push([min, max]),
            }
        }
        boxes.into_iter().map(|corners| corners.map(Into::into))
    }
}

impl FromIterator<Place> for Stretch {
    fn from_iter<I: IntoIterator<Item = Place>>(places: I) -> Self {
        Self { places: places.into_iter().collect(), here: None }
    }
}

impl Place {
    fn of(piece: &Piece) -> Self {
        Self::new(&piece.centre, Some(&piece.direction))
    }

    fn new(at: &Vector3<f64>, direction: Option<&Vector3<f64>>) -> Self {
        let heading =
            |ahead: &Vector3<f64>| ahead.y.atan2(ahead.x).to_degrees().rem_euclid(360.0).round() as i32 % 360;
        Self {
            at_dm: (at * 10.0).map(|metres| metres.round() as i32).into(),
            heading_deg: direction.map(heading),
        }
    }

    fn parse(text: &str) -> Option<Self> {
        let mut words =
            text.split(' ').map(|word| word.parse::<f64>().ok().filter(|number| number.is_finite()));
        let [x, y, z, heading] = [words.next()??, words.next()??, words.next()??, words.next()??];
        let (sin, cos) = heading.to_radians().sin_cos();
        Some(Self::new(&Vector3::new(x, y, z), Some(&Vector3::new(cos, sin, 0.0))))
    }

    fn at_m(&self) -> [f64; 3] {
        self.at_dm.map(|decimetres| f64::from(decimetres) / 10.0)
    }

    fn is_same(&self, other: &Self) -> bool {
        let [here, there] = [self, other].map(|place| Vector3::from(place.at_m()));
        let off = (here - there).abs();
        off.xy().max() <= SAME_PLACE_M && off.z <= NEAR_HEIGHT_M
    }

    fn enter(&self) -> Enter {
        let [x, y, z] = self.at_m();
        Enter { x, y, z, heading: self.heading_deg.map(f64::from) }
    }

    /// Whether the way bends to another place, the one before it or behind it.
    fn bends_to(&self, other: &Self) -> bool {
        let [Some(here), Some(there)] = [self.heading_deg, other.heading_deg] else { return false };
        let turn_deg = (here - there + 180).rem_euclid(360) - 180;
        BEND_DEG.contains(&f64::from(turn_deg.abs()))
    }

    /// `enter` events so near to this place, m, and flown through the same way.
    fn same_way(&self, near_m: f64) -> EventSet {
        let Some(heading_deg) = self.heading_deg.map(f64::from) else { return EventSet::None };
        // Headings begin anew at a full turn.
        let alike =
            [-360.0, 0.0, 360.0].map(|turn| heading_deg + turn).into_iter().filter_map(|heading_deg| {
                let (low, high) = (heading_deg - SAME_WAY_DEG, heading_deg + SAME_WAY_DEG);
                (high >= 0.0 && low <= 360.0).then(|| EventSet::field_range("heading", low, high))
            });
        self.around(near_m).and(EventSet::any_of(alike))
    }

    /// `enter` events so near to this place, m.
    fn around(&self, near_m: f64) -> EventSet {
        let at = Vector3::from(self.at_m());
        let margin = Vector3::new(near_m, near_m, NEAR_HEIGHT_M);
        EventSet::region((at - margin).into(), (at + margin).into())
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [x, y, z] = self.at_m();
        write!(f, "{x} {y} {z} {}", self.heading_deg.unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use skein_wire::event::Declared as _;

    use super::*;

    /// Straight on from a place, metres, for so many places.
    fn straight(from: [f64; 2], heading_deg: f64, places: i32) -> Vec<Piece> {
        let (sin, cos) = heading_deg.to_radians().sin_cos();
        let direction = Vector3::new(cos, sin, 0.0);
        let start = Vector3::new(from[0], from[1], 2.0);
        (0..places).map(|k| Piece { centre: start + direction * f64::from(k), direction }).collect()
    }

    fn meets(one: &Stretch, other: &Stretch) -> bool {
        other.leads_against(one, &Me::new("uav/7"))
    }

    fn stretch(from: [f64; 2], heading_deg: f64, places: i32) -> Stretch {
        Stretch::of(&straight(from, heading_deg, places))
    }

    #[test]
    fn who_comes_the_other_way_is_kept_out_and_who_follows_is_not() {
        let east = stretch([0.0, 0.0], 0.0, 20);
        assert!(meets(&east, &stretch([19.4, 0.3], 180.0, 20)));
        assert!(!meets(&east, &stretch([0.5, -0.2], 8.0, 19)));
        assert!(meets(&east, &stretch([10.0, -8.0], 90.0, 16)), "who crosses");
        assert!(!meets(&east, &stretch([19.0, 4.0], 180.0, 20)), "another corridor");
        assert!(meets(&stretch([0.0, 0.0], 350.0, 5), &stretch([5.0, 0.0], 170.0, 5)));
        assert!(
            !meets(&stretch([0.0, 0.0], 350.0, 5), &stretch([0.0, 0.0], 10.0, 3)),
            "across north of east"
        );
    }

    #[test]
    fn those_who_go_the_same_way_round_a_bend_are_a_convoy() {
        let bend = |shift: f64| {
            let mut pieces = straight([shift, 0.0], 0.0, 6);
            pieces.extend(straight([shift + 5.5, 1.0], 90.0, 6));
            Stretch::of(&pieces)
        };
        assert!(!meets(&bend(0.0), &bend(0.3)));
        let mut wide = straight([0.0, 0.0], 0.0, 7);
        wide.extend(straight([6.4, 0.7], 80.0, 3));
        assert!(!meets(&bend(0.0), &Stretch::of(&wide)), "who takes it wide");
        assert!(meets(&bend(0.0), &stretch([2.5, -4.0], 90.0, 10)), "who crosses before it");
        let mut back = straight([5.5, 6.0], 270.0, 6);
        back.extend(straight([4.5, 0.0], 180.0, 5));
        assert!(meets(&bend(0.0), &Stretch::of(&back)));
    }

    #[test]
    fn who_turns_back_keeps_others_out_both_ways() {
        let mut there_and_back = straight([0.0, 0.0], 180.0, 3);
        there_and_back.extend(straight([-2.0, 0.5], 0.0, 3));
        let there_and_back = Stretch::of(&there_and_back);
        assert!(meets(&there_and_back, &stretch([1.0, -1.0], 0.0, 1)));
    }

    #[test]
    fn what_is_told_is_what_is_read() {
        let stretch = stretch([1.25, -3.0], 217.0, 4)
            .from(Some(&Piece { centre: Vector3::new(1.0, -2.9, 0.0), direction: Vector3::x() }));
        let told = stretch.passage().unwrap().at("uav/7");
        assert_eq!(Stretch::read(&told), Some(stretch));
    }

    #[test]
    fn of_a_stretch_of_which_less_is_left_every_place_is_part() {
        let whole = stretch([0.0, 0.0], 0.0, 10);
        assert!(stretch([4.3, 0.2], 3.0, 6).is_part_of(&whole));
        assert!(!stretch([4.3, 0.2], 3.0, 9).is_part_of(&whole), "it goes on further");
        assert!(!stretch([9.0, 0.0], 180.0, 4).is_part_of(&whole), "back");
    }

    #[test]
    fn where_no_heading_is_told_everybody_is_kept_out() {
        let announced = Passage { x: 5.0, y: 0.0, z: 2.0, way: None, here: None }.at("uav/7");
        let place = Stretch::read(&announced).unwrap();
        assert!(meets(&place, &stretch([4.0, 0.0], 0.0, 3)) && meets(&place, &place));
    }

    #[test]
    fn a_straight_stretch_is_one_box() {
        assert_eq!(stretch([0.0, 0.0], 0.0, 24).boxes().count(), 1);
        assert!(stretch([0.0, 0.0], 45.0, 24).boxes().count() > 6);
    }
}
