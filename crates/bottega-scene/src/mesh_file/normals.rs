//! Changes of whole meshes that formats require.

use glam::DVec3;
use rayon::prelude::*;

use crate::model::Mesh;

impl Mesh {
    /// Replaces the normals by the means of the adjacent triangles' normals, weighted by their angles at the vertex
    /// (Thürmer and Wüthrich, Computing vertex normals from polygonal facets, 1998).
    pub(crate) fn smooth_normals(&mut self) {
        let mut sums = vec![DVec3::ZERO; self.positions.len()];
        for triangle in &self.triangles {
            let p = triangle.map(|vertex| self.positions[vertex as usize].as_dvec3());
            let Some(normal) = (p[1] - p[0]).cross(p[2] - p[0]).try_normalize() else { continue };
            for corner in 0..3 {
                let to_next = (p[(corner + 1) % 3] - p[corner]).normalize_or_zero();
                let to_last = (p[(corner + 2) % 3] - p[corner]).normalize_or_zero();
                sums[triangle[corner] as usize] += normal * to_next.dot(to_last).clamp(-1.0, 1.0).acos();
            }
        }
        self.normals = sums.into_par_iter().map(DVec3::as_vec3).collect();
        self.mend_normals();
    }

    /// Flips v of both sets, from pointing up to pointing down.
    pub(crate) fn flip_v(&mut self) {
        for uvs in &mut self.uvs {
            uvs.par_iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};

    use super::*;

    /// Expected values: Mitsuba 3.9, for the same two triangles.
    #[test]
    fn normals_are_weighted_by_angle() {
        let mut mesh = Mesh::quad(Vec3::ZERO, Vec3::X, Vec3::Y);
        mesh.positions[2].z = 0.3;
        mesh.smooth_normals();
        let expected = [
            Vec3::new(-0.146_734_79, -0.146_734_79, 0.978_231_9),
            Vec3::new(0.0, -0.287_347_88, 0.957_826_26),
            Vec3::new(-0.146_734_79, -0.146_734_79, 0.978_231_97),
            Vec3::new(-0.287_347_88, 0.0, 0.957_826_26),
        ];
        for (normal, expected) in mesh.normals.iter().zip(expected) {
            assert!((normal - expected).length() < 1e-6, "{normal} {expected}");
        }
    }

    #[test]
    fn v_turns_over() {
        let mut mesh = Mesh::quad(Vec3::ZERO, Vec3::X, Vec3::Y);
        mesh.flip_v();
        assert_eq!(mesh.uvs[0], vec![Vec2::Y, Vec2::ONE, Vec2::X, Vec2::ZERO]);
    }
}
