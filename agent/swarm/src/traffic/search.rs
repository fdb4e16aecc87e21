//! A way through space and time, around what others have announced: A* over states and steps (Silver 2005, "Cooperative
//! pathfinding"), on the lattice of [`Roads`].
//!
//! Costs, in the order in which they count: meeting the plan of one that goes before, being where it will be a step
//! later, time, passing over one that rests at its goal, way. A meeting is dear and not forbidden: whoever cannot
//! escape gets as far away as it can, and plans again a step later. What *is* forbidden is a first step that is not
//! compatible with what the others are committed to. Who makes way at the last moment would have the one that goes
//! before wait for its commitment, and plan to go a step later, for which the last moment is a step later too; so
//! making way early is cheaper.
//!
//! After the last announced move the search no longer tells steps apart, so its effort is bounded by states times
//! announced steps; it ends at its budget of expansions with the best that it has.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::encounter::Apart;
use super::itinerary::Itinerary;
use super::lattice::{Move, State};
use super::roads::{Distances, Roads, travelled};

const STEP_COST: u32 = 100;
const HALF_CELL_COST: u32 = 1;
const MEETING_COST: u32 = 3000;
const DISTURBANCE_COST: u32 = 60;
const TARRYING_COST: u32 = 120;

/// The question of one vehicle.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// Where one can fly.
    pub roads: &'a Roads,
    pub distances: &'a Distances,
    /// The step at which its way begins.
    pub step: u32,
    /// Its state then.
    pub start: State,
    /// The distance to be kept.
    pub apart: Apart,
    /// The moves of others until they have come to rest, whatever comes: from `step` on three moves each.
    pub committed: &'a [[Move; 3]],
    /// The plans of those that go before.
    pub before: &'a [&'a Itinerary],
    /// Those who rest at their goals, and would have to make way.
    pub resting: &'a [State],
}

/// The result of a search.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found {
    /// The way, from the request's step on.
    pub itinerary: Itinerary,
    /// Whether it keeps its distance from all plans that go before.
    pub is_clear: bool,
    /// Whether the commitments of others forbid a first step that leads nearer to the goal.
    pub is_hindered: bool,
    pub expanded: usize,
}

/// Memory that searches share.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    nodes: Vec<Node>,
    open: BinaryHeap<Reverse<(u32, u32, u32)>>,
    closed: Vec<u64>,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    state: State,
    cost: u32,
    parent: u32,
    /// Steps since the beginning.
    step: u32,
}

const NO_PARENT: u32 = u32::MAX;

/// Finds a way; `budget` is the greatest number of expansions.
pub fn plan(request: &Request<'_>, budget: usize, scratch: &mut Scratch) -> Found {
    let traffic = Traffic::new(request);
    let mut expanded = 0;
    let mut is_hindered = false;
    scratch.reset(request.roads.state_count() * (traffic.horizon() as usize + 1));
    scratch.push(request, Node { state: request.start, cost: 0, parent: NO_PARENT, step: 0 });
    let mut best = None;
    while let Some(index) = scratch.pop() {
        let Some(node) = scratch.nodes.get(index as usize).copied() else { break };
        if !scratch.close(request.roads, &node, &traffic) {
            continue;
        }
        best = Some(index);
        if traffic.is_over(&node) || expanded == budget {
            break;
        }
        expanded += 1;
        for after in request.roads.exits(node.state) {
            let movement = Move { from: node.state, to: after };
            if node.step == 0 && !traffic.allows(&movement) {
                is_hindered |= request.is_nearer(&movement);
                continue;
            }
            let cost = node.cost + traffic.cost(node.step, &movement);
            scratch.push(request, Node { state: after, cost, parent: index, step: node.step + 1 });
        }
    }
    let states = scratch.way_to(best);
    // A vehicle that may do nothing else brakes: that is what it is committed to in any case.
    let itinerary = match states.as_slice() {
        [] | [_] if !request.start.is_at_rest() => Itinerary::new(request.step, vec![request.start]),
        [] => Itinerary::resting(request.step, request.start),
        _ => Itinerary::new(request.step, states),
    };
    let is_clear = !traffic.meets(&itinerary);
    Found { itinerary, is_clear, is_hindered, expanded }
}

