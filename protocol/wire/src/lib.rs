//! The messages between nodes: their forms and keys, the [`Link`] seam and a [`Network`] in memory.
//!
//! The protocol's records ([`skein_dbp::Message`]) and each vehicle's [`State`] travel as protobuf under keys
//! `skein/<fleet>/<what>/<node>/...`. A [`NodeLink`] couples a [`skein_dbp::Node`] to any [`Link`]; the
//! catalogue in [`event`] declares the events that nodes agree on.
//!
//! ```
//! use std::time::Duration;
//! use skein_bp::{Program, ProgramConfig};
//! use skein_dbp::{Node, NodeConfig};
//! use skein_wire::{Fleet, Network, NetworkConfig, NodeLink, NodeName};
//!
//! let names = vec![NodeName::new("uav/1")?, NodeName::new("uav/2")?];
//! let network = Network::new(NetworkConfig::default(), 1);
//! let mut nodes = Vec::new();
//! for name in &names {
//!     let node = Node::new(NodeConfig::new(name.clone(), 1, names.clone()), Program::new(ProgramConfig::default()));
//!     nodes.push((NodeLink::new(node, Fleet::new("demo")?), network.join(name)));
//! }
//! for tick in 0..10 {
//!     let now = Duration::from_millis(20 * tick);
//!     network.advance(now);
//!     for (node, link) in &mut nodes {
//!         node.pump(now, link)?;
//!     }
//! }
//! assert!(nodes.iter().all(|(node, _)| node.node().peers().all(|(_, peer)| peer.alive)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod authority;
mod decode_error;
pub mod event;
mod key;
mod limits;
mod link;
mod mailbox;
mod message;
mod network;
mod node_link;
mod order;
pub mod proto;
mod route;
mod saver;
mod share;
mod store;
mod trace;
mod vehicle_link;
mod zone;

/// The compiled `proto/skein.proto`, a `FileDescriptorSet`: the schema to put beside recorded messages.
pub const FILE_DESCRIPTOR_SET: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/skein.bin"));

pub use authority::{joint_roster, standard_authority};
pub use decode_error::DecodeError;
pub use key::{Fleet, Key, KeyError};
pub use limits::Limits;
pub use link::Link;
pub use mailbox::{Mailbox, Owner};
pub use message::*;
pub use network::{MemoryLink, Network, NetworkConfig, NetworkStats};
pub use node_link::{NodeLink, NodeLinkStats, SenderStats};
pub use order::{Destination, Details, Order, SentScript, Who};
pub use proto::{MAX_PAYLOAD, VERSION};
pub use route::{Route, UnfitRoute};
pub use saver::Saver;
pub use skein_dbp::{NodeName, NodeNameError};
pub use store::{KeptScript, KeptZone, MemoryStore, Saving, Store};
pub use vehicle_link::VehicleLink;
pub use zone::{Outline, UnfitZone, Zone, ZoneTable};
