//! In which order a node sends what one step has brought about.

use std::time::Duration;

use skein_bp::{Event, EventSet, Program, ProgramConfig};
use skein_dbp::{BidRecord, Message, Node, NodeConfig, NodeName, OnLoss, RemoteBid};

fn name(text: &str) -> NodeName {
    NodeName::new(text).unwrap()
}

#[test]
fn an_occurrence_goes_before_the_acknowledgement_of_the_bid_that_led_to_it() {
    let config = NodeConfig::new(name("uav/1"), 1, vec![name("uav/2")]);
    let mut node = Node::new(config, Program::new(ProgramConfig::vehicle(1)));
    let bid = RemoteBid {
        bthread: "asker".into(),
        sync: 1,
        requests: vec![Event::new("uav/1/ping")],
        block: EventSet::None,
        block_since: 1,
        priority: None,
        on_loss: OnLoss::Release,
    };
    let record = BidRecord {
        node: name("uav/2"),
        incarnation: 1,
        home: name("uav/1"),
        home_incarnation: Some(1),
        epoch: 1,
        sent_at: Duration::ZERO,
        applied: 0,
        term: 0,
        decided: 0,
        lease_ms: 1000,
        bids: vec![bid],
    };
    node.handle(Duration::ZERO, Message::Bid(record));
    node.step(Duration::ZERO).unwrap();
    let sent = node.take_outgoing();
    let at = |is_it: fn(&Message) -> bool| sent.iter().position(|(_, message)| is_it(message)).unwrap();
    let occurrence = at(|message| matches!(message, Message::Occurrence(_)));
    let acknowledgement = at(|message| matches!(message, Message::Ack(_)));
    assert!(occurrence < acknowledgement, "{sent:?}");
}
