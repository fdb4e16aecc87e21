//! A network of real nodes, and all that may happen to it.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use crate::config::NodeConfig;
use crate::error::NodeError;
use crate::facts;
use crate::kept::Kept;
use crate::message::{Message, Presence, Recipient};
use crate::name::NodeName;
use crate::node::Node;
use crate::verify::choices::Choices;
use crate::verify::row::Row;
use crate::verify::step::{Cargo, Pair, Step};
use crate::verify::wire::Wire;
use crate::verify::{Faults, Member};

/// When the network starts: later than any lease, so that what was last heard at time zero has lapsed.
const START: Duration = Duration::from_secs(1 << 20);
/// From one move to the next; so little that nothing lapses by itself.
const MOVE: Duration = Duration::from_nanos(1);

/// Nodes, the messages on their way between them, and the faults that there may still be.
#[derive(Clone, Debug)]
pub(super) struct Network {
    members: Rc<[Member]>,
    pub(super) nodes: BTreeMap<NodeName, Rc<Node>>,
    pub(super) wires: BTreeMap<Pair, Rc<Wire>>,
    pub(super) faults: Faults,
    /// Holders that are no longer sure of a home, which has yet to let go of their bids.
    pub(super) lapsing: BTreeSet<Pair>,
    /// Pairs of nodes that are cut off from one another, each in the order of their names.
    pub(super) cut: BTreeSet<Pair>,
    pub(super) now: Duration,
    /// Why a node could not go on.
    pub(super) broken: Option<(NodeName, NodeError)>,
    /// Whether more was sent than may be on its way.
    pub(super) overflows: bool,
}

impl Network {
    /// The fleet is formed, and nobody has begun.
    pub(super) fn formed(members: Rc<[Member]>, faults: Faults) -> Self {
        let nodes = members.iter().map(|member| {
            let mut node = member.node(&members, member.config.incarnation, Kept::default());
            for other in members.iter().filter(|other| other.config.name != member.config.name) {
                let presence = presence(other, other.config.incarnation, Duration::ZERO, 0);
                node.handle(START, Message::Presence(presence));
            }
            (member.config.name.clone(), Rc::new(node))
        });
        Self {
            nodes: nodes.collect(),
            members,
            wires: BTreeMap::new(),
            faults,
            lapsing: BTreeSet::new(),
            cut: BTreeSet::new(),
            now: START,
            broken: None,
            overflows: false,
        }
    }

    pub(super) fn write_standing(&self, row: &mut Row<'_>) {
        self.nodes.values().for_each(|node| node.write_standing(row));
        let silent = Wire::default();
        for (from, to) in self.pairs() {
            if let Some(home) = self.nodes.get(to) {
                let wire = self.wires.get(&(from.clone(), to.clone())).map_or(&silent, |wire| wire);
                wire.write_standing(row, from, home);
            }
        }
        let Faults { lapses, restarts, repeats, partitions, .. } = self.faults;
        [lapses, restarts, repeats, partitions].into_iter().for_each(|left| row.plain(left.into()));
        for pairs in [&self.cut, &self.lapsing] {
            row.list(pairs, |row, (one, other)| {
                row.text(one.as_str());
                row.text(other.as_str());
            });
        }
        if let Some((node, error)) = &self.broken {
            row.text(&format!("{node}: {error}"));
        }
    }

    /// All that may happen next.
    pub(super) fn steps(&self) -> Vec<Step> {
        if let Some((name, _)) = self.nodes.iter().find(|(_, node)| !has_begun(node)) {
            return vec![Step::Begin(name.clone())];
        }
        let mut steps = Vec::new();
        for (from, to) in self.pairs() {
            self.add_steps_between((from.clone(), to.clone()), &mut steps);
        }
        for (name, node) in &self.nodes {
            let sure = self.nodes.values().any(|other| other.is_sure_of(name));
            if node.home.guarding && !sure {
                steps.push(Step::GuardEnds(name.clone()));
            }
            steps.extend(node.deadlines().map(|bthread| Step::Deadline(name.clone(), bthread.into())));
            if self.faults.restarts > 0 && self.member(name).is_some_and(|member| member.may_restart) {
                steps.push(Step::Restart(name.clone()));
            }
        }
        steps
    }

