//! The live table: what each vehicle does now, redrawn in place on a terminal.

use std::io::{self, IsTerminal, Stderr, Write};
use std::time::Duration;

use comfy_table::presets::UTF8_BORDERS_ONLY;
use comfy_table::{CellAlignment, ContentArrangement, Table};

/// Time between two pictures on a terminal.
const REDRAW: Duration = Duration::from_millis(200);
/// Time between two lines where the output is a file or a pipe.
const PROGRESS: Duration = Duration::from_secs(5);
/// Vehicles shown at most: with the lines around them they fit a terminal of 24 lines.
const MAX_ROWS: usize = 16;
/// Width taken where a terminal does not say.
const FALLBACK_WIDTH: u16 = 100;
/// Narrower than this, cells would be cut to nothing.
const LEAST_WIDTH: u16 = 60;

const HIDE_CURSOR: &str = "\x1b[?25l";
const SHOW_CURSOR: &str = "\x1b[?25h";
const CLEAR_BELOW: &str = "\x1b[J";

/// One vehicle's line.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Row {
    /// Name of its node, such as `uav/3`.
    pub vehicle: String,
    /// Flight mode of its autopilot.
    pub mode: String,
    pub task: String,
    pub waiting_for: String,
    /// Share of the battery's energy left, 0 to 1.
    pub battery: Option<f64>,
    /// The nearest other vehicle and the distance between the centres, in metres.
    pub nearest: Option<(String, f64)>,
}

/// The progress of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Progress {
    pub sim_time_s: f64,
    /// Simulated time over wall time.
    pub realtime_factor: f64,
    /// Events selected so far.
    pub events: u64,
    /// Messages between nodes so far.
    pub messages: u64,
    /// Vehicles that have landed at their goals.
    pub complete: usize,
    pub vehicles: usize,
}

impl Progress {
    pub fn line(&self) -> String {
        let Self { sim_time_s, realtime_factor, events, messages, complete, vehicles } = self;
        format!(
            "t {sim_time_s:.1} s  x{realtime_factor:.1} real time  complete {complete}/{vehicles}  \
             events {events}  messages {messages}"
        )
    }
}

/// Draws pictures of the swarm; the last one stays when it is dropped.
pub struct LiveTable<W: Write> {
    out: W,
    width: Option<u16>,
    /// Lines of the picture on the screen.
    drawn: usize,
    /// Wall time of the last picture.
    last: Option<Duration>,
}

impl LiveTable<Stderr> {
    /// On standard error: in place if that is a terminal, else a line every few seconds.
    pub fn stderr() -> Self {
        let width = Table::new().use_stderr().width().unwrap_or(FALLBACK_WIDTH);
        Self::new(io::stderr(), io::stderr().is_terminal().then_some(width))
    }
}

impl<W: Write> LiveTable<W> {
    /// Pictures `width` columns wide on a terminal; lines where there is no width.
    pub fn new(out: W, width: Option<u16>) -> Self {
        Self { out, width: width.map(|w| w.max(LEAST_WIDTH)), drawn: 0, last: None }
    }

    /// A picture is due; `wall` is the wall time since the run began.
    pub fn is_due(&self, wall: Duration) -> bool {
        let period = if self.width.is_some() { REDRAW } else { PROGRESS };
        self.last.is_none_or(|last| wall >= last + period)
    }

    /// Draws a picture now; see [`LiveTable::is_due`].
    pub fn draw(&mut self, wall: Duration, progress: &Progress, rows: &[Row]) -> io::Result<()> {
        self.last = Some(wall);
        let Some(width) = self.width else {
            writeln!(self.out, "{}", progress.line())?;
            return self.out.flush();
        };
        let picture = picture(width, progress, rows);
        let erase = self.erase();
        self.drawn = picture.lines().count();
        // One write, so that a terminal shows no half-drawn picture.
        write!(self.out, "{HIDE_CURSOR}{erase}{picture}")?;
        self.out.flush()
    }

    /// Writes a line above the picture, which the next [`LiveTable::draw`] brings back.
    pub fn note(&mut self, line: &str) -> io::Result<()> {
        let erase = self.erase();
        self.drawn = 0;
        writeln!(self.out, "{erase}{line}")?;
        self.out.flush()
    }

    /// Moves to the picture's first line and clears the screen from there.
    fn erase(&self) -> String {
        match (self.width, self.drawn) {
            (None, _) | (_, 0) => String::new(),
            (Some(_), lines) => format!("\x1b[{lines}A\r{CLEAR_BELOW}"),
        }
    }
}

impl<W: Write> Drop for LiveTable<W> {
    fn drop(&mut self) {
        if self.width.is_some() {
            // There is no one left to tell that the terminal is gone.
            let _ = write!(self.out, "{SHOW_CURSOR}").and_then(|()| self.out.flush());
        }
    }
}

