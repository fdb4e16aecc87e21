//! The event names that agents and the ground agree on.
//!
//! An event's home is its first two name chunks, so every event here is `<node>/<verb>`: `uav/3/takeoff` is decided on
//! `uav/3`, whoever asks for it. Verbs a vehicle selects at the request of its own b-threads or of a remote one come
//! first; what its body reports (external events) comes second. Lengths are in metres, positions ENU.

use skein_bp::{Event, EventSet};

/// The event `<node>/<verb>`, without data.
#[must_use]
pub fn event(node: impl std::fmt::Display, verb: &str) -> Event {
    Event::new(format!("{node}/{verb}"))
}

/// The events `<node>/<verb>`, whatever their data.
#[must_use]
pub fn of(node: impl std::fmt::Display, verb: &str) -> EventSet {
    EventSet::named(format!("{node}/{verb}"))
}

/// The events `uav/*/<verb>` of all vehicles, whatever their data.
#[must_use]
pub fn of_every_vehicle(verb: &str) -> EventSet {
    EventSet::from(format!("uav/*/{verb}"))
}

/// An operator's order to one vehicle: `what` is `hold`, `resume`, `land`, `return`, `hand_back`, or `goto` with `x`, `y`,
/// `z` beside it.
#[must_use]
pub fn order(node: impl std::fmt::Display, what: &str) -> Event {
    event(node, ORDER).with("what", what)
}

/// First chunk of the joint events `swarm/<verb>`, which the coordinator decides on for all.
pub const SWARM: &str = "swarm";
/// `swarm/launch`: every vehicle takes off now. Those that are not ready block it.
pub const LAUNCH: &str = "launch";
/// `swarm/abort`: every vehicle lands where it is.
pub const ABORT: &str = "abort";

/// Arm, then climb to the take-off height. Requested by the ground, one vehicle after another.
pub const TAKEOFF: &str = "takeoff";
/// Fly to a waypoint: data `leg` (int), `x`, `y`, `z`, and whether the vehicle `lands` there.
pub const GOTO: &str = "goto";
/// Compute a path to the current waypoint: data `why` (text).
pub const PLAN: &str = "plan";
/// Leave to move for one navigation cycle. Blocking it holds the vehicle.
pub const ADVANCE: &str = "advance";
/// Leave to move on the way home. Unlike [`ADVANCE`], nobody can block it from afar.
pub const HOMEWARD: &str = "homeward";
/// Enter the narrow passage around `x`, `y`, `z`.
pub const ENTER: &str = "enter";
/// The narrow passage lies behind.
pub const LEAVE: &str = "leave";
/// Stop and hover at once. A safety event: no remote b-thread can block it.
pub const HOLD: &str = "hold";
/// Fly home and land: data `why` (text). A safety event.
pub const RETURN: &str = "return";
/// Land here: data `why` (text). A safety event.
pub const LAND: &str = "land";
/// What an operator wants: data `what` (text). The one gateway for remote safety requests.
pub const ORDER: &str = "order";
/// An operator gives the vehicle back to its agent after a pilot had it.
pub const HAND_BACK: &str = "hand_back";
/// An order is not carried out: data `what`, `why` (texts).
pub const DECLINED: &str = "declined";
/// A joint decision is taken to heart: data `what` (text).
pub const HEEDED: &str = "heeded";
/// The mission is complete and the vehicle is on the ground.
pub const COMPLETE: &str = "complete";
/// The mission ended without reaching its goal: data `why` (text).
pub const FAILED: &str = "failed";

/// Preflight checks pass.
pub const READY: &str = "ready";
/// A preflight check that had passed fails again.
pub const UNREADY: &str = "unready";
/// The vehicle is in the air at its take-off height.
pub const AIRBORNE: &str = "airborne";
/// The vehicle stands on the ground, disarmed.
pub const LANDED: &str = "landed";
/// The waypoint of `leg` is reached.
pub const ARRIVED: &str = "arrived";
/// A path to the waypoint of `leg` exists: data `length_m`.
pub const PLANNED: &str = "planned";
/// No path to the waypoint of `leg` exists: data `why` (text).
pub const UNPLANNABLE: &str = "unplannable";
/// The path ahead runs into an obstacle that was not known when it was planned.
pub const PATH_BLOCKED: &str = "path_blocked";
/// Leave to move was given, and yet the vehicle makes no way.
pub const STUCK: &str = "stuck";
/// A narrow passage lies ahead around `x`, `y`, `z`.
pub const PASSAGE: &str = "passage";
/// A neighbour is nearer than the emergency distance: data `other` (text).
pub const TOO_CLOSE: &str = "too_close";
/// No neighbour is nearer than the emergency distance any more.
pub const CLEAR: &str = "clear";
/// What is left in the battery is what the way home needs.
pub const BATTERY_LOW: &str = "battery_low";
/// The battery is nearly empty.
pub const BATTERY_CRITICAL: &str = "battery_critical";
/// The vehicle is outside its geofence.
pub const FENCE_BREACHED: &str = "fence_breached";
/// Somebody else changed the flight mode: data `mode` (text).
pub const PILOT: &str = "pilot";
/// The agent did not run for `seconds` (real), too long for what it knew and what it had said to count.
pub const SLEPT: &str = "slept";
/// The agent started while its vehicle was in the air.
pub const FOUND_AIRBORNE: &str = "found_airborne";
/// The autopilot refused or never answered a command: data `why` (text).
pub const COMMAND_FAILED: &str = "command_failed";

/// What only the vehicle itself can say or decide: from afar these are neither blocked nor requested (G6).
pub const OWN: [&str; 28] = [
    HOLD,
    RETURN,
    LAND,
    HAND_BACK,
    DECLINED,
    HEEDED,
    SLEPT,
    HOMEWARD,
    PLAN,
    LEAVE,
    READY,
    UNREADY,
    AIRBORNE,
    LANDED,
    ARRIVED,
    PLANNED,
    UNPLANNABLE,
    PATH_BLOCKED,
    STUCK,
    PASSAGE,
    TOO_CLOSE,
    CLEAR,
    BATTERY_LOW,
    BATTERY_CRITICAL,
    FENCE_BREACHED,
    PILOT,
    FOUND_AIRBORNE,
    COMMAND_FAILED,
];
