//! The sets of markers that people print, and which of them a grid of bits is.

use thiserror::Error;

/// Wrong bits that each dictionary corrects, by name.
const LIMITS: &str = include_str!("dictionaries/limits.txt");
/// The largest dictionary of each family, whose beginnings the smaller ones are: a code a line, in hexadecimal.
const FAMILIES: [(&str, usize, &str); 4] = [
    ("4x4", 4, include_str!("dictionaries/4x4.txt")),
    ("5x5", 5, include_str!("dictionaries/5x5.txt")),
    ("6x6", 6, include_str!("dictionaries/6x6.txt")),
    ("7x7", 7, include_str!("dictionaries/7x7.txt")),
];
/// The dictionary with a rule.
const ORIGINAL: &str = "original";
/// The ids of the original dictionary are the numbers of ten bits.
const ORIGINAL_COUNT: u64 = 1024;
/// A row of the original dictionary holds two bits of the id and three that check them (Zhang 2019, section 2).
const ORIGINAL_ROWS: [u64; 4] = [0b10000, 0b10111, 0b01001, 0b01110];

/// A set of markers: square grids of black and white cells, told apart in each of four rotations.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Dictionary {
    name: String,
    side: usize,
    correctable: u32,
    /// Of each marker its bits, and the same after one to three quarter turns clockwise.
    codes: Vec<[u64; 4]>,
}

/// There is no dictionary of this name.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("there is no dictionary `{name}`; those known are {}", known.join(", "))]
pub struct UnknownDictionary {
    name: String,
    known: Vec<&'static str>,
}

/// The marker that a grid of bits is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Its id.
    pub id: u32,
    /// Quarter turns clockwise after which the printed marker looks like the grid, 0 to 3.
    pub turns: usize,
    /// Bits that were read wrongly.
    pub errors: u32,
}

impl Dictionary {
    /// The dictionary of a name: `original`, or a family and a count such as `4x4_50` or `6x6_250`. OpenCV's names
    /// (`DICT_6X6_250`, `DICT_ARUCO_ORIGINAL`) are understood.
    pub fn named(name: &str) -> Result<Self, UnknownDictionary> {
        let lower = name.to_lowercase();
        let short = lower.trim_start_matches("dict_").trim_start_matches("aruco_");
        limits()
            .find(|(known, _)| *known == short)
            .and_then(|(known, limit)| Self::read(known, limit))
            .ok_or_else(|| UnknownDictionary { name: name.to_owned(), known: Self::names().collect() })
    }

    /// The names of all dictionaries.
    pub fn names() -> impl Iterator<Item = &'static str> {
        limits().map(|(name, _)| name)
    }

    fn read(name: &str, correctable: u32) -> Option<Self> {
        let (side, codes): (usize, Vec<u64>) = if name == ORIGINAL {
            (5, (0..ORIGINAL_COUNT).map(original).collect())
        } else {
            let (family, count) = name.split_once('_')?;
            let count = count.parse().ok()?;
            let (_, side, table) = FAMILIES.into_iter().find(|(known, ..)| *known == family)?;
            let lines = table.lines().filter(|line| !line.starts_with('#'));
            let codes = lines.take(count).map(|line| u64::from_str_radix(line, 16));
            (side, codes.collect::<Result<_, _>>().ok()?)
        };
        let codes = codes.into_iter().map(|code| turns(code, side)).collect();
        Some(Self { name: name.to_owned(), side, correctable, codes })
    }

    /// Its name, as [`Dictionary::named`] takes it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Data cells along a side; a black border of one cell goes round them.
    pub fn side(&self) -> usize {
        self.side
    }

    /// Cells along a side, the border included.
    pub fn cells(&self) -> usize {
        self.side + 2
    }

    /// The number of markers; their ids begin at 0.
    pub fn count(&self) -> usize {
        self.codes.len()
    }

    /// Whether a cell of a marker is white, rows from the top and columns from the left, the border included. `None` if
    /// there is no such marker. Cells outside are white, as the paper around must be.
    pub fn is_white(&self, id: u32, row: usize, column: usize) -> Option<bool> {
        let code = self.codes.get(usize::try_from(id).ok()?)?[0];
        let last = self.side + 1;
        Some(match (row, column) {
            _ if row > last || column > last => true,
            _ if row == 0 || column == 0 || row == last || column == last => false,
            _ => code >> (self.side * self.side - 1 - ((row - 1) * self.side + column - 1)) & 1 == 1,
        })
    }

    /// Whether a marker looks the same after a half or quarter turn, so that it does not tell a direction.
    pub fn is_symmetric(&self, id: u32) -> bool {
        let code = usize::try_from(id).ok().and_then(|id| self.codes.get(id));
        code.is_some_and(|[upright, turned @ ..]| turned.contains(upright))
    }

    /// The marker whose bits these are, row by row with the first the highest, white 1. Wrong bits are corrected, up to
    /// the dictionary's own limit, where a single marker in a single rotation is nearest.
    pub fn identify(&self, bits: u64) -> Option<Identity> {
        let mut nearest: Option<Identity> = None;
        let mut is_tie = false;
        for (id, code) in (0..).zip(&self.codes) {
            for (turns, turned) in code.iter().enumerate() {
                let errors = (turned ^ bits).count_ones();
                if errors == 0 {
                    return Some(Identity { id, turns, errors });
                }
                let bound = nearest.map_or(self.correctable, |nearest| nearest.errors);
                if errors <= bound {
                    is_tie = nearest.is_some_and(|nearest| nearest.errors == errors);
                    nearest = Some(Identity { id, turns, errors });
                }
            }
        }
        nearest.filter(|_| !is_tie)
    }
}

