//! COLLADA: the geometries of a scene, where its nodes put them, in its unit. Its `<up_axis>` counts for
//! nothing, as in Gazebo, whose models are made so.

use std::collections::BTreeMap;

use nalgebra::{Matrix4, Point3, Rotation3, Unit, Vector3};
use roxmltree::{Document, Node};

use super::{Faces, MOST_TRIANGLES, MeshError};

/// Nodes may nest this deep.
const DEPTH_LIMIT: usize = 64;
/// Nodes of a scene, those that stand for others counted again each time.
const MOST_NODES: usize = 100_000;
/// Triangles that any file may place; a larger one may place as many more as it has bytes.
const LEAST_TRIANGLES: usize = 10_000;

pub(super) fn read(bytes: &[u8], part: Option<&str>) -> Result<Faces, MeshError> {
    let malformed = |error: &dyn std::fmt::Display| MeshError::Malformed(error.to_string());
    let text = std::str::from_utf8(bytes).map_err(|error| malformed(&error))?;
    let document = Document::parse(text.trim_start_matches('\u{feff}')).map_err(|error| malformed(&error))?;
    let mut reader = Reader {
        ids: document.descendants().filter_map(|node| Some((node.attribute("id")?, node))).collect(),
        geometries: BTreeMap::new(),
        part,
        found: part.is_none(),
        nodes: 0,
        most: MOST_TRIANGLES.min(LEAST_TRIANGLES + bytes.len()),
        faces: Faces::default(),
    };
    reader.read_scene(document.root_element())?;
    match part {
        Some(part) if !reader.found => Err(MeshError::NoPart(part.to_owned())),
        _ => Ok(reader.faces),
    }
}

struct Reader<'a> {
    ids: BTreeMap<&'a str, Node<'a, 'a>>,
    /// By the byte at which they begin.
    geometries: BTreeMap<usize, Faces>,
    part: Option<&'a str>,
    found: bool,
    nodes: usize,
    /// Triangles, those of a geometry counted again each time that it is placed.
    most: usize,
    faces: Faces,
}

impl<'a> Reader<'a> {
    fn read_scene(&mut self, root: Node<'a, 'a>) -> Result<(), MeshError> {
        let unit = child(root, "asset").and_then(|asset| child(asset, "unit"));
        let metre = unit.and_then(|unit| unit.attribute("meter")?.trim().parse().ok()).unwrap_or(1.0);
        let scale = Matrix4::new_scaling(metre);
        let instance = child(root, "scene").and_then(|scene| child(scene, "instance_visual_scene"));
        if let Some(scene) = instance.and_then(|instance| self.target(instance, "url")) {
            return self.read_node(scene, &scale, self.is_wanted(scene), 0);
        }
        for library in children(root, "library_geometries") {
            for geometry in children(library, "geometry") {
                self.place(geometry, &scale, self.is_wanted(geometry))?;
            }
        }
        Ok(())
    }

    /// The element that an attribute points to.
    fn target(&self, node: Node<'a, 'a>, attribute: &str) -> Option<Node<'a, 'a>> {
        self.ids.get(node.attribute(attribute)?.strip_prefix('#')?).copied()
    }

    /// Whether it is the part that is asked for.
    fn is_wanted(&self, node: Node<'a, 'a>) -> bool {
        self.part.is_none_or(|part| [node.attribute("id"), node.attribute("name")].contains(&Some(part)))
    }

