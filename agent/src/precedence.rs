//! The order of precedence when b-threads of one vehicle disagree. Written once, here.
//!
//! The order is pilot, collision, battery emergency, fence, battery low, link, mission: a fence that outranks an
//! empty battery has crashed vehicles.

/// A human took the vehicle.
pub const PILOT: i32 = 70;
/// Something is about to be hit.
pub const COLLISION: i32 = 60;
/// The battery is nearly empty.
pub const BATTERY_EMERGENCY: i32 = 50;
/// The vehicle is outside its geofence.
pub const FENCE: i32 = 40;
/// The battery holds what the way home needs.
pub const BATTERY_LOW: i32 = 30;
/// The ground station is out of reach, or its operator gives an order.
pub const LINK: i32 = 20;
/// Everything the vehicle was sent out to do.
pub const MISSION: i32 = 10;
