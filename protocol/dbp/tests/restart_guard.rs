//! A home that has restarted keeps its guarded events back until it knows who blocks them.

use std::time::Duration;

use skein_bp::script::{Op, Script};
use skein_bp::{Bid, EventSet, Program, ProgramConfig};
use skein_dbp::{BidRecord, Message, Node, NodeConfig, NodeName, OnLoss, RemoteBid};

const MS: Duration = Duration::from_millis(1);

fn name(text: &str) -> NodeName {
    NodeName::new(text).unwrap()
}

/// `uav/1` in its second life, which wants to step, as soon and as often as it may.
fn node() -> Node {
    let mut program = Program::new(ProgramConfig::vehicle(1));
    let steps = Script::new(&[Op::repeat(3, [Op::Sync(Bid::new().request("uav/1/step"))])]).unwrap();
    program.add("steps", steps);
    let config = NodeConfig {
        guarded: EventSet::from("uav/1/step"),
        longest_lease: Duration::from_secs(2),
        ..NodeConfig::new(name("uav/1"), 2, vec![name("uav/2")])
    };
    Node::new(config, program)
}

/// What `uav/2` bids, for the home's life `home_incarnation`.
fn record(home_incarnation: Option<u64>, epoch: u64, bids: Vec<RemoteBid>) -> Message {
    Message::Bid(BidRecord {
        node: name("uav/2"),
        incarnation: 1,
        home: name("uav/1"),
        home_incarnation,
        epoch,
        sent_at: Duration::ZERO,
        applied: 0,
        term: 0,
        decided: 0,
        lease_ms: 1000,
        bids,
    })
}

fn steps(node: &mut Node, now: Duration) -> usize {
    node.step(now).unwrap();
    node.take_selections().iter().filter(|happened| happened.event.name() == "uav/1/step").count()
}

#[test]
fn it_waits_for_the_longest_lease_when_nobody_answers() {
    let mut node = node();
    for ms in [0, 1000, 1999] {
        assert_eq!(steps(&mut node, MS * ms), 0, "stepped after {ms} ms");
    }
    assert!(node.next_deadline() <= MS * 2000);
    assert_eq!(steps(&mut node, MS * 2000), 3);
}

#[test]
fn it_goes_on_as_soon_as_every_member_has_told_its_bids() {
    let mut node = node();
    assert_eq!(steps(&mut node, Duration::ZERO), 0);
    node.handle(MS * 20, record(Some(2), 4, vec![]));
    assert_eq!(steps(&mut node, MS * 20), 3);
}

#[test]
fn a_record_made_for_its_former_life_does_not_count() {
    let mut node = node();
    // A late copy of the time before the block, which the former life has confirmed since.
    node.handle(MS * 20, record(Some(1), 4, vec![]));
    node.handle(MS * 40, record(None, 5, vec![]));
    assert_eq!(steps(&mut node, MS * 40), 0);
    let block = RemoteBid {
        bthread: "hold".into(),
        sync: 1,
        requests: vec![],
        block: EventSet::from("uav/*/step"),
        block_since: 1,
        priority: None,
        on_loss: OnLoss::Release,
    };
    node.handle(MS * 60, record(Some(2), 6, vec![block]));
    assert_eq!(steps(&mut node, MS * 60), 0);
    assert_eq!(steps(&mut node, MS * 1059), 0);
    assert_eq!(steps(&mut node, MS * 1060), 3, "the holder's lease is over");
}
