//! The console: the swarm in a browser, live, and the operator's orders back from it.
//!
//! A [`Console`] serves a page on a thread of its own. The station's loop tells it what is so with
//! [`publish`](Console::publish) and asks it for orders with [`take_orders`](Console::take_orders); neither ever waits. A
//! browser that does not read gets the newest when it does; it holds up nobody.
//!
//! Only this computer can open it, and only pages that it serves itself may speak to it.

mod client;
mod feed;
mod request;
mod server;
mod subscription;
#[cfg(test)]
mod tests;

use std::net::SocketAddr;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

use skein_dbp::Happened;
use skein_wire::Scene;
use tokio::sync::oneshot;

pub use self::request::Wish;
use self::{feed::Feed, request::Mailbox};
use crate::core::GroundCore;

/// So many orders may wait for the station's loop.
const ORDERS_WAITING: usize = 64;

/// Why the console cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum ConsoleError {
    #[error(
        "console address `{address}` is not on the loopback interface: use 127.0.0.1, and a tunnel from elsewhere"
    )]
    NotLoopback { address: SocketAddr },
    #[error("console address `{address}`: {source}; use another port, or 0 for any that is free")]
    Listen { address: SocketAddr, source: std::io::Error },
    #[error("the console's thread cannot be started: {0}")]
    Thread(std::io::Error),
}

/// The console's server. It ends when this is dropped.
pub struct Console {
    address: SocketAddr,
    feed: Feed,
    orders: Receiver<Wish>,
    _stop: oneshot::Sender<()>,
}

impl Console {
    /// Serves the console at `address`; port 0 is any free one. `wake` is called when an order waits to be taken.
    pub fn serve(address: SocketAddr, wake: impl Fn() + Send + Sync + 'static) -> Result<Self, ConsoleError> {
        if !address.ip().is_loopback() {
            return Err(ConsoleError::NotLoopback { address });
        }
        let listen = |source| ConsoleError::Listen { address, source };
        let listener = std::net::TcpListener::bind(address).map_err(listen)?;
        listener.set_nonblocking(true).map_err(listen)?;
        let bound = listener.local_addr().map_err(listen)?;
        let (put, orders): (SyncSender<Wish>, _) = sync_channel(ORDERS_WAITING);
        let (feed, subscription) = Feed::new();
        let (stop, stopped) = oneshot::channel();
        let mailbox = Mailbox::new(put, wake);
        server::start(listener, subscription, mailbox, stopped).map_err(ConsoleError::Thread)?;
        Ok(Self { address: bound, feed, orders, _stop: stop })
    }

    /// The address for a browser.
    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Shows what stands in the world, if that is known.
    pub fn show_scene(&mut self, station: &GroundCore, scene: Option<&Scene>) {
        self.feed.show_scene(station, scene);
    }

    /// Shows what is so now, and what has `happened` since the last call.
    pub fn publish(&mut self, now: Duration, station: &GroundCore, happened: &[Happened]) {
        self.feed.publish(now, station, happened);
    }

    /// The orders that operators have given since the last call.
    pub fn take_orders(&self) -> impl Iterator<Item = Wish> + '_ {
        self.orders.try_iter()
    }
}