    fn add_steps_between(&self, pair: Pair, steps: &mut Vec<Step>) {
        let (from, to) = &pair;
        let is_cut = self.are_cut_off(from, to);
        let wire = self.wires.get(&pair).filter(|_| !is_cut);
        let arrivals = || wire.into_iter().flat_map(|wire| wire.arrivals());
        if self.faults.repeats > 0 {
            let again = arrivals().filter(|cargo| *cargo != Cargo::Presence);
            steps.extend(again.map(|cargo| Step::Twice(pair.clone(), cargo)));
        }
        steps.extend(arrivals().map(|cargo| Step::Arrival(pair.clone(), cargo)));
        // Of each pair once.
        if from < to && is_cut {
            steps.push(Step::Heal(pair.clone()));
        } else if from < to && self.faults.partitions > 0 {
            steps.push(Step::Cut(pair.clone()));
        }
        let (Some(holder), Some(home)) = (self.nodes.get(from), self.nodes.get(to)) else { return };
        let may_lapse = self.faults.lapses > 0 || is_cut;
        if holder.is_sure_of(to) {
            if may_lapse {
                steps.push(Step::HoldLapses(pair));
            }
        } else if home.channel.counts_as_alive(from) && (may_lapse || self.lapsing.contains(&pair)) {
            if home.home.holds_bids_of(from) {
                steps.push(Step::BidsLapse(pair.clone()));
            }
            steps.push(Step::LeaseLapses(pair));
        }
    }

    /// Lets a step happen, and the nodes go on after it; gives the selections on the way.
    pub(super) fn take(&mut self, step: &Step, choices: &mut Choices) -> Vec<String> {
        self.now += MOVE;
        let mut selected = self.happen(step, choices);
        self.hear_facts(choices, &mut selected);
        self.forget_renewed();
        selected
    }

    fn happen(&mut self, step: &Step, choices: &mut Choices) -> Vec<String> {
        match step {
            Step::Begin(node) => self.go_on(node, choices),
            Step::Arrival(pair, cargo) => self.arrive(pair, *cargo, choices),
            Step::Twice(pair, cargo) => {
                let before = self.wires.get(pair).cloned().unwrap_or_default();
                self.faults.repeats -= 1;
                let selected = self.arrive(pair, *cargo, choices);
                self.wire(&pair.0, &pair.1).reload(*cargo, &before);
                selected
            }
            Step::Cut(pair) => {
                self.faults.partitions -= 1;
                self.cut.insert(pair.clone());
                Vec::new()
            }
            Step::Heal(pair) => {
                self.cut.remove(pair);
                Vec::new()
            }
            Step::HoldLapses(pair) => {
                let (holder, home) = pair;
                if !self.are_cut_off(holder, home) {
                    self.faults.lapses -= 1;
                    self.lapsing.insert(pair.clone());
                }
                // The copies that were sent before may arrive yet.
                self.with(holder, |node| node.let_renewal_fall_due(home));
                let mut selected = self.go_on(holder, choices);
                self.with(holder, |node| node.let_hold_lapse(home));
                // An acknowledgement on its way is of a copy sent before.
                self.wire(home, holder).acks.clear();
                selected.extend(self.go_on(holder, choices));
                selected
            }
            Step::BidsLapse(pair) => {
                let (holder, home) = pair;
                self.pay_for_lapse(pair);
                if !self.are_cut_off(holder, home) {
                    self.lapsing.insert(pair.clone());
                }
                self.with(home, |node| node.home.let_bids_lapse(holder));
                self.let_go(pair, choices)
            }
            Step::LeaseLapses(pair) => {
                let (holder, home) = pair;
                self.pay_for_lapse(pair);
                self.with(home, |node| node.let_lease_lapse(holder));
                let selected = self.let_go(pair, choices);
                // Its signs of life come again.
                self.wire(holder, home).presence = self.presence_of(holder);
                selected
            }
            Step::GuardEnds(node) => {
                self.with(node, Node::let_guard_end);
                self.go_on(node, choices)
            }
            Step::Deadline(node, bthread) => {
                self.with(node, |node| node.let_deadline_pass(bthread));
                self.go_on(node, choices)
            }
            Step::Restart(node) => {
                self.faults.restarts -= 1;
                self.restart(node);
                self.go_on(node, choices)
            }
        }
    }

