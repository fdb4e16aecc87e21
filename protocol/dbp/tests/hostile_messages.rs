//! Whatever a node is told, it neither fails nor believes what the teller has no say in.

use std::time::Duration;

use proptest::prelude::*;
use skein_bp::script::{Op, Script};
use skein_bp::{Bid, Bound, Event, EventSet, Program, ProgramConfig};
use skein_dbp::{
    BidAck, BidRecord, JointWord, Message, Node, NodeConfig, NodeName, Occurrence, OnLoss, Presence,
    Recipient, RemoteBid, Repair, Roster, ServedRequest,
};

fn name(text: &str) -> NodeName {
    NodeName::new(text).unwrap()
}

/// `uav/1`, which flies, lands and holds `uav/2`.
fn node() -> Node {
    node_with(None)
}

/// A node, of a fleet that decides together under this coordinator.
fn node_with(coordinator: Option<&str>) -> Node {
    let mut program = Program::new(ProgramConfig::vehicle(1));
    let ask = Bid::new().request("uav/2/a").block("uav/*/b");
    program.add("ask", Script::new(&[Op::forever([Op::Sync(ask)])]).unwrap());
    let wait = Bid::new().wait_for(EventSet::All).priority(1);
    program.add("listen", Script::new(&[Op::forever([Op::Sync(wait)])]).unwrap());
    let config = NodeConfig {
        safety: EventSet::from("uav/1/land"),
        joint: coordinator
            .map(|coordinator| Roster::first(name(coordinator), ["uav/1", "uav/2", "uav/3"].map(name))),
        durable: coordinator.is_some(),
        ..NodeConfig::new(name("uav/1"), 3, vec![name("uav/2"), name("uav/3")])
    };
    let mut node = Node::new(config, program);
    node.step(Duration::ZERO).unwrap();
    node
}

fn occurrence(home: &str, seq: u64, event: &str) -> Message {
    let (home, event) = (name(home), Event::new(event));
    Message::Occurrence(Occurrence {
        home,
        incarnation: 1,
        seq,
        term: 0,
        event,
        requests_served: vec![],
        requested_by: Vec::new(),
        choice: None,
        at: Duration::ZERO,
    })
}

fn presence(node: &str, latest_seq: u64) -> Message {
    let up = Duration::ZERO;
    Message::Presence(Presence {
        node: name(node),
        incarnation: 1,
        up,
        latest_seq,
        oldest_seq: 1,
        lease_ms: 1000,
        joint: None,
    })
}

/// The names of what has happened, but for the node's own facts.
fn heard(node: &mut Node) -> Vec<String> {
    node.step(Duration::from_millis(20)).unwrap();
    let happened = node.take_selections().into_iter().filter(|happened| happened.home != name("uav/1"));
    happened.map(|happened| happened.event.name().into()).collect()
}

#[test]
fn a_home_cannot_speak_for_another_one() {
    let mut node = node();
    node.handle(Duration::ZERO, presence("uav/2", 0));
    for (seq, event) in [(1, "uav/1/land"), (2, "uav/3/step"), (3, "tick"), (4, "uav/2/step")] {
        node.handle(Duration::ZERO, occurrence("uav/2", seq, event));
    }
    assert_eq!(heard(&mut node), ["uav/2/step"]);
}

#[test]
fn strangers_and_lives_that_are_over_are_not_heard() {
    let mut node = node();
    node.handle(Duration::ZERO, presence("uav/9", 0));
    node.handle(Duration::ZERO, occurrence("uav/9", 1, "uav/9/step"));
    node.handle(Duration::ZERO, presence("uav/2", 0));
    let young = Presence {
        node: name("uav/3"),
        incarnation: 7,
        up: Duration::ZERO,
        latest_seq: 0,
        oldest_seq: 1,
        lease_ms: 1000,
        joint: None,
    };
    node.handle(Duration::ZERO, Message::Presence(young));
    node.handle(Duration::ZERO, occurrence("uav/3", 1, "uav/3/step"));
    assert_eq!(heard(&mut node), Vec::<String>::new());
    assert_eq!(node.stats().ignored, 3);
}

fn sign_of_life(node: &str, incarnation: u64) -> Message {
    let Message::Presence(presence) = presence(node, 0) else { unreachable!() };
    Message::Presence(Presence { incarnation, ..presence })
}

