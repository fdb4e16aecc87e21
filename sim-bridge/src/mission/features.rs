//! Features of a map: polygons become zones, and lines routes, each of them for one vehicle.

use nalgebra::Vector2;
use skein_mav::Datum;
use skein_planning::airspace::{Airspace, Area, StayInside};

use super::command::WAYPOINT;
use super::item::{Item, Origin};
use super::route::Draft;
use super::{Account, Allowances, MissionError, MissionSet, Warning};
use crate::element::{Element, Verdict};

/// Height of lines that have none, above where they begin, in metres.
const LINE_HEIGHT_M: f64 = 5.0;
/// `MAV_FRAME_GLOBAL_RELATIVE_ALT`.
const ABOVE_HOME: u64 = 3;

/// A feature, and its place in the file.
pub struct Feature {
    /// Such as `features[2]: LineString`.
    pub what: String,
    pub line: usize,
    pub shape: Shape,
    /// A polygon is one to stay inside of, where the file says; else it is one to stay out of.
    pub includes: bool,
}

/// Longitudes and latitudes in degrees, as maps have them.
pub enum Shape {
    /// With heights above the ground where it begins, in metres.
    Line(Vec<([f64; 2], Option<f64>)>),
    /// The outline, then holes.
    Polygon(Vec<Vec<[f64; 2]>>),
    /// Neither a zone nor a route.
    Mark,
    /// The fault in it: expected, found.
    Wrong(String, String),
}

/// Zones and routes of features; see [`MissionSet::read`] for the `datum`.
pub fn read(features: Vec<Feature>, file: &str, datum: Option<Datum>, allowances: Allowances) -> Account {
    let Some([longitude, latitude]) = features.iter().find_map(|feature| feature.shape.first()) else {
        return Account { elements: features.iter().map(nowhere).collect(), set: Err(nothing(file)) };
    };
    let mut reader = Reader {
        file,
        allowances,
        datum: Draft::new(latitude, longitude, None, datum, allowances).datum,
        zones: Airspace::default(),
        set: MissionSet::default(),
        elements: Vec::new(),
        fault: None,
    };
    // Zones first, as routes are held against them.
    let is_line = |feature: &Feature| matches!(feature.shape, Shape::Line(_));
    let (lines, others): (Vec<_>, Vec<_>) = features.into_iter().partition(is_line);
    others.into_iter().chain(lines).for_each(|feature| reader.take(feature));
    reader.finish()
}

struct Reader<'a> {
    file: &'a str,
    allowances: Allowances,
    datum: Datum,
    zones: Airspace,
    set: MissionSet,
    elements: Vec<Element>,
    fault: Option<MissionError>,
}

