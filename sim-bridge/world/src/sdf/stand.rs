//! The solids of a world where they stand: as its frames say, or where its `<state>` has them.

use nalgebra::{Isometry3, Vector3};

use super::error::SdfError;
use super::frames::Frames;
use super::state::State;
use super::tree::{Link, Model};
use crate::obstacle::{Obstacle, Shape};

/// Letters of one name: each body carries the names of all models around it.
const MOST_LETTERS: usize = 64;

/// All solids of the models of a world.
pub(super) fn obstacles(world: &Model, state: &State) -> Result<Vec<Obstacle>, SdfError> {
    let mut standing = Standing { frames: Frames::new(world), obstacles: Vec::new() };
    let mut number = Frames::first_link(0, world);
    for model in &world.models {
        let state = state.models.get(model.name.as_str());
        number = standing.stand(model, number, &Above::default(), state)?;
    }
    Ok(standing.obstacles)
}

struct Standing<'m> {
    frames: Frames<'m>,
    obstacles: Vec<Obstacle>,
}

/// The holder of a model.
struct Above {
    name: String,
    /// From where its frames have it to where its state has it.
    moved: Isometry3<f64>,
    scale: Vector3<f64>,
}

impl Default for Above {
    fn default() -> Self {
        Self { name: String::new(), moved: Isometry3::identity(), scale: Vector3::repeat(1.0) }
    }
}

impl Standing<'_> {
    /// Puts up a model that has number `number`; returns the number of what follows it.
    fn stand(
        &mut self,
        model: &Model,
        number: usize,
        above: &Above,
        state: Option<&State>,
    ) -> Result<usize, SdfError> {
        let written = self.frames.pose(number)?;
        let here = Above {
            name: if model.is_merged { above.name.clone() } else { scoped(&above.name, &model.name) },
            moved: moved(state, &written, &above.moved),
            scale: state.map_or(above.scale, |state| state.scale),
        };
        let mut next = Frames::first_link(number, model);
        for link in &model.links {
            let state = state.and_then(|state| state.links.get(link.name.as_str()));
            self.stand_link(link, (number, next), &here, state)?;
            next += 1;
        }
        for child in &model.models {
            let state = state.and_then(|state| state.models.get(child.name.as_str()));
            next = self.stand(child, next, &here, state)?;
        }
        Ok(next)
    }

    fn stand_link(
        &mut self,
        link: &Link,
        (model, number): (usize, usize),
        above: &Above,
        state: Option<&State>,
    ) -> Result<(), SdfError> {
        let written = self.frames.pose(number)?;
        let moved = moved(state, &written, &above.moved);
        let name = scoped(&above.name, &link.name);
        for body in &link.bodies {
            let pose = moved * self.frames.pose_in_link(model, number, &body.pose)?;
            let shape = scaled(&body.shape, &above.scale);
            self.obstacles.push(Obstacle::new(scoped(&name, &body.name), shape, pose));
        }
        Ok(())
    }
}

/// From where the frames have something to where its own state has it, or else that of what holds it.
fn moved(state: Option<&State>, written: &Isometry3<f64>, above: &Isometry3<f64>) -> Isometry3<f64> {
    state.and_then(|state| state.pose).map_or(*above, |pose| pose * written.inverse())
}

/// A shape as Gazebo scales it; round ones stay round.
fn scaled(shape: &Shape, scale: &Vector3<f64>) -> Shape {
    let wide = scale.x.max(scale.y);
    match shape {
        Shape::Box { half_extents } => Shape::Box { half_extents: half_extents.component_mul(scale) },
        Shape::Sphere { radius } => Shape::Sphere { radius: radius * scale.max() },
        Shape::Cylinder { radius, half_height } => {
            Shape::Cylinder { radius: radius * wide, half_height: half_height * scale.z }
        }
        Shape::Capsule { radius, half_length } => {
            Shape::Capsule { radius: radius * wide, half_length: half_length * scale.z }
        }
        Shape::Cone { radius, half_height } => {
            Shape::Cone { radius: radius * wide, half_height: half_height * scale.z }
        }
        Shape::Ellipsoid { radii } => Shape::Ellipsoid { radii: radii.component_mul(scale) },
        Shape::Mesh(mesh) => Shape::Mesh(mesh.scaled(scale)),
        Shape::Plane { .. } => shape.clone(),
    }
}

/// `name` with the names of what holds it, as Gazebo writes them.
pub(super) fn scoped(above: &str, name: &str) -> String {
    let end = name.char_indices().nth(MOST_LETTERS).map_or(name.len(), |(end, _)| end);
    let name = name.get(..end).unwrap_or(name);
    if above.is_empty() { name.to_owned() } else { format!("{above}::{name}") }
}