#[test]
fn a_huge_incarnation_or_term_locks_nobody_out() {
    let mut node = node_with(Some("uav/1"));
    for (peer, before) in [("uav/2", None), ("uav/3", Some(7))] {
        before.into_iter().for_each(|life| node.handle(Duration::ZERO, sign_of_life(peer, life)));
        node.handle(Duration::ZERO, sign_of_life(peer, u64::MAX));
        node.handle(Duration::ZERO, sign_of_life(peer, 8));
        let known = node.peers().find(|(name, _)| name.as_str() == peer).unwrap().1;
        assert_eq!((known.incarnation, known.alive), (Some(8), true), "{peer}");
    }
    let first = Roster::first(name("uav/1"), ["uav/2", "uav/3"].map(name));
    for (term, taken) in [(i64::MAX.unsigned_abs(), false), (2, true)] {
        node.enqueue(Roster { term, ..first.clone() }.order(&name("uav/1")));
        node.step(Duration::from_millis(20)).unwrap();
        assert_eq!(node.roster().unwrap().term == term, taken, "term {term}");
    }
}

#[test]
fn who_speaks_in_a_life_before_the_last_is_told_and_learns_which_one_that_was() {
    let mut node = node();
    node.handle(Duration::ZERO, sign_of_life("uav/2", 57));
    node.take_outgoing();
    let mut told = Vec::new();
    for tick in 0..100 {
        node.handle(Duration::from_millis(20 * tick), sign_of_life("uav/2", 1));
        told.extend(node.take_outgoing());
    }
    let [(Recipient::Node(to), Message::Repair(told))] = &told[..] else { panic!("{told:?}") };
    assert_eq!((to.as_str(), told.home.as_str(), told.incarnation), ("uav/2", "uav/2", 57));

    // The other end: here the life is the third.
    let asked = |requester: &str, incarnation| {
        let (home, requester) = (name("uav/1"), name(requester));
        Message::Repair(Repair { home, incarnation, from_seq: 1, to_seq: 1, term: 0, requester })
    };
    for (requester, life, known) in [
        ("uav/2", 2, None),
        ("uav/9", 57, None),
        ("uav/2", u64::MAX, None),
        ("uav/2", 57, Some(57)),
        ("uav/3", 9, Some(57)),
    ] {
        node.handle(Duration::from_secs(3), asked(requester, life));
        assert_eq!(node.outlived().map(|(_, life)| life), known, "{requester} of life {life}");
    }
}

#[test]
fn an_acknowledgement_of_what_was_never_sent_confirms_nothing() {
    let mut node = node();
    for home in ["uav/2", "uav/3"] {
        node.handle(Duration::ZERO, presence(home, 0));
        for (epoch, sent_at) in [(99, Duration::ZERO), (1, Duration::from_secs(99))] {
            node.handle(
                Duration::ZERO,
                Message::Ack(BidAck {
                    home: name(home),
                    home_incarnation: 1,
                    node: name("uav/1"),
                    incarnation: 3,
                    epoch,
                    sent_at,
                    latest_seq: 0,
                    refused: vec![],
                }),
            );
        }
    }
    node.step(Duration::from_millis(20)).unwrap();
    assert!(node.take_selections().iter().all(|happened| happened.event.name() != "uav/1/confirmed"));
}

