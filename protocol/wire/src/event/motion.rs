//! What a vehicle decides about its motion.

use super::Text;

skein_bp::words! {
    /// Why a path is asked for.
    pub enum PlanReason {
        /// There is a new waypoint, or the last search found no path.
        Waypoint = "waypoint",
        /// The path ahead is blocked.
        Obstacle = "obstacle",
        /// The vehicle makes no way; the path goes around its neighbours too.
        Stuck = "stuck",
    }
}

skein_bp::events! {
    /// Everything that moves a vehicle. A pilot who takes it over keeps all of these from happening.
    pub const MOTION;

    /// Arm, then climb to the take-off height. The ground requests it, of one vehicle after another.
    Takeoff = "takeoff", Anyone;
    /// Fly to a waypoint.
    Goto = "goto", Anyone {
        /// Number of the waypoint from 0; -1 for the way home, -2 for an operator's point.
        leg: i64,
        /// Whether the vehicle lands there.
        lands: bool,
        x: f64 ["m"],
        y: f64 ["m"],
        z: f64 ["m"],
    }
    /// Compute a path to the present waypoint.
    Plan = "plan", Own {
        why: PlanReason,
    }
    /// Leave to move for one navigation cycle. To block it holds the vehicle. It names the place where it leads while a
    /// script listens to `ahead`.
    Advance = "advance", Anyone {
        x: Option<f64> ["m"],
        y: Option<f64> ["m"],
        z: Option<f64> ["m"],
    }
    /// Leave to move on the way home. Unlike `advance`, nobody can block it from afar.
    Homeward = "homeward", Own;
    /// Enter this narrow place. One after another, all places of a stretch are entered before the vehicle flies there.
    Enter = "enter", Anyone {
        x: f64 ["m"],
        y: f64 ["m"],
        z: f64 ["m"],
        /// Where it will be flown to from there, counter-clockwise from east.
        heading: Option<f64> ["deg"],
    }
    /// Leave to move leads out of the way of another for now, not to the waypoint.
    MakeWay = "make_way", Own {
        /// Of which one.
        of: Text,
    }
    /// Fly by this source of position from now on: `autopilot`, `markers`, `lidar`, or `dead_reckoning` for inertia and
    /// flow alone.
    FlyBy = "fly_by", Anyone {
        source: Text,
    }
    /// Stop and hover at once.
    Hold = "hold", Own {
        why: Text,
    }
    /// Land here.
    Land = "land", Own {
        why: Text,
    }
    /// Fly home and land.
    Return = "return", Own {
        why: Text,
    }
}

impl Advance {
    /// Leave to move, without a word of where it leads.
    pub const ANYWHERE: Self = Self { x: None, y: None, z: None };
}
