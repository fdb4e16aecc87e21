//! The web server.

use std::net::TcpListener;
use std::sync::Arc;
use std::thread;

use axum::Router;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::serve::ListenerExt as _;
use tokio::sync::{Semaphore, oneshot};

use super::client;
use super::request::Mailbox;
use super::subscription::Subscription;

/// So many browsers may watch at once.
const MOST_BROWSERS: usize = 64;
/// Longest message that a browser may send, in bytes.
const LONGEST_REQUEST: usize = 64 << 10;
/// The page needs nothing from elsewhere, and belongs in no other page.
const CONTENT_POLICY: &str = "default-src 'self'; img-src 'self' data: blob:; frame-ancestors 'none'";

/// One file of the page.
struct Asset {
    path: &'static str,
    content_type: &'static str,
    body: &'static [u8],
}

/// All files of the page. Without Node at build time, the first says what to install.
const ASSETS: [Asset; 3] = [
    Asset {
        path: "/",
        content_type: "text/html; charset=utf-8",
        body: include_bytes!(concat!(env!("OUT_DIR"), "/console/index.html")),
    },
    Asset {
        path: "/app.js",
        content_type: "text/javascript; charset=utf-8",
        body: include_bytes!(concat!(env!("OUT_DIR"), "/console/app.js")),
    },
    Asset {
        path: "/app.css",
        content_type: "text/css; charset=utf-8",
        body: include_bytes!(concat!(env!("OUT_DIR"), "/console/app.css")),
    },
];

#[derive(Clone)]
struct Shared {
    subscription: Subscription,
    mailbox: Mailbox,
    seats: Arc<Semaphore>,
}

/// Serves on a thread of its own until `stopped`.
pub(super) fn start(
    listener: TcpListener,
    subscription: Subscription,
    mailbox: Mailbox,
    stopped: oneshot::Receiver<()>,
) -> std::io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let listener = {
        let _inside = runtime.enter();
        tokio::net::TcpListener::from_std(listener)?
    };
    let shared = Shared { subscription, mailbox, seats: Arc::new(Semaphore::new(MOST_BROWSERS)) };
    let serve = async move {
        tokio::select! {
            outcome = async { axum::serve(listener.tap_io(send_at_once), router(shared)).await } => {
                if let Err(error) = outcome {
                    tracing::error!("the console has ended: {error}");
                }
            }
            _ = stopped => {}
        }
    };
    thread::Builder::new().name("console".into()).spawn(move || runtime.block_on(serve))?;
    Ok(())
}

/// An answer to an order waits for no further one.
fn send_at_once(stream: &mut tokio::net::TcpStream) {
    // Without it, everything works, but later.
    let _ = stream.set_nodelay(true);
}

fn router(shared: Shared) -> Router {
    let mut router = Router::new().route("/live", get(live));
    for asset in &ASSETS {
        let page = || async { ([(header::CONTENT_TYPE, asset.content_type)], asset.body) };
        router = router.route(asset.path, get(page));
    }
    router.layer(middleware::from_fn(guard)).with_state(shared)
}

/// Turns away pages of other origins, which could otherwise land the swarm from any browser on this computer, and
/// names that others have made to point here.
async fn guard(request: Request, next: Next) -> Response {
    let headers = request.headers();
    if !is_local(headers) {
        return (StatusCode::FORBIDDEN, "the console answers to localhost only").into_response();
    }
    if !is_own_origin(headers) {
        return (StatusCode::FORBIDDEN, "the console answers to its own page only").into_response();
    }
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_SECURITY_POLICY, header::HeaderValue::from_static(CONTENT_POLICY));
    headers.insert(header::CACHE_CONTROL, header::HeaderValue::from_static("no-cache"));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, header::HeaderValue::from_static("nosniff"));
    response
}

fn text(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    headers.get(name)?.to_str().ok()
}

fn is_local(headers: &HeaderMap) -> bool {
    let host = text(headers, header::HOST).unwrap_or_default();
    let name = host.rsplit_once(':').filter(|(_, port)| !port.ends_with(']')).map_or(host, |(name, _)| name);
    let bare = name.trim_start_matches('[').trim_end_matches(']');
    bare == "localhost" || bare.parse::<std::net::IpAddr>().is_ok_and(|address| address.is_loopback())
}

fn is_own_origin(headers: &HeaderMap) -> bool {
    let host = text(headers, header::HOST).unwrap_or_default();
    // Programs that are no browsers send none.
    text(headers, header::ORIGIN).is_none_or(|origin| origin.strip_prefix("http://") == Some(host))
}

async fn live(State(shared): State<Shared>, upgrade: WebSocketUpgrade) -> Response {
    let Ok(seat) = shared.seats.clone().try_acquire_owned() else {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many browsers watch already").into_response();
    };
    upgrade.max_message_size(LONGEST_REQUEST).max_frame_size(LONGEST_REQUEST).on_upgrade(
        async move |socket| {
            client::attend(socket, shared.subscription, &shared.mailbox).await;
            drop(seat);
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(host: &'static str, origin: Option<&'static str>) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, header::HeaderValue::from_static(host));
        if let Some(origin) = origin {
            headers.insert(header::ORIGIN, header::HeaderValue::from_static(origin));
        }
        headers
    }

    #[test]
    fn only_this_computer_is_answered() {
        for host in ["127.0.0.1:8700", "localhost", "localhost:80", "[::1]:8700", "[::1]"] {
            assert!(is_local(&headers(host, None)), "{host} was turned away");
        }
        for host in ["example.org", "example.org:8700", "192.168.0.1:8700", "", "localhost.example.org"] {
            assert!(!is_local(&headers(host, None)), "{host} was answered");
        }
    }

    #[test]
    fn pages_of_others_are_turned_away() {
        assert!(is_own_origin(&headers("127.0.0.1:8700", Some("http://127.0.0.1:8700"))));
        assert!(is_own_origin(&headers("127.0.0.1:8700", None)));
        for origin in ["http://127.0.0.1:8701", "https://example.org", "null"] {
            assert!(!is_own_origin(&headers("127.0.0.1:8700", Some(origin))), "{origin} was answered");
        }
    }
}
