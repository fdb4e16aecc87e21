//! The missions of LSC planner experiments (Park et al.): JSON with `#` comments, one start and goal per agent.

use nalgebra::Vector3;
use skein_world::{Aabb, VehicleModel};

use super::json::{Document, Node};
use super::{Mission, MissionError, MissionSet, Waypoint};

/// A mission as the experiment sets it: who flies from where to where, within which bounds and limits.
#[derive(Debug, Clone, PartialEq)]
pub struct LscMission {
    pub bounds: Aabb,
    pub agents: Vec<LscAgent>,
}

/// One vehicle of an [`LscMission`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LscAgent {
    /// Its first hover, world ENU, m.
    pub start: Vector3<f64>,
    /// Its last hover, world ENU, m.
    pub goal: Vector3<f64>,
    pub radius_m: f64,
    /// Greatest speed on each axis, m/s.
    pub max_speed_m_s: Vector3<f64>,
    /// Greatest acceleration on each axis, m/s^2.
    pub max_accel_m_s2: Vector3<f64>,
    /// Heights of others count less by this factor, for the air below a vehicle.
    pub downwash: f64,
}

impl LscMission {
    /// Reads a mission; `file` is what errors call it.
    pub fn read(text: &str, file: &str) -> Result<Self, MissionError> {
        let document = Document::parse(text, file)?;
        let root = document.root();
        let kinds = root.member("quadrotors")?;
        let world = root.member("world")?;
        let [world] = &world.elements()?[..] else { return Err(world.mismatch("one world")) };
        let dimension = world.member("dimension")?;
        let [x_min, y_min, z_min, x_max, y_max, z_max] = dimension.numbers::<6>()?;
        let bounds = Aabb { min: Vector3::new(x_min, y_min, z_min), max: Vector3::new(x_max, y_max, z_max) };
        if (0..3).any(|axis| bounds.min[axis] >= bounds.max[axis]) {
            return Err(dimension.mismatch("three least coordinates, then three greater ones"));
        }
        let agents = root.member("agents")?;
        let read = agents
            .elements()?
            .iter()
            .map(|one| LscAgent::read(one, &kinds))
            .collect::<Result<Vec<_>, _>>()?;
        if read.is_empty() {
            return Err(agents.mismatch("at least one agent"));
        }
        Ok(Self { bounds, agents: read })
    }
}

impl LscAgent {
    fn read(agent: &Node<'_>, kinds: &Node<'_>) -> Result<Self, MissionError> {
        let kind = kinds.member(agent.member("type")?.text()?)?;
        let positive = |limit: &str| {
            let node = kind.member(limit)?;
            let limits = Vector3::from(node.numbers::<3>()?);
            if limits.min() > 0.0 { Ok(limits) } else { Err(node.mismatch("three numbers above 0")) }
        };
        Ok(Self {
            start: Vector3::from(agent.member("start")?.numbers::<3>()?),
            goal: Vector3::from(agent.member("goal")?.numbers::<3>()?),
            radius_m: kind.member("radius")?.number_in(0.01, 10.0, "m")?,
            max_speed_m_s: positive("max_vel")?,
            max_accel_m_s2: positive("max_acc")?,
            downwash: kind.member("downwash")?.number_in(1.0, 100.0, "")?,
        })
    }
}

/// Reads the `agents`. Starts are taken down to the ground; goals keep their height.
pub fn read(root: &Node<'_>) -> Result<MissionSet, MissionError> {
    let agents = root.member("agents")?;
    let missions = agents.elements()?.iter().map(agent).collect::<Result<Vec<_>, _>>()?;
    if missions.is_empty() {
        return Err(agents.mismatch("at least one agent"));
    }
    let obstacles = root.optional("obstacles").filter(|o| !o.is_empty());
    match obstacles {
        Some(obstacles) => Err(obstacles.mismatch("no moving obstacles, which are not flown around")),
        None => Ok(MissionSet { missions, ..MissionSet::default() }),
    }
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
        waypoints: vec![Waypoint { position: goal, ..Waypoint::default() }],
        takeoff_height_m: (start.z > 0.0).then_some(start.z),
        model: kind.filter(known).map(str::to_owned),
        exact: true,
        ..Mission::default()
    })
}
