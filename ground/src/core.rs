//! The ground core: the station's program and roster, without I/O.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use nalgebra::Vector3;
use skein_bp::catalogue::Whose;
use skein_bp::{Event, EventSet, Program, ProgramConfig};
use skein_dbp::{Board, Happened, Node, NodeConfig, NodeError, NodeName};
use skein_wire::event::{Declared as _, Drawn, Erased, Heard, Held, Situation, What};
use skein_wire::{
    KeptZone, Link, MissionState, NodeLink, Order, Readiness, Route, Saver, State, Store, Who, Zone,
    joint_roster,
};

use crate::bthreads::{self, GOING_LASTS, LiftZone, MissionOutcome, Watch, ZoneBlock};
use crate::config::GroundConfig;
use crate::explain::{Evidence, Explanation, explain};
use crate::giver::Giver;
use crate::launch_offer::{Candidate, LaunchOffer, LaunchOffers};
use crate::order::events;
use crate::order_log::{Answer, OrderLog, OrderRecord};
use crate::planning::{CalledOff, FleetProblem, Flyer, Orphaned, Other, StandIns, Theatre, plan};
use crate::refusal::Refusal;
use crate::zone_log::{ZoneLog, ZoneRecord};

/// Who holds a vehicle is kept holding it this often while they are there: several times in a holder's absence that a
/// vehicle bears with.
const KEEP_PERIOD: Duration = Duration::from_secs(10);

/// The ground station. Tick it every 20 ms with its link.
pub struct GroundCore {
    name: NodeName,
    node: NodeLink,
    orders: Vec<(Duration, Giver, Order)>,
    vehicles: Vec<NodeName>,
    now: Duration,
    roster: BTreeMap<NodeName, State>,
    readiness: BTreeMap<NodeName, Readiness>,
    order_log: OrderLog,
    /// The holder of each vehicle, as it has told; without those that nobody holds.
    holders: BTreeMap<NodeName, String>,
    /// The givers of the orders that were known in advance. They hold no vehicle for longer than an order takes:
    /// whoever is there must not ask a plan.
    planners: BTreeSet<Giver>,
    /// The people and programs that are there to give orders now.
    present: BTreeSet<Giver>,
    keep_due: Duration,
    offers: LaunchOffers,
    zones: ZoneLog,
    zone_store: Option<Saver<Vec<KeptZone>>>,
    evidence: Evidence,
    selections: Vec<Happened>,
    theatre: Option<Theatre>,
    stand_ins: StandIns,
    seed: u64,
}

impl GroundCore {
    /// A station that has heard of nobody yet.
    pub fn new(config: GroundConfig) -> Self {
        Self::with_store(config, None)
    }

    /// A station that keeps in `store` what it must not forget, and takes up what its former life has kept.
    pub fn durable(config: GroundConfig, store: Box<dyn Store>) -> Self {
        Self::with_store(config, Some(store))
    }

    fn with_store(mut config: GroundConfig, store: Option<Box<dyn Store>>) -> Self {
        let mut program = Program::new(ProgramConfig::vehicle(config.seed));
        if config.loaded {
            bthreads::load(&mut program, &config);
        }
        let roster: Vec<_> =
            config.vehicles.iter().chain([&config.name]).chain(&config.operators).cloned().collect();
        let brought = |whose| config.behaviours.events(config.name.as_str(), whose);
        let gateway = EventSet::named(config.name.event_name("order"));
        let node_config = NodeConfig {
            safety: brought(Whose::Own),
            gateway: gateway.or(brought(Whose::Operator)),
            lease: config.lease,
            authority: config.authority,
            joint: Some(joint_roster(config.name.clone(), &roster)),
            durable: store.is_some(),
            kept: config.kept,
            forgot: config.forgot,
            ..NodeConfig::new(config.name.clone(), config.incarnation, roster)
        };
        config.orders.sort_by_key(|(at, ..)| *at);
        let node = Node::new(node_config, program);
        let mut evidence = Evidence::default();
        config.vehicles.iter().for_each(|vehicle| evidence.note_vehicle(vehicle));
        let node = match store {
            Some(store) => NodeLink::durable(node, config.fleet, store),
            None => NodeLink::new(node, config.fleet),
        };
        let mut core = Self {
            node: node.reading_boards(),
            stand_ins: StandIns::new(config.name.clone()),
            name: config.name,
            planners: config.orders.iter().map(|(_, by, _)| by.clone()).collect(),
            orders: config.orders,
            vehicles: config.vehicles,
            now: Duration::ZERO,
            roster: BTreeMap::new(),
            readiness: BTreeMap::new(),
            order_log: OrderLog::default(),
            holders: BTreeMap::new(),
            present: BTreeSet::new(),
            keep_due: Duration::ZERO,
            offers: LaunchOffers::default(),
            zones: ZoneLog::default(),
            zone_store: None,
            evidence,
            selections: Vec::new(),
            theatre: config.theatre,
            seed: config.seed,
        };
        config.zones.into_iter().for_each(|kept| core.take_up(kept));
        core
    }

