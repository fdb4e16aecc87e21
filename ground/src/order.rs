//! What an operator may order.

use std::fmt;

use std::sync::Arc;

use nalgebra::Vector3;
use skein_bp::script::{Assignment, ScriptFileError, TrialFault};
use skein_bp::{Event, EventSet};
use skein_dbp::NodeName;
use skein_wire::vocabulary::{self, LOAD, UNLOAD};

/// Whom an order is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Who {
    /// Every vehicle of the roster.
    All,
    These(Vec<NodeName>),
}

/// An operator's order.
#[derive(Clone, Debug, PartialEq)]
pub enum Order {
    /// Take off, one after another, those that stand ready.
    Launch,
    /// Take off together, once every vehicle of the roster is there and ready.
    LaunchTogether,
    /// Land together, wherever you are: every vehicle of the roster learns of it before anything else is decided.
    Abort,
    /// Stay where you are until resumed.
    Hold(Who),
    Resume(Who),
    /// Land where you are.
    Land(Who),
    /// Fly home and land there.
    Return(Who),
    /// Fly here and hover until resumed.
    GoTo(Who, Destination),
    /// Fly again by yourself: the pilot has let go.
    HandBack(Who),
    /// Run a script beside whatever you do.
    Load(Who, SentScript),
    /// Run the script of this name no more.
    Unload(Who, String),
}

/// How many states of a script are looked at before it is sent.
const STATES_TRIED: usize = 20_000;

/// Why a script is not sent.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnfitScript {
    /// It is not sound, or its parameters are not.
    #[error(transparent)]
    Unsound(#[from] ScriptFileError),
    /// What it would do.
    #[error(transparent)]
    Trial(#[from] TrialFault),
}

/// A script as it is sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SentScript {
    name: String,
    text: Arc<str>,
}

impl SentScript {
    /// Makes a script ready to be sent. Each vehicle checks it again, and more: whether it keeps to its rights there.
    ///
    /// # Errors
    /// [`UnfitScript`] when an argument is not what its parameter may be, the script is too long, or a trial goes wrong.
    pub fn new(assignment: &Assignment) -> Result<Self, UnfitScript> {
        let bound = assignment.bind("uav/1")?;
        bound.bthread.try_out(STATES_TRIED)?;
        Ok(Self { name: bound.name, text: assignment.to_json()?.into() })
    }

    /// The name it will run under.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }
}

/// Where to go, metres ENU. Several vehicles spread out around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Destination {
    pub x: f64,
    pub y: f64,
    /// Up; none to keep the height that each vehicle has.
    pub z: Option<f64>,
}

/// From one vehicle's place to the next where several are sent to one destination, m.
const SPREAD_M: f64 = 3.0;
/// A vehicle that keeps its height keeps at least this one, m.
const LEAST_HEIGHT_M: f64 = 1.0;

impl Order {
    /// The order as one word: `launch`, `launch_together`, `abort`, `hold`, `resume`, `land`, `return`, `goto`, `hand_back`, `load` or `unload`.
    #[must_use]
    pub fn what(&self) -> &'static str {
        match self {
            Self::Launch => "launch",
            Self::LaunchTogether => "launch_together",
            Self::Abort => "abort",
            Self::Hold(_) => "hold",
            Self::Resume(_) => "resume",
            Self::Land(_) => "land",
            Self::Return(_) => "return",
            Self::GoTo(..) => "goto",
            Self::HandBack(_) => "hand_back",
            Self::Load(..) => LOAD,
            Self::Unload(..) => UNLOAD,
        }
    }

    /// Whom it is for.
    #[must_use]
    pub fn who(&self) -> &Who {
        match self {
            Self::Launch | Self::LaunchTogether | Self::Abort => &Who::All,
            Self::Hold(who)
            | Self::Resume(who)
            | Self::Land(who)
            | Self::Return(who)
            | Self::GoTo(who, _)
            | Self::Load(who, _)
            | Self::Unload(who, _)
            | Self::HandBack(who) => who,
        }
    }

    /// The name of the script that it is about.
    #[must_use]
    pub fn script(&self) -> Option<&str> {
        match self {
            Self::Load(_, script) => Some(script.name()),
            Self::Unload(_, name) => Some(name),
            _ => None,
        }
    }

    /// The order as events of the ground station: `ground/main/ordered{what: "hold", who: "all"}`, or one for each
    /// vehicle that it names. `positions` are those of the vehicles it is for, in metres ENU, as far as they are known.
    pub(crate) fn events(
        &self,
        ground: &NodeName,
        positions: &[(NodeName, Option<Vector3<f64>>)],
    ) -> Vec<Event> {
        let event = |who: &str| {
            let order = ordered_event(ground, self.what(), who);
            let order = self.script().into_iter().fold(order, |order, name| order.with("name", name));
            match self {
                Self::Load(_, script) => order.with("script", script.text.clone()),
                _ => order,
            }
        };
        match (self, self.who()) {
            (Self::GoTo(_, destination), _) => places(*destination, positions)
                .into_iter()
                .map(|(vehicle, place)| {
                    event(vehicle.as_str()).with("x", place.x).with("y", place.y).with("z", place.z)
                })
                .collect(),
            (_, Who::All) => vec![event(ALL)],
            (_, Who::These(vehicles)) => vehicles.iter().map(|vehicle| event(vehicle.as_str())).collect(),
        }
    }
}

