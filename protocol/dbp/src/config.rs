//! The settings of a node.

use std::ops::RangeInclusive;
use std::time::Duration;

use skein_bp::EventSet;

use crate::home::authority::Authority;
use crate::joint::roster::Roster;
use crate::kept::Kept;
use crate::name::NodeName;

/// The shortest lease.
pub(crate) const LEAST_LEASE: Duration = Duration::from_millis(10);

/// The settings of a [`Node`](crate::Node): itself and the fleet.
#[derive(Clone, Debug)]
pub struct NodeConfig {
    pub name: NodeName,
    /// Its incarnation: a durable counter that grows with each start.
    pub incarnation: u64,
    /// Every member of the fleet; its own name may be among them or not. Others are not listened to.
    pub roster: Vec<NodeName>,
    /// The time for which this node's bids hold, and it counts as alive, without renewal; 1 s unless set, at least 10
    /// ms.
    pub lease: Duration,
    /// The longest lease granted to others. As long, a restarted home keeps its `guarded` events back.
    pub longest_lease: Duration,
    /// Events that no remote bid can block or, outside `gateway`, request (G6).
    pub safety: EventSet,
    /// Events that others may request and nobody from afar can block: `<name>/order` unless set.
    pub gateway: EventSet,
    /// The rights of the others to request and block events here (G7): everybody may do everything unless set.
    pub authority: Authority,
    /// Events that this home selects, after a start, only once it knows every member's blocks: from their records,
    /// or because the longest lease has passed.
    pub guarded: EventSet,
    /// The nodes that decide on `swarm/...` events in the first term (G8); none: there are no such events.
    pub joint: Option<Roster>,
    /// Whether the driver saves what must be kept before it sends: without that, blocks that are to outlive their
    /// holders are refused.
    pub durable: bool,
    /// The promises of a former life of this node.
    pub kept: Kept,
    /// Whether what a former life has kept is lost. As coordinator it then decides nothing before an operator
    /// begins a new term, since it does not know what it has decided in this one.
    pub forgot: bool,
    /// The band that priorities of remote bids are brought into.
    pub remote_priority: RangeInclusive<i32>,
    /// The number of occurrences that are kept for those who missed them; at least 1.
    pub history: usize,
    /// Selections in one step after which the program counts as unsettled. They count from the last one that another
    /// node has asked for, and what others have decided does not count: no other node can make a program unsettled.
    pub settle_limit: usize,
    /// The promise that this node breaks on purpose.
    #[cfg(feature = "mutants")]
    pub mutant: Option<crate::mutant::Mutant>,
}

impl NodeConfig {
    /// The usual settings for a node in a fleet.
    pub fn new(name: NodeName, incarnation: u64, roster: Vec<NodeName>) -> Self {
        let gateway = EventSet::named(name.event_name("order"));
        Self {
            name,
            incarnation,
            roster,
            lease: Duration::from_secs(1),
            longest_lease: Duration::from_secs(10),
            safety: EventSet::None,
            gateway,
            authority: Authority::default(),
            guarded: EventSet::None,
            joint: None,
            durable: false,
            kept: Kept::default(),
            forgot: false,
            remote_priority: i32::MIN..=i32::MAX,
            history: 1024,
            settle_limit: 1000,
            #[cfg(feature = "mutants")]
            mutant: None,
        }
    }

    /// The same settings, brought into their ranges; the roster is of others only, in order.
    pub(crate) fn in_range(mut self) -> Self {
        let lease = u64::try_from(self.lease.max(LEAST_LEASE).as_millis()).unwrap_or(u64::MAX);
        self.lease = Duration::from_millis(lease);
        self.longest_lease = self.longest_lease.max(self.lease);
        self.roster.retain(|member| *member != self.name);
        self.roster.sort();
        self.roster.dedup();
        self
    }

    pub(crate) fn lease_ms(&self) -> u64 {
        u64::try_from(self.lease.as_millis()).unwrap_or(u64::MAX)
    }
}
