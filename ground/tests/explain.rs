//! What is said of a vehicle, from boards made by hand and from recordings.

use std::path::Path;
use std::time::Duration;

use nalgebra::Vector3;
use skein_bp::{Bid, Event, EventSet, Origin};
use skein_dbp::{Board, BoardLease, BoardRow, Happened, NodeName};
use skein_ground::bthreads::Hold;
use skein_ground::explain::{Evidence, Explanation, Recorded, RecordedError, explain};
use skein_ground::recorder::Recorder;
use skein_wire::event::{Declared as _, Events as _, Limit, OrderGiven, What};
use skein_wire::{MissionState, State};

type Outcome = Result<(), Box<dyn std::error::Error>>;

const NOW: Duration = Duration::from_secs(20);
const LEASE: BoardLease = BoardLease { age: Duration::from_millis(200), length: Duration::from_secs(1) };

fn node(name: &str) -> NodeName {
    NodeName::new(name).unwrap()
}

/// An event of a vehicle that one of its b-threads has requested.
fn happened(at: Duration, event: Event, requested_by: &str) -> Happened {
    let origin = Origin::Internal;
    let requested_by = vec![requested_by.into()];
    Happened { event, home: node("uav/3"), seq: 1, term: 0, origin, requested_by, choice: None, at }
}

/// A b-thread's bid, and who blocks whatever it requests.
type Bidding<'a> = (&'a str, Bid, &'a [&'a str]);

/// The board of a node; names with `#` have a lease.
fn board(of: &str, bids: &[Bidding<'_>]) -> Board {
    let row = |(name, bid, blockers): &Bidding<'_>| {
        let row = BoardRow::new(*name, bid, |_| blockers.iter().map(|name| (*name).to_owned()).collect());
        BoardRow { lease: name.contains('#').then_some(LEASE), ..row }
    };
    Board::new(node(of), 1, NOW, bids.iter().map(row).collect())
}

/// Vehicles that have hovered since the beginning, and what is on these boards.
fn hovering(boards: Vec<Board>) -> Evidence {
    standing(boards, &|state| state)
}

fn standing(boards: Vec<Board>, change: &dyn Fn(State) -> State) -> Evidence {
    let mut evidence = Evidence::default();
    for board in boards {
        if board.node.kind() == "uav" {
            let state = State {
                armed: true,
                mode: "offboard".into(),
                position: Vector3::new(1.0, 2.0, 3.0),
                ..State::new(board.node.clone())
            };
            let state = change(state);
            evidence.note_state(Duration::ZERO, &state);
            evidence.note_state(NOW, &state);
        }
        evidence.note_board(NOW, board);
    }
    evidence
}

fn of(evidence: &Evidence, vehicle: &str) -> Explanation {
    explain(evidence, NOW, &node(vehicle)).unwrap()
}

fn request(event: &str) -> Bid {
    Bid::new().request(event)
}

fn held_by_ground() -> Vec<Board> {
    let ordered = |what: What| OrderGiven::any_at("ground/main").and(OrderGiven::what(what));
    let orders = [What::Hold, What::Resume, What::Land, What::Return, What::GoTo].map(ordered);
    let hold = Bid::new().block("uav/*/advance").wait_for(EventSet::any_of(orders));
    vec![
        board(
            "uav/3",
            &[
                ("navigation", request("uav/3/advance").priority(10), &["ground/main#hold"]),
                ("mission", Bid::new().wait_for("uav/3/arrived"), &[]),
                ("ground/main#hold", Bid::new().block("uav/*/advance"), &[]),
            ],
        ),
        board("ground/main", &[(Hold::NAME, hold, &[])]),
    ]
}

#[test]
fn a_held_vehicle_is_freed_by_an_order_or_by_the_end_of_the_lease() {
    let explanation = of(&hovering(held_by_ground()), "uav/3");
    let [change] = &*explanation.changes else { panic!("{explanation}") };
    assert_eq!(
        change.because,
        ["`uav/3/advance` is requested by navigation and blocked by ground/main#hold, renewed 0.2 s ago"]
    );
    assert_eq!(
        change.needed,
        [
            "the operator orders Resume, Return, Land or Go to",
            "ground/main is lost for 1.0 s, and its lease lapses"
        ]
    );
    let [request] = &*explanation.requests else { panic!("{explanation}") };
    assert_eq!((&*request.event, &*request.by, request.priority), ("uav/3/advance", "navigation", Some(10)));
    let blocker = &request.blocked_by[0];
    assert_eq!((&*blocker.node, &*blocker.bthread, blocker.local), ("ground/main", "hold", false));
    assert_eq!((blocker.lease_age_s, blocker.lease_s), (Some(0.2), Some(1.0)));
    assert!(explanation.doubts.is_empty());
    let text = explanation.to_string();
    assert!(
        text.starts_with("uav/3 at (1.0, 2.0, 3.0) stands still since 0.0 s, for 20.0 s; offboard"),
        "{text}"
    );
    assert!(text.contains("advance by navigation (priority 10), blocked by ground/main#hold (renewed 0.2 s ago, lease 1.0 s)"), "{text}");
}

