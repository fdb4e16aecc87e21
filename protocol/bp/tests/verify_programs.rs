//! The verifier on programs whose answers are known.

use std::collections::BTreeSet;

use crate::support::{START, plain};
use serde::Serialize;
use serde_json::json;
use skein_bp::script::{Op, Script};
use skein_bp::verify::{Inspection, Report, Search, Verifier, ViolationKind};
use skein_bp::{BThread, Bid, Context, Event, EventSet, Program, ProgramConfig, Strategy};

fn names(report: &Report) -> Vec<String> {
    report.verdict.iter().flat_map(|violation| &violation.trace).map(Event::to_string).collect()
}

/// Each takes the right stick first.
fn philosophers(count: usize) -> Program {
    let mut program = Program::new(ProgramConfig::default());
    let sync = |bid: Bid| Op::Sync(bid);
    for i in 1..=count {
        let next = i % count + 1;
        let picks = EventSet::from([format!("Pick{i}R"), format!("Pick{next}L")]);
        let releases = EventSet::from([format!("Rel{i}R"), format!("Rel{next}L")]);
        let stick = [
            sync(Bid::new().wait_for(&picks).block(&releases)),
            sync(Bid::new().wait_for(&releases).block(&picks)),
        ];
        program.add(format!("Stick{i}"), Script::new(&[Op::forever(stick)]).unwrap());
        let acts = [format!("Pick{i}R"), format!("Pick{i}L"), format!("Rel{i}L"), format!("Rel{i}R")];
        let acts = acts.map(|act| sync(Bid::new().request(act)));
        program.add(format!("Phil{i}"), Script::new(&[Op::forever(acts)]).unwrap());
    }
    program
}

#[test]
fn dining_philosophers_have_the_known_graph_and_starve_when_each_has_one_stick() {
    for (count, states, edges) in [(3, 35, 75), (4, 118, 340), (5, 392, 1415)] {
        for order in [Search::BreadthFirst, Search::DepthFirst] {
            let report = Verifier::new(philosophers(count)).inspect([]).order(order).run();
            assert_eq!((report.states, report.edges), (states, edges));
            assert!(report.is_complete() && report.verdict.is_none(), "{report}");
        }
        let report = Verifier::new(philosophers(count)).inspect([Inspection::Deadlock]).run();
        let picks: BTreeSet<String> = (1..=count).map(|i| format!("Pick{i}R")).collect();
        assert_eq!(names(&report).len(), count);
        assert_eq!(names(&report).into_iter().collect::<BTreeSet<_>>(), picks);
        assert_eq!(report.verdict.unwrap().violators.len(), count, "every philosopher is stuck");
    }
}

#[test]
fn two_threads_find_what_one_finds() {
    let bounds = [(usize::MAX, u32::MAX), (9_000, u32::MAX), (usize::MAX, 15)];
    for (inspections, (most_states, deepest)) in [vec![], vec![Inspection::Deadlock]]
        .into_iter()
        .flat_map(|i| bounds.map(|bounds| (i.clone(), bounds)))
    {
        let run = |threads| {
            let verifier = Verifier::new(philosophers(8)).inspect(inspections.clone()).threads(threads);
            verifier.most_states(most_states).deepest(deepest).run()
        };
        assert_eq!(run(2), run(1), "{most_states} states, {deepest} deep");
    }
    // Late enough to be found by the other thread.
    let late = |threads| {
        let mut program = philosophers(8);
        program.add(
            "counts",
            Script::new(&[Op::repeat(16, [wait(EventSet::All)]), Op::AssertFail("late".into())]).unwrap(),
        );
        Verifier::new(program).inspect([Inspection::FailedAssertion]).threads(threads).run()
    };
    assert_eq!(late(1).verdict.as_ref().unwrap().trace.len(), 16);
    assert_eq!(late(2), late(1));
}

const LINES: [[(i32, i32); 3]; 8] = [
    [(0, 0), (0, 1), (0, 2)],
    [(1, 0), (1, 1), (1, 2)],
    [(2, 0), (2, 1), (2, 2)],
    [(0, 0), (1, 0), (2, 0)],
    [(0, 1), (1, 1), (2, 1)],
    [(0, 2), (1, 2), (2, 2)],
    [(0, 0), (1, 1), (2, 2)],
    [(0, 2), (1, 1), (2, 0)],
];
const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
const CORNERS: [(i32, i32); 4] = [(0, 0), (0, 2), (2, 0), (2, 2)];
const SIDES: [(i32, i32); 4] = [(0, 1), (1, 0), (1, 2), (2, 1)];

fn mark(player: &str, (row, column): (i32, i32)) -> String {
    format!("{player}({row},{column})")
}

