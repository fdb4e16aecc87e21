//! The b-threads of the ground station, one file each.
//!
//! Adding a b-thread: write its file, name it in [`load`]. One in a crate of one's own is a
//! [`Behaviour`](skein_bp::behaviour::Behaviour).

mod delivery;
mod hold;
mod launch;
mod muster;
pub mod roll_call;
mod script_delivery;
mod together;
mod watch;

use skein_bp::Program;

pub use delivery::{Delivery, GOING_LASTS};
pub use hold::Hold;
pub use launch::Launch;
pub use muster::Muster;
pub use roll_call::RollCall;
pub use script_delivery::ScriptDelivery;
pub use together::{LAUNCH_LASTS, Together};
pub use watch::{MissionOutcome, Watch};

use crate::config::GroundConfig;

/// Loads the ground station's b-threads into its program.
pub fn load(program: &mut Program, config: &GroundConfig) {
    let (ground, vehicles) = (&config.name, &config.vehicles);
    program.add("roll_call", RollCall::new(ground.clone(), vehicles.clone()));
    program.add(Launch::NAME, Launch::new(ground.clone(), config.launch_on_order));
    program.add("together", Together::new(ground.clone()));
    if config.muster {
        program.add("muster", Muster::new(ground.clone(), vehicles.iter().cloned()));
    }
    program.add(Hold::NAME, Hold::new(ground.clone(), vehicles.clone()));
    program.add(Watch::NAME, Watch::new(ground.clone(), vehicles.iter().cloned()));
    for vehicle in vehicles {
        program.add(Delivery::name(vehicle), Delivery::new(ground.clone(), vehicle.clone()));
        let scripts = ScriptDelivery::new(ground.clone(), vehicle.clone());
        program.add(ScriptDelivery::name(vehicle), scripts);
    }
    config.behaviours.load(&config.host(), program);
}