    /// A node, or a scene, and all below it; `is_wanted` if something above it is.
    fn read_node(
        &mut self,
        node: Node<'a, 'a>,
        above: &Matrix4<f64>,
        is_wanted: bool,
        depth: usize,
    ) -> Result<(), MeshError> {
        self.nodes += 1;
        if depth > DEPTH_LIMIT || self.nodes > MOST_NODES {
            return Err(MeshError::Malformed("its nodes nest without end, or are too many".to_owned()));
        }
        // What only lights or looks at the scene may stand anywhere.
        let places = ["instance_geometry", "instance_controller", "instance_node"];
        if !node.descendants().any(|inner| places.contains(&inner.tag_name().name())) {
            return Ok(());
        }
        let mut pose = *above;
        for child in node.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "node" => self.read_node(child, &pose, is_wanted || self.is_wanted(child), depth + 1)?,
                "instance_node" => {
                    if let Some(target) = self.target(child, "url") {
                        self.read_node(target, &pose, is_wanted || self.is_wanted(target), depth + 1)?;
                    }
                }
                "instance_geometry" => {
                    if let Some(geometry) = self.target(child, "url") {
                        self.place(geometry, &pose, is_wanted || self.is_wanted(geometry))?;
                    }
                }
                "instance_controller" => self.read_skin(child, &pose, is_wanted)?,
                _ => pose *= step(child)?,
            }
        }
        Ok(())
    }

    /// A skin over bones, in the pose in which it was bound to them.
    fn read_skin(
        &mut self,
        instance: Node<'a, 'a>,
        pose: &Matrix4<f64>,
        is_wanted: bool,
    ) -> Result<(), MeshError> {
        let skin = self.target(instance, "url").and_then(|controller| child(controller, "skin"));
        let Some((skin, geometry)) = skin.and_then(|skin| Some((skin, self.target(skin, "source")?))) else {
            return Ok(());
        };
        let bound =
            child(skin, "bind_shape_matrix").map(matrix).transpose()?.unwrap_or_else(Matrix4::identity);
        self.place(geometry, &(pose * bound), is_wanted || self.is_wanted(geometry))
    }

    fn place(
        &mut self,
        geometry: Node<'a, 'a>,
        pose: &Matrix4<f64>,
        is_wanted: bool,
    ) -> Result<(), MeshError> {
        let Some(mesh) = child(geometry, "mesh").filter(|_| is_wanted) else { return Ok(()) };
        self.found = true;
        let key = geometry.range().start;
        if !self.geometries.contains_key(&key) {
            let faces = self.read_mesh(mesh)?;
            self.geometries.insert(key, faces);
        }
        let Some(own) = self.geometries.get(&key) else { return Ok(()) };
        if self.faces.triangles.len() + own.triangles.len() > self.most {
            return Err(MeshError::TooMany);
        }
        let first = u32::try_from(self.faces.corners.len()).map_err(|_| MeshError::TooMany)?;
        let moved =
            |corner: &[f64; 3]| -> [f64; 3] { pose.transform_point(&Point3::from(*corner)).coords.into() };
        self.faces.corners.extend(own.corners.iter().map(moved));
        self.faces.triangles.extend(own.triangles.iter().map(|face| face.map(|corner| first + corner)));
        Ok(())
    }

    fn read_mesh(&self, mesh: Node<'a, 'a>) -> Result<Faces, MeshError> {
        let mut faces = Faces { corners: self.read_positions(mesh)?, triangles: Vec::new() };
        for primitive in mesh.children().filter(Node::is_element) {
            match primitive.tag_name().name() {
                "triangles" => read_faces(primitive, &mut faces, |_| Some(3))?,
                "polylist" => {
                    let counts =
                        child(primitive, "vcount").map(whole_numbers).transpose()?.unwrap_or_default();
                    read_faces(primitive, &mut faces, |number| {
                        counts.get(number).map(|count| *count as usize)
                    })?;
                }
                "polygons" | "trifans" => read_faces(primitive, &mut faces, |_| Some(usize::MAX))?,
                "tristrips" => read_strips(primitive, &mut faces)?,
                _ => {}
            }
        }
        Ok(faces)
    }

    /// The corners that the `<vertices>` of a mesh name.
    fn read_positions(&self, mesh: Node<'a, 'a>) -> Result<Vec<[f64; 3]>, MeshError> {
        let vertices = child(mesh, "vertices").into_iter().flat_map(|vertices| children(vertices, "input"));
        let input = vertices.into_iter().find(|input| input.attribute("semantic") == Some("POSITION"));
        let Some(source) = input.and_then(|input| self.target(input, "source")) else {
            return Ok(Vec::new());
        };
        let Some(array) = child(source, "float_array") else { return Ok(Vec::new()) };
        let numbers = numbers(array)?;
        let accessor = child(source, "technique_common").and_then(|common| child(common, "accessor"));
        let number =
            |name| accessor.and_then(|accessor| accessor.attribute(name)?.trim().parse::<usize>().ok());
        let (stride, offset) = (number("stride").unwrap_or(3).max(3), number("offset").unwrap_or(0));
        let rows = numbers.get(offset..).unwrap_or_default().chunks(stride);
        Ok(rows.filter_map(|row| Some([*row.first()?, *row.get(1)?, *row.get(2)?])).collect())
    }
}

