//! Files that hold a mesh: PLY, OBJ with its materials, Mitsuba's serialized meshes. Mitsuba's files of curves, too.
//!
//! Texture coordinates are those of the file: whoever asked for the mesh knows whether v points up or down there, and
//! calls [`Mesh::flip_v`] where it points up. Numbers that are no positions, and indices of vertices that are not
//! there, are errors that name the place; normals without direction are mended.

pub(crate) mod curves;
mod inflate;
mod lines;
pub(crate) mod mtl;
mod normals;
pub(crate) mod obj;
pub(crate) mod ply;
mod scene;
pub(crate) mod serialized;
mod source;

use std::path::Path;

use glam::{Vec2, Vec4};
use rayon::prelude::*;
use source::MeshSource;

use crate::budget::{HeldBytes, MemoryBudget};
use crate::{Mesh, SceneError};

pub(crate) use scene::{import, recognizes};

/// Unfolds a gzip file, or gives the bytes back where they are none. The memory is booked as long as the second result is
/// kept.
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

/// A colour that can be computed with: no channel is negative, infinite or not a number.
fn clean(color: Vec4) -> Vec4 {
    Vec4::select(color.cmpge(Vec4::ZERO), color.min(Vec4::splat(f32::MAX)), Vec4::ZERO)
}

/// Mends what would poison the shading, and drops what says nothing.
fn finish(mut mesh: Mesh) -> Mesh {
    mesh.mend_normals();
    mesh.uvs[0].par_iter_mut().filter(|uv| !uv.is_finite()).for_each(|uv| *uv = Vec2::ZERO);
    mesh.colors.par_iter_mut().for_each(|color| *color = clean(*color));
    if mesh.colors.par_iter().all(|&color| color == Vec4::ONE) {
        mesh.colors = Vec::new();
    }
    mesh
}
