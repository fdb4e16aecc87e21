//! Small connected graphs of narrow and wide places, and what is asked of three vehicles there.

use std::collections::{BTreeSet, VecDeque};

use rand::RngExt as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;

/// A place's number, from 0.
pub type Place = usize;
/// Exits of a narrow place, at most: five ways through it, one of which ends there, differ in heading by 72 degrees.
pub const MOST_EXITS: usize = 4;

/// A connected graph. A narrow place holds one vehicle, a wide one any number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Graph {
    pub next_to: Vec<BTreeSet<Place>>,
    pub narrow: Vec<bool>,
}

/// A graph, and the start and goal of each vehicle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Case {
    pub graph: Graph,
    pub starts: Vec<Place>,
    pub goals: Vec<Place>,
}

impl Graph {
    fn new(places: usize, edges: impl IntoIterator<Item = [Place; 2]>, narrow: Vec<bool>) -> Self {
        let mut next_to = vec![BTreeSet::new(); places];
        for [one, other] in edges {
            next_to[one].insert(other);
            next_to[other].insert(one);
        }
        Self { next_to, narrow }
    }

    pub fn places(&self) -> usize {
        self.narrow.len()
    }

    /// The shortest way between two places that leads into no place for which `is_shut`; of two, the one through lower
    /// numbers.
    pub fn way(
        &self,
        from: Place,
        is_end: impl Fn(Place) -> bool,
        is_shut: impl Fn(Place) -> bool,
    ) -> Option<Vec<Place>> {
        let mut came_from = vec![None; self.places()];
        let mut open = VecDeque::from([from]);
        came_from[from] = Some(from);
        while let Some(place) = open.pop_front() {
            if is_end(place) {
                let back = std::iter::successors(Some(place), |place| {
                    came_from[*place].filter(|from| from != place)
                });
                let mut way: Vec<_> = back.collect();
                way.reverse();
                return Some(way);
            }
            for next in &self.next_to[place] {
                if came_from[*next].is_none() && !is_shut(*next) {
                    came_from[*next] = Some(place);
                    open.push_back(*next);
                }
            }
        }
        None
    }

    /// All connected graphs of so many places, each once up to the numbers of its places.
    pub fn all(places: usize) -> Vec<Self> {
        let pairs: Vec<_> =
            (0..places).flat_map(|one| (one + 1..places).map(move |other| [one, other])).collect();
        let orders = orders(places);
        let mut seen = BTreeSet::new();
        let mut graphs = Vec::new();
        for edges in 0..1_u32 << pairs.len() {
            for narrow in 0..1_u32 << places {
                let is_narrow = (0..places).map(|place| narrow >> place & 1 == 1).collect();
                let chosen = pairs.iter().enumerate().filter(|(bit, _)| edges >> bit & 1 == 1);
                let graph = Self::new(places, chosen.map(|(_, pair)| *pair), is_narrow);
                if graph.is_connected() && seen.insert(orders.iter().map(|order| graph.renamed(order)).min())
                {
                    graphs.push(graph);
                }
            }
        }
        graphs
    }

    /// A random connected graph: a tree, and as many more edges as chance gives it.
    fn random(places: usize, random: &mut ChaCha8Rng) -> Self {
        loop {
            let tree = (1..places).map(|place| [place, random.random_range(0..place)]).collect::<Vec<_>>();
            let more = random.random_range(0..places);
            let more = (0..more).map(|_| [random.random_range(0..places), random.random_range(0..places)]);
            let edges: Vec<_> = tree.into_iter().chain(more).filter(|[one, other]| one != other).collect();
            let narrow = (0..places).map(|_| random.random_bool(0.6)).collect();
            let graph = Self::new(places, edges, narrow);
            if graph.next_to.iter().all(|next| next.len() <= MOST_EXITS) {
                return graph;
            }
        }
    }

    fn is_connected(&self) -> bool {
        (0..self.places()).all(|place| self.way(0, |end| end == place, |_| false).is_some())
    }

    /// All there is to know of it, with its places renamed.
    fn renamed(&self, order: &[Place]) -> (Vec<Vec<Place>>, Vec<bool>) {
        let of = |place: Place| order.iter().position(|old| *old == place).unwrap_or_default();
        let next_to = order.iter().map(|old| {
            let mut next: Vec<_> = self.next_to[*old].iter().map(|place| of(*place)).collect();
            next.sort_unstable();
            next
        });
        (next_to.collect(), order.iter().map(|old| self.narrow[*old]).collect())
    }
}

impl Case {
    /// All that may be asked of so many vehicles in a graph: no two begin, and no two end, in the same narrow place.
    pub fn all(graph: &Graph, vehicles: usize) -> Vec<Self> {
        let seats = seatings(graph, vehicles);
        let pairs = seats.iter().flat_map(|starts| seats.iter().map(move |goals| (starts, goals)));
        pairs
            .map(|(starts, goals)| Self {
                graph: graph.clone(),
                starts: starts.clone(),
                goals: goals.clone(),
            })
            .collect()
    }

