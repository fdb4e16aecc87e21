//! The console: the swarm in a browser, live, and the operator's orders back from it.
//!
//! A [`Console`] serves a page on a thread of its own. The station's loop tells it what is so with
//! [`publish`](Console::publish) and asks it for orders with [`take_orders`](Console::take_orders); neither ever waits.
//! A browser that does not read gets the newest when it does; it holds up nobody.
//!
//! On the loopback interface only this computer can open it, and anybody on it may be anybody. Beyond it, TLS only: a
//! browser shows a certificate of the fleet's authority, which has a [`Role`]. Only pages that it serves itself may
//! speak to it.

mod client;
mod feed;
mod listener;
mod plan_view;
mod request;
mod server;
mod session;
mod subscription;
#[cfg(test)]
mod tests;
mod tls;
mod token;

use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

use skein_dbp::Happened;
use skein_wire::Scene;
use tokio::sync::oneshot;

pub use self::request::{Wish, check_message};
pub use self::session::Role;
pub use self::tls::{ConsoleSecurity, ConsoleSecurityError};
use self::{feed::Feed, request::Mailbox, subscription::Present};
use crate::core::GroundCore;
use crate::giver::Giver;
use crate::replay::Replay;

/// So many orders may wait for the station's loop.
const ORDERS_WAITING: usize = 64;

/// Why the console cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum ConsoleError {
    #[error(
        "console address `{address}` is not on the loopback interface, and beyond it the console is served over TLS only: \
         use 127.0.0.1 and a tunnel, or give [console] certificates and [console.roles]"
    )]
    NotLoopback { address: SocketAddr },
    #[error(transparent)]
    Security(#[from] ConsoleSecurityError),
    #[error("console address `{address}`: {cause}; use another port, or 0 for any that is free")]
    Listen { address: SocketAddr, cause: std::io::Error },
    #[error("the console's thread cannot be started: {0}")]
    Thread(std::io::Error),
}

/// The console's server. It ends when this is dropped.
pub struct Console {
    address: SocketAddr,
    scheme: &'static str,
    feed: Feed,
    present: Present,
    orders: Receiver<Wish>,
    _stop: oneshot::Sender<()>,
}

impl Console {
    /// Serves the console at `address`; port 0 is any free one. `wake` is called when an order waits to be taken.
    ///
    /// # Errors
    /// [`ConsoleError`]: the address is not free, or beyond the loopback interface without `security`; a certificate
    /// cannot be used.
    pub fn serve(
        address: SocketAddr,
        security: Option<&ConsoleSecurity>,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Result<Self, ConsoleError> {
        if security.is_none() && !address.ip().is_loopback() {
            return Err(ConsoleError::NotLoopback { address });
        }
        let tls = security.map(ConsoleSecurity::open).transpose()?;
        let scheme = if tls.is_some() { "https" } else { "http" };
        let listen = |cause| ConsoleError::Listen { address, cause };
        let listener = std::net::TcpListener::bind(address).map_err(listen)?;
        listener.set_nonblocking(true).map_err(listen)?;
        let bound = listener.local_addr().map_err(listen)?;
        let (put, orders): (SyncSender<Wish>, _) = sync_channel(ORDERS_WAITING);
        let (feed, subscription) = Feed::new();
        let (stop, stopped) = oneshot::channel();
        let mailbox = Mailbox::new(put, wake);
        let present = Present::default();
        server::start((listener, tls), (subscription, present.clone()), mailbox, stopped)
            .map_err(ConsoleError::Thread)?;
        Ok(Self { address: bound, scheme, feed, present, orders, _stop: stop })
    }

    /// The address for a browser.
    pub fn url(&self) -> String {
        format!("{}://{}", self.scheme, self.address)
    }

    /// Names the file in which the mission is recorded, with the next scene.
    pub fn note_recording(&mut self, path: &Path) {
        self.feed.recording = path.display().to_string();
    }

    /// Shows what stands in the world, if that is known.
    pub fn show_scene(&mut self, station: &GroundCore, scene: Option<&Scene>) {
        self.feed.show_scene(station, scene);
    }

    /// Shows what is so now, and what has `happened` since the last call.
    pub fn publish(&mut self, now: Duration, station: &GroundCore, happened: &[Happened]) {
        self.feed.publish(now, station, happened);
    }

    /// Shows where a recording is now, in the place of a live swarm.
    pub fn show_replay(&mut self, replay: &mut Replay) {
        self.feed.show_replay(replay);
    }

    /// The wishes of operators since the last call: see [`Wish::carry_out`].
    pub fn take_orders(&self) -> impl Iterator<Item = Wish> + '_ {
        self.orders.try_iter()
    }

    /// Those who are there now to give orders: see [`GroundCore::attend`].
    pub fn present(&self) -> BTreeSet<Giver> {
        self.present.names()
    }
}
