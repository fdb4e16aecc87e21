//! The missions of LSC planner experiments (Park et al.): JSON with `#` comments, one start and goal per agent.

use nalgebra::Vector3;
use skein_world::VehicleModel;

use super::json::Node;
use super::{Ends, Mission, MissionError, MissionSet, Waypoint};

/// Reads the `agents`. Starts are taken down to the ground; goals keep their height.
pub fn read(root: &Node<'_>) -> Result<MissionSet, MissionError> {
    let agents = root.member("agents")?;
    let missions = agents.elements()?.iter().map(agent).collect::<Result<Vec<_>, _>>()?;
    if missions.is_empty() {
        return Err(agents.mismatch("at least one agent"));
    }
    let obstacles = root.optional("obstacles").filter(|o| !o.is_empty());
    let warnings =
        obstacles.iter().map(|o| o.warning("moving obstacles are not read; they are left out")).collect();
    Ok(MissionSet { missions, warnings, datum: None })
}

fn agent(agent: &Node<'_>) -> Result<Mission, MissionError> {
    let start = Vector3::from(agent.member("start")?.numbers::<3>()?);
    let goal_node = agent.member("goal")?;
    let goal = Vector3::from(goal_node.numbers::<3>()?);
    if goal.z <= 0.0 {
        return Err(goal_node.error("a goal above the ground", format!("height {}", goal.z)));
    }
    let kind = agent.optional("type").map(|kind| kind.text()).transpose()?;
    let known = |kind: &&str| VehicleModel::built_in_names().any(|name| name == *kind);
    Ok(Mission {
        home: Vector3::new(start.x, start.y, 0.0),
        waypoints: vec![Waypoint { position: goal, hold_s: 0.0, speed_m_s: None }],
        ends: Ends::Land,
        takeoff_height_m: (start.z > 0.0).then_some(start.z),
        model: kind.filter(known).map(str::to_owned),
        exact: true,
    })
}
