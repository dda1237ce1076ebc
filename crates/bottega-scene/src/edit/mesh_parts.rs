//! Meshes by corner as meshes by vertex: corners with equal values become one vertex, and each material slot one mesh.

use std::sync::{Arc, OnceLock};

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::corner_mesh::CornerMesh;
use super::error::EditError;
use crate::keys::check_times;
use crate::model::Mesh;
use crate::motion::MeshKey;

/// The most vertices at one position that a corner is compared with. Beyond them a corner gets a vertex of its own, so that
/// the time stays proportional to the number of corners.
const COMPARED_MAX: u32 = 32;

/// The end of a list of vertices.
const END: u32 = u32::MAX;

/// The meshes of one edited mesh, by material slot.
#[derive(Clone, Debug)]
pub(crate) struct MeshParts {
    /// Material slots, ascending, and their meshes.
    pub(super) parts: Vec<(u32, Arc<Mesh>)>,
    /// Least and greatest coordinates of all positions, object space.
    pub(super) bounds: (Vec3, Vec3),
    mirrored: OnceLock<Vec<Arc<Mesh>>>,
}

impl MeshParts {
    /// Makes the meshes of the slots, after checking all arrays.
    ///
    /// - `slots`: number of material slots; 0: any slot is allowed.
    pub(crate) fn new(name: &str, mesh: &CornerMesh<'_>, slots: usize) -> Result<Self, EditError> {
        mesh.check(slots)?;
        if !mesh.drop_empty {
            mesh.check_areas()?;
        }
        let (corners, vertex_of) = unique_corners(mesh);
        // Drop triangles without area, and number the rest by vertex
        let kept: Vec<usize> = if mesh.drop_empty {
            let is_kept = |&row: &usize| !mesh.is_empty(&mesh.triangles[row]);
            (0..mesh.triangles.len()).into_par_iter().filter(is_kept).collect()
        } else {
            (0..mesh.triangles.len()).collect()
        };
        let triangle = |&row: &usize| mesh.triangles[row].map(|corner| vertex_of[corner as usize]);
        // Divide the triangles by slot
        let slot_of = |row: usize| mesh.triangle_materials.map_or(0, |slots| slots[row] as u32);
        let mut slots_used: Vec<u32> = kept.iter().map(|&row| slot_of(row)).collect();
        slots_used.par_sort_unstable();
        slots_used.dedup();
        let parts = match *slots_used {
            [] => Vec::new(),
            [slot] => vec![(slot, of_vertices(name, mesh, &corners, kept.par_iter().map(triangle).collect()))],
            _ => {
                let of_slot = |&slot: &u32| {
                    let rows = kept.par_iter().filter(|&&row| slot_of(row) == slot);
                    let mut triangles: Vec<[u32; 3]> = rows.map(triangle).collect();
                    let used = compact(&mut triangles, corners.len());
                    let corners: Vec<u32> = used.iter().map(|&vertex| corners[vertex as usize]).collect();
                    (slot, of_vertices(name, mesh, &corners, triangles))
                };
                slots_used.iter().map(of_slot).collect()
            }
        };
        let parts = parts.into_iter().map(|(slot, mesh)| (slot, Arc::new(mesh))).collect();
        Ok(Self::of(parts))
    }

    /// Returns the meshes and their slots.
    pub(crate) fn into_meshes(self) -> impl Iterator<Item = (u32, Mesh)> {
        self.parts.into_iter().map(|(slot, mesh)| (slot, Arc::unwrap_or_clone(mesh)))
    }

    /// Makes parts of meshes that are sound.
    pub(super) fn of(parts: Vec<(u32, Arc<Mesh>)>) -> Self {
        let mut bounds = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for (_, mesh) in &parts {
            let (min, max) = mesh.bounds();
            bounds = (bounds.0.min(min), bounds.1.max(max));
        }
        Self { parts, bounds, mirrored: OnceLock::new() }
    }

    /// Returns these parts with keys of their vertices.
    pub(super) fn moving(self, keys: &[(f64, Self)]) -> Result<Self, EditError> {
        let wrong =
            |problem: String| EditError::argument("motion", problem, "keys differ in positions and normals alone");
        check_times(keys.iter().map(|key| key.0)).map_err(|problem| wrong(problem.to_string()))?;
        let mut parts = Vec::with_capacity(self.parts.len());
        for (index, (slot, mesh)) in self.parts.iter().enumerate() {
            let mut mesh = Mesh::clone(mesh);
            for (time, key) in keys {
                let same = key.parts.get(index).filter(|(other, key)| {
                    other == slot && key.triangles == mesh.triangles && key.normals.len() == mesh.normals.len()
                });
                let Some((_, key)) = same else {
                    return Err(wrong(format!("the key at time {time} has other triangles than the mesh")));
                };
                let (positions, normals) = (key.positions.clone(), key.normals.clone());
                mesh.motion.push(MeshKey { time: *time, positions, normals });
            }
            parts.push((*slot, Arc::new(mesh)));
        }
        Ok(Self::of(parts))
    }

