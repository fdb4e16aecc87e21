//! Playing a story in lockstep: time jumps to whatever is due next.

use std::collections::VecDeque;
use std::time::Duration;

use skein_bp::{Event, EventSet, Program, ProgramConfig};
use skein_dbp::{Authority, Grant, Happened, Node, NodeConfig, NodeName, Role, Roster};
use skein_wire::{Fleet, MemoryStore, Network, NetworkConfig, NodeLink};

use crate::clock::Clock;
use crate::knowledge::{self, Step};
use crate::oracle::Court;
use crate::promise::{Promise, Violation};
use crate::story::{Cast, Fault, Faults, Grants, Story};
use crate::tap::TappedLink;

/// A run goes on past its story's end until so much has occurred ...
const LEAST_OCCURRENCES: u64 = 500;
/// ... but no longer than this many times its length.
const MOST_LENGTHS: u32 = 4;
/// A node that has something to do at once does it so much later.
const SHORTEST_STEP: Duration = Duration::from_micros(100);

/// The settings with which a story is played.
#[derive(Clone, Copy, Debug, Default)]
pub struct Settings {
    /// How many of the last things that happened are told.
    pub told: usize,
    /// The promise that every node breaks on purpose.
    #[cfg(feature = "mutants")]
    pub mutant: Option<skein_dbp::Mutant>,
}

impl Settings {
    /// The same, with so many of the last things told.
    #[must_use]
    pub fn telling(mut self, told: usize) -> Self {
        self.told = told;
        self
    }
}

/// The result of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The first breach of a promise, which ends the run.
    pub violation: Option<Violation>,
    pub simulated: Duration,
    /// Steps of nodes, each of which was judged.
    pub steps: u64,
    /// What occurred at its home.
    pub occurrences: u64,
    pub faults: Faults,
    /// The last things that happened, for people.
    pub told: Vec<String>,
}

/// Plays a story to its end, or to the first breach of a promise.
#[must_use]
pub fn run(story: &Story, settings: &Settings) -> Outcome {
    let mut stage = Stage::new(story, *settings);
    let violation = stage.play();
    Outcome {
        violation,
        simulated: stage.now,
        steps: stage.steps,
        occurrences: stage.occurrences,
        faults: stage.faults(),
        told: stage.told.into(),
    }
}

/// The program of a node at the beginning of a life.
pub(crate) fn program(cast: &Cast, seed: u64, node: usize) -> Program {
    let mut program = Program::new(ProgramConfig::vehicle(seed.wrapping_add(node as u64)));
    for (name, role) in &cast.roles {
        role.load(name, &cast.name, &mut program);
    }
    program
}

/// What a home lets others do, as its node is configured.
fn authority(cast: &Cast) -> Authority {
    let Some(Grants { requests, blocks }) = &cast.grants else { return Authority::unrestricted() };
    let kinds = |kinds: &[&str]| EventSet::any_of(kinds.iter().map(|kind| format!("*/*/{kind}")));
    let all = Grant { request: EventSet::All, block: EventSet::All };
    let some = Grant { request: kinds(requests).or(Roster::joint_events()), block: kinds(blocks) };
    let role = |name: &str, nodes: &str, grant| Role { name: name.into(), nodes: vec![nodes.into()], grant };
    Authority::new(vec![role("ground", "ground/*", all), role("vehicle", "uav/*", some)], None)
}

/// Something that a story says will be done.
#[derive(Clone, Debug)]
enum Turn {
    Weather(NetworkConfig),
    /// A partition of this number begins or ends.
    Cut(usize, bool),
    /// One reason more, or one less, for a node to be gone.
    Gone(usize, bool),
    /// One reason more, or one less, for a process to stand still.
    Still(usize, bool),
    /// An operator tells a node this.
    Order(usize, Event),
}

