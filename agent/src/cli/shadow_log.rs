//! The set-points of a shadow, in a file to look at after the flight.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context as _;
use skein_disk::Room;
use skein_mav::SetPoint;
use skein_wire::NodeName;

use crate::positioning::Motion;

/// A line for each set-point: when, where the vehicle was and how it moved, and how it should have.
pub struct ShadowLog {
    file: BufWriter<File>,
    path: PathBuf,
    room: Room,
    is_full: bool,
}

/// The greatest size of the file, bytes: ten hours.
const MOST_BYTES: u64 = 128 << 20;

impl ShadowLog {
    /// Begins the file anew beside the vehicle's state.
    pub fn create(state: &Path, vehicle: &NodeName) -> anyhow::Result<Self> {
        let path = state.join(format!("{}.set-points.csv", vehicle.as_str().replace('/', "-")));
        let mut file = BufWriter::new(File::create(&path).with_context(|| path.display().to_string())?);
        writeln!(file, "time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,set_vx_m_s,set_vy_m_s,set_vz_m_s,set_z_m")?;
        tracing::warn!("a shadow: the autopilot is told nothing; set-points go to {}", path.display());
        let room = Room::new(&path, MOST_BYTES);
        Ok(Self { file, path, room, is_full: false })
    }

    /// Writes a set-point, made at this time of a vehicle that moved like this. In world ENU; what a
    /// set-point leaves to the autopilot stays empty. The file grows to its greatest size and no further.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&mut self, at: Duration, set_point: &SetPoint, motion: &Motion) -> anyhow::Result<()> {
        if !self.has_room() {
            return Ok(());
        }
        let mut line = format!("{:.3}", at.as_secs_f64());
        for number in motion.position.iter().chain(motion.velocity.iter()) {
            write!(line, ",{number:.3}")?;
        }
        match set_point {
            SetPoint::Planar { vx, vy, z, .. } => writeln!(line, ",{vx:.3},{vy:.3},,{z:.3}")?,
            SetPoint::Velocity { velocity, .. } => {
                writeln!(line, ",{:.3},{:.3},{:.3},", velocity.x, velocity.y, velocity.z)?;
            }
            SetPoint::Position { position, .. } => writeln!(line, ",,,,{:.3}", position.z)?,
        }
        self.room.take(line.len());
        self.file.write_all(line.as_bytes()).with_context(|| self.path.display().to_string())
    }

    fn has_room(&mut self) -> bool {
        let full = self.room.is_full();
        if let Some(why) = full.filter(|_| !std::mem::replace(&mut self.is_full, true)) {
            tracing::warn!("{}: no more set-points are written down: {why}", self.path.display());
        }
        !self.is_full
    }
}
