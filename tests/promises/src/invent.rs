//! Making up a story from a seed.

use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use skein_bp::EventSet;
use skein_dbp::NodeName;
use skein_wire::NetworkConfig;

use crate::programs::Role;
use crate::story::{Cast, Fault, Grants, Order, Ordered, Story, Weather};

/// Faults end here ...
const CALM: Duration = Duration::from_secs(50);
/// ... which leaves five of the longest leases for everything to come right.
const END: Duration = Duration::from_secs(61);
/// How many nodes a story has: few more often than many, whose messages grow with the square.
const SIZES: [usize; 14] = [2, 2, 2, 3, 3, 3, 3, 4, 4, 5, 6, 7, 8, 10];
/// Blocks of events of every node in one story, at most: each is a record for each member.
const MOST_WILDCARDS: usize = 2;

impl Story {
    /// The story of a seed.
    #[must_use]
    pub fn invent(seed: u64) -> Self {
        Author { random: ChaCha8Rng::seed_from_u64(seed), names: Vec::new(), wildcards: 0 }.write(seed)
    }
}

struct Author {
    random: ChaCha8Rng,
    names: Vec<NodeName>,
    wildcards: usize,
}

impl Author {
    fn write(mut self, seed: u64) -> Story {
        let size = self.pick(&SIZES);
        self.names = names(size);
        let lease = self.pick(&[1000, 1000, 1500, 2000]);
        let casts: Vec<Cast> = (0..size).map(|node| self.cast(node, lease)).collect();
        let weather = self.weather();
        let mut faults = self.faults(size);
        faults.sort_by_key(Fault::at);
        let joint = self.chance(0.4);
        let mut casts = casts;
        let orders = self.orders(&mut casts, joint);
        Story { seed, casts, weather, faults, joint, orders, calm: CALM, end: END }
    }

    fn cast(&mut self, node: usize, lease_ms: u64) -> Cast {
        let size = self.names.len();
        let lease_ms = if self.chance(0.2) { self.pick(&[1000, 1500, 2000]) } else { lease_ms };
        let ticks: &[u64] = if size < 5 { &[0, 0, 5, 20, 50] } else { &[5, 20, 20, 50] };
        let late = node > 0 && self.chance(0.12);
        Cast {
            name: self.names[node].clone(),
            lease: Duration::from_millis(lease_ms),
            history: if self.chance(0.15) { 16 } else { Cast::ROOMY },
            guarded: self.chance(0.7),
            tick: Duration::from_millis(self.pick(ticks)),
            clock_offset: self.between(0, 100_000),
            drift_ppm: self.random.random_range(-5000..=5000),
            grants: if self.chance(0.3) { Some(self.grants()) } else { None },
            joins: if late { self.between(1000, 20_000) } else { Duration::ZERO },
            senses: if self.chance(0.3) { Some(self.between(300, 3000)) } else { None },
            roles: self.roles(node),
        }
    }

    fn roles(&mut self, node: usize) -> Vec<(String, Role)> {
        let size = self.names.len();
        let me = self.names[node].clone();
        let every = Duration::from_millis(60 * size as u64);
        let mut roles =
            vec![("step".to_owned(), Role::Asks { event: me.event_name("step"), every, patience: None })];
        if self.chance(0.4) {
            let every = self.between(300, 3000);
            roles.push(("land".into(), Role::Asks { event: me.event_name("land"), every, patience: None }));
        }
        let more = if size < 5 { self.random.random_range(1..=4) } else { self.random.random_range(1..=2) };
        for number in 1..=more {
            roles.extend(self.role(node, number));
        }
        roles
    }

