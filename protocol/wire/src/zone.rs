//! A zone: something drawn on the map that vehicles have regard for.

use serde::{Deserialize, Serialize};
use skein_bp::{Event, EventSet, Value};

use crate::event::{Declared as _, Disregard, Events as _, Text, ZoneKind};

/// No vehicle flies further than this from the world's origin, m.
const FURTHEST_M: f64 = 1e5;
/// Corners nearer than this to one line enclose nothing, m.
const FLAT_M: f64 = 0.01;
/// Lengths travel in steps of a millimetre.
const STEPS_PER_M: f64 = 1e3;
/// The first second of the year 10000, since 1970.
const LATEST_S: f64 = 253_402_300_800.0;

/// The part of the ground that a zone stands over. ENU, metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Outline {
    Everywhere,
    Circle {
        centre: [f64; 2],
        radius_m: f64,
    },
    /// Its corners in order, three or more.
    Polygon(Vec<[f64; 2]>),
    /// The place of a rally point.
    Point([f64; 2]),
}

/// Something drawn on the map: a no-fly zone, an area to stay inside of, a threat, a limit of height, a rally point.
///
/// It is written as JSON: whoever reads it has checked it.
///
/// ```
/// use skein_wire::Zone;
///
/// let zone: Zone = r#"{"name":"pond","kind":"no_fly","centre_m":[3,4],"radius_m":5,"ceiling_m":30}"#.parse()?;
/// assert_eq!(zone.heights_m(), [f64::NEG_INFINITY, 30.0]);
/// let wrong = r#"{"name":"pond","kind":"threat","centre_m":[3,4],"radius_m":-5}"#.parse::<Zone>().unwrap_err();
/// assert!(wrong.to_string().contains("`radius_m` is -5.0: expected"));
/// # Ok::<(), skein_wire::UnfitZone>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "ZoneTable", into = "ZoneTable")]
pub struct Zone {
    name: String,
    kind: ZoneKind,
    outline: Outline,
    low_m: f64,
    high_m: f64,
    from_s: Option<f64>,
    until_s: Option<f64>,
}

/// A zone as it is written. ENU, metres; seconds since 1970.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ZoneTable {
    pub name: String,
    pub kind: ZoneKind,
    /// Of a circle, and of a rally point.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre_m: Option<[f64; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_m: Option<f64>,
    /// Of a polygon.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corners_m: Option<Vec<[f64; 2]>>,
    /// The lower end of a no-fly zone or of an area to stay inside of; none: it goes down to the ground and below.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor_m: Option<f64>,
    /// Their upper end; none: it has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ceiling_m: Option<f64>,
    /// Of a limit of height, and of a rally point.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_m: Option<f64>,
    /// It counts from then on; none: at once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from_s: Option<f64>,
    /// It counts until then; none: until it is removed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until_s: Option<f64>,
}

/// Why a table is no zone.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnfitZone {
    /// It cannot be read at all.
    #[error("no zone: {0}")]
    Unreadable(String),
    /// A field is not what it may be.
    #[error("`{field}` is {value}: expected {expected}")]
    Field { field: String, value: String, expected: &'static str },
}

impl Zone {
    /// Most bytes of a name.
    pub const LONGEST_NAME: usize = 32;
    /// Most corners of a polygon.
    pub const MOST_CORNERS: usize = 64;
    /// So many zones one station draws at most: they travel in one message.
    pub const MOST: usize = 32;
    /// So many corners all its zones have at most.
    pub const MOST_CORNERS_IN_ALL: usize = 512;

    pub fn name(&self) -> &str {
        &self.name
    }

    pub fn kind(&self) -> ZoneKind {
        self.kind
    }

    pub fn outline(&self) -> &Outline {
        &self.outline
    }

    /// Its lower and its upper end, metres; infinite without one. Of a rally point the height twice.
    pub fn heights_m(&self) -> [f64; 2] {
        [self.low_m, self.high_m]
    }

    /// When it begins and ends to count, seconds since 1970; infinite without.
    pub fn hours_s(&self) -> [f64; 2] {
        [self.from_s.unwrap_or(f64::NEG_INFINITY), self.until_s.unwrap_or(f64::INFINITY)]
    }

