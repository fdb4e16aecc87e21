//! One vehicle in traffic: hears the others' words, plans for itself, commits itself by one step in its turn, and
//! says so.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Vector3;
use thiserror::Error;

use super::encounter::Apart;
use super::itinerary::Itinerary;
use super::lattice::{Move, State};
use super::roads::{Distances, Roads};
use super::search::{self, Request, Scratch};
use super::standing::{Rank, Standing};

/// A vehicle that has not been heard of for so many steps has changed its mind since.
const FORGOTTEN_AFTER: u32 = 8;
/// A vehicle that cannot escape is gone around for so many steps: enough to let another out of a corridor that both
/// want.
const CORNERED_FOR: u32 = 12;
/// A vehicle at its goal is believed to stay there for so many steps by those that it goes before.
const STAYS_FOR: u32 = 20;
/// A vehicle that has rested for so many steps away from its goal does not wait for its turn any longer.
const PATIENCE: u32 = 30;
/// Another standing is lent for so many steps.
const LENT_FOR: u32 = 12;

/// The word of a vehicle to the others in its turn.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Word {
    /// Its number, which no other has.
    pub number: u32,
    /// The step whose beginning it was said for.
    pub said_for: u32,
    /// Grows with every word.
    pub sequence: u32,
    /// Its plan, to its goal, from the step before on, which is being flown.
    pub itinerary: Itinerary,
    /// It keeps to its plan until this step, and brakes then unless it says otherwise.
    pub committed: u32,
    /// The order of vehicles: which plans around which.
    pub standing: Standing,
    /// The narrow places on its way, from which cell into which.
    pub lanes: Vec<Lane>,
    /// Where it rests once it has arrived.
    pub goal: State,
    /// It rests, has found no way to escape those that go before, and will hardly have moved before this step.
    pub cornered_until: u32,
}

impl Word {
    /// Where it comes to rest if it says nothing more.
    fn last_commitment(&self) -> Option<State> {
        self.itinerary.at(self.committed).map(|state| state.braked())
    }

    /// Whether it rests at its goal and plans to stay.
    fn is_settled(&self) -> bool {
        self.itinerary.states().iter().all(|state| *state == self.goal)
    }
}

/// A step from a cell into the next, in a place with room for one.
pub type Lane = ([i16; 3], [i16; 3]);

/// The settings of a vehicle in traffic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TravellerConfig {
    /// The distance kept from others.
    pub apart: Apart,
    /// Most states that a search expands.
    pub budget: usize,
}

/// Why a vehicle cannot take part.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum TravellerError {
    #[error(
        "vehicle {number}: its {what} ({x}, {y}, {z}) m is outside the bounds or too near an obstacle; move it"
    )]
    Place { number: u32, what: &'static str, x: f64, y: f64, z: f64 },
    #[error("vehicle {number}: no way leads from its start to its goal; obstacles close every one")]
    NoWay { number: u32 },
}

/// The result of a turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Turn {
    pub expanded: usize,
    /// Whether the plan keeps its distance from all that go before.
    pub is_clear: bool,
}

/// A vehicle in traffic.
#[derive(Debug, Clone)]
pub struct Traveller {
    roads: Arc<Roads>,
    distances: Distances,
    config: TravellerConfig,
    word: Word,
    /// Where it stands by itself.
    standing: Standing,
    /// The step from which on it has rested where it is.
    rests_since: u32,
    /// The standing that it has instead, and until which step.
    lent: Option<(Standing, u32)>,
    is_hindered: bool,
    heard: BTreeMap<u32, Word>,
    scratch: Scratch,
}

impl Traveller {
    /// A vehicle at rest in the cell of `start`, on its way to that of `goal` (world ENU, m).
    pub fn new(
        number: u32,
        roads: Arc<Roads>,
        start: &Vector3<f64>,
        goal: &Vector3<f64>,
        config: TravellerConfig,
    ) -> Result<Self, TravellerError> {
        let state = |what, point: &Vector3<f64>| {
            let state = roads.lattice().nearest(point).filter(|state| roads.is_open(state));
            let [x, y, z] = (*point).into();
            state.ok_or(TravellerError::Place { number, what, x, y, z })
        };
        let (start, goal) = (state("start", start)?, state("goal", goal)?);
        let distances = roads.distances(goal);
        let way = distances.steps_from(&roads, &start).ok_or(TravellerError::NoWay { number })?;
        let own = Rank { way: std::cmp::Reverse(way), number };
        let word = Word {
            number,
            said_for: 0,
            sequence: 0,
            itinerary: Itinerary::resting(0, start),
            committed: 0,
            standing: Standing { arrived: start == goal, convoy: own, left: way, own },
            lanes: lanes(&roads, &roads.route(start, &distances)),
            goal,
            cornered_until: 0,
        };
        Ok(Self {
            roads,
            distances,
            config,
            standing: word.standing,
            rests_since: 0,
            lent: None,
            word,
            is_hindered: false,
            heard: BTreeMap::new(),
            scratch: Scratch::default(),
        })
    }