    /// The same station, which keeps the zones that it draws in `store`.
    #[must_use]
    pub fn keeping_zones(self, store: Box<dyn Store<Vec<KeptZone>>>) -> Self {
        Self { zone_store: Some(Saver::new(store)), ..self }
    }

    /// States a zone of a former life again: so it is this life's to remove.
    fn take_up(&mut self, KeptZone { by, zone }: KeptZone) {
        let by = Giver::new(&by).unwrap_or_else(|_| Giver::from(&self.name));
        let block = ZoneBlock::new(self.name.clone(), &zone);
        self.node.node_mut().program_mut().add(ZoneBlock::name(zone.name()), block);
        self.zones.draw(Duration::ZERO, by, zone, &self.vehicles);
    }

    /// Draws a zone for all vehicles, in the place of one of its name. What becomes of it stands in
    /// [`zones`](Self::zones).
    ///
    /// # Errors
    /// [`Refusal`]: there are too many, or one of this name is just being removed.
    pub fn draw(&mut self, by: &Giver, zone: Zone) -> Result<(), Refusal> {
        if let Some(refusal) = self.zones.objection(&zone) {
            return Err(refusal);
        }
        let (name, bthread) = (zone.name().to_owned(), ZoneBlock::name(zone.name()));
        let node = self.node.node_mut();
        match (node.program().bid(&bthread).is_some(), self.zones.is_standing(&name)) {
            (false, _) => drop(node.program_mut().add(bthread, ZoneBlock::new(self.name.clone(), &zone))),
            (true, true) => {}
            (true, false) => return Err(Refusal::ZoneGoing { name }),
        }
        let drawn = Drawn { name: name.into(), zone: zone.to_json().into(), by: by.as_str().into() };
        node.enqueue(drawn.at(&self.name));
        self.zones.draw(self.now, by.clone(), zone, &self.vehicles);
        self.keep_zones();
        Ok(())
    }

    /// Removes the zone of this name; one that this station does not know is lifted from the vehicles that keep it.
    ///
    /// # Errors
    /// [`Refusal`]: nobody knows it.
    pub fn erase(&mut self, by: &Giver, name: &str) -> Result<(), Refusal> {
        if self.zones.erase(self.now, name, &self.vehicles) {
            let erased = Erased { name: name.into(), by: by.as_str().into() };
            self.node.node_mut().enqueue(erased.at(&self.name));
            self.keep_zones();
            return Ok(());
        }
        let keeps = |state: &&State| state.zones.iter().any(|zone| zone == name);
        let keeping: Vec<_> = self.roster.values().filter(keeps).map(|state| state.node.clone()).collect();
        if keeping.is_empty() {
            return Err(Refusal::NoSuchZone { name: name.to_owned() });
        }
        for vehicle in keeping {
            let lift = LiftZone::new(&self.name, name, &vehicle, self.now + GOING_LASTS);
            self.node.node_mut().program_mut().add(LiftZone::name(name, &vehicle), lift);
        }
        Ok(())
    }

    fn keep_zones(&mut self) {
        if let Some(store) = &mut self.zone_store {
            store.put(self.now, self.zones.kept());
        }
    }

    fn look_at_zones(&mut self, happened: &[Happened]) {
        self.zones.update(self.now, self.node.node(), happened);
        if let Some(store) = &mut self.zone_store {
            store.go_on(self.now);
            self.node.node_mut().note_disk("zones", store.trouble());
        }
    }

