//! The layers of the pipeline that can be exchanged.

use skein_planning::{
    global::PotentialConfig, local::escape::EscapeConfig, passage::PassageConfig, separation::RepulsionConfig,
};

use super::{
    global::{PathFinder, path_finder},
    local::{PathFollower, path_follower},
    safety_filter::{SafetyFilter, VelocityFilter},
};
use crate::config::{Envelope, Fence, Planners, Repellers};

/// A passage is announced this far ahead, m: far enough to stop well clear of it.
const PASSAGE_AHEAD_M: f64 = 6.0;

/// The layers of guidance. Every one is there for a reason: [`Layers::of`] has them all.
#[derive(Debug)]
pub struct Layers {
    /// Where paths stay, as far from its walls as the filter keeps the vehicle.
    pub fence: Fence,
    /// Finds a path through the map.
    pub finder: Box<dyn PathFinder>,
    /// The things that make paths near them dearer.
    pub potential: PotentialConfig,
    /// Turns a path into a velocity.
    pub follower: Box<dyn PathFollower>,
    /// Bends the velocity around other vehicles.
    pub repulsion: RepulsionConfig,
    /// Makes the velocity safe.
    pub filter: Box<dyn VelocityFilter>,
    /// When the vehicle is stuck.
    pub escape: EscapeConfig,
    /// Which passages need right of way.
    pub passages: PassageConfig,
}

impl Layers {
    /// The layers that fly: those of a vehicle of this envelope inside this fence, with these planners.
    pub fn of(envelope: &Envelope, fence: Fence, planners: Planners) -> Self {
        Self {
            fence,
            finder: path_finder(planners.global),
            potential: potential(planners.potential),
            follower: path_follower(planners.local, envelope),
            repulsion: RepulsionConfig::default(),
            filter: Box::new(SafetyFilter::new(envelope, fence)),
            escape: EscapeConfig::default(),
            passages: PassageConfig { look_m: PASSAGE_AHEAD_M, ..PassageConfig::default() },
        }
    }
}

fn potential(repellers: Repellers) -> PotentialConfig {
    let vehicles = PotentialConfig::default();
    match repellers {
        Repellers::Nobody => PotentialConfig { gain: 0.0, ..vehicles },
        Repellers::Vehicles => vehicles,
        Repellers::Everything => PotentialConfig { of_everything: true, ..vehicles },
    }
}
