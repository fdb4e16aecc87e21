//! The first word of a vehicle that was there before the ground station.
//!
//! A vehicle's first word to this station, in each of its lives, becomes the event [`Heard`].
//! So a station that starts late, or again, launches nobody who flies and waits for nobody who has landed.

use skein_bp::Event;
use skein_dbp::NodeName;
use skein_wire::event::{Declared as _, Heard, Situation};
use skein_wire::{MissionState, State};

fn situation(state: &State) -> Situation {
    match state.mission {
        MissionState::UnderWay if state.armed => Situation::Flying,
        MissionState::UnderWay => Situation::Grounded,
        MissionState::Complete => Situation::Complete,
        MissionState::Failed => Situation::Failed,
    }
}

/// The event by which the station `ground` tells that it has heard a vehicle.
pub fn event(ground: &NodeName, state: &State) -> Event {
    let why = state.task.as_str().into();
    Heard { vehicle: state.node.clone(), situation: situation(state), why }.at(ground)
}
