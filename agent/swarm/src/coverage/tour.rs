//! A tour of all cells that can be reached from one another.

use nalgebra::Vector2;

use super::field::Field;
use super::lines::{Cell, Corner, ploughed};
use super::ways::{From, Ways};

/// With more cells than this, tours begin with the first alone.
const BEGIN_ANYWHERE: usize = 12;

/// One way over the cells of each part of a field; no way leads from one part to another.
pub fn tours(field: &Field<'_>, cells: &[Cell]) -> Vec<Vec<Vector2<f64>>> {
    let corners = cells.iter().flat_map(|cell| Corner::ALL.map(|corner| corner.of(cell)));
    let ways = Ways::new(field, corners.collect());
    let from: Vec<From> = (0..4 * cells.len()).map(|end| ways.from(end)).collect();
    let mut left: Vec<usize> = (0..cells.len()).collect();
    let mut tours = Vec::new();
    while let Some(&first) = left.first() {
        let is_reached = |cell: &usize| from[4 * first].length_m[4 * cell].is_finite();
        let (part, rest): (Vec<usize>, Vec<usize>) = left.into_iter().partition(is_reached);
        tours.push(tour(&part, cells, &ways, &from));
        left = rest;
    }
    tours
}

/// A cell and where it is entered.
type Visit = (usize, Corner);

/// The shortest of the tours that go to the nearest cell next, over cells of one part.
fn tour(part: &[usize], cells: &[Cell], ways: &Ways, from: &[From]) -> Vec<Vector2<f64>> {
    let begins = if part.len() > BEGIN_ANYWHERE { &part[..1] } else { part };
    let begins = begins.iter().flat_map(|cell| Corner::ALL.map(|corner| (*cell, corner)));
    let tours = begins.map(|begin| nearest_next(begin, part, cells, from));
    let Some((visits, _)) = tours.min_by(|one, other| one.1.total_cmp(&other.1)) else { return Vec::new() };
    let mut way: Vec<Vector2<f64>> = Vec::new();
    let mut left_at: Option<usize> = None;
    for (cell, corner) in visits {
        way.extend(left_at.iter().flat_map(|end| ways.between(&from[*end], 4 * cell + corner.index())));
        way.extend(ploughed(&cells[cell], corner));
        left_at = Some(4 * cell + corner.opposite(cells[cell].len()).index());
    }
    way.dedup();
    way
}

/// The visits of a tour that begins here, and the length of the ways between them, metres.
fn nearest_next(begin: Visit, part: &[usize], cells: &[Cell], from: &[From]) -> (Vec<Visit>, f64) {
    let mut left: Vec<usize> = part.iter().copied().filter(|cell| *cell != begin.0).collect();
    let (mut visits, mut length_m) = (vec![begin], 0.0);
    let mut last = begin;
    while !left.is_empty() {
        let (cell, corner) = last;
        let end = 4 * cell + corner.opposite(cells[cell].len()).index();
        let next_m = |(cell, corner): &Visit| from[end].length_m[4 * cell + corner.index()];
        let next = left.iter().flat_map(|cell| Corner::ALL.map(|corner| (*cell, corner)));
        let Some(next) = next.min_by(|one, other| next_m(one).total_cmp(&next_m(other))) else { break };
        length_m += next_m(&next);
        left.retain(|cell| *cell != next.0);
        visits.push(next);
        last = next;
    }
    (visits, length_m)
}
