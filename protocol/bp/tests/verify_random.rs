//! The verifier against an exploration that is as plain as can be, on programs made at random.

use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};
use std::time::Duration;

use crate::recipes::{bid, event, set};
use crate::support::START;
use proptest::prelude::*;
use skein_bp::script::{Op, Reply, Script, ScriptSource, Spawn};
use skein_bp::verify::{Graph, Inspection, Report, Search, Verifier, Violation, ViolationKind};
use skein_bp::{Bid, Event, EventSet, Program, ProgramConfig, Strategy as Selecting};

/// Programs with more states than this are left out.
const MOST_STATES: usize = 200;

/// A bid that may be hot or have a deadline.
fn full_bid() -> impl Strategy<Value = Bid> {
    let deadline = prop_oneof![12 => Just(None), 1 => Just(Some(0_u64)), 2 => Just(Some(1))];
    (bid(), prop::bool::weighted(0.3), deadline).prop_map(|(bid, hot, deadline)| {
        let bid = if hot { bid.hot() } else { bid };
        deadline.map_or(bid.clone(), |at| bid.deadline(Duration::from_secs(at)))
    })
}

fn child() -> impl Strategy<Value = Op> {
    (prop_oneof!["child", "other"], prop::collection::vec(full_bid(), 1..3)).prop_map(|(name, bids)| {
        let body = bids.into_iter().map(Op::Sync).collect();
        Op::Spawn(Spawn::Inline(ScriptSource { name, body, priority: Some(1) }))
    })
}

/// What a b-thread does to the rest of the program between two syncs, without adding b-threads to it.
fn effect() -> impl Strategy<Value = Op> {
    prop_oneof![
        3 => event().prop_map(|event| Op::Enqueue(vec![event])),
        1 => Just(Op::AssertFail("made to fail".to_owned())),
        1 => any::<bool>().prop_map(Op::Daemon),
        1 => event().prop_map(|event| Op::OnInterruptEnqueue(vec![Reply::Interrupting, Reply::Event(event)])),
        1 => Just(Op::On(BTreeMap::from([("b".to_owned(), vec![Op::Stop])]))),
    ]
}

/// Bids, and after each perhaps an op.
fn body(op: impl Strategy<Value = Op> + 'static) -> impl Strategy<Value = Vec<Op>> {
    prop::collection::vec((full_bid(), prop::option::weighted(0.3, op)), 1..4).prop_map(|parts| {
        parts.into_iter().flat_map(|(bid, op)| [Some(Op::Sync(bid)), op]).flatten().collect()
    })
}

/// B-threads, proxies and external events.
#[derive(Clone, Debug)]
struct Recipe {
    bthreads: Vec<Vec<Op>>,
    proxies: Vec<Bid>,
    externals: Vec<Event>,
    home: EventSet,
    protected: EventSet,
    strategy: Selecting,
}

impl Recipe {
    fn program(&self) -> Program {
        let (strategy, protected) = (self.strategy, self.protected.clone());
        let mut program = Program::new(ProgramConfig { strategy, protected, ..ProgramConfig::default() });
        program.set_home(&self.home);
        for (at, body) in self.bthreads.iter().enumerate() {
            let body = if at % 2 == 0 { Op::forever(body.clone()) } else { Op::repeat(2, body.clone()) };
            program.add(format!("t{at}"), Script::new(&[body]).unwrap());
        }
        for (at, bid) in self.proxies.iter().enumerate() {
            program.put_proxy(format!("far#{at}"), bid);
        }
        self.externals.iter().for_each(|event| program.enqueue(event));
        program
    }
}

/// In a program of this kind the order of b-threads makes no difference between runs: either nobody is added, or only
/// one b-thread does more than state bids.
fn recipe() -> impl Strategy<Value = Recipe> {
    use Selecting::{BThreadPriority, Ordered, Simple, SyncPriority};
    let many_with_effects = prop::collection::vec(body(effect()), 1..5).boxed();
    let silent = || body(Just(Op::OnInterruptEnqueue(Vec::new())));
    let one_that_spawns = (body(prop_oneof![child(), effect()]), prop::collection::vec(silent(), 0..4))
        .prop_map(|(one, mut others)| {
            others.insert(0, one);
            others
        })
        .boxed();
    let bthreads = prop_oneof![2 => many_with_effects, 1 => one_that_spawns];
    let proxies = prop_oneof![2 => Just(Vec::new()), 1 => prop::collection::vec(bid(), 1..3)];
    let home = prop_oneof![3 => Just(EventSet::All), 1 => set()];
    let strategy = prop_oneof![2 => Just(Simple), 1 => Just(Ordered), 1 => Just(SyncPriority), 1 => Just(BThreadPriority)];
    (bthreads, proxies, prop::collection::vec(event(), 0..3), home, set(), strategy).prop_map(
        |(bthreads, proxies, externals, home, protected, strategy)| Recipe {
            bthreads,
            proxies,
            externals,
            home,
            protected,
            strategy,
        },
    )
}

