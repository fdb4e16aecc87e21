//! Solids of many faces: meshes and terrain, each under a hierarchy of bounding boxes.

mod blocks;
mod cubes;
mod dae;
pub mod extrusion;
mod obj;
mod stl;
pub mod terrain;

use std::fmt;
use std::sync::{Arc, OnceLock};

use glamx::{DPose3, DVec3};
use nalgebra::{Point3, Vector3};
use parry3d_f64::query::Ray;
use parry3d_f64::shape::{SharedShape, TriMesh, TriMeshFlags};

use crate::aabb::Aabb;

/// Files of meshes and pictures longer than this are refused, bytes.
pub const MOST_BYTES: u64 = 256 << 20;
/// Meshes of more triangles than this are refused.
pub const MOST_TRIANGLES: usize = 4_000_000;
/// Numbers beyond this are taken for mistakes, m.
const LIMIT_M: f64 = 1e6;

/// A form of many faces, in its own frame, metres.
#[derive(Clone)]
pub struct Mesh {
    shape: SharedShape,
    /// Parry's frame of the shape in the own frame.
    pose: DPose3,
    inside: Inside,
    bounds: Aabb,
    /// Found when they are asked for.
    blocks: Arc<OnceLock<Vec<Aabb>>>,
}

/// The part of space that a mesh fills beside its faces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Inside {
    /// Nothing: a vehicle may fly in the rooms of a house.
    Hollow,
    /// The inside of its faces, which point outwards.
    Filled,
    /// All that is below its faces.
    Below,
    /// Its cubes.
    Cubes,
}

/// Corners and faces as a file gives them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Faces {
    /// In the file's frame, metres unless the user scales them.
    pub corners: Vec<[f64; 3]>,
    /// Three numbers of corners each.
    pub triangles: Vec<[u32; 3]>,
}

/// Why a mesh cannot be solid.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum MeshError {
    #[error("expected a name that ends in .stl, .obj or .dae")]
    Kind,
    #[error("{0}")]
    Malformed(String),
    #[error("there is no part `{0}` in it")]
    NoPart(String),
    #[error("there is no face in it")]
    Empty,
    #[error("there is no point above the ground in it")]
    NoPoint,
    #[error("its points are scattered over too wide a space")]
    Wide,
    #[error("it has more than {MOST_TRIANGLES} triangles")]
    TooMany,
    #[error("a corner of face {face} lies beyond 1000 km or is not there")]
    Corner { face: usize },
    #[error("expected a square number of heights, each of 1 or 2 bytes, found {0} bytes")]
    Raw(usize),
    #[error("expected 2 to {most} heights along each side, found {rows} x {columns}", most = terrain::MOST_ALONG)]
    Heights { rows: usize, columns: usize },
    #[error("expected 3 to {most} corners that do not lie in one line", most = extrusion::MOST_CORNERS)]
    Outline,
}

/// The faces of a file that `name` ends in the kind of: of all of its parts, or of the one that is called
/// `part`.
pub fn read(name: &str, bytes: &[u8], part: Option<&str>) -> Result<Faces, MeshError> {
    let kind = name.rsplit('.').next().unwrap_or_default().to_lowercase();
    match kind.as_str() {
        "stl" => part.map_or_else(|| stl::read(bytes), |part| Err(MeshError::NoPart(part.to_owned()))),
        "obj" => obj::read(bytes, part),
        "dae" => dae::read(bytes, part),
        _ => Err(MeshError::Kind),
    }
}

impl Faces {
    /// The same, each axis times a factor.
    #[must_use]
    pub fn scaled(mut self, scale: &Vector3<f64>) -> Self {
        for corner in &mut self.corners {
            *corner = [corner[0] * scale.x, corner[1] * scale.y, corner[2] * scale.z];
        }
        self
    }

    /// The same about the middle of the box around it.
    #[must_use]
    pub fn centred(mut self) -> Self {
        let bounds = bounds_of(self.corners.iter().map(|corner| Vector3::from(*corner)));
        let Some(middle) = bounds.map(|bounds| (bounds.min + bounds.max) / 2.0) else { return self };
        for corner in &mut self.corners {
            *corner = [corner[0] - middle.x, corner[1] - middle.y, corner[2] - middle.z];
        }
        self
    }

    fn push(&mut self, corners: [[f64; 3]; 3]) {
        let first = u32::try_from(self.corners.len()).unwrap_or(u32::MAX - 2);
        self.corners.extend(corners);
        self.triangles.push([first, first + 1, first + 2]);
    }

    /// Without those that have no area.
    fn whole(self) -> Result<(Vec<DVec3>, Vec<[u32; 3]>), MeshError> {
        if self.triangles.len() > MOST_TRIANGLES {
            return Err(MeshError::TooMany);
        }
        let corners: Vec<DVec3> = self.corners.iter().map(|corner| DVec3::from(*corner)).collect();
        let is_sound = |corner: &DVec3| corner.is_finite() && corner.abs().max_element() <= LIMIT_M;
        let mut triangles = self.triangles;
        let corner = |number: u32| corners.get(number as usize).filter(|corner| is_sound(corner)).copied();
        let three = |face: [u32; 3]| Some([corner(face[0])?, corner(face[1])?, corner(face[2])?]);
        if let Some(face) = triangles.iter().position(|face| three(*face).is_none()) {
            return Err(MeshError::Corner { face: face + 1 });
        }
        triangles.retain(|face| {
            three(*face).is_some_and(|[a, b, c]| (b - a).cross(c - a).length_squared() > f64::MIN_POSITIVE)
        });
        if triangles.is_empty() { Err(MeshError::Empty) } else { Ok((corners, triangles)) }
    }
}

