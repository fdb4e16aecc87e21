//! The settings by which a session is joined to others.

use std::net::{IpAddr, TcpListener};
use std::path::Path;
use std::time::SystemTime;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use skein_wire::{Fleet, NodeName};

use crate::error::ZenohError;
use crate::roster::Roster;
use crate::security::Security;
use crate::{access, certificate, links};

/// Longest message that Zenoh puts together from its fragments, in bytes: more than any that Skein reads.
const MOST_REASSEMBLED: usize = 16 << 20;

/// The configuration of a [`ZenohSession`](crate::ZenohSession).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ZenohConfig {
    /// The fleet; sessions of other fleets are not heard.
    pub fleet: Fleet,
    pub network: NetworkSettings,
    /// The node that speaks here, and all that it knows of: who may take part where the network's security names no
    /// roster of its own.
    pub node: Option<(NodeName, Vec<NodeName>)>,
    /// Capacity for messages that wait to be put. Beyond, new ones are dropped: bids and states are repeated anyway,
    /// occurrences are repaired.
    pub outgoing_capacity: usize,
    /// Capacity for messages that wait for each link. Beyond, the oldest are dropped.
    pub incoming_capacity: usize,
}

/// The table `[network]` of a node's configuration file.
///
/// Nothing is found by multicast or by word of others: who is to be reached is named here or there.
/// Endpoints are Zenoh's: `tcp/127.0.0.1:7447`, or `tls/192.168.1.4:7447` where [`Security`] is configured.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NetworkSettings {
    pub mode: Mode,
    /// Where others may connect; port 0 is any free one, see [`ZenohSession::locators`](crate::ZenohSession::locators).
    /// A client listens nowhere.
    pub listen: Vec<String>,
    /// Whom to connect to, again and again until it is there.
    pub connect: Vec<String>,
    /// The certificates of the fleet. Without them, only the loopback interface is used.
    pub security: Option<Security>,
}

/// The role of a session in the network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// Talks to every other peer directly; relays nothing. Nobody's loss cuts others off.
    #[default]
    Peer,
    /// Talks through one router: `zenohd`, or a node in router mode.
    Client,
    /// Relays for others.
    Router,
}

impl Default for NetworkSettings {
    /// A peer on a free port of the loopback interface.
    fn default() -> Self {
        Self {
            mode: Mode::default(),
            listen: vec!["tcp/127.0.0.1:0".into()],
            connect: Vec::new(),
            security: None,
        }
    }
}