/// The corners' numbers in a `<p>`.
fn corners(primitive: Node<'_, '_>, numbers: Node<'_, '_>) -> Result<Vec<u32>, MeshError> {
    let offset = |input: Node<'_, '_>| input.attribute("offset")?.trim().parse::<usize>().ok();
    let inputs = || primitive.children().filter(|node| node.tag_name().name() == "input");
    let stride = inputs().filter_map(offset).max().map_or(1, |last| last + 1);
    let vertex = inputs().find(|input| input.attribute("semantic") == Some("VERTEX"));
    let first = vertex.and_then(offset).unwrap_or(0);
    Ok(whole_numbers(numbers)?.into_iter().skip(first).step_by(stride).collect())
}

/// Faces of as many corners as `count` says of each, or of all in a `<p>`; those of more than three as fans.
fn read_faces(
    primitive: Node<'_, '_>,
    faces: &mut Faces,
    count: impl Fn(usize) -> Option<usize>,
) -> Result<(), MeshError> {
    let mut number = 0;
    for list in children(primitive, "p") {
        let corners = corners(primitive, list)?;
        let mut rest = corners.as_slice();
        while let Some(count) = count(number).filter(|_| !rest.is_empty()) {
            let (face, after) = rest.split_at(count.min(rest.len()));
            if let Some((first, others)) = face.split_first() {
                faces.triangles.extend(others.windows(2).map(|pair| [*first, pair[0], pair[1]]));
            }
            (rest, number) = (after, number + 1);
        }
    }
    Ok(())
}

fn read_strips(primitive: Node<'_, '_>, faces: &mut Faces) -> Result<(), MeshError> {
    for list in children(primitive, "p") {
        let corners = corners(primitive, list)?;
        faces.triangles.extend(corners.windows(3).map(|face| [face[0], face[1], face[2]]));
    }
    Ok(())
}

/// A node's turn, shift or stretch; nothing of other elements.
fn step(node: Node<'_, '_>) -> Result<Matrix4<f64>, MeshError> {
    match node.tag_name().name() {
        "matrix" => matrix(node),
        "translate" => of_numbers(node, |[x, y, z]| Matrix4::new_translation(&Vector3::new(x, y, z))),
        "scale" => of_numbers(node, |[x, y, z]| Matrix4::new_nonuniform_scaling(&Vector3::new(x, y, z))),
        "rotate" => of_numbers(node, |[x, y, z, degrees]: [f64; 4]| {
            let axis = Unit::try_new(Vector3::new(x, y, z), 1e-12);
            axis.map_or_else(Matrix4::identity, |axis| {
                Rotation3::from_axis_angle(&axis, degrees.to_radians()).to_homogeneous()
            })
        }),
        "lookat" | "skew" => Err(MeshError::Malformed(format!("it has a <{}>", node.tag_name().name()))),
        _ => Ok(Matrix4::identity()),
    }
}

fn matrix(node: Node<'_, '_>) -> Result<Matrix4<f64>, MeshError> {
    of_numbers(node, |numbers: [f64; 16]| Matrix4::from_row_slice(&numbers))
}

fn of_numbers<const N: usize>(
    node: Node<'_, '_>,
    make: impl Fn([f64; N]) -> Matrix4<f64>,
) -> Result<Matrix4<f64>, MeshError> {
    let found = numbers(node)?;
    found.try_into().map(make).map_err(|found: Vec<f64>| {
        let name = node.tag_name().name();
        MeshError::Malformed(format!("<{name}> holds {} numbers, expected {N}", found.len()))
    })
}

fn numbers(node: Node<'_, '_>) -> Result<Vec<f64>, MeshError> {
    words(node, |word| word.parse().ok().filter(|number: &f64| number.is_finite()))
}

fn whole_numbers(node: Node<'_, '_>) -> Result<Vec<u32>, MeshError> {
    words(node, |word| word.parse().ok())
}

fn words<T>(node: Node<'_, '_>, parse: impl Fn(&str) -> Option<T>) -> Result<Vec<T>, MeshError> {
    let word = |word: &str| {
        let name = node.tag_name().name();
        let shown: String = word.chars().take(20).collect();
        parse(word).ok_or_else(|| MeshError::Malformed(format!("<{name}> holds `{shown}`, expected numbers")))
    };
    node.text().unwrap_or_default().split_ascii_whitespace().map(word).collect()
}

fn children<'a>(parent: Node<'a, 'a>, name: &'static str) -> impl Iterator<Item = Node<'a, 'a>> + use<'a> {
    parent.children().filter(move |child| child.tag_name().name() == name)
}

fn child<'a>(parent: Node<'a, 'a>, name: &'static str) -> Option<Node<'a, 'a>> {
    children(parent, name).next()
}