#[test]
fn a_vehicle_that_moves_needs_no_change() {
    let mut evidence = hovering(held_by_ground());
    let state =
        State { position: Vector3::new(9.0, 2.0, 3.0), velocity: Vector3::x(), ..State::new(node("uav/3")) };
    evidence.note_state(NOW, &state);
    let explanation = of(&evidence, "uav/3");
    assert!(explanation.changes.is_empty(), "{explanation}");
    assert!(explanation.headline().contains("moves, 1.0 m/s"), "{explanation}");
    assert_eq!(explanation.requests.len(), 1);
}

#[test]
fn a_hold_is_told_with_who_ordered_it() {
    let mut evidence = hovering(held_by_ground());
    for by in ["Ben", "Anna"] {
        let order = OrderGiven::plain(What::Hold, OrderGiven::ALL, by).at("ground/main");
        evidence.note_event(Happened { home: node("ground/main"), ..happened(NOW, order, "") });
    }
    let because = &of(&evidence, "uav/3").changes[0].because;
    assert_eq!(because.last().map(String::as_str), Some("Anna has ordered it"), "{because:?}");
}

/// Both at the passage: each with what it requests, blocks and waits for.
fn at_a_passage(first: Bid, second: Bid) -> Vec<Board> {
    let leave = |vehicle: &str| EventSet::from(format!("{vehicle}/leave"));
    let own = |bid: Bid, vehicle: &str| bid.block(format!("{vehicle}/advance")).wait_for(leave(vehicle));
    vec![
        board(
            "uav/1",
            &[
                ("navigation", request("uav/1/advance"), &["right_of_way"]),
                ("right_of_way", own(first, "uav/1"), &["uav/2#right_of_way"]),
                ("uav/2#right_of_way", Bid::new().block("uav/*/enter"), &[]),
            ],
        ),
        board(
            "uav/2",
            &[
                ("navigation", request("uav/2/advance"), &["right_of_way"]),
                ("right_of_way", own(second, "uav/2"), &["uav/1#right_of_way"]),
                ("uav/1#right_of_way", Bid::new().block("uav/*/enter"), &[]),
            ],
        ),
    ]
}

#[test]
fn who_waits_for_a_passage_waits_for_the_one_inside_to_leave() {
    let evidence = hovering(at_a_passage(request("uav/1/enter"), Bid::new().block("uav/1/enter")));
    let explanation = of(&evidence, "uav/1");
    let [change] = &*explanation.changes else { panic!("{explanation}") };
    assert_eq!(
        change.because,
        [
            "`uav/1/advance` is requested by navigation and blocked by right_of_way",
            "`uav/1/enter` is requested by right_of_way and blocked by uav/2#right_of_way, renewed 0.2 s ago"
        ]
    );
    assert_eq!(change.needed[0], "`uav/2/leave` happens, which nobody requests");
    assert!(change.cycle.is_empty());
}

#[test]
fn a_cycle_of_waiting_is_named_as_one_with_what_ends_it() {
    let patient = request("uav/2/enter").deadline(NOW + Duration::from_millis(1500));
    let explanation = of(&hovering(at_a_passage(request("uav/1/enter"), patient)), "uav/1");
    let cycle = explanation.changes.iter().find(|change| !change.cycle.is_empty()).unwrap();
    assert_eq!(cycle.cycle, ["right_of_way", "uav/2#right_of_way"]);
    let last = cycle.because.last().map(String::as_str);
    assert_eq!(
        last,
        Some("that is a cycle of waiting: right_of_way, then uav/2#right_of_way and back to right_of_way")
    );
    assert_eq!(cycle.needed, ["uav/2#right_of_way goes on by itself, in 1.5 s", "one of them gives way"]);
}

#[test]
fn an_empty_battery_that_keeps_a_vehicle_from_flying_is_told_with_what_it_went_before() {
    let battery = Bid::new().block(["uav/3/return", "uav/3/goto"]).wait_for("uav/3/landed").priority(50);
    let operator = request("uav/3/return").wait_for("uav/3/order").priority(20);
    let mut evidence =
        hovering(vec![board("uav/3", &[("battery", battery, &[]), ("operator", operator, &["battery"])])]);
    evidence.note_event(Happened {
        choice: Some("priority 50, over uav/3/goto by mission (blocked)".into()),
        ..happened(
            NOW - Duration::from_secs(3),
            Event::new("uav/3/land").with("why", "battery nearly empty"),
            "battery",
        )
    });
    let explanation = of(&evidence, "uav/3");
    assert_eq!(
        explanation.changes[0].because,
        ["`uav/3/return` is requested by operator and blocked by battery"]
    );
    assert_eq!(explanation.changes[0].needed, ["`uav/3/landed` happens, which nobody requests"]);
    assert_eq!(
        explanation.events[0].to_string(),
        "17.00 s uav/3/land{why: \"battery nearly empty\"}, requested by battery; \
         priority 50, over uav/3/goto by mission (blocked)"
    );
}

