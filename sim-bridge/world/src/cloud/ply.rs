//! PLY: points, and faces if there are any.

use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{PropertyAccess, PropertyAccessResult};

use super::{Cloud, MOST_POINTS};

/// A point.
#[derive(Debug, Clone, Copy, Default)]
struct Vertex([f64; 3]);

impl Vertex {
    fn set(&mut self, name: &str, value: f64) -> PropertyAccessResult {
        let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) else {
            return PropertyAccessResult::Ignored;
        };
        self.0[axis] = value;
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_float(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        self.set(name, value.into())
    }

    fn set_double(&mut self, name: &str, value: f64) -> PropertyAccessResult {
        self.set(name, value)
    }

    fn set_int(&mut self, name: &str, value: i32) -> PropertyAccessResult {
        self.set(name, value.into())
    }

    fn set_short(&mut self, name: &str, value: i16) -> PropertyAccessResult {
        self.set(name, value.into())
    }
}

/// The points of a face.
#[derive(Debug, Clone, Default)]
struct Face(Vec<u32>);

impl Face {
    fn set(&mut self, name: &str, points: impl Iterator<Item = Option<u32>>) -> PropertyAccessResult {
        if !["vertex_indices", "vertex_index"].contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        // What is below 0 is no point: the mesh says so.
        self.0 = points.map(|point| point.unwrap_or(u32::MAX)).collect();
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_list_int(&mut self, name: &str, value: Vec<i32>) -> PropertyAccessResult {
        self.set(name, value.into_iter().map(|point| u32::try_from(point).ok()))
    }

    fn set_list_uint(&mut self, name: &str, value: Vec<u32>) -> PropertyAccessResult {
        self.set(name, value.into_iter().map(Some))
    }

    fn set_list_short(&mut self, name: &str, value: Vec<i16>) -> PropertyAccessResult {
        self.set(name, value.into_iter().map(|point| u32::try_from(point).ok()))
    }

    fn set_list_ushort(&mut self, name: &str, value: Vec<u16>) -> PropertyAccessResult {
        self.set(name, value.into_iter().map(|point| Some(point.into())))
    }

    fn set_list_uchar(&mut self, name: &str, value: Vec<u8>) -> PropertyAccessResult {
        self.set(name, value.into_iter().map(|point| Some(point.into())))
    }
}

pub(super) fn read(bytes: &[u8]) -> Result<Cloud, String> {
    let mut reader = Reader::new(bytes);
    let (vertices, faces) = (Parser::<Vertex>::new(), Parser::<Face>::new());
    let header = vertices.read_header(&mut reader).map_err(|error| error.to_string())?;
    let mut cloud = Cloud::default();
    for (name, element) in &header.elements {
        if element.count > MOST_POINTS {
            return Err(format!(
                "{} of `{name}` are too many: expected at most {MOST_POINTS}",
                element.count
            ));
        }
        if name == "vertex" {
            let read = vertices
                .read_payload_for_element(&mut reader, element, &header)
                .map_err(|error| error.to_string())?;
            cloud.points = read.into_iter().map(|vertex| vertex.0).collect();
        } else {
            // Others than faces are read to get past them.
            let read = faces
                .read_payload_for_element(&mut reader, element, &header)
                .map_err(|error| error.to_string())?;
            let fan = |face: Face| {
                let first = face.0.first().copied().unwrap_or_default();
                let rest = face.0.get(1..).unwrap_or_default().windows(2);
                rest.map(|pair| [first, pair[0], pair[1]]).collect::<Vec<_>>()
            };
            cloud.triangles.extend(read.into_iter().flat_map(fan));
        }
    }
    if cloud.points.is_empty() { Err("there is no element `vertex` in it".to_owned()) } else { Ok(cloud) }
}
