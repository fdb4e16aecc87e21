//! Zenoh as a [`skein_wire::Link`]: a session behind bounded queues.
//!
//! A [`ZenohSession`] does all its work where Zenoh does its own. A [`ZenohLink`] hands messages to it through a
//! bounded queue and takes what has arrived from a bounded ring, so that no control loop ever waits for the network:
//! what does not fit is dropped and counted, and the protocol above repeats it. Congested links drop too
//! (`CongestionControl::Drop`). A program that calls [`share_threads`] first has messages wake fewer threads.
//!
//! Several nodes of one process share a session; other processes connect to its [`locators`](ZenohSession::locators).
//! Without security configured, only the loopback interface is used; nothing is announced by multicast or to third
//! ones. With it, links are encrypted, and a node may say and hear what is its own by the name of its certificate
//! ([`Roster`]).
//!
//! ```
//! use skein_wire::{Fleet, NodeName};
//! use skein_zenoh::{NetworkSettings, ZenohConfig, ZenohSession};
//!
//! let session = ZenohSession::open(ZenohConfig::new(Fleet::new("demo")?, NetworkSettings::default()))?;
//! let link = session.link(&NodeName::new("uav/1")?)?;
//! assert!(session.locators()[0].starts_with("tcp/127.0.0.1:"));
//! assert_eq!(link.stats().received, 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod access;
#[cfg(feature = "authority")]
mod authority;
mod bell;
mod certificate;
mod complaints;
mod config;
mod error;
mod inbox;
mod link;
mod links;
mod log;
mod queue;
mod roster;
mod security;
mod session;

#[cfg(feature = "authority")]
pub use authority::{Authority, AuthorityError, Holder, Issued};
pub use bell::Bell;
pub use certificate::{CertificateError, Fault, check as check_certificate};
pub use complaints::Complaints;
pub use config::{Mode, NetworkSettings, ZenohConfig};
pub use error::ZenohError;
pub use link::{ZenohLink, ZenohLinkStats};
pub use links::{overhearing, take as take_refusals};
pub use log::log;
pub use queue::ZenohStats;
pub use roster::{FIRST_SERIAL, Roster, RosterError, Unlisted};
pub use security::Security;
pub use session::{ZenohSession, share_threads};
