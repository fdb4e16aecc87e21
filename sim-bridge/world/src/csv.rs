//! Worlds of boxes as comma-separated values.

use nalgebra::Vector3;
use thiserror::Error;

use crate::obstacle::Obstacle;
use crate::scene::Scene;

const FIELDS: [&str; 6] = ["x", "y", "z", "dx", "dy", "dz"];
/// Numbers beyond this are taken for mistakes, m.
const LIMIT_M: f64 = 1e6;

/// Why a box file was refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "{source_name}:{line}:{column}: {message}; a line is x,y,z,dx,dy,dz in metres (centre and size of a box)"
)]
pub struct CsvError {
    pub source_name: String,
    /// Line from 1.
    pub line: usize,
    /// Column from 1, in characters.
    pub column: usize,
    pub message: String,
}

impl Scene {
    /// Reads boxes along the world axes, one `x,y,z,dx,dy,dz` (centre and whole size, m) a line.
    /// Empty lines, lines that begin with `#`, and a first line of field names are skipped.
    /// `source_name` is what messages, and the scene, are called by.
    ///
    /// ```
    /// let scene = skein_world::Scene::from_csv("2,0,1.25,0.5,0.5,2.5\n", "forest.csv")?;
    /// assert_eq!(scene.clearance(&[0.0, 0.0, 1.0].into()), 1.75);
    /// # Ok::<(), skein_world::CsvError>(())
    /// ```
    pub fn from_csv(text: &str, source_name: &str) -> Result<Self, CsvError> {
        let mut obstacles = Vec::new();
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        for (index, line) in text.lines().enumerate() {
            let content = line.trim();
            let is_header = index == 0 && content.replace(' ', "") == FIELDS.join(",");
            if content.is_empty() || content.starts_with('#') || is_header {
                continue;
            }
            let numbers = read_line(line).map_err(|(column, message)| CsvError {
                source_name: source_name.to_owned(),
                line: index + 1,
                column,
                message,
            })?;
            let [x, y, z, dx, dy, dz] = numbers;
            obstacles.push(Obstacle::block(
                format!("box {}", obstacles.len() + 1),
                Vector3::new(x, y, z),
                Vector3::new(dx, dy, dz),
            ));
        }
        Ok(Self::new(source_name, obstacles))
    }
}

/// The numbers of a line, or the column (from 1) and what is wrong there.
fn read_line(line: &str) -> Result<[f64; 6], (usize, String)> {
    let mut numbers = [0.0; 6];
    let mut cells = line.split(',');
    let mut column = 1;
    for (field, number) in FIELDS.iter().zip(&mut numbers) {
        let Some(cell) = cells.next() else {
            let end = line.chars().count() + 1;
            return Err((end, format!("expected `{field}`, found the line's end")));
        };
        let content = cell.trim();
        let here = column + cell.chars().take_while(|c| c.is_whitespace()).count();
        let is_size = field.starts_with('d');
        *number = content
            .parse()
            .ok()
            .filter(|number: &f64| number.abs() <= LIMIT_M && (!is_size || *number > 0.0))
            .ok_or_else(|| {
                let expected = if is_size { "a size above 0" } else { "a number" };
                (here, format!("expected `{field}`, {expected}, found `{content}`"))
            })?;
        column += cell.chars().count() + 1;
    }
    match cells.next() {
        Some(_) => Err((column, "expected the line's end after `dz`".to_owned())),
        None => Ok(numbers),
    }
}
