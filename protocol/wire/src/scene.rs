//! What stands in a world, as a recording and the console show it.

use nalgebra::{Isometry3, Vector3};

/// A world's space to fly in, and what stands there. For display: agents see by their own sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Least corner of the space to fly in, metres ENU.
    pub min: Vector3<f64>,
    pub max: Vector3<f64>,
    /// What stands there.
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
    /// How many bodies of a scene travel.
    pub const MAX_SOLIDS: usize = 4096;
}
