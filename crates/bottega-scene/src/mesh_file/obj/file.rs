//! An OBJ file as it was read.

use glam::{Vec2, Vec3};

use super::super::source::MeshSource;
use crate::budget::HeldBytes;

/// One corner of a polygon: position, texture coordinates, normal; [`NONE`] where absent.
pub(super) type Corner = [u32; 3];

/// Stands for an absent index.
pub(super) const NONE: u32 = u32::MAX;

/// A file as it was read.
pub(crate) struct ObjFile<'a> {
    pub(super) source: MeshSource<'a>,
    pub(super) positions: Vec<Vec3>,
    /// Linear; empty where no vertex has a colour.
    pub(super) colors: Vec<Vec3>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
    pub(super) triangles: Vec<[Corner; 3]>,
    /// What holds from a triangle on.
    pub(super) runs: Vec<Run>,
    /// Names of the materials, in the order of their first use.
    pub(super) materials: Vec<String>,
    /// The libraries of materials that it names, and the line of each.
    pub(crate) libraries: Vec<(String, usize)>,
    /// Each keyword that was left out, and the line of the first one.
    pub(super) left_out: Vec<(String, usize)>,
    /// Lines, and what else is to be told of them.
    pub(super) notes: Vec<(usize, String)>,
    /// The memory of all this.
    pub(super) _held: Vec<HeldBytes<'a>>,
}

/// Triangles that share a material and a smoothing group.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    pub(super) first: usize,
    /// Index into the names; `None`: before the first `usemtl`.
    pub(super) material: Option<usize>,
    /// 0: flat.
    pub(super) smoothing: u32,
}