    fn arrive(&mut self, (from, to): &Pair, cargo: Cargo, choices: &mut Choices) -> Vec<String> {
        let message = self.wire(from, to).unload(cargo);
        self.hand_over(to, message);
        self.go_on(to, choices)
    }

    /// A home and then the holder go on after a lapse. The holder states its bids again in a fresh copy.
    fn let_go(&mut self, (holder, home): &Pair, choices: &mut Choices) -> Vec<String> {
        self.wire(home, holder).acks.clear();
        let mut selected = self.go_on(home, choices);
        self.with(holder, |node| node.let_hold_lapse(home));
        selected.extend(self.go_on(holder, choices));
        selected
    }

    /// Begins a new life of a node, which finds the others alive. The messages on their way to the old one are lost.
    fn restart(&mut self, name: &NodeName) {
        let Some(member) = self.member(name).cloned() else { return };
        let old = self.nodes.get(name);
        let incarnation = old.map_or(0, |node| node.incarnation()) + 1;
        let kept = old.filter(|_| member.config.durable).map(|node| node.kept()).unwrap_or_default();
        let mut node = member.node(&self.members, incarnation, kept);
        for other in self.others(name) {
            let Some(presence) = self.presence_of(&other) else { continue };
            node.handle(self.now, Message::Presence(presence));
            self.wires.remove(&(other, name.clone()));
        }
        self.nodes.insert(name.clone(), Rc::new(node));
        for other in self.others(name) {
            self.wire(name, &other).presence = Some(presence(&member, incarnation, Duration::ZERO, 0));
        }
    }

    /// Lets a node go on, and puts its messages on the wires. Gives what it selected.
    fn go_on(&mut self, name: &NodeName, choices: &mut Choices) -> Vec<String> {
        let Some(node) = self.nodes.get_mut(name) else { return Vec::new() };
        let node = Rc::make_mut(node);
        let outcome = node.step_by(self.now, &mut |program, now| choices.step(program, now));
        let (selected, outgoing) = (node.take_selections(), node.take_outgoing());
        if let Err(error) = outcome {
            self.broken.get_or_insert((name.clone(), error));
        }
        let others = self.others(name);
        for (recipient, message) in outgoing {
            for to in &others {
                if !matches!(&recipient, Recipient::Node(node) if node != to) {
                    self.put(name, to, message.clone());
                }
            }
        }
        let own = selected.iter().filter(|happened| happened.home == *name);
        own.map(|happened| happened.event.to_string()).collect()
    }

    /// Lets the others' facts that are next on the wires arrive, unless they may take their time.
    fn hear_facts(&mut self, choices: &mut Choices, selected: &mut Vec<String>) {
        while let Some(pair) = self.next_fact() {
            selected.extend(self.arrive(&pair, Cargo::Occurrence, choices));
        }
    }

    /// Two nodes of which the first has told a fact that is the next thing the other hears of it, and must hear at
    /// once.
    pub(super) fn next_fact(&self) -> Option<Pair> {
        let is_fact = |wire: &Wire, from: &NodeName| {
            wire.occurrences.front().is_some_and(|next| facts::all(from).contains(&next.event))
        };
        let has_begun = |name: &NodeName| self.nodes.get(name).is_some_and(|node| has_begun(node));
        let mut wires = self.wires.iter().filter(|_| !self.faults.late_facts);
        let next = wires
            .find(|((from, to), wire)| is_fact(wire, from) && has_begun(to) && !self.are_cut_off(from, to));
        next.map(|(pair, _)| pair.clone())
    }

    /// The b-threads that must not stay where they are for ever: `node#bthread`.
    pub(super) fn hot_bthreads(&self) -> impl Iterator<Item = Arc<str>> {
        self.nodes.iter().flat_map(|(name, node)| {
            let hot = node.program().bids().filter(|(_, bid, _)| bid.is_hot());
            hot.map(move |(bthread, ..)| format!("{name}#{bthread}").into())
        })
    }

