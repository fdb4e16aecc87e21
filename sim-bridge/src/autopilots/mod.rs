//! Real autopilots in the simulated world: software-in-the-loop builds of PX4 and ArduPilot, each vehicle's in a
//! process and a folder of its own. World, physics and instruments are Skein's; time is the world's, in lockstep.

mod ardupilot;
mod companions;
mod instance;
mod legs;
mod magnetism;
pub mod make;
mod px4;

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use clap::{Args, ValueEnum as _};
use skein_world::{PositionErrors, PositionFaultKind, Simulation};

use self::ardupilot::ArduPilot;
pub use self::companions::Companions;
use self::make::Make;
use self::px4::Px4;
use crate::scenario::Scenario;

/// Before it lets itself be armed, an autopilot that has just been switched on looks for satellites for so long, s.
const TIME_TO_GET_READY_S: f64 = 60.0;

/// The autopilots of a run.
#[derive(Debug, Clone, Default, PartialEq, Args)]
pub struct Autopilots {
    /// Autopilot of all vehicles whose scenario names none.
    #[arg(long, value_enum)]
    pub autopilot: Option<Make>,
    /// PX4's program, with its `etc` beside the folder that it is in; without it, PX4s that you start are served.
    #[arg(long, value_name = "PATH")]
    pub px4: Option<PathBuf>,
    /// ArduPilot's program `arducopter`; without it, ArduCopters that you start are served.
    #[arg(long, value_name = "PATH")]
    pub ardupilot: Option<PathBuf>,
    /// Parameter file of ArduPilot's default copter; `default_params/copter.parm` beside its program otherwise.
    #[arg(long, value_name = "FILE", requires = "ardupilot")]
    pub ardupilot_defaults: Option<PathBuf>,
}

impl Autopilots {
    /// Gives each vehicle for which the scenario names no autopilot that of the command line.
    pub fn assign(&self, scenario: &mut Scenario) {
        for plan in &mut scenario.vehicles {
            plan.autopilot = plan.autopilot.or(self.autopilot);
        }
        if scenario.vehicles.iter().any(|plan| plan.make() != Make::BuiltIn) {
            scenario.time_limit_s += TIME_TO_GET_READY_S;
        }
    }

    /// The options of the command line that say the same, each after a space.
    pub fn options(&self) -> String {
        let make = self
            .autopilot
            .and_then(|make| Some(format!(" --autopilot {}", make.to_possible_value()?.get_name())));
        let files = [
            ("--px4", &self.px4),
            ("--ardupilot", &self.ardupilot),
            ("--ardupilot-defaults", &self.ardupilot_defaults),
        ];
        let files = files
            .into_iter()
            .filter_map(|(option, path)| Some(format!(" {option} {}", path.as_ref()?.display())));
        make.into_iter().chain(files).collect()
    }

    /// Seats the autopilots that the scenario's vehicles have in the simulation. Their files and logs go into folders
    /// in `folder`. They end with the simulation.
    ///
    /// # Errors
    /// A program that is missing, does not start or does not connect; a port that is taken.
    pub fn seat(
        &self,
        simulation: &mut Simulation,
        scenario: &Scenario,
        folder: &Path,
        companions: Companions,
    ) -> anyhow::Result<()> {
        let datum = *scenario.scene.datum();
        for (index, plan) in scenario.vehicles.iter().enumerate() {
            let folder = folder.join("autopilots").join(format!("uav-{}", index + 1));
            check_errors(plan.make(), &plan.position_errors)
                .with_context(|| format!("the position of uav/{}", index + 1))?;
            match plan.make() {
                Make::BuiltIn => {}
                Make::Px4 => {
                    let px4 =
                        Px4::start(index, datum, &plan.model, self.px4.as_deref(), &folder, companions)?;
                    simulation.seat(index, Box::new(px4));
                }
                Make::Ardupilot => {
                    let program = self.ardupilot.as_deref();
                    let defaults = self.ardupilot_defaults.as_deref();
                    let copter = ArduPilot::start(index, datum, &plan.model, program, defaults, &folder)?;
                    simulation.seat(index, Box::new(copter));
                }
            }
        }
        Ok(())
    }
}

/// Whether an autopilot of this make can have these errors.
fn check_errors(make: Make, errors: &PositionErrors) -> anyhow::Result<()> {
    if make == Make::BuiltIn {
        return Ok(());
    }
    ensure!(
        errors.drift.told_m.is_none(),
        "position_error.told_m: a real autopilot tells its own accuracy; leave it out"
    );
    for fault in &errors.faults {
        ensure!(
            !fault.kind.is_of_autopilot(),
            "position_fault at {:?}: a real autopilot cannot be made to; expected jump_m or gps_lost",
            fault.at
        );
        ensure!(
            make != Make::Ardupilot || fault.kind != PositionFaultKind::GpsLost,
            "position_fault at {:?}: ArduPilot makes its own satellites; expected jump_m",
            fault.at
        );
    }
    Ok(())
}