fn wait(event: impl Into<EventSet>) -> Op {
    Op::Sync(Bid::new().wait_for(event))
}

fn ask(priority: i32, events: impl IntoIterator<Item = String>) -> Op {
    Op::Sync(events.into_iter().fold(Bid::new(), Bid::request).priority(priority))
}

/// The rules, an O that plays by precepts, and an X that plays anything: each precept is a b-thread.
fn tic_tac_toe() -> Program {
    let mut program =
        Program::new(ProgramConfig { strategy: Strategy::SyncPriority, ..ProgramConfig::default() });
    let mut add = |name: String, body: Vec<Op>| {
        program.add(name, Script::new(&[Op::forever(body)]).unwrap());
    };
    let (any_x, any_o) = (EventSet::prefix("X("), EventSet::prefix("O("));
    let any_mark = any_x.clone().or(any_o.clone());
    let squares = || (0..3).flat_map(|row| (0..3).map(move |column| (row, column)));
    for square in squares() {
        let marks = EventSet::from([mark("X", square), mark("O", square)]);
        let body = vec![wait(&marks), Op::Sync(Bid::new().block(&marks))];
        add(format!("taken {square:?}"), body);
    }
    let turns = [(&any_x, &any_o), (&any_o, &any_x)]
        .map(|(now, later)| Op::Sync(Bid::new().wait_for(now).block(later)));
    add("turns".into(), turns.into());
    let over = EventSet::from(["XWin", "OWin", "draw"]);
    add("over".into(), vec![wait(over), Op::Sync(Bid::new().block(&any_mark))]);
    let mut nine: Vec<Op> = vec![wait(&any_mark); 9];
    nine.push(ask(90, ["draw".to_owned()]));
    add("nine marks".into(), nine);
    for line in LINES {
        for [a, b, c] in ORDERS.map(|order| order.map(|at| line[at])) {
            for (player, win) in [("X", "XWin"), ("O", "OWin")] {
                let body = vec![
                    wait(mark(player, a)),
                    wait(mark(player, b)),
                    wait(mark(player, c)),
                    ask(100, [win.to_owned()]),
                ];
                add(format!("{win} {a:?}{b:?}{c:?}"), body);
            }
            for (player, priority) in [("O", 50), ("X", 40)] {
                let body = vec![wait(mark(player, a)), wait(mark(player, b)), ask(priority, [mark("O", c)])];
                add(format!("third {player} {a:?}{b:?}{c:?}"), body);
            }
        }
    }
    // Two X that could make a fork, and the corners or sides that spoil it.
    type Square = (i32, i32);
    let forks: [([Square; 2], &[Square]); 13] = [
        ([(1, 2), (2, 0)], &[(2, 2), (0, 2), (2, 0)]),
        ([(2, 1), (0, 2)], &[(2, 2), (0, 2), (2, 0)]),
        ([(1, 2), (2, 1)], &[(2, 2), (0, 2), (2, 0)]),
        ([(1, 2), (0, 0)], &[(0, 2), (0, 0), (2, 2)]),
        ([(0, 1), (2, 2)], &[(0, 2), (0, 0), (2, 2)]),
        ([(1, 2), (0, 1)], &[(0, 2), (0, 0), (2, 2)]),
        ([(1, 0), (2, 2)], &[(2, 0), (0, 0), (2, 2)]),
        ([(2, 1), (0, 0)], &[(2, 0), (0, 0), (2, 2)]),
        ([(2, 1), (1, 0)], &[(2, 0), (0, 0), (2, 2)]),
        ([(0, 1), (2, 0)], &[(0, 0), (0, 2), (2, 0)]),
        ([(1, 0), (0, 2)], &[(0, 0), (0, 2), (2, 0)]),
        ([(0, 1), (1, 0)], &[(0, 0), (0, 2), (2, 0)]),
        // The other diagonal is forgotten, which is O's mistake.
        ([(0, 2), (2, 0)], &SIDES),
    ];
    for ([a, b], answers) in forks {
        for (a, b) in [(a, b), (b, a)] {
            let answer = ask(30, answers.iter().map(|square| mark("O", *square)));
            add(format!("fork {a:?}{b:?}"), vec![wait(mark("X", a)), wait(mark("X", b)), answer]);
        }
    }
    add("centre".into(), vec![ask(35, [mark("O", (1, 1))])]);
    add("corners".into(), vec![ask(20, CORNERS.map(|square| mark("O", square)))]);
    add("sides".into(), vec![ask(10, SIDES.map(|square| mark("O", square)))]);
    add("X".into(), vec![ask(10, squares().map(|square| mark("X", square)))]);
    add("X never wins".into(), vec![wait("XWin"), Op::AssertFail("X wins".into())]);
    program
}

