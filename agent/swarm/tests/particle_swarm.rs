//! What all particle swarms keep to, and what each finds.

use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use skein_swarm::particle_swarm::{
    Best, Improved, ImprovedConfig, Motion, Mover, Objective, SearchSpace, SearchSpaceError, Swarm,
    TabuConfig, TabuSwarm,
};

/// A swarm whose numbers never change: its inertia, and `c1 = c2`.
struct Plain(f64, f64);

const STANDARD: Plain = Plain(0.9, 2.0);
const CONSTRICTION: Plain = Plain(0.729, 1.494);

impl Motion for Plain {
    fn accelerate(&mut self, mover: Mover<'_>, _: &SearchSpace, rng: &mut ChaCha8Rng) {
        mover.attract(self.0, self.1, self.1, rng);
    }

    fn max_step(&self) -> f64 {
        0.5
    }
}

/// A function with a known least value, and what it was asked.
struct Function {
    space: SearchSpace,
    of: fn(f64) -> f64,
    least_at: f64,
    asked: Vec<f64>,
}

impl Function {
    /// The sum of `of` over all dimensions, least, 0, where all are `least_at`; searched 10 to each side of `origin`.
    fn new(dimensions: usize, origin: f64, least_at: f64, of: fn(f64) -> f64) -> Function {
        let space =
            SearchSpace::new(vec![origin - 10.0; dimensions], vec![origin + 10.0; dimensions]).unwrap();
        Function { space, of, least_at: origin + least_at, asked: vec![] }
    }
}

impl Objective for Function {
    fn space(&self) -> &SearchSpace {
        &self.space
    }

    fn cost_below(&mut self, _: f64, position: &[f64]) -> f64 {
        for (dimension, value) in position.iter().enumerate() {
            assert!(
                (self.space.lower()[dimension]..=self.space.upper()[dimension]).contains(value),
                "{value}"
            );
        }
        let cost = position.iter().map(|value| (self.of)(value - self.least_at)).sum();
        self.asked.push(cost);
        cost
    }
}

fn square(x: f64) -> f64 {
    x * x
}

/// Many local minima, one unit apart (Rastrigin 1974).
fn rastrigin(x: f64) -> f64 {
    x * x + 10.0 * (1.0 - (std::f64::consts::TAU * x).cos())
}

/// The algorithms, by number, each run in the pieces given.
fn best(algorithm: usize, function: &mut Function, seed: u64, pieces: &[usize]) -> Best {
    fn of<M: Motion>(mut swarm: Swarm<M>, function: &mut Function, pieces: &[usize]) -> Best {
        for piece in pieces {
            swarm.run(function, *piece);
        }
        assert_eq!(swarm.evaluations(), function.asked.len());
        swarm.best().clone()
    }
    let space = function.space.clone();
    match algorithm {
        0 => of(Swarm::new(&space, STANDARD, 20, seed), function, pieces),
        1 => of(Swarm::new(&space, CONSTRICTION, 20, seed), function, pieces),
        2 => {
            let motion = Improved::new(&space, ImprovedConfig::default());
            of(Swarm::new(&space, motion, 20, seed), function, pieces)
        }
        _ => {
            let mut swarm = TabuSwarm::new(&space, TabuConfig::default(), 20, seed);
            for piece in pieces {
                swarm.run(function, *piece);
            }
            assert_eq!(swarm.evaluations(), function.asked.len());
            swarm.best().clone()
        }
    }
}

/// The improved swarm does not settle: it escapes as long as it hardly moves. Tabu search settles for it.
#[test]
fn the_least_value_of_a_bowl_is_found() {
    for (algorithm, within) in [(1, 1e-3), (2, 0.5), (3, 1e-3)] {
        for seed in 0..5 {
            let found = best(algorithm, &mut Function::new(5, 0.0, 3.0, square), seed, &[4000]);
            assert!(found.cost < within, "algorithm {algorithm}, seed {seed}: {}", found.cost);
            assert!(found.position.iter().all(|value| (value - 3.0).abs() < 0.7), "algorithm {algorithm}");
        }
    }
}

#[test]
fn tabu_search_leaves_local_minima() {
    let mean = |algorithm| {
        let costs = (0..20)
            .map(|seed| best(algorithm, &mut Function::new(4, 0.0, 2.3, rastrigin), seed, &[1500]).cost);
        costs.sum::<f64>() / 20.0
    };
    let (with, without) = (mean(3), mean(2));
    assert!(with < 0.8 * without, "{with} with, {without} without");
}

