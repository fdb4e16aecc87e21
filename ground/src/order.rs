//! An operator's order at the station: a script is made fit to be sent, and a place becomes one for each vehicle.

use nalgebra::Vector3;
use skein_bp::script::{Assignment, ScriptFileError, TrialFault};
use skein_bp::{Event, EventSet};
use skein_dbp::NodeName;
use skein_wire::event::{Declared as _, Events as _, OrderGiven, What};
use skein_wire::{Destination, Order, SentScript};

use crate::giver::Giver;

/// The number of states of a script that are looked at before it is sent.
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

/// Makes a script ready to be sent. Each vehicle checks it again, and more: whether it keeps to its rights there.
///
/// # Errors
/// [`UnfitScript`] when an argument is not what its parameter may be, the script is too long, or a trial goes wrong.
pub fn to_send(assignment: &Assignment) -> Result<SentScript, UnfitScript> {
    let bound = assignment.bind("uav/1")?;
    bound.bthread.try_out(STATES_TRIED)?;
    Ok(SentScript { name: bound.name.as_str().into(), text: assignment.to_json()?.into() })
}

/// From one vehicle's place to the next where several are sent to one destination, m.
const SPREAD_M: f64 = 3.0;
/// A vehicle that keeps its height keeps at least this one, m.
const LEAST_HEIGHT_M: f64 = 1.0;

/// An order of `by` as events of the ground station: `ground/main/ordered{what: "hold", who: "all"}` if it is for
/// `everybody`, or else one for each vehicle of `positions`, which says where they are in metres ENU, as far as that is
/// known.
pub(crate) fn events(
    order: &Order,
    ground: &NodeName,
    by: &Giver,
    everybody: bool,
    positions: &[(NodeName, Option<Vector3<f64>>)],
) -> Vec<Event> {
    let given = |who: &str| order.given(who, by.as_str());
    let orders: Vec<_> = match order.place() {
        Some(destination) => places(destination, positions)
            .into_iter()
            .map(|(vehicle, place)| given(vehicle.as_str()).at_place(place.into()))
            .collect(),
        None if everybody => vec![given(OrderGiven::ALL)],
        None => positions.iter().map(|(vehicle, _)| given(vehicle.as_str())).collect(),
    };
    orders.into_iter().map(|order| order.at(ground)).collect()
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
