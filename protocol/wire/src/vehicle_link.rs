//! The words of vehicles about their bodies, apart from the protocol between nodes: for one who may not wait
//! for it.

use std::collections::{BTreeMap, BTreeSet};

use skein_dbp::NodeName;

use crate::key::{Fleet, Key};
use crate::link::Link;
use crate::message::{Payload, Readiness, Record, State};

/// One look takes in so many messages at most.
const MOST_PER_LOOK: usize = 1024;

/// Hears the states and checks of the vehicles of a roster, and tells those of one's own.
///
/// Of what has arrived since the last look only the newest of each vehicle is read, and nothing that others
/// say: what a member sends costs one reading in each look.
#[derive(Debug)]
pub struct VehicleLink {
    name: NodeName,
    fleet: Fleet,
    roster: BTreeSet<NodeName>,
    has_met: bool,
    states: Vec<State>,
    readiness: Vec<Readiness>,
}

impl VehicleLink {
    /// Of the vehicle `name` among the members of `roster`.
    pub fn new(name: NodeName, fleet: Fleet, roster: impl IntoIterator<Item = NodeName>) -> Self {
        let roster = roster.into_iter().filter(|member| *member != name).collect();
        Self { roster, name, fleet, has_met: false, states: Vec::new(), readiness: Vec::new() }
    }

    /// Takes in what has arrived.
    pub fn receive(&mut self, link: &mut dyn Link) {
        if !std::mem::replace(&mut self.has_met, true) {
            link.meet(&self.roster.iter().cloned().collect::<Vec<_>>());
        }
        let mut newest = BTreeMap::new();
        for (key, payload) in std::iter::from_fn(|| link.poll()).take(MOST_PER_LOOK) {
            let is_read = self.roster.contains(key.sender()) && payload.len() <= key.most_bytes();
            if is_read && (key.is_of::<State>() || key.is_of::<Readiness>()) {
                newest.insert(key, payload);
            }
        }
        for (key, payload) in newest {
            match Payload::decode(&payload) {
                Ok(payload) if !key.fits(&payload) => {}
                Ok(Payload::State(mut state)) => {
                    state.bring_to_what_is_believed();
                    self.states.push(state);
                }
                Ok(Payload::Readiness(readiness)) => self.readiness.push(readiness),
                // The ground station counts and tells what cannot be read.
                Ok(_) | Err(_) => {}
            }
        }
    }

    /// The states that have arrived since the last call.
    pub fn take_states(&mut self) -> Vec<State> {
        std::mem::take(&mut self.states)
    }

    /// The checks that have arrived since the last call.
    pub fn take_readiness(&mut self) -> Vec<Readiness> {
        std::mem::take(&mut self.readiness)
    }

    /// Tells all what state this vehicle is in.
    pub fn put_state(&self, state: State, link: &mut dyn Link) {
        self.put::<State>(&Payload::State(state), link);
    }

    /// Tells all how this vehicle passes its checks before take-off.
    pub fn put_readiness(&self, readiness: Readiness, link: &mut dyn Link) {
        self.put::<Readiness>(&Payload::Readiness(readiness), link);
    }

    fn put<R: Record>(&self, payload: &Payload, link: &mut dyn Link) {
        link.put(&Key::to_all::<R>(&self.fleet, self.name.clone()), payload.encode());
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;
    use std::time::Duration;

    use super::*;

    #[derive(Default)]
    struct Waiting(VecDeque<(Key, Vec<u8>)>);

    impl Link for Waiting {
        fn put(&mut self, key: &Key, payload: Vec<u8>) {
            self.0.push_back((key.clone(), payload));
        }

        fn poll(&mut self) -> Option<(Key, Vec<u8>)> {
            self.0.pop_front()
        }
    }

    fn name(text: &str) -> NodeName {
        NodeName::new(text).unwrap()
    }

    #[test]
    fn of_each_member_the_newest_word_counts_and_nobody_speaks_for_another() {
        let fleet = Fleet::new("demo").unwrap();
        let roster = ["uav/1", "uav/2", "uav/3"].map(name);
        let mut link = Waiting::default();
        let mut say = |sender: &str, node: &str, ms| {
            let key = Key::to_all::<State>(&fleet, name(sender));
            let time = Duration::from_millis(ms);
            link.put(&key, Payload::State(State { time, ..State::new(name(node)) }).encode());
        };
        for (sender, node, ms) in [
            ("uav/2", "uav/2", 1),
            ("uav/3", "uav/2", 9),
            ("uav/2", "uav/2", 2),
            ("uav/9", "uav/9", 1),
            ("uav/1", "uav/1", 1),
        ] {
            say(sender, node, ms);
        }
        let mut vehicle = VehicleLink::new(name("uav/1"), fleet, roster);
        vehicle.receive(&mut link);
        let heard: Vec<_> = vehicle.take_states().into_iter().map(|state| (state.node, state.time)).collect();
        assert_eq!(heard, [(name("uav/2"), Duration::from_millis(2))]);
        assert!(vehicle.take_states().is_empty());
    }
}