#[test]
fn the_equation_of_motion_is_the_papers() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut velocity = [1.0, -2.0];
    let here = [5.0, 5.0];
    Mover { position: &here, velocity: &mut velocity, own_best: &here, leader: &here }
        .attract(0.9, 2.0, 2.0, &mut rng);
    assert_eq!(velocity, [0.9, -1.8], "nothing attracts at the best place");
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for _ in 0..2000 {
        let mut velocity = [0.0];
        Mover { position: &[0.0], velocity: &mut velocity, own_best: &[1.0], leader: &[10.0] }
            .attract(0.9, 2.0, 3.0, &mut rng);
        (low, high) = (low.min(velocity[0]), high.max(velocity[0]));
    }
    assert!(
        (0.0..1.0).contains(&low) && (31.0..32.0).contains(&high),
        "0 to 2 x 1 + 3 x 10: {low} to {high}"
    );
}

#[test]
fn the_improved_swarm_escapes_once_it_hardly_moves() {
    let mut bowl = Function::new(3, 0.0, 1.0, square);
    let config = ImprovedConfig::default();
    let motion = Improved::new(&bowl.space, config);
    let mut swarm = Swarm::new(&bowl.space.clone(), motion, 20, 3);
    swarm.run(&mut bowl, 20 * config.generations);
    assert!(!swarm.motion().is_stuck(), "too early to tell");
    swarm.run(&mut bowl, 2000);
    assert!(swarm.motion().is_stuck());
    assert_eq!(swarm.motion().inertia(), config.inertia_max);
}

#[test]
fn a_swarm_begins_where_it_is_told_to() {
    let mut bowl = Function::new(2, 0.0, 4.0, square);
    let places: [&[f64]; 2] = [&[4.0, 4.0], &[99.0, 0.0]];
    let mut swarm = Swarm::new(&bowl.space.clone(), STANDARD, 5, 1).starting_at(places);
    swarm.run(&mut bowl, 2);
    assert_eq!(bowl.asked, [0.0, 36.0 + 16.0], "99 is outside, and brought to 10");
}

#[test]
fn a_box_that_cannot_be_searched_is_refused() {
    assert_eq!(SearchSpace::new(vec![], vec![]), Err(SearchSpaceError::Lengths { lower: 0, upper: 0 }));
    assert_eq!(
        SearchSpace::new(vec![0.0, 1.0], vec![1.0, 1.0]),
        Err(SearchSpaceError::Bounds { dimension: 1, lower: 1.0, upper: 1.0 })
    );
    let space = SearchSpace::new(vec![0.0; 6], vec![1.0; 6]).unwrap();
    assert_eq!(space.clone().in_chains_of(4), Err(SearchSpaceError::Chain { dimensions: 6, chain: 4 }));
    assert_eq!(space.about(vec![0.5]), Err(SearchSpaceError::Centre { dimensions: 6, numbers: 1 }));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn a_run_in_pieces_is_the_whole_run(
        algorithm in 0..4_usize,
        seed in 0..1000_u64,
        pieces in prop::collection::vec(1..90_usize, 1..8),
    ) {
        let mut in_pieces = Function::new(6, 0.0, 2.0, rastrigin);
        let mut whole = Function::new(6, 0.0, 2.0, rastrigin);
        let one = best(algorithm, &mut in_pieces, seed, &pieces);
        let other = best(algorithm, &mut whole, seed, &[pieces.iter().sum()]);
        prop_assert_eq!(one, other);
        prop_assert_eq!(in_pieces.asked, whole.asked);
    }

    #[test]
    fn the_best_is_the_least_of_all_that_was_looked_at(
        algorithm in 0..4_usize,
        seed in 0..1000_u64,
        evaluations in 1..800_usize,
    ) {
        let mut function = Function::new(4, 0.0, -1.0, rastrigin);
        let best = best(algorithm, &mut function, seed, &[evaluations]);
        prop_assert_eq!(best.cost, function.asked.iter().copied().fold(f64::INFINITY, f64::min));
    }

    #[test]
    fn all_begin_with_the_same_particles(seed in 0..1000_u64) {
        let first = |algorithm| {
            let mut function = Function::new(3, 0.0, 1.0, square);
            best(algorithm, &mut function, seed, &[20]);
            function.asked
        };
        prop_assert!((1..4).all(|algorithm| first(algorithm) == first(0)));
    }

    #[test]
    fn where_the_origin_of_coordinates_is_does_not_matter(algorithm in 0..4_usize, seed in 0..1000_u64) {
        // A power of two, so that coordinates lose no more than their last bits.
        let costs = |origin| {
            let mut function = Function::new(3, origin, 2.5, square);
            best(algorithm, &mut function, seed, &[200]);
            function.asked
        };
        for (here, there) in costs(0.0).iter().zip(costs(1024.0)) {
            prop_assert!((here - there).abs() < 1e-6, "{here} and {there}");
        }
    }
}
