//! Skein's world in Foxglove's terms.

use foxglove::messages::{
    Color, CubePrimitive, CylinderPrimitive, LinePrimitive, Point3, Pose, Quaternion, SceneEntity,
    SpherePrimitive, TextPrimitive, Timestamp, Vector3 as Vector, line_primitive,
};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use skein_wire::{Form, Solid};

use super::WORLD;

const OBSTACLE: Color = Color { r: 0.45, g: 0.36, b: 0.27, a: 1.0 };
const TEXT: Color = Color { r: 1.0, g: 1.0, b: 1.0, a: 1.0 };
const PATH_THICKNESS_M: f64 = 0.05;
const TEXT_HEIGHT_M: f64 = 0.4;

/// The entity of all obstacles.
pub const OBSTACLES: &str = "obstacles";

pub fn obstacles(timestamp: Timestamp, solids: &[Solid]) -> SceneEntity {
    let mut entity = entity(timestamp, WORLD, OBSTACLES);
    for solid in solids {
        let (pose, color) = (Some(pose(&solid.pose)), Some(OBSTACLE));
        match solid.form {
            Form::Box(size) => entity.cubes.push(CubePrimitive { pose, size: Some(vector(&size)), color }),
            Form::Cylinder { radius, height } => {
                let size = Some(Vector { x: 2.0 * radius, y: 2.0 * radius, z: height });
                entity.cylinders.push(CylinderPrimitive {
                    pose,
                    size,
                    bottom_scale: 1.0,
                    top_scale: 1.0,
                    color,
                });
            }
            Form::Sphere { radius } => entity.spheres.push(ball(&solid.pose, radius, OBSTACLE)),
        }
    }
    entity
}

/// The obstacles of an entity that [`obstacles`] has made; what has no place or size is left out.
pub fn solids(entity: &SceneEntity) -> Vec<Solid> {
    let solid = |at: &Option<Pose>, form| Some(Solid { form, pose: plain_pose(at.as_ref()?)? });
    let cubes =
        entity.cubes.iter().filter_map(|cube| solid(&cube.pose, Form::Box(plain(cube.size.as_ref()?))));
    let cylinders = entity.cylinders.iter().filter_map(|cylinder| {
        let size = cylinder.size.as_ref()?;
        solid(&cylinder.pose, Form::Cylinder { radius: size.x / 2.0, height: size.z })
    });
    let spheres = entity
        .spheres
        .iter()
        .filter_map(|sphere| solid(&sphere.pose, Form::Sphere { radius: sphere.size.as_ref()?.x / 2.0 }));
    cubes.chain(cylinders).chain(spheres).collect()
}

pub fn plain(v: &Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

fn plain_pose(pose: &Pose) -> Option<Isometry3<f64>> {
    let (place, turn) = (plain(pose.position.as_ref()?), pose.orientation.as_ref()?);
    let turn = UnitQuaternion::try_new(nalgebra::Quaternion::new(turn.w, turn.x, turn.y, turn.z), 1e-6)?;
    place.iter().all(|metres| metres.is_finite()).then(|| Isometry3::from_parts(place.into(), turn))
}

/// A vehicle's hull, fixed to its frame, with its name over it.
pub fn hull(timestamp: Timestamp, vehicle: &str, radius_m: f64, index: usize) -> SceneEntity {
    let mut entity = entity(timestamp, vehicle, &format!("hull of {vehicle}"));
    entity.frame_locked = true;
    entity.spheres.push(ball(&Isometry3::identity(), radius_m, hue(index)));
    entity.texts.push(TextPrimitive {
        pose: Some(pose(&Isometry3::translation(0.0, 0.0, radius_m + TEXT_HEIGHT_M))),
        billboard: true,
        font_size: TEXT_HEIGHT_M,
        scale_invariant: false,
        color: Some(TEXT),
        text: vehicle.to_owned(),
    });
    entity
}

/// A planned path as a line in the world.
pub fn path(timestamp: Timestamp, vehicle: &str, points: &[Vector3<f64>]) -> SceneEntity {
    let number = vehicle.rsplit('/').next().and_then(|n| n.parse::<usize>().ok()).unwrap_or(1);
    let mut entity = entity(timestamp, WORLD, &format!("path of {vehicle}"));
    entity.lines.push(LinePrimitive {
        r#type: line_primitive::Type::LineStrip.into(),
        pose: Some(pose(&Isometry3::identity())),
        thickness: PATH_THICKNESS_M,
        scale_invariant: false,
        points: points.iter().map(|p| Point3 { x: p.x, y: p.y, z: p.z }).collect(),
        color: Some(hue(number.saturating_sub(1))),
        colors: Vec::new(),
        indices: Vec::new(),
    });
    entity
}

/// A position and orientation.
pub fn pose(pose: &Isometry3<f64>) -> Pose {
    Pose { position: Some(vector(&pose.translation.vector)), orientation: Some(quaternion(&pose.rotation)) }
}

pub fn vector(v: &Vector3<f64>) -> Vector {
    Vector { x: v.x, y: v.y, z: v.z }
}

pub fn quaternion(rotation: &UnitQuaternion<f64>) -> Quaternion {
    Quaternion { x: rotation.i, y: rotation.j, z: rotation.k, w: rotation.w }
}

fn entity(timestamp: Timestamp, frame: &str, id: &str) -> SceneEntity {
    SceneEntity {
        timestamp: Some(timestamp),
        frame_id: frame.to_owned(),
        id: id.to_owned(),
        ..SceneEntity::default()
    }
}

fn ball(at: &Isometry3<f64>, radius: f64, color: Color) -> SpherePrimitive {
    let diameter = 2.0 * radius;
    let size = Some(Vector { x: diameter, y: diameter, z: diameter });
    SpherePrimitive { pose: Some(pose(at)), size, color: Some(color) }
}

/// A colour for each vehicle: steps of the golden angle keep neighbours in number far apart in hue.
fn hue(index: usize) -> Color {
    const GOLDEN_TURN: f64 = 0.618_033_988_749_895;
    let turn = (index as f64 * GOLDEN_TURN).fract() * 6.0;
    let channel = |offset: f64| {
        let t = (turn + offset) % 6.0;
        (2.0 - (t - 3.0).abs()).clamp(0.0, 1.0)
    };
    Color { r: channel(3.0), g: channel(1.0), b: channel(5.0), a: 1.0 }
}