#[test]
fn a_record_that_asks_for_too_much_is_cut_down_and_the_rest_is_told() {
    let mut node = node();
    node.handle(Duration::ZERO, presence("uav/2", 0));
    let bid = |bthread: String, event: &str| RemoteBid {
        bthread,
        sync: 1,
        requests: vec![Event::new(event)],
        block: EventSet::All,
        block_since: 1,
        priority: None,
        on_loss: OnLoss::Release,
    };
    let mut bids: Vec<_> = (0..300).map(|n| bid(format!("b{n}"), "uav/1/x")).collect();
    bids[0] = bid("b0".into(), "uav/1/land");
    bids[1] = bid("b1".into(), "uav/3/x");
    bids[2] = RemoteBid { on_loss: OnLoss::Hold, ..bid("b2".into(), "uav/1/x") };
    let record = BidRecord {
        node: name("uav/2"),
        incarnation: 1,
        home: name("uav/1"),
        home_incarnation: Some(3),
        epoch: 1,
        sent_at: Duration::ZERO,
        applied: 0,
        term: 0,
        decided: 0,
        lease_ms: 1000,
        bids,
    };
    node.handle(Duration::ZERO, Message::Bid(record));
    let acks: Vec<_> = node
        .take_outgoing()
        .into_iter()
        .filter_map(|(to, message)| match message {
            Message::Ack(ack) if to == Recipient::Node(name("uav/2")) => Some(ack),
            _ => None,
        })
        .collect();
    assert_eq!(acks.len(), 1);
    let reasons: Vec<_> =
        acks[0].refused.iter().map(|refusal| (&*refusal.bthread, refusal.reason.word())).collect();
    assert_eq!(reasons[..3], [("b0", "safety"), ("b1", "not_home"), ("b2", "hold_unsupported")]);
    assert_eq!(reasons.len(), 3 + 300 - 256);
    assert!(reasons[3..].iter().all(|(_, reason)| *reason == "quota"));
    let denied = facts(&mut node, "denied");
    assert_eq!(denied.len(), 1, "the acknowledgement lists all; the fleet is told once");
    assert_eq!(denied[0].int("more"), Some(2 + 300 - 256));
}

/// The facts of a kind that are told from now to the end of a step.
fn facts(node: &mut Node, kind: &str) -> Vec<Event> {
    node.step(Duration::from_millis(20)).unwrap();
    let events = node.take_selections().into_iter().map(|happened| happened.event);
    events.filter(|event| event.kind() == kind).collect()
}

fn record(incarnation: u64, epoch: u64, bids: Vec<RemoteBid>) -> Message {
    Message::Bid(BidRecord {
        node: name("uav/2"),
        incarnation,
        home: name("uav/1"),
        home_incarnation: Some(3),
        epoch,
        sent_at: Duration::ZERO,
        applied: 0,
        term: 0,
        decided: 0,
        lease_ms: 1000,
        bids,
    })
}

fn bid(bthread: &str, requests: Vec<Event>, block: EventSet) -> RemoteBid {
    let on_loss = OnLoss::Release;
    RemoteBid { bthread: bthread.into(), sync: 1, requests, block, block_since: 1, priority: None, on_loss }
}

#[test]
fn facts_that_one_member_causes_are_told_up_to_its_share() {
    let most = Bound::FactsAtOnce.stated();
    // Records that are refused each for something else.
    let mut node = node();
    for epoch in 1..500 {
        node.handle(
            Duration::ZERO,
            record(1, epoch, vec![bid(&format!("b{epoch}"), vec!["uav/1/land".into()], EventSet::None)]),
        );
    }
    assert_eq!(facts(&mut node, "denied").len(), most);
    assert_eq!(node.caused_by(&name("uav/2")).facts_withheld, 499 - most as u64);

    // An occurrence that claims to have served what was never asked.
    let mut node = self::node();
    node.handle(Duration::ZERO, presence("uav/2", 0));
    let served =
        |n: u64| ServedRequest { node: name("uav/1"), incarnation: 3, bthread: format!("b{n}"), sync: 1 };
    let Message::Occurrence(lie) = occurrence("uav/2", 1, "uav/2/x") else { unreachable!() };
    node.handle(
        Duration::ZERO,
        Message::Occurrence(Occurrence { requests_served: (0..1000).map(served).collect(), ..lie }),
    );
    assert_eq!(facts(&mut node, "orphan").len(), most);

    // A stream that is nothing but holes.
    let mut node = self::node();
    node.handle(Duration::ZERO, presence("uav/2", 0));
    (1..500).for_each(|n| node.handle(Duration::ZERO, occurrence("uav/2", 2 * n, "uav/2/x")));
    let Message::Presence(forgets) = presence("uav/2", 1000) else { unreachable!() };
    node.handle(Duration::ZERO, Message::Presence(Presence { oldest_seq: 1001, ..forgets }));
    assert_eq!(facts(&mut node, "gap").len(), most);

    // Blocks of what it requests itself, by ever other b-threads.
    let mut node = self::node();
    for epoch in 1..50 {
        let blockers = (0..100).map(|n| bid(&format!("b{epoch}.{n}"), vec![], "uav/1/x".into()));
        let asks = bid("asks", vec!["uav/1/x".into()], EventSet::None);
        node.handle(Duration::ZERO, record(1, epoch, blockers.chain([asks]).collect()));
        assert!(facts(&mut node, "stalled").len() <= Bound::StallsNoted.stated());
    }
    assert_eq!(node.caused_by(&name("uav/2")).facts_told, most as u64);
}