    /// The zones that are drawn, by name, and those that are being removed.
    pub fn zones(&self) -> impl Iterator<Item = &ZoneRecord> {
        self.zones.records()
    }

    /// Grows whenever [`zones`](Self::zones) has changed.
    pub fn zones_revision(&self) -> u64 {
        self.zones.revision()
    }

    /// Says something to the vehicles, as `by`. Returns the order's number: see [`orders`](Self::orders). Vehicles that
    /// somebody else holds do not hear of it, if it is not for their safety, and count as refusing it.
    ///
    /// # Errors
    /// [`Refusal`], and then nobody is ordered anything. A launch is always refused: see
    /// [`offer_launch`](Self::offer_launch).
    pub fn order(&mut self, by: &Giver, order: &Order) -> Result<u64, Refusal> {
        if order.what().is_launch() {
            return Err(Refusal::LaunchUnasked);
        }
        self.give(by, order)
    }

    /// The first of a launch's two messages: what `what`, a launch, would launch. `token` is random, and nobody's
    /// guess.
    ///
    /// # Errors
    /// [`Refusal`]: somebody else holds a vehicle, or nobody is there to be launched.
    pub fn offer_launch(&mut self, by: &Giver, what: What, token: String) -> Result<LaunchOffer, Refusal> {
        let held = self.vehicles.iter().find_map(|vehicle| self.held_by_another(by, vehicle));
        if let Some((vehicle, holder)) = held {
            return Err(Refusal::Held { vehicle, holder });
        }
        let candidates = self.candidates();
        if candidates.is_empty() {
            return Err(Refusal::NobodyToLaunch);
        }
        Ok(self.offers.offer(self.now, (by, what), token, candidates))
    }

    /// The second message: `by` returns the token within [`OFFER_LASTS`](crate::OFFER_LASTS). It serves once.
    ///
    /// # Errors
    /// [`Refusal`]: there is no such offer to `by`, others would be launched now, or somebody else holds a vehicle.
    pub fn launch(&mut self, by: &Giver, token: &str) -> Result<u64, Refusal> {
        let offer = self.offers.take_up(self.now, by, token).ok_or(Refusal::NoSuchOffer)?;
        if !offer.is_about(&self.candidates()) {
            return Err(Refusal::OfferOutdated);
        }
        self.give(by, &Order::new(offer.what, Who::All))
    }

    /// The people and programs that are there to give orders, of whom vehicles are told: whoever holds one and is not
    /// there is not kept holding it.
    pub fn attend(&mut self, present: BTreeSet<Giver>) {
        self.present = present;
    }

    /// The fleet as it is, to be planned for: those of `who` that fly, or wait to, and the others in their way.
    ///
    /// # Errors
    /// [`Refusal`]: a vehicle is none of this station's, or it was not told what to plan with.
    pub fn survey(&self, who: &Who, targets: Vec<Vector3<f64>>) -> Result<FleetProblem, Refusal> {
        let theatre = self.theatre.clone().ok_or(Refusal::NoTheatre)?;
        self.refuse_strangers(who)?;
        let is_out = |state: &State| state.mission == MissionState::UnderWay && self.is_alive(&state.node);
        let known = self.vehicles.iter().filter_map(|vehicle| self.roster.get(vehicle));
        let (planned, others): (Vec<&State>, Vec<_>) =
            known.partition(|state| who.includes(&state.node) && is_out(state));
        let flyer = |state: &State| Flyer {
            node: state.node.clone(),
            position: state.position,
            battery: state.battery,
            stops: Vec::new(),
        };
        let other = |state: &State| Other {
            node: state.node.clone(),
            way: std::iter::once(state.position).chain(state.path.iter().copied()).collect(),
        };
        Ok(FleetProblem {
            theatre,
            flyers: planned.into_iter().map(flyer).collect(),
            others: others.into_iter().map(other).collect(),
            targets,
            one_to_each: false,
            seed: self.seed,
        })
    }

    fn refuse_strangers(&self, who: &Who) -> Result<(), Refusal> {
        let Who::These(named) = who else { return Ok(()) };
        match named.iter().find(|name| !self.vehicles.contains(name)) {
            Some(stranger) => Err(Refusal::UnknownVehicle { name: stranger.clone() }),
            None => Ok(()),
        }
    }

