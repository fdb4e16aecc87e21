//! The right of way in a graph: every run of the b-threads that decide it, with channels of which no more is known than
//! that who hears of another hears any earlier state of it.
//!
//! A vehicle moves a place at a time, by leave alone. It sees who is in the place before it, and does not fly into
//! those who go the same way, nor into those who met it inside or make way there. It is kept from flying into one that
//! goes against it, and has entered that place as it has itself, by nothing but the rule.

use std::collections::{BTreeSet, HashMap};

use skein_agent::{Me, bthreads::RIGHT_OF_WAY, rank::goes_before};
use skein_bp::Event;
use skein_dbp::NodeName;
use skein_dbp::facts::{Confirmed, PeerJoined, Stalled};
use skein_wire::event::{Cornered, Declared as _, InTheWay, Leave, OutOfTheWay, Passage};

use super::decisions::{Decisions, Rule};
use super::graph::{Case, Graph, MOST_EXITS, Place};

/// Degrees from one exit of a place to the next.
const EXIT_DEG: i32 = 360 / (MOST_EXITS as i32 + 1);
/// Metres from one place to the next, along both axes: no two are in one box that others are in.
const APART_M: i32 = 10;
/// Between two places that bend a third stands for the bend, so far off, m.
const BENDS_M: i32 = 1000;

/// The outcome of a case.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    pub states: usize,
    pub moves: usize,
    /// Two were in a narrow place against one another, by the rule: the moves that led there.
    pub shared: Option<Vec<String>>,
    /// There is a way, and none for the rule from here on: the moves that led there.
    pub stuck: Option<Vec<String>>,
    /// There are more states than were asked for; nothing is said about arriving.
    pub is_cut: bool,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct State {
    vehicles: Vec<Vehicle>,
    /// The claim of one vehicle at the home of another, in rows of the home.
    claims: Vec<Known>,
    /// The word of one vehicle on its way to another, likewise: the last, if that has not been heard.
    words: Vec<Option<u32>>,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Vehicle {
    /// The state of its rule.
    rule: u32,
    /// From where it is to its goal.
    way: Vec<Place>,
    /// It has come into the narrow place where it is by leave.
    entered: bool,
    /// The newest claim that it has stated.
    claim: u32,
    /// It has told of a stretch that is not behind it.
    told: Option<u32>,
    /// The one that it makes way for, and the narrow place where or before which it was in the way.
    aside: Option<(usize, Place)>,
}

/// The knowledge that a home has of another's claim.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Known {
    claim: u32,
    /// It is the newest. Else these are on their way too, beside the newest.
    is_fresh: bool,
    stale: BTreeSet<u32>,
}

impl Vehicle {
    fn at(&self) -> Place {
        self.way[0]
    }
}

/// All runs of a case under a rule.
pub struct Model<'a, R> {
    case: &'a Case,
    names: Vec<Me>,
    decisions: Decisions<R>,
    /// Claims that are neither the newest nor the last one known may be heard late.
    with_stale: bool,
}

type Moves = Vec<(String, State)>;

impl<'a, R: Rule> Model<'a, R> {
    pub fn new(case: &'a Case, with_stale: bool) -> Self {
        let names = (1..=case.starts.len()).map(|number| Me::new(format!("uav/{number}"))).collect();
        Self { case, names, decisions: Decisions::new(), with_stale }
    }

    /// Explores every run, up to so many states; `rule` makes a vehicle's from its name and those of the others.
    pub fn explore(&mut self, rule: impl Fn(&Me, &[&str]) -> R, most_states: usize) -> Outcome {
        let first = self.first(rule);
        let mut numbers = HashMap::from([(first.clone(), 0_usize)]);
        let mut states = vec![first];
        let mut came_from: Vec<(usize, String)> = vec![(0, String::new())];
        let mut back: Vec<Vec<usize>> = vec![Vec::new()];
        let mut outcome = Outcome::default();
        let mut next = 0;
        while next < states.len() {
            if states.len() > most_states {
                outcome.is_cut = true;
                break;
            }
            let state = states[next].clone();
            let moves = match self.moves(&state) {
                Ok(moves) => moves,
                Err(what) => {
                    let mut story = story(&came_from, next);
                    story.push(what);
                    outcome.shared = Some(story);
                    break;
                }
            };
            for (what, moved) in moves {
                outcome.moves += 1;
                let number = *numbers.entry(moved).or_insert_with_key(|moved| {
                    states.push(moved.clone());
                    came_from.push((next, what));
                    back.push(Vec::new());
                    states.len() - 1
                });
                back[number].push(next);
            }
            next += 1;
        }
        outcome.states = states.len();
        if outcome.shared.is_none() && !outcome.is_cut && self.case.has_a_way() {
            let mut arrives: Vec<bool> = states.iter().map(|state| self.has_arrived(state)).collect();
            let mut open: Vec<usize> = (0..states.len()).filter(|number| arrives[*number]).collect();
            while let Some(number) = open.pop() {
                for before in &back[number] {
                    if !arrives[*before] {
                        arrives[*before] = true;
                        open.push(*before);
                    }
                }
            }
            outcome.stuck =
                arrives.iter().position(|arrives| !arrives).map(|number| story(&came_from, number));
        }
        outcome
    }

