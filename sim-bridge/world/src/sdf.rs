//! Gazebo worlds: the Simulation Description Format (SDF), as far as solid things go.
//!
//! Read are models, nested models, links and their collision geometry (box, cylinder, sphere,
//! plane) with composed poses, and the spherical coordinates. What cannot be read but does not
//! make the file wrong is named in warnings; what makes it wrong is an error with its place.

use std::collections::BTreeMap;
use std::fmt;

use nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use roxmltree::{Document, Node, TextPos};
use skein_mav::Datum;
use thiserror::Error;

use crate::obstacle::{Obstacle, Shape};
use crate::scene::Scene;

/// Models may nest this deep.
const DEPTH_LIMIT: usize = 32;
/// Letters of one name: each body carries the names of all models around it.
const MOST_LETTERS: usize = 64;
/// Warnings that are listed: to know the line of each takes a walk through the file.
const MOST_WARNINGS: usize = 100;
/// Numbers beyond this are taken for mistakes, m.
const LIMIT_M: f64 = 1e6;
/// Models that every Gazebo has and that bring no obstacle.
const BUILT_IN_MODELS: [&str; 2] = ["model://sun", "model://ground_plane"];
/// Children of a world that do not matter to flying.
const WORLD_SCENERY: [&str; 12] = [
    "atmosphere",
    "audio",
    "gravity",
    "gui",
    "joint",
    "light",
    "magnetic_field",
    "physics",
    "plugin",
    "scene",
    "spherical_coordinates",
    "wind",
];

/// A place in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    pub source_name: String,
    /// Line from 1.
    pub line: u32,
    /// Column from 1, in characters.
    pub column: u32,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.source_name, self.line, self.column)
    }
}

/// Something in a world file that was understood only in part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning {
    /// Place of its first occurrence.
    pub place: Place,
    /// The oddity, and what was done about it.
    pub message: String,
    pub count: usize,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.message)?;
        if self.count > 1 {
            write!(f, " ({} times)", self.count)?;
        }
        Ok(())
    }
}

