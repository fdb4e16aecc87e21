//! The configuration of a ground station.

use std::time::Duration;

use skein_bp::behaviour::{Chosen, Host};
use skein_dbp::{Authority, Kept, NodeName};
use skein_wire::{Fleet, KeptZone, Order, standard_authority};

use crate::giver::Giver;
use crate::planning::Theatre;

/// The configuration of a ground station.
#[derive(Clone, Debug)]
pub struct GroundConfig {
    pub fleet: Fleet,
    /// The station's node name, such as `ground/main`.
    pub name: NodeName,
    /// The vehicles, in the order in which they take off.
    pub vehicles: Vec<NodeName>,
    /// Operators' scripts that may speak to the station too; nobody misses one that is not there.
    pub operators: Vec<NodeName>,
    /// A number that grows with every start of this node.
    pub incarnation: u64,
    /// Orders known in advance, each with its time and who gives it.
    pub orders: Vec<(Duration, Giver, Order)>,
    /// Whether the b-threads are loaded; without them the station listens and asks for nothing.
    pub loaded: bool,
    /// Whether the swarm takes off when an operator orders it, and not as soon as it is there.
    pub launch_on_order: bool,
    /// Whether nobody sets out before everybody is in the air.
    pub muster: bool,
    /// The behaviours that are switched on; those for other nodes count for nothing.
    pub behaviours: Chosen,
    /// The station's means to plan for the fleet; without it, it makes no plans.
    pub theatre: Option<Theatre>,
    /// Lease of the station's bids.
    pub lease: Duration,
    /// The rights of other nodes to request and block events here.
    pub authority: Authority,
    /// The promises of a former life of this station: joint decisions, and a roster that an operator has given.
    pub kept: Kept,
    /// Whether what a former life has kept is lost: see
    /// [`NodeConfig::forgot`](skein_dbp::NodeConfig::forgot).
    pub forgot: bool,
    /// The zones that a former life of this station has drawn.
    pub zones: Vec<KeptZone>,
    /// Seed of the program's tie-breaks.
    pub seed: u64,
}

impl GroundConfig {
    /// The station `name`, in its first incarnation, with the usual lease and nothing ordered yet.
    pub fn new(fleet: Fleet, name: NodeName, vehicles: Vec<NodeName>) -> Self {
        let lease = Duration::from_secs(1);
        Self {
            fleet,
            name,
            vehicles,
            operators: Vec::new(),
            incarnation: 1,
            orders: Vec::new(),
            loaded: true,
            launch_on_order: false,
            muster: false,
            behaviours: Chosen::default(),
            theatre: None,
            lease,
            authority: standard_authority(),
            kept: Kept::default(),
            forgot: false,
            zones: Vec::new(),
            seed: 0,
        }
    }

    /// The station as its behaviours see it.
    pub fn host(&self) -> Host<'_> {
        let roster = self.vehicles.iter().chain([&self.name]).chain(&self.operators);
        Host { node: self.name.as_str(), roster: roster.map(NodeName::as_str).collect() }
    }
}
