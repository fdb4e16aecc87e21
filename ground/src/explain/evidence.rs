//! The evidence about the swarm at a moment.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use nalgebra::Vector3;
use skein_dbp::{Board, Happened, NodeName};
use skein_wire::State;
use skein_wire::event::{
    Advance, Declared as _, Enter, Events as _, Goto, Homeward, OrderGiven, Plan, Takeoff, Text, What,
};

use super::party::Party;

/// The number of a vehicle's latest events that are remembered.
const EVENTS_KEPT: usize = 4;
/// Of how many b-threads of a node it is remembered that they ask for movement: quotas of the bids allow no more names.
const MOST_MOVERS: usize = 64;
/// The events that make up a vehicle's movement, take-off apart.
type Moves = (Goto, Plan, Advance, Homeward, Enter);

/// A vehicle that stays this near to a place stands still, m: a hovering one sways.
const RADIUS_M: f64 = 0.5;
/// Only who has stayed this long stands still; others turn around.
const LEAST: Duration = Duration::from_secs(2);

/// Everything heard up to a moment: feed it in the order in which it was heard.
#[derive(Clone, Debug, Default)]
pub struct Evidence {
    vehicles: BTreeMap<NodeName, Vehicle>,
    boards: BTreeMap<NodeName, Noted<Board>>,
    /// The b-threads that have requested a take-off, of any vehicle.
    launchers: BTreeSet<Party>,
}

/// Something and when it was heard, on the listener's clock.
#[derive(Clone, Debug)]
pub(super) struct Noted<T> {
    pub(super) at: Duration,
    pub(super) what: T,
}

/// The evidence about one vehicle.
#[derive(Clone, Debug, Default)]
pub(super) struct Vehicle {
    pub(super) state: Option<Noted<State>>,
    pub(super) stillness: Stillness,
    /// Oldest first, without leaves to move.
    events: VecDeque<Happened>,
    /// The latest leave to move.
    leave: Option<Happened>,
    /// The person or program that has ordered each station to hold it, last.
    held_by: BTreeMap<NodeName, Text>,
    /// Its b-threads that have asked for a move.
    pub(super) movers: BTreeSet<String>,
}

impl Evidence {
    /// There is a vehicle of this name, heard or not.
    pub fn note_vehicle(&mut self, vehicle: &NodeName) {
        self.vehicles.entry(vehicle.clone()).or_default();
    }

    /// A vehicle has told its state.
    pub fn note_state(&mut self, now: Duration, state: &State) {
        let vehicle = self.vehicles.entry(state.node.clone()).or_default();
        vehicle.stillness.note(now, &state.position);
        vehicle.state = Some(Noted { at: now, what: state.clone() });
    }

    /// A node has told what is on its board.
    pub fn note_board(&mut self, now: Duration, board: Board) {
        self.boards.insert(board.node.clone(), Noted { at: now, what: board });
    }

    /// An event has happened, at a time on the clock of who listens.
    pub fn note_event(&mut self, happened: Happened) {
        let requested_by = || happened.requested_by.iter().map(|name| Party::read(&happened.home, name));
        if happened.event.kind() == Takeoff::NAME && self.launchers.len() < MOST_MOVERS {
            self.launchers.extend(requested_by());
        }
        if let Some(order) = OrderGiven::read(&happened.event).filter(|order| order.what == What::Hold) {
            for (_, vehicle) in self.vehicles.iter_mut().filter(|(name, _)| order.is_for(name)) {
                vehicle.held_by.insert(happened.home.clone(), order.by.clone());
            }
        }
        let Some(vehicle) = self.vehicles.get_mut(&happened.home) else { return };
        if Moves::NAMES.contains(&happened.event.kind()) && vehicle.movers.len() < MOST_MOVERS {
            let own = requested_by().filter(|party| party.node == happened.home);
            vehicle.movers.extend(own.map(|party| party.bthread));
        }
        if matches!(happened.event.kind(), Advance::NAME | Homeward::NAME) {
            vehicle.leave = Some(happened);
            return;
        }
        if vehicle.events.len() == EVENTS_KEPT {
            vehicle.events.pop_front();
        }
        vehicle.events.push_back(happened);
    }

    pub fn vehicles(&self) -> impl Iterator<Item = &NodeName> {
        self.vehicles.keys()
    }

    /// The newest board of each node.
    pub fn boards(&self) -> impl Iterator<Item = &Board> {
        self.boards.values().map(|noted| &noted.what)
    }

    pub(super) fn vehicle(&self, name: &NodeName) -> Option<&Vehicle> {
        self.vehicles.get(name)
    }

    pub(super) fn board(&self, node: &NodeName) -> Option<&Noted<Board>> {
        self.boards.get(node)
    }

    pub(super) fn launchers(&self) -> impl Iterator<Item = &Party> {
        self.launchers.iter()
    }
}

impl Vehicle {
    /// The person or program that has ordered this station to hold it.
    pub(super) fn held_by(&self, station: &NodeName) -> Option<&str> {
        self.held_by.get(station).map(|by| &**by)
    }

    /// Newest first; of the leaves to move the latest only.
    pub(super) fn latest_events(&self) -> impl Iterator<Item = &Happened> {
        let mut events: Vec<&Happened> = self.events.iter().chain(&self.leave).collect();
        events.sort_by_key(|happened| happened.at);
        events.into_iter().rev().take(EVENTS_KEPT)
    }
}

/// The place that a vehicle was last seen to come to, and when.
#[derive(Clone, Debug, Default)]
pub(super) struct Stillness(Option<(Vector3<f64>, Duration)>);

impl Stillness {
    /// At `now` the vehicle is at `position`, metres.
    pub(super) fn note(&mut self, now: Duration, position: &Vector3<f64>) {
        if self.0.is_none_or(|(place, _)| (place - position).norm() > RADIUS_M) {
            self.0 = Some((*position, now));
        }
    }

    /// Since when it stands still; none if it moves, or has just come to a halt.
    pub(super) fn since(&self, now: Duration) -> Option<Duration> {
        self.0.map(|(_, since)| since).filter(|since| now.saturating_sub(*since) >= LEAST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_sways_stands_still_and_who_creeps_does_not() {
        let (mut sways, mut flies) = (Stillness::default(), Stillness::default());
        for tenth in 0..100_u32 {
            let (now, t) = (Duration::from_millis(u64::from(tenth) * 100), f64::from(tenth) / 10.0);
            sways.note(now, &Vector3::new((3.0 * t).sin() * 0.2, 0.0, 2.0));
            flies.note(now, &Vector3::new(0.4 * t, 0.0, 2.0));
            assert_eq!(flies.since(now), None, "at {t} s");
        }
        assert_eq!(sways.since(Duration::from_millis(1900)), None);
        assert_eq!(sways.since(Duration::from_secs(10)), Some(Duration::ZERO));
    }
}
