//! What one seed stands for: programs, network and faults, as data that can be read and shrunk.

use std::fmt;
use std::ops::AddAssign;
use std::time::Duration;

use skein_bp::Event;
use skein_bp::catalogue::Declared as _;
use skein_dbp::{Lift, NodeName, Roster};
use skein_wire::NetworkConfig;

use crate::programs::Role;
use crate::seconds::Seconds;

/// A run to be: who takes part, over what network, and what goes wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct Story {
    /// What every draw of the run comes from.
    pub seed: u64,
    pub casts: Vec<Cast>,
    /// The network's habits from some times on, in order of time.
    pub weather: Vec<Weather>,
    /// What goes wrong, in order of time.
    pub faults: Vec<Fault>,
    /// Whether there are joint events, with the first node as their first coordinator.
    pub joint: bool,
    /// What an operator orders, in order of time.
    pub orders: Vec<Order>,
    /// From when on nothing goes wrong any more: the network is good and every node is up.
    pub calm: Duration,
    /// The least length of the run.
    pub end: Duration,
}

/// A node: its settings and what its b-threads do.
#[derive(Clone, Debug, PartialEq)]
pub struct Cast {
    pub name: NodeName,
    pub lease: Duration,
    /// The number of occurrences it keeps for those who missed them.
    pub history: usize,
    /// Whether its events are `guarded`: a restart does not let slip what others block.
    pub guarded: bool,
    /// It looks at its messages and deadlines at multiples of this only; zero: at once.
    pub tick: Duration,
    /// What its clock shows when the run begins.
    pub clock_offset: Duration,
    /// How many millionths its clock gains.
    pub drift_ppm: i32,
    /// What vehicles may request and block here: last chunks of names; everything if none.
    pub grants: Option<Grants>,
    /// When it is started first.
    pub joins: Duration,
    /// The period of events from outside.
    pub senses: Option<Duration>,
    /// Its b-threads, by name.
    pub roles: Vec<(String, Role)>,
}

/// What vehicles may do at a home; the ground station may do everything.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grants {
    /// Last chunks of the names of events that they may request.
    pub requests: Vec<&'static str>,
    /// Last chunks of the names of events that they may block.
    pub blocks: Vec<&'static str>,
}

/// An operator's order to every node that runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// When it begins to be given out.
    pub at: Duration,
    /// How much later each next node is told.
    pub spread: Duration,
    pub what: Ordered,
}

/// What an operator may order. Nodes are numbered as in [`Story::casts`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ordered {
    /// A new term of joint decisions.
    Roster {
        term: u64,
        coordinator: usize,
        /// Without whom nothing is decided.
        members: Vec<usize>,
    },
    /// That a block is lifted which stays although its holder may be lost.
    Lift {
        holder: usize,
        /// Of which of its b-threads.
        bthread: String,
    },
}

/// The network's habits from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weather {
    /// From when on.
    pub from: Duration,
    /// How it treats messages.
    pub habits: NetworkConfig,
}

/// Something that goes wrong. Nodes are numbered as in [`Story::casts`].
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// Some nodes reach each other, but none of the others.
    Partition {
        at: Duration,
        /// For how long.
        lasts: Duration,
        /// Who is cut off.
        apart: Vec<usize>,
    },
    /// A process stands still, as under a debugger or without processor time.
    Pause {
        at: Duration,
        /// For how long.
        lasts: Duration,
        node: usize,
    },
    /// A process is killed and started again.
    Restart {
        /// When it is killed.
        at: Duration,
        lasts: Duration,
        node: usize,
    },
}

impl Fault {
    /// When it begins.
    #[must_use]
    pub fn at(&self) -> Duration {
        let (Self::Partition { at, .. } | Self::Pause { at, .. } | Self::Restart { at, .. }) = self;
        *at
    }

    /// When it is over.
    #[must_use]
    pub fn ends(&self) -> Duration {
        let (Self::Partition { at, lasts, .. }
        | Self::Pause { at, lasts, .. }
        | Self::Restart { at, lasts, .. }) = self;
        *at + *lasts
    }
}

/// How much of each kind of fault there has been.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Faults {
    /// Messages lost by chance or for lack of a way.
    pub lost: u64,
    /// Messages that arrived twice.
    pub duplicated: u64,
    /// Messages that overtook others.
    pub reordered: u64,
    /// Runs in which messages took up to 300 ms.
    pub delayed: u64,
    pub partitions: u64,
    /// Pauses of a process.
    pub pauses: u64,
    pub restarts: u64,
    /// Nodes that came late.
    pub late_joiners: u64,
}

impl Faults {
    /// Each kind with its name.
    #[must_use]
    pub fn by_name(&self) -> [(&'static str, u64); 8] {
        [
            ("lost", self.lost),
            ("duplicated", self.duplicated),
            ("reordered", self.reordered),
            ("delayed", self.delayed),
            ("partitions", self.partitions),
            ("pauses", self.pauses),
            ("restarts", self.restarts),
            ("late_joiners", self.late_joiners),
        ]
    }
}

impl AddAssign for Faults {
    fn add_assign(&mut self, more: Self) {
        self.lost += more.lost;
        self.duplicated += more.duplicated;
        self.reordered += more.reordered;
        self.delayed += more.delayed;
        self.partitions += more.partitions;
        self.pauses += more.pauses;
        self.restarts += more.restarts;
        self.late_joiners += more.late_joiners;
    }
}

impl Story {
    #[must_use]
    pub fn roster(&self) -> Vec<NodeName> {
        self.casts.iter().map(|cast| cast.name.clone()).collect()
    }

