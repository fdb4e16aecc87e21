//! Mission: what the vehicle is to do. The node with its b-threads and peers, the scripts, and how far the task has
//! come.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use nalgebra::Vector3;
use skein_bp::script::Assignment;
use skein_bp::{Event, Program, ProgramConfig};
use skein_dbp::facts::{PeerJoined, PeerLost};
use skein_dbp::{Happened, Node, NodeConfig, NodeName};
use skein_wire::event::{
    self, Advance, Arrived, Complete, Declared as _, Declined, Enter, Failed, Goto, Hold, Land, Load,
    OrderTaken, PlaceFree, PlaceTaken, Planned, Rerouted, Return, Right, ScriptNews, Takeoff, Text, Unload,
    Unplannable, What,
};
use skein_wire::{
    Fleet, KeptScript, Limits, Link, MissionState, NodeLink, Readiness, Route, State, Store, Zone,
    joint_roster,
};

use crate::{
    agent_error::AgentError,
    apart::Words,
    arrival, bthreads,
    config::AgentConfig,
    drawn::DrawnZones,
    instruction::{Instruction, Waypoint},
    me::Me,
    mind::Mind,
    precedence,
    report::Report,
    reroute,
    safety::safety_events,
    scripts::{Begins, CONFIGURATION, Circumstances, Loaded, ScriptFacts, Scripts},
    verify::check_script,
    way_on::WayOn,
};

/// How many states of a script and the vehicle's program are looked at before it runs: no more than there is
/// time for. `skein-agent verify --script` looks at all.
const STATES_TRIED: usize = 500;

/// What a task is told with while another vehicle has the place where it ends, and who that is.
const BESIDE: &str = ", waiting beside it: ";

/// What a task is told with while a zone keeps the vehicle from it.
const WAITS_FOR: &str = ", waiting for the zone ";

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
    /// The points that the mission leads to, metres ENU, and who has sent them, if they are not those of the
    /// configuration.
    waypoints: Vec<[f64; 3]>,
    sent_by: Option<Text>,
    /// The route that it was sent, and the number of the point that it flies to.
    route: Option<Route>,
    next: usize,
    /// The ground station has just been lost: what is left of the route is the vehicle's own to plan.
    is_left_alone: bool,
    /// The last that has sent the vehicle elsewhere.
    pointed_by: Text,
    /// Where others stay, or mean to, metres ENU.
    ends: Vec<(NodeName, Vector3<f64>)>,
    outcome: Option<Outcome>,
    selections: Vec<Happened>,
    limits: Limits,
    drawn: DrawnZones,
    /// Whether control has yet to be told of other zones.
    draws: bool,
    /// The revision of the program that these are of.
    limits_of: Option<u64>,
    fault: Option<String>,
    trials: VecDeque<Trial>,
    /// The trials that have begun, or are to.
    trying: usize,
}

/// So many scripts are tried out at once, or wait for it.
const MOST_TRIALS: usize = 4;

/// A script that was sent, and is to be tried out before it runs.
#[derive(Debug)]
pub struct Trial {
    assignment: Assignment,
    from: String,
    config: Arc<AgentConfig>,
    /// Whether a script of its name runs, so that there is nothing to be tried.
    is_known: bool,
}

/// A script that was tried out.
#[derive(Debug)]
pub struct Tried {
    assignment: Assignment,
    from: String,
    outcome: Result<(), String>,
}

impl Trial {
    /// Looks for a fault of the script together with the vehicle's program. It takes some tens of
    /// milliseconds.
    #[must_use]
    pub fn run(self) -> Tried {
        let Self { assignment, from, config, is_known } = self;
        let outcome = if is_known { Ok(()) } else { check_script(&config, &assignment, STATES_TRIED) };
        Tried { assignment, from, outcome }
    }