struct Stage<'a> {
    story: &'a Story,
    settings: Settings,
    roster: Vec<NodeName>,
    network: Network,
    players: Vec<Player<'a>>,
    /// What is still to be done, next one last.
    turns: Vec<(Duration, Turn)>,
    cuts: Vec<bool>,
    court: Court,
    now: Duration,
    steps: u64,
    occurrences: u64,
    told: VecDeque<String>,
}

struct Player<'a> {
    cast: &'a Cast,
    clock: Clock,
    alive: Option<(NodeLink, TappedLink)>,
    incarnation: u64,
    gone: u32,
    still: u32,
    /// When it has something to do even if no message comes; true time.
    due: Duration,
    stepped: Option<Duration>,
    senses_next: Option<Duration>,
    sensed: i64,
    /// What an operator has told it since its last step.
    ordered: Vec<Event>,
    store: MemoryStore,
}

impl<'a> Stage<'a> {
    fn new(story: &'a Story, settings: Settings) -> Self {
        let players: Vec<Player<'a>> = story.casts.iter().map(Player::new).collect();
        let network = Network::new(NetworkConfig::default(), story.seed);
        Self {
            story,
            settings,
            roster: story.roster(),
            network,
            players,
            turns: turns(story),
            cuts: vec![false; story.faults.len()],
            court: Court::new(story),
            now: Duration::ZERO,
            steps: 0,
            occurrences: 0,
            told: VecDeque::new(),
        }
    }

    fn play(&mut self) -> Option<Violation> {
        for node in 0..self.players.len() {
            if self.players[node].gone == 0 {
                self.start(node);
            }
        }
        loop {
            let turn = self.turns.last().map(|(at, _)| *at);
            let next = self
                .players
                .iter()
                .enumerate()
                .filter_map(|(node, player)| Some((player.wakes(self.now)?, node)));
            let next = next.min();
            let at = [turn, next.map(|(at, _)| at)].into_iter().flatten().min()?;
            if at > self.story.end && self.has_seen_enough() {
                self.now = self.now.max(self.story.end);
                return self.court.ends(self.now);
            }
            self.now = at;
            self.network.advance(at);
            if turn == Some(at) {
                if let Some((_, turn)) = self.turns.pop() {
                    self.take(turn);
                }
            } else if let Some((_, node)) = next
                && let Some(violation) = self.step(node)
            {
                return Some(violation);
            }
        }
    }

    fn has_seen_enough(&self) -> bool {
        self.occurrences >= LEAST_OCCURRENCES || self.now > self.story.end * MOST_LENGTHS
    }

    fn take(&mut self, turn: Turn) {
        match turn {
            Turn::Weather(habits) => self.network.set_config(habits),
            Turn::Cut(number, begins) => {
                self.cuts[number] = begins;
                self.part();
            }
            Turn::Gone(node, true) => {
                self.players[node].gone += 1;
                self.kill(node);
            }
            Turn::Gone(node, false) => {
                self.players[node].gone -= 1;
                if self.players[node].gone == 0 {
                    self.start(node);
                }
            }
            Turn::Order(node, event) => {
                let player = &mut self.players[node];
                if player.alive.is_some() {
                    player.ordered.push(event);
                    player.due = self.now;
                }
            }
            Turn::Still(node, begins) => {
                let player = &mut self.players[node];
                player.still = if begins { player.still + 1 } else { player.still - 1 };
                if begins && player.alive.is_some() {
                    self.court.pauses(node);
                }
            }
        }
    }

    /// Lets those reach each other whom no partition parts.
    fn part(&mut self) {
        let mut groups: Vec<(Vec<bool>, Vec<NodeName>)> = Vec::new();
        for (node, name) in self.roster.iter().enumerate() {
            let faults = self.story.faults.iter().zip(&self.cuts);
            let sides: Vec<bool> = faults
                .map(|(fault, cut)| {
                    *cut && matches!(fault, Fault::Partition { apart, .. } if apart.contains(&node))
                })
                .collect();
            match groups.iter_mut().find(|(of, _)| *of == sides) {
                Some((_, group)) => group.push(name.clone()),
                None => groups.push((sides, vec![name.clone()])),
            }
        }
        let groups: Vec<&[NodeName]> = groups.iter().map(|(_, group)| &**group).collect();
        self.network.partition(&groups);
    }