/// The header line, a row a vehicle, and how many vehicles did not fit; each line ends with a newline.
fn picture(width: u16, progress: &Progress, rows: &[Row]) -> String {
    let mut table = Table::new();
    table.load_style(UTF8_BORDERS_ONLY);
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(width);
    table.set_header(["vehicle", "mode", "task", "waiting for", "battery", "nearest"]);
    for row in rows.iter().take(MAX_ROWS) {
        let cells = [
            row.vehicle.clone(),
            row.mode.clone(),
            row.task.clone(),
            row.waiting_for.clone(),
            row.battery.map_or_else(|| "-".to_owned(), |share| format!("{:.0} %", share * 100.0)),
            row.nearest
                .as_ref()
                .map_or_else(|| "-".to_owned(), |(who, metres)| format!("{who} {metres:.1} m")),
        ];
        let mut line = comfy_table::Row::from(cells);
        // A cell that wraps would make the picture jump.
        line.max_height(1);
        table.add_row(line);
    }
    for column in table.column_iter_mut().skip(4) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let header: String = progress.line().chars().take(width.into()).collect();
    let mut picture = format!("{header}\n{table}\n");
    let hidden = rows.len().saturating_sub(MAX_ROWS);
    if hidden > 0 {
        picture.push_str(&format!("... and {hidden} more\n"));
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROGRESS_NOW: Progress = Progress {
        sim_time_s: 12.34,
        realtime_factor: 21.0,
        events: 120,
        messages: 3400,
        complete: 1,
        vehicles: 3,
    };

    fn rows(count: usize) -> Vec<Row> {
        let row = |i: usize| Row {
            vehicle: format!("uav/{}", i + 1),
            mode: "offboard".into(),
            task: "to waypoint 1 of 1, 23.4 m to go, round a group of trees that needs a long text".into(),
            waiting_for: "uav/1/advance".into(),
            battery: Some(0.874),
            nearest: Some(("uav/2".into(), 3.21)),
        };
        (0..count).map(row).collect()
    }

    fn drawn(width: Option<u16>, pictures: usize, vehicles: usize) -> io::Result<String> {
        let mut screen = Vec::new();
        let mut table = LiveTable::new(&mut screen, width);
        for i in 0..pictures {
            table.draw(Duration::from_secs(i as u64), &PROGRESS_NOW, &rows(vehicles))?;
        }
        drop(table);
        Ok(String::from_utf8_lossy(&screen).into_owned())
    }

    #[test]
    fn the_second_picture_covers_exactly_the_lines_of_the_first() -> io::Result<()> {
        let first = picture(80, &PROGRESS_NOW, &rows(3));
        let screen = drawn(Some(80), 2, 3)?;
        let up = format!("\x1b[{}A\r{CLEAR_BELOW}", first.matches('\n').count());
        assert_eq!(screen.matches(&up).count(), 1, "{screen:?}");
        assert!(screen.ends_with(SHOW_CURSOR));
        Ok(())
    }

    #[test]
    fn no_line_is_wider_than_the_terminal_and_no_row_takes_two() {
        for width in [60, 80, 120, 200] {
            let picture = picture(width, &PROGRESS_NOW, &rows(3));
            assert!(picture.lines().all(|line| line.chars().count() <= width.into()), "{width}:\n{picture}");
            assert_eq!(picture.lines().filter(|line| line.contains("uav/")).count(), 3, "{picture}");
        }
    }

    #[test]
    fn a_row_shows_battery_and_nearest_vehicle() {
        let picture = picture(160, &PROGRESS_NOW, &rows(1));
        assert!(picture.contains("87 %") && picture.contains("uav/2 3.2 m"), "{picture}");
        assert!(picture.contains("complete 1/3") && picture.contains("t 12.3 s"), "{picture}");
    }

    #[test]
    fn a_large_swarm_fits_a_small_terminal_and_says_how_many_are_hidden() {
        let picture = picture(80, &PROGRESS_NOW, &rows(100));
        assert!(picture.lines().count() <= 23);
        assert!(picture.contains("and 84 more"));
    }

    #[test]
    fn what_is_no_terminal_gets_plain_lines_every_few_seconds() -> io::Result<()> {
        assert!(!drawn(None, 2, 3)?.contains('\x1b'));
        let mut table = LiveTable::new(Vec::new(), None);
        assert!(table.is_due(Duration::ZERO));
        table.draw(Duration::ZERO, &PROGRESS_NOW, &[])?;
        assert!(!table.is_due(Duration::from_secs(4)));
        assert!(table.is_due(Duration::from_secs(5)));
        Ok(())
    }

    #[test]
    fn a_terminal_is_redrawn_five_times_a_second() -> io::Result<()> {
        let mut table = LiveTable::new(Vec::new(), Some(80));
        table.draw(Duration::ZERO, &PROGRESS_NOW, &[])?;
        assert!(!table.is_due(Duration::from_millis(199)));
        assert!(table.is_due(Duration::from_millis(200)));
        Ok(())
    }
}