/// Why a world file was refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SdfError {
    #[error("{place}: {message}; {advice}")]
    Malformed { place: Place, message: String, advice: &'static str },
    #[error("{place}: <{element}> holds `{found}`; expected {expected}")]
    Value { place: Place, element: String, found: String, expected: &'static str },
    #[error("{place}: <{element}> needs {expected} inside; add it")]
    Missing { place: Place, element: String, expected: &'static str },
    #[error("{place}: models nest deeper than {DEPTH_LIMIT} levels; flatten the file")]
    TooDeep { place: Place },
}

impl Scene {
    /// Reads a Gazebo world (or a bare model) from the text of an SDF file; `source_name` is what
    /// messages call it. Nothing is fetched: models that the file includes by name are left out
    /// with a warning. Everything stands still, whether static or not.
    pub fn from_sdf(text: &str, source_name: &str) -> Result<(Self, Vec<Warning>), SdfError> {
        let document = Document::parse(text).map_err(|error| malformed(text, source_name, &error))?;
        let mut reader = Reader::new(&document, source_name);
        let name = reader.read_root(document.root_element())?;
        let warnings = reader.take_warnings();
        let scene = Self::new(name, reader.obstacles);
        let scene = match reader.datum {
            Some(datum) => scene.with_datum(datum),
            None => scene,
        };
        Ok((scene, warnings))
    }
}

/// The place where XML stops being XML. An unclosed comment swallows the rest of the file, so the parser
/// complains about the end; the place to mend is where the comment opens.
fn malformed(text: &str, source_name: &str, error: &roxmltree::Error) -> SdfError {
    let (offset, message, advice) = if let Some(offset) = unclosed_comment(text) {
        (Some(offset), "a comment opens here and never closes".to_owned(), "close it with `-->` or delete it")
    } else {
        use roxmltree::Error::{NoRootNode, UnclosedRootNode, UnexpectedEndOfStream};
        let at_end = matches!(error, NoRootNode | UnclosedRootNode | UnexpectedEndOfStream);
        let message = error.to_string();
        let place = format!(" at {}", error.pos());
        (
            at_end.then_some(text.len()),
            message.strip_suffix(&place).unwrap_or(&message).to_owned(),
            if at_end {
                "the file seems to be cut off: close every element, the last one being </sdf>"
            } else {
                "correct the XML there"
            },
        )
    };
    let at = offset.map_or(error.pos(), |offset| text_pos(text, offset));
    SdfError::Malformed { place: place(source_name, at), message, advice }
}

/// Byte offset of a comment that is never closed.
fn unclosed_comment(text: &str) -> Option<usize> {
    let mut from = 0;
    loop {
        let open = from + text.get(from..)?.find("<!--")?;
        match text.get(open..)?.find("-->") {
            Some(close) => from = open + close + 3,
            None => return Some(open),
        }
    }
}

fn text_pos(text: &str, offset: usize) -> TextPos {
    let before = text.get(..offset).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
    TextPos::new(u32::try_from(line).unwrap_or(u32::MAX), u32::try_from(column).unwrap_or(u32::MAX))
}

fn place(source_name: &str, at: TextPos) -> Place {
    Place { source_name: source_name.to_owned(), line: at.row, column: at.col }
}

struct Reader<'a> {
    document: &'a Document<'a>,
    source_name: &'a str,
    obstacles: Vec<Obstacle>,
    datum: Option<Datum>,
    has_ground: bool,
    /// By message: byte offset of the first occurrence, and how many.
    warnings: BTreeMap<String, (usize, usize)>,
}

/// A reader's place in the tree of models.
struct Parent {
    name: String,
    pose: Isometry3<f64>,
    is_static: bool,
    depth: usize,
}

impl<'a> Reader<'a> {
    fn new(document: &'a Document<'a>, source_name: &'a str) -> Self {
        Self {
            document,
            source_name,
            obstacles: Vec::new(),
            datum: None,
            has_ground: false,
            warnings: BTreeMap::new(),
        }
    }

    /// Reads the whole file and returns the world's name.
    fn read_root(&mut self, root: Node<'a, 'a>) -> Result<String, SdfError> {
        if root.tag_name().name() != "sdf" {
            return Err(SdfError::Missing {
                place: self.place(root),
                element: root.tag_name().name().to_owned(),
                expected: "an <sdf> around everything, with a <world> or <model>",
            });
        }
        let mut worlds = children(root, "world");
        let Some(world) = worlds.next() else {
            return self.read_bare_models(root);
        };
        if let Some(second) = worlds.next() {
            self.warn(second, "only the first <world> is read");
        }
        self.read_world(world)?;
        if !self.has_ground {
            self.warn(world, "no ground plane; flat ground at z = 0 is assumed");
        }
        Ok(world.attribute("name").unwrap_or(self.source_name).to_owned())
    }

    fn read_bare_models(&mut self, root: Node<'a, 'a>) -> Result<String, SdfError> {
        let mut name = None;
        for model in children(root, "model") {
            name = name.or(model.attribute("name"));
            self.read_model(model, &Parent::world())?;
            self.has_ground = true;
        }
        if children(root, "model").next().is_none() {
            return Err(SdfError::Missing {
                place: self.place(root),
                element: "sdf".to_owned(),
                expected: "a <world> or <model>",
            });
        }
        Ok(name.unwrap_or(self.source_name).to_owned())
    }

    fn read_world(&mut self, world: Node<'a, 'a>) -> Result<(), SdfError> {
        for child in world.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "model" => self.read_model(child, &Parent::world())?,
                "include" => self.read_include(child)?,
                "spherical_coordinates" => self.read_datum(child)?,
                scenery if WORLD_SCENERY.contains(&scenery) => {}
                other => self.warn(child, format!("<{other}> is not supported; left out")),
            }
        }
        Ok(())
    }

    fn read_include(&mut self, include: Node<'a, 'a>) -> Result<(), SdfError> {
        let uri = self.required_text(include, "uri", "a <uri>")?;
        if BUILT_IN_MODELS.contains(&uri) {
            self.has_ground |= uri == "model://ground_plane";
        } else {
            self.warn(include, format!("included model `{uri}` is not in this file; left out"));
        }
        Ok(())
    }

    fn read_model(&mut self, model: Node<'a, 'a>, parent: &Parent) -> Result<(), SdfError> {
        if parent.depth >= DEPTH_LIMIT {
            return Err(SdfError::TooDeep { place: self.place(model) });
        }
        let name = model.attribute("name").unwrap_or("model");
        let is_static = match child_text(model, "static") {
            Some(text) => matches!(text, "1" | "true"),
            None => parent.is_static,
        };
        if model.has_attribute("placement_frame") {
            self.warn(
                model,
                format!("model `{name}`: placement_frame is not supported; its own origin is used"),
            );
        }
        let here = Parent {
            name: parent.scoped(name),
            pose: parent.pose * self.read_pose(model, name)?,
            is_static,
            depth: parent.depth + 1,
        };
        let before = self.obstacles.len();
        for child in model.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "link" => self.read_link(child, &here)?,
                "model" => self.read_model(child, &here)?,
                "include" => self.read_include(child)?,
                _ => {}
            }
        }
        if !is_static && parent.depth == 0 && self.obstacles.len() > before {
            self.warn(model, format!("model `{name}` is not static; it stands still here"));
        }
        Ok(())
    }

    fn read_link(&mut self, link: Node<'a, 'a>, model: &Parent) -> Result<(), SdfError> {
        let name = model.scoped(link.attribute("name").unwrap_or("link"));
        let pose = model.pose * self.read_pose(link, &name)?;
        let mut is_solid = false;
        for collision in children(link, "collision") {
            is_solid = true;
            let own_name = collision.attribute("name").unwrap_or("collision");
            let name = format!("{name}::{own_name}");
            let pose = pose * self.read_pose(collision, &name)?;
            let geometry = self.required(collision, "geometry", "a <geometry>")?;
            if let Some(shape) = self.read_geometry(geometry, &name)? {
                self.add(Obstacle { name, shape, pose, way: None });
            }
        }
        if !is_solid && children(link, "visual").next().is_some() {
            self.warn(link, format!("link `{name}` can be seen but has no <collision>; left out"));
        }
        Ok(())
    }

    /// Keeps an obstacle, unless it is the ground that every scene has.
    fn add(&mut self, obstacle: Obstacle) {
        if let Shape::Plane { normal } = obstacle.shape {
            let up = obstacle.pose.rotation * normal.into_inner();
            let height = obstacle.pose.translation.vector.dot(&up);
            if up.z > 1.0 - 1e-9 && height.abs() < 1e-6 {
                self.has_ground = true;
                return;
            }
        }
        self.obstacles.push(obstacle);
    }

    fn read_geometry(&mut self, geometry: Node<'a, 'a>, owner: &str) -> Result<Option<Shape>, SdfError> {
        let Some(form) = geometry.first_element_child() else {
            return Err(SdfError::Missing {
                place: self.place(geometry),
                element: "geometry".to_owned(),
                expected: "a shape such as <box>",
            });
        };
        let shape = match form.tag_name().name() {
            "box" => Shape::Box {
                half_extents: Vector3::from(self.sizes::<3>(form, "size", "three sizes above 0")?) / 2.0,
            },
            "cylinder" => Shape::Cylinder {
                radius: self.size(form, "radius")?,
                half_height: self.size(form, "length")? / 2.0,
            },
            "sphere" => Shape::Sphere { radius: self.size(form, "radius")? },
            "plane" => Shape::Plane { normal: self.read_normal(form)? },
            other => {
                self.warn(form, format!("`{owner}` is a <{other}>, which is not supported; left out"));
                return Ok(None);
            }
        };
        Ok(Some(shape))
    }

    fn read_normal(&self, plane: Node<'a, 'a>) -> Result<Unit<Vector3<f64>>, SdfError> {
        let Some(normal) = child(plane, "normal") else {
            return Ok(Vector3::z_axis());
        };
        let parts = Vector3::from(self.numbers::<3>(normal, "three numbers")?);
        Unit::try_new(parts, 1e-9).ok_or_else(|| self.bad_value(normal, "a direction that is not zero"))
    }

    /// Pose of an element relative to its parent element; the identity when it has none.
    fn read_pose(&mut self, owner: Node<'a, 'a>, name: &str) -> Result<Isometry3<f64>, SdfError> {
        let Some(pose) = child(owner, "pose") else {
            return Ok(Isometry3::identity());
        };
        let frame = pose.attribute("relative_to").or(pose.attribute("frame"));
        if let Some(frame) = frame.filter(|frame| !frame.is_empty()) {
            self.warn(
                pose,
                format!("pose of `{name}` is relative to `{frame}`, which is not supported; taken relative to what holds it"),
            );
        }
        if text_of(pose).is_empty() {
            return Ok(Isometry3::identity());
        }
        if pose.attribute("rotation_format") == Some("quat_xyzw") {
            let [x, y, z, qx, qy, qz, qw] = self.numbers(pose, "x y z and a quaternion x y z w")?;
            let rotation = UnitQuaternion::try_new(Quaternion::new(qw, qx, qy, qz), 1e-9)
                .ok_or_else(|| self.bad_value(pose, "a quaternion that is not zero"))?;
            return Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation));
        }
        let [x, y, z, mut roll, mut pitch, mut yaw] =
            self.numbers(pose, "six numbers: x y z roll pitch yaw")?;
        if matches!(pose.attribute("degrees"), Some("1" | "true")) {
            (roll, pitch, yaw) = (roll.to_radians(), pitch.to_radians(), yaw.to_radians());
        }
        Ok(Isometry3::from_parts(
            Translation3::new(x, y, z),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        ))
    }

    fn read_datum(&mut self, coordinates: Node<'a, 'a>) -> Result<(), SdfError> {
        let number = |name, expected, limit: f64| -> Result<f64, SdfError> {
            let Some(node) = child(coordinates, name) else {
                return Ok(0.0);
            };
            let [number] = self.numbers::<1>(node, expected)?;
            if number.abs() > limit {
                return Err(self.bad_value(node, expected));
            }
            Ok(number)
        };
        let latitude_deg = number("latitude_deg", "degrees of -90 to 90", 90.0)?;
        let longitude_deg = number("longitude_deg", "degrees of -180 to 180", 180.0)?;
        let height_m = number("elevation", "metres", 1e4)?;
        let heading_deg = number("heading_deg", "degrees", 360.0)?;
        if heading_deg != 0.0 {
            self.warn(coordinates, "<heading_deg> is not supported; x is taken to point east");
        }
        self.datum = Some(Datum::from_degrees(latitude_deg, longitude_deg, height_m));
        Ok(())
    }

    fn size(&self, form: Node<'a, 'a>, name: &'static str) -> Result<f64, SdfError> {
        let [size] = self.sizes::<1>(form, name, "a size above 0")?;
        Ok(size)
    }

    fn sizes<const N: usize>(
        &self,
        form: Node<'a, 'a>,
        name: &'static str,
        expected: &'static str,
    ) -> Result<[f64; N], SdfError> {
        let node = self.required(form, name, expected)?;
        let sizes = self.numbers::<N>(node, expected)?;
        if sizes.iter().any(|size| *size <= 0.0) {
            return Err(self.bad_value(node, expected));
        }
        Ok(sizes)
    }

    /// Exactly `N` numbers of sensible magnitude.
    fn numbers<const N: usize>(
        &self,
        node: Node<'a, 'a>,
        expected: &'static str,
    ) -> Result<[f64; N], SdfError> {
        let mut numbers = [0.0; N];
        let mut words = text_of(node).split_whitespace();
        for number in &mut numbers {
            *number = words
                .next()
                .and_then(|word| word.parse().ok())
                .filter(|number: &f64| number.abs() <= LIMIT_M)
                .ok_or_else(|| self.bad_value(node, expected))?;
        }
        match words.next() {
            Some(_) => Err(self.bad_value(node, expected)),
            None => Ok(numbers),
        }
    }

    fn required(
        &self,
        parent: Node<'a, 'a>,
        name: &str,
        expected: &'static str,
    ) -> Result<Node<'a, 'a>, SdfError> {
        child(parent, name).ok_or_else(|| SdfError::Missing {
            place: self.place(parent),
            element: parent.tag_name().name().to_owned(),
            expected,
        })
    }

    fn required_text(
        &self,
        parent: Node<'a, 'a>,
        name: &str,
        expected: &'static str,
    ) -> Result<&'a str, SdfError> {
        self.required(parent, name, expected).map(text_of)
    }

    fn bad_value(&self, node: Node<'a, 'a>, expected: &'static str) -> SdfError {
        SdfError::Value {
            place: self.place(node),
            element: node.tag_name().name().to_owned(),
            found: text_of(node).chars().take(80).collect(),
            expected,
        }
    }

    fn warn(&mut self, node: Node<'a, 'a>, message: impl Into<String>) {
        let (_, count) = self.warnings.entry(message.into()).or_insert((node.range().start, 0));
        *count += 1;
    }

    /// All warnings in the order of the file.
    fn take_warnings(&mut self) -> Vec<Warning> {
        let mut warnings: Vec<_> = std::mem::take(&mut self.warnings)
            .into_iter()
            .map(|(message, (offset, count))| (offset, message, count))
            .collect();
        warnings.sort();
        let unlisted = warnings.split_off(warnings.len().min(MOST_WARNINGS));
        let rest = unlisted.first().map(|(offset, ..)| {
            (*offset, format!("from here on, {} more warnings are not listed", unlisted.len()), 1)
        });
        warnings
            .into_iter()
            .chain(rest)
            .map(|(offset, message, count)| Warning {
                place: place(self.source_name, self.document.text_pos_at(offset)),
                message,
                count,
            })
            .collect()
    }

    fn place(&self, node: Node<'a, 'a>) -> Place {
        place(self.source_name, self.document.text_pos_at(node.range().start))
    }
}

impl Parent {
    fn world() -> Self {
        Self { name: String::new(), pose: Isometry3::identity(), is_static: false, depth: 0 }
    }

    /// `name` with the names of what holds it, as Gazebo writes them.
    fn scoped(&self, name: &str) -> String {
        let end = name.char_indices().nth(MOST_LETTERS).map_or(name.len(), |(end, _)| end);
        let name = name.get(..end).unwrap_or(name);
        if self.name.is_empty() { name.to_owned() } else { format!("{}::{name}", self.name) }
    }
}

fn children<'a>(parent: Node<'a, 'a>, name: &'static str) -> impl Iterator<Item = Node<'a, 'a>> + use<'a> {
    parent.children().filter(move |child| child.has_tag_name(name))
}

fn child<'a>(parent: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    parent.children().find(|child| child.has_tag_name(name))
}

fn child_text<'a>(parent: Node<'a, 'a>, name: &str) -> Option<&'a str> {
    child(parent, name).map(text_of)
}

fn text_of<'a>(node: Node<'a, 'a>) -> &'a str {
    node.text().unwrap_or_default().trim()
}