    fn give(&mut self, by: &Giver, order: &Order) -> Result<u64, Refusal> {
        let (who, what) = (order.who(), order.what());
        self.refuse_strangers(who)?;
        let (mut concerned, mut answers) = (Vec::new(), BTreeMap::new());
        for vehicle in self.vehicles.iter().filter(|vehicle| who.includes(vehicle)) {
            match self.objection(by, what, vehicle) {
                None => concerned.push(vehicle.clone()),
                Some(refusal) if what.is_for_all() => return Err(refusal),
                Some(refusal) => drop(answers.insert(vehicle.clone(), refusal)),
            }
        }
        if let (true, Some(refusal)) = (concerned.is_empty(), answers.values().next()) {
            return Err(refusal.clone());
        }
        self.say(by, order, &concerned);
        let refused = answers.into_iter().map(|(vehicle, why)| (vehicle, Answer::Refused(why.to_string())));
        let pending = concerned.into_iter().map(|vehicle| (vehicle, Answer::Pending));
        Ok(self.order_log.give(self.now, by.clone(), order.clone(), refused.chain(pending).collect()))
    }

    /// Tells the station's b-threads of an order for these vehicles.
    fn say(&mut self, by: &Giver, order: &Order, vehicles: &[NodeName]) {
        let place = |vehicle: &NodeName| self.roster.get(vehicle).map(|state| state.position);
        let placed: Vec<_> = vehicles.iter().map(|vehicle| (vehicle.clone(), place(vehicle))).collect();
        let everybody = vehicles.len() == self.vehicles.len() && *order.who() == Who::All;
        for event in events(order, &self.name, by, everybody, &placed) {
            self.node.node_mut().enqueue(event);
        }
        if order.what().is_launch() {
            // Who launches a vehicle holds it, and no event of the launch says so to the vehicle.
            self.say(by, &Order::new(What::Keep, Who::All), vehicles);
        }
    }

    /// Why `by` cannot order this of a vehicle, if so.
    fn objection(&self, by: &Giver, what: What, vehicle: &NodeName) -> Option<Refusal> {
        if what.needs_holder() {
            let (vehicle, holder) = self.held_by_another(by, vehicle)?;
            return Some(Refusal::Held { vehicle, holder });
        }
        let holder = self.holder(vehicle).unwrap_or_default();
        let is_his = holder == by.as_str();
        let needs = matches!(what, What::Give | What::Release);
        (needs && !is_his).then(|| Refusal::NotHolder {
            vehicle: vehicle.clone(),
            holder: holder.to_owned(),
            what,
        })
    }

    /// The vehicle and its holder, if that is not `by`. One that is out of reach may be anybody's by now.
    fn held_by_another(&self, by: &Giver, vehicle: &NodeName) -> Option<(NodeName, String)> {
        let holder =
            self.holder(vehicle).filter(|holder| *holder != by.as_str() && self.is_alive(vehicle))?;
        Some((vehicle.clone(), holder.to_owned()))
    }

    fn is_alive(&self, vehicle: &NodeName) -> bool {
        self.node.node().peers().any(|(peer, state)| peer == vehicle && state.alive)
    }

    fn candidates(&self) -> Vec<Candidate> {
        let candidate = |vehicle: &NodeName| {
            let (state, readiness) = (self.roster.get(vehicle), self.readiness.get(vehicle));
            Candidate::of(vehicle, state, readiness, self.is_alive(vehicle))
        };
        self.vehicles.iter().filter_map(candidate).collect()
    }

    fn set_holder(&mut self, vehicle: &NodeName, holder: &str) {
        if holder.is_empty() {
            self.holders.remove(vehicle);
        } else if self.holder(vehicle) != Some(holder) {
            self.holders.insert(vehicle.clone(), holder.to_owned());
            if let Some(planner) = self.planners.iter().find(|by| by.as_str() == holder).cloned() {
                self.say(
                    &planner,
                    &Order::new(What::Release, Who::only(vehicle.clone())),
                    std::slice::from_ref(vehicle),
                );
            }
        }
    }

