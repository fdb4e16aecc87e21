//! Runs of real nodes, held against the model: wherever a run comes to, there the model comes too.
//!
//! Time runs in them: messages take it, are lost and repeated, leases are renewed or lapse, partitions begin and end.
//! Only the clock of the b-threads is held, as the model has it, and their deadlines are let pass when they are due.

use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustc_hash::FxHashSet;

use crate::message::{BidRecord, Message, Recipient};
use crate::name::NodeName;
use crate::verify::model::NetworkModel;
use crate::verify::network::Network;
use crate::verify::{Faults, programs};

const MS: Duration = Duration::from_millis(1);
/// The length of a run.
const LENGTH: Duration = Duration::from_secs(4);
/// The events of a run that are told when it leaves the model.
const STORY: usize = 12;

/// Every state that the model comes to, as far as a run can be compared with it.
fn reached_by(model: &mut NetworkModel) -> FxHashSet<Vec<u32>> {
    let start = model.formed();
    let mut reached = FxHashSet::from_iter([comparable_row(model, &start)]);
    let mut seen = FxHashSet::from_iter([model.row(&start)]);
    let mut queue = VecDeque::from([start]);
    while let Some(network) = queue.pop_front() {
        for step in network.steps() {
            for (_, next) in model.outcomes(&network, &step) {
                if seen.insert(model.row(&next)) {
                    reached.insert(comparable_row(model, &next));
                    queue.push_back(next);
                }
            }
        }
    }
    reached
}

/// A state without what a run does not share with the model: how much may still go wrong, what has lapsed of itself
/// because there was nothing to renew, and signs of life, which come again and again.
fn comparable_row(model: &mut NetworkModel, network: &Network) -> Vec<u32> {
    let mut network = network.clone();
    network.faults = Faults { lapses: 0, restarts: 0, repeats: 0, partitions: 0, ..network.faults };
    network.lapsing.clear();
    network.wires.values_mut().for_each(|wire| Rc::make_mut(wire).presence = None);
    network.nodes.values_mut().for_each(|node| Rc::make_mut(node).overlook_idle_leases());
    model.row(&network)
}

/// A message that is on its way.
struct Underway {
    at: Duration,
    from: NodeName,
    to: NodeName,
    message: Message,
}

/// The end of a run.
enum End {
    /// It was as long as it should be.
    Whole,
    /// More leases lapsed than the model allows for.
    BeyondFaults,
}

struct Run<'a> {
    model: &'a mut NetworkModel,
    reached: &'a FxHashSet<Vec<u32>>,
    /// The nodes, and what is on its way between them by the model's rules.
    network: Network,
    underway: Vec<Underway>,
    rng: ChaCha8Rng,
    /// The probability that a message is lost or comes twice, and the longest time it takes.
    loss: f64,
    slowest: Duration,
    /// When each deadline of a b-thread passes, with the synchronisation point at which it was set.
    deadlines: BTreeMap<(NodeName, String), (u64, Duration)>,
    /// The record that each node has stated last to each home.
    stated: BTreeMap<(NodeName, NodeName), BidRecord>,
    /// Who was sure of whom, who heard whom, and whose bids stood where.
    standing: BTreeMap<(NodeName, NodeName), [bool; 3]>,
    /// Whether a record has arrived that was on a wire, so that its acknowledgement is too.
    answers: bool,
    /// When two nodes are cut off from one another, and when they are joined again.
    cut: Option<(Duration, Duration)>,
    /// The number of leases that have lapsed without a partition.
    lapses: u32,
    /// The last things that happened, for people.
    story: VecDeque<String>,
}

impl<'a> Run<'a> {
    fn new(model: &'a mut NetworkModel, reached: &'a FxHashSet<Vec<u32>>, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let network = model.formed();
        let start = network.now;
        let cut = (network.faults.partitions > 0).then(|| {
            let begins = start + MS * rng.random_range(0..1500);
            (begins, begins + MS * rng.random_range(100..2500))
        });
        let (loss, slowest) = (rng.random_range(0.0..0.3), MS * rng.random_range(1..400));
        Self {
            model,
            reached,
            network,
            underway: Vec::new(),
            rng,
            loss,
            slowest,
            deadlines: BTreeMap::new(),
            stated: BTreeMap::new(),
            standing: BTreeMap::new(),
            answers: false,
            cut,
            lapses: 0,
            story: VecDeque::new(),
        }
    }

    fn play(mut self) -> End {
        let end = self.network.now + LENGTH;
        let nodes: Vec<NodeName> = self.network.nodes.keys().cloned().collect();
        for node in nodes {
            self.go_on(&node);
            self.compare(format!("{node} begins"));
        }
        while self.network.now < end {
            if self.is_beyond_faults() {
                return End::BeyondFaults;
            }
            self.happen_next();
        }
        End::Whole
    }

    fn is_beyond_faults(&self) -> bool {
        self.lapses > self.network.faults.lapses
    }

