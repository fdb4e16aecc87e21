//! A network of real nodes as a model.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use rustc_hash::FxHashMap;
use skein_bp::verify::{Fault, Inspection, Interner, Model, Moves, ViolationKind};
use skein_bp::{Event, Program, ProgramError, Selection};

use super::row::{Family, Part, Row};
use super::wire::Wire;
use super::{Faults, Invariant, Member, MoveCounts, NetworkView};
use crate::node::Node;
use crate::{BidAck, BidRecord, Kept, Message, NodeConfig, NodeError, NodeName, Presence, Recipient, facts};

/// When the network starts: later than any lease, so that what was last heard at time zero has lapsed.
const START: Duration = Duration::from_secs(1 << 20);
/// From one move to the next; so little that nothing lapses by itself.
const MOVE: Duration = Duration::from_nanos(1);
/// Ways in which the b-threads of one node may go on after one message.
const MOST_WAYS: usize = 4096;

/// Nodes, what is on its way between them, and how much may still go wrong.
#[derive(Clone, Debug)]
struct Network {
    nodes: BTreeMap<NodeName, Rc<Node>>,
    wires: BTreeMap<(NodeName, NodeName), Rc<Wire>>,
    lapses: u32,
    /// Holders that are no longer sure of a home, which has yet to let go of what they bid there.
    lapsing: BTreeSet<(NodeName, NodeName)>,
    restarts: u32,
    repeats: u32,
    partitions: u32,
    /// Pairs of nodes that are cut off from one another, each in the order of their names.
    cut: BTreeSet<(NodeName, NodeName)>,
    now: Duration,
    /// Why a node could not go on.
    broken: Option<(NodeName, NodeError)>,
    /// Whether more was sent than may be on its way.
    overflows: bool,
}

/// Something that happens to a node.
#[derive(Clone, Debug)]
pub(super) enum Step {
    /// Its b-threads begin.
    Begin(NodeName),
    /// The record at this place of the wire from a bidder arrives, and those before it count no more.
    Record {
        from: NodeName,
        to: NodeName,
        at: usize,
    },
    /// So does an acknowledgement.
    Ack {
        from: NodeName,
        to: NodeName,
        at: usize,
    },
    Occurrence {
        from: NodeName,
        to: NodeName,
    },
    /// What this step delivers arrives, and will arrive again.
    Twice(Box<Step>),
    /// Nothing arrives between two nodes any more.
    Cut(NodeName, NodeName),
    /// It does again.
    Heal(NodeName, NodeName),
    /// A sign of life.
    Presence {
        from: NodeName,
        to: NodeName,
    },
    /// The holder of a lease can no longer be sure of the home.
    HoldLapses {
        holder: NodeName,
        home: NodeName,
    },
    /// The home lets go of its bids, while it still counts it as alive: a sign of life has come since.
    BidsLapse {
        holder: NodeName,
        home: NodeName,
    },
    /// The home lets go, and counts the holder as lost.
    LeaseLapses {
        holder: NodeName,
        home: NodeName,
    },
    GuardEnds(NodeName),
    /// The deadline of a b-thread passes.
    Deadline {
        node: NodeName,
        bthread: String,
    },
    Restart(NodeName),
}

/// What comes about sooner or later, unless something forestalls it: whatever stays on its way arrives, partitions end, and
/// time passes.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Due {
    Record(NodeName, NodeName),
    Ack(NodeName, NodeName),
    Occurrence(NodeName, NodeName),
    Presence(NodeName, NodeName),
    Heal(NodeName, NodeName),
    GuardEnds(NodeName),
    Deadline(NodeName, String),
}

/// What is known of a state that was reached.
#[derive(Debug)]
enum Seen {
    /// It was not gone on from.
    Waiting(Box<Network>),
    /// It was. Of one in which somebody is hot that is kept of which cycles are made.
    Left(Option<Box<HotState>>),
}

/// A state in which somebody is hot.
#[derive(Debug)]
struct HotState {
    /// Who, by number.
    hot: Vec<u32>,
    /// What is due, by number.
    due: Vec<u32>,
    /// Labels and targets.
    moves: Vec<(u32, Rc<[u32]>)>,
}

#[derive(Debug)]
pub(super) struct NetworkModel {
    members: Vec<Member>,
    faults: Faults,
    invariants: Vec<Invariant>,
    parts: Interner<Part>,
    families: Interner<Family>,
    /// What a move is called, and what it brings about of what is due.
    labels: Interner<(Event, Vec<u32>)>,
    dues: Interner<Due>,
    /// The names of b-threads that were hot, with their nodes.
    bthreads: Interner<Arc<str>>,
    seen: FxHashMap<Rc<[u32]>, Seen>,
    /// The state that is gone on from, and whether nothing is due there.
    present: Option<Network>,
    rests: bool,
    /// Whether a bound of the model, not of the search, was reached.
    pub(super) ways_cut: bool,
    pub(super) queue_cut: bool,
    /// How many moves of each kind were made.
    pub(super) moves: MoveCounts,
}

