//! Control's lines, written down on a thread that may wait for a disk or a terminal.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

use skein_mav::{SetPoint, Severity, Text};

use super::shadow_log::ShadowLog;
use crate::positioning::Motion;

/// So many lines may wait; more are passed over.
const MOST_LINES: usize = 256;

/// Something to be written down.
pub enum Line {
    /// Of the autopilot.
    Text(Text),
    Warning(String),
    /// For a shadow's log.
    SetPoint(Box<(Duration, SetPoint, Motion)>),
}

/// Takes lines and never waits. Cloning gives another way to the same log.
#[derive(Clone)]
pub struct Log(SyncSender<Line>);

impl Log {
    /// A log with its thread, which ends with its last handle.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn open(shadow: Option<ShadowLog>) -> std::io::Result<Self> {
        let (put, lines) = sync_channel(MOST_LINES);
        std::thread::Builder::new().name("log".into()).spawn(move || write(&lines, shadow))?;
        Ok(Self(put))
    }

    pub fn put(&self, line: Line) {
        // A line more or less; whoever waits for a full disk would wait for long.
        let _ = self.0.try_send(line);
    }

    pub fn warn(&self, line: impl Into<String>) {
        self.put(Line::Warning(line.into()));
    }
}

fn write(lines: &Receiver<Line>, mut shadow: Option<ShadowLog>) {
    for line in lines {
        match line {
            Line::Text(text) => tell(&text),
            Line::Warning(line) => tracing::warn!("{line}"),
            Line::SetPoint(made) => {
                let (at, set_point, motion) = *made;
                if let Some(log) = &mut shadow
                    && let Err(error) = log.write(at, &set_point, &motion)
                {
                    tracing::error!("{error:#}; the flight goes on, and no more set-points are written down");
                    shadow = None;
                }
            }
        }
    }
}

fn tell(Text { severity, text }: &Text) {
    match severity {
        Severity::Emergency | Severity::Alert | Severity::Critical | Severity::Error => {
            tracing::error!("autopilot: {text}");
        }
        Severity::Warning => tracing::warn!("autopilot: {text}"),
        Severity::Notice | Severity::Info => tracing::info!("autopilot: {text}"),
        Severity::Debug => tracing::debug!("autopilot: {text}"),
    }
}
