//! What a ground station finds when it starts beside a swarm that is already there.
//!
//! A vehicle's first word to this station, in each of its lives, becomes the event `<ground>/heard {vehicle, situation}`.
//! So a station that starts late, or again, launches nobody who flies and waits for nobody who has landed.

use skein_bp::{Event, EventSet};
use skein_dbp::NodeName;
use skein_wire::{MissionState, State};

/// The verb of the event.
pub const HEARD: &str = "heard";

/// How a vehicle was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Situation {
    /// On the ground, its mission before it.
    Grounded,
    /// In the air, or about to be.
    Flying,
    /// On the ground, its mission done.
    Complete,
    /// On the ground, its mission not done.
    Failed,
}

impl Situation {
    fn of(state: &State) -> Self {
        match state.mission {
            MissionState::UnderWay if state.armed => Self::Flying,
            MissionState::UnderWay => Self::Grounded,
            MissionState::Complete => Self::Complete,
            MissionState::Failed => Self::Failed,
        }
    }

    fn word(self) -> &'static str {
        match self {
            Self::Grounded => "grounded",
            Self::Flying => "flying",
            Self::Complete => "complete",
            Self::Failed => "failed",
        }
    }
}

/// The event by which the station `ground` tells that it has heard a vehicle.
#[must_use]
pub fn event(ground: &NodeName, state: &State) -> Event {
    Event::new(ground.event_name(HEARD))
        .with("vehicle", state.node.as_str())
        .with("situation", Situation::of(state).word())
        .with("why", state.task.as_str())
}

/// All events of this kind at the station `ground`.
#[must_use]
pub fn of(ground: &NodeName) -> EventSet {
    EventSet::named(ground.event_name(HEARD))
}

/// The events by which vehicles were found like this.
#[must_use]
pub fn is(situation: Situation) -> EventSet {
    EventSet::field_is("situation", situation.word())
}

/// The vehicle and how it was found, if `event` is of this kind.
#[must_use]
pub fn read(event: &Event) -> Option<(NodeName, Situation)> {
    let all = [Situation::Grounded, Situation::Flying, Situation::Complete, Situation::Failed];
    let word = event.text("situation").filter(|_| event.kind() == HEARD)?;
    let situation = all.into_iter().find(|situation| situation.word() == word)?;
    Some((NodeName::new(event.text("vehicle")?).ok()?, situation))
}
