//! The improved particle swarm with a tabu search beside it (P3): what the ground plans with.

use std::collections::VecDeque;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::modes::Modes;
use super::swarm::unit;
use super::{Best, Improved, ImprovedConfig, Objective, SearchSpace, Swarm};

/// The turns of swarm and tabu search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TabuConfig {
    pub swarm: ImprovedConfig,
    /// Generations of the swarm between two turns of the tabu search.
    pub generations: usize,
    /// Moves of the tabu search in a turn.
    pub moves: usize,
    /// Candidate solutions looked at for each move.
    pub candidates: usize,
    /// Moves that are remembered as tabu.
    pub tenure: usize,
    /// A swarm whose best has gained less than this share since it was last looked at sticks: it is the search's turn.
    pub least_gain: f64,
    /// The longest and the shortest candidate, as shares of the box's width.
    pub reach: (f64, f64),
}

impl Default for TabuConfig {
    fn default() -> Self {
        TabuConfig {
            swarm: ImprovedConfig::default(),
            generations: 5,
            moves: 10,
            candidates: 6,
            tenure: 8,
            least_gain: 0.01,
            reach: (0.05, 0.0005),
        }
    }
}

/// The change of a move: the mode of a chain, rising or falling.
type Feature = (usize, bool);

/// The improved swarm, and a tabu search (Glover 1989) that sets out, turn by turn, from the best it has found.
///
/// A candidate solution changes one mode of one chain of coordinates. Of a few drawn at random the best is moved to,
/// even if it is worse; to undo one of the last moves is tabu, unless that gives the best position found so far. So
/// the search climbs out of a local minimum instead of falling back. What it finds leads the swarm.
#[derive(Clone, Debug)]
pub struct TabuSwarm {
    config: TabuConfig,
    swarm: Swarm<Improved>,
    modes: Modes,
    rng: ChaCha8Rng,
    tabu: VecDeque<Feature>,
    here: Best,
    /// The best candidate of the present move.
    next: Option<(Feature, Best)>,
    /// The swarm's best cost when it was last looked at.
    at_last_look: f64,
    /// Evaluations of the tabu search, in its latest turn and in all.
    in_turn: usize,
    spent: usize,
    amplitudes: Vec<f64>,
    candidate: Vec<f64>,
}

impl TabuSwarm {
    /// A swarm of `size` particles at places drawn evenly from the whole box: the same that [`Swarm::new`] draws.
    pub fn new(space: &SearchSpace, config: TabuConfig, size: usize, seed: u64) -> TabuSwarm {
        let swarm = Swarm::new(space, Improved::new(space, config.swarm), size, seed);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(1);
        TabuSwarm {
            config,
            here: swarm.best().clone(),
            swarm,
            modes: Modes::new(space.chain()),
            rng,
            tabu: VecDeque::new(),
            next: None,
            at_last_look: f64::INFINITY,
            in_turn: config.moves * config.candidates,
            spent: 0,
            amplitudes: vec![0.0; space.dimensions()],
            candidate: vec![0.0; space.dimensions()],
        }
    }

    /// Goes on for so many evaluations.
    pub fn run(&mut self, objective: &mut impl Objective, evaluations: usize) {
        for _ in 0..evaluations {
            self.step(objective);
        }
    }

    /// Spends one evaluation.
    pub fn step(&mut self, objective: &mut impl Objective) {
        if self.in_turn < self.config.moves * self.config.candidates {
            self.look(objective);
            return;
        }
        self.swarm.step(objective);
        let round = self.config.generations * self.swarm.size();
        if self.swarm.evaluations().is_multiple_of(round.max(1)) {
            if self.swarm.best().cost > (1.0 - self.config.least_gain) * self.at_last_look {
                self.in_turn = 0;
            }
            self.at_last_look = self.swarm.best().cost;
        }
    }

    /// Evaluates a candidate, and after enough of them moves.
    fn look(&mut self, objective: &mut impl Objective) {
        if self.in_turn == 0 {
            self.here.clone_from(self.swarm.best());
            self.tabu.clear();
            self.next = None;
        }
        let feature = self.draw(objective.space());
        let next_cost = self.next.as_ref().map_or(f64::INFINITY, |(_, next)| next.cost);
        let cost = objective.cost_below(next_cost.max(self.swarm.best().cost), &self.candidate);
        self.in_turn += 1;
        self.spent += 1;
        let is_best = cost < self.swarm.best().cost;
        self.swarm.learn(&self.candidate, cost);
        let is_allowed = is_best || !self.tabu.contains(&feature);
        if is_allowed && cost < next_cost {
            self.next = Some((feature, Best { position: self.candidate.clone(), cost }));
        }
        if self.in_turn.is_multiple_of(self.config.candidates)
            && let Some(((mode, is_rising), next)) = self.next.take()
        {
            self.here = next;
            self.tabu.push_back((mode, !is_rising));
            if self.tabu.len() > self.config.tenure {
                self.tabu.pop_front();
            }
        }
    }

    /// Draws a candidate near where the search is.
    fn draw(&mut self, space: &SearchSpace) -> Feature {
        let dimension = self.rng.random_range(0..space.dimensions());
        let is_rising: bool = self.rng.random();
        let share = unit(&mut self.rng);
        let (longest, shortest) = self.config.reach;
        let mode = (dimension % space.chain() + 1) as f64;
        let length =
            longest * (share * (shortest / longest).ln()).exp() * (space.chain() as f64).sqrt() / mode;
        self.amplitudes.fill(0.0);
        self.amplitudes[dimension] = space.width(dimension) * if is_rising { length } else { -length };
        self.modes.transform(&self.amplitudes, &mut self.candidate);
        for (dimension, (value, here)) in self.candidate.iter_mut().zip(&self.here.position).enumerate() {
            *value = space.clamp(dimension, here + *value);
        }
        (dimension, is_rising)
    }

    /// The best found so far.
    pub fn best(&self) -> &Best {
        self.swarm.best()
    }

    /// Evaluations spent so far.
    pub fn evaluations(&self) -> usize {
        self.swarm.evaluations() + self.spent
    }
}
