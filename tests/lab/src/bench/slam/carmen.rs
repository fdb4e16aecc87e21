//! Reads laser scans, odometry and poses from CARMEN logs (`.clf`, `.log`), as the public 2-D recordings are written.

use std::f64::consts::PI;

use nalgebra::{Isometry2, Vector2};

/// A scan of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// The logger's time, s.
    pub time_s: f64,
    pub ranges_m: Vec<f32>,
    /// Direction of the first ray from the nose, and from a ray to the next, rad.
    pub angles: [f64; 2],
    /// Where the log says that the laser was: raw odometry in raw logs, a published solution in corrected ones.
    pub pose: Isometry2<f64>,
    /// Where odometry says that the robot was.
    pub odometry: Isometry2<f64>,
}

/// A line that is no scan although it begins like one.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error(
    "line {line} of the log: {what}; expected `FLASER count ranges x y theta odom-x odom-y odom-theta time host \
         time`, or `ROBOTLASER1` with what CARMEN writes after it"
)]
pub struct CarmenError {
    pub line: usize,
    pub what: String,
}

/// The scans of a log, in its order; other lines are passed over.
///
/// # Errors
/// The first `FLASER` or `ROBOTLASER1` line that is not whole.
pub fn read(text: &str) -> Result<Vec<Record>, CarmenError> {
    let mut records = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let mut words = Words { rest: line.split_ascii_whitespace(), line: index + 1 };
        match words.rest.next() {
            Some("FLASER") => records.push(front_laser(&mut words)?),
            Some("ROBOTLASER1") => records.push(robot_laser(&mut words)?),
            _ => {}
        }
    }
    Ok(records)
}

struct Words<'a> {
    rest: std::str::SplitAsciiWhitespace<'a>,
    line: usize,
}

impl Words<'_> {
    fn number(&mut self, of: &str) -> Result<f64, CarmenError> {
        let word = self.rest.next().unwrap_or("nothing");
        let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| CarmenError { line: self.line, what: format!("`{word}` is no {of}") })
    }

    fn count(&mut self) -> Result<usize, CarmenError> {
        let count = self.number("count")?;
        let is_sound = (0.0..=100_000.0).contains(&count);
        let what = || format!("a count of {count} is not between 0 and 100000");
        is_sound.then_some(count as usize).ok_or_else(|| CarmenError { line: self.line, what: what() })
    }

    fn ranges(&mut self) -> Result<Vec<f32>, CarmenError> {
        let count = self.count()?;
        (0..count).map(|_| Ok(self.number("range")? as f32)).collect()
    }

    fn pose(&mut self) -> Result<Isometry2<f64>, CarmenError> {
        let [x, y, heading] = [self.number("x")?, self.number("y")?, self.number("theta")?];
        Ok(Isometry2::new(Vector2::new(x, y), heading))
    }
}

fn front_laser(words: &mut Words<'_>) -> Result<Record, CarmenError> {
    let ranges_m = words.ranges()?;
    let (pose, odometry) = (words.pose()?, words.pose()?);
    let time_s = words.number("time")?;
    // Half a turn, and its end either counted or not.
    let step = PI / (ranges_m.len() / 90 * 90).max(1) as f64;
    Ok(Record { time_s, ranges_m, angles: [-PI / 2.0, step], pose, odometry })
}

fn robot_laser(words: &mut Words<'_>) -> Result<Record, CarmenError> {
    words.number("laser type")?;
    let start = words.number("start angle")?;
    words.number("field of view")?;
    let step = words.number("angular resolution")?;
    for of in ["greatest range", "accuracy", "remission mode"] {
        words.number(of)?;
    }
    let ranges_m = words.ranges()?;
    for _ in 0..words.count()? {
        words.number("remission")?;
    }
    let (pose, odometry) = (words.pose()?, words.pose()?);
    for of in ["laser_tv", "laser_rv", "forward safety", "side safety", "turn axis"] {
        words.number(of)?;
    }
    let time_s = words.number("time")?;
    Ok(Record { time_s, ranges_m, angles: [start, step], pose, odometry })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_kinds_of_scans_are_read_and_other_lines_passed_over() {
        let text = "# a comment\nODOM 1 2 3\nFLASER 3 1.5 2 81.9 1 2 0.5 1.1 2.1 0.6 12.5 host 12.6\n\
                    ROBOTLASER1 0 -1.57 3.14 1.57 50 0.01 0 2 4 5 1 9 7 8 0.1 7.1 8.1 0.2 0 0 1 1 0 33.5 host 33.6\n";
        let records = read(text).unwrap();
        assert_eq!(records.len(), 2);
        assert_eq!(records[0].ranges_m, [1.5, 2.0, 81.9]);
        assert_eq!(records[0].pose, Isometry2::new(Vector2::new(1.0, 2.0), 0.5));
        assert_eq!((records[0].time_s, records[1].time_s), (12.5, 33.5));
        assert_eq!((records[1].angles, records[1].ranges_m.as_slice()), ([-1.57, 1.57], &[4.0, 5.0][..]));
        assert_eq!(records[1].odometry, Isometry2::new(Vector2::new(7.1, 8.1), 0.2));
        let half_turn = read(&format!("FLASER 180 {} 0 0 0 0 0 0 1 h 1", "1 ".repeat(180))).unwrap();
        assert!((half_turn[0].angles[1] - PI / 180.0).abs() < 1e-12);
    }

    #[test]
    fn a_broken_scan_is_named() {
        for (line, what) in [
            ("FLASER 3 1 2", "`nothing` is no range"),
            ("FLASER x", "`x` is no count"),
            ("FLASER -1", "a count of -1 is not between 0 and 100000"),
            ("FLASER 1e9", "a count of 1000000000 is not between 0 and 100000"),
            ("FLASER 1 NaN", "`NaN` is no range"),
        ] {
            let text = format!("ODOM\n{line}\n");
            assert_eq!(read(&text), Err(CarmenError { line: 2, what: what.to_owned() }));
        }
    }
}