    /// The number of its corners.
    pub fn corners(&self) -> usize {
        match &self.outline {
            Outline::Polygon(corners) => corners.len(),
            Outline::Everywhere | Outline::Circle { .. } | Outline::Point(_) => 0,
        }
    }

    /// As it is written and sent.
    pub fn to_json(&self) -> String {
        // No map with keys that are no texts is in it, so that writing it cannot fail.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// What whoever has drawn it blocks: that vehicles fly without regard to it.
    pub fn block(&self) -> EventSet {
        Disregard::any_of("uav/*").and(Disregard::zone(self.to_json().as_str()))
    }

    /// The zones in a block that holds at the vehicle `me`, each as it is written.
    pub fn texts_in(block: &EventSet, me: &str) -> Vec<Text> {
        let mut texts = Vec::new();
        if block.may_hold_named(&format!("{me}/{}", Disregard::NAME)) {
            collect(block, &mut texts);
        }
        texts
    }
}

fn collect(block: &EventSet, texts: &mut Vec<Text>) {
    let text = |value: Option<&Value>| value.and_then(Value::as_text).cloned();
    match block {
        EventSet::And(sets) | EventSet::Or(sets) => sets.iter().for_each(|set| collect(set, texts)),
        EventSet::FieldIs(fields) => texts.extend(text(fields.get("zone"))),
        EventSet::Exactly(event) => texts.extend(text(Event::get(event, "zone"))),
        _ => {}
    }
}

impl std::str::FromStr for Zone {
    type Err = UnfitZone;

    fn from_str(text: &str) -> Result<Self, UnfitZone> {
        let table: ZoneTable =
            serde_json::from_str(text).map_err(|error| UnfitZone::Unreadable(error.to_string()))?;
        table.try_into()
    }
}

fn unfit(field: &str, value: impl std::fmt::Debug, expected: &'static str) -> UnfitZone {
    let value: String = format!("{value:?}").chars().take(80).collect();
    UnfitZone::Field { field: field.to_owned(), value, expected }
}

fn is_length(metres: f64) -> bool {
    (-FURTHEST_M..=FURTHEST_M).contains(&metres)
}

fn rounded(metres: f64) -> f64 {
    (metres * STEPS_PER_M).round() / STEPS_PER_M
}

impl TryFrom<ZoneTable> for Zone {
    type Error = UnfitZone;

