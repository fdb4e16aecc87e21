//! Keys of messages, names of nodes and fleets, addresses of autopilots: short texts that come from the network or from
//! command lines.

use skein_agent::autopilot_link::Address;
use skein_wire::{Key, NodeName};

use crate::target::{Allowed, Reached, Target};

pub const TARGET: Target =
    Target { name: "keys", allowed: Allowed { bytes: 4 << 10, per_byte: 64 }, read, seeds };

fn read(input: &[u8]) -> Reached {
    let Ok(text) = std::str::from_utf8(input) else { return Reached::Refused };
    let key = text.parse::<Key>();
    if let Ok(key) = &key {
        assert_eq!(key.to_string(), text);
    }
    let name = NodeName::new(text);
    if let Ok(name) = &name {
        assert_eq!(name.as_str(), text);
    }
    let address = text.parse::<Address>();
    if let Ok(address) = &address {
        assert_eq!(address.to_string().parse::<Address>().as_ref().ok(), Some(address));
    }
    match (key, name.is_ok() || address.is_ok()) {
        (Ok(key), _) => Reached::read(key.fleet().as_str() == "."),
        (Err(_), true) => Reached::Read,
        (Err(_), false) => Reached::Refused,
    }
}

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("bid", "skein/demo/bid/ground/main/uav/3".into()),
        ("state", "skein/demo/state/uav/1".into()),
        ("name", "uav/17".into()),
        ("udp", "udp:127.0.0.1:14540".into()),
        ("serial", "serial:/dev/ttyACM0:57600".into()),
    ]
}
