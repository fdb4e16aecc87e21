//! The verifier on small networks whose answers are known.

use std::sync::Arc;
use std::time::Duration;

use skein_bp::script::{Op, Script};
use skein_bp::verify::{Inspection, Omission, Report, ViolationKind};
use skein_bp::{Bid, EventSet, Program, ProgramConfig};
use skein_dbp::verify::programs::{self, Network};
use skein_dbp::verify::{Faults, Member, NetworkView};
use skein_dbp::{NodeConfig, NodeName, facts};

const NONE: Faults = Faults {
    delay: false,
    lapses: 0,
    restarts: 0,
    repeats: 0,
    partitions: 0,
    late_facts: false,
    most_under_way: 8,
};

fn trace(report: &Report) -> Vec<String> {
    report.verdict.iter().flat_map(|violation| &violation.trace).map(ToString::to_string).collect()
}

fn holds(network: &Network, faults: Faults) -> Report {
    let report = network.verifier(faults).run();
    assert_eq!(report.verdict, None, "{}: {report}", network.name);
    // The only bounds are those on what may go wrong.
    let is_modelled = |omission: &Omission| matches!(omission, Omission::NotModelled { .. });
    assert!(report.not_covered.iter().all(is_modelled), "{}: {report}", network.name);
    println!("{}: {} states, {} edges", network.name, report.states, report.edges);
    report
}

#[test]
fn nodes_pass_a_gate_by_turns() {
    let network = programs::alternating_gate().unwrap();
    let calm = holds(&network, NONE);
    holds(&network, Faults { delay: true, ..NONE });
    let lapsing = holds(&network, Faults { lapses: 1, ..NONE });
    let restarting = holds(&network, Faults { restarts: 1, ..NONE });
    let repeating = holds(&network, Faults { repeats: 1, ..NONE });
    let parting = holds(&network, Faults { partitions: 1, ..NONE });
    // Faults add behaviour.
    assert!([lapsing, restarting, repeating, parting].iter().all(|report| report.states > calm.states));
}

#[test]
fn one_at_most_is_inside_where_each_blocks_awaits_confirmation_and_acts() {
    let network = programs::guarded_resource(2).unwrap();
    holds(&network, Faults { delay: true, ..NONE });
    holds(&network, Faults { lapses: 1, ..NONE });
    holds(&network, Faults { restarts: 1, ..NONE });
}

#[test]
fn of_three_one_at_most_is_inside() {
    holds(&programs::guarded_resource(3).unwrap(), NONE);
}

#[test]
fn someone_does_get_inside() {
    let mut network = programs::guarded_resource(2).unwrap();
    let enters = |view: &NetworkView<'_>| {
        let entered = view.programs().any(|(node, program)| {
            let entrance = program.bids().find(|(name, ..)| *name == "entrance");
            entrance.is_some_and(|(_, bid, sync)| {
                sync > 2 && bid.requests().is_empty() && node.starts_with("uav/")
            })
        });
        if entered { Err("entered".to_owned()) } else { Ok(()) }
    };
    network.requirement = Some(("nobody enters", Arc::new(enters)));
    assert!(network.verifier(NONE).run().verdict.is_some());
}

#[test]
fn two_are_inside_where_nobody_awaits_confirmation() {
    let report = programs::naive_resource(2).unwrap().verifier(NONE).run();
    let violation = report.verdict.as_ref().unwrap();
    assert!(
        matches!(&violation.kind, ViolationKind::Invariant { message, .. } if message == "uav/1 and uav/2 are inside")
    );
    // Both begin, and enter before they hear of each other.
    assert_eq!(trace(&report).len(), 2, "{report}");
    assert!(
        trace(&report)[0].starts_with("uav/1 begins") && trace(&report)[0].contains("uav/1/enter"),
        "{report}"
    );
}

/// Whoever is inside learns of a home's new life, and leaves, before it can acknowledge a claim of that life.
#[test]
fn one_at_most_is_inside_after_a_restart_even_where_entering_is_not_guarded() {
    let mut network = programs::guarded_resource(2).unwrap();
    for Member { config, .. } in &mut network.members {
        config.guarded = EventSet::None;
    }
    holds(&network, Faults { restarts: 1, ..NONE });
}

