//! Faults of a configuration.

use skein_planning::map::MapError;

/// Why an agent cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum AgentError {
    /// A node name in the configuration is none.
    #[error("agent configuration: `{field}` is {value:?}: {source}")]
    Name {
        field: &'static str,
        value: String,
        /// What is wrong with it.
        source: skein_dbp::NodeNameError,
    },
    /// The fleet's name is none.
    #[error("agent configuration: `fleet` is {value:?}: {source}")]
    Fleet {
        value: String,
        /// What is wrong with it.
        source: skein_wire::KeyError,
    },
    /// A script is not run.
    #[error("agent configuration: script `{name}`: {why}")]
    Script { name: String, why: String },
    /// The fence is no space to fly in.
    #[error("agent configuration: `fence`: {0}")]
    Fence(#[from] MapError),
}
