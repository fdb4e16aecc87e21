//! PCD, the files of the Point Cloud Library: text, bytes, or packed bytes.

use super::{Cloud, MOST_POINTS, lzf};

/// The columns of a file, as its head states them.
#[derive(Debug, Default)]
struct Head {
    fields: Vec<String>,
    sizes: Vec<usize>,
    types: Vec<String>,
    counts: Vec<usize>,
    points: Option<usize>,
}

/// A field that is a coordinate.
#[derive(Debug, Clone, Copy)]
struct Column {
    /// Numbers, and bytes, of a point before it.
    number: usize,
    byte: usize,
    is_double: bool,
}

pub(super) fn read(bytes: &[u8]) -> Result<Cloud, String> {
    let mut head = Head::default();
    let mut at = 0;
    let mut lines = 0;
    loop {
        let rest = bytes.get(at..).unwrap_or_default();
        let end =
            rest.iter().position(|byte| *byte == b'\n').ok_or("there is no line that begins with DATA")?;
        let line = String::from_utf8_lossy(rest.get(..end).unwrap_or_default()).into_owned();
        (at, lines) = (at + end + 1, lines + 1);
        let mut words = line.split_whitespace();
        let (key, words) = (words.next().unwrap_or_default(), words);
        if key == "DATA" {
            let kind = words.collect::<String>();
            return head.read_data(&kind, bytes.get(at..).unwrap_or_default(), lines).map(of_points);
        }
        head.take(key, words.map(str::to_owned).collect()).ok_or_else(|| {
            format!(
                "line {lines}: expected numbers after {key}, at most {MOST_POINTS} of POINTS, found `{line}`"
            )
        })?;
    }
}

fn of_points(points: Vec<[f64; 3]>) -> Cloud {
    Cloud { points, triangles: Vec::new() }
}

impl Head {
    fn take(&mut self, key: &str, words: Vec<String>) -> Option<()> {
        let numbers = || -> Option<Vec<usize>> {
            words.iter().map(|word| word.parse::<usize>().ok().filter(|number| *number <= 1 << 16)).collect()
        };
        match key {
            "FIELDS" | "COLUMNS" => self.fields = words,
            "SIZE" => self.sizes = numbers()?,
            "TYPE" => self.types = words,
            "COUNT" => self.counts = numbers()?,
            "POINTS" => {
                self.points = Some(words.first()?.parse().ok().filter(|number| *number <= MOST_POINTS)?)
            }
            _ => {}
        }
        Some(())
    }

    fn count(&self, field: usize) -> usize {
        self.counts.get(field).copied().unwrap_or(1)
    }

    fn size(&self, field: usize) -> usize {
        self.sizes.get(field).copied().unwrap_or(4)
    }

    fn column(&self, name: &str) -> Result<Column, String> {
        let field = self.fields.iter().position(|field| field == name);
        let field =
            field.ok_or_else(|| format!("expected x, y and z among the FIELDS, found {:?}", self.fields))?;
        let is_number = self.types.get(field).is_none_or(|kind| kind == "F");
        if !is_number || ![4, 8].contains(&self.size(field)) {
            return Err(format!("expected `{name}` of TYPE F and SIZE 4 or 8"));
        }
        Ok(Column {
            number: (0..field).map(|before| self.count(before)).sum(),
            byte: (0..field).map(|before| self.count(before) * self.size(before)).sum(),
            is_double: self.size(field) == 8,
        })
    }

    fn read_data(&self, kind: &str, data: &[u8], lines: usize) -> Result<Vec<[f64; 3]>, String> {
        let columns = [self.column("x")?, self.column("y")?, self.column("z")?];
        let points = self.points.ok_or("there is no line that begins with POINTS")?;
        let width: usize = (0..self.fields.len()).map(|field| self.count(field) * self.size(field)).sum();
        match kind {
            "ascii" => read_text(&columns, data, lines),
            "binary" => {
                let cells = |column: &Column, point: usize| point * width + column.byte;
                read_bytes(&columns, data, points, points * width, cells)
            }
            "binary_compressed" => {
                let plain = unpack(data, points * width)?;
                let cells = |column: &Column, point: usize| {
                    column.byte * points + point * if column.is_double { 8 } else { 4 }
                };
                read_bytes(&columns, &plain, points, plain.len(), cells)
            }
            _ => Err(format!("expected DATA ascii, binary or binary_compressed, found `{kind}`")),
        }
    }
}

fn read_text(columns: &[Column; 3], data: &[u8], before: usize) -> Result<Vec<[f64; 3]>, String> {
    let mut points = Vec::new();
    for (line, row) in String::from_utf8_lossy(data).lines().enumerate() {
        if row.trim().is_empty() {
            continue;
        }
        let number = |column: &Column| row.split_whitespace().nth(column.number)?.parse::<f64>().ok();
        let [x, y, z] = columns.each_ref().map(number);
        let (Some(x), Some(y), Some(z)) = (x, y, z) else {
            return Err(format!(
                "line {}: expected the numbers of a point, found `{row}`",
                before + line + 1
            ));
        };
        points.push([x, y, z]);
    }
    Ok(points)
}

fn unpack(data: &[u8], expected: usize) -> Result<Vec<u8>, String> {
    let size =
        |at: usize| data.get(at..at + 4)?.try_into().ok().map(|size| u32::from_le_bytes(size) as usize);
    let (packed, plain) = size(0).zip(size(4)).ok_or("it is cut off after DATA")?;
    if plain != expected {
        return Err(format!("it unpacks to {plain} bytes, expected {expected} of so many POINTS"));
    }
    let packed = data.get(8..8 + packed).ok_or("it is cut off within its packed bytes")?;
    lzf::unpack(packed, plain).ok_or_else(|| "its packed bytes are damaged".to_owned())
}

fn read_bytes(
    columns: &[Column; 3],
    data: &[u8],
    points: usize,
    expected: usize,
    cell: impl Fn(&Column, usize) -> usize,
) -> Result<Vec<[f64; 3]>, String> {
    if data.len() < expected {
        return Err(format!("it is cut off: expected {expected} bytes of points, found {}", data.len()));
    }
    let number = |column: &Column, point: usize| {
        let at = cell(column, point);
        let double = || Some(f64::from_le_bytes(data.get(at..at + 8)?.try_into().ok()?));
        let single = || Some(f64::from(f32::from_le_bytes(data.get(at..at + 4)?.try_into().ok()?)));
        if column.is_double { double() } else { single() }
    };
    let point = |point: usize| {
        Some([number(&columns[0], point)?, number(&columns[1], point)?, number(&columns[2], point)?])
    };
    Ok((0..points).filter_map(point).collect())
}