    fn note_holder(&mut self, happened: &Happened) {
        if let Some(held) = Held::read(&happened.event).filter(|_| self.vehicles.contains(&happened.home)) {
            self.set_holder(&happened.home, held.by.as_deref().unwrap_or_default());
        }
    }

    /// Keeps the vehicles for those of their holders who are there.
    fn keep_holders(&mut self) {
        if self.now < self.keep_due {
            return;
        }
        self.keep_due = self.now + KEEP_PERIOD;
        for by in self.present.clone() {
            let held = self.vehicles.iter().filter(|vehicle| self.holder(vehicle) == Some(by.as_str()));
            let held: Vec<_> = held.cloned().collect();
            self.say(&by, &Order::new(What::Keep, Who::These(held.clone())), &held);
        }
    }

    /// The person or program that holds a vehicle, as it has told.
    pub fn holder(&self, vehicle: &NodeName) -> Option<&str> {
        self.holders.get(vehicle).map(String::as_str)
    }

    /// Tells once when the disk does not take `what` must be kept, and once when it does again.
    pub fn note_disk(&mut self, what: &str, trouble: Option<&str>) {
        self.node.node_mut().note_disk(what, trouble);
    }

    /// Hears, decides and answers.
    ///
    /// # Errors
    /// [`NodeError`] when a b-thread misbehaves; the station goes on all the same.
    pub fn tick(&mut self, now: Duration, link: &mut dyn Link) -> Result<(), NodeError> {
        self.now = now;
        let due = self.orders.partition_point(|(at, ..)| *at <= now);
        for (_, by, order) in self.orders.drain(..due).collect::<Vec<_>>() {
            // Nobody is there to hear of a refusal; whoever wrote it down has launched by that.
            let _ = self.give(&by, &order);
        }
        let outcome = self.node.pump(now, link);
        for state in self.node.take_states() {
            self.note(state);
        }
        for said in self.node.take_readiness() {
            if self.vehicles.contains(&said.node) {
                self.readiness.insert(said.node.clone(), said);
            }
        }
        self.note_boards(link);
        let happened = self.node.node_mut().take_selections();
        happened.iter().for_each(|happened| self.evidence.note_event(happened.clone()));
        happened.iter().for_each(|happened| self.note_holder(happened));
        for overruled in self.order_log.update(now, self.node.node(), &happened, &self.holders) {
            self.node.node_mut().enqueue(overruled.at(&self.name));
        }
        self.look_after_targets(&happened);
        self.look_at_zones(&happened);
        self.keep_holders();
        self.selections.extend(happened);
        outcome
    }

    /// Sends others to the targets of vehicles that are lost or have failed, and calls that off when they are back.
    fn look_after_targets(&mut self, happened: &[Happened]) {
        for happened in happened {
            for CalledOff { vehicle, left, by } in self.stand_ins.returned(happened) {
                let left = Route::new(left.into_iter().map(Into::into).collect());
                if let (Ok(by), Ok(left)) = (Giver::new(&by), left) {
                    // Whoever holds it otherwise by now keeps it from that.
                    let _ = self.give(&by, &Order::route(vehicle, left));
                }
            }
            if let Some(orphaned) = self.stand_ins.note(self.now, happened) {
                self.replace(orphaned);
            }
        }
        for orphaned in self.stand_ins.due(self.now) {
            self.replace(orphaned);
        }
    }

    /// An operator has brought it down, and with it what it was to do.
    fn was_brought_down(&self, vehicle: &NodeName) -> bool {
        let told = |order: &&OrderRecord| {
            order.answers.contains_key(vehicle) && !order.order.what().is_beside_flight()
        };
        let newest = self.order_log.records().filter(told).last();
        newest.is_some_and(|newest| matches!(newest.order.what(), What::Land | What::Return | What::Abort))
    }

