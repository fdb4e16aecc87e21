//! The ground station: it launches the swarm, carries the operator's orders to it, and records what happens.
//!
//! [`GroundCore`] is the station without I/O: a behavioural program ([`bthreads`]) joined to those of the vehicles. An
//! [`Order`](skein_wire::Order) becomes an event of the station; the b-threads do the rest, by blocking (`hold`) and by requesting at each
//! vehicle's gateway (`land`, `return`). The [`recorder`] writes a mission as an MCAP file; the
//! `console` (a feature) shows the swarm in a browser and takes the operator's orders from it. [`explain`] says why a
//! vehicle stands still, live and of a recording.
//!
//! ```
//! use std::time::Duration;
//! use skein_ground::{Giver, GroundConfig, GroundCore};
//! use skein_wire::event::What;
//! use skein_wire::{Fleet, Network, NetworkConfig, NodeName, Order, Who};
//!
//! let (ground, vehicle) = (NodeName::new("ground/main")?, NodeName::new("uav/1")?);
//! let network = Network::new(NetworkConfig::default(), 0);
//! let mut link = network.join(&ground);
//! let mut station = GroundCore::new(GroundConfig::new(Fleet::new("demo")?, ground, vec![vehicle]));
//! station.order(&Giver::new("Anna")?, &Order::new(What::Hold, Who::All))?;
//! station.tick(Duration::ZERO, &mut link)?;
//! assert!(station.take_selections().iter().any(|happened| happened.event.kind() == "ordered"));
//! assert!(station.finished().is_none());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod bthreads;
#[cfg(feature = "zenoh")]
mod cli;
mod config;
#[cfg(feature = "zenoh")]
pub mod config_file;
#[cfg(feature = "console")]
pub mod console;
mod core;
pub mod explain;
mod giver;
mod launch_offer;
mod order;
mod order_log;
pub mod planning;
pub mod recorder;
mod refusal;
pub mod replay;
mod zone_log;

pub use crate::core::GroundCore;
pub use bthreads::MissionOutcome;
#[cfg(feature = "zenoh")]
pub use cli::main;
pub use config::GroundConfig;
pub use giver::{Giver, UnfitName};
pub use launch_offer::{Candidate, LaunchOffer, OFFER_LASTS};
pub use order::{UnfitScript, to_send};
pub use order_log::{Answer, OrderRecord};
pub use refusal::Refusal;
pub use zone_log::ZoneRecord;
