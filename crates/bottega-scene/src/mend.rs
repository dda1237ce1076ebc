//! Replacement of invalid normals and tangents.

use glam::{DVec3, Vec3, Vec4};
use rayon::prelude::*;

use crate::model::Mesh;

impl Mesh {
    /// Normalizes all normals. Replaces one without direction by the mean of the triangles around its vertex, weighted
    /// by area. Returns true if there was one.
    pub(crate) fn mend_normals(&mut self) -> bool {
        let normals = self.normals.par_iter_mut().enumerate();
        let bad: Vec<usize> = normals
            .filter_map(|(vertex, normal)| match unit(*normal) {
                Some(direction) => {
                    *normal = direction;
                    None
                }
                None => Some(vertex),
            })
            .collect();
        if bad.is_empty() {
            return false;
        }
        let mut sums = vec![Vec3::ZERO; self.normals.len()];
        for &triangle in &self.triangles {
            let cross = self.cross(triangle);
            let cross = if cross.is_finite() { cross } else { Vec3::ZERO };
            triangle.iter().for_each(|&vertex| sums[vertex as usize] += cross);
        }
        for vertex in bad {
            self.normals[vertex] = unit(sums[vertex]).unwrap_or(Vec3::Y);
        }
        true
    }

    /// Normalizes all tangents and their signs to ±1. Replaces one without direction by any perpendicular to the
    /// normal. Returns true if there was one. Drops tangents without normals.
    pub(crate) fn mend_tangents(&mut self) -> bool {
        if self.normals.is_empty() {
            self.tangents = Vec::new();
        }
        let mut mended = false;
        for (tangent, normal) in self.tangents.iter_mut().zip(&self.normals) {
            let sign = if tangent.w < 0.0 { -1.0 } else { 1.0 };
            let direction = unit(tangent.truncate());
            mended |= direction.is_none();
            let direction = direction.unwrap_or_else(|| normal.any_orthonormal_vector());
            *tangent = Vec4::from((direction, sign));
        }
        mended
    }
}

/// Returns the direction of a finite vector of any length but 0.
fn unit(v: Vec3) -> Option<Vec3> {
    if !v.is_finite() {
        return None;
    }
    v.as_dvec3().try_normalize().map(DVec3::as_vec3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_normal_without_direction_is_taken_from_the_surface() {
        let mut mesh = Mesh::quad(Vec3::ZERO, Vec3::X, Vec3::Y);
        mesh.normals = vec![Vec3::Z * 3.0, Vec3::ZERO, Vec3::NAN, Vec3::Z * 1e-30];
        assert!(mesh.mend_normals());
        assert_eq!(mesh.normals, vec![Vec3::Z; 4]);
        assert!(!mesh.mend_normals());
    }

    #[test]
    fn a_tangent_without_direction_becomes_perpendicular_to_the_normal() {
        let mut mesh = Mesh::quad(Vec3::ZERO, Vec3::X, Vec3::Y);
        mesh.normals = vec![Vec3::Z; 4];
        mesh.tangents = vec![Vec4::ZERO, Vec4::NAN, Vec4::new(2.0, 0.0, 0.0, -0.5), Vec4::X];
        assert!(mesh.mend_tangents());
        for tangent in &mesh.tangents {
            assert!(tangent.truncate().dot(Vec3::Z).abs() < 1e-6 && tangent.truncate().is_normalized());
        }
        assert_eq!(
            (mesh.tangents[2], mesh.tangents[3]),
            (Vec4::new(1.0, 0.0, 0.0, -1.0), Vec4::new(1.0, 0.0, 0.0, 1.0))
        );
    }
}
