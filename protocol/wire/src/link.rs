//! The seam between a node and whatever carries its messages.

use skein_dbp::NodeName;

use crate::key::Key;

/// A node's way to the others: Zenoh on vehicles, memory in lockstep.
///
/// A link delivers to its node what is addressed to it and what is put for all, but not its own. It may lose,
/// repeat, delay and reorder messages. Neither method ever waits.
pub trait Link {
    /// Learns who the members of the fleet are: what others send must not displace what they say.
    fn meet(&mut self, _members: &[NodeName]) {}

    /// Hands over a message for sending.
    fn put(&mut self, key: &Key, payload: Vec<u8>);

    /// The next message that has arrived, if any.
    fn poll(&mut self) -> Option<(Key, Vec<u8>)>;
}
