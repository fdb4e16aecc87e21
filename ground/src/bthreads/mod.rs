//! The b-threads of the ground station, one file each.
//!
//! Adding a b-thread: write its file, name it in [`load`]. One in a crate of one's own is a
//! [`Behaviour`](skein_bp::behaviour::Behaviour).

mod beside_delivery;
mod delivery;
mod hold;
mod launch;
mod lift;
mod muster;
pub mod roll_call;
mod together;
mod watch;
mod zone_block;

use skein_bp::Program;

pub use beside_delivery::BesideDelivery;
pub use delivery::{Delivery, GOING_LASTS};
pub use hold::Hold;
pub use launch::Launch;
pub use lift::LiftZone;
pub use muster::Muster;
pub use roll_call::RollCall;
pub use together::{LAUNCH_LASTS, Together};
pub use watch::{MissionOutcome, Watch};
pub use zone_block::ZoneBlock;

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
        let scripts = BesideDelivery::of_scripts(ground.clone(), vehicle.clone());
        program.add(BesideDelivery::name_for_scripts(vehicle), scripts);
        let routes = BesideDelivery::of_routes(ground.clone(), vehicle.clone());
        program.add(BesideDelivery::name_for_routes(vehicle), routes);
        let handovers = BesideDelivery::of_handovers(ground.clone(), vehicle.clone());
        program.add(BesideDelivery::name_for_handovers(vehicle), handovers);
    }
    config.behaviours.load(&config.host(), program);
}