    /// One b-thread, or two that belong together.
    fn role(&mut self, node: usize, number: usize) -> Vec<(String, Role)> {
        let me = self.names[node].clone();
        let other = self.other_than(node);
        let every = self.between(100, 1500);
        match self.random.random_range(0..20) {
            0..=6 => {
                let what = self.pick(&["do", "do", "do", "turn", "step", "order"]);
                let patience = if self.chance(0.4) { Some(self.between(200, 2500)) } else { None };
                let asks = Role::Asks { event: other.event_name(what), every, patience };
                vec![(format!("ask-{number}"), asks)]
            }
            7..=11 => {
                let holder = format!("block-{number}");
                let blocks = Role::Blocks {
                    set: self.blocked(&other),
                    on: self.between(800, 6000),
                    off: self.between(300, 3000),
                    hold: self.chance(0.2),
                };
                let acts = Role::Acts { holder: holder.clone(), event: me.event_name("act") };
                let mut roles = vec![(holder, blocks)];
                if self.chance(0.6) {
                    roles.push((format!("act-{number}"), acts));
                }
                roles
            }
            12..=13 => {
                let gate = Role::Blocks {
                    set: EventSet::from(me.event_name(self.pick(&["do", "step", "land", "turn"]))),
                    on: self.between(100, 3000),
                    off: self.between(300, 3000),
                    hold: false,
                };
                vec![(format!("gate-{number}"), gate)]
            }
            14..=15 => {
                let of = self.pick(&["step", "do", "sensed", "act"]);
                let of = if self.chance(0.3) {
                    EventSet::from(format!("*/*/{of}"))
                } else {
                    EventSet::from(other.event_name(of))
                };
                let where_to = if self.chance(0.5) { &me } else { &other };
                let echoes = Role::Echoes { of, event: where_to.event_name("echo"), rest: every };
                vec![(format!("echo-{number}"), echoes)]
            }
            16..=17 => {
                let events = [other.event_name("left"), other.event_name("right")];
                vec![(format!("turns-{number}"), Role::Alternates { events, every })]
            }
            _ => {
                // Not from afar: it is refused, and has to do no harm.
                let patience = if self.chance(0.5) { Some(self.between(500, 3000)) } else { None };
                let asks = Role::Asks { event: other.event_name("land"), every, patience };
                vec![(format!("meddle-{number}"), asks)]
            }
        }
    }

