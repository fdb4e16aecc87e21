//! Faults of a session.

use skein_wire::NodeName;

use crate::certificate::CertificateError;
use crate::roster::RosterError;

/// Why a session cannot be opened, or a link not be had.
#[derive(Debug, thiserror::Error)]
pub enum ZenohError {
    #[error(
        "`{endpoint}` is not an endpoint: expected `tcp/<address>:<port>` or `tls/<address>:<port>`, such as `tcp/127.0.0.1:7447`"
    )]
    Endpoint { endpoint: String },
    #[error(
        "`{endpoint}` is not on the loopback interface, where only `tls/` is accepted: configure `[network.security]`, or use `127.0.0.1`, `[::1]` or `localhost`"
    )]
    NotLoopback { endpoint: String },
    #[error(
        "`{endpoint}` needs certificates: configure `authority`, `certificate` and `key` under `[network.security]`"
    )]
    NoCertificates { endpoint: String },
    #[error(
        "`{endpoint}` is not encrypted: with `[network.security]` every endpoint is of the form `tls/<address>:<port>`"
    )]
    NotEncrypted { endpoint: String },
    #[error(transparent)]
    Certificate(#[from] CertificateError),
    #[error(transparent)]
    Roster(#[from] RosterError),
    #[error("`[network.security]` is for one node of a roster, and this session is nobody's")]
    Nobody,
    #[error(
        "`mode = \"client\"` with `[network.security]` needs a roster that says who relays: name its file, `roster`, there"
    )]
    NobodyRelays,
    #[error(
        "`mode = \"router\"`, and the roster does not trust {node} with what others say: add it to `relays`"
    )]
    NoRelay { node: NodeName },
    #[error("`mode = \"client\"` needs a router to connect to: name its endpoint in `connect`")]
    ClientOfNobody,
    #[error("no free port for `{endpoint}`: {cause}")]
    NoPort { endpoint: String, cause: std::io::Error },
    #[error("Zenoh refuses the setting `{key}` = {value}: {cause}")]
    Config { key: &'static str, value: String, cause: zenoh::Error },
    #[error("cannot open a Zenoh session on {listen:?}: {cause}")]
    Open { listen: Vec<String>, cause: zenoh::Error },
    #[error("cannot subscribe to `{pattern}`: {cause}")]
    Subscribe { pattern: String, cause: zenoh::Error },
    #[error("the session has ended")]
    ThreadGone,
}