#[test]
fn who_stands_on_the_ground_waits_for_its_turn_behind_those_who_are_launched_before_it() {
    let unready = Bid::new().block("uav/1/takeoff").wait_for("uav/1/ready");
    let boards = vec![
        board(
            "uav/1",
            &[("preflight", unready, &[]), ("ground/main#launch", request("uav/1/takeoff"), &["preflight"])],
        ),
        board("uav/2", &[("mission", Bid::new().wait_for("uav/2/takeoff"), &[])]),
        board("ground/main", &[("launch", request("uav/1/takeoff"), &[])]),
    ];
    let mut evidence = standing(boards, &|state| State { armed: false, ..state });
    let unready = Event::new("uav/1/unready").with("why", "home: stands 12 m east of its home");
    let unready = happened(NOW - Duration::from_secs(3), unready, "");
    evidence.note_event(Happened { home: node("uav/1"), ..unready });
    let explanation = of(&evidence, "uav/2");
    let [change] = &*explanation.changes else { panic!("{explanation}") };
    assert_eq!(
        change.because,
        [
            "nobody requests `uav/2/takeoff`, which mission waits for",
            "ground/main#launch would",
            "`uav/1/takeoff` is requested by ground/main#launch and blocked by uav/1#preflight",
            "uav/1 is not ready: home: stands 12 m east of its home"
        ]
    );
    assert_eq!(change.needed, ["`uav/1/ready` happens, which nobody requests"]);
}

#[test]
fn a_vehicle_that_is_done_says_so_and_one_never_heard_too() {
    let done = |state| State { armed: false, mission: MissionState::Complete, ..state };
    let evidence = standing(vec![board("uav/1", &[])], &done);
    assert_eq!(
        of(&evidence, "uav/1").changes[0].because,
        ["its mission is complete, and it is on the ground"]
    );
    let mut evidence = Evidence::default();
    evidence.note_vehicle(&node("uav/9"));
    let explanation = of(&evidence, "uav/9");
    assert_eq!(explanation.headline(), "uav/9: never heard");
    assert_eq!(explanation.doubts, ["uav/9 has told nothing of what it requests and blocks"]);
    assert_eq!(explain(&evidence, NOW, &node("uav/1")), None);
}

#[test]
fn what_is_old_or_cut_is_doubted() {
    let mut boards = held_by_ground();
    boards[0].rows[0].cut = true;
    let evidence = hovering(boards);
    let later = explain(&evidence, NOW + Duration::from_secs(30), &node("uav/3")).unwrap();
    assert_eq!(later.doubts.len(), 2, "{later}");
    assert!(later.doubts[0].contains("as of 30 s before"), "{later}");
}

#[test]
fn any_ring_of_waiting_ends() {
    // Everybody requests what the next one blocks, in rings of every size, and is named on every other board.
    for size in 2..40_usize {
        let name = |index: usize| format!("uav/{}", 1 + index % size);
        let boards = (0..size).map(|index| {
            let blocker = format!("{}#b", name(index + 1));
            board(&name(index), &[("b", request(&format!("{}/enter", name(index))), &[&blocker])])
        });
        let explanation = of(&hovering(boards.collect()), "uav/1");
        assert_eq!(explanation.changes.len(), 1, "{size}: {explanation}");
        assert_eq!(explanation.changes[0].cycle.is_empty(), size > 8, "{size}");
    }
}

#[test]
fn the_most_tangled_boards_are_explained_in_a_few_reasons() {
    let names: Vec<String> = (1..=24).map(|number| format!("uav/{number}")).collect();
    let tangled = |vehicle: &String| {
        let others: Vec<String> =
            names.iter().filter(|name| *name != vehicle).map(|name| format!("{name}#b")).collect();
        let others: Vec<&str> = others.iter().map(String::as_str).collect();
        let bid = ["enter", "advance", "goto", "plan"]
            .iter()
            .fold(Bid::new(), |bid, verb| bid.request(format!("{vehicle}/{verb}")));
        board(vehicle, &[("b", bid.wait_for("uav/**"), &others)])
    };
    let explanation = of(&hovering(names.iter().map(tangled).collect()), "uav/1");
    assert!((1..=8).contains(&explanation.changes.len()), "{explanation}");
}

