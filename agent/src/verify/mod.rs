//! Verifies the program that flies: the very b-threads that [`load`](crate::bthreads::load) loads, with the world
//! around them abstracted.
//!
//! The world is a b-thread for each [`Part`] of it, which offers what autopilot, perception, planner, people and
//! other nodes may tell, in every order. A [`Scene`] puts some parts around the whole program; the verifier of
//! `skein_bp` looks at all its runs. What must hold are the [`requirements`], who may block a safety event, that
//! every burst of events comes to rest before an external event would have to come between, that nobody is stuck, and
//! that the ground stays within reach.

mod part;
mod requirement;
mod scene;
mod world;

use std::collections::BTreeSet;
use std::sync::Arc;

use skein_bp::behaviour::{Model, WORLD};
use skein_bp::script::{Assignment, Script};
use skein_bp::verify::{Coverage, Inspection, Progress, Report, Timers, Verifier, View};
use skein_bp::{BThread, Bid, Event, Program, ProgramConfig};
use skein_wire::NodeName;
use skein_wire::event::{
    Declaration, Declared as _, Goto, Hold, Homeward, Land, MakeWay, Plan, Return, SCRIPT_FACTS,
};

pub use self::part::{Part, Place};
pub use self::requirement::{Requirement, requirements};
pub use self::scene::Scene;
use self::scene::World;
use crate::agent_error::AgentError;
use crate::bthreads::{self, HOME_LEG, RIGHT_OF_WAY};
use crate::config::AgentConfig;
use crate::me::Me;
use crate::scripts::{Runner, Scripts};

/// The waypoints of a mission that are flown: the first and the last, between which all others are alike.
const MOST_WAYPOINTS: usize = 2;
/// On a vehicle an external event gets its turn after so many internal ones.
const LONGEST_BURST: u32 = 16;
/// Name of the part of the world that is the flight.
const FLIGHT: &str = "world/flight";

const SAFETY_RULE: &str = "nobody blocks a safety event but who goes before it";

/// Which b-threads may block an event that is for the vehicle's safety; nobody may block those that are not named.
/// `goto` is that to home.
const MAY_BLOCK: [(&str, &[&str]); 7] = [
    (Hold::NAME, &["pilot"]),
    (Land::NAME, &["pilot"]),
    // An empty battery does not carry it home.
    (Return::NAME, &["pilot", "battery"]),
    (Goto::NAME, &["pilot", "battery", "found_airborne"]),
    (Plan::NAME, &["pilot"]),
    (MakeWay::NAME, &["pilot"]),
    (
        Homeward::NAME,
        &["pilot", "positioning", "separation", "obstacle_avoidance", RIGHT_OF_WAY, "found_airborne"],
    ),
];

/// A vehicle's program under verification.
#[derive(Debug)]
pub struct VehicleVerifier {
    me: Me,
    /// With no more waypoints and nodes than are told apart.
    config: AgentConfig,
    program: Program,
    scripts: Vec<(Arc<str>, Script)>,
    most_states: usize,
    left_out: Vec<String>,
}

/// Looks for a fault of a script together with the vehicle's program, in no more than so many states around the
/// vehicle's first flight.
pub fn check_script(config: &AgentConfig, script: &Assignment, most_states: usize) -> Result<(), String> {
    let config = AgentConfig { scripts: vec![script.clone()], ..config.clone() };
    let verifier = VehicleVerifier::new(&config).map_err(|error| match error {
        AgentError::Script { why, .. } => why,
        error => error.to_string(),
    })?;
    match verifier.most_states(most_states).verify(Scene::Scripts, |_| {}).report.verdict {
        None => Ok(()),
        Some(violation) => Err(format!("with the vehicle's program: {violation}")),
    }
}

/// The result of one scene.
#[derive(Clone, Debug)]
pub struct SceneReport {
    pub scene: Scene,
    /// The verdict, how much was looked at, and what was not.
    pub report: Report,
    /// The parts of the program that were met.
    pub coverage: Coverage,
}

/// The parts of a program that no scene has met.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NotCovered {
    /// Events that b-threads wait for and that never happened, each with those b-threads.
    pub never_told: Vec<(String, Vec<Arc<str>>)>,
    /// Events that b-threads requested and that never happened.
    pub never_selected: Vec<Event>,
    /// The behaviour that the model of the world leaves out.
    pub left_out: Vec<String>,
}

