//! A swarm that flies in lockstep with a hostile member in its fleet, judged after each tick.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use skein_agent::Outcome;
use skein_bp::{Bound, Event, EventSet};
use skein_dbp::{Authority, Happened, NodeName};
use skein_sim::cli::Controller;
use skein_sim::fly::{self, FLEET, GROUND, Links, Swarm, node_name, vehicle_name};
use skein_sim::scenario::Scenario;
use skein_wire::event::{Declared as _, OrderTaken, SWARM};
use skein_wire::{Fleet, Link, Network, NetworkConfig, NodeLink, standard_authority};
use skein_world::{STEP, Simulation};

use super::content::beyond;
use super::cost::{Cost, Used, Worst, note};
use super::mouth::{Mouth, Said};
use super::story::{LAST_TICK, Rank, Story};

/// Vehicles that have a mission.
pub const FLYING: usize = 3;
const STEPS_PER_TICK: u32 = 5;
/// Time in which they must have arrived beside a vehicle that lies.
const PATIENCE: Duration = Duration::from_secs(90);
/// An operator may hold and land by right: only cost and safety are judged, for as long as it speaks and a little more.
const OPERATOR_END: Duration = Duration::from_millis(20 * LAST_TICK + 2000);
/// Least distance between two centres, m; the filter asks for 1.4 m.
const LEAST_SEPARATION_M: f64 = 1.0;
/// Who lands farther from its goal than this has landed early, m.
pub const AT_GOAL_M: f64 = 1.5;
/// Higher than this above its pad a vehicle has taken off, m.
const ALOFT_M: f64 = 1.0;

/// Events of each home whose blocks are judged.
const OWN_EVENTS: [&str; 11] = [
    "advance",
    "takeoff",
    "goto",
    "order",
    "handover",
    "land",
    "hold",
    "hand_back",
    "enter",
    "load",
    "roster",
];
/// Joint events, likewise.
const JOINT_EVENTS: [&str; 2] = ["launch", "abort"];

/// What a hostile member has brought about and may not.
#[derive(Debug, Clone, PartialEq)]
pub struct Violation {
    /// A word: a bound, a count, or what has happened.
    pub kind: String,
    pub at: Duration,
    pub node: NodeName,
    pub what: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {:.2} s, {}: {}", self.kind, self.at.as_secs_f64(), self.node, self.what)
    }
}

/// The account of one flight.
#[derive(Debug)]
pub struct Flown {
    pub violation: Option<Violation>,
    pub said: Said,
    pub worst: Worst,
    pub min_separation_m: Option<f64>,
    pub end: Duration,
}

/// Flies until all have arrived, or something is violated.
///
/// # Errors
/// A fault in the scenario.
pub fn fly(story: &Story) -> anyhow::Result<Flown> {
    let mut flight = Flight::new(story)?;
    let end = match story.rank {
        Rank::Vehicle => PATIENCE,
        Rank::Operator | Rank::Crowd => OPERATOR_END,
    };
    let mut violation = None;
    while violation.is_none() && flight.swarm.now() < end && !flight.is_over() {
        violation = flight.tick();
    }
    let violation = violation.or_else(|| flight.judge_end(end));
    Ok(Flown {
        violation,
        said: flight.mouth.said,
        worst: flight.worst,
        min_separation_m: flight.swarm.truth().min_separation_m,
        end: flight.swarm.now(),
    })
}

struct Flight<'a> {
    story: &'a Story,
    swarm: Swarm,
    network: Network,
    mouth: Mouth,
    member: NodeName,
    /// The vehicles with a mission, then the ground station.
    honest: Vec<NodeName>,
    goals: Vec<[f64; 2]>,
    authority: Authority,
    costs: BTreeMap<NodeName, Cost>,
    /// The repeated occurrences of each home, and when they were counted last.
    repeats: BTreeMap<NodeName, (Used, Duration)>,
    worst: Worst,
    has_flown: [bool; FLYING],
    tick: u64,
}

impl<'a> Flight<'a> {
    fn new(story: &'a Story) -> anyhow::Result<Self> {
        let goals = goals(story.seed);
        let scenario = scenario(story, &goals)?;
        let network = Network::new(NetworkConfig::default(), scenario.seed);
        let count = scenario.vehicles.len();
        let link = |node: &NodeName| Box::new(network.join(node)) as Box<dyn Link>;
        let links = Links {
            vehicles: (0..count).map(|index| link(&vehicle_name(index))).collect(),
            ground: link(&GROUND),
        };
        let mut agents = fly::agent_configs(&scenario);
        if story.rank == Rank::Crowd {
            agents.iter_mut().for_each(|agent| agent.roster = Vec::new());
        }
        let mut swarm = Swarm::new(
            Simulation::new(fly::simulation_config(&scenario)),
            agents,
            fly::ground_config(&scenario, Fleet::new(FLEET)?, Controller::Bp),
            links,
        )?;
        let member = match story.rank {
            Rank::Vehicle => vehicle_name(FLYING),
            Rank::Operator => node_name("script", "operator"),
            Rank::Crowd => node_name("uav", "crowd"),
        };
        network.leave(&member);
        swarm.kill_agent(FLYING);
        let honest: Vec<NodeName> = (0..FLYING).map(vehicle_name).chain([GROUND.clone()]).collect();
        let place = swarm.simulation().vehicle(FLYING).map(|state| state.motion.position).unwrap_or_default();
        let own = Box::new(network.join(&member));
        let mouth = Mouth::new(member.clone(), story.rank, own, honest.clone(), place)?;
        Ok(Self {
            story,
            swarm,
            network,
            mouth,
            member,
            costs: honest.iter().map(|node| (node.clone(), Cost::default())).collect(),
            honest,
            goals,
            authority: standard_authority(),
            repeats: BTreeMap::new(),
            worst: Worst::new(),
            has_flown: [false; FLYING],
            tick: 0,
        })
    }