    fn try_from(table: ZoneTable) -> Result<Self, UnfitZone> {
        check_name(&table.name)?;
        let outline = outline(&table)?;
        let [low_m, high_m] = heights(&table)?;
        let ZoneTable { name, kind, from_s, until_s, .. } = table;
        for (field, time_s) in [("from_s", from_s), ("until_s", until_s)] {
            if let Some(time_s) = time_s.filter(|time_s| !(0.0..LATEST_S).contains(time_s)) {
                return Err(unfit(field, time_s, "seconds since 1970"));
            }
        }
        if let (Some(from_s), Some(until_s)) = (from_s, until_s)
            && from_s >= until_s
        {
            return Err(unfit("until_s", until_s, "a time after `from_s`"));
        }
        Ok(Self { name, kind, outline, low_m, high_m, from_s, until_s })
    }
}

fn check_name(name: &str) -> Result<(), UnfitZone> {
    let is_odd = |letter: char| !(letter.is_alphanumeric() || matches!(letter, '-' | '_' | '.'));
    if name.is_empty() || name.len() > Zone::LONGEST_NAME || name.contains(is_odd) {
        return Err(unfit("name", name, "1 to 32 bytes of letters, digits, `-`, `_` and `.`"));
    }
    Ok(())
}

fn outline(table: &ZoneTable) -> Result<Outline, UnfitZone> {
    let ZoneTable { kind, centre_m, radius_m, corners_m, .. } = table;
    if let Some(centre) = centre_m.filter(|centre| !centre.iter().all(|metres| is_length(*metres))) {
        return Err(unfit("centre_m", centre, "two numbers of at most 100 km: metres east and north"));
    }
    if let Some(radius_m) = radius_m.filter(|radius_m| !(0.1..=FURTHEST_M).contains(radius_m)) {
        return Err(unfit("radius_m", radius_m, "a number from 0.1 to 100000"));
    }
    if corners_m.is_some() && matches!(kind, ZoneKind::Threat | ZoneKind::Rally) {
        return Err(unfit("corners_m", "given", "none: a threat is a circle, and a rally point a point"));
    }
    match (kind, centre_m, radius_m, corners_m) {
        (ZoneKind::Rally, Some([x, y]), None, _) => Ok(Outline::Point([rounded(*x), rounded(*y)])),
        (ZoneKind::Rally, None, ..) => Err(unfit("centre_m", "missing", "the place of the rally point")),
        (ZoneKind::Rally, _, Some(radius_m), _) => Err(unfit("radius_m", radius_m, "none for a rally point")),
        (_, Some([x, y]), Some(radius_m), None) => {
            Ok(Outline::Circle { centre: [rounded(*x), rounded(*y)], radius_m: rounded(*radius_m) })
        }
        (_, None, None, Some(corners)) => polygon(corners).map(Outline::Polygon),
        (ZoneKind::NotAbove | ZoneKind::NotBelow, None, None, None) => Ok(Outline::Everywhere),
        (_, Some(_), None, None) => Err(unfit("radius_m", "missing", "the radius around `centre_m`")),
        (_, None, Some(_), None) => Err(unfit("centre_m", "missing", "the middle of the circle")),
        (_, None, None, None) => {
            Err(unfit("centre_m", "missing", "`centre_m` and `radius_m`, or `corners_m`"))
        }
        (_, _, _, Some(_)) => Err(unfit("corners_m", "given", "either a circle or corners")),
    }
}

fn polygon(corners: &[[f64; 2]]) -> Result<Vec<[f64; 2]>, UnfitZone> {
    if !(3..=Zone::MOST_CORNERS).contains(&corners.len()) {
        return Err(unfit("corners_m", format_args!("{} corners", corners.len()), "3 to 64 corners"));
    }
    let outside = corners.iter().position(|corner| !corner.iter().all(|metres| is_length(*metres)));
    if let Some(index) = outside {
        let field = format!("corners_m[{index}]");
        return Err(unfit(&field, corners[index], "two numbers of at most 100 km: metres east and north"));
    }
    let rounded: Vec<_> = corners.iter().map(|[x, y]| [rounded(*x), rounded(*y)]).collect();
    if is_flat(&rounded) {
        return Err(unfit("corners_m", "a line", "corners that enclose something"));
    }
    Ok(rounded)
}

/// Whether all corners are on one line, or in one place.
fn is_flat(corners: &[[f64; 2]]) -> bool {
    let [from, ..] = corners else { return true };
    let off = |corner: &[f64; 2]| [corner[0] - from[0], corner[1] - from[1]];
    let length = |[x, y]: [f64; 2]| x.hypot(y);
    let furthest = corners.iter().map(off).max_by(|a, b| length(*a).total_cmp(&length(*b)));
    let [x, y] = furthest.unwrap_or_default();
    let beside_m = |[east, north]: [f64; 2]| (x * north - y * east).abs() / length([x, y]).max(FLAT_M);
    corners.iter().map(off).all(|corner| beside_m(corner) < FLAT_M)
}

/// The lower and the upper end.
fn heights(table: &ZoneTable) -> Result<[f64; 2], UnfitZone> {
    let ZoneTable { kind, floor_m, ceiling_m, height_m, .. } = *table;
    for (field, metres) in [("floor_m", floor_m), ("ceiling_m", ceiling_m), ("height_m", height_m)] {
        if let Some(metres) = metres.filter(|metres| !is_length(*metres)) {
            return Err(unfit(field, metres, "metres, at most 100 km"));
        }
    }
    let of_ends = matches!(kind, ZoneKind::NoFly | ZoneKind::StayInside);
    let [floor_m, ceiling_m, height_m] = [floor_m, ceiling_m, height_m].map(|metres| metres.map(rounded));
    match (floor_m, ceiling_m, height_m) {
        (Some(floor_m), ..) if !of_ends => Err(unfit("floor_m", floor_m, "none for this kind of zone")),
        (_, Some(ceiling_m), _) if !of_ends => {
            Err(unfit("ceiling_m", ceiling_m, "none for this kind of zone"))
        }
        (_, _, Some(height_m)) if of_ends || kind == ZoneKind::Threat => {
            Err(unfit("height_m", height_m, "none for this kind of zone"))
        }
        (Some(floor_m), Some(ceiling_m), _) if floor_m >= ceiling_m => {
            Err(unfit("ceiling_m", ceiling_m, "a height above `floor_m`"))
        }
        (floor_m, ceiling_m, None) if of_ends || kind == ZoneKind::Threat => {
            Ok([floor_m.unwrap_or(f64::NEG_INFINITY), ceiling_m.unwrap_or(f64::INFINITY)])
        }
        (.., None) => Err(unfit("height_m", "missing", "a height in metres")),
        (.., Some(height_m)) => Ok(match kind {
            ZoneKind::NotAbove => [height_m, f64::INFINITY],
            ZoneKind::NotBelow => [f64::NEG_INFINITY, height_m],
            _ => [height_m, height_m],
        }),
    }
}

impl From<Zone> for ZoneTable {
    fn from(zone: Zone) -> Self {
        let Zone { name, kind, outline, low_m, high_m, from_s, until_s } = zone;
        let finite = |metres: f64| Some(metres).filter(|metres| metres.is_finite());
        let (floor_m, ceiling_m, height_m) = match kind {
            ZoneKind::NoFly | ZoneKind::StayInside => (finite(low_m), finite(high_m), None),
            ZoneKind::Threat => (None, None, None),
            ZoneKind::NotAbove | ZoneKind::Rally => (None, None, Some(low_m)),
            ZoneKind::NotBelow => (None, None, Some(high_m)),
        };
        let (centre_m, radius_m, corners_m) = match outline {
            Outline::Everywhere => (None, None, None),
            Outline::Circle { centre, radius_m } => (Some(centre), Some(radius_m), None),
            Outline::Polygon(corners) => (None, None, Some(corners)),
            Outline::Point(place) => (Some(place), None, None),
        };
        Self { name, kind, centre_m, radius_m, corners_m, floor_m, ceiling_m, height_m, from_s, until_s }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn zone(rest: &str) -> Result<Zone, UnfitZone> {
        format!(r#"{{"name":"pond",{rest}}}"#).parse()
    }

    #[test]
    fn each_kind_is_written_as_it_is_read() {
        for rest in [
            r#""kind":"no_fly","centre_m":[1.5,-2.0],"radius_m":5.0"#,
            r#""kind":"no_fly","corners_m":[[0.0,0.0],[9.0,0.0],[0.0,9.0]],"floor_m":2.0,"ceiling_m":8.0"#,
            r#""kind":"stay_inside","centre_m":[0.0,0.0],"radius_m":50.0,"ceiling_m":30.0"#,
            r#""kind":"threat","centre_m":[0.0,0.0],"radius_m":50.0,"from_s":100.0,"until_s":200.0"#,
            r#""kind":"not_above","height_m":12.0"#,
            r#""kind":"not_below","centre_m":[0.0,0.0],"radius_m":50.0,"height_m":3.0"#,
            r#""kind":"rally","centre_m":[4.0,5.0],"height_m":6.0"#,
        ] {
            let read = zone(rest).unwrap();
            assert_eq!(read.to_json(), format!(r#"{{"name":"pond",{rest}}}"#));
            assert_eq!(read.to_json().parse(), Ok(read));
        }
    }

    #[test]
    fn what_is_no_zone_is_told_with_the_field_at_fault() {
        let many: Vec<[f64; 2]> = (0..65).map(|k| [f64::from(k), f64::from(k * k)]).collect();
        let many = format!(r#""kind":"no_fly","corners_m":{many:?}"#);
        for (rest, fault) in [
            (r#""kind":"no_fly""#, "`centre_m` is \"missing\""),
            (r#""kind":"no_fly","centre_m":[0,0]"#, "`radius_m` is \"missing\""),
            (r#""kind":"no_fly","centre_m":[0,0],"radius_m":0"#, "`radius_m` is 0.0"),
            (r#""kind":"no_fly","centre_m":[0,1e6],"radius_m":5"#, "`centre_m` is [0.0, 1000000.0]"),
            (r#""kind":"no_fly","corners_m":[[0,0],[1,1]]"#, "`corners_m` is 2 corners"),
            (r#""kind":"no_fly","corners_m":[[0,0],[1,1],[2,2]]"#, "enclose something"),
            (r#""kind":"no_fly","corners_m":[[0,0],[1,1],[0,1e7]]"#, "`corners_m[2]`"),
            (many.as_str(), "65 corners"),
            (
                r#""kind":"no_fly","corners_m":[[0,0],[1,0],[0,1]],"centre_m":[0,0],"radius_m":1"#,
                "`corners_m` is \"given\"",
            ),
            (
                r#""kind":"no_fly","centre_m":[0,0],"radius_m":5,"floor_m":9,"ceiling_m":8"#,
                "`ceiling_m` is 8.0",
            ),
            (r#""kind":"no_fly","centre_m":[0,0],"radius_m":5,"height_m":9"#, "`height_m`"),
            (r#""kind":"threat","corners_m":[[0,0],[1,0],[0,1]]"#, "`corners_m`"),
            (r#""kind":"threat","centre_m":[0,0],"radius_m":5,"floor_m":1"#, "`floor_m`"),
            (r#""kind":"not_above""#, "`height_m` is \"missing\""),
            (r#""kind":"rally","height_m":3"#, "`centre_m`"),
            (r#""kind":"rally","centre_m":[0,0],"radius_m":4,"height_m":3"#, "`radius_m`"),
            (r#""kind":"not_above","height_m":3,"from_s":9,"until_s":9"#, "`until_s`"),
            (r#""kind":"not_above","height_m":3,"from_s":-1"#, "`from_s`"),
            (r#""kind":"moat""#, "unknown variant `moat`"),
            (r#""kind":"not_above","height_m":3,"colour":1"#, "unknown field `colour`"),
        ] {
            let error = zone(rest).unwrap_err().to_string();
            assert!(error.contains(fault), "{rest}: {error}");
        }
        for name in ["", "a b", "a/b", "a#b", &"x".repeat(33)] {
            let named = ZoneTable {
                name: name.to_owned(),
                kind: ZoneKind::NotAbove,
                height_m: Some(3.0),
                ..ZoneTable::default()
            };
            assert!(Zone::try_from(named).unwrap_err().to_string().contains("`name`"), "{name:?}");
        }
    }

    #[test]
    fn the_zones_of_a_block_are_found_also_where_a_home_honours_a_part_of_it() {
        let pond = zone(r#""kind":"not_above","height_m":12"#).unwrap();
        let hill = zone(r#""kind":"not_below","height_m":3"#).unwrap();
        let part = pond.block().and(EventSet::prefix("uav/1/").and(EventSet::named("uav/1/land").not()));
        let both = part.or(hill.block());
        let texts: Vec<_> = Zone::texts_in(&both, "uav/1").iter().map(|text| text.parse()).collect();
        assert_eq!(texts, [Ok(pond), Ok(hill)]);
        assert!(Zone::texts_in(&EventSet::field_is("zone", "x").and("uav/*/advance"), "uav/1").is_empty());
    }

    #[test]
    fn as_many_zones_as_one_station_draws_fit_into_one_message() {
        let corner = |k: usize| [-99_989.123 - k as f64 * 0.101, 99_998.321 - (k * k) as f64 * 0.101];
        let corners = Zone::MOST_CORNERS_IN_ALL / Zone::MOST;
        let table = |number: usize| ZoneTable {
            name: format!("{number:>032}"),
            kind: ZoneKind::StayInside,
            corners_m: Some((0..corners).map(corner).collect()),
            floor_m: Some(-99_999.123),
            ceiling_m: Some(99_999.123),
            from_s: Some(1_900_000_000.123),
            until_s: Some(1_900_000_001.123),
            ..ZoneTable::default()
        };
        let bytes: usize =
            (0..Zone::MOST).map(|number| Zone::try_from(table(number)).unwrap().to_json().len() + 200).sum();
        assert!(bytes < skein_bp::Bound::BidBytes.stated() / 2, "{bytes}");
    }

    proptest! {
        #[test]
        fn nothing_that_is_written_makes_it_panic(text in "\\PC{0,80}") {
            let _ = text.parse::<Zone>();
        }
    }
}