/// Like the guarded resource, but whoever is inside does not heed that its block has lapsed.
#[test]
fn two_are_inside_where_a_lapsed_block_is_not_heeded() {
    let members = ["uav/1", "uav/2"].map(|name| {
        let name = NodeName::new(name).unwrap();
        let own = name.event_name("enter");
        let mut program = Program::new(ProgramConfig::default());
        let others = EventSet::from("uav/*/enter").and(EventSet::named(own.as_str()).not());
        let claim = Bid::new().block(others).wait_for(facts::block_lapsed(&name, "claim"));
        program.add("claim", Script::new(&[Op::forever([Op::Sync(claim)])]).unwrap());
        let entrance = [
            Op::Sync(Bid::new().wait_for(facts::confirmed(&name, "claim"))),
            Op::Sync(Bid::new().request(own)),
            Op::Sync(Bid::new()),
        ];
        program.add("entrance", Script::new(&entrance).unwrap());
        Member { config: NodeConfig::new(name, 1, Vec::new()), program, may_restart: false }
    });
    let one_inside = |view: &NetworkView<'_>| {
        let is_inside =
            |program: &Program| program.bids().any(|(name, _, sync)| name == "entrance" && sync == 3);
        let inside = view.programs().filter(|(_, program)| is_inside(program)).count();
        if inside > 1 { Err(format!("{inside} are inside")) } else { Ok(()) }
    };
    let network = Network {
        name: "deaf",
        about: "whoever is inside does not heed that its block has lapsed",
        is_sound: false,
        faults: NONE,
        members: members.into(),
        requirement: Some(("one inside", Arc::new(one_inside))),
    };
    holds(&network, NONE);
    let report = network.verifier(Faults { lapses: 1, ..NONE }).run();
    assert!(report.verdict.is_some(), "{report}");
    assert!(trace(&report).iter().any(|step| step.contains("lets go of what")), "{report}");
    // A partition lets leases lapse that would not by themselves.
    let (report, moves) = network.verifier(Faults { partitions: 1, ..NONE }).run_and_count();
    assert!(report.verdict.is_some(), "{report}");
    assert!(trace(&report).iter().any(|step| step.contains("are cut off from one another")), "{report}");
    assert!(moves["partition"] > 0 && moves["lapse"] > 0 && !moves.contains_key("restart"), "{moves:?}");
}

#[test]
fn a_hold_that_is_counted_on_holds_through_a_partition_and_a_repetition() {
    for network in [programs::hold().unwrap(), programs::kept_hold().unwrap()] {
        holds(&network, Faults { partitions: 1, ..NONE });
        holds(&network, Faults { repeats: 1, delay: true, ..NONE });
    }
}

/// A block that is stated to outlive its holder is there in its home's next life; another is not.
#[test]
fn only_a_kept_hold_survives_the_restart_of_its_home() {
    let survives = |mut network: Network| {
        let lost = |view: &NetworkView<'_>| {
            let [ground, uav] = ["ground/main", "uav/1"].map(|node| view.program(node).unwrap());
            let was_confirmed = ground.bids().any(|(name, _, sync)| name == "trust" && sync > 1);
            let is_held = uav.blockers(&"uav/1/advance".into()).next().is_some();
            if was_confirmed && !is_held { Err("let go".to_owned()) } else { Ok(()) }
        };
        network.requirement = Some(("once confirmed, it stays", Arc::new(lost)));
        network.verifier(Faults { restarts: 1, ..NONE }).run().verdict.is_none()
    };
    assert!(survives(programs::kept_hold().unwrap()));
    assert!(!survives(programs::hold().unwrap()));
}

#[test]
fn programs_have_names_of_their_own() {
    let all = programs::all().unwrap();
    let names: std::collections::BTreeSet<&str> = all.iter().map(|network| network.name).collect();
    assert_eq!(names.len(), all.len());
    assert!(all.iter().any(|network| !network.is_sound), "nothing shows that faults are found");
}

#[test]
fn nobody_takes_off_while_held() {
    holds(&programs::held_launch().unwrap(), Faults { lapses: 1, ..NONE });
}

/// How many states the two searches below look at: more than it takes to find what is wrong with the second network.
const MOST: usize = 15_000;

#[test]
fn what_is_asked_once_is_done_once_though_its_home_restarts() {
    let network = programs::asked_once().unwrap();
    let report = network.verifier(Faults { restarts: 1, ..NONE }).most_states(MOST).run();
    assert_eq!(report.verdict, None, "{report}");
}

#[test]
fn what_is_asked_again_may_be_done_twice() {
    let report =
        programs::asked_again().unwrap().verifier(Faults { restarts: 1, ..NONE }).most_states(MOST).run();
    let violation = report.verdict.as_ref().unwrap();
    assert_eq!(violation.kind, ViolationKind::FailedAssertion { message: "dropped twice".into() });
    assert_eq!(*violation.violators[0], *"ground/log#at most one");
}

#[test]
fn one_at_most_is_inside_where_whoever_has_waited_long_enough_gives_way() {
    let network = programs::patient_resource().unwrap();
    let report = holds(&network, NONE);
    assert!(report.not_covered.iter().any(|what| what.to_string().contains("deadlines")), "{report}");
}

/// Deadlines of equal length pass one after the other, and before what was sent at the start arrives.
#[test]
fn two_are_inside_where_whoever_has_waited_long_enough_enters() {
    let network = programs::impatient_resource().unwrap();
    let (report, moves) = network.verifier(network.faults).run_and_count();
    let violation = report.verdict.as_ref().unwrap();
    assert!(
        matches!(&violation.kind, ViolationKind::Invariant { message, .. } if message == "uav/1 and uav/2 are inside")
    );
    let trace = trace(&report);
    assert_eq!(trace.len(), 4, "{report}");
    assert!(trace[3].starts_with("the deadline of uav/"), "{report}");
    assert!(moves["deadline"] > 0, "{moves:?}");
}