/// A place of its own for each vehicle: a square grid around the destination, the nearest vehicle to each place.
fn places(
    destination: Destination,
    vehicles: &[(NodeName, Option<Vector3<f64>>)],
) -> Vec<(&NodeName, Vector3<f64>)> {
    let columns = (1..).find(|columns| columns * columns >= vehicles.len()).unwrap_or(1);
    let rows = vehicles.len().div_ceil(columns.max(1));
    let offset = |index: usize, count: usize| (index as f64 - (count as f64 - 1.0) / 2.0) * SPREAD_M;
    let mut left: Vec<_> = vehicles.iter().collect();
    let mut placed = Vec::new();
    for slot in 0..vehicles.len() {
        let (x, y) =
            (destination.x + offset(slot % columns, columns), destination.y + offset(slot / columns, rows));
        let distance = |position: &Option<Vector3<f64>>| {
            position.map_or(f64::INFINITY, |position| (position.x - x).hypot(position.y - y))
        };
        let nearest = (0..left.len()).min_by(|a, b| distance(&left[*a].1).total_cmp(&distance(&left[*b].1)));
        let Some(nearest) = nearest else { break };
        let (vehicle, position) = left.swap_remove(nearest);
        let kept = position.map_or(LEAST_HEIGHT_M, |position| position.z.max(LEAST_HEIGHT_M));
        placed.push((vehicle, Vector3::new(x, y, destination.z.unwrap_or(kept))));
    }
    placed
}

/// Whether an order says nothing against what other orders have set going.
pub(crate) fn is_beside_flight(what: &str) -> bool {
    matches!(what, "launch" | "launch_together" | LOAD | UNLOAD)
}

/// What the operator has ordered becomes an event of this name.
pub(crate) const ORDERED: &str = "ordered";

/// The event of the ground station by which `what` is ordered, for a vehicle or for [`ALL`].
pub(crate) fn ordered_event(ground: impl fmt::Display, what: &str, who: &str) -> Event {
    vocabulary::event(ground, ORDERED).with("what", what).with("who", who)
}

/// The events of the ground station by which `what` is ordered, for anyone.
#[must_use]
pub fn ordered(ground: &NodeName, what: &str) -> EventSet {
    EventSet::named(ground.event_name(ORDERED)).and(EventSet::field_is("what", what))
}

/// Those among them that are for the whole swarm.
#[must_use]
pub fn ordered_for_all(ground: &NodeName, what: &str) -> EventSet {
    ordered(ground, what).and(EventSet::field_is("who", ALL))
}

/// Everything that is ordered for `vehicle`, alone or with all.
#[must_use]
pub fn ordered_for(ground: &NodeName, vehicle: &NodeName) -> EventSet {
    let who = EventSet::field_is("who", ALL).or(EventSet::field_is("who", vehicle.as_str()));
    EventSet::named(ground.event_name(ORDERED)).and(who)
}

/// Whether an `ordered` event is for `vehicle`.
#[must_use]
pub fn is_for(event: &Event, vehicle: &NodeName) -> bool {
    event.text("who").is_some_and(|who| who == ALL || who == vehicle.as_str())
}

/// How an event names all vehicles.
pub(crate) const ALL: &str = "all";

impl Who {
    #[must_use]
    pub fn only(vehicle: NodeName) -> Self {
        Self::These(vec![vehicle])
    }

    /// Whether it is for `vehicle`.
    #[must_use]
    pub fn includes(&self, vehicle: &NodeName) -> bool {
        match self {
            Self::All => true,
            Self::These(vehicles) => vehicles.contains(vehicle),
        }
    }
}

impl fmt::Display for Who {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.write_str(ALL),
            Self::These(vehicles) => {
                let names: Vec<&str> = vehicles.iter().map(NodeName::as_str).collect();
                f.write_str(&names.join(", "))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn swarm(count: usize) -> Vec<(NodeName, Option<Vector3<f64>>)> {
        let vehicle = |index: usize| {
            let position = Vector3::new(0.0, index as f64, 2.0 + index as f64);
            (NodeName::new(&format!("uav/{index}")).unwrap(), Some(position))
        };
        (0..count).map(vehicle).collect()
    }

    #[test]
    fn one_vehicle_goes_to_the_point_itself_and_keeps_its_height() {
        let swarm = swarm(1);
        let placed = places(Destination { x: 10.0, y: -4.0, z: None }, &swarm);
        assert_eq!(placed, [(&swarm[0].0, Vector3::new(10.0, -4.0, 2.0))]);
    }

    #[test]
    fn several_get_places_of_their_own_around_it() {
        for count in 2..30 {
            let swarm = swarm(count);
            let placed = places(Destination { x: 10.0, y: 5.0, z: Some(7.0) }, &swarm);
            assert_eq!(placed.len(), count);
            for (index, (vehicle, place)) in placed.iter().enumerate() {
                assert_eq!(place.z, 7.0);
                for (other, elsewhere) in &placed[..index] {
                    assert!(vehicle != other && (place - elsewhere).norm() > SPREAD_M - 1e-9);
                }
            }
            let middle = placed.iter().map(|(_, place)| place).sum::<Vector3<f64>>() / count as f64;
            assert!((middle - Vector3::new(10.0, 5.0, 7.0)).norm() < 1.5 * SPREAD_M, "{middle}");
        }
    }

    #[test]
    fn a_vehicle_that_was_never_heard_is_sent_too() {
        let swarm = [(NodeName::new("uav/1").unwrap(), None)];
        let placed = places(Destination { x: 1.0, y: 2.0, z: None }, &swarm);
        assert_eq!(placed[0].1, Vector3::new(1.0, 2.0, LEAST_HEIGHT_M));
    }
}
