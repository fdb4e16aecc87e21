//! The explanation of a vehicle: for people as text, for programs as JSON.

use std::fmt;

use serde::Serialize;

use skein_dbp::Happened;

/// A vehicle slower than this does not get anywhere, m/s.
const SLOW_M_S: f64 = 0.2;

/// Why a vehicle does what it does at a moment, and what would have to change for it to move if it stands still.
///
/// B-threads of the vehicle are named plainly, those elsewhere as `node#bthread`. Times are the listener's, in seconds.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Explanation {
    pub vehicle: String,
    pub time_s: f64,
    /// Where it is and what it does; none of one that has not been heard.
    pub situation: Option<Situation>,
    /// Its latest events, newest first.
    pub events: Vec<EventNote>,
    /// The requests for its events now, by its own b-threads and by others.
    pub requests: Vec<Request>,
    /// The limits on its motion, and whose they are.
    pub limits: Vec<String>,
    /// The changes that would let it move: one will do. Empty while it moves.
    pub changes: Vec<Change>,
    /// The doubts about all this.
    pub doubts: Vec<String>,
}

/// Where a vehicle is and what it does.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Situation {
    /// The age of this.
    pub age_s: f64,
    /// The autopilot's mode.
    pub mode: String,
    /// The vehicle's task, as it says.
    pub task: String,
    /// Whether its motors are armed.
    pub armed: bool,
    /// `under_way`, `complete` or `failed`.
    pub mission: &'static str,
    /// ENU, metres.
    pub position: [f64; 3],
    /// Metres per second.
    pub speed_m_s: f64,
    /// Since when it has not left this place; none if it moves.
    pub still_since_s: Option<f64>,
}

/// An event that has happened.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct EventNote {
    pub time_s: f64,
    /// Its name and data.
    pub event: String,
    /// Where it was decided.
    pub home: String,
    /// The b-threads that requested it; none if the node reports it.
    pub requested_by: Vec<String>,
    /// At which priority, and which requests it went before.
    pub choice: Option<String>,
}

/// Something that is requested.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Request {
    /// Its name and data.
    pub event: String,
    pub by: String,
    /// At which priority.
    pub priority: Option<i32>,
    /// The b-threads that block it at its home.
    pub blocked_by: Vec<Blocker>,
}

/// A b-thread that blocks a request.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Blocker {
    pub node: String,
    pub bthread: String,
    /// Whether it runs where it blocks.
    pub local: bool,
    /// The time since it renewed its block, if that comes from elsewhere.
    pub lease_age_s: Option<f64>,
    /// After what age the block lapses.
    pub lease_s: Option<f64>,
}

/// One reason for which a vehicle stands still, and what would end it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Change {
    /// Sentences, from the vehicle to what is behind it all.
    pub because: Vec<String>,
    /// Any of these would end it. Empty if nothing known would.
    pub needed: Vec<String>,
    /// The b-threads that wait for one another in a ring, if that is the reason.
    pub cycle: Vec<String>,
}

impl From<&Happened> for EventNote {
    fn from(happened: &Happened) -> Self {
        Self {
            time_s: happened.at.as_secs_f64(),
            event: format!("{:#}", happened.event),
            home: happened.home.to_string(),
            requested_by: happened.requested_by.iter().map(ToString::to_string).collect(),
            choice: happened.choice.as_deref().map(Into::into),
        }
    }
}

impl Explanation {
    /// The first line: what the vehicle does, where, and since when.
    pub fn headline(&self) -> String {
        let Some(situation) = &self.situation else { return format!("{}: never heard", self.vehicle) };
        let Situation { mode, task, position: [x, y, z], speed_m_s, still_since_s, age_s, .. } = situation;
        let motion = match still_since_s {
            Some(since) => {
                format!("stands still since {since:.1} s, for {:.1} s", (self.time_s - since).max(0.0))
            }
            None if *speed_m_s < SLOW_M_S => "has just come to a halt".to_owned(),
            None => format!("moves, {speed_m_s:.1} m/s"),
        };
        let old = if *age_s > 2.0 { format!(", heard {age_s:.1} s before") } else { String::new() };
        format!("{} at ({x:.1}, {y:.1}, {z:.1}) {motion}; {mode}, {task}{old}", self.vehicle)
    }
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.headline())?;
        if !self.events.is_empty() {
            writeln!(f, "  last events")?;
        }
        for event in &self.events {
            writeln!(f, "    {event}")?;
        }
        if !self.requests.is_empty() {
            writeln!(f, "  requested now")?;
        }
        for request in &self.requests {
            writeln!(f, "    {request}")?;
        }
        if !self.limits.is_empty() {
            writeln!(f, "  limits on its motion")?;
        }
        for limit in &self.limits {
            writeln!(f, "    {limit}")?;
        }
        if !self.changes.is_empty() {
            writeln!(f, "  it stands still because")?;
        }
        for change in &self.changes {
            writeln!(f, "    {change}")?;
        }
        for doubt in &self.doubts {
            writeln!(f, "  not sure: {doubt}")?;
        }
        Ok(())
    }
}

impl fmt::Display for EventNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} s {}, ", self.time_s, self.event)?;
        match self.requested_by.as_slice() {
            [] => f.write_str("which nobody requested: it is a report")?,
            names => write!(f, "requested by {}", names.join(", "))?,
        }
        self.choice.as_ref().map_or(Ok(()), |choice| write!(f, "; {choice}"))
    }
}

impl fmt::Display for Request {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} by {}", self.event, self.by)?;
        if let Some(priority) = self.priority {
            write!(f, " (priority {priority})")?;
        }
        for blocker in &self.blocked_by {
            write!(f, ", blocked by {blocker}")?;
        }
        Ok(())
    }
}

impl fmt::Display for Blocker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.local {
            return write!(f, "{} here", self.bthread);
        }
        write!(f, "{}#{}", self.node, self.bthread)?;
        match (self.lease_age_s, self.lease_s) {
            (Some(age), Some(lease)) => write!(f, " (renewed {age:.1} s ago, lease {lease:.1} s)"),
            _ => Ok(()),
        }
    }
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.because.join("; "))?;
        if !self.needed.is_empty() {
            write!(f, ".\n      It moves on when {}", self.needed.join(", or when "))?;
        }
        f.write_str(".")
    }
}
