//! A node tells what is on its board: exactly who blocks what, seldom, and never more than there is room for.

use std::time::Duration;

use crate::swarm::{Always, LEASE, Requester, Swarm, TICK, name, program};
use proptest::prelude::*;
use skein_bp::{Bid, Event, EventSet};
use skein_dbp::{Board, BoardLease, BoardRow};
use skein_wire::{Link as _, MAX_PAYLOAD, NetworkConfig, NodeLink, Payload};

/// `uav/1` wants to advance, `ground/main` blocks that, and something of the vehicle's own that it may not.
fn held() -> Swarm {
    let mut swarm = Swarm::new(&["uav/1", "ground/main"], NetworkConfig::default(), 1);
    let mut vehicle = program(1);
    vehicle.add("navigation", Requester::new("uav/1/advance", 1000, Duration::from_millis(100)));
    vehicle.add("mission", Always(Bid::new().wait_for("uav/1/landed").priority(10)));
    let config = skein_dbp::NodeConfig { safety: EventSet::named("uav/1/land"), ..swarm.config("uav/1", 1) };
    swarm.start_with(config, vehicle);
    let mut ground = program(1);
    ground.add("hold", Always(Bid::new().block(EventSet::from("uav/*/advance").or("uav/*/land"))));
    swarm.start("ground/main", 1, ground);
    swarm
}

#[test]
fn a_blocked_request_is_on_the_board_with_its_blocker_and_the_age_of_the_lease() {
    let mut swarm = held();
    swarm.run(Duration::from_secs(2));
    let board = swarm.node("uav/1").board();
    let navigation = board.row("navigation").unwrap();
    assert_eq!(navigation.requests[0].blocked_by, ["ground/main#hold"]);
    assert_eq!(navigation.lease, None);
    let mission = board.row("mission").unwrap();
    assert_eq!(mission.priority, Some(10));
    assert!(mission.waits.contains(&"uav/1/landed".into()));
    let hold = board.row("ground/main#hold").unwrap();
    // As it was asked for, not as this home honours it.
    assert_eq!(hold.blocks.to_string(), "(uav/*/advance | uav/*/land)");
    let BoardLease { age, length } = hold.lease.unwrap();
    assert!(age <= LEASE / 2 && length == LEASE, "{age:?} of {length:?}");

    swarm.crash("ground/main");
    swarm.run(LEASE * 2);
    let board = swarm.node("uav/1").board();
    assert!(board.row("ground/main#hold").is_none());
    assert!(board.row("navigation").unwrap().requests.iter().all(|request| request.blocked_by.is_empty()));
}

/// When `uav/1` puts its board in the next seconds.
fn told(swarm: &mut Swarm, seconds: u64) -> Vec<Duration> {
    let end = swarm.now + Duration::from_secs(seconds);
    let mut told = Vec::new();
    while swarm.now < end {
        swarm.tick();
        let now = swarm.now;
        let member = swarm.members.get_mut(&name("uav/1")).unwrap();
        told.extend(member.node.put_board(now, &mut member.link).map(|board| board.at));
    }
    told
}

#[test]
fn a_board_is_told_at_once_when_something_is_newly_blocked_and_seldom_when_nothing_changes() {
    let mut swarm = held();
    swarm.run(TICK * 50);
    let quiet = told(&mut swarm, 30);
    assert!((9..=12).contains(&quiet.len()), "{} times in 30 s", quiet.len());
    swarm.crash("ground/main");
    let lost_at = swarm.now;
    let free = told(&mut swarm, 2);
    assert!(free.iter().any(|at| *at <= lost_at + LEASE + Duration::from_millis(300)), "{free:?}");
    assert!(free.len() <= 5, "{free:?}");
}