impl NetworkModel {
    pub(super) fn new(members: Vec<Member>, faults: Faults, invariants: Vec<Invariant>) -> Self {
        Self {
            members,
            faults,
            invariants,
            parts: Interner::default(),
            families: Interner::default(),
            labels: Interner::default(),
            dues: Interner::default(),
            bthreads: Interner::default(),
            seen: FxHashMap::default(),
            present: None,
            rests: false,
            ways_cut: false,
            queue_cut: false,
            moves: MoveCounts::new(),
        }
    }

    /// The fleet is formed, and nobody has begun.
    fn formed(&self) -> Network {
        let roster = self.roster();
        let nodes = self.members.iter().map(|member| {
            let mut node = member.node(&roster, member.config.incarnation, Kept::default());
            for other in self.members.iter().filter(|other| other.config.name != member.config.name) {
                node.handle(START, presence(other, other.config.incarnation, Duration::ZERO, 0));
            }
            (member.config.name.clone(), Rc::new(node))
        });
        Network {
            nodes: nodes.collect(),
            wires: BTreeMap::new(),
            lapses: self.faults.lapses,
            lapsing: BTreeSet::new(),
            restarts: self.faults.restarts,
            repeats: self.faults.repeats,
            partitions: self.faults.partitions,
            cut: BTreeSet::new(),
            now: START,
            broken: None,
            overflows: false,
        }
    }

    fn roster(&self) -> Vec<NodeName> {
        self.members.iter().map(|member| member.config.name.clone()).collect()
    }

    fn row(&mut self, network: &Network) -> Vec<u32> {
        let mut row = Row::new(&mut self.parts, &mut self.families);
        for node in network.nodes.values() {
            node.write_standing(&mut row);
        }
        let silent = Wire::default();
        for (from, to) in pairs(network) {
            if let Some(home) = network.nodes.get(to) {
                let wire = network.wires.get(&(from.clone(), to.clone())).map_or(&silent, |wire| wire);
                wire.write_standing(&mut row, from, home);
            }
        }
        row.plain(network.lapses.into());
        row.plain(network.restarts.into());
        row.plain(network.repeats.into());
        row.plain(network.partitions.into());
        for pairs in [&network.cut, &network.lapsing] {
            row.list(pairs, |row, (one, other)| {
                row.text(one.as_str());
                row.text(other.as_str());
            });
        }
        if let Some((node, error)) = &network.broken {
            row.text(&format!("{node}: {error}"));
        }
        row.finish()
    }

    /// All that may happen next.
    fn steps(&self, network: &Network) -> Vec<Step> {
        let not_begun = network.nodes.values().find(|node| !has_begun(node));
        if let Some(node) = not_begun {
            return vec![Step::Begin(node.name().clone())];
        }
        let mut steps = Vec::new();
        for (from, to) in pairs(network) {
            let (from, to) = (from.clone(), to.clone());
            let is_cut = network.are_cut_off(&from, &to);
            if !is_cut {
                let arrivals = network.arrivals(&from, &to);
                if network.repeats > 0 {
                    let again = arrivals.iter().filter(|step| !matches!(step, Step::Presence { .. }));
                    steps.extend(again.map(|step| Step::Twice(Box::new(step.clone()))));
                }
                steps.extend(arrivals);
            }
            steps.extend(self.cuts(network, &from, &to));
            let (Some(holder), Some(home)) = (network.nodes.get(&from), network.nodes.get(&to)) else {
                continue;
            };
            if holder.is_sure_of(&to) {
                if network.lapses > 0 || is_cut {
                    steps.push(Step::HoldLapses { holder: from, home: to });
                }
            } else if home.hears(&from) {
                let (holder, home_holds) = (from.clone(), home.holds_bids_of(&from));
                let pair = (from, to);
                if network.lapses > 0 || is_cut || network.lapsing.contains(&pair) {
                    let home = pair.1;
                    if home_holds {
                        steps.push(Step::BidsLapse { holder: holder.clone(), home: home.clone() });
                    }
                    steps.push(Step::LeaseLapses { holder, home });
                }
            }
        }
        for (name, node) in &network.nodes {
            let sure = network.nodes.values().any(|other| other.is_sure_of(name));
            if node.is_guarding() && !sure {
                steps.push(Step::GuardEnds(name.clone()));
            }
            let deadline = |bthread: &str| Step::Deadline { node: name.clone(), bthread: bthread.into() };
            steps.extend(node.deadlines().map(deadline));
            let may_restart = |member: &Member| member.config.name == *name && member.may_restart;
            if network.restarts > 0 && self.members.iter().any(may_restart) {
                steps.push(Step::Restart(name.clone()));
            }
        }
        steps
    }

