//! The b-threads of a vehicle, one file each. They decide *what* may be done; the pipeline decides *how*.
//!
//! Adding a b-thread: write its file, name it in [`load`]. No other b-thread changes. One in a crate of one's own is a
//! [`Behaviour`](skein_bp::behaviour::Behaviour).

mod await_place;
mod battery;
mod choosing;
pub mod escape;
mod found_airborne;
mod geofence;
mod holder;
mod link_loss;
mod lost_promises;
pub mod mission;
pub mod navigation;
mod obstacle_avoidance;
mod one_name;
mod operator;
pub mod path_planning;
mod pilot;
mod positioning;
mod preflight;
mod reposition;
pub mod return_home;
pub mod right_of_way;
mod separation;
mod together;

use skein_bp::{BThread, Program};

pub use await_place::{AwaitPlace, PATIENCE as PATIENCE_FOR_A_PLACE};
pub use battery::Battery;
pub use choosing::Choosing;
pub use escape::Escape;
pub use found_airborne::FoundAirborne;
pub use geofence::Geofence;
pub use holder::{HOLDING_LASTS, Holder};
pub use link_loss::{LinkLoss, LinkLossPolicy};
pub use lost_promises::LostPromises;
pub use mission::Mission;
pub use navigation::Navigation;
pub use obstacle_avoidance::ObstacleAvoidance;
pub use one_name::OneName;
pub use operator::Operator;
pub use path_planning::PathPlanning;
pub use pilot::Pilot;
pub use positioning::Positioning;
pub use preflight::Preflight;
pub use reposition::{OPERATOR_LEG, Reposition};
pub use return_home::{HOME_LEG, ReturnHome};
pub use right_of_way::{NAME as RIGHT_OF_WAY, RightOfWay};
pub use separation::Separation;
pub use together::Together;

use crate::config::{AgentConfig, PositionSource};
use crate::me::Me;

/// Loads a vehicle's b-threads into its program.
pub fn load(program: &mut Program, config: &AgentConfig) {
    let with_say = |node: &&String| node.starts_with("uav/") || **node == config.ground;
    let others = config.roster.iter().filter(with_say).filter(|node| **node != config.node);
    let others = others.map(String::as_str);
    let right_of_way = RightOfWay::new(Me::new(&config.node), others, config.lease);
    load_with(program, config, right_of_way.with_short_radio(config.radio_range_m.is_some()));
}

/// The same with another b-thread in place of [`RightOfWay`].
pub fn load_with(program: &mut Program, config: &AgentConfig, right_of_way: impl BThread) {
    let me = Me::new(&config.node);
    let [x, y, _] = config.home;
    program.add("pilot", Pilot::new(me.clone()));
    program.add("positioning", Positioning::new(me.clone()));
    if config.position.iter().any(|source| *source != PositionSource::Autopilot) {
        program.add("choosing", Choosing::new(me.clone(), &config.position));
    }
    program.add("separation", Separation::new(me.clone()));
    program.add("obstacle_avoidance", ObstacleAvoidance::new(me.clone()));
    program.add(RIGHT_OF_WAY, right_of_way);
    program.add("preflight", Preflight::new(me.clone()));
    program.add("found_airborne", FoundAirborne::new(me.clone()));
    program.add("one_name", OneName::new(me.clone()));
    program.add("battery", Battery::new(me.clone()));
    program.add("geofence", Geofence::new(me.clone(), config.fence.min, config.fence.max));
    program.add("link_loss", LinkLoss::new(me.clone(), &config.ground, config.link_loss));
    program.add(Holder::NAME, Holder::new(me.clone()));
    program.add("operator", Operator::new(me.clone()));
    program.add("together", Together::new(me.clone()));
    program.add("reposition", Reposition::new(me.clone()));
    program.add("return_home", ReturnHome::new(me.clone(), [x, y, config.return_altitude_m]));
    program.add("escape", Escape::new(me.clone()));
    program.add("await_place", AwaitPlace::new(me.clone()));
    program.add(Mission::NAME, Mission::new(me.clone(), &config.waypoints).with_errands(&config.errands));
    program.add("path_planning", PathPlanning::new(me.clone()));
    program.add("navigation", Navigation::new(me));
    config.behaviours.load(&config.host(), program);
}