#[test]
fn a_member_begins_no_more_lives_than_a_process_can() {
    let mut node = node();
    let live = |incarnation: u64| {
        let Message::Presence(presence) = presence("uav/2", 0) else { unreachable!() };
        Message::Presence(Presence { incarnation, ..presence })
    };
    (1..1000).for_each(|incarnation| node.handle(Duration::ZERO, live(incarnation)));
    assert_eq!(facts(&mut node, "peer_joined").len(), Bound::LivesPerSecond.stated());
    assert_eq!(node.caused_by(&name("uav/2")).lives_refused, 999 - Bound::LivesPerSecond.stated() as u64);
    node.handle(Duration::from_secs(2), live(5000));
    let (_, peer) = node.peers().find(|(peer, _)| **peer == name("uav/2")).unwrap();
    assert_eq!(peer.incarnation, Some(5000));
}

#[test]
fn a_home_has_a_say_about_what_is_asked_of_it_and_nothing_else() {
    let mut node = node();
    node.handle(Duration::ZERO, presence("uav/2", 0));
    node.step(Duration::from_millis(20)).unwrap();
    let refusal = |n: u64| skein_dbp::Refusal {
        bthread: format!("b{n}"),
        sync: 1,
        reason: skein_dbp::RefusalReason::Quota,
    };
    node.handle(
        Duration::from_millis(40),
        Message::Ack(BidAck {
            home: name("uav/2"),
            home_incarnation: 1,
            node: name("uav/1"),
            incarnation: 3,
            epoch: 2,
            sent_at: Duration::from_millis(20),
            latest_seq: 0,
            refused: (0..1000).map(refusal).collect(),
        }),
    );
    assert_eq!(facts(&mut node, "refused").len(), 0);
}

#[test]
fn wishes_for_repair_bring_no_more_than_may_be_repeated() {
    let mut program = Program::new(ProgramConfig::vehicle(1));
    let tap = Op::Sync(Bid::new().request("uav/1/x"));
    program.add("tap", Script::new(&[Op::repeat(900, [tap])]).unwrap());
    let mut node = Node::new(NodeConfig::new(name("uav/1"), 3, vec![name("uav/2")]), program);
    node.handle(Duration::ZERO, presence("uav/2", 0));
    node.step(Duration::ZERO).unwrap();
    node.take_outgoing();
    let wish = Repair {
        home: name("uav/1"),
        incarnation: 3,
        from_seq: 1,
        to_seq: 64,
        term: 0,
        requester: name("uav/2"),
    };
    (0..10_000).for_each(|_| node.handle(Duration::ZERO, Message::Repair(wish.clone())));
    assert_eq!(node.take_outgoing().len(), Bound::RepeatsAtOnce.stated());
}

#[test]
fn no_number_of_occurrences_or_requests_of_others_keeps_a_step_from_settling() {
    let most = Bound::PendingOccurrences.stated() as u64;
    let mut node = self::node();
    let echo = [Op::Sync(Bid::new().wait_for("uav/2/last")), Op::Sync(Bid::new().request("uav/1/echo"))];
    node.program_mut().add("echo", Script::new(&echo).unwrap());
    node.handle(Duration::ZERO, presence("uav/2", 0));
    (2..most).for_each(|seq| node.handle(Duration::ZERO, occurrence("uav/2", seq, "uav/2/x")));
    node.handle(Duration::ZERO, occurrence("uav/2", most, "uav/2/last"));
    node.step(Duration::from_millis(20)).unwrap();
    node.take_selections();
    // All of them come at once with the one that was missing.
    node.handle(Duration::from_millis(20), occurrence("uav/2", 1, "uav/2/x"));
    node.step(Duration::from_millis(40)).unwrap();
    let happened = node.take_selections();
    assert!(happened.len() as u64 > most && happened.last().unwrap().event.name() == "uav/1/echo");

    // Whatever each of ten members may ask for at once, answered by ten events each.
    let members: Vec<NodeName> = (2..12).map(|number| name(&format!("uav/{number}"))).collect();
    let mut program = Program::new(ProgramConfig::vehicle(1));
    let answers = Op::repeat(10, [Op::Sync(Bid::new().request("uav/1/answer").priority(1))]);
    let ask = Op::Sync(Bid::new().wait_for("uav/1/x"));
    program.add("answers", Script::new(&[Op::forever([ask, answers])]).unwrap());
    let mut node = Node::new(NodeConfig::new(name("uav/1"), 3, members.clone()), program);
    let requests = Bound::RecordRequests.stated();
    for member in &members {
        node.handle(Duration::ZERO, presence(member.as_str(), 0));
        let asked = |n: usize| Event::new("uav/1/x").with("n", n as i64).with("by", member.as_str());
        let bids = (0..requests).map(|n| bid(&format!("b{n}"), vec![asked(n)], EventSet::None));
        let Message::Bid(record) = record(1, 1, bids.collect()) else { unreachable!() };
        node.handle(Duration::ZERO, Message::Bid(BidRecord { node: member.clone(), ..record }));
    }
    node.step(Duration::from_millis(20)).unwrap();
    let answered = node.take_selections().iter().filter(|one| one.event.kind() == "answer").count();
    assert_eq!(answered, 10 * requests * members.len());
}