    /// A cut between two nodes, or its end; of each pair once.
    fn cuts(&self, network: &Network, one: &NodeName, other: &NodeName) -> Option<Step> {
        if one > other {
            None
        } else if network.are_cut_off(one, other) {
            Some(Step::Heal(one.clone(), other.clone()))
        } else {
            (network.partitions > 0).then(|| Step::Cut(one.clone(), other.clone()))
        }
    }

    /// The states to which a step may lead, each with what was selected on the way.
    fn outcomes(&mut self, network: &Network, step: &Step) -> Vec<(Vec<String>, Network)> {
        let mut outcomes = Vec::new();
        let mut script: Vec<Choice> = Vec::new();
        loop {
            let mut next = network.clone();
            next.now += MOVE;
            let mut choices = Choices { script: std::mem::take(&mut script), at: 0 };
            let mut selected = self.take(&mut next, step, &mut choices);
            self.hear_facts(&mut next, &mut choices, &mut selected);
            next.forget_renewed();
            self.queue_cut |= next.overflows;
            if !next.overflows {
                outcomes.push((selected, next));
            }
            script = choices.script;
            while script.last().is_some_and(|choice| choice.taken + 1 >= choice.of) {
                script.pop();
            }
            match script.last_mut() {
                Some(choice) if outcomes.len() < MOST_WAYS => choice.taken += 1,
                Some(_) => {
                    self.ways_cut = true;
                    return outcomes;
                }
                None => return outcomes,
            }
        }
    }

    /// Lets a step happen, and the node go on after it; gives what it selects.
    fn take(&mut self, network: &mut Network, step: &Step, choices: &mut Choices) -> Vec<String> {
        let now = network.now;
        match step {
            Step::Begin(node) | Step::GuardEnds(node) => {
                if let (Step::GuardEnds(_), Some(node)) = (step, network.nodes.get_mut(node)) {
                    Rc::make_mut(node).let_guard_end();
                }
                self.go_on(network, node, choices)
            }
            Step::Record { from, to, at } => {
                let wire = network.wire(from, to);
                let record = wire.records.drain(..=*at).next_back();
                network.hand_over(to, now, record.map(Message::Bid));
                self.go_on(network, to, choices)
            }
            Step::Ack { from, to, at } => {
                let ack = network.wire(from, to).acks.drain(..=*at).next_back();
                network.hand_over(to, now, ack.map(Message::Ack));
                self.go_on(network, to, choices)
            }
            Step::Occurrence { from, to } => {
                let occurrence = network.wire(from, to).occurrences.pop_front();
                network.hand_over(to, now, occurrence.map(Message::Occurrence));
                self.go_on(network, to, choices)
            }
            Step::Presence { from, to } => {
                let presence = network.wire(from, to).presence.take();
                network.hand_over(to, now, presence.map(Message::Presence));
                self.go_on(network, to, choices)
            }
            Step::Twice(step) => {
                let wires = network.wires.clone();
                network.repeats -= 1;
                let selected = self.take(network, step, choices);
                network.put_again(step, wires);
                selected
            }
            Step::Cut(one, other) => {
                network.partitions -= 1;
                network.cut.insert((one.clone(), other.clone()));
                Vec::new()
            }
            Step::Heal(one, other) => {
                network.cut.remove(&(one.clone(), other.clone()));
                Vec::new()
            }
            Step::HoldLapses { holder, home } => {
                if !network.are_cut_off(holder, home) {
                    network.lapses -= 1;
                    network.lapsing.insert((holder.clone(), home.clone()));
                }
                // The copies that were sent before may arrive yet.
                network.with(holder, |node| node.let_renewal_fall_due(home));
                let mut selected = self.go_on(network, holder, choices);
                network.with(holder, |node| node.let_hold_lapse(home));
                // An acknowledgement on its way is of a copy sent before.
                network.wire(home, holder).acks.clear();
                selected.extend(self.go_on(network, holder, choices));
                selected
            }
            Step::BidsLapse { holder, home } => {
                network.pay_for_lapse(holder, home);
                if !network.are_cut_off(holder, home) {
                    network.lapsing.insert((holder.clone(), home.clone()));
                }
                network.with(home, |node| node.let_bids_lapse(holder));
                self.let_go(network, holder, home, choices)
            }
            Step::LeaseLapses { holder, home } => {
                network.pay_for_lapse(holder, home);
                network.with(home, |node| node.let_lease_lapse(holder));
                let selected = self.let_go(network, holder, home, choices);
                // Its signs of life come again.
                let life = network.nodes.get(holder).map(|node| (node.incarnation(), node.latest_seq()));
                let member = self.members.iter().find(|member| member.config.name == *holder);
                if let (Some((life, seq)), Some(member)) = (life, member)
                    && let Message::Presence(presence) = presence(member, life, START, seq)
                {
                    network.wire(holder, home).presence = Some(presence);
                }
                selected
            }
            Step::Deadline { node, bthread } => {
                network.with(node, |node| node.let_deadline_pass(bthread));
                self.go_on(network, node, choices)
            }
            Step::Restart(node) => {
                network.restarts -= 1;
                self.restart(network, node);
                self.go_on(network, node, choices)
            }
        }
    }

