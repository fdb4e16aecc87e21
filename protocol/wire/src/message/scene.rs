//! A world, as a recording and the console show it, on `scene/<node>`.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use skein_bp::Bound;
use skein_dbp::NodeName;

use super::field::{Result, at_most, not_negative, out_of_range, required, vector};
use super::record::{Addressee, Kind, Record};
use crate::decode_error::DecodeError;
use crate::proto;

/// A world's space to fly in, and what stands there. For display: agents see by their own sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Least corner of the space to fly in, metres ENU.
    pub min: Vector3<f64>,
    pub max: Vector3<f64>,
    pub solids: Vec<Solid>,
}

/// A body that stands in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solid {
    /// Its form, centred on its origin.
    pub form: Form,
    /// Own frame to world ENU, metres.
    pub pose: Isometry3<f64>,
}

/// The form of a body, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// A cuboid of this whole size.
    Box(Vector3<f64>),
    /// A cylinder about z.
    Cylinder {
        /// Radius of the round section.
        radius: f64,
        /// Whole length along z.
        height: f64,
    },
    /// A ball.
    Sphere { radius: f64 },
}

impl Scene {
    /// So many bodies of a scene travel.
    pub const MAX_SOLIDS: usize = 4096;
}

impl Record for Scene {
    const KIND: Kind = Kind {
        word: "scene",
        addressee: Addressee::All,
        every_node_listens: false,
        bytes: Bound::SceneBytes,
    };

    /// The key alone names the host of the world.
    fn sender(&self) -> Option<&NodeName> {
        None
    }
}

impl From<&Scene> for proto::Scene {
    fn from(scene: &Scene) -> Self {
        Self {
            min: Some((&scene.min).into()),
            max: Some((&scene.max).into()),
            solids: scene.solids.iter().take(Scene::MAX_SOLIDS).map(Into::into).collect(),
        }
    }
}

impl TryFrom<proto::Scene> for Scene {
    type Error = DecodeError;

    fn try_from(scene: proto::Scene) -> Result<Self> {
        at_most("Scene.solids", scene.solids.len(), Self::MAX_SOLIDS, "at most 4096 bodies")?;
        Ok(Self {
            min: vector("Scene.min", &required("Scene.min", scene.min)?)?,
            max: vector("Scene.max", &required("Scene.max", scene.max)?)?,
            solids: scene.solids.into_iter().map(Solid::try_from).collect::<Result<_>>()?,
        })
    }
}

impl From<&Solid> for proto::Solid {
    fn from(solid: &Solid) -> Self {
        let (position, turn) = (&solid.pose.translation.vector, &solid.pose.rotation);
        Self {
            position: Some(position.into()),
            orientation: Some(proto::Quaternion { x: turn.i, y: turn.j, z: turn.k, w: turn.w }),
            form: Some(match solid.form {
                Form::Box(size) => proto::solid::Form::Box((&size).into()),
                Form::Cylinder { radius, height } => {
                    proto::solid::Form::Cylinder(proto::solid::Cylinder { radius, height })
                }
                Form::Sphere { radius } => proto::solid::Form::Sphere(radius),
            }),
        }
    }
}

impl TryFrom<proto::Solid> for Solid {
    type Error = DecodeError;

    fn try_from(solid: proto::Solid) -> Result<Self> {
        let form = match required("Solid.form", solid.form)? {
            proto::solid::Form::Box(size) => Form::Box(vector("Solid.box", &size)?),
            proto::solid::Form::Cylinder(cylinder) => Form::Cylinder {
                radius: not_negative("Solid.cylinder.radius", cylinder.radius)?,
                height: not_negative("Solid.cylinder.height", cylinder.height)?,
            },
            proto::solid::Form::Sphere(radius) => {
                Form::Sphere { radius: not_negative("Solid.sphere", radius)? }
            }
        };
        let position = vector("Solid.position", &required("Solid.position", solid.position)?)?;
        let turn = required("Solid.orientation", solid.orientation)?;
        let turn = Quaternion::new(turn.w, turn.x, turn.y, turn.z);
        let turn = UnitQuaternion::try_new(turn, 1e-6)
            .ok_or_else(|| out_of_range("Solid.orientation", "no rotation", "a unit quaternion"))?;
        Ok(Self { form, pose: Isometry3::from_parts(Translation3::from(position), turn) })
    }
}
