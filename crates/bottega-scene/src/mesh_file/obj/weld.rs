//! Merging of corners with an index per attribute into vertices with a single index.

use glam::{Vec2, Vec3, Vec4};

use super::file::{Corner, NONE, ObjFile};
use crate::error::SceneError;
use crate::model::Mesh;

/// Flag of a normal index that is the number of a smoothing group.
const GROUP: u32 = 1 << 31;
/// Flag of a normal index that is the number of a flat triangle.
const FLAT: u32 = 3 << 30;

/// Triangles from the first to before the second number, and their smoothing group.
pub(super) type Range = (usize, usize, u32);

/// Makes meshes of parts of a file. Vertices are in the order of their first use by triangles.
pub(super) struct Welder<'f, 'a> {
    file: &'f ObjFile<'a>,
    /// The head of each position's list of vertices.
    first: Vec<u32>,
}

/// A vertex, and the next one of the same position.
struct Vertex {
    corner: Corner,
    next: u32,
}

impl<'f, 'a> Welder<'f, 'a> {
    /// Makes a welder for the parts of a file.
    pub(super) fn new(file: &'f ObjFile<'a>) -> Self {
        Self { file, first: vec![NONE; file.positions.len()] }
    }

    /// Makes a mesh of runs of triangles.
    ///
    /// - `smooths`: use smoothing groups.
    pub(super) fn weld(&mut self, runs: &[Range], smooths: bool) -> Result<Mesh, SceneError> {
        let file = self.file;
        let corners = || runs.iter().flat_map(|&(first, end, _)| file.triangles[first..end].iter().flatten());
        let has_uvs = corners().any(|corner| corner[1] != NONE);
        let has_groups = smooths && runs.iter().any(|&(.., group)| group != 0);
        let has_normals = has_groups || corners().any(|corner| corner[2] != NONE);
        let count: usize = runs.iter().map(|&(first, end, _)| end - first).sum();
        let mut triangles: Vec<[u32; 3]> = file.source.zeroed(count)?;
        let mut vertices: Vec<Vertex> = Vec::new();
        let numbered = runs.iter().flat_map(|&(first, end, group)| (first..end).map(move |number| (number, group)));
        for (to, (number, group)) in triangles.iter_mut().zip(numbered) {
            *to = file.triangles[number].map(|[position, uv, normal]| {
                let normal = match normal {
                    NONE if !has_normals || !smooths => NONE,
                    // Beside smooth triangles, flat ones get vertices of their own.
                    NONE if group == 0 => FLAT | (number as u32 & !FLAT),
                    NONE => GROUP | group,
                    normal => normal,
                };
                self.vertex([position, uv, normal], &mut vertices)
            });
        }
        let mesh = self.mesh(&vertices, triangles, has_uvs, has_normals);
        for vertex in &vertices {
            self.first[vertex.corner[0] as usize] = NONE;
        }
        mesh
    }

    /// Finds or adds the vertex of a corner.
    fn vertex(&mut self, corner: Corner, vertices: &mut Vec<Vertex>) -> u32 {
        let first = &mut self.first[corner[0] as usize];
        let mut candidate = *first;
        while let Some(vertex) = vertices.get(candidate as usize) {
            if vertex.corner == corner {
                return candidate;
            }
            candidate = vertex.next;
        }
        let number = vertices.len() as u32;
        vertices.push(Vertex { corner, next: *first });
        *first = number;
        number
    }

    fn mesh(
        &self,
        vertices: &[Vertex],
        triangles: Vec<[u32; 3]>,
        has_uvs: bool,
        has_normals: bool,
    ) -> Result<Mesh, SceneError> {
        let file = self.file;
        let has_colors = !file.colors.is_empty();
        let mut mesh = Mesh { triangles, ..Mesh::default() };
        mesh.positions = file.source.zeroed(vertices.len())?;
        mesh.uvs[0] = file.source.zeroed(if has_uvs { vertices.len() } else { 0 })?;
        mesh.normals = file.source.zeroed(if has_normals { vertices.len() } else { 0 })?;
        mesh.colors = file.source.zeroed(if has_colors { vertices.len() } else { 0 })?;
        // Absent attributes become 0; normals are replaced later.
        let corners = || vertices.iter().map(|vertex| vertex.corner);
        set(&mut mesh.positions, corners().map(|corner| file.positions[corner[0] as usize]));
        set(&mut mesh.uvs[0], corners().map(|corner| file.uvs.get(corner[1] as usize).copied().unwrap_or(Vec2::ZERO)));
        set(
            &mut mesh.normals,
            corners().map(|corner| file.normals.get(corner[2] as usize).copied().unwrap_or(Vec3::ZERO)),
        );
        set(&mut mesh.colors, corners().map(|corner| Vec4::from((file.colors[corner[0] as usize], 1.0))));
        Ok(mesh)
    }
}

/// Fills a list, which may be empty.
fn set<T>(list: &mut [T], values: impl Iterator<Item = T>) {
    list.iter_mut().zip(values).for_each(|(to, value)| *to = value);
}
