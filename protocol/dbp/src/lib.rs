//! Behavioural programming across nodes, without I/O.
//!
//! Each node runs its own b-program ([`skein_bp::Program`]). Every event has one *home*, the node named by its first
//! two chunks: `uav/3/takeoff` is selected on `uav/3` and nowhere else. A b-thread that requests or blocks an event of
//! another node is represented there by a proxy, whose bid travels as state under a lease ([`BidRecord`]). What has
//! occurred travels back as a numbered stream ([`Occurrence`]) and is told to b-threads before anything else.
//!
//! These promises hold under loss, delay, repetition, partition and crash:
//! - order (G1): a home's occurrences are seen in order; a hole is repaired or becomes a `gap`;
//! - cause (G2): an event occurs only while a bid in its home's table requests it;
//! - confirmed block (G3): after `confirmed` a blocked event does not occur until the block is withdrawn, or its holder
//!   has been told `block_lapsed`;
//! - once (G4): one request is served at most once;
//! - loss (G5): requests and blocks of a lost node lapse with its lease, but for blocks that are to outlive it;
//! - safe alone (G6): safety events never wait for another node;
//! - joint (G8): a `swarm/...` event is decided once, by the coordinator of a [`Roster`], on fresh word from all of it;
//! - authority (G7): a bid outside its sender's rights counts for nothing, and both ends are told why.
//!
//! A node learns of all this through events under its own name, the [`facts`].
//!
//! ```
//! use std::time::Duration;
//! use skein_bp::script::{Op, Script};
//! use skein_bp::{Bid, Program, ProgramConfig};
//! use skein_dbp::{Node, NodeConfig, NodeName, Recipient};
//!
//! let (ground, uav) = (NodeName::new("ground/main")?, NodeName::new("uav/1")?);
//! let roster = vec![ground.clone(), uav.clone()];
//! let mut program = Program::new(ProgramConfig::default());
//! program.add("launch", Script::new(&[Op::Sync(Bid::new().request("uav/1/takeoff"))])?);
//! let mut a = Node::new(NodeConfig::new(ground, 1, roster.clone()), program);
//! let mut b = Node::new(NodeConfig::new(uav, 1, roster), Program::new(ProgramConfig::default()));
//!
//! let mut now = Duration::ZERO;
//! while a.stats().heard == 0 && now < Duration::from_secs(1) {
//!     a.step(now)?;
//!     b.step(now)?;
//!     a.take_outgoing().into_iter().for_each(|(_, message)| b.handle(now, message));
//!     b.take_outgoing().into_iter().for_each(|(_, message)| a.handle(now, message));
//!     now += Duration::from_millis(20);
//! }
//! let happened = b.take_selections();
//! assert!(happened.iter().any(|h| h.event.name() == "uav/1/takeoff" && *h.requested_by[0] == *"ground/main#launch"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod allowance;
mod board;
mod channel;
mod clock;
mod config;
mod error;
pub mod facts;
mod guest;
mod history;
mod home;
mod joint;
mod kept;
mod message;
#[cfg(feature = "mutants")]
mod mutant;
mod name;
mod node;
mod routes;
mod rule;
mod run;
pub mod verify;

pub use board::{Board, BoardLease, BoardRequest, BoardRow, shortened};
pub use channel::peers::Peer;
pub use config::NodeConfig;
pub use error::NodeError;
pub use home::authority::{Authority, Grant, Role, SCRIPT};
pub use home::table::RemoteParty;
pub use joint::roster::{Roster, RosterError, SWARM};
pub use kept::{Kept, KeptBlock};
pub use message::{
    BidAck, BidRecord, JointWord, Message, Occurrence, OnLoss, Presence, Recipient, Refusal, RefusalReason,
    RemoteBid, Repair, ServedRequest,
};
#[cfg(feature = "mutants")]
pub use mutant::Mutant;
pub use name::{NodeName, NodeNameError, first_two_chunks, is_chunk};
pub use node::{Caused, Node, NodeExplanation, NodeStats};
pub use rule::{Lift, NewRoster, RULES};
pub use run::{BoardChange, ChannelMove, Happened};
