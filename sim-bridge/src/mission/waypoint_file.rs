//! `QGC WPL 110`: the text files of Mission Planner and MAVProxy, a row for each item, of which the first is
//! home.

use skein_mav::Datum;

use super::item::{Item, Origin, Part};
use super::route::Draft;
use super::{Account, Allowances, MissionError, command};
use crate::element::Verdict;

/// The first words of such a file.
pub const HEADING: &str = "QGC WPL";
/// The version that is read; its predecessor lacks a column.
const VERSION: &str = "110";
const COLUMNS: usize = 12;

/// Reads the rows of a file whose text begins with [`HEADING`]; see
/// [`MissionSet::read`](super::MissionSet::read).
pub fn read(
    text: &str,
    file: &str,
    datum: Option<Datum>,
    allowances: Allowances,
) -> Result<Account, MissionError> {
    let version = text.lines().next().unwrap_or_default().trim_start_matches('\u{feff}').trim();
    let version = version.strip_prefix(HEADING).unwrap_or_default().trim();
    if version != VERSION {
        return Err(wrong(file, 1, "heading", "`QGC WPL 110`", version));
    }
    let rows: Vec<_> = text.lines().enumerate().skip(1).filter(|(_, row)| !row.trim().is_empty()).collect();
    let Some(((index, home), rows)) = rows.split_first() else {
        return Err(wrong(file, 1, "rows", "home and at least one item", "none"));
    };
    let home = item(home, file, index + 1, 0)?;
    let [latitude, longitude, height_m] = [home.params[4], home.params[5], home.params[6]];
    if latitude.abs() > 90.0 || longitude.abs() > 180.0 {
        return Err(home.origin.error(Part::Parameter(4), "home within 90 and 180 degrees", "one beyond"));
    }
    let mut draft = Draft::new(latitude, longitude, Some(height_m), datum, allowances);
    draft.element("row 0: home".to_owned(), index + 1, Verdict::Honoured, "");
    let mut items = Vec::new();
    for (index, row) in rows {
        if draft.is_hopeless() {
            break;
        }
        let element = draft.element(format!("row {}", items.len() + 1), index + 1, Verdict::Harmless, "");
        match item(row, file, index + 1, element) {
            Ok(item) => {
                draft.elements[element].what.push_str(&format!(": {}", command::in_words(item.command)));
                items.push(item);
            }
            Err(error) => draft.refuse(element, error),
        }
    }
    draft.fly(&items);
    let none = || wrong(file, 1, "rows", "at least one waypoint (command 16)", "none");
    let (draft, flown) = draft.finish(none);
    Ok(Account::of(draft, vec![flown]))
}

/// Index, current, frame, command, seven parameters, continue.
fn item<'a>(row: &str, file: &'a str, line: usize, element: usize) -> Result<Item<'a>, MissionError> {
    let columns: Vec<&str> = row.split_whitespace().collect();
    if columns.len() != COLUMNS {
        return Err(wrong(file, line, "row", "12 columns", &columns.len().to_string()));
    }
    let number = |index: usize| -> Result<f64, MissionError> {
        let text = columns[index];
        let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| wrong(file, line, &format!("column {}", index + 1), "a number", text))
    };
    let whole = |index: usize| -> Result<u64, MissionError> {
        let text = columns[index];
        let or_none = |_| wrong(file, line, &format!("column {}", index + 1), "a whole number", text);
        text.parse::<u64>().map_err(or_none)
    };
    let mut params = [0.0; 7];
    for (index, param) in params.iter_mut().enumerate() {
        *param = number(index + 4)?;
    }
    Ok(Item {
        origin: Origin::Row { file, line },
        command: whole(3)?,
        frame: whole(2)?,
        params,
        number: whole(0)?,
        element,
        scan: None,
        follows_terrain: false,
    })
}

fn wrong(file: &str, line: usize, field: &str, expected: &str, found: &str) -> MissionError {
    MissionError::Field {
        file: file.to_owned(),
        line,
        field: field.to_owned(),
        expected: expected.to_owned(),
        found: found.to_owned(),
    }
}
