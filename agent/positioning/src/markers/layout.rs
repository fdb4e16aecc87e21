//! Where the markers of a place are.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::dictionary::{Dictionary, UnknownDictionary};

/// Sides and distances beyond this are taken for mistakes, m.
const FARTHEST_M: f64 = 1e5;

/// A marker at its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Its id in the layout's dictionary.
    pub id: u32,
    /// The side of its black square, m.
    pub side_m: f64,
    /// From the marker's frame to the world: its origin is the marker's centre, x runs to the right of what is printed,
    /// y to its top, z out of the paper.
    pub to_world: Isometry3<f64>,
}

impl Placed {
    /// Its upper left, upper right, lower right and lower left corner as it is printed, world ENU, m.
    pub fn corners(&self) -> [Vector3<f64>; 4] {
        let half = self.side_m / 2.0;
        [[-half, half], [half, half], [half, -half], [-half, -half]]
            .map(|[x, y]| (self.to_world * Point3::new(x, y, 0.0)).coords)
    }
}

/// The markers of a place, by id. Any layout will do: each marker has its own size and place.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(try_from = "LayoutTable", into = "LayoutTable")]
pub struct Layout {
    dictionary: Dictionary,
    markers: BTreeMap<u32, Placed>,
}

/// Why a table is no layout.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum LayoutError {
    #[error(transparent)]
    Dictionary(#[from] UnknownDictionary),
    #[error("marker {id} is not in the dictionary `{dictionary}`; its ids are 0 to {last}")]
    NoSuchId { id: u64, dictionary: String, last: usize },
    #[error("marker {0} stands twice in the layout; an id may have one place")]
    Twice(u32),
    #[error("marker {0} looks the same after half a turn, so it tells no direction; leave it out")]
    Symmetric(u32),
    #[error("marker {id}: `{field}` is {value}; expected {expected}")]
    Number { id: u64, field: &'static str, value: f64, expected: &'static str },
    #[error("a floor of {columns} columns and {rows} rows; expected at least one of each")]
    NoFloor { columns: u32, rows: u32 },
}

impl Layout {
    /// A layout of markers of a dictionary.
    pub fn new(
        dictionary: Dictionary,
        markers: impl IntoIterator<Item = Placed>,
    ) -> Result<Self, LayoutError> {
        let mut by_id = BTreeMap::new();
        for placed in markers {
            check(&dictionary, &placed)?;
            if by_id.insert(placed.id, placed).is_some() {
                return Err(LayoutError::Twice(placed.id));
            }
        }
        Ok(Self { dictionary, markers: by_id })
    }

    /// The dictionary that its markers are of.
    pub fn dictionary(&self) -> &Dictionary {
        &self.dictionary
    }

    /// The marker of an id.
    pub fn get(&self, id: u32) -> Option<&Placed> {
        self.markers.get(&id)
    }

    /// All markers, in the order of their ids.
    pub fn markers(&self) -> impl Iterator<Item = &Placed> {
        self.markers.values()
    }

    /// The table of its markers, a line each, in the form in which layouts are read.
    pub fn to_toml(&self) -> String {
        let mut text = format!("dictionary = \"{}\"\nmarker = [\n", self.dictionary.name());
        for placed in self.markers() {
            let MarkerTable { id, side_m, position: [x, y, z], yaw_deg, pitch_deg, roll_deg } = placed.into();
            let _ = write!(
                text,
                "  {{ id = {id}, side_m = {side_m:?}, position = [{x:?}, {y:?}, {z:?}], yaw_deg = {yaw_deg:?}"
            );
            if (pitch_deg, roll_deg) != (0.0, 0.0) {
                let _ = write!(text, ", pitch_deg = {pitch_deg:?}, roll_deg = {roll_deg:?}");
            }
            text.push_str(" },\n");
        }
        text + "]\n"
    }
}

fn check(dictionary: &Dictionary, placed: &Placed) -> Result<(), LayoutError> {
    let id = u64::from(placed.id);
    let last = dictionary.count() - 1;
    if id > last as u64 {
        return Err(LayoutError::NoSuchId { id, dictionary: dictionary.name().to_owned(), last });
    }
    if dictionary.is_symmetric(placed.id) {
        return Err(LayoutError::Symmetric(placed.id));
    }
    if !(placed.side_m > 0.0 && placed.side_m < FARTHEST_M) {
        let expected = "a length above 0, m";
        return Err(LayoutError::Number { id, field: "side_m", value: placed.side_m, expected });
    }
    let wrong = placed.to_world.translation.vector.iter().copied().find(|along| !(along.abs() < FARTHEST_M));
    match wrong {
        Some(value) => Err(LayoutError::Number { id, field: "position", value, expected: "metres" }),
        None => Ok(()),
    }
}