    /// Its own word, and the words that it has heard of the others: all of it is passed on.
    pub fn words(&self) -> impl Iterator<Item = &Word> {
        std::iter::once(&self.word).chain(self.heard.values())
    }

    /// Where it can fly.
    pub fn roads(&self) -> &Roads {
        &self.roads
    }

    pub fn word(&self) -> &Word {
        &self.word
    }

    /// Takes in a word, its own author's or passed on.
    pub fn hear(&mut self, word: &Word) {
        let is_new = self.heard.get(&word.number).is_none_or(|known| known.sequence < word.sequence);
        if is_new && word.number != self.word.number {
            self.heard.insert(word.number, word.clone());
        }
    }

    /// Its move from `step` to the next, as far as it is committed.
    pub fn movement(&self, step: u32) -> Option<Move> {
        self.word.itinerary.committed(step, self.word.committed)
    }

    /// Whether it rests at its goal at `step`.
    pub fn is_home(&self, step: u32) -> bool {
        self.movement(step).is_some_and(|movement| movement.from == self.word.goal)
    }

    /// Its turn, before `step` begins: plans from there on and commits itself to the move from `step` to the next.
    ///
    /// To be taken once or more for each step, by one vehicle at a time among those that hear one another.
    /// A second turn for the same step does nothing unless a commitment of another was in the way at the first.
    pub fn take_turn(&mut self, step: u32) -> Option<Turn> {
        if self.word.said_for == step && self.word.sequence > 0 && !self.is_hindered {
            return None;
        }
        self.heard.retain(|_, word| word.said_for + FORGOTTEN_AFTER >= step);
        let start = self.movement(step)?.from;
        let flown_from = self.movement(step.saturating_sub(1))?.from;
        self.stand(start);
        if flown_from != start || start == self.word.goal {
            self.rests_since = step;
        }
        self.word.standing = self.present_standing(step, start);
        let found = self.search(step, start);
        self.is_hindered = found.is_hindered;
        if !found.is_clear && found.itinerary.at(step + 1) == Some(start) {
            self.word.cornered_until = step + CORNERED_FOR;
        }
        self.word.itinerary = found.itinerary.after(flown_from);
        self.word.committed = step + 1;
        self.word.said_for = step;
        self.word.sequence += 1;
        Some(Turn { expanded: found.expanded, is_clear: found.is_clear })
    }

    fn search(&mut self, step: u32, start: State) -> search::Found {
        // Whoever is near enough to meet has spoken for this step or the last.
        let near = self.heard.values().filter(|word| word.said_for + 1 >= step);
        let committed: Vec<_> = near
            .filter_map(|word| {
                let at = |step| word.itinerary.committed(step, word.committed);
                Some([at(step)?, at(step + 1)?, at(step + 2)?])
            })
            .collect();
        let (before, behind): (Vec<&Word>, Vec<&Word>) =
            self.heard.values().partition(|word| word.standing < self.word.standing);
        // Who rests at its goal stays there, for those behind it; and whoever cannot make way is waited for, whatever
        // its standing.
        let settled = before.iter().filter(|word| word.is_settled()).map(|word| (word, step + STAYS_FOR));
        let cornered =
            behind.iter().map(|word| (word, word.cornered_until)).filter(|(_, until)| *until > step);
        let staying: Vec<_> = settled
            .chain(cornered)
            .filter_map(|(word, until)| Some(Itinerary::waiting(step, word.last_commitment()?, until)))
            .collect();
        let before: Vec<_> = before.into_iter().map(|word| &word.itinerary).chain(&staying).collect();
        let resting: Vec<_> =
            behind.into_iter().filter(|word| word.standing.arrived).map(|word| word.goal).collect();
        let request = Request {
            roads: &self.roads,
            distances: &self.distances,
            step,
            start,
            apart: self.config.apart,
            committed: &committed,
            before: &before,
            resting: &resting,
        };
        search::plan(&request, self.config.budget, &mut self.scratch)
    }