    fn replace(&mut self, Orphaned { of, targets, by }: Orphaned) {
        if self.was_brought_down(&of) {
            return;
        }
        let able = |vehicle: &&NodeName| **vehicle != of && self.stand_ins.knows(vehicle);
        let able: Vec<_> = self.vehicles.iter().filter(able).cloned().collect();
        let (Ok(by), Ok(mut problem)) = (Giver::new(&by), self.survey(&Who::These(able), targets)) else {
            return;
        };
        problem.one_to_each = true;
        problem.others.retain(|other| other.node != of);
        for flyer in &mut problem.flyers {
            flyer.stops = self.stand_ins.ahead(&flyer.node);
            let way = std::iter::once(flyer.position).chain(flyer.stops.iter().copied()).collect();
            problem.others.push(Other { node: flyer.node.clone(), way });
        }
        let Ok(plan) = plan(&problem) else { return };
        for journey in plan.journeys {
            let Ok(route) = journey.sent() else { continue };
            if self.give(&by, &Order::route(journey.node.clone(), route)).is_ok() {
                let places = journey.targets.iter().map(|number| problem.targets[*number]).collect();
                self.stand_ins.stands_in(journey.node, of.clone(), places);
            }
        }
    }

    fn note(&mut self, state: State) {
        if !self.vehicles.contains(&state.node) {
            return;
        }
        if self.roster.get(&state.node).is_none_or(|known| known.incarnation != state.incarnation) {
            self.node.node_mut().enqueue(first_word(&self.name, &state));
        }
        self.evidence.note_state(self.now, &state);
        self.zones.note_state(self.now, &state);
        self.set_holder(&state.node, &state.holder);
        self.roster.insert(state.node.clone(), state);
    }

    /// Takes in what the vehicles have on their boards, and tells what this station has.
    fn note_boards(&mut self, link: &mut dyn Link) {
        for board in self.node.take_boards() {
            if self.vehicles.contains(&board.node) {
                self.evidence.note_board(self.now, board);
            }
        }
        if let Some(board) = self.node.put_board(self.now, link) {
            self.evidence.note_board(self.now, board.clone());
        }
    }

    /// The outcome of the mission, once every vehicle is on the ground and knows.
    pub fn finished(&self) -> Option<MissionOutcome> {
        self.node.node().program().state_of::<Watch>(Watch::NAME)?.outcome()
    }

    /// Everything selected here or heard of since the last call, in order.
    pub fn take_selections(&mut self) -> Vec<Happened> {
        std::mem::take(&mut self.selections)
    }

    /// The station's node name.
    pub fn name(&self) -> &NodeName {
        &self.name
    }

    /// The station's node, to explain what it requests and blocks, and what has come in that was not understood.
    pub fn node(&self) -> &NodeLink {
        &self.node
    }

    /// Every vehicle in the order of take-off, with its last word if it has been heard.
    pub fn roster(&self) -> impl Iterator<Item = (&NodeName, Option<&State>)> {
        self.vehicles.iter().map(|vehicle| (vehicle, self.roster.get(vehicle)))
    }

    /// A vehicle's checks before take-off, as it told them last; also of one that does not know where it is.
    pub fn readiness(&self, vehicle: &NodeName) -> Option<&Readiness> {
        self.readiness.get(vehicle)
    }

    /// The newest board of this station and of each vehicle.
    pub fn boards(&self) -> impl Iterator<Item = &Board> {
        self.evidence.boards()
    }

    /// Why a vehicle of this station does what it does now, or does not move.
    pub fn explain(&self, vehicle: &NodeName) -> Option<Explanation> {
        explain(&self.evidence, self.now, vehicle)
    }

    /// The latest orders and their answers, oldest first.
    pub fn orders(&self) -> impl Iterator<Item = &OrderRecord> {
        self.order_log.records()
    }

    /// Grows whenever [`orders`](Self::orders) has changed.
    pub fn orders_revision(&self) -> u64 {
        self.order_log.revision()
    }
}

/// The event by which the station `ground` tells that it has heard a vehicle for the first time in the vehicle's life.
/// So a station that starts late, or again, launches nobody who flies and waits for nobody who has landed.
fn first_word(ground: &NodeName, state: &State) -> Event {
    let situation = match state.mission {
        MissionState::UnderWay if state.armed => Situation::Flying,
        MissionState::UnderWay => Situation::Grounded,
        MissionState::Complete => Situation::Complete,
        MissionState::Failed => Situation::Failed,
    };
    let why = state.task.as_str().into();
    Heard { vehicle: state.node.clone(), situation, why }.at(ground)
}