    /// Returns the mirrored meshes, in the order of the parts; they are made when they are first needed.
    pub(super) fn mirrored(&self) -> &[Arc<Mesh>] {
        let mirrored = |(_, mesh): &(u32, Arc<Mesh>)| Arc::new(Mesh::clone(mesh).mirrored());
        self.mirrored.get_or_init(|| self.parts.iter().map(mirrored).collect())
    }
}

/// Unites corners of the same vertex whose values have the same bits. Returns one corner of each new vertex, and the new vertex
/// of each corner.
fn unique_corners(mesh: &CornerMesh<'_>) -> (Vec<u32>, Vec<u32>) {
    let count = mesh.corner_count();
    let mut vertex_of = vec![END; count];
    if !mesh.has_corner_values() {
        // Corners have nothing but their position: the vertices are those given.
        let mut corners = vec![END; mesh.positions.len()];
        for (number, corner) in vertex_of.iter_mut().zip(0..) {
            let vertex = mesh.vertex_of(corner);
            *number = vertex as u32;
            corners[vertex] = corner as u32;
        }
        if corners.iter().all(|&corner| corner != END) {
            return (corners, vertex_of);
        }
        // Leave out vertices without a corner
        let mut number = vec![END; mesh.positions.len()];
        let mut kept = Vec::with_capacity(count);
        for vertex in &mut vertex_of {
            let number = &mut number[*vertex as usize];
            if *number == END {
                *number = kept.len() as u32;
                kept.push(corners[*vertex as usize]);
            }
            *vertex = *number;
        }
        return (kept, vertex_of);
    }
    // The new vertices at each given vertex form a list: its first, and the next of each.
    let mut first = vec![END; mesh.positions.len()];
    let (mut next, mut corners): (Vec<u32>, Vec<u32>) = (Vec::new(), Vec::new());
    for (corner, number) in vertex_of.iter_mut().enumerate() {
        let vertex = mesh.vertex_of(corner as i32);
        let (mut candidate, mut compared) = (first[vertex], 0);
        while candidate != END && compared < COMPARED_MAX && !is_same(mesh, corners[candidate as usize], corner) {
            (candidate, compared) = (next[candidate as usize], compared + 1);
        }
        if candidate == END || compared == COMPARED_MAX {
            candidate = corners.len() as u32;
            corners.push(corner as u32);
            next.push(first[vertex]);
            first[vertex] = candidate;
        }
        *number = candidate;
    }
    (corners, vertex_of)
}

/// Returns true if two corners of a vertex have values of the same bits.
#[inline(always)]
fn is_same(mesh: &CornerMesh<'_>, a: u32, b: usize) -> bool {
    fn equal<const N: usize>(values: Option<&[[f32; N]]>, a: usize, b: usize) -> bool {
        values.is_none_or(|values| values[a].map(f32::to_bits) == values[b].map(f32::to_bits))
    }
    let a = a as usize;
    equal(mesh.normals, a, b) && equal(mesh.uvs[0], a, b) && equal(mesh.uvs[1], a, b) && equal(mesh.colors, a, b)
}

/// Renumbers the vertices of triangles in the order of their first use. Returns the former numbers.
fn compact(triangles: &mut [[u32; 3]], vertex_count: usize) -> Vec<u32> {
    let mut number = vec![END; vertex_count];
    let mut used = Vec::new();
    for vertex in triangles.iter_mut().flatten() {
        let number = &mut number[*vertex as usize];
        if *number == END {
            *number = used.len() as u32;
            used.push(*vertex);
        }
        *vertex = *number;
    }
    used
}

