//! What a vehicle finds out on its way.

use super::Text;

skein_bp::words! {
    /// The right to go first where there is room for one. Who has more of it goes before who has less; of two with
    /// the same right, the one with the lower number.
    pub enum Right {
        /// It is in no narrow place.
        Free = "free",
        /// It is in a narrow place that the others have confirmed.
        Inside = "inside",
        /// It is in a narrow place and cannot make way.
        Cornered = "cornered",
    }
}

// Nobody has a right that was not told.
#[allow(clippy::derivable_impls)]
impl Default for Right {
    fn default() -> Self {
        Self::Free
    }
}

skein_bp::events! {
    /// What is found out about the way, the vehicle's surroundings and its battery.
    pub const SENSES;

    /// The waypoint is reached.
    Arrived = "arrived", Own {
        /// As in `goto`.
        leg: i64,
    }
    /// A path to the waypoint exists.
    Planned = "planned", Own {
        /// As in `goto`.
        leg: i64,
        length_m: f64 ["m", 0.0..=f64::INFINITY],
    }
    /// No path to the waypoint exists.
    Unplannable = "unplannable", Own {
        /// As in `goto`.
        leg: i64,
        why: Text,
        /// The zone in the way, if one is: the vehicle waits for its end.
        zone: Option<Text>,
    }
    /// The path ahead runs into an obstacle that was not known when it was planned.
    PathBlocked = "path_blocked", Own;
    /// The vehicle is above its map or outside its fence, where no path leads: it goes straight to this place
    /// first, and does not plan before it is there.
    WayBack = "way_back", Own {
        x: f64 ["m"],
        y: f64 ["m"],
        z: f64 ["m"],
        /// Where it is, and whether something holds it up.
        why: Text,
    }
    /// Leave to move was given, and yet the vehicle makes no way.
    Stuck = "stuck", Own;
    /// Where the way ends another vehicle stays, nearer than this one may come.
    PlaceTaken = "place_taken", Own {
        /// As in `goto`.
        leg: i64,
        /// Which one.
        by: Text,
        /// Whether that is on its way elsewhere.
        leaves: bool,
    }
    /// Nobody else stays any more where the way ends.
    PlaceFree = "place_free", Own;
    /// Where a return would end: the nearest of home and the rally points that no other vehicle has.
    Refuge = "refuge", Own {
        x: f64 ["m"],
        y: f64 ["m"],
        z: f64 ["m"],
    }
    /// A narrow stretch of the way lies ahead, or goes on further, or less of it is left: its first place.
    Passage = "passage", Own {
        x: f64 ["m"],
        y: f64 ["m"],
        z: f64 ["m"],
        /// All its places, as `x y z heading` in metres and degrees, with `; ` between two; without it, this one.
        way: Option<Text>,
        /// Where the vehicle itself is, if that is in it, likewise.
        here: Option<Text>,
    }
    /// The narrow stretch lies behind.
    Leave = "leave", Own;
    /// The vehicle stands, and lets go all that it has entered but where it is, for whoever wants to come out there.
    GiveWay = "give_way", Own;
    /// The vehicle stands where another wants to go, and there is no room to pass.
    InTheWay = "in_the_way", Own {
        /// Of which one.
        of: Text,
        /// The right that it has.
        right: Right,
    }
    /// It does not any more, or the other does not want to go there any more.
    OutOfTheWay = "out_of_the_way", Own;
    /// There is no place where it could make way for another.
    Cornered = "cornered", Own {
        /// By which one.
        by: Text,
    }
    /// A neighbour is nearer than the emergency distance.
    TooClose = "too_close", Own {
        /// Which one.
        other: Text,
    }
    /// No neighbour is nearer than the emergency distance any more.
    Clear = "clear", Own;
    /// What is left in the battery is what the way home needs, or nobody knows what is left.
    BatteryLow = "battery_low", Own {
        why: Text,
    }
    /// On the ground the battery was changed, or charged.
    BatteryChanged = "battery_changed", Own {
        /// Charge before.
        from_percent: i64 ["%", 0.0..=100.0],
        /// Charge now.
        to_percent: i64 ["%", 0.0..=100.0],
    }
    /// The battery is nearly empty.
    BatteryCritical = "battery_critical", Own;
    /// The vehicle is outside its geofence.
    FenceBreached = "fence_breached", Own;
    /// In the air, the vehicle does not know where it is, or not well enough: it holds, and lands if that lasts.
    PositionDoubted = "position_doubted", Own {
        why: Text,
        /// Standard deviation of its position, as it tells others.
        sigma_m: f64 ["m", 0.0..=f64::INFINITY],
    }
    /// It knows where it is again.
    PositionTrusted = "position_trusted", Own;
    /// A source of position can be flown by: `autopilot`, `markers` or `lidar`.
    SourceFound = "source_found", Own {
        source: Text,
    }
    /// It cannot any more: it is silent, or disagrees.
    SourceLost = "source_lost", Own {
        source: Text,
        why: Text,
    }
}