fn limits() -> impl Iterator<Item = (&'static str, u32)> {
    LIMITS.lines().filter_map(|line| {
        let (name, limit) = line.split_once(' ')?;
        Some((name, limit.parse().ok()?))
    })
}

/// The bits of an id of the original dictionary.
fn original(id: u64) -> u64 {
    (0..5).rev().fold(0, |bits, row| bits << 5 | ORIGINAL_ROWS[(id >> (2 * row) & 3) as usize])
}

/// A grid, and the same after one, two and three quarter turns clockwise.
fn turns(bits: u64, side: usize) -> [u64; 4] {
    let once = turned(bits, side);
    let twice = turned(once, side);
    [bits, once, twice, turned(twice, side)]
}

fn turned(bits: u64, side: usize) -> u64 {
    let cells = (0..side).flat_map(|row| (0..side).map(move |column| (side - 1 - column, row)));
    cells.fold(0, |grid, (row, column)| grid << 1 | bits >> (side * side - 1 - (row * side + column)) & 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_original_dictionary_follows_its_rule() {
        let original = Dictionary::named("original").unwrap();
        let rows = [0b10000, 0b10000, 0b01001, 0b10111, 0b10111];
        let expected = rows.into_iter().fold(0, |bits: u64, row| bits << 5 | row);
        assert_eq!(original.codes[37][0], expected, "data 00 00 10 01 01");
        let table = include_str!("dictionaries/original.txt").lines().filter(|line| !line.starts_with('#'));
        let table: Vec<_> = table.map(|line| u64::from_str_radix(line, 16).unwrap()).collect();
        let codes: Vec<_> = original.codes.iter().map(|code| code[0]).collect();
        assert_eq!(codes, table, "as OpenCV has it");
    }

    #[test]
    fn every_marker_is_known_in_every_rotation() {
        assert_eq!(Dictionary::names().count(), 17);
        for name in Dictionary::names() {
            let dictionary = Dictionary::named(name).unwrap();
            let count = name.split_once('_').map_or(1024, |(_, count)| count.parse().unwrap());
            assert_eq!(dictionary.count(), count, "{name}");
            for (id, code) in (0..).zip(&dictionary.codes).step_by(7) {
                for (turns, bits) in code.iter().enumerate() {
                    let expected = Identity { id, turns, errors: 0 };
                    let found = dictionary.identify(*bits).unwrap();
                    assert!(
                        found == expected || dictionary.is_symmetric(id) && found.id == id,
                        "{name} {id}: {found:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn as_many_wrong_bits_as_the_dictionary_allows_are_corrected_and_no_more() {
        for name in ["4x4_50", "5x5_100", "6x6_250", "7x7_1000"] {
            let dictionary = Dictionary::named(name).unwrap();
            let (code, limit) = (dictionary.codes[17][1], dictionary.correctable);
            let wrong = |errors: u32| (0..errors).fold(code, |bits, n| bits ^ 1 << (3 * n % 16));
            assert_eq!(dictionary.identify(wrong(limit)), Some(Identity { id: 17, turns: 1, errors: limit }));
            assert_ne!(dictionary.identify(wrong(limit + 1)).map(|found| found.id), Some(17), "{name}");
        }
    }

    #[test]
    fn a_grid_between_two_markers_is_neither() {
        let dictionary = Dictionary::named("original").unwrap();
        let near = |code: &u64| {
            let turned = dictionary.codes.iter().flatten();
            turned.copied().find(|other| (other ^ code).count_ones() == 2).map(|other| (*code, other))
        };
        let (code, other) = dictionary.codes.iter().find_map(|[code, ..]| near(code)).unwrap();
        let differing = code ^ other;
        assert_eq!(dictionary.identify(code ^ (differing & differing.wrapping_neg())), None);
    }

    #[test]
    fn opencvs_names_are_understood_and_others_told() {
        assert_eq!(Dictionary::named("DICT_6X6_250").unwrap().name(), "6x6_250");
        assert_eq!(Dictionary::named("DICT_ARUCO_ORIGINAL").unwrap().name(), "original");
        let told = Dictionary::named("8x8_50").unwrap_err().to_string();
        assert!(told.contains("`8x8_50`") && told.contains("7x7_1000"), "{told}");
    }
}