    /// A home and then the holder go on after a lapse. What the holder states again is a fresh copy.
    fn let_go(
        &mut self,
        network: &mut Network,
        holder: &NodeName,
        home: &NodeName,
        choices: &mut Choices,
    ) -> Vec<String> {
        network.wire(home, holder).acks.clear();
        let mut selected = self.go_on(network, home, choices);
        network.with(holder, |node| node.let_hold_lapse(home));
        selected.extend(self.go_on(network, holder, choices));
        selected
    }

    /// Begins a new life of a node, which finds the others alive. What was on its way to the old one is lost.
    fn restart(&self, network: &mut Network, name: &NodeName) {
        let Some(member) = self.members.iter().find(|member| member.config.name == *name) else { return };
        let incarnation = network.nodes.get(name).map_or(0, |node| node.incarnation()) + 1;
        let kept = network.nodes.get(name).filter(|_| member.config.durable).map(|node| node.kept());
        let mut node = member.node(&self.roster(), incarnation, kept.unwrap_or_default());
        for other in self.members.iter().filter(|other| other.config.name != *name) {
            let Some(peer) = network.nodes.get(&other.config.name) else { continue };
            let (life, seq) = (peer.incarnation(), peer.latest_seq());
            node.handle(network.now, presence(other, life, START, seq));
            network.wires.remove(&(other.config.name.clone(), name.clone()));
        }
        network.nodes.insert(name.clone(), Rc::new(node));
        for other in self.roster().iter().filter(|other| *other != name) {
            let Message::Presence(presence) = presence(member, incarnation, Duration::ZERO, 0) else {
                continue;
            };
            network.wire(name, other).presence = Some(presence);
        }
    }

    /// Lets a node go on, and puts what it says on the wires. Gives what it selected.
    fn go_on(&mut self, network: &mut Network, name: &NodeName, choices: &mut Choices) -> Vec<String> {
        let Some(node) = network.nodes.get_mut(name) else { return Vec::new() };
        let node = Rc::make_mut(node);
        let outcome = node.step_by(network.now, &mut |program, now| choices.step(program, now));
        let selected = node.take_selections();
        let outgoing = node.take_outgoing();
        if let Err(error) = outcome {
            network.broken.get_or_insert((name.clone(), error));
        }
        for (recipient, message) in outgoing {
            for to in self.roster().iter().filter(|to| *to != name) {
                if matches!(&recipient, Recipient::Node(node) if node != to) {
                    continue;
                }
                network.put(name, to, message.clone(), self.faults);
            }
        }
        let own = selected.iter().filter(|happened| happened.home == *name);
        own.map(|happened| happened.event.to_string()).collect()
    }

    /// Lets the others' facts that are next on the wires arrive, unless they may take their time.
    fn hear_facts(&mut self, network: &mut Network, choices: &mut Choices, selected: &mut Vec<String>) {
        if self.faults.late_facts {
            return;
        }
        while let Some((from, to)) = network.next_fact() {
            let now = network.now;
            let fact = network.wire(&from, &to).occurrences.pop_front();
            network.hand_over(&to, now, fact.map(Message::Occurrence));
            selected.extend(self.go_on(network, &to, choices));
        }
    }

    fn label(&mut self, step: &Step, selected: &[String], from: &Network, to: &Network) -> u32 {
        let what = step.what();
        let what = if selected.is_empty() { what } else { what.with("then", selected.join(", ")) };
        let forestalled = from.nodes.iter().flat_map(|(name, node)| {
            let gone_on = |bthread: &&str| {
                let sync = |network: &Network| network.nodes.get(name).and_then(|node| node.sync_of(bthread));
                sync(from) != sync(to)
            };
            // Whether the deadline of a b-thread that has gone on is still the same nobody can tell.
            node.deadlines().filter(gone_on).map(|bthread| Due::Deadline(name.clone(), bthread.into()))
        });
        let dues = &mut self.dues;
        let brings_about = step.due().into_iter().chain(forestalled).map(|due| dues.number(due));
        let brings_about = sorted(brings_about.collect());
        self.labels.number((what, brings_about))
    }

