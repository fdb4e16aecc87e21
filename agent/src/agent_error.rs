//! The errors of making an agent.

use skein_planning::map::MapError;

/// Why an agent cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum AgentError {
    #[error("agent configuration: `{field}` is {value:?}: {cause}")]
    Name { field: &'static str, value: String, cause: skein_dbp::NodeNameError },
    #[error("agent configuration: `fleet` is {value:?}: {cause}")]
    Fleet { value: String, cause: skein_wire::KeyError },
    #[error("agent configuration: script `{name}`: {why}")]
    Script { name: String, why: String },
    #[error("agent configuration: `fence`: {0}")]
    Fence(#[from] MapError),
}
