//! The b-threads of the ground station, one file each.
//!
//! Adding a b-thread: write its file, name it in [`load`].

mod delivery;
mod hold;
mod launch;
mod muster;
mod watch;

use skein_bp::Program;
use skein_wire::vocabulary::TAKEOFF;

pub use delivery::Delivery;
pub use hold::Hold;
pub use launch::Launch;
pub use muster::Muster;
pub use watch::{MissionOutcome, Watch};

use crate::GroundConfig;

/// Loads the ground station's b-threads into its program.
pub fn load(program: &mut Program, config: &GroundConfig) {
    let (ground, vehicles) = (&config.name, &config.vehicles);
    program.add(TAKEOFF, Launch::new(ground.clone(), vehicles.clone()));
    if config.muster {
        program.add("muster", Muster::new(ground.clone(), vehicles.iter().cloned()));
    }
    program.add("hold", Hold::new(ground.clone(), vehicles.clone()));
    program.add(Watch::NAME, Watch::new(ground.clone(), vehicles.iter().cloned()));
    for vehicle in vehicles {
        for what in ["resume", "land", "return", "hand_back"] {
            program.add(format!("{what} {vehicle}"), Delivery::new(ground.clone(), vehicle.clone(), what));
        }
    }
}