    /// Lets what comes next happen: a cut, an arrival, a deadline, or the next step of a node that has something to do.
    fn happen_next(&mut self) {
        let arrival = self.underway.iter().map(|message| message.at).min();
        let deadline = self.deadlines.values().map(|(_, at)| *at).min();
        let due = self.network.nodes.values().map(|node| node.next_deadline()).min();
        let cut = self.cut.map(|(begins, ends)| if begins > self.network.now { begins } else { ends });
        let Some(next) = [arrival, deadline, due, cut].into_iter().flatten().min() else { return };
        self.network.now = self.network.now.max(next);
        let now = self.network.now;
        if cut.is_some_and(|at| at <= now) {
            return self.cut_or_heal();
        }
        if let Some(at) = self.underway.iter().position(|message| message.at <= now) {
            let message = self.underway.swap_remove(at);
            return self.arrive(message);
        }
        let passed = self.deadlines.iter().find(|(_, (_, at))| *at <= now).map(|(whose, _)| whose.clone());
        if let Some((node, bthread)) = passed {
            self.deadlines.remove(&(node.clone(), bthread.clone()));
            self.network.with(&node, |node| node.let_deadline_pass(&bthread));
            self.go_on(&node);
            return self.compare(format!("the deadline of {node}#{bthread} passes"));
        }
        let due = self.network.nodes.iter().find(|(_, node)| node.next_deadline() <= now);
        if let Some(node) = due.map(|(name, _)| name.clone()) {
            self.go_on(&node);
            self.compare(format!("{node} goes on"));
        }
    }

    fn cut_or_heal(&mut self) {
        let roster: Vec<NodeName> = self.network.nodes.keys().take(2).cloned().collect();
        let [one, other] = &roster[..] else { return };
        let pair = (one.clone(), other.clone());
        match self.cut {
            Some((_, ends)) if ends <= self.network.now => {
                self.cut = None;
                self.network.cut.remove(&pair);
                self.hear_facts();
                self.compare("joined again".to_owned());
            }
            Some((_, ends)) => {
                self.cut = Some((Duration::ZERO, ends));
                self.network.cut.insert(pair);
                self.compare("cut off".to_owned());
            }
            None => {}
        }
    }

    fn arrive(&mut self, underway: Underway) {
        let Underway { from, to, message, .. } = underway;
        // The model does not have it that several occurrences are told at once, behind a hole that is filled; so what
        // comes too early is lost.
        let comes_early = matches!(&message, Message::Occurrence(occurrence)
            if occurrence.seq > self.network.nodes[&to].channel.applied(&from) + 1);
        if comes_early || self.network.are_cut_off(&from, &to) {
            return;
        }
        let what = format!("{to} hears {message:?}");
        self.take_off_the_wire(&from, &to, &message);
        self.network.hand_over(&to, Some(message));
        self.go_on(&to);
        self.answers = false;
        self.compare(what);
    }

    /// What arrives is, by the model's rules, on its way no more; copies are not on its wires.
    fn take_off_the_wire(&mut self, from: &NodeName, to: &NodeName, message: &Message) {
        let wire = self.network.wire(from, to);
        match message {
            Message::Bid(record) => {
                let same = |other: &BidRecord| {
                    (other.incarnation, other.epoch) == (record.incarnation, record.epoch)
                };
                if let Some(at) = wire.records.iter().position(same) {
                    wire.records.drain(..=at);
                    self.answers = true;
                }
            }
            Message::Ack(ack) => {
                if let Some(at) = wire.acks.iter().position(|other| other.epoch == ack.epoch) {
                    wire.acks.drain(..=at);
                }
            }
            Message::Occurrence(_) => {
                // What the node has been told of is taken off when it has gone on.
            }
            Message::Presence(_) | Message::Repair(_) => {}
        }
    }

    /// A node goes on, and what it says is sent.
    fn go_on(&mut self, name: &NodeName) {
        let now = self.network.now;
        let mut outgoing = Vec::new();
        self.network.with(name, |node| {
            node.step(now).unwrap();
            outgoing = node.take_outgoing();
        });
        self.count_lapses();
        for (recipient, message) in outgoing {
            for to in self.network.others(name) {
                if !matches!(&recipient, Recipient::Node(node) if *node != to) {
                    self.send(name, &to, message.clone());
                }
            }
        }
        self.drop_heard();
        self.note_deadlines();
        self.hear_facts();
    }

    /// Facts arrive at once, where the model has it so.
    fn hear_facts(&mut self) {
        while let Some((from, to)) = self.network.next_fact() {
            let fact = self.network.wire(&from, &to).occurrences.pop_front();
            self.network.hand_over(&to, fact.map(Message::Occurrence));
            self.go_on(&to);
        }
    }

    /// Occurrences that a node has been told of are on their way to it no more.
    fn drop_heard(&mut self) {
        for (from, to) in self.network.clone().pairs() {
            let applied = self.network.nodes.get(to).map_or(0, |node| node.channel.applied(from));
            let wire = self.network.wire(from, to);
            while wire.occurrences.front().is_some_and(|next| next.seq <= applied) {
                wire.occurrences.pop_front();
            }
        }
    }