    fn is_over(&self) -> bool {
        self.story.rank == Rank::Vehicle
            && self.tick > LAST_TICK
            && self.swarm.outcomes().take(FLYING).all(|outcome| outcome.is_some())
    }

    /// One tick of all; gives what it has violated.
    fn tick(&mut self) -> Option<Violation> {
        self.tick += 1;
        if self.tick <= LAST_TICK {
            self.mouth.speak(self.tick, &self.story.habits);
        } else {
            self.mouth.speak(self.tick, &[]);
        }
        let mut happened = Vec::new();
        for _ in 0..STEPS_PER_TICK {
            self.network.advance(self.swarm.now() + STEP);
            happened.append(&mut self.swarm.step().selections);
        }
        self.judge_content()
            .or_else(|| self.judge_rights(&happened))
            .or_else(|| self.judge_cost(&happened))
            .or_else(|| self.judge_flight())
    }

    fn found(&self, kind: impl Into<String>, node: &NodeName, what: String) -> Violation {
        Violation { kind: kind.into(), at: self.swarm.now(), node: node.clone(), what }
    }

    fn judge_content(&self) -> Option<Violation> {
        let (bound, given) = self.mouth.taken.iter().find_map(beyond)?;
        let what =
            format!("a message of {given} {} was let through, at most {}", bound.unit(), bound.stated());
        Some(self.found(bound.word(), &self.member, what))
    }

    /// Nobody does what the member has no right to.
    fn judge_rights(&self, happened: &[Happened]) -> Option<Violation> {
        let own = |name: &str| {
            let bthread = name.split_once('#').filter(|(node, _)| *node == self.member.as_str());
            bthread.map(|(_, bthread)| bthread.to_owned())
        };
        let wrong = happened.iter().find_map(|one| {
            let bthread = one.requested_by.iter().find_map(|name| own(name));
            let is_wrong = match bthread {
                Some(bthread) => !self.authority.may_request(&self.member, &bthread, &one.event),
                None => {
                    self.story.rank == Rank::Vehicle
                        && one.event.kind() == OrderTaken::NAME
                        && one.home != *GROUND
                }
            };
            is_wrong.then(|| self.found("right_to_request", &one.home, one.event.to_string()))
        });
        let blocks = |name: &NodeName, node: &NodeLink| {
            let mut proxies = node.node().program().proxies();
            proxies.find_map(|(proxy, bid)| self.wrongly_blocked(name, proxy, &own(proxy)?, bid.blocks()))
        };
        wrong.or_else(|| {
            let found = self.nodes().find_map(|(name, node)| Some((name, blocks(name, node)?)));
            found.map(|(name, what)| self.found("right_to_block", name, what))
        })
    }

    /// An event of this home that is in a block and that the member may not block.
    fn wrongly_blocked(
        &self,
        home: &NodeName,
        proxy: &str,
        bthread: &str,
        block: &EventSet,
    ) -> Option<String> {
        let joint = JOINT_EVENTS.iter().map(|event| format!("{SWARM}/{event}"));
        let names = OWN_EVENTS.iter().map(|event| home.event_name(event)).chain(joint);
        let mut events = names.map(Event::new).filter(|event| block.contains(event));
        let wrong = events.find(|event| {
            !self.authority.may_block(&self.member, bthread, &EventSet::Exactly(event.clone()))
        })?;
        Some(format!("{proxy} blocks {wrong}"))
    }

    fn nodes(&self) -> impl Iterator<Item = (&NodeName, &NodeLink)> {
        let agents = self.swarm.agents().take(FLYING).map(skein_agent::AgentCore::node);
        self.honest.iter().zip(agents.chain([self.swarm.ground().node()]))
    }