    fn graph(&self) -> &'a Graph {
        &self.case.graph
    }

    fn has_arrived(&self, state: &State) -> bool {
        state.vehicles.iter().zip(&self.case.goals).all(|(vehicle, goal)| vehicle.at() == *goal)
    }

    fn first(&mut self, rule: impl Fn(&Me, &[&str]) -> R) -> State {
        let names = self.names.clone();
        let nothing = self.decisions.nothing();
        let vehicles = names.iter().enumerate().map(|(index, me)| {
            let others: Vec<_> = names.iter().filter(|other| *other != me).map(Me::name).collect();
            let mut number = self.decisions.state(rule(me, &others), me.name());
            for other in others.iter().filter_map(|other| NodeName::new(other).ok()) {
                let joined = self.decisions.number(PeerJoined { node: other, incarnation: 1 }.at(me.name()));
                number = self.decisions.after(number, joined, me.name());
            }
            let way = self
                .way(self.case.starts[index], index, &[])
                .unwrap_or_else(|| vec![self.case.starts[index]]);
            Vehicle { rule: number, way, entered: false, claim: nothing, told: None, aside: None }
        });
        let vehicles: Vec<_> = vehicles.collect();
        let pairs = names.len() * names.len();
        let known = Known { claim: nothing, is_fresh: true, stale: BTreeSet::new() };
        let mut state = State { vehicles, claims: vec![known; pairs], words: vec![None; pairs] };
        for vehicle in 0..names.len() {
            self.tell(&mut state, vehicle);
        }
        state
    }

    /// The shortest way to a vehicle's goal, past those narrow places.
    fn way(&self, from: Place, vehicle: usize, past: &[Place]) -> Option<Vec<Place>> {
        self.graph().way(from, |end| end == self.case.goals[vehicle], |place| past.contains(&place))
    }

    fn heading(&self, place: Place, next: Option<Place>) -> i32 {
        let exits = &self.graph().next_to[place];
        let exit = next.map_or(exits.len(), |next| exits.iter().take_while(|exit| **exit < next).count());
        exit as i32 * EXIT_DEG
    }

    /// The narrow stretch that a vehicle has before it, with the place that it is in; of one that makes way, the place
    /// alone.
    fn passage(&self, vehicle: &Vehicle) -> Option<Passage> {
        let graph = self.graph();
        let is_inside = graph.narrow[vehicle.at()];
        let begins = if is_inside { 0 } else { 1 };
        let ends = if vehicle.aside.is_some() { 1 } else { vehicle.way.len() };
        let mut places: Vec<[i32; 2]> = Vec::new();
        for index in begins..ends {
            let place = vehicle.way[index];
            if !graph.narrow[place] {
                break;
            }
            let heading = self.heading(place, vehicle.way.get(index + 1).copied());
            if let Some([_, last]) = places.last().copied()
                && let Some(between) = between(last, heading)
            {
                let [from, to] = [vehicle.way[index - 1], place];
                places.push([BENDS_M + APART_M * (from * graph.places() + to) as i32, between]);
            }
            places.push([APART_M * place as i32, heading]);
        }
        let text = |[at, heading]: &[i32; 2]| format!("{at} {at} 2 {heading}");
        let at = f64::from(places.first()?[0]);
        let way = places.iter().map(text).collect::<Vec<_>>().join("; ");
        let here = places.first().filter(|_| is_inside).map(|place| text(place).as_str().into());
        Some(Passage { x: at, y: at, z: 2.0, way: Some(way.as_str().into()), here })
    }

    /// A vehicle tells of the stretch before it, if that is another than it has told of.
    fn tell(&mut self, state: &mut State, vehicle: usize) {
        let name = self.names[vehicle].name();
        let passage = self.passage(&state.vehicles[vehicle]).map(|passage| passage.at(name));
        let event = passage.map(|passage| self.decisions.number(passage));
        let told = std::mem::replace(&mut state.vehicles[vehicle].told, event);
        if event != told {
            // Between two stretches there is room.
            let was_inside =
                |told| Passage::read(self.decisions.event(told)).is_some_and(|told| told.here.is_some());
            let is_out = !self.graph().narrow[state.vehicles[vehicle].at()];
            let leaves = told.is_some_and(|told| event.is_none() || is_out && was_inside(told));
            let leave = leaves.then(|| self.decisions.number(Leave.at(name)));
            for word in leave.into_iter().chain(event) {
                self.hear(state, vehicle, word);
                self.say(state, vehicle, word);
            }
        }
        self.settle(state, vehicle);
    }

    fn hear(&mut self, state: &mut State, vehicle: usize, event: u32) {
        let name = self.names[vehicle].name();
        let rule = &mut state.vehicles[vehicle].rule;
        *rule = self.decisions.after(*rule, event, name);
    }

    /// The others are to hear it.
    fn say(&mut self, state: &mut State, vehicle: usize, word: u32) {
        let fleet = self.names.len();
        for other in (0..fleet).filter(|other| *other != vehicle) {
            state.words[other * fleet + vehicle] = Some(word);
        }
    }

    /// Whether a home has a claim that keeps out an event of its own, and whose.
    fn kept_out_by(&mut self, state: &State, vehicle: usize, event: u32) -> Option<usize> {
        let fleet = self.names.len();
        let mut others = (0..fleet).filter(|other| *other != vehicle);
        others.find(|other| self.decisions.keeps_out(state.claims[vehicle * fleet + other].claim, event))
    }

    /// All that its rule requests and nobody is known to block happens, and what it then claims is on its way.
    fn settle(&mut self, state: &mut State, vehicle: usize) {
        loop {
            let requests = self.decisions.stated(state.vehicles[vehicle].rule).requests.clone();
            let free = requests.into_iter().find(|event| self.kept_out_by(state, vehicle, *event).is_none());
            let Some(event) = free else { break };
            self.hear(state, vehicle, event);
        }
        let claim = self.decisions.stated(state.vehicles[vehicle].rule).claim;
        let before = std::mem::replace(&mut state.vehicles[vehicle].claim, claim);
        if claim == before {
            return;
        }
        let fleet = self.names.len();
        for home in (0..fleet).filter(|home| *home != vehicle) {
            let known = &mut state.claims[home * fleet + vehicle];
            if !known.is_fresh && self.with_stale {
                known.stale.insert(before);
            }
            known.is_fresh = false;
        }
    }

    /// The narrow places where others are.
    fn taken(&self, state: &State, vehicle: usize) -> Vec<Place> {
        let others = state.vehicles.iter().enumerate().filter(|(other, _)| *other != vehicle);
        others.map(|(_, other)| other.at()).filter(|place| self.graph().narrow[*place]).collect()
    }

    /// Every state that may come next, with what led there; two that share a narrow place by the rule are an error.
    fn moves(&mut self, state: &State) -> Result<Moves, String> {
        let mut moves = Moves::new();
        for vehicle in 0..self.names.len() {
            self.news(state, vehicle, &mut moves);
            self.facts(state, vehicle, &mut moves);
            if self.decisions.stated(state.vehicles[vehicle].rule).makes_way {
                self.make_way(state, vehicle, &mut moves);
            } else {
                self.drive(state, vehicle, &mut moves)?;
            }
        }
        Ok(moves)
    }

    /// One home hears of the others.
    fn news(&mut self, state: &State, home: usize, moves: &mut Moves) {
        let fleet = self.names.len();
        for of in (0..fleet).filter(|of| *of != home) {
            let (pair, me) = (home * fleet + of, self.names[home].name().to_owned());
            if let Some(word) = state.words[pair] {
                let mut next = state.clone();
                next.words[pair] = None;
                self.hear(&mut next, home, word);
                self.settle(&mut next, home);
                moves.push((format!("{me} hears {}", self.decisions.event(word)), next));
            }
            let known = &state.claims[pair];
            let newest = (!known.is_fresh).then_some(state.vehicles[of].claim);
            for claim in known.stale.iter().copied().chain(newest) {
                let is_newest = Some(claim) == newest;
                let mut next = state.clone();
                next.claims[pair] = match is_newest {
                    true => Known { claim, is_fresh: true, stale: BTreeSet::new() },
                    false => Known { claim, ..known.clone() },
                };
                self.settle(&mut next, home);
                let which = if is_newest { "the claim" } else { "an older claim" };
                moves.push((format!("{me} knows {which} of {}", self.names[of].name()), next));
            }
        }
    }

    /// A vehicle finds out about its own claim, and time passes.
    fn facts(&mut self, state: &State, vehicle: usize, moves: &mut Moves) {
        let (fleet, me) = (self.names.len(), self.names[vehicle].clone());
        let mut facts = Vec::new();
        if (0..fleet)
            .filter(|home| *home != vehicle)
            .all(|home| state.claims[home * fleet + vehicle].is_fresh)
        {
            facts.push(me.event(Confirmed { bthread: RIGHT_OF_WAY.into(), sync: 1 }));
        }
        facts.push(Event::timeout());
        for request in self.decisions.stated(state.vehicles[vehicle].rule).requests.clone() {
            if let Some(by) = self.kept_out_by(state, vehicle, request) {
                let by = format!("{}#{RIGHT_OF_WAY}", self.names[by].name());
                let event = self.decisions.event(request).name().into();
                facts.push(me.event(Stalled { event, by: by.into() }));
            }
        }
        if let Some((of, stood)) = state.vehicles[vehicle].aside {
            let way = &state.vehicles[of].way;
            let needs = |place: &Place| self.graph().narrow[*place] && way.contains(place);
            let still = [state.vehicles[vehicle].at(), stood].iter().any(needs);
            let mut next = state.clone();
            next.vehicles[vehicle].aside = None;
            let at = next.vehicles[vehicle].at();
            if let Some(way) = self.way(at, vehicle, &[]) {
                next.vehicles[vehicle].way = way;
            }
            let over = self.decisions.number(OutOfTheWay.at(me.name()));
            self.hear(&mut next, vehicle, over);
            self.tell(&mut next, vehicle);
            let why = if still { "for long enough" } else { "and the other is past" };
            moves.push((format!("{} has made way {why}", me.name()), next));
        }
        for fact in facts {
            let number = self.decisions.number(fact.clone());
            let mut next = state.clone();
            self.hear(&mut next, vehicle, number);
            if next.vehicles[vehicle].rule != state.vehicles[vehicle].rule {
                self.settle(&mut next, vehicle);
                moves.push((format!("{}: {fact}", me.name()), next));
            }
        }
    }

    /// A vehicle flies on, or finds another way, or that it is in the way.
    fn drive(&mut self, state: &State, vehicle: usize, moves: &mut Moves) -> Result<(), String> {
        let (me, graph) = (self.names[vehicle].clone(), self.graph());
        let flies = &state.vehicles[vehicle];
        let may_move = self.decisions.stated(flies.rule).may_move;
        let mut stands = true;
        if let Some(next_place) = flies.way.get(1).copied() {
            let exit = self.heading(next_place, flies.way.get(2).copied());
            let is_there = |other: &&Vehicle| graph.narrow[next_place] && other.at() == next_place;
            let there = state.vehicles.iter().find(is_there);
            if may_move && there.is_none() {
                stands = false;
                let mut next = state.clone();
                next.vehicles[vehicle].way.remove(0);
                next.vehicles[vehicle].entered = graph.narrow[next_place];
                self.tell(&mut next, vehicle);
                moves.push((format!("{} flies to {next_place}", me.name()), next));
            }
            if let Some(other) = there {
                let goes_along = self.heading(next_place, other.way.get(1).copied()) == exit;
                if may_move && other.entered && !goes_along {
                    return Err(format!("{} flies to {next_place}, where another is by right", me.name()));
                }
                let mut next = state.clone();
                if let Some(way) = self.way(flies.at(), vehicle, &self.taken(state, vehicle))
                    && way != flies.way
                {
                    next.vehicles[vehicle].way = way;
                    self.tell(&mut next, vehicle);
                    moves.push((format!("{} finds another way", me.name()), next));
                }
            }
        }
        if stands {
            self.be_in_the_way(state, vehicle, moves);
        }
        Ok(())
    }

    /// A vehicle that stands in a narrow place, or in the mouth of one, finds that it is in the way of the first of
    /// those who want to go through there, or to come out.
    fn be_in_the_way(&mut self, state: &State, vehicle: usize, moves: &mut Moves) {
        let (me, flies, graph) = (&self.names[vehicle], &state.vehicles[vehicle], self.graph());
        let (at, next_place) = (flies.at(), flies.way.get(1).copied());
        let exit = self.heading(at, next_place);
        let mouth = next_place.filter(|next| !graph.narrow[at] && graph.narrow[*next]);
        let wants_it = |other: &usize| {
            let way = &state.vehicles[*other].way;
            let comes_out = mouth.is_some_and(|inside| way.windows(2).any(|step| step == [inside, at]));
            let index = way.iter().skip(1).position(|place| *place == at && graph.narrow[at]);
            let goes_through =
                index.is_some_and(|index| self.heading(at, way.get(index + 2).copied()) != exit);
            comes_out || goes_through
        };
        let right = |other: usize| self.decisions.stated(state.vehicles[other].rule).right;
        let first =
            (0..self.names.len()).filter(|other| *other != vehicle).filter(wants_it).reduce(|first, next| {
                let [one, other] = [next, first].map(|index| (self.names[index].name(), right(index)));
                if goes_before(one, other) { next } else { first }
            });
        let Some(of) = first else { return };
        let report = InTheWay { of: self.names[of].name().into(), right: right(of) };
        let text = format!("{} is in the way of {}", me.name(), self.names[of].name());
        let event = me.event(report);
        let number = self.decisions.number(event);
        let mut next = state.clone();
        self.hear(&mut next, vehicle, number);
        if next.vehicles[vehicle].rule != flies.rule {
            next.vehicles[vehicle].aside = Some((of, mouth.unwrap_or(at)));
            self.settle(&mut next, vehicle);
            self.tell(&mut next, vehicle);
            moves.push((text, next));
        }
    }

    /// A vehicle that makes way flies a place further to its refuge, or finds that there is none.
    fn make_way(&mut self, state: &State, vehicle: usize, moves: &mut Moves) {
        let (me, graph) = (self.names[vehicle].clone(), self.graph());
        let flies = &state.vehicles[vehicle];
        let Some((of, stood)) = flies.aside else { return };
        let right = |other: usize| {
            (self.names[other].name(), self.decisions.stated(state.vehicles[other].rule).right)
        };
        let stays =
            |other: &usize| *other != vehicle && (*other == of || goes_before(right(*other), right(of)));
        let shut: Vec<_> =
            (0..self.names.len()).filter(stays).map(|other| state.vehicles[other].at()).collect();
        let taken = self.taken(state, vehicle);
        let own = &self.way(stood, vehicle, &[]).unwrap_or_default();
        let is_refuge = |place: Place| {
            let is_wanted = state.vehicles[of].way.contains(&place) || own.contains(&place);
            !graph.narrow[place] || !is_wanted && !taken.contains(&place)
        };
        let is_shut = |place: Place| graph.narrow[place] && shut.contains(&place);
        let mut next = state.clone();
        match graph.way(flies.at(), is_refuge, is_shut).as_deref() {
            Some([_]) => {}
            Some([_, to, ..]) if taken.contains(to) => {}
            Some([_, to, ..]) => {
                let Some(way) = self.way(*to, vehicle, &[]) else { return };
                next.vehicles[vehicle].way = way;
                next.vehicles[vehicle].entered = false;
                self.tell(&mut next, vehicle);
                moves.push((format!("{} makes way, to {to}", me.name()), next));
            }
            _ => {
                let event = me.event(Cornered { by: self.names[of].name().into() });
                let number = self.decisions.number(event);
                next.vehicles[vehicle].aside = None;
                self.hear(&mut next, vehicle, number);
                self.say(&mut next, vehicle, number);
                self.tell(&mut next, vehicle);
                moves.push((format!("{} is cornered", me.name()), next));
            }
        }
    }
}

fn story(came_from: &[(usize, String)], mut number: usize) -> Vec<String> {
    let mut story = Vec::new();
    while number != 0 {
        let (before, what) = &came_from[number];
        story.push(what.clone());
        number = *before;
    }
    story.reverse();
    story
}

/// The heading that is no bend beside either of two that are one, degrees.
fn between(last: i32, next: i32) -> Option<i32> {
    let is_bend =
        |one: i32, other: i32| (20..120).contains(&((one - other + 180).rem_euclid(360) - 180).abs());
    is_bend(last, next)
        .then(|| (0..360).find(|heading| !is_bend(last, *heading) && !is_bend(*heading, next)))?
}