impl Request<'_> {
    fn is_nearer(&self, movement: &Move) -> bool {
        let left = |state| self.distances.steps_from(self.roads, state).unwrap_or(u16::MAX);
        left(&movement.to) < left(&movement.from)
    }
}

/// The moves of the others, step by step.
struct Traffic<'a> {
    request: &'a Request<'a>,
    /// The moves of those that go before.
    before: Vec<Vec<Move>>,
    /// From this step on nobody that goes before comes near the goal.
    goal_free_from: u32,
}

impl<'a> Traffic<'a> {
    fn new(request: &'a Request<'a>) -> Self {
        let horizon = request.before.iter().map(|plan| plan.end().saturating_sub(request.step)).max();
        let horizon = horizon.unwrap_or(0);
        let moves_at = |step: u32| -> Vec<Move> {
            let moves = request.before.iter().filter(|plan| plan.end() > request.step + step);
            moves.filter_map(|plan| plan.movement(request.step + step)).collect()
        };
        let before: Vec<_> = (0..horizon).map(moves_at).collect();
        let goal = request.distances.goal();
        let stay = Move { from: goal, to: goal };
        let meets_goal =
            |moves: &Vec<Move>| moves.iter().any(|movement| request.apart.is_broken(movement, &stay));
        let goal_free_from = before.iter().rposition(meets_goal).map_or(0, |step| step as u32 + 1);
        Self { request, before, goal_free_from }
    }

    fn horizon(&self) -> u32 {
        self.before.len() as u32
    }

    /// Whether the first step is compatible with what the others are committed to, when the vehicle then brakes.
    fn allows(&self, first: &Move) -> bool {
        let braking = Move { from: first.to, to: first.to.braked() };
        let rest = Move { from: braking.to, to: braking.to };
        let own = [*first, braking, rest];
        let meets = |moves: &[Move; 3]| {
            own.iter().zip(moves).any(|(own, other)| self.request.apart.is_broken(own, other))
        };
        !self.request.committed.iter().any(meets)
    }

    fn cost(&self, step: u32, movement: &Move) -> u32 {
        let apart = &self.request.apart;
        let mut cost = STEP_COST + HALF_CELL_COST * travelled(&movement.from, &movement.to);
        if let Some(moves) = self.before.get(step as usize)
            && moves.iter().any(|other| apart.is_broken(movement, other))
        {
            cost += MEETING_COST;
        } else if let Some(moves) = self.before.get(step as usize + 1)
            && moves.iter().any(|other| apart.is_broken(movement, other))
        {
            cost += TARRYING_COST;
        }
        let disturbs = |rest: &State| apart.is_broken(movement, &Move { from: *rest, to: *rest });
        if self.request.resting.iter().any(disturbs) {
            cost += DISTURBANCE_COST;
        }
        cost
    }

    fn is_over(&self, node: &Node) -> bool {
        node.state == self.request.distances.goal() && node.step >= self.goal_free_from
    }

    fn meets(&self, itinerary: &Itinerary) -> bool {
        self.before.iter().zip(self.request.step..).any(|(moves, step)| {
            itinerary
                .movement(step)
                .is_some_and(|own| moves.iter().any(|other| self.request.apart.is_broken(&own, other)))
        })
    }
}

impl Scratch {
    fn reset(&mut self, states: usize) {
        self.nodes.clear();
        self.open.clear();
        self.closed.clear();
        self.closed.resize(states.div_ceil(64), 0);
    }

    fn push(&mut self, request: &Request<'_>, node: Node) {
        let Some(left) = request.distances.steps_from(request.roads, &node.state) else { return };
        let left = u32::from(left) * STEP_COST;
        let index = self.nodes.len() as u32;
        self.nodes.push(node);
        self.open.push(Reverse((node.cost + left, left, index)));
    }

    fn pop(&mut self) -> Option<u32> {
        self.open.pop().map(|Reverse((_, _, index))| index)
    }

