//! The set-points of a shadow, in a file to look at after the flight.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::Path;
use std::time::Duration;

use anyhow::Context as _;
use skein_mav::SetPoint;
use skein_wire::NodeName;

use crate::core::AgentCore;

/// A line for each set-point: when, where the vehicle was and how it moved, and how it should have.
pub struct ShadowLog {
    file: BufWriter<File>,
    last: Option<Duration>,
}

impl ShadowLog {
    /// Begins the file anew beside the vehicle's state.
    pub fn create(state: &Path, vehicle: &NodeName) -> anyhow::Result<Self> {
        let path = state.join(format!("{}.set-points.csv", vehicle.as_str().replace('/', "-")));
        let mut file = BufWriter::new(File::create(&path).with_context(|| path.display().to_string())?);
        writeln!(file, "time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,set_vx_m_s,set_vy_m_s,set_vz_m_s,set_z_m")?;
        tracing::warn!("a shadow: the autopilot is told nothing; set-points go to {}", path.display());
        Ok(Self { file, last: None })
    }

    /// Writes the newest set-point, if it is not written yet. In world ENU; what a set-point leaves to the autopilot
    /// stays empty.
    pub fn write(&mut self, core: &AgentCore) -> anyhow::Result<()> {
        let Some((at, set_point, motion)) = core.last_set_point() else { return Ok(()) };
        if self.last.replace(at) == Some(at) {
            return Ok(());
        }
        write!(self.file, "{:.3}", at.as_secs_f64())?;
        for number in motion.position.iter().chain(motion.velocity.iter()) {
            write!(self.file, ",{number:.3}")?;
        }
        match set_point {
            SetPoint::Planar { vx, vy, z, .. } => writeln!(self.file, ",{vx:.3},{vy:.3},,{z:.3}")?,
            SetPoint::Velocity { velocity, .. } => {
                writeln!(self.file, ",{:.3},{:.3},{:.3},", velocity.x, velocity.y, velocity.z)?;
            }
            SetPoint::Position { position, .. } => writeln!(self.file, ",,,,{:.3}", position.z)?,
        }
        Ok(())
    }
}