impl VehicleVerifier {
    /// Of the program of this configuration, its scripts included.
    ///
    /// # Errors
    /// [`AgentError::Script`]: a script is not run, because it exceeds its rights or blocks something for ever by
    /// itself.
    pub fn new(config: &AgentConfig) -> Result<Self, AgentError> {
        let me = Me::new(&config.node);
        let mut left_out = vec![
            "time: a deadline may fire whenever the program rests, also before an earlier one; two never at once".to_owned(),
            "other data than the places and reasons that the world's parts offer".to_owned(),
        ];
        let config = reduced(config, &mut left_out);
        // The world waits for the program to rest, which it must within `LONGEST_BURST`.
        let mut program = Program::new(ProgramConfig { externals_after: None, ..ProgramConfig::vehicle(0) });
        bthreads::load(&mut program, &config);
        let examiner = Scripts::new(me.clone(), &config.roster, &config.events());
        let mut scripts = Vec::new();
        for assignment in &config.scripts {
            let refused = |why| AgentError::Script { name: assignment.name().to_owned(), why };
            let script = examiner.examine(assignment).map_err(refused)?;
            let name = program.add(Runner::bthread_name(&script.name), examiner.runner(&script).unpaced());
            scripts.push((name, script.bthread));
        }
        Ok(Self { me, config, program, scripts, most_states: usize::MAX, left_out })
    }

    /// Adds a b-thread to the program.
    #[must_use]
    pub fn with_bthread(mut self, name: &str, bthread: impl BThread) -> Self {
        self.program.add(name, bthread);
        self
    }

    /// Takes a b-thread out of the program: does what it is for fail without it?
    #[must_use]
    pub fn without_bthread(mut self, name: &str) -> Self {
        self.program.remove(name);
        self
    }

    /// Looks at no more states in one scene.
    #[must_use]
    pub fn most_states(mut self, states: usize) -> Self {
        self.most_states = states;
        self
    }

    /// The vehicle's node name.
    pub fn vehicle(&self) -> &str {
        self.me.name()
    }

    /// The rules that are checked, in words.
    pub fn rules(&self) -> impl Iterator<Item = String> {
        let general = [
            "no deadlock; nobody is hot for ever; every burst comes to rest",
            SAFETY_RULE,
            "the ground stays within reach",
        ];
        let requirements = requirements(&self.me, &self.config.fence).into_iter();
        let held = self.held_by_scripts().map(|(name, event)| goal_of_script(&name, &event));
        let mut program = self.program.clone();
        let mut brought = Model::new(&mut program);
        self.config.behaviours.model(&self.config.host(), &mut brought);
        let brought: Vec<String> = brought.rules().iter().map(|rule| rule.to_string()).collect();
        let requirements = requirements.map(|requirement| requirement.name().to_owned()).chain(brought);
        general.into_iter().map(str::to_owned).chain(requirements).chain(held)
    }

    /// The scenes that are of interest for this program.
    pub fn scenes(&self) -> impl Iterator<Item = Scene> + use<> {
        let has_scripts = !self.scripts.is_empty();
        Scene::ALL.iter().copied().filter(move |scene| *scene != Scene::Scripts || has_scripts)
    }

    /// Looks at all runs of one scene.
    pub fn verify(&self, scene: Scene, on_progress: impl FnMut(&Progress) + 'static) -> SceneReport {
        let (report, coverage) = self.verifier(scene).on_progress(on_progress).run_and_cover();
        SceneReport { scene, report, coverage }
    }

    /// The verification of one scene, to be run or drawn.
    pub fn verifier(&self, scene: Scene) -> Verifier {
        let mut program = self.program.clone();
        for requirement in requirements(&self.me, &self.config.fence) {
            program.add(requirement.name(), requirement.clone());
        }
        let mut model = Model::new(&mut program);
        self.config.behaviours.model(&self.config.host(), &mut model);
        let mut outside = model.world().to_vec();
        let facts = self.script_facts();
        let me = self.me.name();
        let other = self.config.roster.iter().find(|node| node.starts_with("uav/") && *node != me);
        let name = |node: &String| NodeName::new(node).ok();
        let (other, ground) = (other.and_then(name), name(&self.config.ground));
        let world = World {
            me: &self.me,
            config: &self.config,
            other: other.as_ref(),
            ground: ground.as_ref(),
            script_facts: &facts,
        };
        for (name, part) in scene.parts(&world) {
            let name = program.add(name, part);
            if name.starts_with(WORLD) {
                outside.push(name);
            }
        }
        let (me, [x, y, _]) = (self.me.clone(), self.config.home);
        let z = self.config.return_altitude_m;
        let home = me.event(Goto { leg: HOME_LEG, lands: true, x, y, z });
        let own: Vec<_> = self.config.events().own().collect();
        let mut verifier = Verifier::new(program)
            .inspect(Inspection::USUAL.into_iter().chain([Inspection::Unsettled]))
            .timers(Timers::AtRest)
            .most_states(self.most_states)
            .world(outside)
            .every_bid(SAFETY_RULE, move |bthread, bid| blocks_safety(&me, &own, &home, bthread, bid))
            .always_within_reach("the ground", is_down);
        for (name, event) in self.held_by_scripts() {
            let goal = goal_of_script(&name, &event);
            verifier = verifier.always_within_reach(goal, move |view| !is_blocked_by(view, &name, &event));
        }
        verifier
    }