    fn judge_cost(&mut self, happened: &[Happened]) -> Option<Violation> {
        let now = self.swarm.now();
        let (mut worst, mut costs) = (std::mem::take(&mut self.worst), std::mem::take(&mut self.costs));
        let mut found = Vec::new();
        for (name, node) in self.nodes() {
            let here: Vec<&Happened> = happened.iter().filter(|one| one.home == *name).collect();
            let beyond =
                costs.entry(name.clone()).or_default().look(now, node, &self.member, &here, &mut worst);
            found.extend(beyond.into_iter().map(|beyond| (name.clone(), beyond)));
            if self.tick.is_multiple_of(25) {
                let rows = node.node().board().rows;
                let prefix = format!("{}#", self.member);
                let rows = rows.iter().filter(|row| row.bthread.starts_with(&prefix)).count();
                let beyond = note(&mut worst, "board_rows", rows as u64, Bound::BoardRows.stated());
                found.extend(beyond.map(|beyond| (name.clone(), beyond)));
            }
        }
        for agent in self.swarm.agents().take(FLYING) {
            // In a fleet without a roster nobody is known by name.
            let known = agent.known_vehicles() as u64;
            let beyond = note(&mut worst, "strangers", known, Bound::Strangers.stated());
            found.extend(beyond.map(|beyond| (agent.name().clone(), beyond)));
        }
        for (name, repeated) in std::mem::take(&mut self.mouth.repeated) {
            let (used, at) = self.repeats.entry(name.clone()).or_default();
            let passed = now - std::mem::replace(at, now);
            let used = used.add(repeated, Bound::RepeatsPerSecond.stated(), passed);
            let beyond = note(&mut worst, "repeated", used, Bound::RepeatsAtOnce.stated());
            found.extend(beyond.map(|beyond| (name, beyond)));
        }
        (self.worst, self.costs) = (worst, costs);
        let (name, (count, counted)) = found.into_iter().next()?;
        Some(self.found(count, &name, format!("{}, at most {}", counted.most, counted.stated)))
    }

    /// Nobody touches anything, comes too near to another, or lands elsewhere than at its goal.
    fn judge_flight(&mut self) -> Option<Violation> {
        let truth = self.swarm.truth();
        let collisions = truth.collisions_vehicle + truth.collisions_obstacle;
        if collisions > 0 {
            return Some(self.found("collision", &self.member, format!("{collisions} collisions")));
        }
        if let Some(near) = truth.min_separation_m.filter(|near| *near < LEAST_SEPARATION_M) {
            return Some(self.found(
                "separation",
                &self.member,
                format!("{near:.2} m from centre to centre"),
            ));
        }
        for index in 0..FLYING {
            let Some(state) = self.swarm.simulation().vehicle(index) else { continue };
            let (place, airborne) = (state.motion.position, state.airborne);
            self.has_flown[index] |= place.z > ALOFT_M;
            let [x, y] = self.goals[index];
            let off = (place.x - x).hypot(place.y - y);
            if self.story.rank == Rank::Vehicle && self.has_flown[index] && !airborne && off > AT_GOAL_M {
                return Some(self.found(
                    "landed_early",
                    &vehicle_name(index),
                    format!("{off:.1} m from its goal"),
                ));
            }
        }
        None
    }

    /// Everybody has arrived, and what was too long was not read.
    fn judge_end(&self, end: Duration) -> Option<Violation> {
        let now = self.swarm.now();
        let arrived = self.swarm.outcomes().take(FLYING).map(|outcome| outcome == Some(&Outcome::Complete));
        let late = arrived.zip(self.swarm.agents()).find(|(arrived, _)| !arrived);
        if let Some((_, agent)) = late.filter(|_| self.story.rank == Rank::Vehicle) {
            let what = format!("not arrived after {} s: {:?}", end.as_secs(), agent.status(now));
            return Some(self.found("not_arrived", agent.name(), what));
        }
        let read = self.nodes().find_map(|(name, node)| {
            let (_, stats) = node.senders().find(|(name, _)| *name == Some(&self.member))?;
            let sent = *self.mouth.too_long.get(name)?;
            (stats.oversized < sent).then_some((name, stats.oversized, sent))
        });
        read.map(|(name, passed_over, sent)| {
            let what =
                format!("{sent} messages were longer than their kind may be, {passed_over} were not read");
            self.found("message_bytes", name, what)
        })
    }
}

/// Where each flies to, m: their ways cross, in an order that the seed gives.
pub fn goals(seed: u64) -> Vec<[f64; 2]> {
    let order = [[0, 1, 2], [1, 0, 2], [2, 1, 0], [0, 2, 1], [1, 2, 0], [2, 0, 1]][seed as usize % 6];
    order.map(|lane| [14.0, 5.0 * f64::from(lane)]).to_vec()
}

/// The world and the missions.
///
/// # Errors
/// None that a seed brings about.
pub fn scenario(story: &Story, goals: &[[f64; 2]]) -> anyhow::Result<Scenario> {
    let lanes = goals.iter().zip(0..).map(|([x, y], lane)| {
        let from = 5.0 * f64::from(lane);
        format!("[[vehicle]]\nstart_m = [0.0, {from:.1}]\nwaypoints_m = [[{x:.1}, {y:.1}, 3.0]]\n")
    });
    let member = match story.rank {
        Rank::Vehicle => "[[vehicle]]\nstart_m = [0.0, 18.0]\nwaypoints_m = [[14.0, 18.0, 3.0]]\n",
        Rank::Operator | Rank::Crowd => "",
    };
    let text = lanes.collect::<String>() + member;
    Ok(Scenario::from_toml(&text, "hostile.toml", None, story.seed)?)
}
