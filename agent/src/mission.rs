//! Mission: what the vehicle is to do. The node with its b-threads and peers, the scripts, and how far the task has
//! come.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use skein_bp::script::Assignment;
use skein_bp::{Event, Program, ProgramConfig};
use skein_dbp::{Happened, Node, NodeConfig, NodeName};
use skein_wire::event::{
    self, Advance, Complete, Declared as _, Enter, Failed, Goto, Hold, Land, Load, OrderTaken, Return,
    ScriptNews, Takeoff, Unload, What,
};
use skein_wire::{
    Fleet, KeptScript, Limits, Link, MissionState, NodeLink, Readiness, State, Store, joint_roster,
};

use crate::{
    agent_error::AgentError,
    bthreads,
    config::AgentConfig,
    instruction::Instruction,
    me::Me,
    mind::Mind,
    precedence,
    report::Report,
    safety::safety_events,
    scripts::{Begins, CONFIGURATION, Circumstances, ScriptFacts, Scripts},
    verify::check_script,
};

/// How many states of a script and the vehicle's program are looked at before it runs: no more than there is time for
/// between two ticks. `skein-agent verify --script` looks at all.
const STATES_TRIED: usize = 500;
/// The checks before take-off are told this often, for those who have come since.
const READINESS_PERIOD: Duration = Duration::from_secs(1);

/// Why a script is not taken in that nobody sends.
const UNNAMED: &str = "the request names nobody: set `by` to the name of the person or program that makes it";

/// The outcome of a vehicle's mission.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It reached its last waypoint and landed.
    Complete,
    /// It did not, and this is why.
    Failed(String),
}

/// One vehicle's mission.
#[derive(Debug)]
pub struct Mission {
    config: Arc<AgentConfig>,
    me: Me,
    name: NodeName,
    node: NodeLink,
    mind: Box<dyn Mind>,
    scripts: Scripts,
    script_facts: ScriptFacts,
    task: String,
    outcome: Option<Outcome>,
    selections: Vec<Happened>,
    limits: Limits,
    /// The revision of the program that these are of.
    limits_of: Option<u64>,
    fault: Option<String>,
    told_readiness: Option<(Duration, Readiness)>,
}

impl Mission {
    /// The mission of a vehicle on the ground, decided by `mind`. What its node promises is kept in `store`, if there
    /// is one.
    pub fn new(
        config: Arc<AgentConfig>,
        mind: Box<dyn Mind>,
        store: Option<Box<dyn Store>>,
    ) -> Result<Self, AgentError> {
        let me = Me::new(&config.node);
        let node_config = node_config(&config, &me, store.is_some())?;
        let protected = node_config.safety.clone();
        let mut program = Program::new(ProgramConfig { protected, ..ProgramConfig::vehicle(config.seed) });
        mind.load(&mut program, &config);
        let mut scripts = Scripts::new(me.clone(), &config.roster, &config.events());
        for assignment in &config.scripts {
            scripts
                .load(&mut program, assignment, CONFIGURATION, Begins::WhenReleased)
                .and_then(|()| check_script(&config, assignment, STATES_TRIED))
                .map_err(|why| AgentError::Script { name: assignment.name().to_owned(), why })?;
        }
        let fleet = Fleet::new(&config.fleet)
            .map_err(|source| AgentError::Fleet { value: config.fleet.clone(), source })?;
        let name = node_config.name.clone();
        let node = Node::new(node_config, program);
        Ok(Self {
            node: match store {
                Some(store) => NodeLink::durable(node, fleet, store),
                None => NodeLink::new(node, fleet),
            },
            mind,
            scripts,
            script_facts: ScriptFacts::default(),
            task: "on the ground".to_owned(),
            outcome: None,
            selections: Vec::new(),
            limits: Limits::default(),
            limits_of: None,
            fault: None,
            told_readiness: None,
            name,
            me,
            config,
        })
    }