/// A layout as a file has it: regular floors, and markers of their own.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LayoutTable {
    dictionary: String,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    floor: Vec<FloorTable>,
    #[serde(default)]
    marker: Vec<MarkerTable>,
}

/// Equal markers row by row: the first at the origin, the next along the rows (east at yaw 0), rows to its left.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FloorTable {
    first_id: u32,
    columns: u32,
    rows: u32,
    side_m: f64,
    /// From centre to centre.
    pitch_m: f64,
    #[serde(default)]
    origin: [f64; 3],
    #[serde(default)]
    yaw_deg: f64,
}

/// A marker of its own. Turned by yaw, pitch and roll as a vehicle is: at zero it lies on the floor, its top to the north.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MarkerTable {
    id: u32,
    side_m: f64,
    position: [f64; 3],
    #[serde(default)]
    yaw_deg: f64,
    #[serde(default)]
    pitch_deg: f64,
    #[serde(default)]
    roll_deg: f64,
}

impl MarkerTable {
    fn placed(&self) -> Result<Placed, LayoutError> {
        let fields = [("yaw_deg", self.yaw_deg), ("pitch_deg", self.pitch_deg), ("roll_deg", self.roll_deg)];
        if let Some((field, value)) = fields.into_iter().find(|(_, angle)| !angle.is_finite()) {
            let expected = "an angle in degrees";
            return Err(LayoutError::Number { id: self.id.into(), field, value, expected });
        }
        let [roll, pitch, yaw] = [self.roll_deg, self.pitch_deg, self.yaw_deg].map(f64::to_radians);
        let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let to_world = Isometry3::from_parts(Translation3::from(self.position), turn);
        Ok(Placed { id: self.id, side_m: self.side_m, to_world })
    }
}

impl From<&Placed> for MarkerTable {
    fn from(placed: &Placed) -> Self {
        let (roll, pitch, yaw) = placed.to_world.rotation.euler_angles();
        // To a billionth of a degree, so that what was written by hand reads as it did.
        let degrees = |angle: f64| (angle.to_degrees() * 1e9).round() / 1e9 + 0.0;
        let position = placed.to_world.translation.vector.map(|along| (along * 1e9).round() / 1e9 + 0.0);
        Self {
            id: placed.id,
            side_m: placed.side_m,
            position: position.into(),
            yaw_deg: degrees(yaw),
            pitch_deg: degrees(pitch),
            roll_deg: degrees(roll),
        }
    }
}

impl FloorTable {
    /// Its markers, the number of which `count` bounds.
    fn markers(&self, dictionary: &Dictionary) -> Result<Vec<MarkerTable>, LayoutError> {
        let Self { first_id, columns, rows, side_m, pitch_m, origin, yaw_deg } = *self;
        let first = u64::from(first_id);
        if columns == 0 || rows == 0 {
            return Err(LayoutError::NoFloor { columns, rows });
        }
        if !(pitch_m >= side_m && pitch_m < FARTHEST_M) {
            let expected = "metres from centre to centre, at least a side";
            return Err(LayoutError::Number { id: first, field: "pitch_m", value: pitch_m, expected });
        }
        let (end, last) = (first + u64::from(columns) * u64::from(rows) - 1, dictionary.count() - 1);
        if end > last as u64 {
            return Err(LayoutError::NoSuchId { id: end, dictionary: dictionary.name().to_owned(), last });
        }
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_deg.to_radians());
        let place = |index: u32| {
            let cell = Vector3::new(f64::from(index % columns), f64::from(index / columns), 0.0);
            let position = (Vector3::from(origin) + turn * (cell * pitch_m)).into();
            MarkerTable { id: first_id + index, side_m, position, yaw_deg, pitch_deg: 0.0, roll_deg: 0.0 }
        };
        Ok((0..columns * rows).map(place).collect())
    }
}

impl TryFrom<LayoutTable> for Layout {
    type Error = LayoutError;

    fn try_from(table: LayoutTable) -> Result<Self, LayoutError> {
        let dictionary = Dictionary::named(&table.dictionary)?;
        let mut markers = Vec::new();
        for floor in &table.floor {
            markers.extend(floor.markers(&dictionary)?);
        }
        markers.extend(table.marker);
        let placed = markers.iter().map(MarkerTable::placed).collect::<Result<Vec<_>, _>>()?;
        Self::new(dictionary, placed)
    }
}

