//! Zenoh as a [`skein_wire::Link`]: a session behind bounded queues.
//!
//! A [`ZenohSession`] does all its work on a thread of its own. A [`ZenohLink`] hands messages to it through a bounded
//! queue and takes what has arrived from a bounded ring, so that no control loop ever waits for the network: what does
//! not fit is dropped and counted, and the protocol above repeats it. Congested links drop too
//! (`CongestionControl::Drop`).
//!
//! Several nodes of one process share a session; other processes connect to its [`locators`](ZenohSession::locators).
//! Without security configured, only the loopback interface is used, and nothing is announced by multicast.
//!
//! ```
//! use skein_wire::{Fleet, NodeName};
//! use skein_zenoh::{ZenohConfig, ZenohSession};
//!
//! let session = ZenohSession::open(ZenohConfig::new(Fleet::new("demo")?))?;
//! let link = session.link(&NodeName::new("uav/1")?)?;
//! assert!(session.locators()[0].starts_with("tcp/127.0.0.1:"));
//! assert_eq!(link.stats().received, 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod config;
mod error;
mod inbox;
mod link;
mod session;

pub use config::ZenohConfig;
pub use error::ZenohError;
pub use link::{ZenohLink, ZenohLinkStats};
pub use session::{ZenohSession, ZenohStats};
