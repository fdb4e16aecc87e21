//! The parts of an agent that can be exchanged.

use crate::config::AgentConfig;
use crate::mind::{BThreads, Mind};
use crate::pipeline::layers::Layers;
use crate::positioning::{self, Positioning};

/// The parts of an agent, beside its configuration. Experiments replace a part to see what it is good for.
#[derive(Debug)]
pub struct Parts {
    pub mind: Box<dyn Mind>,
    pub positioning: Box<dyn Positioning>,
    pub layers: Layers,
}

impl Parts {
    /// The parts that fly with this configuration.
    #[must_use]
    pub fn of(config: &AgentConfig) -> Self {
        Self {
            mind: Box::new(BThreads),
            positioning: positioning::source(config),
            layers: Layers::of(&config.envelope, config.fence, config.planners),
        }
    }
}