    /// Keeps the scripts that are sent in `store`, and runs those again that were `kept`.
    pub fn keep_scripts(&mut self, store: Box<dyn Store<Vec<KeptScript>>>, kept: &[KeptScript]) {
        for KeptScript { from, assignment } in kept {
            let outcome = self
                .admit(assignment, from, Begins::WhenReleased)
                .map_err(|why| format!("it was kept from the agent's last life, and passes no more: {why}"));
            self.node.node_mut().enqueue(self.scripts.verdict(assignment.name(), outcome));
        }
        self.scripts.keep_in(store);
    }

    /// Takes in an order of whoever is at this vehicle's own computer.
    pub fn order(&mut self, what: What) {
        self.node
            .node_mut()
            .enqueue(OrderTaken::plain(what, "the vehicle's own computer").given_aboard().at(&self.name));
    }

    /// Takes in what other nodes say; gives back what vehicles say of themselves.
    pub fn receive(&mut self, now: Duration, link: &mut dyn Link) -> Vec<State> {
        self.node.receive(now, link);
        self.node.take_states()
    }

    /// What vehicles have said of their checks before take-off since the last call.
    pub fn take_readiness(&mut self) -> Vec<Readiness> {
        self.node.take_readiness()
    }

    /// Tells the others of this vehicle's checks before take-off, if that is due: every second, and when one has
    /// changed its state.
    pub fn put_readiness(&mut self, now: Duration, readiness: Readiness, link: &mut dyn Link) {
        let states = |said: &Readiness| said.checks.iter().map(|check| check.state).collect::<Vec<_>>();
        let told = self.told_readiness.as_ref();
        if told.is_none_or(|(at, told)| now >= *at + READINESS_PERIOD || states(told) != states(&readiness)) {
            self.node.put_readiness(&readiness, link);
            self.told_readiness = Some((now, readiness));
        }
    }

    /// Says to other nodes what is due.
    pub fn send(&mut self, link: &mut dyn Link) {
        self.node.send(link);
    }

    /// Tells what each b-thread waits for, if that is due.
    pub fn put_board(&mut self, now: Duration, link: &mut dyn Link) {
        self.node.put_board(now, link);
    }

    /// Tells the others where this vehicle is and how far its task has come. `state` is that of its body.
    pub fn put_state(&mut self, state: State, complaint: Option<String>, link: &mut dyn Link) {
        let holder = self.node.node().program().state_of::<bthreads::Holder>(bthreads::Holder::NAME);
        let name = |name: Option<&str>| name.unwrap_or_default().to_owned();
        let state = State {
            holder: name(holder.and_then(bthreads::Holder::holder)),
            asked_by: name(holder.and_then(bthreads::Holder::asked_by)),
            incarnation: self.config.incarnation,
            task: self.task.clone(),
            waiting_for: self.waiting_for(complaint),
            mission: match &self.outcome {
                None => MissionState::UnderWay,
                Some(Outcome::Complete) => MissionState::Complete,
                Some(Outcome::Failed(_)) => MissionState::Failed,
            },
            scripts: self.scripts.running().map(|(name, _)| name.to_owned()).collect(),
            ..state
        };
        self.node.put_state(&state, link);
    }

    /// Tells whoever decides what control has found out.
    pub fn hear(&mut self, now: Duration, report: Report) {
        if matches!(report, Report::Planned { .. } | Report::Unplannable { .. }) {
            self.script_facts.forget_path();
        }
        // A script that has slept so far begins to listen now.
        if matches!(report, Report::Ready | Report::Airborne) {
            self.script_facts.forget();
        }
        self.mind.hear(now, report.into_event(&self.me), self.node.node_mut());
    }

    /// Tells whoever listens what is told to nobody else.
    pub fn tell_scripts(&mut self, circumstances: &Circumstances<'_>) {
        let is_heard =
            |fact: &str| self.scripts.listen_to(fact) || self.config.behaviours.hear(self.me.name(), fact);
        for event in self.script_facts.tell(&self.me, is_heard, circumstances) {
            self.node.node_mut().enqueue(event);
        }
    }

    /// Tries again to keep the scripts that could not be kept.
    pub fn catch_up(&mut self, now: Duration) {
        self.scripts.catch_up(now);
    }