    /// Its own standing, or the one lent to it.
    fn present_standing(&mut self, step: u32, start: State) -> Standing {
        if step >= self.rests_since + PATIENCE {
            self.lent = Some((self.lent_standing(step, start), step + LENT_FOR));
        }
        self.lent = self.lent.filter(|(_, until)| step < *until);
        self.lent.map_or(self.standing, |(lent, _)| lent.min(self.standing))
    }

    /// The standing that it has for a while after it has rested for long away from its goal. In the way of one that
    /// goes before it has that one's, but for that one itself: who is in its own way out makes way in turn (priority
    /// inheritance: Sha 1990). Else, if it has been at its goal, it has its own from before: who rests at its own
    /// goal in front of it makes way.
    fn lent_standing(&self, step: u32, start: State) -> Standing {
        let rest = Move { from: start, to: start };
        let crosses = |word: &&Word| {
            let mut movements = (step..step + LENT_FOR).filter_map(|step| word.itinerary.movement(step));
            movements.any(|movement| self.config.apart.is_broken(&movement, &rest))
        };
        let before = self.heard.values().filter(|word| word.standing < self.standing && !word.is_settled());
        let first = before.filter(crosses).map(|word| word.standing).min();
        first.map_or(Standing { arrived: false, ..self.standing }, |first| Standing {
            left: first.left.saturating_add(1),
            own: self.standing.own,
            ..first
        })
    }

    /// Finds its standing among those it hears.
    fn stand(&mut self, state: State) {
        let standing = &mut self.standing;
        standing.arrived |= state == self.word.goal;
        self.word.lanes = lanes(&self.roads, &self.roads.route(state, &self.distances));
        let leaders = self.heard.values().filter(|word| !word.standing.arrived);
        let same_way = leaders.filter(|word| go_the_same_way(&self.word.lanes, &word.lanes));
        let first = same_way.map(|word| word.standing.convoy).min();
        if let Some(convoy) = first.filter(|convoy| *convoy < standing.convoy) {
            standing.convoy = convoy;
        }
    }
}

/// The steps of a way that lead into or out of a cell which has room for one only, between two walls.
fn lanes(roads: &Roads, route: &[[i16; 3]]) -> Vec<Lane> {
    let steps = route.windows(2).filter_map(|pair| <[[i16; 3]; 2]>::try_from(pair).ok());
    steps.filter(|[from, to]| is_narrow(roads, *from, *to)).map(|[from, to]| (from, to)).collect()
}

fn is_narrow(roads: &Roads, from: [i16; 3], to: [i16; 3]) -> bool {
    let changed: Vec<usize> = (0..3).filter(|axis| from[*axis] != to[*axis]).collect();
    let [along] = changed[..] else { return false };
    let walled = |cell: [i16; 3]| {
        (0..3).filter(|axis| *axis != along).all(|axis| {
            [-1, 1].into_iter().all(|side| {
                let mut beside = cell;
                beside[axis] += side;
                !roads.is_cell_open(beside)
            })
        })
    };
    walled(from) || walled(to)
}