    /// Whether the node's state is new at its step; it is not new any more. Steps after the horizon are all the same.
    fn close(&mut self, roads: &Roads, node: &Node, traffic: &Traffic<'_>) -> bool {
        let Some(state) = roads.index(&node.state) else { return false };
        let layer = node.step.min(traffic.horizon()) as usize;
        let index = layer * roads.state_count() + state;
        let Some(word) = self.closed.get_mut(index / 64) else { return false };
        let bit = 1 << (index % 64);
        let is_new = *word & bit == 0;
        *word |= bit;
        is_new
    }

    fn way_to(&self, end: Option<u32>) -> Vec<State> {
        let mut states = Vec::new();
        let mut next = end.unwrap_or(NO_PARENT);
        while let Some(node) = self.nodes.get(next as usize) {
            states.push(node.state);
            next = node.parent;
        }
        states.reverse();
        states
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::traffic::roads::room;

    const APART: Apart = Apart { half_cells: 1.4, downwash: 1.0 };

    fn straight(step: u32, from: i16, to: i16, row: i16) -> Itinerary {
        let way = if to > from { 1 } else { -1 };
        let mut states = vec![State::at_rest([from, row, 0])];
        while let Some(last) = states.last().filter(|last| last.braked().place[0] != 2 * to) {
            states.push(last.then([way, 0, 0]));
        }
        Itinerary::new(step, states)
    }

    fn ask<'a>(roads: &'a Roads, distances: &'a Distances, start: State) -> Request<'a> {
        Request { roads, distances, step: 0, start, apart: APART, committed: &[], before: &[], resting: &[] }
    }

    #[test]
    fn in_a_corridor_it_waits_in_the_pocket_until_the_other_has_passed() {
        let roads = room(&["####.##", "......."]);
        let distances = roads.distances(State::at_rest([0, 0, 0]));
        let oncoming = straight(0, 0, 6, 0);
        let request = Request { before: &[&oncoming], ..ask(&roads, &distances, State::at_rest([5, 0, 0])) };
        let found = plan(&request, 10_000, &mut Scratch::default());
        assert!(found.is_clear);
        assert!(found.itinerary.states().contains(&State::at_rest([4, 1, 0])), "{:?}", found.itinerary);
        assert_eq!(found.itinerary.states().last(), Some(&State::at_rest([0, 0, 0])));
    }

    #[test]
    fn without_a_pocket_it_says_that_it_cannot_escape() {
        let roads = room(&["......."]);
        let distances = roads.distances(State::at_rest([0, 0, 0]));
        let oncoming = straight(0, 0, 6, 0);
        let request = Request { before: &[&oncoming], ..ask(&roads, &distances, State::at_rest([5, 0, 0])) };
        assert!(!plan(&request, 10_000, &mut Scratch::default()).is_clear);
    }

    #[test]
    fn nobody_enters_where_another_is_committed_to_rest() {
        let roads = room(&["....."]);
        let distances = roads.distances(State::at_rest([4, 0, 0]));
        let stands = State::at_rest([1, 0, 0]);
        let committed = [[Move { from: stands, to: stands }; 3]];
        let start = State::at_rest([0, 0, 0]);
        let request = Request { committed: &committed, ..ask(&roads, &distances, start) };
        let found = plan(&request, 10_000, &mut Scratch::default());
        assert_eq!(found.itinerary.at(1), Some(start));
        assert!(found.is_hindered);
    }

    #[test]
    fn a_goal_that_another_crosses_later_is_not_rested_at_before() {
        let roads = room(&[".......", "......."]);
        let goal = State::at_rest([3, 0, 0]);
        let distances = roads.distances(goal);
        let later = straight(6, 0, 6, 0);
        let request = Request { before: &[&later], ..ask(&roads, &distances, State::at_rest([3, 1, 0])) };
        let found = plan(&request, 10_000, &mut Scratch::default());
        assert!(found.is_clear && found.itinerary.end() > 9, "{:?}", found.itinerary);
    }

    #[test]
    fn without_a_budget_a_moving_vehicle_brakes() {
        let roads = room(&["....."]);
        let distances = roads.distances(State::at_rest([4, 0, 0]));
        let start = State { place: [1, 0, 0], speed: [1, 0, 0] };
        let found = plan(&ask(&roads, &distances, start), 0, &mut Scratch::default());
        assert_eq!(found.itinerary.states(), [start, State::at_rest([1, 0, 0])]);
    }
}