    /// One step of whoever decides: what happened, in order.
    pub fn decide(&mut self, now: Duration) -> Vec<Happened> {
        if let Err(error) = self.node.node_mut().step(now) {
            // Without fresh leave the vehicle hovers; its b-threads may yet recover.
            self.fault = Some(error.to_string());
        }
        self.mind.decide(now, self.node.node_mut())
    }

    /// The limits on the vehicle's motion that its b-threads state now.
    pub fn limits(&mut self) -> &Limits {
        let program = self.node.node().program();
        if self.limits_of != Some(program.revision()) {
            self.limits_of = Some(program.revision());
            self.limits = Limits::of(self.me.name(), program.stated());
        }
        &self.limits
    }

    /// Takes in one thing that happened; gives back what control has to do then.
    pub fn follow(&mut self, happened: &Happened, is_landing: bool) -> Option<Instruction> {
        if happened.home != self.name {
            return None;
        }
        self.note_task(&happened.event, is_landing);
        self.look_after_scripts(happened);
        Instruction::of(&self.me, &happened.event)
    }

    /// Keeps what happened for [`take_selections`](Self::take_selections).
    pub fn record(&mut self, happened: Vec<Happened>) {
        self.selections.extend(happened);
    }

    fn note_task(&mut self, event: &Event, is_landing: bool) {
        let why = event::why(event).unwrap_or_default();
        self.task = match self.me.verb(event) {
            Some(Takeoff::NAME) => "taking off".to_owned(),
            Some(Goto::NAME) => match Goto::read(event).map_or(0, |goto| goto.leg) {
                bthreads::HOME_LEG => "flying home".to_owned(),
                bthreads::OPERATOR_LEG => "going where the operator points".to_owned(),
                leg => format!("leg {} of {}", leg + 1, self.config.waypoints.len()),
            },
            Some(Hold::NAME) => "holding".to_owned(),
            Some(Return::NAME) if !is_landing => format!("returning: {why}"),
            Some(Land::NAME) => format!("landing: {why}"),
            Some(Complete::NAME) => {
                self.outcome = Some(Outcome::Complete);
                "arrived".to_owned()
            }
            Some(Failed::NAME) => {
                self.outcome = Some(Outcome::Failed(why.to_owned()));
                why.to_owned()
            }
            _ => return,
        };
    }

    /// Runs the scripts that are sent, and answers what cannot be done.
    fn look_after_scripts(&mut self, happened: &Happened) {
        let event = &happened.event;
        let verdict = match self.me.verb(event) {
            Some(Load::NAME) => {
                let (name, outcome) = self.load_script(happened);
                self.scripts.verdict(&name, outcome)
            }
            Some(Unload::NAME) => {
                let Some(Unload { name, by }) = Unload::read(event) else { return };
                let why = match (self.scripts.runs(&name), by) {
                    (true, Some(_)) => return,
                    (true, None) => UNNAMED,
                    (false, _) => "no script of this name runs",
                };
                self.scripts.verdict(&name, Err(why.to_owned()))
            }
            Some(ScriptNews::NAME) => return self.scripts.hear(event),
            _ => return,
        };
        self.node.node_mut().enqueue(verdict);
    }

    /// Runs a script that is sent; gives back its name, and why it is not run if it is not.
    fn load_script(&mut self, happened: &Happened) -> (String, Result<(), String>) {
        let Some(Load { script, by, .. }) = Load::read(&happened.event) else {
            return (String::new(), Err("it holds no script".to_owned()));
        };
        let assignment = match Assignment::from_json(&script) {
            Ok(assignment) => assignment,
            Err(error) => return (String::new(), Err(error.to_string())),
        };
        if by.is_none() {
            return (assignment.name().to_owned(), Err(UNNAMED.to_owned()));
        }
        let sender = happened.requested_by.iter().find(|bthread| bthread.contains('#'));
        let from = sender.map_or(self.name.as_str(), |bthread| bthread).to_owned();
        let outcome = self.admit(&assignment, &from, Begins::AtOnce);
        (assignment.name().to_owned(), outcome)
    }