    /// The longest lease of any node.
    #[must_use]
    pub fn longest_lease(&self) -> Duration {
        self.casts.iter().map(|cast| cast.lease).max().unwrap_or_default()
    }

    /// Who decides on joint events first, if there are any.
    #[must_use]
    pub fn first_roster(&self) -> Option<Roster> {
        let coordinator = self.casts.first().filter(|_| self.joint)?.name.clone();
        Some(Roster::first(coordinator, self.roster()))
    }

    /// The event by which `order` is given to a node; none if it names nobody.
    pub(crate) fn event_of(&self, order: &Order, node: usize) -> Option<Event> {
        let name = |node: &usize| self.casts.get(*node).map(|cast| cast.name.clone());
        let to = name(&node)?;
        match &order.what {
            Ordered::Roster { term, coordinator, members } => {
                let first = Roster::first(name(coordinator)?, members.iter().filter_map(name));
                Some(Roster { term: *term, ..first }.order(&to))
            }
            Ordered::Lift { holder, bthread } => {
                Some(Lift { node: name(holder)?, bthread: bthread.as_str().into() }.at(&to))
            }
        }
    }

    fn name(&self, node: usize) -> &str {
        self.casts.get(node).map_or("nobody", |cast| cast.name.as_str())
    }
}

impl fmt::Display for Story {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "Seed {}{}:", self.seed, if self.joint { ", with joint events" } else { "" })?;
        for cast in &self.casts {
            write!(f, "{cast}")?;
        }
        for Weather { from, habits } in &self.weather {
            let (least, greatest) = habits.latency;
            writeln!(
                f,
                "  from {} on: {:.0} % lost, {:.0} % twice, {:.0} % out of order, {:.1} to {:.1} ms",
                Seconds(*from),
                habits.loss * 100.0,
                habits.duplicate * 100.0,
                habits.reorder * 100.0,
                least.as_secs_f64() * 1e3,
                greatest.as_secs_f64() * 1e3,
            )?;
        }
        for Order { at, what, .. } in &self.orders {
            match what {
                Ordered::Roster { term, coordinator, members } => {
                    let members: Vec<&str> = members.iter().map(|node| self.name(*node)).collect();
                    let (at, coordinator) = (Seconds(*at), self.name(*coordinator));
                    writeln!(
                        f,
                        "  at {at}: term {term} is ordered, of {} under {coordinator}",
                        members.join(", ")
                    )?;
                }
                Ordered::Lift { holder, bthread } => {
                    writeln!(
                        f,
                        "  at {}: the block of {bthread} at {} is lifted",
                        Seconds(*at),
                        self.name(*holder)
                    )?;
                }
            }
        }
        for fault in &self.faults {
            match fault {
                Fault::Partition { at, lasts, apart } => {
                    let names: Vec<&str> = apart.iter().map(|node| self.name(*node)).collect();
                    let (names, lasts) = (names.join(", "), Seconds(*lasts));
                    writeln!(f, "  at {}: {names} cut off for {lasts}", Seconds(*at))?;
                }
                Fault::Pause { at, lasts, node } => {
                    writeln!(
                        f,
                        "  at {}: {} stands still for {}",
                        Seconds(*at),
                        self.name(*node),
                        Seconds(*lasts)
                    )?;
                }
                Fault::Restart { at, lasts, node } => writeln!(
                    f,
                    "  at {}: {} is killed, and started again {} later",
                    Seconds(*at),
                    self.name(*node),
                    Seconds(*lasts)
                )?,
            }
        }
        Ok(())
    }
}

impl fmt::Display for Cast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "  {}, lease {}", self.name, Seconds(self.lease))?;
        if !self.tick.is_zero() {
            write!(f, ", tick {}", Seconds(self.tick))?;
        }
        if self.history < Self::ROOMY {
            write!(f, ", keeps {} occurrences", self.history)?;
        }
        if self.guarded {
            f.write_str(", guarded")?;
        }
        if let Some(Grants { requests, blocks }) = &self.grants {
            write!(f, ", lets vehicles request {} and block {}", requests.join(", "), blocks.join(", "))?;
        }
        if self.drift_ppm != 0 {
            write!(f, ", clock {:+} ppm", self.drift_ppm)?;
        }
        if !self.joins.is_zero() {
            write!(f, ", joins at {}", Seconds(self.joins))?;
        }
        writeln!(f)?;
        for (name, role) in &self.roles {
            writeln!(f, "    {name} {role}")?;
        }
        if let Some(every) = self.senses {
            writeln!(f, "    senses something every {}", Seconds(every))?;
        }
        Ok(())
    }
}

impl Cast {
    /// A history that no run outgrows while somebody is away.
    pub const ROOMY: usize = 1024;
}