    fn grants(&mut self) -> Grants {
        let mut some = |of: &[&'static str]| -> Vec<&'static str> {
            of.iter().copied().filter(|_| self.random.random::<f64>() < 0.6).collect()
        };
        Grants {
            requests: some(&["do", "turn", "order", "left", "right"]),
            blocks: some(&["step", "do", "left"]),
        }
    }

    /// What an operator orders; gives the nodes reason to heed it.
    fn orders(&mut self, casts: &mut [Cast], joint: bool) -> Vec<Order> {
        let size = casts.len();
        let mut orders = Vec::new();
        let holding: Vec<(usize, String)> = casts
            .iter()
            .enumerate()
            .flat_map(|(node, cast)| cast.roles.iter().map(move |(name, role)| (node, name, role)))
            .filter(|(_, _, role)| matches!(role, Role::Blocks { hold: true, .. }))
            .map(|(node, name, _)| (node, name.clone()))
            .collect();
        for (holder, bthread) in holding {
            let (at, spread) = (self.between(5000, 45_000), self.between(0, 500));
            orders.push(Order { at, spread, what: Ordered::Lift { holder, bthread } });
        }
        if joint {
            for (node, cast) in casts.iter_mut().enumerate() {
                if node == 0 || self.chance(0.3) {
                    let every = self.between(200, 3000);
                    let asks = Role::Asks { event: "swarm/go".to_owned(), every, patience: None };
                    cast.roles.push(("decide".to_owned(), asks));
                }
            }
            let mut times: Vec<Duration> =
                (0..self.random.random_range(0..=2)).map(|_| self.between(8000, 45_000)).collect();
            times.sort_unstable();
            let mut terms = 2..;
            for (at, term) in times.into_iter().zip(&mut terms) {
                let coordinator = self.random.random_range(0..size);
                let members: Vec<usize> = (0..size)
                    .filter(|node| *node == coordinator || self.random.random::<f64>() < 0.8)
                    .collect();
                let what = Ordered::Roster { term, coordinator, members };
                orders.push(Order { at, spread: self.between(0, 300), what });
            }
            // In the end everybody is brought to one term.
            for (term, coordinator) in terms.zip([0]) {
                let what = Ordered::Roster { term, coordinator, members: (0..size).collect() };
                orders.push(Order { at: CALM, spread: Duration::ZERO, what });
            }
        }
        orders.sort_by_key(|order| order.at);
        orders
    }

    /// A set that concerns `other`, and perhaps everybody.
    fn blocked(&mut self, other: &NodeName) -> EventSet {
        let wide = self.wildcards < MOST_WILDCARDS && self.chance(0.4);
        self.wildcards += usize::from(wide);
        if !wide {
            let what = self.pick(&["step", "do", "turn", "**", "sensed"]);
            return EventSet::from(other.event_name(what));
        }
        match self.random.random_range(0..5) {
            0 => EventSet::All,
            1 => EventSet::from("uav/**"),
            2 => EventSet::from("uav/*/do").or(EventSet::from("*/*/turn")),
            _ => EventSet::from("uav/*/step"),
        }
    }

    fn weather(&mut self) -> Vec<Weather> {
        let spells = self.random.random_range(1..=3);
        let mut from: Vec<Duration> = (1..spells).map(|_| self.between(3000, 45_000)).collect();
        from.sort_unstable();
        let from = [Duration::ZERO].into_iter().chain(from);
        from.map(|from| Weather { from, habits: self.habits() }).collect()
    }

    fn habits(&mut self) -> NetworkConfig {
        let longest = self.pick(&[2, 20, 100, 300, 300]);
        NetworkConfig {
            latency: (Duration::from_micros(200), Duration::from_millis(longest)),
            loss: self.pick(&[0.0, 0.05, 0.1, 0.2, 0.3]),
            duplicate: self.pick(&[0.0, 0.1, 0.3]),
            reorder: self.pick(&[0.0, 0.2, 0.5]),
            range_m: None,
        }
    }

    fn faults(&mut self, size: usize) -> Vec<Fault> {
        let mut faults = Vec::new();
        for _ in 0..self.random.random_range(0..=3) {
            let (at, lasts) = self.spell(200, 6000);
            let apart: Vec<usize> = (0..size).filter(|_| self.random.random::<bool>()).collect();
            if !apart.is_empty() && apart.len() < size {
                faults.push(Fault::Partition { at, lasts, apart });
            }
        }
        for _ in 0..self.random.random_range(0..=2) {
            let (at, lasts) = self.spell(50, 5000);
            faults.push(Fault::Pause { at, lasts, node: self.random.random_range(0..size) });
        }
        for _ in 0..self.random.random_range(0..=3) {
            let (at, lasts) = self.spell(20, 5000);
            faults.push(Fault::Restart { at, lasts, node: self.random.random_range(0..size) });
        }
        faults
    }

    /// A time for a fault, and how long it lasts, in ms: over before the calm.
    fn spell(&mut self, least: u64, most: u64) -> (Duration, Duration) {
        let lasts = self.between(least, most);
        let latest = (CALM - lasts).as_millis();
        (self.between(1000, u64::try_from(latest).unwrap_or(1000)), lasts)
    }

    fn other_than(&mut self, node: usize) -> NodeName {
        let at = self.random.random_range(0..self.names.len() - 1);
        self.names[if at < node { at } else { at + 1 }].clone()
    }

    fn between(&mut self, least_ms: u64, most_ms: u64) -> Duration {
        Duration::from_millis(self.random.random_range(least_ms..=most_ms))
    }

    fn chance(&mut self, probability: f64) -> bool {
        self.random.random::<f64>() < probability
    }

    fn pick<T: Copy>(&mut self, among: &[T]) -> T {
        among[self.random.random_range(0..among.len())]
    }
}

/// A ground station and vehicles.
#[allow(clippy::expect_used)] // They are names.
fn names(size: usize) -> Vec<NodeName> {
    let texts = (0..size).map(|at| if at == 0 { "ground/main".to_owned() } else { format!("uav/{at}") });
    texts.map(|text| NodeName::new(&text).expect("two plain chunks")).collect()
}
