//! A cable between one node and its router that can be cut: what is under way then waits in it.

use std::io::{Read as _, Write as _};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Time between two looks at a cut cable.
const LOOK: Duration = Duration::from_millis(5);

/// Forwards TCP connections from its own port to another, unless it is cut.
pub struct Cable {
    port: u16,
    cut: Arc<AtomicBool>,
}

impl Cable {
    /// A cable to `to`, on a free port of its own.
    pub fn lay(to: u16) -> std::io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let port = listener.local_addr()?.port();
        let cut = Arc::new(AtomicBool::new(false));
        let shared = cut.clone();
        std::thread::Builder::new().name("cable".into()).spawn(move || {
            for near in listener.incoming().flatten() {
                let far = TcpStream::connect(SocketAddr::from((Ipv4Addr::LOCALHOST, to)));
                // Whoever connects in vain tries again.
                let Ok(far) = far else { continue };
                for (from, to) in [(near.try_clone(), far.try_clone()), (Ok(far), Ok(near))] {
                    if let (Ok(from), Ok(to)) = (from, to) {
                        let cut = shared.clone();
                        std::thread::spawn(move || forward(from, to, &cut));
                    }
                }
            }
        })?;
        Ok(Self { port, cut })
    }

    pub fn port(&self) -> u16 {
        self.port
    }

    /// Cuts it, or mends it.
    pub fn set_cut(&self, cut: bool) {
        self.cut.store(cut, Ordering::Relaxed);
    }
}

fn forward(mut from: TcpStream, mut to: TcpStream, cut: &AtomicBool) {
    let mut buffer = [0; 16384];
    while let Ok(length @ 1..) = from.read(&mut buffer) {
        while cut.load(Ordering::Relaxed) {
            std::thread::sleep(LOOK);
        }
        if to.write_all(&buffer[..length]).is_err() {
            break;
        }
    }
    // The other direction may have ended it already.
    let _ = to.shutdown(std::net::Shutdown::Both);
}