    /// Runs a script that `from` has sent, now or to a former life of this agent, if it passes all checks.
    fn admit(&mut self, assignment: &Assignment, from: &str, begins: Begins) -> Result<(), String> {
        if !self.may_send(assignment, from)? {
            let node = from.split_once('#').map_or(from, |(node, _)| node);
            return Err(format!(
                "{node} may not send scripts: that is for the ground station and its operators"
            ));
        }
        if !self.scripts.runs(assignment.name()) {
            check_script(&self.config, assignment, STATES_TRIED)?;
        }
        self.script_facts.forget();
        self.scripts.load(self.node.node_mut().program_mut(), assignment, from, begins)
    }

    /// Whether `from` has the right to send this script: the vehicle itself, or a b-thread of another node that is a
    /// member and no vehicle.
    fn may_send(&self, assignment: &Assignment, from: &str) -> Result<bool, String> {
        let Some((node, bthread)) = from.split_once('#') else { return Ok(from == self.name.as_str()) };
        let text = assignment.to_json().map_err(|error| error.to_string())?;
        let load = self.me.event(Load { name: None, script: text.into(), by: None });
        let is_member = self.config.roster.iter().any(|member| member == node);
        let may_request = |node| self.config.authority.may_request(&node, bthread, &load);
        Ok(is_member && !node.starts_with("uav/") && NodeName::new(node).is_ok_and(may_request))
    }

    /// The b-threads that keep this vehicle from moving on or taking off; `complaint` is control's, why it is not ready.
    pub fn waiting_for(&self, complaint: Option<String>) -> String {
        if let Some(fault) = &self.fault {
            return fault.clone();
        }
        if let Some(contradiction) = self.limits.contradiction() {
            return contradiction;
        }
        let question = self.me.any::<(Advance, Enter, Takeoff)>();
        let explanation = self.node.node().explain(question).local;
        // One whose mission is over needs not be ready, unless somebody wants it to fly again.
        if let Some(complaint) =
            complaint.filter(|_| self.outcome.is_none() || !explanation.requested.is_empty())
        {
            return complaint;
        }
        if explanation.requested.is_empty() {
            return String::new();
        }
        let blockers: BTreeSet<&str> = explanation.blocked.iter().map(|(bthread, _)| &**bthread).collect();
        blockers.into_iter().collect::<Vec<_>>().join(", ")
    }

    /// Everything that happened here or was heard of since the last call, in order.
    pub fn take_selections(&mut self) -> Vec<Happened> {
        std::mem::take(&mut self.selections)
    }

    pub fn name(&self) -> &NodeName {
        &self.name
    }

    pub fn node(&self) -> &NodeLink {
        &self.node
    }

    pub fn scripts(&self) -> &Scripts {
        &self.scripts
    }

    /// The vehicle's task, for people.
    pub fn task(&self) -> &str {
        &self.task
    }

    /// The outcome of the mission, once it has ended.
    pub fn outcome(&self) -> Option<&Outcome> {
        self.outcome.as_ref()
    }
}

/// The vehicle's node, as its configuration describes it.
fn node_config(config: &AgentConfig, me: &Me, durable: bool) -> Result<NodeConfig, AgentError> {
    let name = |field, value: &str| {
        NodeName::new(value).map_err(|source| AgentError::Name { field, value: value.to_owned(), source })
    };
    let roster: Vec<_> = config.roster.iter().map(|node| name("roster", node)).collect::<Result<_, _>>()?;
    let own_name = name("node", &config.node)?;
    let events = config.events();
    Ok(NodeConfig {
        lease: config.lease,
        safety: safety_events(me, &events),
        gateway: me.any_in(events.gateway()),
        // What comes from afar never outranks a vehicle's own b-threads for its safety.
        remote_priority: precedence::MISSION..=precedence::LINK,
        authority: config.authority.clone(),
        joint: Some(joint_roster(name("ground", &config.ground)?, &roster)),
        durable,
        kept: config.kept.clone(),
        ..NodeConfig::new(own_name, config.incarnation, roster)
    })
}