    fn kill(&mut self, node: usize) {
        if self.players[node].alive.take().is_some() {
            self.network.leave(&self.roster[node]);
            self.court.dies(node);
        }
    }

    #[allow(clippy::expect_used)]
    fn start(&mut self, node: usize) {
        let player = &mut self.players[node];
        player.incarnation += 1;
        let cast = player.cast;
        let config = NodeConfig {
            lease: cast.lease,
            longest_lease: self.story.longest_lease(),
            safety: knowledge::safety(cast),
            guarded: knowledge::guarded(cast),
            authority: authority(cast),
            joint: self.story.first_roster(),
            durable: true,
            kept: player.store.kept(),
            history: cast.history,
            #[cfg(feature = "mutants")]
            mutant: self.settings.mutant,
            ..NodeConfig::new(cast.name.clone(), player.incarnation, self.roster.clone())
        };
        let mut started = Node::new(config, program(cast, self.story.seed, node));
        started.record_channel();
        let fleet = Fleet::new("promises").expect("a plain name");
        let link = TappedLink::new(self.network.join(&cast.name));
        self.court.starts(node, self.now, started.program());
        let store = Box::new(player.store.clone());
        player.alive = Some((NodeLink::durable(started, fleet, store), link));
        player.ordered.clear();
        player.due = self.now;
        player.stepped = None;
        player.senses_next = cast.senses.map(|every| self.now + every);
        let still = player.still > 0;
        if still {
            self.court.pauses(node);
        }
    }

    /// Lets a node take in what has come, go on, and send; then judges it.
    fn step(&mut self, node: usize) -> Option<Violation> {
        let now = self.now;
        let player = &mut self.players[node];
        let clock = player.clock.shows(now);
        let (node_link, link) = player.alive.as_mut()?;
        let mut enqueued = std::mem::take(&mut player.ordered);
        enqueued.iter().for_each(|event| node_link.node_mut().enqueue(event.clone()));
        while let Some(every) = player.cast.senses
            && player.senses_next.is_some_and(|at| at <= now)
        {
            player.sensed += 1;
            let event = Event::new(player.cast.name.event_name("sensed")).with("n", player.sensed);
            node_link.node_mut().enqueue(event.clone());
            enqueued.push(event);
            player.senses_next = Some(now + every);
        }
        let outcome = node_link.pump(clock, link);
        let not_understood = node_link.stats().undecodable + node_link.stats().forged;
        let happened = node_link.node_mut().take_selections();
        let moves = node_link.node_mut().take_channel_moves();
        let received = link.take_received();
        player.due = player.clock.when(node_link.node().next_deadline());
        player.stepped = Some(now);
        self.steps += 1;
        let here = happened.iter().filter(|happened| happened.home == player.cast.name);
        self.occurrences += here.count() as u64;
        tell(&mut self.told, self.settings.told, now, &player.cast.name, &happened);
        let broken = |what| {
            Some(Violation { promise: Promise::GoesOn, at: now, node: player.cast.name.clone(), what })
        };
        if let Err(error) = outcome {
            return broken(format!("the step failed: {error}"));
        }
        if not_understood > 0 {
            return broken("a message was not understood".to_owned());
        }
        self.court.judge(&Step {
            at: now,
            clock,
            node,
            enqueued: &enqueued,
            received: &received,
            happened: &happened,
            moves: &moves,
            program: node_link.node().program(),
        })
    }