    /// The script is not tried, and does not run, because of this.
    #[must_use]
    pub fn refused(self, why: &str) -> Tried {
        Tried { assignment: self.assignment, from: self.from, outcome: Err(why.to_owned()) }
    }
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
                .and_then(|_| check_script(&config, assignment, STATES_TRIED))
                .map_err(|why| AgentError::Script { name: assignment.name().to_owned(), why })?;
        }
        let fleet = Fleet::new(&config.fleet)
            .map_err(|cause| AgentError::Fleet { value: config.fleet.clone(), cause })?;
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
            waypoints: config.waypoints.clone(),
            sent_by: None,
            route: None,
            next: 0,
            is_left_alone: false,
            pointed_by: "an operator".into(),
            ends: Vec::new(),
            outcome: None,
            selections: Vec::new(),
            limits: Limits::default(),
            drawn: DrawnZones::default(),
            draws: false,
            limits_of: None,
            fault: None,
            trials: VecDeque::new(),
            trying: 0,
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
                .map(|_| ())
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

    /// The vehicles' checks before take-off, as told since the last call.
    pub fn take_readiness(&mut self) -> Vec<Readiness> {
        self.node.take_readiness()
    }

    /// Tells the others of this vehicle's checks before take-off.
    pub fn put_readiness(&mut self, readiness: &Readiness, link: &mut dyn Link) {
        self.node.put_readiness(readiness, link);
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
        let state = self.words(complaint).said_of(state);
        self.node.put_state(&state, link);
    }

    /// The progress of the task; `complaint` is control's, why the vehicle is not ready.
    pub fn words(&self, complaint: Option<String>) -> Words {
        let holder = self.node.node().program().state_of::<bthreads::Holder>(bthreads::Holder::NAME);
        let name = |name: Option<&str>| name.unwrap_or_default().to_owned();
        Words {
            holder: name(holder.and_then(bthreads::Holder::holder)),
            asked_by: name(holder.and_then(bthreads::Holder::asked_by)),
            task: self.task.clone(),
            waiting_for: self.waiting_for(complaint),
            mission: match &self.outcome {
                None => MissionState::UnderWay,
                Some(Outcome::Complete) => MissionState::Complete,
                Some(Outcome::Failed(_)) => MissionState::Failed,
            },
            right: self.right(),
            scripts: self.scripts.running().map(|(name, _)| name.to_owned()).collect(),
            zones: self.drawn.zones().map(|zone| zone.name().to_owned()).collect(),
        }
    }

    /// The vehicle's right to go first where there is room for one.
    fn right(&self) -> Right {
        let right_of_way =
            self.node.node().program().state_of::<bthreads::RightOfWay>(bthreads::RIGHT_OF_WAY);
        right_of_way.map_or(Right::Free, bthreads::RightOfWay::right)
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
        self.ends.clear();
        self.ends.extend(circumstances.neighbours.iter().map(|other| (other.node.clone(), other.end())));
        self.go_on_alone(circumstances);
        let is_heard =
            |fact: &str| self.scripts.listen_to(fact) || self.config.behaviours.hear(self.me.name(), fact);
        for event in self.script_facts.tell(&self.me, is_heard, circumstances) {
            self.node.node_mut().enqueue(event);
        }
    }

    /// Goes on with keeping scripts, and tells what has become of those that waited for it.
    pub fn catch_up(&mut self, now: Duration) {
        self.node.node_mut().note_disk("scripts", self.scripts.unsaved());
        for (name, outcome) in self.scripts.catch_up(now, self.node.node_mut().program_mut()) {
            self.node.node_mut().enqueue(self.scripts.verdict(&name, outcome));
        }
    }

    /// One step of whoever decides: what happened, in order.
    pub fn decide(&mut self, now: Duration) -> Vec<Happened> {
        if let Err(error) = self.node.node_mut().step(now) {
            // Without fresh leave the vehicle hovers; its b-threads may yet recover.
            self.fault = Some(error.to_string());
        }
        self.mind.decide(now, self.node.node_mut())
    }

    /// The limits on the vehicle's motion that its b-threads state now, if they may have changed since the
    /// last call.
    pub fn changed_limits(&mut self) -> Option<&Limits> {
        self.read_zones();
        let program = self.node.node().program();
        if self.limits_of.replace(program.revision()) == Some(program.revision()) {
            return None;
        }
        self.limits = Limits::of(self.me.name(), program.stated());
        if let Some(why) = self.drawn.unreadable() {
            self.limits.note_unreadable(why);
        }
        Some(&self.limits)
    }

    fn read_zones(&mut self) {
        let Some(news) = self.drawn.read(self.node.node()) else { return };
        (self.draws, self.limits_of) = (true, None);
        for told in news {
            self.node.node_mut().enqueue(self.me.event(told));
        }
    }

    /// The zones that others have drawn for this vehicle, if they are others than at the last call; to be asked after
    /// [`changed_limits`](Self::changed_limits).
    pub fn changed_zones(&mut self) -> Option<Vec<Zone>> {
        std::mem::take(&mut self.draws).then(|| self.drawn.zones().cloned().collect())
    }

    /// Tells once when the disk does not take `what` must be kept, and once when it does again.
    pub fn note_disk(&mut self, what: &str, trouble: Option<&str>) {
        self.node.node_mut().note_disk(what, trouble);
    }

    /// The promises of this vehicle's former life are lost, and `why`: it does not go on before an
    /// operator says so.
    pub fn forget_promises(&mut self, why: &str) {
        let bthread = bthreads::LostPromises::new(self.me.clone(), why);
        self.node.node_mut().program_mut().add("lost_promises", bthread);
    }

    /// Takes in one thing that happened; gives back what control has to do then.
    pub fn follow(&mut self, happened: &Happened, is_landing: bool) -> Option<Instruction> {
        if happened.home != self.name {
            return None;
        }
        self.look_after_routes(&happened.event);
        self.note_task(&happened.event, is_landing);
        self.look_after_scripts(happened);
        match Instruction::of(&self.me, &happened.event)? {
            Instruction::GoTo(waypoint) => {
                self.next = usize::try_from(waypoint.leg).unwrap_or(self.next);
                let beyond_s = self.beyond_s(waypoint.leg);
                Some(Instruction::GoTo(Waypoint { beyond_s, ..waypoint }))
            }
            instruction => Some(instruction),
        }
    }

    /// Time from the waypoint of this leg to the last one at cruise speed, s.
    fn beyond_s(&self, leg: i64) -> Option<f64> {
        let later = self.waypoints.get(usize::try_from(leg).ok()?..)?;
        Some(arrival::to_go_s(later.iter().map(|point| (*point).into()), &self.config.envelope))
    }

    /// Answers a route that is sent, and notes who sends the vehicle where.
    fn look_after_routes(&mut self, event: &Event) {
        if let Some(order) = self.me.read::<OrderTaken>(event) {
            match order.what {
                What::Route => {
                    let answer = self.answer_to_route(&order);
                    self.node.node_mut().enqueue(answer);
                }
                What::GoTo => self.pointed_by = order.by,
                _ => {}
            }
        } else if let Some(Rerouted { way, by }) = self.me.read(event)
            && let Ok(route) = way.parse::<Route>()
        {
            self.waypoints = route.points().to_vec();
            (self.route, self.next) = (Some(route), 0);
            self.sent_by = Some(by);
        } else if let Some(lost) = self.me.read::<PeerLost>(event) {
            self.is_left_alone |= lost.node.as_str() == self.config.ground;
        } else if let Some(joined) = self.me.read::<PeerJoined>(event) {
            self.is_left_alone &= joined.node.as_str() != self.config.ground;
        }
    }

    /// Looks for a better way for what is left of its route, once the ground station that has planned it is lost. The
    /// station's next route takes its place.
    fn go_on_alone(&mut self, here: &Circumstances<'_>) {
        if !(self.is_left_alone && here.is_flown) {
            return;
        }
        self.is_left_alone = false;
        let program = self.node.node().program();
        let mission = program.state_of::<bthreads::Mission>(bthreads::Mission::NAME);
        let is_on_its_way = mission.is_some_and(|mission| mission.objects_to_routes().is_none());
        let Some(route) = self.route.as_ref().filter(|_| is_on_its_way) else { return };
        let way_on = WayOn::new(here.neighbours, here.battery.unwrap_or(1.0), &self.config);
        let better = way_on.better(route, self.next, here.position);
        let drawn: Vec<_> = self.drawn.zones().cloned().collect();
        let may_be_flown = |way: &Route| reroute::objection(way, &self.config, &drawn, &self.ends).is_none();
        if let Some(better) = better.filter(may_be_flown) {
            let by = self.name.as_str().into();
            let rerouted = Rerouted { way: better.to_string().as_str().into(), by };
            self.node.node_mut().enqueue(self.me.event(rerouted));
        }
    }

    fn answer_to_route(&self, order: &OrderTaken) -> Event {
        match self.fit_route(order) {
            Ok(route) => {
                self.me.event(Rerouted { way: route.to_string().as_str().into(), by: order.by.clone() })
            }
            Err(why) => self.me.event(Declined { what: What::Route, why: why.as_str().into() }),
        }
    }

    fn fit_route(&self, order: &OrderTaken) -> Result<Route, String> {
        let program = self.node.node().program();
        let mission = program.state_of::<bthreads::Mission>(bthreads::Mission::NAME);
        let objection = mission.map_or(Some("it has no mission"), bthreads::Mission::objects_to_routes);
        if let Some(why) = objection {
            return Err(why.to_owned());
        }
        let way = order.way.as_deref().ok_or("the order names no points")?;
        let route = way.parse::<Route>().map_err(|error| error.to_string())?;
        let drawn: Vec<_> = self.drawn.zones().cloned().collect();
        match reroute::objection(&route, &self.config, &drawn, &self.ends) {
            Some(why) => Err(why),
            None => Ok(route),
        }
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
                bthreads::OPERATOR_LEG => format!("going where {} points", self.pointed_by),
                leg => {
                    let whose = self.sent_by.as_ref().map(|by| format!(" of the route by {by}"));
                    format!("leg {} of {}{}", leg + 1, self.waypoints.len(), whose.unwrap_or_default())
                }
            },
            Some(Arrived::NAME)
                if Arrived::read(event).is_some_and(|it| it.leg == bthreads::OPERATOR_LEG) =>
            {
                format!("hovering where {} pointed, until resumed", self.pointed_by)
            }
            Some(Hold::NAME) => "holding".to_owned(),
            Some(PlaceTaken::NAME) => {
                PlaceTaken::read(event).map_or_else(String::new, |taken| self.beside(&taken))
            }
            Some(Unplannable::NAME) => match self.me.read::<Unplannable>(event) {
                Some(Unplannable { leg: 0.., zone: Some(zone), .. }) => {
                    let before =
                        self.task.split_once(WAITS_FOR).map_or(self.task.as_str(), |(before, _)| before);
                    format!("{before}{WAITS_FOR}`{zone}`, which is in the way")
                }
                _ => return,
            },
            Some(Planned::NAME) => match self.task.split_once(WAITS_FOR) {
                Some((before, _)) => before.to_owned(),
                None => return,
            },
            Some(PlaceFree::NAME) => match self.task.split_once(BESIDE) {
                Some((before, _)) => before.to_owned(),
                None => return,
            },
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

    /// The task of a vehicle whose place another one has.
    fn beside(&self, taken: &PlaceTaken) -> String {
        let before = self.task.split_once(BESIDE).map_or(self.task.as_str(), |(before, _)| before);
        format!("{before}{BESIDE}{} is there", taken.by)
    }

    /// Has the scripts tried out that are sent, and answers what cannot be done.
    fn look_after_scripts(&mut self, happened: &Happened) {
        let event = &happened.event;
        let refused = match self.me.verb(event) {
            Some(Load::NAME) => self.begin_trial(happened),
            Some(Unload::NAME) => {
                let Some(Unload { name, by }) = Unload::read(event) else { return };
                match (self.scripts.runs(&name), by) {
                    (true, Some(_)) => Ok(()),
                    (true, None) => Err((name.to_string(), UNNAMED.to_owned())),
                    (false, _) => Err((name.to_string(), "no script of this name runs".to_owned())),
                }
            }
            Some(ScriptNews::NAME) => return self.scripts.hear(event),
            _ => return,
        };
        if let Err((name, why)) = refused {
            self.node.node_mut().enqueue(self.scripts.verdict(&name, Err(why)));
        }
    }

    /// Puts a script that is sent among those to be tried out, or says why not.
    fn begin_trial(&mut self, happened: &Happened) -> Result<(), (String, String)> {
        let nameless = |why: String| (String::new(), why);
        let sent = Load::read(&happened.event).ok_or_else(|| nameless("it holds no script".to_owned()))?;
        let assignment = Assignment::from_json(&sent.script).map_err(|error| nameless(error.to_string()))?;
        if sent.by.is_none() {
            return Err((assignment.name().to_owned(), UNNAMED.to_owned()));
        }
        let sender = happened.requested_by.iter().find(|bthread| bthread.contains('#'));
        let from = sender.map_or(self.name.as_str(), |bthread| bthread).to_owned();
        let refused = |why| (assignment.name().to_owned(), why);
        self.check_sender(&assignment, &from).map_err(refused)?;
        if self.trying == MOST_TRIALS {
            return Err(refused(format!("{MOST_TRIALS} scripts are being tried out already; send it again")));
        }
        self.trying += 1;
        let known = self.scripts.runs(assignment.name());
        self.trials.push_back(Trial { assignment, from, config: self.config.clone(), is_known: known });
        Ok(())
    }

    /// The next script that is to be tried out, by whoever has the time for it.
    pub fn next_trial(&mut self) -> Option<Trial> {
        self.trials.pop_front()
    }

    /// Runs a script that has been tried out, or says why not.
    pub fn note_trial(&mut self, Tried { assignment, from, outcome }: Tried) {
        self.trying = self.trying.saturating_sub(1);
        let outcome = match outcome.and_then(|()| self.load(&assignment, &from, Begins::AtOnce)) {
            Ok(Loaded::Waits) => return,
            outcome => outcome.map(|_| ()),
        };
        self.node.node_mut().enqueue(self.scripts.verdict(assignment.name(), outcome));
    }

    /// Runs a script that `from` has sent to a former life of this agent, if it passes all checks.
    fn admit(&mut self, assignment: &Assignment, from: &str, begins: Begins) -> Result<Loaded, String> {
        self.check_sender(assignment, from)?;
        if !self.scripts.runs(assignment.name()) {
            check_script(&self.config, assignment, STATES_TRIED)?;
        }
        self.load(assignment, from, begins)
    }

    fn load(&mut self, assignment: &Assignment, from: &str, begins: Begins) -> Result<Loaded, String> {
        self.script_facts.forget();
        self.scripts.load(self.node.node_mut().program_mut(), assignment, from, begins)
    }

    fn check_sender(&self, assignment: &Assignment, from: &str) -> Result<(), String> {
        if self.may_send(assignment, from)? {
            return Ok(());
        }
        let node = from.split_once('#').map_or(from, |(node, _)| node);
        Err(format!("{node} may not send scripts: that is for the ground station and its operators"))
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

    /// The b-threads that keep this vehicle from moving on or taking off; `complaint` is control's, why it is not
    /// ready.
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
        NodeName::new(value).map_err(|cause| AgentError::Name { field, value: value.to_owned(), cause })
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
