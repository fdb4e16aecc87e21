//! Faults of bytes from outside.

use skein_bp::Exceeded;
use skein_dbp::NodeNameError;

use crate::proto::{MAX_PAYLOAD, VERSION};

/// Bytes that are not a message.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DecodeError {
    #[error("not a protobuf message of this schema: {0}")]
    Protobuf(#[from] prost::DecodeError),
    #[error("message version {given}: expected 1 to {VERSION}; update the older of the two nodes")]
    Version { given: u32 },
    #[error("payload of {bytes} bytes: expected at most {MAX_PAYLOAD}")]
    TooLong { bytes: usize },
    #[error("`{field}` is missing")]
    Missing { field: &'static str },
    #[error("`{field}` is {given}: expected {expected}")]
    Range { field: &'static str, given: String, expected: &'static str },
    #[error("`{field}`: {cause}")]
    Name { field: &'static str, cause: NodeNameError },
    #[error("`{field}`: {cause}")]
    Bound { field: &'static str, cause: Exceeded },
}