#[test]
fn long_events_do_not_fill_the_memory() {
    let long = |n: u64| Event::new("uav/1/x").with("text", "x".repeat(30_000)).with("n", n as i64);
    let mut program = Program::new(ProgramConfig::vehicle(1));
    let taps = (0..500).map(|n| Op::Sync(Bid::new().request(long(n))));
    program.add("tap", Script::new(&taps.collect::<Vec<_>>()).unwrap());
    let mut node = Node::new(NodeConfig::new(name("uav/1"), 3, vec![name("uav/2")]), program);
    node.step(Duration::ZERO).unwrap();
    let presences = node.take_outgoing().into_iter().filter_map(|(_, message)| match message {
        Message::Presence(presence) => Some(presence),
        _ => None,
    });
    let kept = presences.last().map(|presence| presence.latest_seq + 1 - presence.oldest_seq).unwrap();
    assert!((100..=Bound::HistoryBytes.stated() as u64 / 30_000).contains(&kept), "{kept}");
    // Nor do those of another home that wait behind a hole.
    for seq in 2..500 {
        let Message::Occurrence(one) = occurrence("uav/2", seq, "uav/2/x") else { unreachable!() };
        node.handle(Duration::ZERO, Message::Occurrence(Occurrence { event: long(seq), ..one }));
    }
    let kept = node.caused_by(&name("uav/2"));
    assert!((10..20).contains(&kept.pending), "{kept:?}");
    assert!(kept.pending_bytes < Bound::PendingBytes.stated() + 40_000, "{kept:?}");
}

#[test]
fn lives_that_each_block_something_else_fill_no_disk() {
    let mut node = node_with(Some("uav/1"));
    for life in 1..2000 {
        let regions = (0..100).map(|n| EventSet::field_range("x", f64::from(life), f64::from(n)));
        let block = EventSet::from("uav/1/x").and(EventSet::any_of(regions));
        let hold = RemoteBid { on_loss: OnLoss::Hold, ..bid("hold", vec![], block) };
        let at = Duration::from_secs(life as u64);
        node.handle(at, record(life as u64, 1, vec![hold]));
    }
    let kept = node.kept();
    assert_eq!(kept.blocks.len(), 1);
    assert!(kept.blocks[0].block.extent().nodes <= Bound::SetNodes.stated());
    let written = serde_json::to_string(&kept.blocks[0].block).unwrap();
    assert_eq!(serde_json::from_str::<EventSet>(&written).unwrap().extent(), kept.blocks[0].block.extent());
}

#[test]
fn lives_that_each_block_under_other_names_fill_no_disk() {
    let mut node = node_with(Some("uav/1"));
    for life in 1..200 {
        let hold = |n: u64| RemoteBid {
            on_loss: OnLoss::Hold,
            ..bid(&format!("hold{}", 20 * life + n), vec![], "uav/1/x".into())
        };
        node.handle(Duration::from_secs(life), record(life, 1, (0..20).map(hold).collect()));
    }
    let kept: Vec<String> = node.kept().blocks.iter().map(|block| block.bthread.clone()).collect();
    assert_eq!(kept.len(), Bound::HonouredBids.stated());
    assert!(kept.contains(&"hold20".to_owned()), "what was promised first is kept: {kept:?}");
}