    /// Puts a message on the wire unless it only repeats another, and on its way, unless it is lost.
    fn send(&mut self, from: &NodeName, to: &NodeName, message: Message) {
        let repeats = match &message {
            Message::Bid(record) => {
                let pair = (from.clone(), to.clone());
                let before = self.stated.insert(pair, record.clone());
                before.is_some_and(|before| {
                    (before.incarnation, before.epoch) == (record.incarnation, record.epoch)
                })
            }
            Message::Ack(_) => !self.answers,
            Message::Occurrence(occurrence) => {
                let wire = self.network.wire(from, to);
                wire.occurrences.iter().any(|other| other.seq == occurrence.seq)
                    || self.network.nodes[to].channel.applied(from) >= occurrence.seq
            }
            Message::Presence(_) | Message::Repair(_) => true,
        };
        if !repeats {
            self.network.put(from, to, message.clone());
        }
        while !self.rng.random_bool(self.loss) {
            let at = self.network.now + self.slowest.mul_f64(self.rng.random_range(0.0..1.0)) + MS;
            self.underway.push(Underway { at, from: from.clone(), to: to.clone(), message: message.clone() });
            if !self.rng.random_bool(self.loss / 2.0) {
                break;
            }
        }
    }

    /// Who is sure of whom, who is heard by whom, and whose bids stand where.
    fn sure_and_heard(&self) -> BTreeMap<(NodeName, NodeName), [bool; 3]> {
        let nodes = &self.network.nodes;
        let standing = |(from, to): (&NodeName, &NodeName)| {
            let relies = nodes[from].guest.relies_on(to) && nodes[from].is_sure_of(to);
            let held = nodes[to].home.holds_bids_of(from);
            ((from.clone(), to.clone()), [relies, nodes[to].channel.counts_as_alive(from), held])
        };
        self.network.pairs().map(standing).collect()
    }

    fn count_lapses(&mut self) {
        let now = self.sure_and_heard();
        for (pair, [relied, heard, held]) in &std::mem::replace(&mut self.standing, now.clone()) {
            let (from, to) = pair;
            let [relies, hears, _] = now[pair];
            let no_longer_sure = *relied && !relies && self.network.nodes[from].guest.relies_on(to);
            let let_go = *held && !self.network.nodes[to].home.keeps_lease_of(from);
            if no_longer_sure || let_go || *heard && !hears {
                self.lapses += u32::from(!self.network.are_cut_off(from, to));
                self.network.wire(to, from).acks.clear();
                if let Some(record) = self.stated.get(pair).cloned()
                    && (no_longer_sure || self.network.nodes[from].states(to) == Some(record.epoch))
                {
                    // The next copy is as good as sent.
                    let copy = BidRecord { sent_at: self.network.now, ..record };
                    self.network.put(from, to, Message::Bid(copy));
                }
            }
        }
    }

    /// A deadline is set when its b-thread comes to it.
    fn note_deadlines(&mut self) {
        let now = self.network.now;
        let mut open = BTreeMap::new();
        for (name, node) in &self.network.nodes {
            for (bthread, bid, sync) in node.program().bids() {
                let Some(after) = bid.given_deadline() else { continue };
                let whose = (name.clone(), bthread.to_owned());
                let known = self.deadlines.get(&whose).filter(|(at, _)| *at == sync).map(|(_, at)| *at);
                open.insert(whose, (sync, known.unwrap_or(now + after)));
            }
        }
        self.deadlines = open;
    }

    /// The state now is one that the model comes to.
    fn compare(&mut self, what: String) {
        if self.is_beyond_faults() {
            return;
        }
        self.story.push_back(format!("{:?} {what}", self.network.now));
        if self.story.len() > STORY {
            self.story.pop_front();
        }
        let row = comparable_row(self.model, &self.network);
        let story = || self.story.iter().map(String::as_str).collect::<Vec<_>>().join("\n");
        assert!(
            self.reached.contains(&row),
            "the model does not come here:\n{}\n{:#?}",
            story(),
            self.network.wires
        );
    }
}

/// What runs are held against: whole graphs, so without what makes them large.
fn faults_of_runs(network: &programs::Network) -> Faults {
    Faults { lapses: 0, restarts: 0, repeats: 0, partitions: 1, ..network.faults }
}

#[test]
fn real_nodes_go_nowhere_but_where_the_model_goes() {
    // What comes late in a run is on its way in a model with delay alone; and three nodes have too many states.
    let is_compared = |network: &programs::Network| network.faults.delay && network.members.len() == 2;
    for network in programs::all().unwrap().into_iter().filter(is_compared) {
        let (name, faults) = (network.name, faults_of_runs(&network));
        let mut model = NetworkModel::new(network.members, faults, Vec::new());
        let reached = reached_by(&mut model);
        let mut whole = 0;
        for seed in 0..200 {
            let end = Run::new(&mut model, &reached, seed).play();
            whole += usize::from(matches!(end, End::Whole));
        }
        println!("{name}: {} states, {whole} whole runs", reached.len());
        assert!(whole > 100, "{name}: only {whole} runs were within what may go wrong");
    }
}
