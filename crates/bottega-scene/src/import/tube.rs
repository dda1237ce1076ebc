//! Tubes around curves, as triangles with the normals of the round surface.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec2};

use crate::model::Mesh;

/// A cross-section of a tube.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ring {
    /// Center of the circle.
    pub(crate) center: DVec3,
    /// Direction of the tube, unit length; the ring is perpendicular to it.
    pub(crate) axis: DVec3,
    pub(crate) radius: f64,
    /// Component of the normals along the axis, in [−1, 1]: 0 where the radius is constant, above 0 where it shrinks.
    pub(crate) lean: f64,
    /// Texture coordinate along the tube.
    pub(crate) v: f64,
}

/// Returns the factor of the radius of a polygonal cross-section that makes it as wide on average, over all viewing
/// directions, as the circle. (The mean width of a convex shape is its perimeter over π.)
pub(crate) fn widening(sides: u32) -> f64 {
    PI / (f64::from(sides) * (PI / f64::from(sides)).sin())
}

/// Returns the memory that [`add`] uses for `rings` rings, in bytes.
pub(crate) fn memory_bytes(rings: usize, sides: u32) -> usize {
    let vertex = size_of::<[f32; 8]>();
    rings.saturating_mul((sides as usize + 1) * vertex + 2 * sides as usize * size_of::<[u32; 3]>())
}

/// Adds a tube through `rings` to a mesh, front outside. u grows around it.
///
/// - `azimuth`: direction at which u = 0 for an axis, perpendicular to it. The cross-section itself twists no more than
///   the curve does.
pub(crate) fn add(mesh: &mut Mesh, rings: &[Ring], sides: u32, azimuth: impl Fn(DVec3) -> DVec3) {
    let Some(first) = rings.first() else { return };
    let wider = widening(sides);
    let start = mesh.positions.len() as u32;
    let mut x = azimuth(first.axis);
    let mut turn = 0.0;
    for ring in rings {
        x = (x - ring.axis * ring.axis.dot(x)).try_normalize().unwrap_or(ring.axis.any_orthonormal_vector());
        let y = ring.axis.cross(x);
        let zero = azimuth(ring.axis);
        let here = x.dot(ring.axis.cross(zero)).atan2(x.dot(zero)) / TAU;
        // Choose the nearest whole turn: a repeating texture is unaffected, but u must not jump between rings.
        turn = here + (turn - here).round();
        let across = (1.0 - ring.lean * ring.lean).max(0.0).sqrt();
        for side in 0..=sides {
            let share = f64::from(side) / f64::from(sides);
            // Make the last corner bit-identical to the first.
            let (sin, cos) = (TAU * f64::from(side % sides) / f64::from(sides)).sin_cos();
            let out = x * cos + y * sin;
            mesh.positions.push((ring.center + out * (ring.radius * wider)).as_vec3());
            mesh.normals.push((out * across + ring.axis * ring.lean).as_vec3());
            mesh.uvs[0].push(Vec2::new((turn + share) as f32, ring.v as f32));
        }
    }
    for (index, pair) in rings.windows(2).enumerate() {
        let a = start + index as u32 * (sides + 1);
        let b = a + sides + 1;
        for side in 0..sides {
            // Where a ring is a point, omit the degenerate triangle.
            if pair[0].radius > 0.0 {
                mesh.triangles.push([a + side, a + side + 1, b + side + 1]);
            }
            if pair[1].radius > 0.0 {
                mesh.triangles.push([a + side, b + side + 1, b + side]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cone_has_its_area_and_its_normals() {
        // Radius 0.5 → 0.2 over a length of 0.4: slant height 0.5, lateral area π · 0.7 · 0.5.
        let ring = |x: f64, radius: f64| Ring { center: DVec3::X * x, axis: DVec3::X, radius, lean: 0.6, v: x };
        let mut mesh = Mesh::default();
        add(&mut mesh, &[ring(0.0, 0.5), ring(0.4, 0.2)], 64, DVec3::any_orthonormal_vector);
        let area: f64 = mesh.triangles.iter().map(|&triangle| f64::from(mesh.cross(triangle).length()) / 2.0).sum();
        assert!((area / (PI * 0.35) - 1.0).abs() < 2e-3, "{area}");
        for &triangle in &mesh.triangles {
            let cross = mesh.cross(triangle).normalize();
            assert!(triangle.iter().all(|&vertex| mesh.normals[vertex as usize].dot(cross) > 0.99));
        }
    }

    #[test]
    fn points_make_no_triangles_without_area() {
        let ring = |x: f64, radius: f64| Ring { center: DVec3::X * x, axis: DVec3::X, radius, lean: 0.0, v: x };
        let mut mesh = Mesh::default();
        add(&mut mesh, &[ring(0.0, 0.0), ring(1.0, 1.0), ring(2.0, 0.0)], 8, DVec3::any_orthonormal_vector);
        assert_eq!(mesh.triangles.len(), 16);
        assert!(mesh.triangles.iter().all(|&triangle| mesh.cross(triangle).length() > 0.0));
        assert!(memory_bytes(3, 8) >= mesh.memory_bytes());
    }
}