    /// The parts that the scenes together have not met.
    pub fn not_covered(&self, scenes: &[SceneReport]) -> NotCovered {
        let mut coverage = Coverage::default();
        scenes.iter().for_each(|scene| coverage.join(scene.coverage.clone()));
        let own = |name: &&Arc<str>| !name.starts_with(WORLD) && !name.contains('#');
        let threads: Vec<_> = coverage.bthreads.iter().filter(|(name, _)| own(name)).collect();
        let events = self.config.events();
        let names = events.at_vehicle().map(|event| self.me.event_name(event.name));
        let untold = names.filter(|name| !coverage.happened.iter().any(|event| event.name() == name));
        let never_told = untold.filter_map(|name| {
            let waits =
                |bid: &Bid| bid.waits().may_hold_named(&name) || bid.interrupts().may_hold_named(&name);
            let is_requirement = |thread: &str| thread.contains(' ');
            let waiting = threads
                .iter()
                .filter(|(thread, seen)| !is_requirement(thread) && seen.bids.iter().any(waits));
            let waiting: Vec<Arc<str>> = waiting.map(|(thread, _)| (*thread).clone()).collect();
            (!waiting.is_empty()).then_some((name, waiting))
        });
        let requested = threads.iter().flat_map(|(_, seen)| &seen.bids).flat_map(Bid::requests);
        let never_selected: BTreeSet<&Event> =
            requested.filter(|event| !coverage.happened.contains(*event)).collect();
        let mut left_out = self.left_out.clone();
        let bursts = scenes.iter().filter_map(|scene| scene.report.longest_burst);
        if let Some(longest) = bursts.max().filter(|longest| *longest > LONGEST_BURST) {
            left_out.push(format!(
                "external events that come after {LONGEST_BURST} internal ones, before the program rests: it may select {longest} in a row"
            ));
        }
        NotCovered {
            never_told: never_told.collect(),
            never_selected: never_selected.into_iter().cloned().collect(),
            left_out,
        }
    }

    /// The events that only scripts listen to.
    fn script_facts(&self) -> BTreeSet<Event> {
        let told = self.me.any_in(SCRIPT_FACTS);
        let is_told = |event: &Event| told.contains(event) || !event.name().starts_with(self.me.name());
        self.scripts.iter().flat_map(|(_, script)| script.listened_to()).filter(is_told).collect()
    }

    /// The events that scripts may block, each with the b-thread's name.
    fn held_by_scripts(&self) -> impl Iterator<Item = (Arc<str>, Event)> {
        self.scripts
            .iter()
            .flat_map(|(name, script)| script.blocked().into_iter().map(|event| (name.clone(), event)))
    }
}

/// A configuration with no more waypoints and nodes than b-threads tell apart.
fn reduced(config: &AgentConfig, left_out: &mut Vec<String>) -> AgentConfig {
    let mut config = config.clone();
    let waypoints = config.waypoints.len();
    if waypoints > MOST_WAYPOINTS {
        config.waypoints.drain(1..waypoints - 1);
        config.errands.clear();
        left_out.push(format!(
            "waypoints 2 to {} of {waypoints}, which are flown to as the first",
            waypoints - 1
        ));
    }
    let mut vehicles = 0;
    let before = config.roster.len();
    let (me, ground) = (config.node.clone(), config.ground.clone());
    config.roster.retain(|node| {
        vehicles += usize::from(node.starts_with("uav/") && *node != me);
        *node == me || *node == ground || node.starts_with("uav/") && vehicles == 1
    });
    if config.roster.len() < before {
        let kept = config.roster.join(", ");
        left_out.push(format!("nodes of the roster beside {kept}"));
    }
    config
}

fn is_down(view: &View<'_>) -> bool {
    view.state_of::<Part>(FLIGHT)
        .is_some_and(|flight| [world::ON_THE_GROUND, world::UNHEARD_OF].contains(&flight.place()))
}

/// The goal of a script that blocks something: to let it happen.
fn goal_of_script(bthread: &str, event: &Event) -> String {
    format!("`{bthread}` lets {event} happen")
}

fn is_blocked_by(view: &View<'_>, bthread: &str, event: &Event) -> bool {
    view.bids().any(|(name, bid)| name == bthread && bid.blocks().contains(event))
}

/// Whether a b-thread of the vehicle blocks what it must not.
fn blocks_safety(
    me: &Me,
    own: &[&Declaration],
    home: &Event,
    bthread: &str,
    bid: &Bid,
) -> Result<(), String> {
    if bthread.starts_with(WORLD) || bid.blocks().is_none() {
        return Ok(());
    }
    let may =
        |verb: &str| MAY_BLOCK.iter().any(|(named, bthreads)| *named == verb && bthreads.contains(&bthread));
    if bid.blocks().contains(home) && !may(Goto::NAME) {
        return Err(format!("`{bthread}` blocks the way home, {home}"));
    }
    let blocked = |verb: &str| bid.blocks().may_hold_named(&me.event_name(verb));
    match own.iter().map(|event| event.name).find(|verb| blocked(verb) && !may(verb)) {
        Some(verb) => Err(format!("`{bthread}` blocks `{}`", me.event_name(verb))),
        None => Ok(()),
    }
}