    /// The b-threads that are hot, by number.
    fn hot_bthreads(&mut self, network: &Network) -> Vec<u32> {
        sorted(network.hot_bthreads().map(|bthread| self.bthreads.number(bthread)).collect())
    }

    fn hot_state(&self, state: &[u32]) -> Option<&HotState> {
        match self.seen.get(state)? {
            Seen::Left(hot) => hot.as_deref(),
            Seen::Waiting(_) => None,
        }
    }

    fn assertion_failed(node: &NodeName, error: &NodeError) -> Fault {
        let (violator, message) = match error {
            NodeError::Program(ProgramError::Failed { bthread, message }) => {
                (format!("{node}#{bthread}"), message.clone())
            }
            error => (node.to_string(), error.to_string()),
        };
        Fault { kind: ViolationKind::FailedAssertion { message }, violators: vec![violator.into()] }
    }

    /// Who is hot where nothing is due any more.
    fn hot_at_rest(&self, network: &Network) -> Option<Fault> {
        let violators: Vec<Arc<str>> = if self.rests { network.hot_bthreads().collect() } else { Vec::new() };
        (!violators.is_empty()).then_some(Fault { kind: ViolationKind::HotTermination, violators })
    }
}

impl Step {
    /// The kind of move by which a deadline passes.
    pub(super) const DEADLINE: &str = "deadline";

    /// What happens, for people.
    fn what(&self) -> Event {
        match self {
            Step::Begin(node) => Event::new(format!("{node} begins")),
            Step::Record { from, to, .. } => Event::new(format!("{to} takes in what {from} bids")),
            Step::Ack { from, to, .. } => Event::new(format!("{to} hears that {from} has taken in its bids")),
            Step::Occurrence { from, to } => Event::new(format!("{to} hears what occurred at {from}")),
            Step::Presence { from, to } => Event::new(format!("{to} hears that {from} lives")),
            Step::Twice(step) => {
                let what = step.what();
                Event::new(format!("{} (and may again)", what.name()))
            }
            Step::Cut(one, other) => Event::new(format!("{one} and {other} are cut off from one another")),
            Step::Heal(one, other) => Event::new(format!("{one} and {other} are joined again")),
            Step::HoldLapses { holder, home } => Event::new(format!("{holder} is no longer sure of {home}")),
            Step::BidsLapse { holder, home } => Event::new(format!("{home} lets go of what {holder} bids")),
            Step::LeaseLapses { holder, home } => {
                Event::new(format!("{home} lets go of what {holder} bids, and counts it as lost"))
            }
            Step::GuardEnds(node) => Event::new(format!("{node} has waited for the longest lease")),
            Step::Deadline { node, bthread } => {
                Event::new(format!("the deadline of {node}#{bthread} passes"))
            }
            Step::Restart(node) => Event::new(format!("{node} restarts")),
        }
    }

    /// The kind of move that it is.
    fn kind(&self) -> &'static str {
        match self {
            Step::Begin(_) => "beginning",
            Step::Record { at: 1.., .. } => "loss of older bids",
            Step::Ack { at: 1.., .. } => "loss of older acknowledgements",
            Step::Record { .. } | Step::Ack { .. } | Step::Occurrence { .. } | Step::Presence { .. } => {
                "arrival"
            }
            Step::Twice(_) => "repetition",
            Step::Cut(..) => "partition",
            Step::Heal(..) => "end of a partition",
            Step::HoldLapses { .. } | Step::BidsLapse { .. } | Step::LeaseLapses { .. } => "lapse",
            Step::GuardEnds(_) => "end of a guard",
            Step::Deadline { .. } => Self::DEADLINE,
            Step::Restart(_) => "restart",
        }
    }

    /// What that was due comes about with it.
    fn due(&self) -> Option<Due> {
        Some(match self {
            Step::Record { from, to, .. } => Due::Record(from.clone(), to.clone()),
            Step::Ack { from, to, .. } => Due::Ack(from.clone(), to.clone()),
            Step::Occurrence { from, to } => Due::Occurrence(from.clone(), to.clone()),
            Step::Presence { from, to } => Due::Presence(from.clone(), to.clone()),
            Step::Twice(step) => return step.due(),
            Step::Heal(one, other) => Due::Heal(one.clone(), other.clone()),
            Step::GuardEnds(node) => Due::GuardEnds(node.clone()),
            Step::Deadline { node, bthread } => Due::Deadline(node.clone(), bthread.clone()),
            Step::Begin(_) | Step::Cut(..) | Step::Restart(_) => return None,
            // A lease need not lapse: its holder renews it.
            Step::HoldLapses { .. } | Step::BidsLapse { .. } | Step::LeaseLapses { .. } => return None,
        })
    }
}

