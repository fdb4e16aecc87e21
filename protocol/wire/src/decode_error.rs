//! Faults of bytes from outside.

use skein_dbp::NodeNameError;

use crate::proto::{MAX_PAYLOAD, VERSION};

/// Bytes that are not a message.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DecodeError {
    /// Not protobuf, or of another schema.
    #[error("not a protobuf message of this schema: {0}")]
    Protobuf(#[from] prost::DecodeError),
    /// From a version that this build does not read.
    #[error("message version {given}: expected 1 to {VERSION}; update the older of the two nodes")]
    Version { given: u32 },
    /// Longer than any message may be.
    #[error("payload of {bytes} bytes: expected at most {MAX_PAYLOAD}")]
    TooLong { bytes: usize },
    /// A field without which the message means nothing.
    #[error("`{field}` is missing")]
    Missing { field: &'static str },
    /// A field outside its range.
    #[error("`{field}` is {given}: expected {expected}")]
    Range {
        field: &'static str,
        given: String,
        /// The values that are allowed.
        expected: &'static str,
    },
    /// A node's name that is none.
    #[error("`{field}`: {source}")]
    Name { field: &'static str, source: NodeNameError },
}
