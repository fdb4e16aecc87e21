//! Travellers without dynamics: each is exactly where its commitment says.

use std::sync::Arc;

use super::places::Place;
use skein_planning::traffic::{Apart, Move, Roads, Traveller, TravellerConfig, closest};

/// Metres.
const RADIO_RANGE_M: f64 = 3.0;
/// How often each has its turn before a step.
const ROUNDS: usize = 2;

pub const CONFIG: TravellerConfig =
    TravellerConfig { apart: Apart { half_cells: 1.4, downwash: 2.0 }, budget: 60_000 };

/// What came of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Steps until all were at their goals together; `None` if they never were.
    pub steps: Option<u32>,
    /// Least distance of two vehicles, half cells, heights divided by the downwash.
    pub closest: f64,
    /// Turns in which a vehicle planned, and states expanded in all, and at most in one.
    pub turns: usize,
    pub expanded: usize,
    pub most_expanded: usize,
}

pub fn fly(place: &Place, most_steps: u32) -> Outcome {
    let (roads, agents) = (&place.roads, &place.trips);
    let mut travellers: Vec<Traveller> = (0..)
        .zip(agents)
        .map(|(number, (start, goal))| {
            Traveller::new(number, Arc::clone(roads), start, goal, CONFIG).unwrap()
        })
        .collect();
    let mut outcome =
        Outcome { steps: None, closest: f64::INFINITY, turns: 0, expanded: 0, most_expanded: 0 };
    for step in 1..most_steps {
        // First all say what they are committed to: some may have come into range.
        (0..travellers.len()).for_each(|index| speak(&mut travellers, index, step, roads));
        for _ in 0..ROUNDS {
            for index in 0..travellers.len() {
                if let Some(turn) = travellers[index].take_turn(step) {
                    outcome.turns += 1;
                    outcome.expanded += turn.expanded;
                    outcome.most_expanded = outcome.most_expanded.max(turn.expanded);
                }
                speak(&mut travellers, index, step, roads);
            }
        }
        let moves: Vec<Move> = travellers.iter().map(|traveller| traveller.movement(step).unwrap()).collect();
        for (index, one) in moves.iter().enumerate() {
            for other in &moves[..index] {
                let d = closest(one, other, CONFIG.apart.downwash);
                if d < 1.0 && std::env::var("TRACE").is_ok() {
                    eprintln!("MEET {index} {one:?} {other:?}");
                }
                outcome.closest = outcome.closest.min(closest(one, other, CONFIG.apart.downwash));
            }
        }
        if std::env::var("TRACE").is_ok() {
            trace(&travellers, step);
        }
        if travellers.iter().all(|traveller| traveller.is_home(step)) {
            outcome.steps = Some(step);
            break;
        }
    }
    outcome
}

fn trace(travellers: &[Traveller], step: u32) {
    if (200..206).contains(&step) {
        for t in travellers {
            let w = t.word();
            eprintln!(
                "  {} {:?} cornered {} goal {:?} left {} : {:?}",
                w.number,
                w.standing.convoy.number,
                w.cornered_until,
                w.goal.place.map(|p| p / 2),
                w.standing.left,
                w.itinerary
                    .states()
                    .iter()
                    .take(24)
                    .map(|s| [f64::from(s.place[0]) / 2.0, f64::from(s.place[1]) / 2.0])
                    .collect::<Vec<_>>()
            );
        }
    }
    let line: Vec<String> = travellers
        .iter()
        .map(|t| {
            let m = t.movement(step).unwrap().from;
            format!(
                "{}:{:?}{}",
                t.word().number,
                [m.place[0], m.place[1]].map(|p| f64::from(p) / 2.0),
                if t.word().standing.arrived { "*" } else { "" }
            )
        })
        .collect();
    eprintln!("{step} {}", line.join(" "));
}

/// Whoever is in range hears what a vehicle says and passes on.
fn speak(travellers: &mut [Traveller], speaker: usize, step: u32, roads: &Roads) {
    let place = |traveller: &Traveller| {
        let place = traveller.movement(step - 1).unwrap().place(0.5);
        roads.lattice().point(&place)
    };
    let from = place(&travellers[speaker]);
    let words: Vec<_> = travellers[speaker].words().cloned().collect();
    for (index, traveller) in travellers.iter_mut().enumerate() {
        if index != speaker && (place(traveller) - from).norm() < RADIO_RANGE_M {
            words.iter().for_each(|word| traveller.hear(word));
        }
    }
}
