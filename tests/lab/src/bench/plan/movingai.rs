//! Benchmark maps and problems as the Moving AI lab publishes them: `.map` and `.scen` (Sturtevant 2012) in the plane,
//! `.3dmap` and `.3dscen` (Brewer and Sturtevant 2018) in space.

use skein_planning::grid::OccupancyGrid;
use skein_planning::map::VoxelIndex;

/// A way to find, and how long the shortest is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Problem {
    pub start: VoxelIndex,
    pub goal: VoxelIndex,
    /// The published length of the shortest way, in cells, under
    /// [`StepCosts::EUCLIDEAN`](skein_planning::grid::StepCosts::EUCLIDEAN).
    pub length: f64,
}

/// A fault in a file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: found {found}, expected {expected}")]
pub struct FormatError {
    /// The line, from 1.
    pub line: usize,
    pub found: String,
    pub expected: String,
}

/// More of a line than this is not repeated in an error.
const QUOTED: usize = 40;

/// The lines of a file that are not blank, with their numbers.
struct Lines<'a> {
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
    /// Number of the line read last.
    number: usize,
}

impl<'a> Lines<'a> {
    fn of(text: &'a str) -> Self {
        Lines { lines: text.lines().enumerate(), number: 0 }
    }

    fn expect(&mut self, expected: &str) -> Result<&'a str, FormatError> {
        self.next().ok_or_else(|| FormatError {
            line: self.number + 1,
            found: "the end of the file".to_owned(),
            expected: expected.to_owned(),
        })
    }

    /// The line read last is wrong.
    fn error(&self, found: impl Into<String>, expected: impl Into<String>) -> FormatError {
        FormatError { line: self.number, found: found.into(), expected: expected.into() }
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = &'a str;

    fn next(&mut self) -> Option<&'a str> {
        for (index, line) in self.lines.by_ref() {
            if !line.trim().is_empty() {
                self.number = index + 1;
                return Some(line.trim_end());
            }
        }
        None
    }
}

/// A piece of a line, in quotation marks.
fn quoted(text: &str) -> String {
    let short: String = text.chars().take(QUOTED).collect();
    if short.len() < text.len() { format!("`{short}...`") } else { format!("`{short}`") }
}

/// Reads a map: a `.3dmap` if its first line begins with `voxel`, else a `.map`.
///
/// In a `.map`, `.`, `G` and `S` are free, `@`, `O`, `T` and `W` blocked.
///
/// # Errors
/// The first line at fault.
pub fn map(text: &str) -> Result<OccupancyGrid, FormatError> {
    let mut lines = Lines::of(text);
    let first = lines.expect("`type octile` or `voxel X Y Z`")?;
    if first.starts_with("voxel") { voxels(first, lines) } else { rows(first, lines) }
}

fn rows(first: &str, mut lines: Lines<'_>) -> Result<OccupancyGrid, FormatError> {
    if first.split_whitespace().ne(["type", "octile"]) {
        return Err(lines.error(quoted(first), "`type octile` or `voxel X Y Z`"));
    }
    let [height, width] = [side(&mut lines, "height")?, side(&mut lines, "width")?];
    let mut grid = sized(&lines, [width, height, 1])?;
    let head = lines.expect("`map`")?;
    if head != "map" {
        return Err(lines.error(quoted(head), "`map`"));
    }
    for y in 0..height {
        let row = lines.expect(&format!("row {} of {height}", y + 1))?;
        let count = row.chars().count();
        if count != width {
            return Err(lines.error(format!("a row of {count} cells"), format!("{width}")));
        }
        for (x, cell) in row.chars().enumerate() {
            let blocked = match cell {
                '.' | 'G' | 'S' => false,
                '@' | 'O' | 'T' | 'W' => true,
                _ => {
                    let found = format!("{cell:?} in column {}", x + 1);
                    return Err(lines.error(found, "one of `.`, `G`, `S`, `@`, `O`, `T`, `W`"));
                }
            };
            grid.set_blocked(VoxelIndex { x, y, z: 0 }, blocked);
        }
    }
    end(lines, grid)
}

/// The count in a line such as `height 32`.
fn side(lines: &mut Lines<'_>, name: &str) -> Result<usize, FormatError> {
    let expected = format!("`{name}` with a number of cells");
    let line = lines.expect(&expected)?;
    let count = line.strip_prefix(name).and_then(|count| count.trim().parse().ok());
    count.ok_or_else(|| lines.error(quoted(line), expected))
}

