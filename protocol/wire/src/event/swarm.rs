//! What the swarm decides together.

/// Home of the joint events: the coordinator decides on them for all.
pub const SWARM: &str = "swarm";

skein_bp::events! {
    /// Joint decisions.
    pub const JOINT;

    /// Every vehicle takes off now. Those that are not ready block it.
    Launch = "launch", Anyone;
    /// Every vehicle lands where it is.
    Abort = "abort", Anyone;
}
