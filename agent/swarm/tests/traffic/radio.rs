//! Travellers that are exactly where their commitments say, and hear one another within 3 m.

use skein_swarm::traffic::{Apart, Move, Traveller, TravellerConfig, closest};

use super::places::Place;

pub const APART: Apart = Apart { half_cells: 1.6, downwash: 2.0 };
const CONFIG: TravellerConfig = TravellerConfig { apart: APART, budget: 60_000 };
const RANGE_M: f64 = 3.0;
/// How often each has its turn before a step.
const ROUNDS: usize = 2;

/// The result of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// The step at which all were at their goals together; `None` if they never were.
    pub steps: Option<u32>,
    /// Least distance of two vehicles, half cells, heights divided by the downwash.
    pub closest: f64,
    /// States expanded in all plans together.
    pub expanded: usize,
}

/// Lets vehicles make their trips, for so many steps at most.
pub fn fly(place: &Place, most_steps: u32) -> Outcome {
    let mut travellers: Vec<Traveller> = (0..)
        .zip(&place.trips)
        .map(|(number, (start, goal))| {
            Traveller::new(number, place.roads.clone(), start, goal, CONFIG).unwrap()
        })
        .collect();
    let mut outcome = Outcome { steps: None, closest: f64::INFINITY, expanded: 0 };
    for step in 1..most_steps {
        // First all say what they are committed to: some may have come into range.
        (0..travellers.len()).for_each(|index| speak(&mut travellers, index, step));
        for _ in 0..ROUNDS {
            for index in 0..travellers.len() {
                outcome.expanded += travellers[index].take_turn(step).map_or(0, |turn| turn.expanded);
                speak(&mut travellers, index, step);
            }
        }
        let moves: Vec<Move> = travellers.iter().map(|traveller| traveller.movement(step).unwrap()).collect();
        for (index, one) in moves.iter().enumerate() {
            for other in &moves[..index] {
                outcome.closest = outcome.closest.min(closest(one, other, APART.downwash));
            }
        }
        if travellers.iter().all(|traveller| traveller.is_home(step)) {
            outcome.steps = Some(step);
            break;
        }
    }
    outcome
}

/// Whoever is in range hears what a vehicle says and passes on.
fn speak(travellers: &mut [Traveller], speaker: usize, step: u32) {
    let place = |traveller: &Traveller| {
        let place = traveller.movement(step - 1).unwrap().place(0.5);
        traveller.roads().lattice().point(&place)
    };
    let from = place(&travellers[speaker]);
    let words: Vec<_> = travellers[speaker].words().cloned().collect();
    for (index, traveller) in travellers.iter_mut().enumerate() {
        if index != speaker && (place(traveller) - from).norm() < RANGE_M {
            words.iter().for_each(|word| traveller.hear(word));
        }
    }
}
