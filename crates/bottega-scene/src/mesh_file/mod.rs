//! Readers of mesh files: PLY, OBJ with materials, Mitsuba's serialized meshes and curves.
//!
//! Texture coordinates are as in the file: the caller knows whether v points up, and then calls [`Mesh::flip_v`].
//! Invalid positions and vertex indices are errors with a location; invalid normals are replaced.

pub(crate) mod curves;
mod inflate;
mod lines;
pub(crate) mod mtl;
mod normals;
pub(crate) mod obj;
pub(crate) mod ply;
pub(crate) mod scene;
pub(crate) mod serialized;
mod source;

use std::path::Path;

use glam::{Vec2, Vec4};
use rayon::prelude::*;
use source::MeshSource;

use crate::budget::{HeldBytes, MemoryBudget};
use crate::error::SceneError;
use crate::model::Mesh;

/// Decompresses a gzip file; returns other bytes unchanged. The memory stays booked until the second result is dropped.
pub(crate) fn unfolded<'a>(
    path: &'a Path,
    bytes: Vec<u8>,
    budget: &'a MemoryBudget,
) -> Result<(Vec<u8>, Option<HeldBytes<'a>>), SceneError> {
    if !bytes.starts_with(inflate::GZIP_MAGIC) {
        return Ok((bytes, None));
    }
    inflate::gunzip(MeshSource { path, budget }, &bytes).map(|(bytes, held)| (bytes, Some(held)))
}

/// Replaces negative, infinite and NaN channels of a colour.
fn clean(color: Vec4) -> Vec4 {
    Vec4::select(color.cmpge(Vec4::ZERO), color.min(Vec4::splat(f32::MAX)), Vec4::ZERO)
}

/// Replaces invalid normals, texture coordinates and colours, and drops colours that are all white.
fn finish(mut mesh: Mesh) -> Mesh {
    mesh.mend_normals();
    mesh.uvs[0].par_iter_mut().filter(|uv| !uv.is_finite()).for_each(|uv| *uv = Vec2::ZERO);
    mesh.colors.par_iter_mut().for_each(|color| *color = clean(*color));
    if mesh.colors.par_iter().all(|&color| color == Vec4::ONE) {
        mesh.colors = Vec::new();
    }
    mesh
}
