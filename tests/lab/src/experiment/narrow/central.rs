//! The central planner with the map known, beside which the swarm's time is judged: everybody's traveller in one place,
//! with a radio that reaches everywhere, and flown exactly.

use std::sync::Arc;

use nalgebra::Vector3;
use skein_swarm::traffic::{Apart, Lattice, Roads, Traveller, TravellerConfig};

use super::place::Place;

/// Cells of the lattice are about so long, m: as fast as the vehicles cruise, they accelerate as those do.
const CELL_M: f64 = 0.8;
/// The distance from centre to centre that it keeps, m.
const KEPT_M: f64 = 1.0;
/// The distance of centres from walls, m.
const CLEAR_M: f64 = 0.35;
/// Most states that a plan expands.
const BUDGET: usize = 60_000;
/// Turns of each before a step.
const ROUNDS: usize = 2;
/// Steps after which nobody arrives any more.
const MOST_STEPS: u32 = 2000;

/// The vehicles of a place on its map.
pub struct Central {
    travellers: Vec<Traveller>,
    step_s: f64,
}

impl Central {
    /// Vehicles that cruise at this speed, m/s; each starts and ends in the middle of the nearest cell.
    ///
    /// # Errors
    /// A vehicle has no way on the lattice.
    pub fn new(place: &Place, cruise_m_s: f64) -> anyhow::Result<Self> {
        // The middle of a corridor is a line of the lattice, whatever its width.
        let cell_m = place.width_m / (place.width_m / CELL_M).floor().max(1.0);
        let level = |[x, y]: [f64; 2]| Vector3::new(x, y, 0.0);
        let [least, most] = place.extent_m().map(level);
        let lattice = Lattice::new(least, most, level([place.width_m / 2.0; 2]), cell_m);
        let roads = Arc::new(Roads::new(lattice, |point| place.clearance_m([point.x, point.y]), CLEAR_M));
        let config = TravellerConfig {
            apart: Apart { half_cells: 2.0 * KEPT_M / cell_m, downwash: 1.0 },
            budget: BUDGET,
        };
        let traveller = |(number, [from, to]): (u32, &[[f64; 2]; 2])| {
            Traveller::new(number, Arc::clone(&roads), &level(*from), &level(*to), config)
        };
        let travellers = (0..).zip(place.routes()).map(traveller).collect::<Result<_, _>>()?;
        Ok(Self { travellers, step_s: cell_m / cruise_m_s })
    }

    /// The vehicle with the longest way.
    pub fn longest(&self) -> usize {
        let way = |index: &usize| self.travellers.get(*index).map(|one| one.word().standing.left);
        (0..self.travellers.len()).max_by_key(way).unwrap_or_default()
    }

    /// The time until all rest at their goals, s; `None` if it does not bring them there, as happens in dead ends: its
    /// rule is not complete.
    pub fn time_s(mut self) -> Option<f64> {
        let vehicles = self.travellers.len();
        let last = (1..MOST_STEPS).find(|step| {
            for speaker in (0..ROUNDS).flat_map(|_| 0..vehicles) {
                self.take_turn(speaker, *step);
            }
            self.travellers.iter().all(|one| one.is_home(*step))
        });
        last.map(|step| f64::from(step) * self.step_s)
    }

    fn take_turn(&mut self, speaker: usize, step: u32) {
        let Some(traveller) = self.travellers.get_mut(speaker) else { return };
        traveller.take_turn(step);
        let word = traveller.word().clone();
        self.travellers.iter_mut().for_each(|other| other.hear(&word));
    }
}

#[cfg(test)]
mod tests {
    use super::super::place::{Shape, draw};
    use super::*;

    #[test]
    fn between_rooms_all_arrive_and_no_sooner_than_the_longest_way_takes() {
        let rooms = [Shape::Corridor, Shape::Bend, Shape::Crossing, Shape::Junction, Shape::Door];
        for (shape, seed) in rooms.into_iter().zip(1..) {
            let place = draw(shape, 6, seed);
            let central = Central::new(&place, 1.5).expect("a way");
            let alone_s = central.travellers.iter().map(|one| f64::from(one.word().standing.left));
            let alone_s = alone_s.fold(0.0, f64::max) * central.step_s;
            let time_s = central.time_s().expect("all arrive");
            assert!((alone_s..100.0).contains(&time_s), "{shape:?} {seed}: {time_s} {alone_s}");
        }
    }
}