impl Model for NetworkModel {
    fn start(&mut self) -> Vec<u32> {
        let network = self.formed();
        let row = self.row(&network);
        self.seen.insert(row.as_slice().into(), Seen::Waiting(Box::new(network)));
        row
    }

    fn expand(&mut self, state: &[u32], moves: &mut Moves) {
        self.present = None;
        let Some(seen) = self.seen.get_mut(state) else { return };
        let network = match std::mem::replace(seen, Seen::Left(None)) {
            Seen::Waiting(network) => *network,
            known @ Seen::Left(_) => {
                *seen = known;
                let kept = self.hot_state(state).into_iter().flat_map(|hot| &hot.moves);
                return kept.for_each(|(label, target)| moves.push(*label, target.iter().copied()));
            }
        };
        if network.broken.is_some() {
            self.present = Some(network);
            return;
        }
        let steps = self.steps(&network);
        let due: Vec<u32> = steps.iter().filter_map(Step::due).map(|due| self.dues.number(due)).collect();
        self.rests = due.is_empty() && network.nodes.values().all(|node| has_begun(node));
        let hot = self.hot_bthreads(&network);
        let mut hot_state =
            (!hot.is_empty()).then(|| Box::new(HotState { hot, due: sorted(due), moves: Vec::new() }));
        for step in steps {
            for (selected, next) in self.outcomes(&network, &step) {
                *self.moves.entry(step.kind()).or_default() += 1;
                let row: Rc<[u32]> = self.row(&next).into();
                let label = self.label(&step, &selected, &network, &next);
                moves.push(label, row.iter().copied());
                if let Some(hot) = &mut hot_state {
                    hot.moves.push((label, row.clone()));
                }
                self.seen.entry(row).or_insert_with(|| Seen::Waiting(Box::new(next)));
            }
        }
        self.seen.insert(state.into(), Seen::Left(hot_state));
        self.present = Some(network);
    }

    fn fault(&self, _: &[u32], _: bool, inspections: &[Inspection]) -> Option<Fault> {
        let network = self.present.as_ref()?;
        if let Some((node, error)) = &network.broken {
            let wanted = inspections.contains(&Inspection::FailedAssertion);
            return wanted.then(|| Self::assertion_failed(node, error));
        }
        let programs = network.nodes.iter().map(|(name, node)| (name.as_str(), node.program())).collect();
        let view = NetworkView::new(programs);
        let broken = self.invariants.iter().find_map(|invariant| {
            let message = (invariant.holds)(&view).err()?;
            let kind = ViolationKind::Invariant { invariant: invariant.name.clone(), message };
            Some(Fault { kind, violators: Vec::new() })
        });
        let at_rest = || {
            let wanted = inspections.contains(&Inspection::HotTermination);
            wanted.then(|| self.hot_at_rest(network)).flatten()
        };
        broken.or_else(at_rest)
    }

    fn hot(&self, state: &[u32], bthreads: &mut Vec<u32>) {
        bthreads.extend(self.hot_state(state).into_iter().flat_map(|hot| &hot.hot));
    }

    fn due(&mut self, state: &[u32], due: &mut Vec<u32>) {
        due.extend(self.hot_state(state).into_iter().flat_map(|hot| &hot.due));
    }

    fn brings_about(&self, label: u32) -> &[u32] {
        self.labels.get(label).map_or(&[], |(_, brings_about)| brings_about)
    }

    fn bthread(&self, number: u32) -> Arc<str> {
        self.bthreads.get(number).cloned().unwrap_or_else(|| "".into())
    }

    fn event(&self, label: u32) -> Event {
        self.labels.get(label).map_or_else(|| Event::new(""), |(event, _)| event.clone())
    }
}

/// Numbers in order, each once.
fn sorted(mut numbers: Vec<u32>) -> Vec<u32> {
    numbers.sort_unstable();
    numbers.dedup();
    numbers
}

impl Member {
    fn node(&self, roster: &[NodeName], incarnation: u64, kept: Kept) -> Node {
        let config = NodeConfig { incarnation, roster: roster.to_vec(), kept, ..self.config.clone() };
        let mut node = Node::new(config, self.program.clone());
        node.hold_clock();
        node
    }
}

