//! The web server.

use std::net::TcpListener;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use axum::Router;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{ConnectInfo, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tokio::sync::{Semaphore, oneshot};

use super::client;
use super::listener::Listener;
use super::request::Mailbox;
use super::session::{Caller, Identity, Session};
use super::subscription::{Present, Subscription};
use super::tls::Tls;

/// So many browsers may watch at once.
const MOST_BROWSERS: usize = 64;
/// The station's loop speaks ten times a second; one that has not for so long does not go on.
const SPEAKS_WITHIN: Duration = Duration::from_secs(2);
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
const ASSETS: [Asset; 5] = [
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
    // The messages on `/live`, for other programs: written from the types here, which a test holds true.
    Asset {
        path: "/messages.ts",
        content_type: "text/plain; charset=utf-8",
        body: include_bytes!("../../console/src/messages.ts"),
    },
    Asset {
        path: "/vocabulary.ts",
        content_type: "text/plain; charset=utf-8",
        body: include_bytes!("../../console/src/vocabulary.ts"),
    },
];

#[derive(Clone)]
struct Shared {
    subscription: Subscription,
    mailbox: Mailbox,
    present: Present,
    seats: Arc<Semaphore>,
}

/// Serves on a thread of its own until `stopped`.
pub(super) fn start(
    (listener, tls): (TcpListener, Option<Tls>),
    (subscription, present): (Subscription, Present),
    mailbox: Mailbox,
    stopped: oneshot::Receiver<()>,
) -> std::io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let listener = {
        let _inside = runtime.enter();
        Listener::new(tokio::net::TcpListener::from_std(listener)?, tls)
    };
    let shared = Shared { subscription, mailbox, present, seats: Arc::new(Semaphore::new(MOST_BROWSERS)) };
    let service = router(shared).into_make_service_with_connect_info::<Caller>();
    let serve = async move {
        tokio::select! {
            outcome = async { axum::serve(listener, service).await } => {
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

fn router(shared: Shared) -> Router {
    let mut router = Router::new().route("/live", get(live)).route("/health", get(health));
    for asset in &ASSETS {
        let page = || async { ([(header::CONTENT_TYPE, asset.content_type)], asset.body) };
        router = router.route(asset.path, get(page));
    }
    router.layer(middleware::from_fn(guard)).with_state(shared)
}

/// Turns away pages of other origins, which could otherwise land the swarm from any browser on this computer, and
/// names that others have made to point here; and over TLS those who have no role.
async fn guard(ConnectInfo(caller): ConnectInfo<Caller>, request: Request, next: Next) -> Response {
    if let Err(why) = check(&caller.identity, request.headers()) {
        return (StatusCode::FORBIDDEN, why).into_response();
    }
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_SECURITY_POLICY, header::HeaderValue::from_static(CONTENT_POLICY));
    headers.insert(header::CACHE_CONTROL, header::HeaderValue::from_static("no-cache"));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, header::HeaderValue::from_static("nosniff"));
    response
}

/// Why a request is not answered, if so.
fn check(identity: &Identity, headers: &HeaderMap) -> Result<(), String> {
    match identity {
        // Over TLS the certificate is for the station's own names.
        Identity::Anybody if !is_local(headers) => return Err("the console answers to localhost only".into()),
        Identity::Stranger(name) => {
            return Err(format!(
                "the certificate of {name:?} has no role here: the station's [console.roles] must name it"
            ));
        }
        Identity::Anybody | Identity::Known(..) => {}
    }
    let scheme = if *identity == Identity::Anybody { "http://" } else { "https://" };
    if is_own_origin(scheme, headers) {
        Ok(())
    } else {
        Err("the console answers to its own page only".into())
    }
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

fn is_own_origin(scheme: &str, headers: &HeaderMap) -> bool {
    let host = text(headers, header::HOST).unwrap_or_default();
    // Programs that are no browsers send none.
    text(headers, header::ORIGIN).is_none_or(|origin| origin.strip_prefix(scheme) == Some(host))
}

/// Whether the station's loop goes on: 200 and its age if it has spoken of late, else 503. It is a JSON object.
async fn health(State(shared): State<Shared>) -> Response {
    let age = shared.subscription.age();
    let is_well = age.is_some_and(|age| age < SPEAKS_WITHIN);
    let age_ms = age.map_or_else(|| "null".to_owned(), |age| age.as_millis().to_string());
    let body = format!("{{\"ok\":{is_well},\"age_ms\":{age_ms}}}\n");
    let status = if is_well { StatusCode::OK } else { StatusCode::SERVICE_UNAVAILABLE };
    (status, [(header::CONTENT_TYPE, "application/json")], body).into_response()
}

async fn live(
    State(shared): State<Shared>,
    ConnectInfo(caller): ConnectInfo<Caller>,
    upgrade: WebSocketUpgrade,
) -> Response {
    let Ok(seat) = shared.seats.clone().try_acquire_owned() else {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many browsers watch already").into_response();
    };
    upgrade.max_message_size(LONGEST_REQUEST).max_frame_size(LONGEST_REQUEST).on_upgrade(
        async move |socket| {
            let session = Session::new(caller, shared.present);
            client::attend(socket, session, shared.subscription, &shared.mailbox).await;
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
        let is_own = |scheme, origin| is_own_origin(scheme, &headers("127.0.0.1:8700", origin));
        assert!(is_own("http://", Some("http://127.0.0.1:8700")) && is_own("http://", None));
        assert!(is_own("https://", Some("https://127.0.0.1:8700")));
        for origin in ["http://127.0.0.1:8701", "https://127.0.0.1:8700", "https://example.org", "null"] {
            assert!(!is_own("http://", Some(origin)), "{origin} was answered");
        }
    }

    #[test]
    fn over_tls_those_without_a_role_are_turned_away_and_told_the_remedy() {
        let headers = headers("station.example:8700", None);
        let known = Identity::Known(crate::giver::Giver::new("Anna").unwrap(), super::super::Role::Observer);
        assert_eq!(check(&known, &headers), Ok(()));
        let why = check(&Identity::Stranger("uav/1;1".into()), &headers).unwrap_err();
        assert!(why.contains("uav/1;1") && why.contains("[console.roles]"), "{why}");
        assert!(check(&Identity::Anybody, &headers).is_err(), "by another name without TLS");
    }
}
