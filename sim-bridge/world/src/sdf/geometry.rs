//! The shapes of solids.

use nalgebra::{Isometry3, Unit, Vector3};

use super::error::SdfError;
use super::reader::Reader;
use super::text::Element;
use crate::files::Found;
use crate::mesh::terrain::Heights;
use crate::mesh::{self, Mesh, MeshError};
use crate::obstacle::Shape;

/// A shape, and where in its collision it is.
type Solid = (Shape, Isometry3<f64>);

impl Reader<'_> {
    /// The solids of a `<geometry>`; none where it is refused, which is said of its `owner`.
    pub(super) fn read_geometry(
        &mut self,
        geometry: Element<'_>,
        owner: &str,
    ) -> Result<Vec<Solid>, SdfError> {
        let Some(form) = geometry.elements().next() else {
            return Err(geometry.lacks("a shape such as <box>"));
        };
        let solids = match form.name() {
            "empty" => {
                self.account.pass(form);
                return Ok(Vec::new());
            }
            "box" => Ok(at_origin(Shape::Box {
                half_extents: Vector3::from(form.sizes::<3>("size", "three sizes above 0")?) / 2.0,
            })),
            "cylinder" => Ok(at_origin(Shape::Cylinder {
                radius: form.size("radius")?,
                half_height: form.size("length")? / 2.0,
            })),
            "capsule" => Ok(at_origin(Shape::Capsule {
                radius: form.size("radius")?,
                half_length: form.size("length")? / 2.0,
            })),
            "sphere" => Ok(at_origin(Shape::Sphere { radius: form.size("radius")? })),
            "plane" => Ok(at_origin(Shape::Plane { normal: read_normal(form)? })),
            "ellipsoid" => Ok(at_origin(Shape::Ellipsoid {
                radii: form.sizes::<3>("radii", "three sizes above 0")?.into(),
            })),
            "cone" => Ok(at_origin(Shape::Cone {
                radius: form.size("radius")?,
                half_height: form.size("length")? / 2.0,
            })),
            "polyline" => read_polylines(geometry)?,
            "mesh" => return self.read_mesh(form, owner),
            "heightmap" => return self.read_heightmap(form, owner),
            other => {
                self.account.refuse(form, format!("`{owner}` is a <{other}>, which cannot be read"));
                return Ok(Vec::new());
            }
        };
        Ok(self.admit(form, owner, "", solids))
    }

    /// The solids, if there are any, else a refusal.
    fn admit(
        &mut self,
        form: Element<'_>,
        owner: &str,
        uri: &str,
        solids: Result<Vec<Solid>, MeshError>,
    ) -> Vec<Solid> {
        match solids {
            Ok(solids) => {
                self.account.honour(form);
                solids
            }
            Err(why) => {
                let name = form.name();
                self.account.refuse(form, format!("the {name} {uri} of `{owner}` cannot be solid: {why}"));
                Vec::new()
            }
        }
    }

    fn read_mesh(&mut self, form: Element<'_>, owner: &str) -> Result<Vec<Solid>, SdfError> {
        let uri = form.required("uri", "a <uri>")?.text();
        let scale = form.child_numbers::<3>("scale", "three factors that are not 0")?.unwrap_or([1.0; 3]);
        if scale.contains(&0.0) {
            return Err(form.bad_value("three factors that are not 0"));
        }
        let submesh = form.child("submesh");
        let part = submesh.and_then(|submesh| submesh.child_text("name")).filter(|part| !part.is_empty());
        let is_centred = submesh.and_then(|submesh| submesh.flag("center")).unwrap_or(false);
        let Some((name, bytes)) = self.open(form, uri, owner) else { return Ok(Vec::new()) };
        let key = format!("{name} {part:?} {is_centred} {scale:?}");
        let known = self.meshes.get(&key).cloned();
        let mesh = known.map_or_else(
            || {
                let faces = mesh::read(&name, &bytes, part)?;
                let faces = if is_centred { faces.centred() } else { faces };
                Mesh::hollow(faces.scaled(&scale.into()))
            },
            Ok,
        );
        if let Ok(mesh) = &mesh {
            self.meshes.insert(key, mesh.clone());
        }
        Ok(self.admit(form, owner, &format!("`{uri}`"), mesh.map(solid)))
    }

    fn read_heightmap(&mut self, form: Element<'_>, owner: &str) -> Result<Vec<Solid>, SdfError> {
        let uri = form.required("uri", "a <uri>")?.text();
        let size = form.child_numbers::<3>("size", "three sizes above 0")?.unwrap_or([1.0; 3]);
        let [x, y, z] = form.child_numbers::<3>("pos", "three numbers")?.unwrap_or_default();
        if size.iter().any(|size| *size <= 0.0) {
            return Err(form.bad_value("three sizes above 0 in <size>"));
        }
        let Some((name, bytes)) = self.open(form, uri, owner) else { return Ok(Vec::new()) };
        let terrain = Heights::read(&name, &bytes).and_then(|heights| Mesh::terrain(&heights, &size.into()));
        let terrain = terrain.map(|mesh| vec![(Shape::Mesh(mesh), Isometry3::translation(x, y, z))]);
        Ok(self.admit(form, owner, &format!("`{uri}`"), terrain))
    }

    /// The content of a file that a shape is made of, and its name; else a refusal.
    fn open(&mut self, form: Element<'_>, uri: &str, owner: &str) -> Option<(String, std::sync::Arc<[u8]>)> {
        let why = match self.files.open(uri, form.file()) {
            Found::File { name, bytes } => return Some((name, bytes)),
            Found::Missing => "is not there".to_owned(),
            Found::Folder { .. } => "is a folder".to_owned(),
            Found::Unreadable(why) => format!("cannot be read: {why}"),
        };
        self.account.refuse(form, format!("the {} `{uri}` of `{owner}` {why}", form.name()));
        None
    }
}

fn at_origin(shape: Shape) -> Vec<Solid> {
    vec![(shape, Isometry3::identity())]
}

fn solid(mesh: Mesh) -> Vec<Solid> {
    at_origin(Shape::Mesh(mesh))
}

fn read_normal(plane: Element<'_>) -> Result<Unit<Vector3<f64>>, SdfError> {
    let Some(normal) = plane.child("normal") else { return Ok(Vector3::z_axis()) };
    let parts = Vector3::from(normal.numbers::<3>("three numbers")?);
    Unit::try_new(parts, 1e-9).ok_or_else(|| normal.bad_value("a direction that is not zero"))
}

/// Each outline is solid: what one cuts out of another is, too.
fn read_polylines(geometry: Element<'_>) -> Result<Result<Vec<Solid>, MeshError>, SdfError> {
    let mut solids = Vec::new();
    for polyline in geometry.children("polyline") {
        let height = polyline.size("height")?;
        let points = polyline.children("point").map(|point| point.numbers::<2>("two numbers"));
        match Mesh::extrusion(&points.collect::<Result<Vec<_>, _>>()?, height) {
            Ok(mesh) => solids.extend(solid(mesh)),
            Err(error) => return Ok(Err(error)),
        }
    }
    Ok(Ok(solids))
}