/// Settings of Zenoh's, each with its value in JSON.
type Settings = Vec<(&'static str, String)>;

/// The settings by which only members come in, encrypted, and say only what is theirs to say.
fn secured(security: &Security, fleet: &Fleet, roster: &Roster) -> Settings {
    let Security { authority, certificate, key, .. } = security;
    vec![
        // Access control knows the other end by its certificate alone.
        ("transport/link/protocols", "[\"tls\"]".into()),
        ("transport/link/tls/root_ca_certificate", json(authority)),
        ("transport/link/tls/listen_certificate", json(certificate)),
        ("transport/link/tls/listen_private_key", json(key)),
        ("transport/link/tls/connect_certificate", json(certificate)),
        ("transport/link/tls/connect_private_key", json(key)),
        ("transport/link/tls/enable_mtls", "true".into()),
        ("transport/link/tls/verify_name_on_connect", "true".into()),
        ("transport/unicast/max_links", "1".into()),
        ("access_control", access::control(fleet, roster).to_string()),
    ]
}

impl ZenohConfig {
    /// A session of `fleet` that is joined to others as `network` says.
    pub fn new(fleet: Fleet, network: NetworkSettings) -> Self {
        Self { fleet, network, node: None, outgoing_capacity: 4096, incoming_capacity: 4096 }
    }

    /// The same, of `node`, which knows of `others`. With security it must be somebody's.
    #[must_use]
    pub fn of(self, node: &NodeName, others: impl IntoIterator<Item = NodeName>) -> Self {
        Self { node: Some((node.clone(), others.into_iter().collect())), ..self }
    }

    /// The configuration file of a program that is none of Skein's and joins in as this node: `zenohd`, a router.
    ///
    /// # Errors
    /// Those of [`ZenohSession::open`](crate::ZenohSession::open) that the settings and certificates alone cause.
    pub fn to_file(&self) -> Result<String, ZenohError> {
        let (settings, _) = self.settings()?;
        let mut file = Value::default();
        for (key, value) in settings {
            let place = key.split('/').fold(&mut file, |table, chunk| &mut table[chunk]);
            *place = serde_json::from_str(&value).unwrap_or(Value::String(value));
        }
        Ok(format!("{file:#}\n"))
    }

    /// Zenoh's own configuration, with the endpoints that are listened on in the end.
    pub(crate) fn to_zenoh(&self) -> Result<(zenoh::Config, Vec<String>), ZenohError> {
        let (settings, listen) = self.settings()?;
        let mut config = zenoh::Config::default();
        for (key, value) in settings {
            config.insert_json5(key, &value).map_err(|cause| ZenohError::Config { key, value, cause })?;
        }
        Ok((config, listen))
    }

    /// Zenoh's settings, with the endpoints that are listened on in the end.
    fn settings(&self) -> Result<(Settings, Vec<String>), ZenohError> {
        let (mut settings, listen) = self.network.settings()?;
        if let Some(security) = &self.network.security {
            let (node, roster) = self.admitted(security)?;
            let hosts: Vec<String> =
                listen.iter().filter_map(|it| Some(Endpoint::parse(it).ok()?.host.into())).collect();
            for warning in certificate::check(security, node, &roster, &hosts, SystemTime::now())? {
                tracing::warn!("{warning}");
            }
            settings.extend(secured(security, &self.fleet, &roster));
            links::open(node, &roster);
        }
        Ok((settings, listen))
    }

    /// This node, and who takes part.
    fn admitted(&self, security: &Security) -> Result<(&NodeName, Roster), ZenohError> {
        let (node, others) = self.node.as_ref().ok_or(ZenohError::Nobody)?;
        let roster = match &security.roster {
            Some(path) => Roster::read(path)?,
            None => Roster::of(others.iter().chain([node]).cloned()),
        };
        match self.network.mode {
            Mode::Client if !roster.has_relays() => Err(ZenohError::NobodyRelays),
            Mode::Router if !roster.relays(node) => Err(ZenohError::NoRelay { node: node.clone() }),
            _ => Ok((node, roster)),
        }
    }
}

impl NetworkSettings {
    /// A peer that listens on a free port of the loopback interface and connects to these endpoints.
    pub fn connected_to(connect: Vec<String>) -> Self {
        Self { connect, ..Self::default() }
    }

    /// The same, with its files' paths relative to `folder`: that of the configuration file.
    #[must_use]
    pub fn relative_to(mut self, folder: &Path) -> Self {
        if let Some(security) = &mut self.security {
            *security = security.relative_to(folder);
        }
        self
    }

    /// Zenoh's settings but for those of security, with the endpoints that are listened on in the end.
    fn settings(&self) -> Result<(Settings, Vec<String>), ZenohError> {
        for endpoint in &self.connect {
            Endpoint::parse(endpoint)?.check(self.security.is_some())?;
        }
        let (mode, listen) = match self.mode {
            Mode::Peer => ("peer", self.listen()?),
            Mode::Router => ("router", self.listen()?),
            Mode::Client if self.connect.is_empty() => return Err(ZenohError::ClientOfNobody),
            Mode::Client => ("client", Vec::new()),
        };
        let settings = vec![
            ("mode", json(&mode)),
            ("scouting/multicast/enabled", "false".into()),
            // Without multicast there is nothing to wait for at opening.
            ("scouting/delay", "0".into()),
            // Whoever is told of by others would be connected to, wherever that is.
            ("scouting/gossip/enabled", "false".into()),
            ("listen/endpoints", json(&listen)),
            ("connect/endpoints", json(&self.connect)),
            // Peers try those who are not there yet again and again, by themselves. A client's session does not open
            // without its router; whoever opens it has to try again.
            ("connect/timeout_ms", r#"{ "router": -1, "peer": -1, "client": 0 }"#.into()),
            ("connect/exit_on_failure", r#"{ "router": false, "peer": false, "client": true }"#.into()),
            (
                "connect/retry",
                r#"{ "period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 1.5 }"#.into(),
            ),
            ("transport/link/rx/max_message_size", MOST_REASSEMBLED.to_string()),
        ];
        Ok((settings, listen))
    }

    /// Where to listen, with free ports in the place of 0, so that they are known before anyone asks for them.
    fn listen(&self) -> Result<Vec<String>, ZenohError> {
        let with_port = |endpoint: &String| {
            let parsed = Endpoint::parse(endpoint)?;
            parsed.check(self.security.is_some())?;
            parsed.with_port()
        };
        self.listen.iter().map(with_port).collect()
    }

    /// Whether opening again may find another free port.
    pub(crate) fn chooses_port(&self) -> bool {
        self.listen.iter().any(|endpoint| endpoint.ends_with(":0"))
    }
}

/// `tcp/127.0.0.1:7447`, in its parts.
struct Endpoint<'a> {
    text: &'a str,
    encrypted: bool,
    host: &'a str,
    port: u16,
}

impl<'a> Endpoint<'a> {
    fn parse(text: &'a str) -> Result<Self, ZenohError> {
        let bad = || ZenohError::Endpoint { endpoint: text.into() };
        let (protocol, address) = text.split_once('/').ok_or_else(bad)?;
        let encrypted = match protocol {
            "tcp" => false,
            "tls" => true,
            _ => return Err(bad()),
        };
        let (host, port) = address.rsplit_once(':').filter(|(host, _)| !host.is_empty()).ok_or_else(bad)?;
        Ok(Self { text, encrypted, host, port: port.parse().map_err(|_| bad())? })
    }

    fn is_loopback(&self) -> bool {
        let bare = self.host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(self.host);
        bare.parse::<IpAddr>().map_or(bare == "localhost", |address| address.is_loopback())
    }

    /// What others could reach, or what leads to others, needs something to tell friend from foe.
    fn check(&self, secured: bool) -> Result<(), ZenohError> {
        match (self.encrypted, secured) {
            (true, true) => Ok(()),
            (true, false) => Err(ZenohError::NoCertificates { endpoint: self.text.into() }),
            (false, true) => Err(ZenohError::NotEncrypted { endpoint: self.text.into() }),
            (false, false) if self.is_loopback() => Ok(()),
            (false, false) => Err(ZenohError::NotLoopback { endpoint: self.text.into() }),
        }
    }

    fn with_port(&self) -> Result<String, ZenohError> {
        if self.port != 0 {
            return Ok(self.text.into());
        }
        let free = TcpListener::bind(format!("{}:0", self.host)).and_then(|listener| listener.local_addr());
        let free = free.map_err(|cause| ZenohError::NoPort { endpoint: self.text.into(), cause })?;
        let protocol = if self.encrypted { "tls" } else { "tcp" };
        Ok(format!("{protocol}/{}:{}", self.host, free.port()))
    }
}

/// A value in the language of Zenoh's configuration.
fn json(value: &impl Serialize) -> String {
    // What is no text is no name of a file that Zenoh could open.
    serde_json::to_string(value).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(endpoint: &str, secured: bool) -> Result<(), ZenohError> {
        Endpoint::parse(endpoint)?.check(secured)
    }

    #[test]
    fn only_loopback_is_accepted_without_security() {
        for fine in ["tcp/127.0.0.1:7447", "tcp/127.9.9.9:1", "tcp/[::1]:0", "tcp/localhost:7447"] {
            assert!(check(fine, false).is_ok(), "{fine} was refused");
        }
        for open in ["tcp/0.0.0.0:7447", "tcp/[::]:0", "tcp/192.168.1.4:7447", "tcp/example.org:7447"] {
            assert!(matches!(check(open, false), Err(ZenohError::NotLoopback { .. })), "{open} was accepted");
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
            assert!(matches!(check(bad, true), Err(ZenohError::Endpoint { .. })), "{bad} was accepted");
        }
    }

    #[test]
    fn encrypted_links_need_certificates_and_may_lead_anywhere() {
        assert!(check("tls/192.168.1.4:7447", true).is_ok());
        // Beside a link whose other end is known, none may stand whose other end is not.
        let beside = check("tcp/127.0.0.1:7447", true);
        assert!(matches!(beside, Err(ZenohError::NotEncrypted { .. })));
        let without = check("tls/192.168.1.4:7447", false);
        assert!(matches!(without, Err(ZenohError::NoCertificates { .. })));
    }

    #[test]
    fn a_port_is_chosen_before_opening() {
        let endpoint = Endpoint::parse("tcp/127.0.0.1:0").unwrap().with_port().unwrap();
        assert!(endpoint.starts_with("tcp/127.0.0.1:") && !endpoint.ends_with(":0"), "{endpoint}");
    }

    #[test]
    fn a_client_needs_somebody_to_connect_to() {
        let alone = NetworkSettings { mode: Mode::Client, ..NetworkSettings::default() };
        assert!(matches!(alone.settings(), Err(ZenohError::ClientOfNobody)));
    }

    #[test]
    fn the_table_is_read_and_a_wrong_word_in_it_is_named() {
        let settings: NetworkSettings =
            toml::from_str("mode = \"client\"\nconnect = [\"tcp/127.0.0.1:7447\"]").unwrap();
        assert_eq!(settings.mode, Mode::Client);
        let error = toml::from_str::<NetworkSettings>("mode = \"pear\"").unwrap_err().to_string();
        assert!(error.contains("line 1") && error.contains("`peer`"), "{error}");
        assert!(toml::from_str::<NetworkSettings>("lisen = []").is_err());
    }
}
