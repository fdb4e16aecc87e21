//! Where browsers come in: plain on the loopback interface, over TLS elsewhere.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::connect_info::Connected;
use axum::serve::IncomingStream;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, mpsc};
use tokio::time::{sleep, timeout};
use tokio_rustls::TlsAcceptor;

use super::session::{Caller, Identity};
use super::tls::Tls;

/// A browser has so long to say who it is.
const PATIENCE: Duration = Duration::from_secs(5);
/// So many may be about to say who they are; further ones are hung up on.
const MOST_GREETED: usize = 32;
/// When no connection can be taken, the next attempt comes after this.
const RETRY: Duration = Duration::from_millis(200);

/// A connection.
pub(super) trait Stream: AsyncRead + AsyncWrite + Unpin + Send {}
impl<T: AsyncRead + AsyncWrite + Unpin + Send> Stream for T {}

type Come = (Box<dyn Stream>, Caller);

/// Takes connections; nobody who is slow to say who they are keeps others waiting.
pub(super) struct Listener {
    listener: TcpListener,
    tls: Option<Tls>,
    greeted: Arc<Semaphore>,
    known: (mpsc::Sender<Come>, mpsc::Receiver<Come>),
}

impl Listener {
    /// Listens with TLS, or without.
    pub(super) fn new(listener: TcpListener, tls: Option<Tls>) -> Self {
        let greeted = Arc::new(Semaphore::new(MOST_GREETED));
        Self { listener, tls, greeted, known: mpsc::channel(MOST_GREETED) }
    }

    /// A connection that needs no greeting; one that does follows once it is known who it is.
    fn take(&self, stream: TcpStream, address: SocketAddr) -> Option<Come> {
        // An answer to an order waits for no further one. Without it, everything works, but later.
        let _ = stream.set_nodelay(true);
        let Some(tls) = self.tls.clone() else {
            return Some((Box::new(stream), Caller { address, identity: Identity::Anybody }));
        };
        if let Ok(place) = self.greeted.clone().try_acquire_owned() {
            let known = self.known.0.clone();
            tokio::spawn(async move {
                let greeting = TlsAcceptor::from(tls.server.clone()).accept(stream);
                match timeout(PATIENCE, greeting).await {
                    Ok(Ok(stream)) => {
                        let identity = tls.identity(stream.get_ref().1);
                        let _ = known.send((Box::new(stream), Caller { address, identity })).await;
                    }
                    Ok(Err(error)) => tracing::debug!("console: {address} was turned away: {error}"),
                    Err(_) => tracing::debug!("console: {address} did not say who it is"),
                }
                drop(place);
            });
        }
        None
    }
}

impl axum::serve::Listener for Listener {
    type Io = Box<dyn Stream>;
    type Addr = Caller;

    async fn accept(&mut self) -> Come {
        loop {
            let accepted = tokio::select! {
                Some(come) = self.known.1.recv() => return come,
                accepted = self.listener.accept() => accepted,
            };
            match accepted {
                Ok((stream, address)) => {
                    if let Some(come) = self.take(stream, address) {
                        return come;
                    }
                }
                Err(_) => sleep(RETRY).await,
            }
        }
    }

    fn local_addr(&self) -> std::io::Result<Caller> {
        Ok(Caller { address: self.listener.local_addr()?, identity: Identity::Anybody })
    }
}

impl Connected<IncomingStream<'_, Listener>> for Caller {
    fn connect_info(stream: IncomingStream<'_, Listener>) -> Self {
        stream.remote_addr().clone()
    }
}
