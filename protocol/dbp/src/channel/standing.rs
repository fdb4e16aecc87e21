//! The standing of the channel, for a verifier.

use crate::channel::Channel;
use crate::name::NodeName;
use crate::verify::row::{Family, Row};

impl Channel {
    pub(crate) fn write_standing(&self, row: &mut Row<'_>) {
        for (_, peer) in self.peers.iter() {
            row.flag(peer.alive);
            row.optional(peer.incarnation);
        }
        for (home, stream) in &self.streams {
            row.flag(stream.has_begun());
            row.number(Family::Seq(home.clone(), stream.incarnation().unwrap_or(0)), stream.applied());
        }
    }

    /// Whether `node` counts as alive here.
    pub(crate) fn counts_as_alive(&self, node: &NodeName) -> bool {
        self.peers.iter().any(|(name, peer)| name == node && peer.alive)
    }
}