impl From<Layout> for LayoutTable {
    fn from(layout: Layout) -> Self {
        Self {
            dictionary: layout.dictionary.name().to_owned(),
            floor: Vec::new(),
            marker: layout.markers().map(MarkerTable::from).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Layout, String> {
        toml::from_str(text).map_err(|error| error.message().to_owned())
    }

    const PAPER: &str = "dictionary = \"original\"\n\
        floor = [{ first_id = 1, columns = 10, rows = 10, side_m = 0.18, pitch_m = 0.36 }]\n";

    #[test]
    fn the_papers_floor_is_one_line() {
        let layout = read(PAPER).unwrap();
        assert_eq!(layout.markers().count(), 100);
        let placed = layout.get(55).unwrap();
        let centre = placed.to_world.translation.vector;
        assert!((centre - Vector3::new(1.44, 1.80, 0.0)).norm() < 1e-12, "{centre}");
        assert!((placed.corners()[0] - Vector3::new(1.35, 1.89, 0.0)).norm() < 1e-12, "upper left");
        assert!((placed.corners()[2] - Vector3::new(1.53, 1.71, 0.0)).norm() < 1e-12, "lower right");
    }

    #[test]
    fn markers_stand_anywhere_and_a_floor_may_be_turned() {
        let text = "dictionary = \"4x4_50\"\n\
            floor = [{ first_id = 0, columns = 2, rows = 2, side_m = 0.1, pitch_m = 0.5, origin = [1, 2, 0], yaw_deg = 90 }]\n\
            marker = [{ id = 9, side_m = 0.4, position = [5, 0, 1.5], roll_deg = 90 }]\n";
        let layout = read(text).unwrap();
        let centre = |id: u32| layout.get(id).unwrap().to_world.translation.vector;
        assert!((centre(1) - Vector3::new(1.0, 2.5, 0.0)).norm() < 1e-12, "along the row");
        assert!((centre(2) - Vector3::new(0.5, 2.0, 0.0)).norm() < 1e-12, "the next row");
        let upper_left = layout.get(9).unwrap().corners()[0];
        assert!((upper_left - Vector3::new(4.8, 0.0, 1.7)).norm() < 1e-12, "on the wall: {upper_left}");
    }

    #[test]
    fn the_table_that_is_written_is_read_again() {
        let text = "dictionary = \"6x6_250\"\n\
            floor = [{ first_id = 3, columns = 3, rows = 2, side_m = 0.12, pitch_m = 0.3, yaw_deg = 20 }]\n\
            marker = [{ id = 200, side_m = 0.4, position = [5, -1, 1.5], yaw_deg = -90, pitch_deg = 10, roll_deg = 80 }]\n";
        let layout = read(text).unwrap();
        let written = layout.to_toml();
        assert!(
            written.contains("{ id = 3, side_m = 0.12, position = [0.0, 0.0, 0.0], yaw_deg = 20.0 },"),
            "{written}"
        );
        let again = read(&written).unwrap();
        for (one, other) in layout.markers().zip(again.markers()) {
            assert_eq!((one.id, one.side_m), (other.id, other.side_m));
            for (a, b) in one.corners().iter().zip(other.corners()) {
                assert!((a - b).norm() < 1e-8, "{one:?} {other:?}");
            }
        }
        assert_eq!(again.markers().count(), 7);
    }

    #[test]
    fn wrong_tables_are_told() {
        let marker =
            |fields: &str| read(&format!("dictionary = \"original\"\nmarker = [{fields}]\n")).unwrap_err();
        let one = "{ id = 7, side_m = 0.18, position = [0, 0, 0] }";
        assert!(marker(&format!("{one}, {one}")).contains("marker 7 stands twice"));
        let id = marker("{ id = 1024, side_m = 0.18, position = [0, 0, 0] }");
        assert_eq!(id, "marker 1024 is not in the dictionary `original`; its ids are 0 to 1023");
        assert!(marker("{ id = 7, side_m = 0.0, position = [0, 0, 0] }").contains("`side_m` is 0; expected"));
        assert!(marker("{ id = 7, side_m = 0.1, position = [nan, 0, 0] }").contains("`position` is NaN"));
        assert!(
            marker("{ id = 7, side_m = 0.1, position = [0, 0, 0], yaw_deg = inf }").contains("`yaw_deg`")
        );
        let original = Dictionary::named("original").unwrap();
        let symmetric = (0..1024).find(|id| original.is_symmetric(*id)).unwrap();
        let told = marker(&format!("{{ id = {symmetric}, side_m = 0.1, position = [0, 0, 0] }}"));
        assert!(told.contains("looks the same after half a turn"), "{told}");
        let floor = PAPER.replace("rows = 10", "rows = 4000000000");
        assert!(read(&floor).unwrap_err().contains("is not in the dictionary"));
        assert!(read(&PAPER.replace("0.36", "0.1")).unwrap_err().contains("`pitch_m` is 0.1"));
        assert!(read(&PAPER.replace("original", "x")).unwrap_err().contains("no dictionary `x`"));
    }
}
