//! A parsed OBJ file.

use glam::{Vec2, Vec3};

use super::super::source::MeshSource;
use crate::budget::HeldBytes;

/// One corner of a polygon: position, texture coordinates, normal; [`NONE`] where absent.
pub(super) type Corner = [u32; 3];

/// An absent index.
pub(super) const NONE: u32 = u32::MAX;

/// A parsed file.
pub(crate) struct ObjFile<'a> {
    pub(super) source: MeshSource<'a>,
    pub(super) positions: Vec<Vec3>,
    /// Linear vertex colours; empty if no vertex has one.
    pub(super) colors: Vec<Vec3>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
    /// Triangles of all runs.
    pub(super) triangles: Vec<[Corner; 3]>,
    /// Start of each run of triangles with the same material and smoothing group.
    pub(super) runs: Vec<Run>,
    /// Names of the materials, in the order of their first use.
    pub(super) materials: Vec<String>,
    /// Names of the material libraries, and their lines.
    pub(crate) libraries: Vec<(String, usize)>,
    /// Each unsupported keyword, with the line of the first one.
    pub(super) skipped: Vec<(String, usize)>,
    /// Lines, and other warnings about them.
    pub(super) notes: Vec<(usize, String)>,
    /// The booked memory.
    pub(super) _held: Vec<HeldBytes<'a>>,
}

/// Triangles that share a material and a smoothing group.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    /// Index of the first triangle; the run ends where the next one starts.
    pub(super) first: usize,
    /// Index into the material names; `None`: before the first `usemtl`.
    pub(super) material: Option<usize>,
    /// Smoothing group; 0: flat.
    pub(super) smoothing: u32,
}