/// Gathers the values of the new vertices.
///
/// - `corners`: one corner of each new vertex.
fn of_vertices(name: &str, mesh: &CornerMesh<'_>, corners: &[u32], triangles: Vec<[u32; 3]>) -> Mesh {
    fn gathered<T: Send, const N: usize>(
        values: Option<&[[f32; N]]>,
        corners: &[u32],
        of: impl Fn([f32; N]) -> T + Sync,
    ) -> Vec<T> {
        let Some(values) = values else { return Vec::new() };
        corners.par_iter().map(|&corner| of(values[corner as usize])).collect()
    }
    let position = |&corner: &u32| Vec3::from_array(mesh.positions[mesh.vertex_of(corner as i32)]);
    let mut made = Mesh {
        name: name.to_owned(),
        positions: corners.par_iter().map(position).collect(),
        normals: gathered(mesh.normals, corners, Vec3::from_array),
        uvs: mesh.uvs.map(|uvs| gathered(uvs, corners, Vec2::from_array)),
        colors: gathered(mesh.colors, corners, Vec4::from_array),
        triangles,
        ..Mesh::default()
    };
    // Normals of no length become those of the surface.
    made.mend_normals();
    made
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    const CORNERS: [i32; 6] = [0, 1, 2, 0, 2, 3];
    const TRIANGLES: [[i32; 3]; 2] = [[0, 1, 2], [3, 4, 5]];

    fn square() -> CornerMesh<'static> {
        CornerMesh {
            positions: &SQUARE,
            corner_vertices: Some(&CORNERS),
            triangles: &TRIANGLES,
            ..CornerMesh::default()
        }
    }

    fn parts(mesh: &CornerMesh<'_>) -> Vec<(u32, Arc<Mesh>)> {
        MeshParts::new("square", mesh, 0).unwrap().parts
    }

    #[test]
    fn corners_with_equal_values_become_one_vertex() {
        let flat = parts(&square());
        assert_eq!((flat[0].1.positions.len(), flat[0].1.triangles[1]), (4, [0, 2, 3]));
        let equal = [[0.0, 0.0, 2.0]; 6];
        let smooth = parts(&CornerMesh { normals: Some(&equal), ..square() });
        assert_eq!(smooth[0].1.normals, vec![Vec3::Z; 4]);
        // A seam of the texture coordinates parts two of the vertices.
        let uvs = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [5.0, 5.0], [1.0, 1.0], [0.0, 1.0]];
        let seamed = parts(&CornerMesh { normals: Some(&equal), uvs: [Some(&uvs), None], ..square() });
        let mesh = &seamed[0].1;
        assert_eq!(mesh.positions.len(), 5);
        for (triangle, corners) in mesh.triangles.iter().zip(TRIANGLES) {
            for (&vertex, corner) in triangle.iter().zip(corners) {
                assert_eq!(mesh.uvs[0][vertex as usize].to_array(), uvs[corner as usize]);
                assert_eq!(mesh.positions[vertex as usize].to_array(), SQUARE[CORNERS[corner as usize] as usize]);
            }
        }
    }

    #[test]
    fn each_slot_is_a_mesh_of_its_own_vertices() {
        let parts = parts(&CornerMesh { triangle_materials: Some(&[7, 2]), ..square() });
        assert_eq!(parts.iter().map(|(slot, _)| *slot).collect::<Vec<_>>(), [2, 7]);
        assert_eq!(parts[0].1.positions, [SQUARE[0], SQUARE[2], SQUARE[3]].map(Vec3::from_array));
        assert_eq!(parts[1].1.positions.len(), 3);
        assert!(parts.iter().all(|(_, mesh)| mesh.triangles == [[0, 1, 2]]));
    }

    #[test]
    fn one_vertex_of_many_different_corners_takes_no_time() {
        // A fan whose corners all differ: comparing each with all before takes minutes.
        let count = 300_000;
        let normals: Vec<[f32; 3]> = (0..count).map(|i| [i as f32, 1.0, 0.0]).collect();
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let vertices = vec![0; count];
        let mesh = CornerMesh {
            positions: &positions,
            corner_vertices: Some(&vertices),
            triangles: &[],
            normals: Some(&normals),
            ..CornerMesh::default()
        };
        assert_eq!(unique_corners(&mesh).0.len(), count);
    }

    #[test]
    fn wrong_rows_are_named() {
        let mut positions = SQUARE;
        positions[2][1] = f32::NAN;
        let wrong = [
            (CornerMesh { positions: &positions, ..square() }, "`positions`, row 2: it is [1.0, NaN, 0.0]; finite"),
            (
                CornerMesh { triangles: &[[0, 1, 6]], ..square() },
                "`triangles`, row 0: it is [0, 1, 6]; there are corners 0 to 5",
            ),
            (
                CornerMesh { corner_vertices: Some(&[0, 1, 2, 0, -1, 3]), ..square() },
                "`corner_vertices`, row 4: it is -1",
            ),
            (
                CornerMesh { normals: Some(&[[0.0; 3]]), ..square() },
                "`normals`: it has 1 rows, and there are 6 corners",
            ),
            (
                CornerMesh { triangles: &[[0, 1, 2], [0, 0, 3]], ..square() },
                "`triangles`, row 1: the triangle of the corners [0, 0, 3] has no area",
            ),
            (
                CornerMesh { triangle_materials: Some(&[0, 3]), ..square() },
                "`triangle_materials`, row 1: it is 3; there are materials 0 to 1",
            ),
            (CornerMesh { colors: Some(&[[-1.0; 4]; 6]), ..square() }, "`colors`, row 0"),
        ];
        for (mesh, expected) in wrong {
            let message = MeshParts::new("", &mesh, 2).map(|_| ()).unwrap_err().to_string();
            assert!(message.starts_with(expected), "{message}");
        }
        let dropped = CornerMesh { triangles: &[[0, 0, 3], [0, 1, 2]], drop_empty: true, ..square() };
        assert_eq!(parts(&dropped)[0].1.triangles.len(), 1);
    }
}
