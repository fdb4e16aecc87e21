//! Who sends a MAVLink frame, and for whom it is.

use mavlink::Message as _;
use mavlink::dialects::common::MavMessage;

/// A sender or receiver: a MAVLink system and one component of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address {
    /// System id, 1..=255. Vehicles have one each; ground stations use 255 downwards.
    pub system_id: u8,
    /// Component id: 1 is the autopilot, 190 a ground station, 191 a companion computer.
    pub component_id: u8,
}

impl Address {
    /// The autopilot component of a system.
    pub fn autopilot(system_id: u8) -> Self {
        Self { system_id, component_id: 1 }
    }

    /// Whether a message for `(target_system, target_component)` is meant for this address; 0 means everyone.
    pub fn is_target(&self, target_system: u8, target_component: u8) -> bool {
        (target_system == 0 || target_system == self.system_id)
            && (target_component == 0 || target_component == self.component_id)
    }

    /// Whether a message names a target, and this address is meant.
    pub(crate) fn is_addressed_by(&self, message: &MavMessage) -> bool {
        let component = message.target_component_id().unwrap_or(0);
        message.target_system_id().is_some_and(|system| self.is_target(system, component))
    }
}