    /// Two swap the ends of a corridor of so many narrow places.
    #[cfg(test)]
    pub fn corridor(narrow: usize) -> Self {
        let end = narrow + 1;
        let is_narrow = (0..=end).map(|place| place != 0 && place != end).collect();
        let graph = Graph::new(end + 1, (0..end).map(|place| [place, place + 1]), is_narrow);
        Self { graph, starts: vec![0, end], goals: vec![end, 0] }
    }

    /// Two in a corridor of two narrow places are to get past one another.
    #[cfg(test)]
    pub fn met_inside() -> Self {
        Self { starts: vec![1, 2], ..Self::corridor(2) }
    }

    /// One stands in a crossing of three ways, and another is to come through it, where neither is in the other's way.
    #[cfg(test)]
    pub fn crossing() -> Self {
        let graph = Graph::new(4, [[0, 1], [0, 2], [0, 3]], vec![true, false, false, false]);
        Self { graph, starts: vec![3, 0], goals: vec![2, 1] }
    }

    /// Two cross where four ways meet, and neither stands where the other comes out.
    #[cfg(test)]
    pub fn four_ways() -> Self {
        let narrow = vec![true, false, false, false, false];
        let graph = Graph::new(5, [[0, 1], [0, 2], [0, 3], [0, 4]], narrow);
        Self { graph, starts: vec![1, 3], goals: vec![2, 4] }
    }

    /// A random case in a random graph.
    pub fn random(places: usize, vehicles: usize, random: &mut ChaCha8Rng) -> Self {
        loop {
            let graph = Graph::random(places, random);
            let mut seats = seatings(&graph, vehicles);
            seats.shuffle(random);
            if let [starts, .., goals] = seats.as_slice() {
                let (starts, goals) = (starts.clone(), goals.clone());
                return Self { graph, starts, goals };
            }
        }
    }

    pub fn has_wide_goals(&self) -> bool {
        self.goals.iter().all(|goal| !self.graph.narrow[*goal])
    }

    /// Whether all could come to their goals, one step of one vehicle at a time, if one mind moved them.
    pub fn has_a_way(&self) -> bool {
        let mut seen = BTreeSet::from([self.starts.clone()]);
        let mut open = vec![self.starts.clone()];
        while let Some(at) = open.pop() {
            if at == self.goals {
                return true;
            }
            for vehicle in 0..at.len() {
                for next in &self.graph.next_to[at[vehicle]] {
                    if !(self.graph.narrow[*next] && at.contains(next)) {
                        let mut moved = at.clone();
                        moved[vehicle] = *next;
                        if seen.insert(moved.clone()) {
                            open.push(moved);
                        }
                    }
                }
            }
        }
        false
    }
}

impl std::fmt::Display for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let kind = |place: Place| if self.graph.narrow[place] { "narrow" } else { "wide" };
        for (place, next) in self.graph.next_to.iter().enumerate() {
            write!(f, "{place} {} beside {next:?}; ", kind(place))?;
        }
        write!(f, "from {:?} to {:?}", self.starts, self.goals)
    }
}

/// All places where so many vehicles may be at once.
fn seatings(graph: &Graph, vehicles: usize) -> Vec<Vec<Place>> {
    (0..vehicles).fold(vec![Vec::new()], |seated, _| {
        let more = seated.iter().flat_map(|seats| {
            let free = (0..graph.places()).filter(|place| !(graph.narrow[*place] && seats.contains(place)));
            free.map(|place| [seats.as_slice(), &[place]].concat())
        });
        more.collect()
    })
}

/// All orders of so many numbers.
fn orders(places: usize) -> Vec<Vec<Place>> {
    (0..places).fold(vec![Vec::new()], |orders, _| {
        let more = orders.iter().flat_map(|order| {
            let left = (0..places).filter(|place| !order.contains(place));
            left.map(|place| [order.as_slice(), &[place]].concat())
        });
        more.collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_connected_graphs_are_as_many_as_are_known_and_each_is_coloured_every_way() {
        let shapes = |places| {
            let graphs = Graph::all(places);
            (graphs.iter().filter(|graph| graph.narrow.iter().all(|narrow| *narrow)).count(), graphs.len())
        };
        // OEIS A001349 and, with a loop for a colour, A054921.
        assert_eq!([1, 2, 3, 4].map(shapes), [(1, 2), (1, 3), (2, 10), (6, 50)]);
    }

    #[test]
    fn two_swap_the_ends_of_a_corridor_only_where_one_can_make_way() {
        let line = |narrow: [bool; 3]| Graph::new(3, [[0, 1], [1, 2]], narrow.into());
        let swap = |graph| Case { graph, starts: vec![0, 2], goals: vec![2, 0] };
        assert!(swap(line([false, true, false])).has_a_way());
        assert!(swap(line([false, true, true])).has_a_way());
        assert!(!swap(line([true, true, true])).has_a_way());
    }
}