#[test]
fn a_record_that_is_too_much_names_the_bound() {
    let check = |bids: Vec<RemoteBid>| {
        let Message::Bid(record) = record(1, 1, bids) else { unreachable!() };
        record.check_bounds().map_err(|exceeded| exceeded.bound)
    };
    let deep = (0..46).fold(EventSet::from("uav/1/x"), |set, _| EventSet::And(vec![set]));
    assert_eq!(check(vec![bid("x", vec![], deep)]), Err(Bound::AskedDepth));
    let wide = EventSet::Or(vec!["uav/1/x".into(); 200]);
    assert_eq!(check(vec![bid("x", vec![], wide.clone()); 6]), Err(Bound::RecordNodes));
    assert_eq!(
        check(vec![bid("x", vec!["uav/1/x".into(); 60], EventSet::None); 3]),
        Err(Bound::RecordRequests)
    );
    assert_eq!(check(vec![bid("x", vec![], EventSet::None); 600]), Err(Bound::RecordBids));
    assert_eq!(check(vec![bid("x", vec!["uav/1/x".into(); 60], wide)]), Ok(()));
}

fn any_name() -> impl Strategy<Value = NodeName> {
    prop::sample::select(vec!["uav/1", "uav/2", "uav/3", "uav/9"]).prop_map(name)
}

fn any_event() -> impl Strategy<Value = Event> {
    let names = ["uav/1/a", "uav/1/land", "uav/2/a", "uav/3/a", "swarm/a", "tick", "uav/9/a"];
    prop::sample::select(names.to_vec()).prop_map(Event::new)
}

prop_compose! {
    fn any_message()(
        (a, b) in (any_name(), any_name()), which in 0..5, event in any_event(), incarnation in 0..4_u64,
        (n, m, far) in (1..6_u64, 0..6_u64, prop::sample::select(vec![1, 5, u64::MAX / 2])),
        (term, asks) in (0..3_u64, any::<bool>()), at in 0..3000_u64, known in prop::option::of(2..5_u64), lease_ms in prop::sample::select(vec![0, 1000, u64::MAX]),
    ) -> Message {
        let at = Duration::from_millis(at);
        let served = ServedRequest { node: b.clone(), incarnation: 3, bthread: "ask".into(), sync: n };
        let bid = RemoteBid {
            bthread: "x".into(), sync: n, requests: vec![event.clone()], block: EventSet::from("uav/1/*"), block_since: m,
            priority: Some(9), on_loss: if asks { OnLoss::Hold } else { OnLoss::Release },
        };
        match which {
            0 => Message::Bid(BidRecord {
                node: a, incarnation, home: b, home_incarnation: known, epoch: n, sent_at: at, applied: m, term, decided: far, lease_ms, bids: vec![bid],
            }),
            1 => Message::Ack(BidAck {
                home: a, home_incarnation: incarnation, node: b, incarnation: 3, epoch: n, sent_at: at, latest_seq: far, refused: vec![],
            }),
            2 => Message::Occurrence(Occurrence { home: a, incarnation, seq: n.max(far / 2), term, event, requests_served: vec![served], requested_by: Vec::new(), choice: None, at }),
            3 => Message::Repair(Repair { home: a, incarnation: 3, from_seq: m, to_seq: far, term, requester: b }),
            _ => Message::Presence(Presence { node: a, incarnation, up: at, latest_seq: far, oldest_seq: n, lease_ms,
                joint: (term > 0).then_some(JointWord { term, decided: n, heard: known.map(Duration::from_secs), asks }),
            }),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_sequence_of_messages_makes_a_node_fail(
        coordinator in prop::sample::select(vec![None, Some("uav/1"), Some("uav/2")]), messages in prop::collection::vec((any_message(), 0..400_u64), 0..60),
    ) {
        let mut node = node_with(coordinator);
        let mut now = Duration::ZERO;
        for (message, pause_ms) in messages {
            node.handle(now, message);
            prop_assert!(node.next_deadline() >= Duration::ZERO);
            now += Duration::from_millis(pause_ms);
            node.step(now).unwrap();
            node.take_unsaved();
            node.take_outgoing();
            for happened in node.take_selections() {
                prop_assert!(happened.event.name() != "uav/1/land", "a safety event was requested or claimed from afar");
            }
        }
    }
}
