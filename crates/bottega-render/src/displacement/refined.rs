//! Meshes whose long edges are split.

use std::collections::HashMap;

use bottega_scene::{Mesh, MeshKey};
use glam::{Vec2, Vec3, Vec4};

/// A midpoint of two vertices of a mesh that is being refined.
type Middles = HashMap<[u32; 2], u32>;

/// Splits the edges of a mesh that are longer than `edge`, in rounds, until none is longer or another round would give
/// more than `faces_max` triangles. Returns true if none is longer.
///
/// An edge is split by the positions of its ends alone, so triangles that touch stay together. Vertices in between have
/// the mean of their neighbours' values.
pub(super) fn split_long_edges(mesh: &mut Mesh, edge: f32, faces_max: usize) -> bool {
    for _ in 0..ROUNDS_MAX {
        let is_long = |a: u32, b: u32| {
            let [a, b] = [a, b].map(|vertex| mesh.positions[vertex as usize]);
            a.distance_squared(b) > edge * edge
        };
        let marks: Vec<[bool; 3]> =
            mesh.triangles.iter().map(|&[a, b, c]| [is_long(a, b), is_long(b, c), is_long(c, a)]).collect();
        let added: usize = marks.iter().flatten().filter(|&&is_long| is_long).count();
        if added == 0 {
            return true;
        }
        if mesh.triangles.len() + added > faces_max {
            return false;
        }
        split(mesh, &marks);
    }
    false
}

/// Largest number of rounds: each halves the longest edges.
const ROUNDS_MAX: u32 = 24;

/// Splits the marked edges of each triangle.
fn split(mesh: &mut Mesh, marks: &[[bool; 3]]) {
    let mut middles = Middles::new();
    let mut ends: Vec<[u32; 2]> = Vec::new();
    let first = mesh.positions.len() as u32;
    let mut middle = |a: u32, b: u32| {
        *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
            ends.push([a, b]);
            first + ends.len() as u32 - 1
        })
    };
    let mut triangles = Vec::with_capacity(2 * mesh.triangles.len());
    for (&[a, b, c], &mark) in mesh.triangles.iter().zip(marks) {
        // Turn the triangle so that the cases below are all
        match mark {
            [false, false, false] => triangles.push([a, b, c]),
            [true, true, true] => {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
            }
            _ => {
                let turns = match mark {
                    [true, false, false] | [true, true, false] => [a, b, c],
                    [false, true, false] | [false, true, true] => [b, c, a],
                    _ => [c, a, b],
                };
                let [a, b, c] = turns;
                let ab = middle(a, b);
                if mark.iter().filter(|&&is_long| is_long).count() == 1 {
                    triangles.extend([[a, ab, c], [ab, b, c]]);
                } else {
                    let bc = middle(b, c);
                    triangles.extend([[ab, b, bc], [a, ab, bc], [a, bc, c]]);
                }
            }
        }
    }
    mesh.triangles = triangles;
    append(&mut mesh.positions, &ends, |a, b| (a + b) * 0.5);
    append(&mut mesh.normals, &ends, middle_normal);
    append(&mut mesh.tangents, &ends, |a: Vec4, b: Vec4| middle_normal(a.truncate(), b.truncate()).extend(a.w));
    for uvs in &mut mesh.uvs {
        append(uvs, &ends, |a: Vec2, b: Vec2| (a + b) * 0.5);
    }
    append(&mut mesh.colors, &ends, |a, b| (a + b) * 0.5);
    for MeshKey { positions, normals, .. } in &mut mesh.motion {
        append(positions, &ends, |a, b| (a + b) * 0.5);
        append(normals, &ends, middle_normal);
    }
}

fn middle_normal(a: Vec3, b: Vec3) -> Vec3 {
    (a + b).normalize_or(a)
}

/// Appends the values between vertices; does nothing if the mesh has no such values.
fn append<T: Copy>(values: &mut Vec<T>, ends: &[[u32; 2]], between: impl Fn(T, T) -> T) {
    if values.is_empty() {
        return;
    }
    values.reserve(ends.len());
    for &[a, b] in ends {
        values.push(between(values[a as usize], values[b as usize]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(mesh: &Mesh) -> Vec3 {
        let corner = |vertex: u32| mesh.positions[vertex as usize];
        let areas = mesh.triangles.iter().map(|&[a, b, c]| (corner(b) - corner(a)).cross(corner(c) - corner(a)) * 0.5);
        areas.sum()
    }

    #[test]
    fn edges_get_shorter_and_the_surface_stays() {
        let mut mesh = Mesh::quad(Vec3::ZERO, 3.0 * Vec3::X, Vec3::Y);
        let before = area(&mesh);
        assert!(split_long_edges(&mut mesh, 0.3, 1 << 20));
        assert!((area(&mesh) - before).length() < 1e-4, "{} {before}", area(&mesh));
        // Inner edges belong to two triangles, outer ones lie on the border: no vertex lies on an edge of another triangle
        let mut uses: HashMap<[u32; 2], u32> = HashMap::new();
        for &[a, b, c] in &mesh.triangles {
            for [a, b] in [[a, b], [b, c], [c, a]] {
                let [p, q] = [a, b].map(|vertex| mesh.positions[vertex as usize]);
                assert!(p.distance(q) <= 0.3, "{p} {q}");
                *uses.entry([a.min(b), a.max(b)]).or_default() += 1;
            }
        }
        for ([a, b], count) in uses {
            let [p, q] = [a, b].map(|vertex| mesh.positions[vertex as usize]);
            let is_border = (0..2).any(|axis| p[axis] == q[axis] && (p[axis] == 0.0 || p[axis] == [3.0, 1.0][axis]));
            assert_eq!(count, if is_border { 1 } else { 2 }, "{p} {q}");
        }
        assert_eq!(mesh.uvs[0].len(), mesh.positions.len());
    }

    #[test]
    fn refinement_ends_where_there_would_be_too_many_faces() {
        let mut mesh = Mesh::quad(Vec3::ZERO, Vec3::X, Vec3::Y);
        assert!(!split_long_edges(&mut mesh, 1e-4, 1000));
        assert!((250..=1000).contains(&mesh.triangles.len()), "{}", mesh.triangles.len());
    }
}
