//! Faults of a session.

/// Why a session cannot be opened, or a link not be had.
#[derive(Debug, thiserror::Error)]
pub enum ZenohError {
    /// An endpoint of another form.
    #[error(
        "`{endpoint}` is not an endpoint: expected `tcp/<address>:<port>` or `tls/<address>:<port>`, such as `tcp/127.0.0.1:7447`"
    )]
    Endpoint { endpoint: String },
    /// An endpoint that others could reach, or that leads to others, with nothing to tell friend from foe.
    #[error(
        "`{endpoint}` is not on the loopback interface, where only `tls/` is accepted: configure `[network.security]`, or use `127.0.0.1`, `[::1]` or `localhost`"
    )]
    NotLoopback { endpoint: String },
    /// An encrypted endpoint without certificates.
    #[error(
        "`{endpoint}` needs certificates: configure `authority`, `certificate` and `key` under `[network.security]`"
    )]
    NoCertificates { endpoint: String },
    /// A client with no router to connect to.
    #[error("`mode = \"client\"` needs a router to connect to: name its endpoint in `connect`")]
    ClientOfNobody,
    /// The system gives no port.
    #[error("no free port for `{endpoint}`: {source}")]
    NoPort { endpoint: String, source: std::io::Error },
    /// Zenoh does not take a setting.
    #[error("Zenoh refuses the setting `{key}` = {value}: {source}")]
    Config { key: &'static str, value: String, source: zenoh::Error },
    /// Zenoh cannot open the session, because an endpoint is in use already, for one.
    #[error("cannot open a Zenoh session on {listen:?}: {source}")]
    Open { listen: Vec<String>, source: zenoh::Error },
    /// Zenoh cannot subscribe.
    #[error("cannot subscribe to `{pattern}`: {source}")]
    Subscribe { pattern: String, source: zenoh::Error },
    /// The thread of the session cannot be started or has ended.
    #[error("the session has ended")]
    ThreadGone,
}
