//! A world: what stands in it, where it is on Earth, and how the air moves.

use nalgebra::Vector3;
use skein_mav::Datum;

use super::error::SdfError;
use super::reader::Reader;
use super::stand;
use super::state::State;
use super::text::Element;
use super::tree::Model;
use crate::obstacle::{Obstacle, Shape};
use crate::scene::Scene;

/// Children of a world that do not change where it is safe to fly.
const SCENERY: [&str; 11] = [
    "atmosphere",
    "audio",
    "gravity",
    "gui",
    "joint",
    "light",
    "magnetic_field",
    "physics",
    "plugin",
    "road",
    "scene",
];

/// What is no higher than this is ground, m.
const PAVEMENT_M: f64 = 0.05;

/// A world as far as it is read.
#[derive(Default)]
struct World {
    /// All models, in one without a name.
    models: Model,
    state: State,
    actors: Vec<Obstacle>,
    datum: Option<Datum>,
    wind: Option<Vector3<f64>>,
    /// The file is of the time before Gazebo turned headings the right way round.
    is_classic: bool,
}

impl Reader<'_> {
    /// Reads the whole file.
    pub(super) fn read_root(&mut self, root: Element<'_>) -> Result<Scene, SdfError> {
        if root.name() != "sdf" {
            return Err(root.lacks("an <sdf> around everything, with a <world> or <model>"));
        }
        let mut worlds = root.children("world");
        let Some(element) = worlds.next() else { return self.read_bare_models(root) };
        for second in worlds {
            self.account.refuse(second, "only the first <world> of a file is read");
        }
        let version = root.attribute("version").and_then(|version| version.split_once('.'));
        let is_classic = version.is_none_or(|(_, minor)| minor.parse::<u32>().is_ok_and(|minor| minor < 8));
        let mut world = World { is_classic, ..World::default() };
        self.account.honour(element);
        for child in element.elements() {
            self.read_thing(child, &mut world)?;
        }
        // The last word has the state: it takes and gives models.
        let own = element.attribute("name");
        for state in element.children("state") {
            if state.attribute("world_name").is_none_or(|name| Some(name) == own) {
                self.read_state(state, &mut world.models, &mut world.state)?;
            } else {
                self.account.pass(state);
            }
        }
        let name = own.unwrap_or(element.file()).to_owned();
        let scene = self.build(name, world)?;
        if !self.has_ground {
            self.account.note(element, "no ground plane; flat ground at z = 0 is assumed");
        }
        Ok(scene)
    }

    fn read_bare_models(&mut self, root: Element<'_>) -> Result<Scene, SdfError> {
        let mut world = World::default();
        for child in root.elements() {
            match child.name() {
                "model" | "include" | "actor" => self.read_thing(child, &mut world)?,
                "light" => self.account.pass(child),
                _ => self.account.pass_unknown(child),
            }
        }
        let first = root.elements().find(|child| matches!(child.name(), "model" | "include" | "actor"));
        let Some(first) = first else { return Err(root.lacks("a <world> or <model>")) };
        let name = first.attribute("name").unwrap_or(root.file()).to_owned();
        self.build(name, world)
    }

    fn read_thing(&mut self, child: Element<'_>, world: &mut World) -> Result<(), SdfError> {
        match child.name() {
            "model" => {
                let model = self.read_model(child, false, 0)?;
                self.take_in(child, model, world);
            }
            "include" => {
                if let Some(model) = self.read_include(child, false, 0)? {
                    self.take_in(child, model, world);
                }
            }
            "frame" => {
                let frame = self.read_frame(child, child.attribute("attached_to"))?;
                world.models.frames.push(frame);
            }
            "actor" => world.actors.extend(self.read_actor(child)?),
            "spherical_coordinates" => world.datum = Some(self.read_datum(child, world.is_classic)?),
            "wind" => world.wind = self.read_wind(child)?,
            "population" => {
                self.account.refuse(child, "the models that a <population> strews cannot be read")
            }
            "state" => {}
            scenery if SCENERY.contains(&scenery) => self.account.pass(child),
            _ => self.account.pass_unknown(child),
        }
        Ok(())
    }

    fn take_in(&mut self, element: Element<'_>, model: Model, world: &mut World) {
        if !model.is_static && model.has_bodies() {
            let name: String = model.name.chars().take(80).collect();
            self.account.note(element, format!("model `{name}` is not static; it stands still here"));
        }
        world.models.models.push(model);
    }

    fn build(&mut self, name: String, world: World) -> Result<Scene, SdfError> {
        let mut obstacles = stand::obstacles(&world.models, &world.state)?;
        let before = obstacles.len();
        obstacles.retain(|obstacle| !is_pavement(obstacle));
        self.has_ground |= obstacles.len() < before;
        obstacles.iter_mut().for_each(pave);
        obstacles.extend(world.actors);
        let scene = Scene::new(name, obstacles);
        let scene = world.datum.map_or(scene.clone(), |datum| scene.with_datum(datum));
        Ok(world.wind.map_or(scene.clone(), |wind| scene.with_wind(wind)))
    }

    fn read_datum(&mut self, coordinates: Element<'_>, is_classic: bool) -> Result<Datum, SdfError> {
        self.account.honour(coordinates);
        let number = |name, expected, limit: f64| -> Result<f64, SdfError> {
            let Some(node) = coordinates.child(name) else { return Ok(0.0) };
            let [number] = node.numbers::<1>(expected)?;
            if number.abs() > limit { Err(node.bad_value(expected)) } else { Ok(number) }
        };
        let latitude_deg = number("latitude_deg", "degrees of -90 to 90", 90.0)?;
        let longitude_deg = number("longitude_deg", "degrees of -180 to 180", 180.0)?;
        let height_m = number("elevation", "metres", 1e4)?;
        let heading_deg = number("heading_deg", "degrees of -360 to 360", 360.0)?;
        let frame = coordinates.child("world_frame_orientation").filter(|frame| frame.text() != "ENU");
        // A heading of 180 was how one had x point east.
        let east = if is_classic { 180.0 } else { 360.0 };
        let heading = coordinates.child("heading_deg").filter(|_| heading_deg.rem_euclid(east) != 0.0);
        for turned in heading.into_iter().chain(frame) {
            let why =
                "the world is turned against east and north, which cannot be read; without it x is east";
            self.account.refuse(turned, why);
        }
        Ok(Datum::from_degrees(latitude_deg, longitude_deg, height_m))
    }

    fn read_wind(&mut self, wind: Element<'_>) -> Result<Option<Vector3<f64>>, SdfError> {
        self.account.honour(wind);
        Ok(wind.child_numbers::<3>("linear_velocity", "three numbers, m/s")?.map(Vector3::from))
    }
}

/// Whether it is the ground that every scene has, or lies so flat on it that a vehicle stands on it as on the
/// ground.
fn is_pavement(obstacle: &Obstacle) -> bool {
    let Shape::Plane { normal } = obstacle.shape else {
        return obstacle.aabb().is_some_and(|bounds| bounds.max.z <= PAVEMENT_M);
    };
    let up = obstacle.pose.rotation * normal.into_inner();
    up.z > 1.0 - 1e-9 && obstacle.pose.translation.vector.dot(&up) <= PAVEMENT_M
}

/// Takes from terrain where it is so flat on the ground that a vehicle stands on it as on the ground.
fn pave(obstacle: &mut Obstacle) {
    let is_upright = (obstacle.pose.rotation * Vector3::z()).z > 1.0 - 1e-9;
    if let Shape::Mesh(mesh) = &obstacle.shape
        && is_upright
    {
        let height_m = PAVEMENT_M - obstacle.pose.translation.z;
        obstacle.shape = Shape::Mesh(mesh.clone().higher_than(height_m));
    }
}
