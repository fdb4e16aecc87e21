//! Messages between nodes, as they come from the network.

use std::time::Duration;

use nalgebra::Vector3;
use skein_bp::{Event, EventSet};
use skein_dbp::{
    BidAck, BidRecord, Board, BoardRequest, BoardRow, JointWord, Message, OnLoss, Presence, Refusal,
    RefusalReason, RemoteBid, Repair,
};
use skein_wire::{NodeName, Payload, State};

use crate::target::{Allowed, Reached, Target};

pub const TARGET: Target =
    Target { name: "packets", allowed: Allowed { bytes: 16 << 10, per_byte: 300 }, read, seeds };

fn read(input: &[u8]) -> Reached {
    let Ok(payload) = Payload::decode(input) else { return Reached::Refused };
    // Compared as bytes: numbers may be none.
    let bytes = payload.encode();
    let again = Payload::decode(&bytes).expect("what was read is written so that it can be read");
    assert_eq!(again.encode(), bytes);
    Reached::read(is_planted(&payload))
}

fn is_planted(payload: &Payload) -> bool {
    match payload {
        Payload::Message(Message::Presence(presence)) => presence.joint.is_none() && presence.oldest_seq == 9,
        Payload::State(state) => state.armed && state.scripts.len() == 2,
        _ => false,
    }
}

pub fn node(name: &str) -> NodeName {
    NodeName::new(name).expect("a node's name")
}

pub fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    payloads().into_iter().map(|(name, payload)| (name, payload.encode())).collect()
}

/// One message of most kinds, from `uav/2` to `uav/1`.
pub fn payloads() -> Vec<(&'static str, Payload)> {
    let state = State {
        velocity: Vector3::new(1.0, 0.0, 0.5),
        mode: "offboard".into(),
        armed: true,
        scripts: vec!["patrol".into()],
        path: vec![Vector3::new(1.0, 2.0, 3.0)],
        ..State::new(node("uav/2"))
    };
    vec![
        ("bid", Payload::Message(Message::Bid(bid()))),
        ("ack", Payload::Message(Message::Ack(ack()))),
        ("repair", Payload::Message(Message::Repair(repair()))),
        ("presence", Payload::Message(Message::Presence(presence()))),
        ("state", Payload::State(state)),
        ("board", Payload::Board(board())),
    ]
}

fn bid() -> BidRecord {
    let set = EventSet::named("uav/1/**").and(EventSet::prefix("uav/1/enter").not());
    BidRecord {
        node: node("uav/2"),
        incarnation: 3,
        home: node("uav/1"),
        home_incarnation: Some(1),
        epoch: 5,
        sent_at: Duration::from_millis(40),
        applied: 2,
        term: 0,
        decided: 0,
        lease_ms: 1000,
        bids: vec![RemoteBid {
            bthread: "curfew".into(),
            sync: 7,
            requests: vec![Event::new("uav/1/order").with("what", "hold")],
            block: set.or(EventSet::region([0.0; 3], [4.0, 4.0, f64::INFINITY])),
            block_since: 6,
            priority: Some(3),
            on_loss: OnLoss::Release,
        }],
    }
}

fn ack() -> BidAck {
    BidAck {
        home: node("uav/2"),
        home_incarnation: 3,
        node: node("uav/1"),
        incarnation: 1,
        epoch: 4,
        sent_at: Duration::from_millis(20),
        latest_seq: 8,
        refused: vec![Refusal { bthread: "hold".into(), sync: 2, reason: RefusalReason::MayNotBlock }],
    }
}

fn repair() -> Repair {
    let (home, requester) = (node("uav/1"), node("uav/2"));
    Repair { home, incarnation: 1, from_seq: 1, to_seq: 4, term: 0, requester }
}

fn presence() -> Presence {
    Presence {
        node: node("uav/2"),
        incarnation: 3,
        up: Duration::from_secs(2),
        latest_seq: 8,
        oldest_seq: 1,
        lease_ms: 1000,
        joint: Some(JointWord { term: 1, decided: 0, heard: None, asks: false }),
    }
}

pub fn board() -> Board {
    let request = BoardRequest { event: Event::new("uav/2/advance"), blocked_by: vec!["operator".into()] };
    let row = BoardRow {
        bthread: "mission".into(),
        requests: vec![request],
        waits: EventSet::named("uav/2/*"),
        blocks: EventSet::None,
        interrupts: EventSet::None,
        states: vec![Event::new("uav/2/limit").with("speed_m_s", 2.0)],
        priority: Some(1),
        deadline: None,
        lease: None,
        cut: false,
    };
    Board::new(node("uav/2"), 3, Duration::from_secs(2), vec![row])
}
