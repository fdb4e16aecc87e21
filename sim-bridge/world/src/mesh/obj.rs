//! Wavefront OBJ: its objects and groups.

use std::io::Cursor;

use tobj::LoadOptions;

use super::{Faces, MeshError};

pub(super) fn read(bytes: &[u8], part: Option<&str>) -> Result<Faces, MeshError> {
    let options = LoadOptions { triangulate: true, single_index: false, ..LoadOptions::default() };
    let no_material = |_: &std::path::Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(bytes), &options, no_material)
        .map_err(|error| MeshError::Malformed(error.to_string()))?;
    let mut faces = Faces::default();
    let mut wanted = models.iter().filter(|model| part.is_none_or(|part| part == model.name)).peekable();
    if let Some(part) = part.filter(|_| wanted.peek().is_none()) {
        return Err(MeshError::NoPart(part.to_owned()));
    }
    for model in wanted {
        let first = u32::try_from(faces.corners.len()).map_err(|_| MeshError::TooMany)?;
        let corners = model.mesh.positions.chunks_exact(3);
        faces.corners.extend(corners.map(|at| [at[0].into(), at[1].into(), at[2].into()]));
        let triangles = model.mesh.indices.chunks_exact(3);
        faces
            .triangles
            .extend(triangles.map(|face| [face[0], face[1], face[2]].map(|corner| first + corner)));
    }
    Ok(faces)
}
