//! The report of an experiment.

use std::fmt;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use comfy_table::{Table, presets};
use serde_json::{Map, Value, json};

use crate::figure::Figure;

/// The results of an experiment: numbers, tables, figures, and goals.
#[derive(Debug, Clone, Default)]
pub struct Report {
    numbers: Map<String, Value>,
    tables: Vec<(String, Table)>,
    figures: Vec<(String, Figure)>,
    goals: Vec<Goal>,
}

/// A goal for a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bound {
    /// This or less.
    AtMost(f64),
    /// Less than this.
    Below(f64),
    /// This or more.
    AtLeast(f64),
    Exactly(f64),
}

#[derive(Debug, Clone, PartialEq)]
struct Goal {
    what: String,
    found: f64,
    bound: Bound,
}

impl Bound {
    fn holds(self, found: f64) -> bool {
        match self {
            Self::AtMost(most) => found <= most,
            Self::Below(limit) => found < limit,
            Self::AtLeast(least) => found >= least,
            Self::Exactly(value) => found == value,
        }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AtMost(value) => write!(f, "at most {value}"),
            Self::Below(value) => write!(f, "below {value}"),
            Self::AtLeast(value) => write!(f, "at least {value}"),
            Self::Exactly(value) => write!(f, "{value}"),
        }
    }
}

impl Report {
    /// Adds a number, or a structure of numbers, to the JSON.
    pub fn number(&mut self, name: &str, value: impl Into<Value>) {
        self.numbers.insert(name.to_owned(), value.into());
    }

    /// Adds a table for people, with its columns' heads.
    pub fn table<Cell: ToString>(
        &mut self,
        title: &str,
        heads: &[&str],
        rows: impl IntoIterator<Item = Vec<Cell>>,
    ) {
        let mut table = Table::new();
        table.load_style(presets::UTF8_FULL_CONDENSED);
        table.set_header(heads);
        for row in rows {
            table.add_row(row.iter().map(Cell::to_string).collect::<Vec<_>>());
        }
        self.tables.push((title.to_owned(), table));
    }

    /// Adds a figure; `name` is its file's, without an extension.
    pub fn figure(&mut self, name: &str, figure: Figure) {
        self.figures.push((name.to_owned(), figure));
    }

    /// Says what a number must be, and what was found.
    pub fn goal(&mut self, what: &str, found: f64, bound: Bound) {
        self.goals.push(Goal { what: what.to_owned(), found, bound });
    }

    #[must_use]
    pub fn is_reached(&self) -> bool {
        self.goals.iter().all(|goal| goal.bound.holds(goal.found))
    }

    /// The numbers, and under `goals` what must be reached and whether it was.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let goals = self.goals.iter().map(|goal| {
            json!({
                "what": goal.what,
                "found": goal.found,
                "must_be": goal.bound.to_string(),
                "reached": goal.bound.holds(goal.found),
            })
        });
        let mut all = self.numbers.clone();
        all.insert("goals".to_owned(), goals.collect());
        all.insert("reached".to_owned(), self.is_reached().into());
        Value::Object(all)
    }

    /// Writes `report.json` and the figures into a folder, made if missing. Returns what was written.
    ///
    /// # Errors
    /// The file that cannot be written.
    pub fn write(&self, folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
        std::fs::create_dir_all(folder).with_context(|| {
            format!("{}: cannot be made; name another folder with --out", folder.display())
        })?;
        let figures = self.figures.iter().map(|(name, figure)| Ok((format!("{name}.svg"), figure.to_svg()?)));
        let json = std::iter::once(Ok(("report.json".to_owned(), format!("{:#}\n", self.to_json()))));
        json.chain(figures)
            .map(|file: anyhow::Result<(String, String)>| {
                let (name, text) = file?;
                let path = folder.join(name);
                std::fs::write(&path, text)
                    .with_context(|| format!("{}: cannot be written", path.display()))?;
                Ok(path)
            })
            .collect()
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (title, table) in &self.tables {
            writeln!(f, "\n{title}\n{table}")?;
        }
        if self.goals.is_empty() {
            return Ok(());
        }
        let mut table = Table::new();
        table.load_style(presets::UTF8_FULL_CONDENSED);
        table.set_header(["", "found", "must be", ""]);
        for Goal { what, found, bound } in &self.goals {
            let verdict = if bound.holds(*found) { "reached" } else { "MISSED" };
            table.add_row([what.clone(), readable(*found), bound.to_string(), verdict.to_owned()]);
        }
        writeln!(f, "\n{table}")
    }
}

/// Whole numbers as they are, others with four significant digits.
fn readable(number: f64) -> String {
    if number.fract() == 0.0 || !number.is_finite() {
        return number.to_string();
    }
    let digits = 3 - number.abs().log10().floor() as i32;
    format!("{number:.*}", digits.clamp(0, 9) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_says_of_each_goal_whether_it_was_reached() {
        let mut report = Report::default();
        report.number("ratio", 0.41);
        report.goal("ratio", 0.41, Bound::AtLeast(0.4));
        assert!(report.is_reached());
        report.goal("collisions", 1.0, Bound::Exactly(0.0));
        assert!(!report.is_reached());
        let json = report.to_json();
        assert_eq!(json["ratio"], 0.41);
        assert_eq!(json["goals"][1]["reached"], false);
        let text = report.to_string();
        assert!(text.contains("MISSED") && text.contains("at least 0.4"), "{text}");
    }

    #[test]
    fn what_is_not_a_number_reaches_nothing() {
        for bound in [Bound::AtMost(1.0), Bound::Below(1.0), Bound::AtLeast(1.0), Bound::Exactly(1.0)] {
            assert!(!bound.holds(f64::NAN), "{bound}");
        }
    }

    #[test]
    fn numbers_are_readable() {
        let texts = [0.000_123_456, 2.345_67, 15.8, 1234.5, 500.0].map(readable);
        assert_eq!(texts, ["0.0001235", "2.346", "15.80", "1234", "500"]);
    }
}