    fn faults(&self) -> Faults {
        let network = self.network.stats();
        let begun = |is: fn(&Fault) -> bool| {
            self.story.faults.iter().filter(|fault| is(fault) && fault.at() <= self.now).count() as u64
        };
        let slow = |habits: &NetworkConfig| habits.latency.1 >= Duration::from_millis(300);
        let late = |cast: &&Cast| !cast.joins.is_zero() && cast.joins <= self.now;
        Faults {
            lost: network.lost,
            duplicated: network.duplicated,
            reordered: network.overtaking,
            delayed: u64::from(self.story.weather.iter().any(|weather| slow(&weather.habits))),
            partitions: begun(|fault| matches!(fault, Fault::Partition { .. })),
            pauses: begun(|fault| matches!(fault, Fault::Pause { .. })),
            restarts: begun(|fault| matches!(fault, Fault::Restart { .. })),
            late_joiners: self.story.casts.iter().filter(late).count() as u64,
        }
    }
}

impl<'a> Player<'a> {
    fn new(cast: &'a Cast) -> Self {
        Self {
            cast,
            clock: Clock::new(cast.clock_offset, cast.drift_ppm),
            alive: None,
            incarnation: 0,
            gone: u32::from(!cast.joins.is_zero()),
            still: 0,
            due: Duration::ZERO,
            stepped: None,
            senses_next: None,
            sensed: 0,
            ordered: Vec::new(),
            store: MemoryStore::default(),
        }
    }

    /// When it steps next, true time and not before `now`, if nothing changes.
    fn wakes(&self, now: Duration) -> Option<Duration> {
        let (_, link) = self.alive.as_ref().filter(|_| self.still == 0)?;
        let due =
            [link.link.next_arrival(), self.senses_next].into_iter().flatten().fold(self.due, Duration::min);
        let due = self.stepped.map_or(due, |at| due.max(at + SHORTEST_STEP)).max(now);
        Some(round_up(due, self.cast.tick))
    }
}

/// The first multiple of `tick` that is not before `at`.
fn round_up(at: Duration, tick: Duration) -> Duration {
    if tick.is_zero() {
        return at;
    }
    let ticks = at.as_nanos().div_ceil(tick.as_nanos());
    tick * u32::try_from(ticks).unwrap_or(u32::MAX)
}

/// All that a story says will be done, next one last.
fn turns(story: &Story) -> Vec<(Duration, Turn)> {
    let mut turns: Vec<(Duration, Turn)> =
        story.weather.iter().map(|weather| (weather.from, Turn::Weather(weather.habits))).collect();
    for (number, fault) in story.faults.iter().enumerate() {
        let turn = |begins| match fault {
            Fault::Partition { .. } => Turn::Cut(number, begins),
            Fault::Pause { node, .. } => Turn::Still(*node, begins),
            Fault::Restart { node, .. } => Turn::Gone(*node, begins),
        };
        turns.extend([(fault.at(), turn(true)), (fault.ends(), turn(false))]);
    }
    for order in &story.orders {
        for (node, at) in
            (0..story.casts.len()).zip(std::iter::successors(Some(order.at), |at| Some(*at + order.spread)))
        {
            turns.extend(story.event_of(order, node).map(|event| (at, Turn::Order(node, event))));
        }
    }
    let late = story.casts.iter().enumerate().filter(|(_, cast)| !cast.joins.is_zero());
    turns.extend(late.map(|(node, cast)| (cast.joins, Turn::Gone(node, false))));
    turns.push((story.calm, Turn::Weather(NetworkConfig::default())));
    turns.sort_by_key(|(at, _)| *at);
    turns.reverse();
    turns
}

/// Adds to the last things that happened.
fn tell(told: &mut VecDeque<String>, most: usize, at: Duration, node: &NodeName, happened: &[Happened]) {
    if most == 0 {
        return;
    }
    for Happened { event, home, seq, origin, requested_by, .. } in happened {
        let whence = if home == node { String::new() } else { format!(", number {seq} of {home}") };
        let by =
            if requested_by.is_empty() { String::new() } else { format!(", by {}", requested_by.join(", ")) };
        told.push_back(format!("{:9.4} s {node}: {event} ({origin}{by}{whence})", at.as_secs_f64()));
    }
    while told.len() > most {
        told.pop_front();
    }
}
