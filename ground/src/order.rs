//! What an operator may order.

use std::fmt;

use std::sync::Arc;

use nalgebra::Vector3;
use skein_bp::script::{Assignment, ScriptFileError, TrialFault};
use skein_bp::{Event, EventSet};
use skein_dbp::NodeName;
use skein_wire::Route;
use skein_wire::event::{Declared as _, Events as _, OrderGiven, What};

use crate::giver::Giver;

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
    /// Fly this instead of what is left of the mission, and land under the last point.
    Route(Who, Route),
    /// Fly again by yourself: the pilot has let go.
    HandBack(Who),
    /// Run a script beside whatever you do.
    Load(Who, SentScript),
    /// Run the script of this name no more.
    Unload(Who, String),
    /// Ask whoever holds a vehicle for it.
    Ask(Who),
    /// Give a vehicle that one holds to another person or program.
    Give(Who, Giver),
    /// Hold a vehicle from now on, whoever holds it.
    Take(Who),
    /// Hold a vehicle no more.
    Release(Who),
    /// Go on holding a vehicle, or hold it if nobody does.
    Keep(Who),
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
    /// [`UnfitScript`] when an argument is not what its parameter may be, the script is too long, or a trial goes
    /// wrong.
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
    /// The order that needs no more than whom it is for; none if it needs more, or is for all and `who` are some.
    #[must_use]
    pub fn plain(what: What, who: Who) -> Option<Self> {
        if what.is_for_all() && who != Who::All {
            return None;
        }
        Some(match what {
            What::Launch => Self::Launch,
            What::LaunchTogether => Self::LaunchTogether,
            What::Abort => Self::Abort,
            What::Hold => Self::Hold(who),
            What::Resume => Self::Resume(who),
            What::Land => Self::Land(who),
            What::Return => Self::Return(who),
            What::HandBack => Self::HandBack(who),
            What::Ask => Self::Ask(who),
            What::Take => Self::Take(who),
            What::Release => Self::Release(who),
            What::Keep => Self::Keep(who),
            What::GoTo | What::Route | What::Load | What::Unload | What::Give => return None,
        })
    }

    #[must_use]
    pub fn what(&self) -> What {
        match self {
            Self::Launch => What::Launch,
            Self::LaunchTogether => What::LaunchTogether,
            Self::Abort => What::Abort,
            Self::Hold(_) => What::Hold,
            Self::Resume(_) => What::Resume,
            Self::Land(_) => What::Land,
            Self::Return(_) => What::Return,
            Self::GoTo(..) => What::GoTo,
            Self::Route(..) => What::Route,
            Self::HandBack(_) => What::HandBack,
            Self::Load(..) => What::Load,
            Self::Unload(..) => What::Unload,
            Self::Ask(_) => What::Ask,
            Self::Give(..) => What::Give,
            Self::Take(_) => What::Take,
            Self::Release(_) => What::Release,
            Self::Keep(_) => What::Keep,
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
            | Self::Route(who, _)
            | Self::Load(who, _)
            | Self::Unload(who, _)
            | Self::Ask(who)
            | Self::Give(who, _)
            | Self::Take(who)
            | Self::Release(who)
            | Self::Keep(who)
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

    /// The order of `by` as events of the ground station: `ground/main/ordered{what: "hold", who: "all"}` if it is for
    /// `everybody`, or else one for each vehicle of `positions`, which says where they are in metres ENU, as far as that
    /// is known.
    pub(crate) fn events(
        &self,
        ground: &NodeName,
        by: &Giver,
        everybody: bool,
        positions: &[(NodeName, Option<Vector3<f64>>)],
    ) -> Vec<Event> {
        let given = |who: &str| OrderGiven {
            to: match self {
                Self::Give(_, to) => Some(to.as_str().into()),
                _ => None,
            },
            name: self.script().map(Into::into),
            script: match self {
                Self::Load(_, script) => Some(script.text.clone()),
                _ => None,
            },
            way: match self {
                Self::Route(_, route) => Some(route.to_string().as_str().into()),
                _ => None,
            },
            ..OrderGiven::plain(self.what(), who, by.as_str())
        };
        let orders: Vec<_> = match self {
            Self::GoTo(_, destination) => places(*destination, positions)
                .into_iter()
                .map(|(vehicle, place)| given(vehicle.as_str()).at_place(place.into()))
                .collect(),
            _ if everybody => vec![given(OrderGiven::ALL)],
            _ => positions.iter().map(|(vehicle, _)| given(vehicle.as_str())).collect(),
        };
        orders.into_iter().map(|order| order.at(ground)).collect()
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

/// The events of the station `ground` by which one of these is ordered, for anyone.
pub fn ordered(ground: &NodeName, what: impl IntoIterator<Item = What>) -> EventSet {
    let ordered = |what| OrderGiven::any_at(ground).and(OrderGiven::what(what));
    EventSet::any_of(what.into_iter().map(ordered))
}

/// Those among them that are for the whole swarm.
pub(crate) fn ordered_for_all(ground: &NodeName, what: impl IntoIterator<Item = What>) -> EventSet {
    let for_all = |what| ordered(ground, [what]).and(OrderGiven::who(OrderGiven::ALL));
    EventSet::any_of(what.into_iter().map(for_all))
}

/// Everything that is ordered for `vehicle`, alone or with all.
#[must_use]
pub fn ordered_for(ground: &NodeName, vehicle: &NodeName) -> EventSet {
    let who = OrderGiven::who(OrderGiven::ALL).or(OrderGiven::who(vehicle.as_str()));
    OrderGiven::any_at(ground).and(who)
}

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
            Self::All => f.write_str(OrderGiven::ALL),
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