/// All that a program can reach, found by cloning it.
struct Plain {
    programs: Vec<Program>,
    depths: Vec<usize>,
    /// By state: event and target.
    edges: Vec<Vec<(Event, usize)>>,
}

impl Plain {
    /// None if there are too many states.
    fn explore(mut program: Program) -> Option<Self> {
        let _ = program.synchronise(START);
        let mut numbers = HashMap::from([(program.clone(), 0)]);
        let mut all = Self { programs: vec![program], depths: vec![0], edges: Vec::new() };
        while let Some(program) = all.programs.get(all.edges.len()).cloned() {
            let depth = all.depths[all.edges.len()];
            let mut edges = Vec::new();
            let events = if program.failed().is_some() { Vec::new() } else { program.selectable() };
            for event in events {
                let mut next = program.clone();
                next.choose(&event, START).unwrap();
                let _ = next.synchronise(START);
                let number = *numbers.entry(next.clone()).or_insert(all.programs.len());
                if number == all.programs.len() {
                    all.programs.push(next);
                    all.depths.push(depth + 1);
                }
                edges.push((event, number));
            }
            all.edges.push(edges);
            if all.programs.len() > MOST_STATES {
                return None;
            }
        }
        Some(all)
    }

    /// The depth of the nearest state of a kind.
    fn nearest(&self, is: impl Fn(&Program) -> bool) -> Option<usize> {
        (0..self.programs.len()).filter(|at| is(&self.programs[*at])).map(|at| self.depths[at]).min()
    }

    /// Whether the states of a kind hold a cycle: what is left when those without a way on are taken away, again and
    /// again.
    fn has_cycle(&self, is: impl Fn(&Program) -> bool) -> bool {
        let mut left: BTreeSet<usize> =
            (0..self.programs.len()).filter(|at| is(&self.programs[*at])).collect();
        loop {
            let goes_on = |at: &usize| self.edges[*at].iter().any(|(_, to)| left.contains(to));
            let next: BTreeSet<usize> = left.iter().copied().filter(goes_on).collect();
            if next.len() == left.len() {
                return !left.is_empty();
            }
            left = next;
        }
    }

    /// The length of the shortest way into and round a cycle of states of a kind.
    fn shortest_cycle(&self, is: impl Fn(&Program) -> bool) -> Option<usize> {
        let within: Vec<bool> = self.programs.iter().map(is).collect();
        let round = |entry: usize| {
            let mut lengths = HashMap::from([(entry, 0)]);
            let mut queue = VecDeque::from([entry]);
            while let Some(at) = queue.pop_front() {
                for (_, to) in self.edges[at].iter().filter(|(_, to)| within[*to]) {
                    if *to == entry {
                        return Some(lengths[&at] + 1);
                    }
                    if !lengths.contains_key(to) {
                        lengths.insert(*to, lengths[&at] + 1);
                        queue.push_back(*to);
                    }
                }
            }
            None
        };
        (0..self.programs.len())
            .filter(|at| within[*at])
            .filter_map(|at| Some(self.depths[at] + round(at)?))
            .min()
    }
}

/// What shows of a state.
fn face(program: &Program) -> String {
    let queue: Vec<&Event> = program.external_queue().collect();
    let proxies: Vec<_> = program.proxies().collect();
    format!("{} {queue:?} {proxies:?} {:?}", program.states_json().unwrap(), program.failed())
}

fn faces_of(graph: &Graph) -> Vec<String> {
    let face = |state: &skein_bp::verify::GraphState| {
        let (proxies, bthreads): (Vec<_>, Vec<_>) =
            state.bthreads.iter().cloned().partition(|(name, _)| name.starts_with("far#"));
        let bthreads: serde_json::Map<String, serde_json::Value> =
            bthreads.into_iter().map(|(name, state)| (name.to_string(), state)).collect();
        let mut proxies: Vec<(&str, Bid)> = proxies
            .iter()
            .map(|(name, bid)| (&**name, serde_json::from_value(bid.clone()).unwrap()))
            .collect();
        proxies.sort_by_key(|(name, _)| *name);
        let failed = state.failure.as_deref().map(|failure| failure.split_once(": ").unwrap());
        format!("{} {:?} {proxies:?} {failed:?}", serde_json::Value::from(bthreads), state.queue)
    };
    graph.states.iter().map(face).collect()
}

fn is_hot(program: &Program) -> bool {
    program.bids().any(|(_, bid, _)| bid.is_hot())
}

fn is_hot_in(program: &Program, name: &str) -> bool {
    program.bid(name).is_some_and(Bid::is_hot)
}

fn is_stuck(program: &Program) -> bool {
    program.failed().is_none() && program.selectable().is_empty() && program.next_deadline().is_none()
}

/// The states along a trace.
fn replay(mut program: Program, trace: &[Event]) -> Vec<Program> {
    let _ = program.synchronise(START);
    let mut states = vec![program];
    for event in trace {
        let mut next = states.last().unwrap().clone();
        next.choose(event, START).unwrap();
        let _ = next.synchronise(START);
        states.push(next);
    }
    states
}