/// A vehicle that flies for ten seconds and is held from then on.
fn record(path: &Path) -> Result<Recorder, Box<dyn std::error::Error>> {
    let mut recorder = Recorder::create(path)?;
    for second in 0..=20_u32 {
        let planned = happened(Duration::from_secs(second.into()), "uav/3/plan".into(), "mission");
        recorder.trace(&node("uav/3"), &planned)?;
        for tenth in 0..10 {
            let now = Duration::from_millis(u64::from(second) * 1000 + tenth * 100);
            let x = f64::from(second.min(10));
            let state = State {
                time: now,
                armed: true,
                position: Vector3::new(x, 0.0, 3.0),
                ..State::new(node("uav/3"))
            };
            recorder.state(now, &state)?;
            if second >= 10 {
                for board in held_by_ground() {
                    recorder.board(now, &Board { at: now, ..board })?;
                }
            }
        }
    }
    Ok(recorder)
}

#[test]
fn a_recording_is_explained_at_any_time_in_it() -> Outcome {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("mission.mcap");
    record(&path)?.finish()?;
    let recorded = Recorded::open(&path)?;
    assert!(recorded.is_complete() && recorded.has_boards());
    assert_eq!(recorded.span(), Some((Duration::ZERO, Duration::from_millis(20_900))));
    let at = |seconds| {
        explain(
            &recorded.evidence_at(Duration::from_secs(seconds)),
            Duration::from_secs(seconds),
            &node("uav/3"),
        )
    };
    let flying = at(8).ok_or("unknown")?;
    assert!(flying.changes.is_empty() && flying.requests.is_empty(), "{flying}");
    assert_eq!(flying.events[0].time_s, 8.0);
    let held = at(18).ok_or("unknown")?;
    assert!(held.changes[0].because[0].contains("blocked by ground/main#hold"), "{held}");
    assert_eq!(held.situation.and_then(|situation| situation.still_since_s), Some(10.0));
    Ok(())
}

#[test]
fn a_recording_that_was_cut_short_is_explained_as_far_as_it_goes() -> Outcome {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("mission.mcap");
    let recorder = record(&path)?;
    // As a killed process would: nothing of what is still in memory reaches the file.
    std::mem::forget(recorder);
    let file = std::fs::read(&path)?;
    for length in [file.len(), file.len() * 19 / 20, file.len() * 17 / 20] {
        std::fs::write(&path, &file[..length])?;
        let recorded = Recorded::open(&path)?;
        assert!(!recorded.is_complete());
        let (_, last) = recorded.span().ok_or("empty")?;
        assert!(last > Duration::from_secs(11), "{last:?}");
        let explanation = explain(&recorded.evidence_at(last), last, &node("uav/3")).ok_or("unknown")?;
        assert!(explanation.to_string().contains("blocked by ground/main#hold"), "{explanation}");
    }
    for length in 0..file.len().min(3000) {
        std::fs::write(&path, &file[..length])?;
        match Recorded::open(&path) {
            Ok(recorded) => assert!(!recorded.is_complete()),
            Err(error) => assert!(error.to_string().contains("mission.mcap"), "{error}"),
        }
    }
    Ok(())
}

#[test]
fn what_is_no_recording_is_named() {
    let missing = Recorded::open(Path::new("missing.mcap")).err();
    assert!(
        matches!(&missing, Some(error @ RecordedError::Open { .. }) if error.to_string().contains("missing.mcap"))
    );
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
    assert!(matches!(Recorded::open(&own), Err(RecordedError::Unreadable { .. })));
}

#[test]
fn limits_on_motion_are_named_with_whose_they_are_and_a_contradiction_is_a_reason() {
    let limit = |bound| Bid::new().wait_for("uav/3/alone").state(Limit { ..bound }.at("uav/3"));
    let low = limit(Limit { max_z: Some(4.0), ..Limit::NONE });
    let slow = limit(Limit { speed_m_s: Some(1.0), max_z: Some(9.0), ..Limit::NONE });
    let bids: [Bidding<'_>; 2] = [("script/low", low, &[]), ("careful", slow, &[])];
    let explanation = explain(&hovering(vec![board("uav/3", &bids)]), NOW, &node("uav/3")).unwrap();
    let limits = ["careful limits speed to at most 1 m/s", "script/low limits z to at most 4 m"];
    assert_eq!(explanation.limits, limits);
    assert!(explanation.to_string().contains("limits on its motion\n    careful limits"), "{explanation}");

    let high = limit(Limit { min_z: Some(6.0), ..Limit::NONE });
    let bids: [Bidding<'_>; 2] = [(bids[0].0, bids[0].1.clone(), &[]), ("script/high", high, &[])];
    let explanation = explain(&hovering(vec![board("uav/3", &bids)]), NOW, &node("uav/3")).unwrap();
    let why = "script/high says `z not below 6 m`, and script/low says `z not above 4 m`";
    assert_eq!(explanation.changes[0].because, [why]);
}
