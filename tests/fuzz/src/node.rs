//! A node that takes in what others say under their keys, and goes on.
//!
//! An input is a row of messages: a byte that chooses the key, two that say the length, and as many of content.

use std::collections::VecDeque;
use std::time::Duration;

use skein_bp::script::{Op, Script};
use skein_bp::{Bid, EventSet, Program, ProgramConfig};
use skein_dbp::{Node, NodeConfig};
use skein_wire::{Fleet, Key, Link, NodeLink};

use crate::packets::{node, payloads};
use crate::target::{Allowed, Reached, Target};

pub const TARGET: Target =
    Target { name: "node", allowed: Allowed { bytes: 8 << 20, per_byte: 2000 }, read, seeds };

/// Further messages of an input do not count, so that one is done soon.
const MOST_MESSAGES: usize = 64;
const PUMP: Duration = Duration::from_millis(20);
const WORDS: [&str; 9] =
    ["bid", "ack", "occ", "occ to one", "repair", "presence", "state", "readiness", "board"];
const SENDERS: [&str; 2] = ["uav/2", "ground/main"];

#[derive(Default)]
struct Said(VecDeque<(Key, Vec<u8>)>);

impl Link for Said {
    fn put(&mut self, _key: &Key, _payload: Vec<u8>) {}

    fn poll(&mut self) -> Option<(Key, Vec<u8>)> {
        self.0.pop_front()
    }
}

fn key(chosen: u8) -> Key {
    let chosen = usize::from(chosen);
    let sender = SENDERS[chosen / WORDS.len() % SENDERS.len()];
    let text = match WORDS[chosen % WORDS.len()] {
        "occ to one" => format!("skein/demo/occ/{sender}/uav/1"),
        word @ ("bid" | "ack" | "repair") => format!("skein/demo/{word}/{sender}/uav/1"),
        word => format!("skein/demo/{word}/{sender}"),
    };
    text.parse().expect("a key")
}

fn messages(mut input: &[u8]) -> Vec<(Key, Vec<u8>)> {
    let mut messages = Vec::new();
    while let [chosen, low, high, rest @ ..] = input {
        let length = usize::from(u16::from_le_bytes([*low, *high])).min(rest.len());
        let (content, after) = rest.split_at(length);
        messages.push((key(*chosen), content.to_vec()));
        input = after;
        if messages.len() == MOST_MESSAGES {
            break;
        }
    }
    messages
}

/// Requests one event, and blocks some.
fn restless() -> Script {
    let bid = Bid::new().request("uav/1/advance").block(EventSet::named("uav/1/land"));
    Script::new(&[Op::Sync(bid.clone()), Op::Sync(bid)]).expect("a script")
}

fn a_node() -> NodeLink {
    let roster = ["uav/1", "uav/2", "ground/main"].map(node).to_vec();
    let mut program = Program::new(ProgramConfig::default());
    program.add("restless", restless());
    let config = NodeConfig { settle_limit: 8, ..NodeConfig::new(node("uav/1"), 1, roster) };
    NodeLink::new(Node::new(config, program), Fleet::new("demo").expect("a fleet")).reading_boards()
}

fn read(input: &[u8]) -> Reached {
    let messages = messages(input);
    let mut link = Said::default();
    let mut node = a_node();
    let mut now = Duration::ZERO;
    for message in messages {
        link.0.push_back(message);
        now += PUMP;
        // The program may go on for ever by itself: that is not the senders' doing.
        let _ = node.pump(now, &mut link);
    }
    let stats = node.stats();
    let passed =
        stats.received.saturating_sub(stats.undecodable + stats.forged + stats.oversized + stats.strange);
    assert!(node.take_states().len() + node.take_boards().len() <= MOST_MESSAGES);
    match passed {
        0 => Reached::Refused,
        _ => Reached::read(stats.forged > 0 && stats.undecodable > 0),
    }
}

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let said = |(name, payload): (&'static str, skein_wire::Payload)| {
        let chosen = WORDS.iter().position(|word| *word == name).expect("a kind") as u8;
        let content = payload.encode();
        let [low, high] = (content.len() as u16).to_le_bytes();
        (name, [&[chosen, low, high], content.as_slice()].concat())
    };
    let mut seeds: Vec<_> = payloads().into_iter().map(said).collect();
    let all = seeds.iter().flat_map(|(_, seed)| seed.clone()).collect();
    seeds.push(("all", all));
    seeds
}
