//! Where the companions of real autopilots are.

/// Where the agents run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Companions {
    /// In this process, which hands on MAVLink.
    Here,
    /// In processes of their own, which speak to PX4's own ports; to ArduPilot's through the world's.
    Elsewhere,
}