    /// Whether all b-threads have reached their first synchronisation points.
    pub(super) fn has_begun(&self) -> bool {
        self.nodes.values().all(|node| has_begun(node))
    }

    pub(super) fn wire(&mut self, from: &NodeName, to: &NodeName) -> &mut Wire {
        Rc::make_mut(self.wires.entry((from.clone(), to.clone())).or_default())
    }

    pub(super) fn with(&mut self, name: &NodeName, change: impl FnOnce(&mut Node)) {
        if let Some(node) = self.nodes.get_mut(name) {
            change(Rc::make_mut(node));
        }
    }

    pub(super) fn hand_over(&mut self, to: &NodeName, message: Option<Message>) {
        let now = self.now;
        if let Some(message) = message {
            self.with(to, |node| node.handle(now, message));
        }
    }

    /// Puts a message on its way.
    pub(super) fn put(&mut self, from: &NodeName, to: &NodeName, message: Message) {
        let Faults { delay, most_under_way, .. } = self.faults;
        let wire = self.wire(from, to);
        wire.load(message, delay);
        let overflows = wire.occurrences.len() > most_under_way;
        self.overflows |= overflows;
    }

    pub(super) fn are_cut_off(&self, one: &NodeName, other: &NodeName) -> bool {
        let pair = if one < other { (one.clone(), other.clone()) } else { (other.clone(), one.clone()) };
        self.cut.contains(&pair)
    }

    /// One lapse more of those that there may be, unless this pair's has begun or a partition brings it about.
    fn pay_for_lapse(&mut self, pair: &Pair) {
        let has_begun = self.lapsing.remove(pair);
        if !has_begun && !self.are_cut_off(&pair.0, &pair.1) {
            self.faults.lapses -= 1;
        }
    }

    /// A home of which its holder is sure again does not lapse.
    fn forget_renewed(&mut self) {
        let is_sure = |holder: &NodeName, home: &NodeName| {
            self.nodes.get(holder).is_some_and(|holder| holder.is_sure_of(home))
        };
        self.lapsing.retain(|(holder, home)| !is_sure(holder, home));
    }

    /// Every node with every other one.
    pub(super) fn pairs(&self) -> impl Iterator<Item = (&NodeName, &NodeName)> {
        let others = |from| self.nodes.keys().filter(move |to| *to != from).map(move |to| (from, to));
        self.nodes.keys().flat_map(others)
    }

    fn member(&self, name: &NodeName) -> Option<&Member> {
        self.members.iter().find(|member| member.config.name == *name)
    }

    /// The other members, in the order in which they were given.
    pub(super) fn others(&self, name: &NodeName) -> Vec<NodeName> {
        let names = self.members.iter().map(|member| &member.config.name);
        names.filter(|other| *other != name).cloned().collect()
    }

    /// A sign of life of a node that has been up for long.
    fn presence_of(&self, name: &NodeName) -> Option<Presence> {
        let (node, member) = (self.nodes.get(name)?, self.member(name)?);
        Some(presence(member, node.incarnation(), START, node.latest_seq()))
    }
}

impl Member {
    fn node(&self, members: &[Self], incarnation: u64, kept: Kept) -> Node {
        let roster = members.iter().map(|member| member.config.name.clone()).collect();
        let config = NodeConfig { incarnation, roster, kept, ..self.config.clone() };
        let mut node = Node::new(config, self.program.clone());
        node.hold_clock();
        node
    }
}

/// Whether a node's b-threads have reached their first synchronisation points.
fn has_begun(node: &Node) -> bool {
    node.program().bids().all(|(.., sync)| sync > 0)
}

fn presence(of: &Member, incarnation: u64, up: Duration, latest_seq: u64) -> Presence {
    Presence {
        node: of.config.name.clone(),
        incarnation,
        up,
        latest_seq,
        oldest_seq: 1,
        lease_ms: of.config.lease_ms(),
        joint: None,
    }
}
