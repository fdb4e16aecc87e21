//! Lines: parallel ones over a field, and cells of them that are ploughed in one go.

use nalgebra::Vector2;

use super::field::Field;

/// Directions closer together than this are one, radians.
const SAME_DIRECTION: f64 = 0.03;
/// Directions that are tried, those of the longest edges.
const MOST_DIRECTIONS: usize = 12;

/// Vehicles turn so far before the ends of lines, metres.
const CUT_M: f64 = 0.7;

/// The ends of a line, the rear one first.
pub type Line = [Vector2<f64>; 2];

/// Lines that follow one another, side by side, so that it is open to turn from each to the next at both
/// ends.
pub type Cell = Vec<Line>;

/// A corner of a cell: of its last line, not its first; at its front end, not its rear.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corner {
    pub is_last: bool,
    pub is_front: bool,
}

impl Corner {
    pub const ALL: [Corner; 4] = [
        Corner { is_last: false, is_front: false },
        Corner { is_last: false, is_front: true },
        Corner { is_last: true, is_front: false },
        Corner { is_last: true, is_front: true },
    ];

    pub fn index(self) -> usize {
        2 * usize::from(self.is_last) + usize::from(self.is_front)
    }

    pub fn of(self, cell: &Cell) -> Vector2<f64> {
        let line = if self.is_last { cell.last() } else { cell.first() };
        line.map_or_else(Vector2::zeros, |line| line[usize::from(self.is_front)])
    }

    /// Where a cell of so many lines is left that is entered here.
    pub fn opposite(self, lines: usize) -> Corner {
        Corner { is_last: !self.is_last, is_front: self.is_front ^ !lines.is_multiple_of(2) }
    }
}

/// The way over a cell from a corner, there and back.
pub fn ploughed(cell: &Cell, from: Corner) -> Vec<Vector2<f64>> {
    let order: Vec<&Line> = if from.is_last { cell.iter().rev().collect() } else { cell.iter().collect() };
    let ends = order.into_iter().enumerate().flat_map(|(number, &[rear, front])| {
        if from.is_front ^ !number.is_multiple_of(2) { [front, rear] } else { [rear, front] }
    });
    ends.collect()
}

/// The directions in which lines may run: along the edges of the area, the longest first.
pub fn directions(corners: &[Vector2<f64>]) -> Vec<Vector2<f64>> {
    let mut edges: Vec<_> =
        corners.iter().zip(corners.iter().cycle().skip(1)).map(|(from, to)| to - from).collect();
    edges.sort_by(|one, other| other.norm().total_cmp(&one.norm()));
    let mut directions: Vec<Vector2<f64>> = Vec::new();
    for edge in edges {
        let Some(along) = edge.try_normalize(1e-6) else { continue };
        let along = if (along.x, along.y) < (0.0, 0.0) { -along } else { along };
        if directions.iter().all(|known| known.perp(&along).abs() > SAME_DIRECTION) {
            directions.push(along);
        }
    }
    directions.truncate(MOST_DIRECTIONS);
    directions
}

/// From where to where an area reaches in a direction, metres.
pub fn extent(corners: &[Vector2<f64>], direction: &Vector2<f64>) -> [f64; 2] {
    let reach = corners.iter().map(|corner| direction.dot(corner));
    [reach.clone().fold(f64::INFINITY, f64::min), reach.fold(f64::NEG_INFINITY, f64::max)]
}

/// The direction across lines.
pub fn across(along: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-along.y, along.x)
}

/// Lines along a direction in so many rows, at equal distances from edge to edge: those of each row, as far
/// as the field is open there.
pub fn rows(field: &Field<'_>, along: &Vector2<f64>, count: usize) -> Vec<Vec<Line>> {
    let (across, [rear, front]) = (across(along), extent(field.corners(), along));
    let [low, high] = extent(field.corners(), &across);
    let row = |number: usize| {
        let middle = across * (low + (high - low) * (number as f64 + 0.5) / count as f64);
        let parts = field.open_parts(&(middle + along * rear), &(middle + along * front));
        let line = |part: [f64; 2]| part.map(|at_m| middle + along * (rear + at_m));
        parts.into_iter().map(line).filter(|[rear, front]| rear != front).collect()
    };
    (0..count).map(row).collect()
}

/// The cells of rows of lines along a direction.
pub fn cells(field: &Field<'_>, along: &Vector2<f64>, rows: &[Vec<Line>]) -> Vec<Cell> {
    let beside = |one: &Line, other: &Line| {
        let [one, other] = [one, other].map(|line| line.map(|end| along.dot(&end)));
        one[0] < other[1] && other[0] < one[1]
    };
    let alone = |line: &Line, row: &[Line]| row.iter().filter(|other| beside(line, other)).count() == 1;
    let turns = |one: &Line, other: &Line| (0..2).all(|end| field.is_open(&one[end], &other[end]));
    let mut cells: Vec<Cell> = Vec::new();
    let mut before: (&[Line], Vec<usize>) = (&[], Vec::new());
    for row in rows {
        let follows = |line: &Line| {
            let known = before.0.iter().zip(&before.1).find(|(other, _)| beside(line, other))?;
            let goes_on = alone(line, before.0) && alone(known.0, row) && turns(known.0, line);
            goes_on.then_some(*known.1)
        };
        let places: Vec<Option<usize>> = row.iter().map(follows).collect();
        let mut owners = Vec::new();
        for (line, place) in row.iter().zip(places) {
            let place = place.unwrap_or_else(|| {
                cells.push(Cell::new());
                cells.len() - 1
            });
            cells[place].push(*line);
            owners.push(place);
        }
        before = (row, owners);
    }
    cells
}

/// The share of places that lie within `half_m` of a line, metres, as far as that is flown.
pub fn share_seen(places: &[Vector2<f64>], rows: &[Vec<Line>], half_m: f64) -> f64 {
    let is_seen = |place: &&Vector2<f64>| {
        rows.iter().flatten().any(|[rear, front]| {
            let way = front - rear;
            let cut = (CUT_M / way.norm()).min(0.5);
            let share = ((*place - rear).dot(&way) / way.norm_squared()).clamp(cut, 1.0 - cut);
            (rear + way * share - *place).norm_squared() <= half_m * half_m
        })
    };
    places.iter().filter(is_seen).count() as f64 / places.len().max(1) as f64
}
