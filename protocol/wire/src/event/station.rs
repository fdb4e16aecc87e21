//! What a ground station tells its own b-threads.

use skein_dbp::NodeName;

use super::{Text, What};

skein_bp::words! {
    /// How a vehicle was found by a station that has just heard of it.
    pub enum Situation {
        /// On the ground, its mission before it.
        Grounded = "grounded",
        /// In the air, or about to be.
        Flying = "flying",
        /// On the ground, its mission done.
        Complete = "complete",
        /// On the ground, its mission not done.
        Failed = "failed",
    }
}

skein_bp::events! {
    /// The station's own events.
    pub const STATION;

    /// The operator has ordered something.
    OrderGiven = "ordered", Anyone {
        what: What,
        /// A vehicle, or `all`.
        who: Text,
        /// The person or program that has ordered it.
        by: Text,
        /// To whom a vehicle is given, for `give`.
        to: Option<Text>,
        /// The name of the script that it is about.
        name: Option<Text>,
        /// For `load`: the script and the values of its parameters, as JSON.
        script: Option<Text>,
        /// Where to, for `goto`.
        x: Option<f64> ["m"],
        y: Option<f64> ["m"],
        z: Option<f64> ["m"],
        /// The points of a `route`, in m: `x y z; x y z`.
        way: Option<Text>,
    }
    /// The operator has drawn a zone for all vehicles, or drawn the zone of this name anew.
    Drawn = "drawn", Anyone {
        /// Its name.
        name: Text,
        /// The zone, as JSON.
        zone: Text,
        by: Text,
    }
    /// The operator has removed a zone.
    Erased = "erased", Anyone {
        /// Its name.
        name: Text,
        by: Text,
    }
    /// An order is not brought to this vehicle any more: another person or program holds it.
    Overruled = "overruled", Anyone {
        vehicle: NodeName,
        /// Who holds it.
        by: Text,
    }
    /// A vehicle's first word to this station, in each of its lives.
    Heard = "heard", Anyone {
        vehicle: NodeName,
        situation: Situation,
        /// Its task, as it tells it.
        why: Text,
    }
    /// It is this vehicle's turn to take off.
    Turn = "turn", Anyone {
        vehicle: NodeName,
    }
    /// This vehicle does not take off now; others go first.
    Later = "later", Anyone {
        vehicle: NodeName,
    }
    /// Every vehicle is on the ground, and knows how its mission went.
    MissionOver = "mission_over", Anyone {
        /// Whether every vehicle did what it was sent for.
        succeeded: bool,
    }
}

impl OrderGiven {
    /// How it names all vehicles.
    pub const ALL: &str = "all";

    /// An order that needs no more than whom it is for.
    pub fn plain(what: What, who: &str, by: &str) -> Self {
        let (who, by) = (who.into(), by.into());
        Self { what, who, by, to: None, name: None, script: None, x: None, y: None, z: None, way: None }
    }

    /// The same order, to this place, metres ENU.
    #[must_use]
    pub fn at_place(self, [x, y, z]: [f64; 3]) -> Self {
        Self { x: Some(x), y: Some(y), z: Some(z), ..self }
    }

    /// Whether it is for `vehicle`.
    pub fn is_for(&self, vehicle: &NodeName) -> bool {
        *self.who == *Self::ALL || *self.who == *vehicle.as_str()
    }
}