#[test]
fn x_wins_at_tic_tac_toe_against_precepts_that_forget_a_diagonal() {
    let report = Verifier::new(tic_tac_toe()).inspect([Inspection::FailedAssertion]).deepest(70).run();
    let violation = report.verdict.as_ref().unwrap();
    assert_eq!(violation.kind, ViolationKind::FailedAssertion { message: "X wins".into() });
    assert_eq!(*violation.violators[0], *"X never wins");
    // Three X in a row and a fourth for the fork, three O between them, and the win itself.
    let trace = names(&report);
    assert_eq!((trace.len(), &*trace[7]), (8, "XWin"), "{report}");
    let crosses: Vec<&String> = trace.iter().filter(|name| name.starts_with("X(")).collect();
    assert!(
        LINES.iter().any(|line| line.iter().all(|square| crosses.contains(&&mark("X", *square)))),
        "{report}"
    );

    // The counter-example that BPjs publishes is one here too.
    let mut program = tic_tac_toe();
    for name in ["X(2,2)", "O(1,1)", "X(0,0)", "O(2,0)", "X(0,2)", "O(0,1)", "X(1,2)", "XWin"] {
        program.choose(&name.into(), START).unwrap();
    }
    assert!(program.failed().is_some());
}

/// Walks from cell to cell.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Walker {
    at: (i64, i64),
    inside: bool,
}

fn enter((row, column): (i64, i64)) -> Event {
    Event::new("Enter").with("row", row).with("column", column)
}

impl BThread for Walker {
    fn bid(&self) -> Option<Bid> {
        let (row, column) = self.at;
        let steps = [(row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)];
        let steps = if self.inside { &steps[..] } else { &[self.at] };
        Some(steps.iter().map(|cell| enter(*cell)).fold(Bid::new().interrupt("found"), Bid::request))
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.at = (event.int("row").unwrap(), event.int("column").unwrap());
        self.inside = true;
    }
}

/// Lets no cell be entered twice.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize)]
struct OnlyOnce(BTreeSet<(i64, i64)>);

impl BThread for OnlyOnce {
    fn bid(&self) -> Option<Bid> {
        Some(Bid::new().wait_for("Enter").block(EventSet::any_of(self.0.iter().map(|cell| enter(*cell)))))
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.0.insert((event.int("row").unwrap(), event.int("column").unwrap()));
    }
}

/// `s` is the start, `t` the target, everything but these and blanks is a wall.
fn maze(rows: &[&str]) -> Report {
    let mut program = Program::new(ProgramConfig::default());
    let inside = EventSet::field_range("row", 0.0, rows.len() as f64 - 1.0).and(EventSet::field_range(
        "column",
        0.0,
        rows[0].len() as f64 - 1.0,
    ));
    program.add(
        "border",
        Script::new(&[Op::Sync(Bid::new().block(EventSet::from("Enter").and(inside.not())))]).unwrap(),
    );
    for (row, text) in rows.iter().enumerate() {
        for (column, cell) in text.chars().enumerate() {
            let at = (row as i64, column as i64);
            match cell {
                's' => drop(program.add("walker", Walker { at, inside: false })),
                't' => {
                    let found = Bid::new().request("found").block(EventSet::from("found").not());
                    let body = [Op::Sync(Bid::new().wait_for(enter(at))), Op::Sync(found)];
                    program.add("target", Script::new(&body).unwrap());
                }
                ' ' => {}
                _ => {
                    let wall = Script::new(&[Op::Sync(Bid::new().block(enter(at)))]).unwrap();
                    program.add(format!("wall {at:?}"), wall);
                }
            }
        }
    }
    program.add("only once", OnlyOnce::default());
    let requirement = [wait("found"), Op::AssertFail("found".into())];
    program.add("never found", Script::new(&requirement).unwrap());
    Verifier::new(program).inspect([Inspection::FailedAssertion]).run()
}

#[test]
fn the_way_through_a_maze_is_the_shortest_counter_example() {
    let ways = [
        (&["s  ", "   ", "  t"][..], 5),
        (&["s  ", "## ", "t  "], 7),
        (&["       t ", "##  #####", "         ", "######## ", "s        "], 22),
        (&["  *     t", "*** *****", "  * *    ", "*** *****", "  *s*    "], 10),
    ];
    for (rows, cells) in ways {
        let report = maze(rows);
        assert_eq!(names(&report).len(), cells + 1, "{rows:?}: {report}");
        assert_eq!(names(&report).last().unwrap(), "found");
    }
}

