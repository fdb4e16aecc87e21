//! Routes of several vehicles through an airspace that is known beforehand (P3).
//!
//! Vehicles plan one after another, each among those who have planned before it ([`Traffic`]), and fly so that all
//! arrive together ([`arrive_together`]). With a link the ground plans for all ([`Planner::Ground`]) and sends
//! waypoints; without, each vehicle plans for itself ([`Planner::Onboard`]) among the routes that it has last heard of.
//!
//! ```
//! use nalgebra::{Vector2, Vector3};
//! use skein_planning::airspace::{Airspace, ThreatZone};
//! use skein_swarm::route::{Effort, Planner, RouteCost, RouteProblem, Traffic};
//!
//! let threats = vec![ThreatZone { centre: Vector2::new(500.0, 500.0), radius_m: 200.0 }];
//! let airspace = Airspace { upper: Vector3::new(1000.0, 1000.0, 500.0), threats, ..Airspace::default() };
//! let ends = (Vector3::new(0.0, 450.0, 100.0), Vector3::new(1000.0, 500.0, 100.0));
//! let others = Traffic::default();
//! let mut problem = RouteProblem::new(&airspace, &others, RouteCost::default(), ends, 5)?;
//! let plan = Planner::Onboard.plan(&mut problem, Effort::default(), 1);
//! assert!(plan.assessment.is_feasible() && plan.assessment.length_m < 1100.0);
//! # Ok::<(), skein_swarm::route::RouteError>(())
//! ```

mod any_angle;
mod arrival;
mod conflict;
mod cost;
mod craft;
mod planner;
mod problem;
mod traffic;
mod weights;

pub use self::any_angle::{AnyAngleConfig, any_angle, refined};
pub use self::arrival::{Arrival, arrival_slots, arrive_together};
pub use self::conflict::{Conflict, Flight, conflicts};
pub use self::cost::Assessment;
pub use self::craft::{Craft, UnfitCraft};
pub use self::planner::{Effort, Plan, Planner, plan_in_turn};
pub use self::problem::{RouteError, RouteProblem};
pub use self::traffic::{PARTS, Traffic};
pub use self::weights::RouteCost;