fn voxels(first: &str, mut lines: Lines<'_>) -> Result<OccupancyGrid, FormatError> {
    let [nx, ny, nz] = counts(first.strip_prefix("voxel").unwrap_or_default())
        .ok_or_else(|| lines.error(quoted(first), "`voxel X Y Z` with numbers of cells"))?;
    let mut grid = sized(&lines, [nx, ny, nz])?;
    while let Some(line) = lines.next() {
        let expected = || format!("a blocked cell as `x y z` below {nx} {ny} {nz}");
        let [x, y, z] = counts(line).ok_or_else(|| lines.error(quoted(line), expected()))?;
        let cell = VoxelIndex { x, y, z };
        if !grid.contains(cell) {
            return Err(lines.error(quoted(line), expected()));
        }
        grid.set_blocked(cell, true);
    }
    Ok(grid)
}

fn sized(lines: &Lines<'_>, size: [usize; 3]) -> Result<OccupancyGrid, FormatError> {
    let [x, y, z] = size;
    OccupancyGrid::new(size).map_err(|_| {
        lines.error(
            format!("a map of {x} x {y} x {z} cells"),
            "1 to 2,000,000 along each axis, and no more in all than 256 MB hold at a bit for each",
        )
    })
}

fn end(mut lines: Lines<'_>, grid: OccupancyGrid) -> Result<OccupancyGrid, FormatError> {
    match lines.next() {
        Some(line) => Err(lines.error(quoted(line), "the end of the file after the last row")),
        None => Ok(grid),
    }
}

/// The numbers in a line, if they are so many.
fn counts<const N: usize>(line: &str) -> Option<[usize; N]> {
    let numbers: Option<Vec<usize>> = line.split_whitespace().map(|number| number.parse().ok()).collect();
    numbers?.try_into().ok()
}

/// Reads the problems of a scenario for a map: of a `.scen` if the map has one layer, else of a `.3dscen`.
///
/// # Errors
/// The first line at fault; also one that begins or ends where the map is blocked, or that is meant for a map of
/// another size.
pub fn problems(text: &str, grid: &OccupancyGrid) -> Result<Vec<Problem>, FormatError> {
    let mut lines = Lines::of(text);
    let version = lines.expect("`version 1`")?;
    let number = version.strip_prefix("version").and_then(|number| number.trim().parse::<f64>().ok());
    if number != Some(1.0) {
        return Err(lines.error(quoted(version), "`version 1`"));
    }
    let is_flat = grid.size()[2] == 1;
    if !is_flat {
        lines.expect("the map's name")?;
    }
    let mut problems = Vec::new();
    while let Some(line) = lines.next() {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let problem = if is_flat { plane(&fields, &lines, grid)? } else { space(&fields, &lines)? };
        for (what, cell) in [("start", problem.start), ("goal", problem.goal)] {
            if grid.is_blocked(cell) {
                let VoxelIndex { x, y, z } = cell;
                let found = format!("a {what} at {x} {y} {z}, which is blocked or outside");
                return Err(lines.error(found, "a free cell of the map"));
            }
        }
        if !(problem.length >= 0.0 && problem.length.is_finite()) {
            return Err(lines.error(format!("a length of {}", problem.length), "0 or more"));
        }
        problems.push(problem);
    }
    Ok(problems)
}

fn plane(fields: &[&str], lines: &Lines<'_>, grid: &OccupancyGrid) -> Result<Problem, FormatError> {
    let expected = "`bucket map width height start-x start-y goal-x goal-y length`";
    let wrong = || lines.error(quoted(&fields.join(" ")), expected);
    let [_, _, cells @ .., length] = fields else { return Err(wrong()) };
    let [width, height, sx, sy, gx, gy] = counts(&cells.join(" ")).ok_or_else(wrong)?;
    let [nx, ny, _] = grid.size();
    if [width, height] != [nx, ny] {
        let found = format!("a problem for a map of {width} x {height} cells");
        return Err(lines.error(found, format!("{nx} x {ny}, as the map has")));
    }
    Ok(Problem {
        start: VoxelIndex { x: sx, y: sy, z: 0 },
        goal: VoxelIndex { x: gx, y: gy, z: 0 },
        length: length.parse().map_err(|_| wrong())?,
    })
}