#[test]
fn only_who_reads_boards_gets_them_and_nobody_gets_another_nodes_under_a_false_key() {
    let mut swarm = held();
    let ground = swarm.members.remove(&name("ground/main")).unwrap();
    let mut reader = NodeLink::new(ground.node.node().clone(), ground.node.fleet().clone()).reading_boards();
    let (mut deaf, mut link) = (ground.node, ground.link);
    let mut board = swarm.node("uav/1").board();
    for (round, node) in ["uav/1", "uav/2"].into_iter().enumerate() {
        board.node = name(node);
        let key = "skein/test/board/uav/1".parse().unwrap();
        let vehicle = swarm.members.get_mut(&name("uav/1")).unwrap();
        vehicle.link.put(&key, Payload::Board(board.clone()).encode());
        let now = Duration::from_secs(1 + round as u64);
        swarm.network.advance(now);
        reader.receive(now, &mut link);
        let read: Vec<_> = reader.take_boards().into_iter().map(|board| board.node).collect();
        let forged = u64::from(node != "uav/1");
        assert_eq!((read.len() as u64, reader.stats().forged), (1 - forged, forged), "{node}");
        vehicle.link.put(&key, Payload::Board(board.clone()).encode());
        swarm.network.advance(now + TICK);
        deaf.receive(now, &mut link);
    }
    assert!(deaf.take_boards().is_empty());
    assert_eq!(deaf.stats().received, 2);
}

fn text() -> impl Strategy<Value = String> {
    prop_oneof!["[a-z/é]{0,20}", "[a-zé…]{150,400}"]
}

fn set() -> impl Strategy<Value = EventSet> {
    let leaf = prop_oneof![
        Just(EventSet::None),
        Just(EventSet::All),
        text().prop_map(EventSet::named),
        text().prop_map(|value| EventSet::field_is("why", value)),
        text().prop_map(EventSet::prefix),
    ];
    leaf.prop_recursive(3, 80, 40, |set| {
        prop_oneof![
            set.clone().prop_map(|set| EventSet::Not(Box::new(set))),
            prop::collection::vec(set.clone(), 0..40).prop_map(EventSet::And),
            prop::collection::vec(set, 0..60).prop_map(EventSet::Or),
        ]
    })
}

prop_compose! {
    fn row()(
        bthread in text(), events in prop::collection::vec((text(), text()), 0..30), blockers in prop::collection::vec(text(), 0..30),
        (waits, blocks) in (set(), set()), priority in any::<Option<i32>>(), deadline in any::<Option<u32>>(),
    ) -> BoardRow {
        let bid = events.iter().fold(Bid::new().wait_for(waits).block(blocks), |bid, (name, why)| {
            bid.request(Event::new(format!("x{name}")).with("why", why.as_str()))
        });
        let row = BoardRow::new(bthread, &bid, |_| blockers.clone());
        let deadline = deadline.map(|ms| Duration::from_millis(ms.into()));
        BoardRow { priority, deadline, lease: deadline.map(|age| BoardLease { age, length: LEASE }), ..row }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_board_keeps_to_its_quotas_says_what_it_cut_and_survives_the_way(rows in prop::collection::vec(row(), 0..6), copies in 1..60_usize) {
        let all: Vec<BoardRow> = rows.iter().cycle().take(rows.len() * copies).cloned().collect();
        let given = all.len();
        let board = Board::new(name("uav/1"), 7, LEASE, all.clone());
        prop_assert_eq!(board.rows.len() + board.left_out as usize, given);
        prop_assert!(board.rows.len() <= Board::MAX_ROWS);
        for (row, given) in board.rows.iter().zip(&all) {
            prop_assert!(row.bthread.len() <= Board::MAX_TEXT && row.requests.len() <= Board::MAX_REQUESTS);
            prop_assert_eq!(row.cut, row != given, "{:?}", row);
        }
        let payload = Payload::Board(board.clone());
        let bytes = payload.encode();
        prop_assert!(bytes.len() < MAX_PAYLOAD / 2, "{} bytes", bytes.len());
        let Payload::Board(back) = Payload::decode(&bytes).unwrap() else { panic!("no board") };
        prop_assert!(back.repeats(&board) && back.stalls_as(&board));
    }
}