/// The first looks up again and again while the answer is on its way, but that does arrive.
#[test]
fn two_that_meet_pass_where_one_of_them_keeps_to_its_side() {
    let network = programs::corridor().unwrap();
    holds(&network, network.faults);
}

#[test]
fn two_that_meet_may_dodge_for_ever_where_both_do() {
    let network = programs::courteous_corridor().unwrap();
    let report = network.verifier(network.faults).run();
    let violation = report.verdict.as_ref().unwrap();
    assert_eq!(violation.kind, ViolationKind::HotBThread);
    let round: Vec<String> = violation.cycle().unwrap().iter().map(ToString::to_string).collect();
    assert_eq!(round.len(), 4, "{report}");
    for (one, other) in [("uav/1", "uav/2"), ("uav/2", "uav/1")] {
        let hears = format!("{one} hears what occurred at {other}");
        let says = |side: &str| round.iter().any(|step| step.starts_with(&hears) && step.contains(side));
        assert!(says("left") && says("right"), "{report}");
    }
}

fn script(node: &str, body: Vec<Op>) -> Member {
    let mut program = Program::new(ProgramConfig::default());
    program.add("script", Script::new(&body).unwrap());
    let config = NodeConfig::new(NodeName::new(node).unwrap(), 1, Vec::new());
    Member { config, program, may_restart: false }
}

fn within_a_second(body: Op) -> Op {
    Op::Until { set: EventSet::None, within: Some(Duration::from_secs(1)), body: vec![body] }
}

fn of(members: Vec<Member>) -> Network {
    let about = "made for a test";
    Network { name: "test", about, is_sound: true, faults: NONE, members, requirement: None }
}

#[test]
fn whoever_looks_up_for_ever_for_what_never_comes_is_hot_for_ever() {
    let hears = |event: &str| Op::Sync(Bid::new().wait_for(event).hot());
    let looks_up = |event: &str| vec![Op::forever([within_a_second(hears(event))])];
    let says = vec![Op::Sync(Bid::new().request("uav/2/hello"))];
    let report =
        of(vec![script("uav/1", looks_up("uav/2/answer")), script("uav/2", says)]).verifier(NONE).run();
    let violation = report.verdict.as_ref().unwrap();
    assert_eq!(violation.kind, ViolationKind::HotBThread);
    assert_eq!(violation.violators, ["uav/1#script".into()]);
    assert_eq!(violation.cycle_length, Some(1), "{report}");
}

#[test]
fn whoever_is_hot_where_nothing_is_due_any_more_stays_so_for_ever() {
    let waits = vec![Op::Sync(Bid::new().wait_for("uav/2/answer").hot())];
    let says = |what: &str| vec![Op::Sync(Bid::new().request(what))];
    let network = of(vec![script("uav/1", waits.clone()), script("uav/2", says("uav/2/hello"))]);
    let report = network.verifier(Faults { lapses: 1, partitions: 1, ..NONE }).run();
    let violation = report.verdict.as_ref().unwrap();
    assert_eq!(violation.kind, ViolationKind::HotTermination, "{report}");
    assert_eq!(violation.violators, ["uav/1#script".into()]);
    let network = of(vec![script("uav/1", waits), script("uav/2", says("uav/2/answer"))]);
    holds(&network, Faults { lapses: 1, partitions: 1, ..NONE });
}

/// Two throw a ball to and fro. Whoever does not have it is hot, so nobody is for ever, and always somebody is.
#[test]
fn a_group_and_the_system_may_be_hot_for_ever_while_nobody_is() {
    let holds_it = || within_a_second(Op::Sync(Bid::new()));
    let throws = |node: &str| Op::Sync(Bid::new().request(format!("{node}/ball")));
    let catches = |other: &str| Op::Sync(Bid::new().wait_for(format!("{other}/ball")).hot());
    let first = script("uav/1", vec![Op::forever([holds_it(), throws("uav/1"), catches("uav/2")])]);
    let second = script("uav/2", vec![Op::forever([catches("uav/1"), holds_it(), throws("uav/2")])]);
    let network = of(vec![first, second]);
    let find = |inspection: Inspection| {
        let report = network.verifier(NONE).inspect([inspection]).run();
        report.verdict.map(|violation| (violation.kind, violation.trace.len(), violation.cycle_length))
    };
    let group = |names: &[&str]| Inspection::HotRun(names.iter().map(|name| (*name).into()).collect());
    assert_eq!(find(Inspection::HotBThread), None);
    assert_eq!(find(group(&["uav/1#script"])), None);
    let (kind, _, round) = find(group(&["uav/1#script", "uav/2#script"])).unwrap();
    assert_eq!((kind, round), (ViolationKind::HotRun, Some(4)));
    let (kind, _, round) = find(Inspection::HotSystem).unwrap();
    assert_eq!((kind, round), (ViolationKind::HotSystem, Some(4)));
}
