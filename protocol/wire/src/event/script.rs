//! Scripts on a vehicle: how they come and go, and what is told to them.

use super::Text;

skein_bp::words! {
    /// What has become of a script.
    pub enum ScriptState {
        /// It runs from now on.
        Accepted = "accepted",
        /// It is not run.
        Refused = "refused",
        /// It was taken back.
        Withdrawn = "withdrawn",
        /// It has come to an end.
        Ended = "ended",
    }
}

skein_bp::events! {
    /// How scripts come and go.
    pub const SCRIPTS;

    /// Run a script.
    Load = "load", Operator {
        /// The name it will run under.
        name: Option<Text>,
        /// The script and the values of its parameters, as JSON.
        script: Text,
        /// The person or program that sends it. One that names nobody is refused.
        by: Option<Text>,
    }
    /// Withdraw a script.
    Unload = "unload", Operator {
        /// The name it runs under.
        name: Text,
        /// The person or program that withdraws it. One that names nobody is refused.
        by: Option<Text>,
    }
    /// News of a script.
    ScriptNews = "script", Own {
        /// The name it runs under.
        name: Text,
        state: ScriptState,
        why: Text,
    }
}

skein_bp::events! {
    /// What is told only while a script, or a behaviour that names it, listens. Places are told in the air, when they
    /// have changed by a metre.
    pub const SCRIPT_FACTS;

    /// Where the vehicle is.
    At = "at", Own {
        x: f64 ["m"],
        y: f64 ["m"],
        z: f64 ["m"],
    }
    /// Where leave to move will have led in a moment, with room to stop before. Then `advance` has this place too.
    Ahead = "ahead", Own {
        x: f64 ["m"],
        y: f64 ["m"],
        z: f64 ["m"],
    }
    /// Where another vehicle in the air is.
    NeighbourAt = "neighbour", Own {
        /// Which one.
        node: Text,
        x: f64 ["m"],
        y: f64 ["m"],
        z: f64 ["m"],
        /// From this vehicle.
        distance_m: f64 ["m", 0.0..=f64::INFINITY],
    }
    /// Which of the other vehicles in the air is nearest; one that has fallen silent counts as where it was last.
    Nearest = "nearest", Own {
        /// Which one.
        node: Text,
        /// From this vehicle.
        distance_m: f64 ["m", 0.0..=f64::INFINITY],
    }
    /// No other vehicle is known to be in the air any more.
    Alone = "alone", Own;
    /// What is left in the battery has passed a multiple of 5 %.
    BatteryLevel = "battery", Own {
        percent: i64 ["%", 0.0..=100.0],
    }
}
