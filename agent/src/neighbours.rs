//! What a vehicle knows of the others: their last word, which stays, as a ghost that the safety filter lets grow, when they fall silent.

use std::{collections::BTreeMap, time::Duration};

use nalgebra::Vector3;
use skein_dbp::NodeName;
use skein_planning::separation;
use skein_wire::State;

/// A neighbour silent for longer than this is not relied on to keep its distance.
const SILENT_AFTER: Duration = Duration::from_millis(500);

/// The last state heard of each other vehicle.
#[derive(Debug, Default)]
pub struct Neighbours {
    last: BTreeMap<NodeName, Heard>,
}

#[derive(Debug)]
struct Heard {
    state: State,
    /// When it arrived, on this vehicle's clock: clocks of two vehicles are never compared.
    at: Duration,
}

/// One neighbour, as of now.
#[derive(Clone, Debug, PartialEq)]
pub struct Neighbour {
    /// Its name.
    pub node: NodeName,
    /// Whether its motors are armed: from before take-off until after landing.
    pub armed: bool,
    /// Its last word with age and uncertainty, as the separation takes it.
    pub track: separation::Neighbour,
}

impl Neighbour {
    /// Where it should be now, metres ENU.
    #[must_use]
    pub fn position(&self) -> Vector3<f64> {
        self.track.predicted()
    }
}

impl Neighbours {
    /// Takes in a state message that arrived at `now`; one older than the last is dropped.
    pub fn hear(&mut self, now: Duration, state: State) {
        let newest = self
            .last
            .get(&state.node)
            .is_none_or(|last| (state.incarnation, state.time) > (last.state.incarnation, last.state.time));
        if newest {
            self.last.insert(state.node.clone(), Heard { state, at: now });
        }
    }

    /// Every neighbour as of `now`, in the order of their names.
    pub fn at(&self, now: Duration) -> impl Iterator<Item = Neighbour> + '_ {
        (0_u32..).zip(self.last.values()).map(move |(id, heard)| {
            let state = &heard.state;
            let age = now.saturating_sub(heard.at);
            Neighbour {
                node: state.node.clone(),
                armed: state.armed,
                track: separation::Neighbour {
                    id,
                    position: state.position,
                    velocity: state.velocity,
                    sigma_m: state.position_sigma_m,
                    age_s: age.as_secs_f64(),
                    radius_m: state.radius_m,
                    cooperative: age <= SILENT_AFTER,
                },
            }
        })
    }

    /// The nearest neighbour's name and distance in metres.
    #[must_use]
    pub fn nearest(&self, now: Duration, position: Vector3<f64>) -> Option<(NodeName, f64)> {
        self.at(now)
            .map(|neighbour| ((neighbour.position() - position).norm(), neighbour.node))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(distance, node)| (node, distance))
    }
}