impl Mesh {
    /// Faces alone: what they enclose is free.
    pub fn hollow(faces: Faces) -> Result<Self, MeshError> {
        let (corners, triangles) = faces.whole()?;
        Self::of_triangles(corners, triangles, TriMeshFlags::empty(), Inside::Hollow)
    }

    /// Faces that point outwards, and all that they enclose.
    pub fn filled(faces: Faces) -> Result<Self, MeshError> {
        let (corners, triangles) = faces.whole()?;
        let flags = TriMeshFlags::ORIENTED | TriMeshFlags::MERGE_DUPLICATE_VERTICES;
        Self::of_triangles(corners, triangles, flags, Inside::Filled)
    }

    fn of_triangles(
        corners: Vec<DVec3>,
        triangles: Vec<[u32; 3]>,
        flags: TriMeshFlags,
        inside: Inside,
    ) -> Result<Self, MeshError> {
        let mesh = TriMesh::with_flags(corners, triangles, flags)
            .map_err(|error| MeshError::Malformed(error.to_string()))?;
        Ok(Self::new(SharedShape::new(mesh), DPose3::IDENTITY, inside))
    }

    fn new(shape: SharedShape, pose: DPose3, inside: Inside) -> Self {
        let around = shape.compute_aabb(&pose);
        let corner = |at: DVec3| Vector3::new(at.x, at.y, at.z);
        let bounds = Aabb { min: corner(around.mins), max: corner(around.maxs) };
        Self { shape, pose, inside, bounds, blocks: Arc::default() }
    }

    /// The box along the own axes that holds all faces.
    pub fn bounds(&self) -> &Aabb {
        &self.bounds
    }

    /// Radius of the smallest ball about the origin that holds that box, metres.
    pub fn bounding_radius(&self) -> f64 {
        self.bounds.min.abs().sup(&self.bounds.max.abs()).norm()
    }

    /// The same, each own axis times a factor; it is as it was where parry cannot.
    #[must_use]
    pub fn scaled(&self, scale: &Vector3<f64>) -> Self {
        if *scale == Vector3::repeat(1.0) {
            return self.clone();
        }
        let along = self.pose.rotation.inverse() * DVec3::new(scale.x, scale.y, scale.z);
        match self.shape.scale_dyn(along.abs(), 16) {
            Some(shape) => Self::new(SharedShape(shape.into()), self.pose, self.inside),
            None => self.clone(),
        }
    }

    /// Distance from `point` to the faces, negative inside.
    pub fn signed_distance(&self, point: &Point3<f64>) -> f64 {
        let at = DVec3::new(point.x, point.y, point.z);
        let nearest = self.shape.project_point(&self.pose, at, false);
        let distance = (nearest.point - at).length();
        let is_inside = match self.inside {
            Inside::Hollow => false,
            Inside::Filled | Inside::Cubes => nearest.is_inside,
            Inside::Below => self.is_below(at),
        };
        if is_inside { -distance } else { distance }
    }

    /// Distance along the unit vector `direction` from `origin` to the first face: 0 when the ray starts
    /// inside.
    pub fn cast_ray(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let at = DVec3::new(origin.x, origin.y, origin.z);
        if self.inside != Inside::Hollow && self.holds(at) {
            return Some(0.0);
        }
        let ray = Ray::new(at, DVec3::new(direction.x, direction.y, direction.z));
        self.shape.cast_ray(&self.pose, &ray, f64::MAX, false)
    }

    fn holds(&self, at: DVec3) -> bool {
        let point = Vector3::new(at.x, at.y, at.z);
        match self.inside {
            Inside::Hollow => false,
            Inside::Filled | Inside::Cubes => {
                self.bounds.contains(&point) && self.shape.project_point(&self.pose, at, false).is_inside
            }
            Inside::Below => point.z <= self.bounds.max.z && self.is_below(at),
        }
    }

    /// Whether there is a face straight above.
    fn is_below(&self, at: DVec3) -> bool {
        self.shape.intersects_ray(&self.pose, &Ray::new(at, DVec3::Z), f64::MAX)
    }
}

impl PartialEq for Mesh {
    /// The same, not alike.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.shape.0, &other.shape.0) && self.pose == other.pose
    }
}

impl fmt::Debug for Mesh {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Mesh").field("inside", &self.inside).field("bounds", &self.bounds).finish()
    }
}

/// The box around places; `None` around none.
pub(crate) fn bounds_of(places: impl Iterator<Item = Vector3<f64>>) -> Option<Aabb> {
    places.map(|place| Aabb { min: place, max: place }).reduce(|all, one| all.union(&one))
}
