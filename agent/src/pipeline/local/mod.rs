//! The local planners of a vehicle: which velocity follows the path now; see [`skein_planning::local`].
//!
//! Another planner is a file here, a line in [`path_follower`], and a name in
//! [`LocalPlanner`](crate::config::LocalPlanner).

mod apf;
mod path_follower;
mod vfh;

pub use self::apf::Apf;
pub use self::path_follower::{PathFollower, Place, TICK_S};
pub use self::vfh::Vfh;
pub use skein_planning::local::vfh::Step;

use crate::config::{Envelope, LocalPlanner};

/// The planner of this name, for a vehicle of this envelope.
pub fn path_follower(planner: LocalPlanner, envelope: &Envelope) -> Box<dyn PathFollower> {
    match planner {
        LocalPlanner::Apf => Box::new(Apf::new(envelope)),
        LocalPlanner::Vfh => Box::new(Vfh::new(envelope)),
    }
}
