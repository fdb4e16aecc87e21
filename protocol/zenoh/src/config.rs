//! Where a session listens and connects.

use std::net::{IpAddr, TcpListener};

use skein_wire::Fleet;

use crate::ZenohError;

/// What a [`ZenohSession`](crate::ZenohSession) is told when it opens.
///
/// Nothing is found by multicast: who is to be reached is named. Endpoints are Zenoh's, `tcp/127.0.0.1:7447`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ZenohConfig {
    /// The fleet; sessions of other fleets are not heard.
    pub fleet: Fleet,
    /// Where others may connect; port 0 is any free one, see [`ZenohSession::locators`](crate::ZenohSession::locators).
    pub listen: Vec<String>,
    /// Whom to connect to, again and again until it is there.
    pub connect: Vec<String>,
    /// How many messages may wait to be put. Beyond, new ones are dropped: bids and states are repeated anyway,
    /// occurrences are repaired.
    pub outgoing_capacity: usize,
    /// How many messages may wait for each link. Beyond, the oldest are dropped.
    pub incoming_capacity: usize,
}

impl ZenohConfig {
    /// A session of `fleet` that listens on a free port of the loopback interface.
    #[must_use]
    pub fn new(fleet: Fleet) -> Self {
        Self {
            fleet,
            listen: vec!["tcp/127.0.0.1:0".into()],
            connect: Vec::new(),
            outgoing_capacity: 4096,
            incoming_capacity: 4096,
        }
    }

    /// Zenoh's own configuration, with the endpoints that are listened on in the end.
    pub(crate) fn to_zenoh(&self) -> Result<(zenoh::Config, Vec<String>), ZenohError> {
        self.connect.iter().try_for_each(|endpoint| loopback_host(endpoint).map(|_| ()))?;
        let listen = self.listen.iter().map(|endpoint| with_port(endpoint)).collect::<Result<Vec<_>, _>>()?;
        let mut config = zenoh::Config::default();
        for (key, value) in [
            ("mode", r#""peer""#.to_owned()),
            ("scouting/multicast/enabled", "false".into()),
            // Without multicast there is nothing to wait for at opening.
            ("scouting/delay", "0".into()),
            ("listen/endpoints", json_list(&listen)),
            ("connect/endpoints", json_list(&self.connect)),
        ] {
            config.insert_json5(key, &value).map_err(|source| ZenohError::Config { key, value, source })?;
        }
        Ok((config, listen))
    }

    /// Whether opening again may find another free port.
    pub(crate) fn chooses_port(&self) -> bool {
        self.listen.iter().any(|endpoint| endpoint.ends_with(":0"))
    }
}

/// The host and port of a TCP endpoint on the loopback interface. Others are refused, since nothing secures them yet.
fn loopback_host(endpoint: &str) -> Result<(&str, u16), ZenohError> {
    let bad = || ZenohError::Endpoint { endpoint: endpoint.into() };
    let (host, port) =
        endpoint.strip_prefix("tcp/").and_then(|address| address.rsplit_once(':')).ok_or_else(bad)?;
    let port = port.parse().map_err(|_| bad())?;
    let address = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host);
    let loopback = match address.parse::<IpAddr>() {
        Ok(address) => address.is_loopback(),
        Err(_) if host.is_empty() => return Err(bad()),
        Err(_) => address == "localhost",
    };
    if loopback { Ok((host, port)) } else { Err(ZenohError::NotLoopback { endpoint: endpoint.into() }) }
}

/// The endpoint with a free port in the place of 0, so that it is known before anyone asks for it.
fn with_port(endpoint: &str) -> Result<String, ZenohError> {
    let (host, port) = loopback_host(endpoint)?;
    if port != 0 {
        return Ok(endpoint.into());
    }
    let free = TcpListener::bind(format!("{host}:0")).and_then(|listener| listener.local_addr());
    let free = free.map_err(|source| ZenohError::NoPort { endpoint: endpoint.into(), source })?;
    Ok(format!("tcp/{host}:{}", free.port()))
}

/// Endpoints have passed [`loopback_host`], so they hold nothing that would need an escape.
fn json_list(endpoints: &[String]) -> String {
    let quoted: Vec<String> = endpoints.iter().map(|endpoint| format!("\"{endpoint}\"")).collect();
    format!("[{}]", quoted.join(","))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_loopback_is_accepted_without_security() {
        for fine in ["tcp/127.0.0.1:7447", "tcp/127.9.9.9:1", "tcp/[::1]:0", "tcp/localhost:7447"] {
            assert!(loopback_host(fine).is_ok(), "{fine} was refused");
        }
        for open in ["tcp/0.0.0.0:7447", "tcp/[::]:0", "tcp/192.168.1.4:7447", "tcp/example.org:7447"] {
            assert!(
                matches!(loopback_host(open), Err(ZenohError::NotLoopback { .. })),
                "{open} was accepted"
            );
        }
        for bad in [
            "",
            "tcp/",
            "127.0.0.1:7447",
            "udp/127.0.0.1:7447",
            "tcp/127.0.0.1",
            "tcp/:7447",
            "tcp/127.0.0.1:x",
            "tcp/127.0.0.1:1#iface=eth0",
        ] {
            assert!(matches!(loopback_host(bad), Err(ZenohError::Endpoint { .. })), "{bad} was accepted");
        }
    }

    #[test]
    fn a_port_is_chosen_before_opening() {
        let endpoint = with_port("tcp/127.0.0.1:0").unwrap();
        assert!(endpoint.starts_with("tcp/127.0.0.1:") && !endpoint.ends_with(":0"), "{endpoint}");
    }
}