fn run(recipe: &Recipe, inspection: Inspection, order: Search) -> Report {
    Verifier::new(recipe.program()).inspect([inspection]).order(order).run()
}

/// Checks that a trace shows what it is said to.
fn check_trace(recipe: &Recipe, violation: &Violation) -> Result<(), TestCaseError> {
    let states = replay(recipe.program(), &violation.trace);
    let last = states.last().unwrap();
    let cycle = violation.cycle().map(|cycle| &states[states.len() - 1 - cycle.len()..]);
    if let Some(cycle) = cycle {
        prop_assert_eq!(cycle.first(), cycle.last());
    }
    let always = |is: &dyn Fn(&Program) -> bool| cycle.unwrap().iter().all(is);
    let shown = match &violation.kind {
        ViolationKind::Deadlock => last.is_deadlocked() && is_stuck(last),
        ViolationKind::FailedAssertion { message } => {
            last.failed() == Some((&violation.violators[0], message.as_str()))
        }
        ViolationKind::HotTermination => {
            is_stuck(last) && violation.violators.iter().all(|name| is_hot_in(last, name))
        }
        ViolationKind::HotBThread => violation.violators.iter().all(|name| always(&|p| is_hot_in(p, name))),
        ViolationKind::HotRun => {
            always(&|program| violation.violators.iter().any(|name| is_hot_in(program, name)))
        }
        ViolationKind::HotSystem => always(&is_hot),
        other => return Err(TestCaseError::fail(format!("nobody asked for {other}"))),
    };
    prop_assert!(shown, "{} does not show it", violation);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn states_and_edges_are_those_of_a_plain_exploration(recipe in recipe()) {
        let Some(plain) = Plain::explore(recipe.program()) else { return Ok(()) };
        for order in [Search::BreadthFirst, Search::DepthFirst] {
            let report = Verifier::new(recipe.program()).inspect([]).order(order).run();
            prop_assert_eq!(report.states, plain.programs.len());
            prop_assert_eq!(report.edges as usize, plain.edges.iter().map(Vec::len).sum::<usize>());
        }
        let graph = Verifier::new(recipe.program()).graph();
        let faces = faces_of(&graph);
        let expected: BTreeSet<String> = plain.programs.iter().map(face).collect();
        prop_assert_eq!(faces.iter().cloned().collect::<BTreeSet<_>>(), expected);
        let edges = |from: String, event: &Event, to: String| format!("{from} {event} {to}");
        let expected: BTreeSet<String> = plain.edges.iter().enumerate().flat_map(|(from, targets)| {
            let from = face(&plain.programs[from]);
            let programs = &plain.programs;
            targets.iter().map(move |(event, to)| edges(from.clone(), event, face(&programs[*to])))
        }).collect();
        let found: BTreeSet<String> = graph.edges.iter()
            .map(|edge| edges(faces[edge.from as usize].clone(), &edge.event, faces[edge.to as usize].clone()))
            .collect();
        prop_assert_eq!(found, expected);
    }

    #[test]
    fn verdicts_are_those_of_a_plain_exploration(recipe in recipe()) {
        let Some(plain) = Plain::explore(recipe.program()) else { return Ok(()) };
        let names: BTreeSet<String> =
            plain.programs.iter().flat_map(|p| p.bids().map(|(name, ..)| name.to_owned()).collect::<Vec<_>>()).collect();
        let group: BTreeSet<std::sync::Arc<str>> = ["t0".into(), "t1".into()].into();
        let hot_group = |p: &Program| group.iter().any(|name| is_hot_in(p, name));
        let own_cycles = names.iter().filter(|name| plain.has_cycle(|p| is_hot_in(p, name)));
        let shortest = [
            (Inspection::Deadlock, plain.nearest(|p| p.failed().is_none() && p.is_deadlocked())),
            (Inspection::FailedAssertion, plain.nearest(|p| p.failed().is_some())),
            (Inspection::HotTermination, plain.nearest(|p| is_stuck(p) && is_hot(p))),
            (Inspection::HotBThread, own_cycles.filter_map(|name| plain.shortest_cycle(|p| is_hot_in(p, name))).min()),
            (Inspection::HotRun(group.clone()), plain.shortest_cycle(hot_group)),
            (Inspection::HotSystem, plain.shortest_cycle(is_hot)),
        ];
        for (inspection, shortest) in shortest {
            let report = run(&recipe, inspection.clone(), Search::BreadthFirst);
            prop_assert_eq!(report.verdict.as_ref().map(|v| v.trace.len()), shortest, "{:?}", &inspection);
            let depth_first = run(&recipe, inspection, Search::DepthFirst);
            prop_assert_eq!(depth_first.verdict.is_some(), shortest.is_some());
            for violation in report.verdict.iter().chain(&depth_first.verdict) {
                check_trace(&recipe, violation)?;
            }
        }
    }
}