fn space(fields: &[&str], lines: &Lines<'_>) -> Result<Problem, FormatError> {
    let expected = "`start-x start-y start-z goal-x goal-y goal-z length ratio`";
    let wrong = || lines.error(quoted(&fields.join(" ")), expected);
    let [cells @ .., length, ratio] = fields else { return Err(wrong()) };
    let [sx, sy, sz, gx, gy, gz] = counts(&cells.join(" ")).ok_or_else(wrong)?;
    ratio.parse::<f64>().map_err(|_| wrong())?;
    Ok(Problem {
        start: VoxelIndex { x: sx, y: sy, z: sz },
        goal: VoxelIndex { x: gx, y: gy, z: gz },
        length: length.parse().map_err(|_| wrong())?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAP: &str = "type octile\nheight 2\nwidth 3\nmap\n.@G\r\nTS.\n";
    const VOXELS: &str = "voxel 3 2 2\n1 0 1\n2 1 0\n";

    fn cell(x: usize, y: usize, z: usize) -> VoxelIndex {
        VoxelIndex { x, y, z }
    }

    #[test]
    fn maps_in_the_plane_and_in_space_are_read() {
        let grid = map(MAP).unwrap();
        assert_eq!(grid.size(), [3, 2, 1]);
        let blocked = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)];
        assert_eq!(
            blocked.map(|(x, y)| grid.is_blocked(cell(x, y, 0))),
            [false, true, false, true, false, false]
        );
        let grid = map(VOXELS).unwrap();
        assert_eq!(grid.size(), [3, 2, 2]);
        assert!(grid.is_blocked(cell(1, 0, 1)) && grid.is_blocked(cell(2, 1, 0)));
        assert!(!grid.is_blocked(cell(1, 0, 0)));
    }

    #[test]
    fn problems_are_read() {
        let grid = map(MAP).unwrap();
        let read = problems("version 1.0\n0\ta.map\t3\t2\t0\t0\t2\t1\t3.41\n\n", &grid).unwrap();
        assert_eq!(read, [Problem { start: cell(0, 0, 0), goal: cell(2, 1, 0), length: 3.41 }]);
        let grid = map(VOXELS).unwrap();
        let read = problems("version 1\na.3dmap\n0 0 0 2 1 1 2.5 1.0\n", &grid).unwrap();
        assert_eq!(read, [Problem { start: cell(0, 0, 0), goal: cell(2, 1, 1), length: 2.5 }]);
    }

    #[test]
    fn what_is_malformed_is_told_with_its_line() {
        for (text, line, expected) in [
            ("", 1, "type octile"),
            ("type hexagonal\n", 1, "type octile"),
            ("type octile\nheight x\n", 2, "`height`"),
            ("type octile\nheight 2\nheight 3\n", 3, "`width`"),
            ("type octile\nheight 2\nwidth 3\n...\n", 4, "`map`"),
            ("type octile\nheight 2\nwidth 3\nmap\n...\n", 6, "row 2 of 2"),
            ("type octile\nheight 2\nwidth 3\nmap\n...\n..\n", 6, "3"),
            ("type octile\nheight 1\nwidth 3\nmap\n.x.\n", 5, "one of"),
            ("type octile\nheight 1\nwidth 3\nmap\n...\n...\n", 6, "the end"),
            ("type octile\nheight 0\nwidth 3\nmap\n", 3, "256 MB"),
            ("voxel 100000 100000 100000\n", 1, "256 MB"),
            ("voxel 3 -1 2\n", 1, "`voxel X Y Z`"),
            ("voxel 3 3 3\n1 1\n", 2, "x y z"),
            ("voxel 3 3 3\n1 1 1\n\n1 3 1\n", 4, "below 3 3 3"),
        ] {
            let error = map(text).unwrap_err();
            assert_eq!(error.line, line, "{text:?}: {error}");
            assert!(error.expected.contains(expected), "{text:?}: {error}");
        }
        let (flat, deep) = (map(MAP).unwrap(), map(VOXELS).unwrap());
        for (text, grid, line, expected) in [
            ("", &flat, 1, "version 1"),
            ("version 2\n", &flat, 1, "version 1"),
            ("version 1\n0 a 3 2 0 0 2 1\n", &flat, 2, "bucket"),
            ("version 1\n0 a 3 2 0 0 2 1 far\n", &flat, 2, "bucket"),
            ("version 1\n0 a 3 2 0 0 2 1 inf\n", &flat, 2, "0 or more"),
            ("version 1\n0 a 4 2 0 0 2 1 3\n", &flat, 2, "3 x 2"),
            ("version 1\n0 a 3 2 1 0 2 1 3\n", &flat, 2, "free cell"),
            ("version 1\n0 a 3 2 0 0 2 9 3\n", &flat, 2, "free cell"),
            ("version 1\n", &deep, 2, "name"),
            ("version 1\nname\n0 0 0 2 1 1 2.5\n", &deep, 3, "ratio"),
        ] {
            let error = problems(text, grid).unwrap_err();
            assert_eq!(error.line, line, "{text:?}: {error}");
            assert!(error.expected.contains(expected), "{text:?}: {error}");
        }
    }
}