#[test]
fn a_maze_without_a_way_is_proved_to_have_none() {
    for rows in [&["s# ", "## ", "  t"], &["s  ", "###", "  t"]] {
        let report = maze(rows);
        assert!(report.verdict.is_none() && report.is_complete(), "{report}");
    }
}

#[test]
fn a_b_thread_that_forks_runs_both_branches_in_every_interleaving() {
    let program = || {
        plain([(
            "parent",
            json!([
                {"sync": {"request": ["start"]}},
                {"spawn": {"name": "child", "body": [
                    {"sync": {"request": ["child prints"]}},
                    {"sync": {"request": ["child/2"]}},
                ]}},
                {"sync": {"request": ["parent prints"]}},
                {"sync": {"request": ["parent/1"]}},
            ]),
        )])
    };
    // The start, then three places in each branch.
    let report = Verifier::new(program()).run();
    assert_eq!((report.states, report.edges), (10, 13));
    assert!(report.verdict.is_none() && report.is_complete(), "{report}");
}

#[test]
fn children_spawned_in_either_order_meet_in_one_state() {
    let spawner = |event: &str, child: &str| {
        json!([
            {"sync": {"request": [event]}},
            {"spawn": {"name": child, "body": [{"sync": {"wait": "never"}}]}},
        ])
    };
    let program = plain([("one", spawner("a", "first")), ("other", spawner("b", "second"))]);
    let report = Verifier::new(program).run();
    assert_eq!((report.states, report.edges), (4, 4));
}

#[test]
fn where_the_order_of_children_shows_it_is_part_of_the_state() {
    // Whoever was added first enqueues first, so the queue tells in which order they came.
    let spawner = |event: &str, child: &str| {
        json!([
            {"sync": {"request": [event]}},
            {"spawn": {"name": child, "body": [{"sync": {"wait": "go"}}, {"enqueue": [child]}]}},
        ])
    };
    let watch = json!([
        {"sync": {"wait": "second"}},
        {"sync": {"wait": "first"}},
        {"assert_fail": "the second came first"},
    ]);
    let starter = json!([
        {"sync": {"wait": ["a", "b"]}},
        {"sync": {"wait": ["a", "b"]}},
        {"sync": {"request": ["go"]}},
    ]);
    let bthreads = [
        ("one", spawner("a", "first")),
        ("other", spawner("b", "second")),
        ("go", starter),
        ("watch", watch),
    ];
    let report = Verifier::new(plain(bthreads)).inspect([Inspection::FailedAssertion]).run();
    assert_eq!(names(&report), ["b", "a", "go", "second", "first"]);
}

#[test]
fn an_invariant_sees_conflicting_writes_at_one_synchronisation_point() {
    let writer = |value: i64| {
        let write = Event::new("write").with("key", "c").with("value", value);
        Script::new(&[Op::Sync(Bid::new().request(write))]).unwrap()
    };
    let run = |values: [i64; 3]| {
        let mut program = Program::new(ProgramConfig::default());
        for (at, value) in values.into_iter().enumerate() {
            program.add(format!("t{at}"), writer(value));
        }
        let one_value = |view: &skein_bp::verify::View<'_>| {
            let written: BTreeSet<&Event> = view.bids().flat_map(|(_, bid)| bid.requests()).collect();
            if written.len() > 1 { Err(format!("{} different values of c", written.len())) } else { Ok(()) }
        };
        Verifier::new(program).inspect([]).invariant("one value for each key", one_value).run()
    };
    let report = run([1, 2, 3]);
    assert_eq!(names(&report), [""; 0]);
    assert!(
        report.to_string().starts_with("`one value for each key` does not hold: 3 different values of c")
    );
    assert_eq!(run([1, 1, 1]).verdict, None);
}

#[test]
fn an_invariant_sees_the_states_of_rust_b_threads() {
    let mut program = Program::new(ProgramConfig::default());
    program.add("walker", Walker { at: (0, 0), inside: false });
    let stays_low = |view: &skein_bp::verify::View<'_>| match view.state_of::<Walker>("walker") {
        Some(walker) if walker.at.0 > 1 => Err(format!("at row {}", walker.at.0)),
        Some(_) => Ok(()),
        None => Err("no walker".to_owned()),
    };
    let report = Verifier::new(program).inspect([]).invariant("low", stays_low).run();
    assert_eq!(names(&report).len(), 3, "{report}");
}

#[test]
fn what_occurred_elsewhere_happens_before_anything_else() {
    let mut program = plain([("t", json!([{"sync": {"request": ["own"], "wait": "far", "block": "far"}}]))]);
    program.occurred("far");
    let report = Verifier::new(program).run();
    assert_eq!((report.states, report.edges), (2, 1));
}
