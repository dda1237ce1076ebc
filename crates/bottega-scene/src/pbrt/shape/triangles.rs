//! The shape `trianglemesh`.

use glam::Vec4;

use super::super::context::Context;
use super::super::params::Params;
use super::geometry::{Geometry, indices, matching, positions, texture_coordinate};
use crate::import::text_place::{ImportResult, TextPlace};
use crate::model::Mesh;

/// Reads a `trianglemesh`.
pub(super) fn read(context: &mut Context<'_>, params: &Params, at: TextPlace) -> ImportResult<Geometry> {
    let points = params.points3("P", "point3")?.ok_or_else(|| at.fault("`trianglemesh` needs the positions `P`"))?;
    let points = positions(&points, params.place_of("P"))?;
    let count = points.len();
    let corners = match params.integers("indices") {
        Some(numbers) => indices(numbers, count, params.place_of("indices"))?,
        None if count == 3 => vec![0, 1, 2],
        None => return Err(at.fault("`trianglemesh` needs `indices`").into()),
    };
    let (triangles, rest) = corners.as_chunks::<3>();
    if !rest.is_empty() {
        context.warn(
            params.place_of("indices"),
            "the number of indices is not a multiple of 3; the last ones are left out",
        );
    }
    let normals = params.points3("N", "normal")?;
    let normals = matching(context, normals, "N", count, params.place_of("N"));
    let uvs = match params.points2("uv")? {
        // The name in pbrt-v3.
        None => params.points2("st")?,
        uvs => uvs,
    };
    let uvs = matching(context, uvs, "uv", count, params.place_of("uv"));
    let tangents = params.points3("S", "vector3")?;
    let tangents = matching(context, tangents, "S", count, params.place_of("S"));
    let mut mesh = Mesh {
        name: String::new(),
        positions: points,
        normals: normals.iter().map(|normal| normal.as_vec3()).collect(),
        uvs: [uvs.into_iter().map(texture_coordinate).collect(), Vec::new()],
        tangents: tangents.iter().map(|tangent| Vec4::from((tangent.as_vec3(), 1.0))).collect(),
        triangles: triangles.to_vec(),
        ..Mesh::default()
    };
    let place = context.place(at);
    context.resources.budget().take(context.path(at.file), &place, mesh.memory_bytes())?;
    if mesh.mend_normals() {
        context.warn(params.place_of("N"), "normals without direction are replaced by those of the surface");
    }
    mesh.mend_tangents();
    mesh.face_normals();
    let primitive_count = mesh.triangles.len();
    Ok(Geometry::Mesh { mesh: Box::new(mesh), primitive_count })
}