impl Network {
    fn wire(&mut self, from: &NodeName, to: &NodeName) -> &mut Wire {
        Rc::make_mut(self.wires.entry((from.clone(), to.clone())).or_default())
    }

    /// Who must not stay where it is for ever: `node#bthread`.
    fn hot_bthreads(&self) -> impl Iterator<Item = Arc<str>> {
        self.nodes.iter().flat_map(|(name, node)| {
            let hot = node.program().bids().filter(|(_, bid, _)| bid.is_hot());
            hot.map(move |(bthread, ..)| format!("{name}#{bthread}").into())
        })
    }

    fn with(&mut self, name: &NodeName, change: impl FnOnce(&mut Node)) {
        if let Some(node) = self.nodes.get_mut(name) {
            change(Rc::make_mut(node));
        }
    }

    fn hand_over(&mut self, to: &NodeName, now: Duration, message: Option<Message>) {
        if let Some(message) = message {
            self.with(to, |node| node.handle(now, message));
        }
    }

    fn are_cut_off(&self, one: &NodeName, other: &NodeName) -> bool {
        let pair = if one < other { (one.clone(), other.clone()) } else { (other.clone(), one.clone()) };
        self.cut.contains(&pair)
    }

    /// What may arrive next at `to` from `from`.
    fn arrivals(&self, from: &NodeName, to: &NodeName) -> Vec<Step> {
        let pair = (from.clone(), to.clone());
        let Some(wire) = self.wires.get(&pair) else { return Vec::new() };
        let (from, to) = pair;
        let records =
            (0..wire.records.len()).map(|at| Step::Record { from: from.clone(), to: to.clone(), at });
        let mut arrivals: Vec<Step> = records.collect();
        let ack = |at| Step::Ack { from: from.clone(), to: to.clone(), at };
        arrivals.extend((0..wire.acks.len()).map(ack));
        let next = wire.occurrences.front();
        arrivals.extend(next.map(|_| Step::Occurrence { from: from.clone(), to: to.clone() }));
        let presence = wire.presence.as_ref();
        arrivals.extend(presence.map(|_| Step::Presence { from: from.clone(), to: to.clone() }));
        arrivals
    }

    /// Puts what a step has delivered back on its way, as it was `before`: with what it had overtaken, and behind it what
    /// was sent since.
    fn put_again(&mut self, step: &Step, before: BTreeMap<(NodeName, NodeName), Rc<Wire>>) {
        let (Step::Record { from, to, .. } | Step::Ack { from, to, .. } | Step::Occurrence { from, to }) =
            step
        else {
            return;
        };
        let Some(before) = before.get(&(from.clone(), to.clone())) else { return };
        let wire = self.wire(from, to);
        match step {
            Step::Record { .. } => {
                let since = std::mem::take(&mut wire.records);
                wire.records.clone_from(&before.records);
                let is_new = |record: &BidRecord| {
                    !before
                        .records
                        .iter()
                        .any(|old| old.epoch == record.epoch && old.incarnation == record.incarnation)
                };
                wire.records.extend(since.into_iter().filter(is_new));
            }
            Step::Ack { .. } => {
                let since = std::mem::replace(&mut wire.acks, before.acks.clone());
                wire.acks.extend(since.into_iter().filter(|ack| !before.acks.contains(ack)));
            }
            _ => {
                if let Some(again) = before.occurrences.front() {
                    wire.occurrences.push_front(again.clone());
                }
            }
        }
    }

    /// Two nodes of which the first has told a fact that is the next thing the other hears of it.
    fn next_fact(&self) -> Option<(NodeName, NodeName)> {
        let is_fact = |wire: &Wire, from: &NodeName| {
            wire.occurrences.front().is_some_and(|next| facts::all(from).contains(&next.event))
        };
        let has_begun = |name: &NodeName| self.nodes.get(name).is_some_and(|node| has_begun(node));
        let next = self
            .wires
            .iter()
            .find(|((from, to), wire)| is_fact(wire, from) && has_begun(to) && !self.are_cut_off(from, to));
        next.map(|(pair, _)| pair.clone())
    }