impl Reader<'_> {
    fn take(&mut self, feature: Feature) {
        let Feature { what, line, shape, includes } = feature;
        let (verdict, why) = match shape {
            Shape::Line(places) => return self.route(what, line, &places),
            Shape::Polygon(rings) => self.zone(line, &rings, includes),
            Shape::Mark => (Verdict::Harmless, "it is no zone and no route".to_owned()),
            Shape::Wrong(expected, found) => {
                let error = self.error(line, &what, expected, found);
                let why = error.to_string();
                self.fault.get_or_insert(error);
                (Verdict::Refused, why)
            }
        };
        self.elements.push(Element { what, file: None, line, verdict, why, count: 1 });
    }

    fn zone(&mut self, line: usize, rings: &[Vec<[f64; 2]>], includes: bool) -> (Verdict, String) {
        let area = |ring: &Vec<[f64; 2]>| ring.iter().map(|place| self.level(place)).collect::<Vec<_>>();
        let (outline, holes) = (rings.first().map(area).unwrap_or_default(), rings.iter().skip(1).map(area));
        let closed = |corners| match Area::cornered(corners) {
            Area::Cornered(zone) => Some(zone),
            Area::Round(_) => None,
        };
        let holes: Vec<_> = holes.filter_map(closed).collect();
        if includes {
            let mut inside = std::mem::take(&mut self.zones.stay_inside).pop().unwrap_or_default();
            inside.any_of.push(Area::cornered(outline));
            self.zones.stay_inside = vec![StayInside { any_of: inside.any_of }];
            self.zones.prisms.extend(holes);
            return (Verdict::Honoured, "a zone to stay inside of".to_owned());
        }
        const WHY: &str = "a zone to stay out of, as it has no property `inclusion` that is true";
        let (file, message) = (self.file.to_owned(), format!("a polygon is {WHY}"));
        self.set.warnings.push(Warning { file, line, message });
        self.zones.prisms.extend(closed(outline));
        (Verdict::Honoured, WHY.to_owned())
    }

    fn level(&self, [longitude, latitude]: &[f64; 2]) -> Vector2<f64> {
        let place = Datum::from_degrees(*latitude, *longitude, self.datum.height_m).place();
        self.datum.to_enu(&place).xy()
    }

    fn route(&mut self, what: String, line: usize, places: &[([f64; 2], Option<f64>)]) {
        let Some(([longitude, latitude], _)) = places.first() else { return };
        let mut draft = Draft::new(*latitude, *longitude, None, Some(self.datum), self.allowances);
        draft.airspace = self.zones.clone();
        let element = draft.element(what, line, Verdict::Honoured, "a route");
        if places.iter().any(|(_, height_m)| height_m.is_none()) {
            let message = format!("a line without heights is flown {LINE_HEIGHT_M} m above where it begins");
            self.set.warnings.push(Warning { file: self.file.to_owned(), line, message });
        }
        let items: Vec<_> = (1..)
            .zip(places)
            .map(|(number, ([longitude, latitude], height_m))| {
                let height_m = height_m.unwrap_or(LINE_HEIGHT_M);
                Item {
                    origin: Origin::Row { file: self.file, line },
                    command: WAYPOINT,
                    frame: ABOVE_HOME,
                    params: [0.0, 0.0, 0.0, f64::NAN, *latitude, *longitude, height_m],
                    number,
                    element,
                    scan: None,
                    follows_terrain: false,
                }
            })
            .collect();
        draft.fly(&items);
        let (draft, mission) = draft.finish(|| nothing(self.file));
        self.elements.extend(draft.elements);
        self.fault = self.fault.take().or(draft.fault);
        self.set.missions.push(mission);
    }

    fn error(&self, line: usize, field: &str, expected: String, found: String) -> MissionError {
        MissionError::Field { file: self.file.to_owned(), line, field: field.to_owned(), expected, found }
    }

    fn finish(self) -> Account {
        let set = MissionSet { airspace: self.zones, datum: Some(self.datum), ..self.set };
        Account { elements: self.elements, set: self.fault.map_or(Ok(set), Err) }
    }
}

impl Shape {
    /// A line of some places.
    pub fn line(places: Vec<([f64; 2], Option<f64>)>) -> Self {
        match places.iter().find(|(place, _)| !is_on_earth(place)) {
            Some((place, _)) => off_earth(place),
            None if places.len() < 2 => {
                Self::Wrong("two places or more".to_owned(), places.len().to_string())
            }
            None => Self::Line(places),
        }
    }

    /// A polygon of some rings, each of which ends where it begins.
    pub fn polygon(mut rings: Vec<Vec<[f64; 2]>>) -> Self {
        for ring in &mut rings {
            if ring.len() > 1 && ring.first() == ring.last() {
                ring.pop();
            }
        }
        if let Some(place) = rings.iter().flatten().find(|place| !is_on_earth(place)) {
            return off_earth(place);
        }
        match rings.iter().find(|ring| ring.len() < 3) {
            Some(ring) => Self::Wrong("three corners or more".to_owned(), ring.len().to_string()),
            None if rings.is_empty() => Self::Wrong("an outline".to_owned(), "none".to_owned()),
            None => Self::Polygon(rings),
        }
    }

    fn first(&self) -> Option<[f64; 2]> {
        match self {
            Self::Line(places) => places.first().map(|(place, _)| *place),
            Self::Polygon(rings) => rings.first()?.first().copied(),
            Self::Mark | Self::Wrong(..) => None,
        }
    }
}

fn is_on_earth([longitude, latitude]: &[f64; 2]) -> bool {
    longitude.abs() <= 180.0 && latitude.abs() <= 90.0
}

fn off_earth(place: &[f64; 2]) -> Shape {
    Shape::Wrong("longitude, then latitude, within 180 and 90 degrees".to_owned(), format!("{place:?}"))
}

fn nowhere(feature: &Feature) -> Element {
    let (verdict, why) = match &feature.shape {
        Shape::Wrong(expected, found) => (Verdict::Refused, format!("expected {expected}, found {found}")),
        _ => (Verdict::Harmless, String::new()),
    };
    Element { what: feature.what.clone(), file: None, line: feature.line, verdict, why, count: 1 }
}

fn nothing(file: &str) -> MissionError {
    MissionError::Field {
        file: file.to_owned(),
        line: 1,
        field: "features".to_owned(),
        expected: "a polygon or a line that is sound".to_owned(),
        found: "none".to_owned(),
    }
}
