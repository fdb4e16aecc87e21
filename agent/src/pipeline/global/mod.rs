//! The global planners of a vehicle: a path through the map; see [`skein_planning::global`].
//!
//! Another planner is a file here, a line in [`path_finder`], and a name in
//! [`GlobalPlanner`](crate::config::GlobalPlanner).

mod astar;
mod dstar_lite;
mod path_finder;

pub use self::astar::AstarFinder;
pub use self::dstar_lite::DstarLiteFinder;
pub use self::path_finder::{Found, PathFinder, Task};

use crate::config::GlobalPlanner;

/// The planner of this name.
pub fn path_finder(planner: GlobalPlanner) -> Box<dyn PathFinder> {
    match planner {
        GlobalPlanner::Astar => Box::new(AstarFinder::default()),
        GlobalPlanner::DstarLite => Box::new(DstarLiteFinder::default()),
    }
}
