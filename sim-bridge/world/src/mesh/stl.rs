//! STL, of text or of bytes.

use std::io::Cursor;

use super::{Faces, MeshError};

pub(super) fn read(bytes: &[u8]) -> Result<Faces, MeshError> {
    let malformed = |error: std::io::Error| MeshError::Malformed(error.to_string());
    let mut bytes = Cursor::new(bytes);
    let mut faces = Faces::default();
    for triangle in stl_io::create_stl_reader(&mut bytes).map_err(malformed)? {
        let corners = triangle.map_err(malformed)?.vertices;
        faces.push(corners.map(|corner| [corner[0].into(), corner[1].into(), corner[2].into()]));
    }
    Ok(faces)
}