    /// Puts a message on its way.
    fn put(&mut self, from: &NodeName, to: &NodeName, message: Message, faults: Faults) {
        let wire = self.wire(from, to);
        match message {
            Message::Bid(record) => {
                if !faults.delay {
                    wire.records.clear();
                }
                wire.records
                    .retain(|older| older.epoch != record.epoch || older.incarnation != record.incarnation);
                wire.records.push(record);
            }
            Message::Ack(ack) => {
                if !faults.delay {
                    wire.acks.clear();
                }
                let content = |ack: &BidAck| (ack.home_incarnation, ack.incarnation, ack.epoch);
                wire.acks.retain(|older| content(older) != content(&ack));
                wire.acks.push(ack);
            }
            Message::Occurrence(occurrence) => {
                wire.occurrences.push_back(occurrence);
                self.overflows |= wire.occurrences.len() > faults.most_under_way;
            }
            // Nothing that a wire holds is lost for good, so no wish to hear it again is needed, and a sign of life says
            // nothing new but where it is put by hand.
            Message::Presence(_) | Message::Repair(_) => {}
        }
    }

    /// One lapse more of those that there may be, unless this pair's has begun or a partition brings it about.
    fn pay_for_lapse(&mut self, holder: &NodeName, home: &NodeName) {
        let has_begun = self.lapsing.remove(&(holder.clone(), home.clone()));
        if !has_begun && !self.are_cut_off(holder, home) {
            self.lapses -= 1;
        }
    }

    /// What a holder is sure of again does not lapse.
    fn forget_renewed(&mut self) {
        let is_sure = |holder: &NodeName, home: &NodeName| {
            self.nodes.get(holder).is_some_and(|holder| holder.is_sure_of(home))
        };
        self.lapsing.retain(|(holder, home)| !is_sure(holder, home));
    }
}

/// Whether a node's b-threads have reached their first synchronisation points.
fn has_begun(node: &Node) -> bool {
    node.program().bids().all(|(.., sync)| sync > 0)
}

/// Every node with every other one.
fn pairs(network: &Network) -> impl Iterator<Item = (&NodeName, &NodeName)> {
    let others = |from| network.nodes.keys().filter(move |to| *to != from).map(move |to| (from, to));
    network.nodes.keys().flat_map(others)
}

fn presence(of: &Member, incarnation: u64, up: Duration, latest_seq: u64) -> Message {
    Message::Presence(Presence {
        node: of.config.name.clone(),
        incarnation,
        up,
        latest_seq,
        oldest_seq: 1,
        lease_ms: u64::try_from(of.config.lease.as_millis()).unwrap_or(u64::MAX),
        joint: None,
    })
}

/// One selection among several.
#[derive(Clone, Copy, Debug)]
struct Choice {
    taken: usize,
    of: usize,
}

/// What to select, in order; beyond its end the first event each time, which is noted.
#[derive(Debug)]
struct Choices {
    script: Vec<Choice>,
    at: usize,
}

impl Choices {
    fn step(&mut self, program: &mut Program, now: Duration) -> Result<Option<Selection>, ProgramError> {
        program.synchronise(now)?;
        let selectable = program.selectable();
        if self.at == self.script.len() && selectable.len() > 1 {
            self.script.push(Choice { taken: 0, of: selectable.len() });
        }
        let taken = if selectable.len() > 1 {
            self.at += 1;
            self.script.get(self.at - 1).map_or(0, |choice| choice.taken)
        } else {
            0
        };
        selectable.get(taken).map(|event| program.choose(event, now)).transpose()
    }
}

#[cfg(test)]
mod runs;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::programs;

    /// Where a network may come to from here. Labels show counters, so they may differ.
    fn ways(model: &mut NetworkModel, network: &Network) -> Vec<Vec<u32>> {
        let mut ways = Vec::new();
        for step in model.steps(network) {
            for (_, next) in model.outcomes(network, &step) {
                ways.push(model.row(&next));
            }
        }
        ways.sort();
        ways
    }

    /// What a row leaves out, such as times and how far the counters have come, must make no difference.
    #[test]
    fn networks_of_one_row_go_on_alike() {
        let faults = Faults { lapses: 1, restarts: 1, repeats: 1, partitions: 1, ..Faults::default() };
        for network in programs::sound().unwrap() {
            let network_name = network.name;
            let mut model = NetworkModel::new(network.members, faults, Vec::new());
            let start = model.formed();
            let mut seen = FxHashMap::default();
            let mut queue = std::collections::VecDeque::from([start]);
            let mut compared = 0;
            while let Some(network) = queue.pop_front() {
                let row = model.row(&network);
                let ways = ways(&mut model, &network);
                if let Some(known) = seen.get(&row) {
                    compared += 1;
                    assert_eq!(&ways, known, "{network_name}");
                    continue;
                }
                seen.insert(row, ways);
                if seen.len() + queue.len() < 600 {
                    for step in model.steps(&network) {
                        queue.extend(model.outcomes(&network, &step).into_iter().map(|(_, next)| next));
                    }
                }
            }
            assert!(compared > 100, "only {compared} pairs in {network_name}");
        }
    }
}
