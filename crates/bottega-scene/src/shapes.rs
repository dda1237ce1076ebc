//! Meshes of simple shapes, for scenes built in code. Their material is 0 until [`Mesh::with_material`].

use std::f64::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use crate::model::Mesh;

impl Mesh {
    /// Returns a parallelogram of two triangles with one corner at `origin`. The front is the side from which `u` to
    /// `v` turns counter-clockwise; texture coordinates grow along them from (0, 0).
    ///
    /// - `u`, `v`: the edges from there to the adjacent corners.
    pub fn quad(origin: Vec3, u: Vec3, v: Vec3) -> Self {
        Self {
            name: "quad".into(),
            positions: vec![origin, origin + u, origin + u + v, origin + v],
            uvs: [vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y], Vec::new()],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Self::default()
        }
    }

    /// Returns a box of twelve triangles between its least and its greatest corner, front outside.
    pub fn cuboid(min: Vec3, max: Vec3) -> Self {
        let size = max - min;
        let (x, y, z) = (Vec3::X * size.x, Vec3::Y * size.y, Vec3::Z * size.z);
        let sides =
            [(min + z, x, y), (min + x, -x, y), (min + x + z, -z, y), (min, z, y), (min + y + z, x, -z), (min, x, z)];
        let mut mesh = Self { name: "cuboid".into(), ..Self::default() };
        for (origin, u, v) in sides {
            let side = Self::quad(origin, u, v);
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(side.positions);
            mesh.uvs[0].extend(&side.uvs[0]);
            mesh.triangles.extend(side.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + first)));
        }
        mesh
    }

    /// Returns a sphere of triangles, front outside, with smooth normals and texture coordinates.
    ///
    /// - `rows`: number of bands from pole to pole; fewer than 2 count as 2. There are twice as many columns.
    pub fn uv_sphere(center: Vec3, radius: f32, rows: u32) -> Self {
        let rows = rows.max(2);
        let columns = 2 * rows;
        let mut mesh = Self { name: "sphere".into(), ..Self::default() };
        for row in 0..=rows {
            for column in 0..=columns {
                let (u, v) = (f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows));
                let (sin_azimuth, cos_azimuth) = (u * TAU).sin_cos();
                let (sin_polar, cos_polar) = (v * PI).sin_cos();
                let normal =
                    Vec3::new((sin_polar * sin_azimuth) as f32, cos_polar as f32, (sin_polar * cos_azimuth) as f32);
                mesh.positions.push(center + radius * normal);
                mesh.normals.push(normal.normalize());
                mesh.uvs[0].push(Vec2::new(u as f32, v as f32));
            }
        }
        let vertex = |row: u32, column: u32| row * (columns + 1) + column;
        for row in 0..rows {
            for column in 0..columns {
                let (a, b) = (vertex(row, column), vertex(row + 1, column));
                if row > 0 {
                    mesh.triangles.push([a, b, a + 1]);
                }
                if row + 1 < rows {
                    mesh.triangles.push([a + 1, b, b + 1]);
                }
            }
        }
        mesh
    }

    /// Returns the mesh with another material, by its index into [`Scene::materials`](crate::Scene::materials).
    pub fn with_material(self, material: u32) -> Self {
        Self { material, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the divergence theorem: the sum over triangles of a · (b × c) / 6.
    fn signed_volume(mesh: &Mesh) -> f64 {
        let volume = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize].as_dvec3());
            a.dot(b.cross(c)) / 6.0
        };
        mesh.triangles.iter().map(volume).sum()
    }

    #[test]
    fn closed_shapes_have_their_front_outside() {
        let cuboid = Mesh::cuboid(Vec3::new(-1.0, 2.0, 0.0), Vec3::new(1.0, 5.0, 4.0));
        assert!((signed_volume(&cuboid) - 24.0).abs() < 1e-4);
        let sphere = Mesh::uv_sphere(Vec3::new(3.0, 1.0, 0.0), 2.0, 32);
        let expected = 4.0 / 3.0 * PI * 8.0;
        assert!((signed_volume(&sphere) / expected - 1.0).abs() < 0.01);
        assert!((signed_volume(&cuboid.mirrored()) - 24.0).abs() < 1e-4);
    }

    #[test]
    fn a_quad_faces_where_its_edges_run_counter_clockwise() {
        let quad = Mesh::quad(Vec3::ZERO, Vec3::X, Vec3::Y);
        assert_eq!(quad.cross(quad.triangles[0]), Vec3::Z);
        assert_eq!(quad.cross(quad.triangles[1]), Vec3::Z);
    }
}