fn go_the_same_way(own: &[Lane], other: &[Lane]) -> bool {
    own.iter().any(|lane| other.contains(lane)) && !own.iter().any(|(from, to)| other.contains(&(*to, *from)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::traffic::roads::room;

    const CONFIG: TravellerConfig =
        TravellerConfig { apart: Apart { half_cells: 1.4, downwash: 1.0 }, budget: 10_000 };

    fn cell(x: f64, y: f64) -> Vector3<f64> {
        Vector3::new(x, y, 0.0) * 0.5
    }

    fn traveller(number: u32, roads: &Arc<Roads>, start: f64, goal: f64) -> Traveller {
        Traveller::new(number, Arc::clone(roads), &cell(start, 0.0), &cell(goal, 0.0), CONFIG)
            .expect("there is a way")
    }

    #[test]
    fn alone_it_flies_the_shortest_way() {
        let roads = Arc::new(room(&["......"]));
        let mut alone = traveller(1, &roads, 0.0, 5.0);
        let arrival = (1..20).find(|step| {
            alone.take_turn(*step);
            alone.is_home(*step)
        });
        assert_eq!(arrival, Some(7), "a step for each of five cells, and one to start, from step 1 on");
    }

    #[test]
    fn planning_the_next_step_does_not_change_the_one_being_flown() {
        let roads = Arc::new(room(&["......"]));
        let mut traveller = traveller(1, &roads, 0.0, 5.0);
        for step in 1..10 {
            let being_flown = traveller.movement(step - 1);
            traveller.take_turn(step);
            assert_eq!(traveller.movement(step - 1), being_flown, "step {step}");
        }
    }

    #[test]
    fn whoever_hears_nothing_more_comes_to_rest() {
        let roads = Arc::new(room(&["......"]));
        let mut traveller = traveller(1, &roads, 0.0, 5.0);
        traveller.take_turn(1);
        traveller.take_turn(2);
        let stops_in = traveller.movement(9).map(|movement| movement.to);
        assert_eq!(stops_in, Some(State::at_rest([2, 0, 0])));
    }

    #[test]
    fn the_same_way_through_a_corridor_makes_a_convoy() {
        let roads = Arc::new(room(&["..#####..", ".........", "..#####.."]));
        let start =
            |number, x| Traveller::new(number, Arc::clone(&roads), &cell(x, 1.0), &cell(8.0, 1.0), CONFIG);
        let (mut leader, mut follower) = (start(1, 0.0).expect("a way"), start(2, 1.0).expect("a way"));
        let mut oncoming =
            Traveller::new(3, Arc::clone(&roads), &cell(8.0, 1.0), &cell(1.0, 1.0), CONFIG).expect("a way");
        leader.take_turn(1);
        for other in [&mut follower, &mut oncoming] {
            other.hear(leader.word());
            other.take_turn(1);
        }
        assert_eq!(follower.word().standing.convoy, leader.word().standing.own);
        assert_eq!(oncoming.word().standing.convoy, oncoming.word().standing.own);
    }

    #[test]
    fn a_second_turn_is_for_those_who_were_hindered() {
        let roads = Arc::new(room(&["......"]));
        let (mut ahead, mut behind) = (traveller(1, &roads, 1.0, 5.0), traveller(2, &roads, 0.0, 4.0));
        behind.hear(ahead.word());
        behind.take_turn(1);
        assert!(behind.movement(1).is_some_and(|movement| movement.from == movement.to), "the cell is taken");
        ahead.take_turn(1);
        behind.hear(ahead.word());
        assert!(behind.take_turn(1).is_some());
        assert!(
            behind.movement(1).is_some_and(|movement| movement.from != movement.to),
            "they leave together"
        );
        assert_eq!(ahead.take_turn(1), None);
    }

    /// Lets all hear one another and take their turns for one step.
    fn everyone_goes_on(all: &mut [Traveller], step: u32) {
        for speaker in 0..all.len() {
            all[speaker].take_turn(step);
            let word = all[speaker].word().clone();
            all.iter_mut().for_each(|listener| listener.hear(&word));
        }
    }

    #[test]
    fn who_has_been_at_its_goal_gets_back_to_it_past_one_that_rests_at_its_own() {
        let roads = Arc::new(room(&["###.###", "......."]));
        let (mut rests, mut returns) = (traveller(1, &roads, 3.0, 3.0), traveller(2, &roads, 5.0, 1.0));
        rests.standing.convoy.way = std::cmp::Reverse(100);
        returns.standing.arrived = true;
        let mut all = [rests, returns];
        let home = (1..100).find(|step| {
            everyone_goes_on(&mut all, *step);
            all.iter().all(|traveller| traveller.is_home(*step))
        });
        assert!(home.is_some_and(|step| step > PATIENCE), "{home:?}");
    }

    #[test]
    fn who_stands_in_the_way_for_long_goes_right_after_the_one_whose_way_it_is() {
        let roads = Arc::new(room(&["......."]));
        let (first, stands) = (traveller(1, &roads, 0.0, 6.0), traveller(2, &roads, 4.0, 1.0));
        let by_itself = stands.standing;
        let mut all = [first, stands];
        let standings: Vec<Standing> = (1..PATIENCE + 10)
            .map(|step| {
                everyone_goes_on(&mut all, step);
                all[1].word().standing
            })
            .collect();
        let first = all[0].word().standing;
        assert_eq!(standings[0], by_itself);
        assert!(standings.iter().any(|standing| first < *standing && standing.convoy == first.convoy));
    }

    #[test]
    fn a_start_inside_a_wall_is_refused_by_name() {
        let roads = Arc::new(room(&["..#..."]));
        let refused = Traveller::new(7, Arc::clone(&roads), &cell(2.0, 0.0), &cell(4.0, 0.0), CONFIG);
        assert!(refused.is_err_and(|error| error.to_string().contains("vehicle 7: its start")));
        let cut_off = Traveller::new(8, roads, &cell(0.0, 0.0), &cell(4.0, 0.0), CONFIG);
        assert_eq!(cut_off.err(), Some(TravellerError::NoWay { number: 8 }));
    }
}
