//! Spherical triangles: uniform sampling of the solid angle of a triangle seen from a point.

use std::f32::consts::PI;

use bottega_kernels::math;
use glam::Vec3;

use crate::density::SolidAnglePdf;

/// The projection of a triangle onto the unit sphere around a point.
///
/// Source: Arvo 1995, *Stratified Sampling of Spherical Triangles*.
pub(super) struct SphericalTriangle {
    /// Corners as unit directions from the point.
    a: Vec3,
    b: Vec3,
    c: Vec3,
    /// Cosine of the angle at `a`; `sin_alpha`: its sine.
    cos_alpha: f32,
    sin_alpha: f32,
    /// Solid angle in sr.
    area: f32,
}

impl SphericalTriangle {
    /// Projects a triangle; `None` if it is seen edge-on, or too small or too large for single precision.
    pub(super) fn new(corners: &[Vec3; 3], from: Vec3) -> Option<Self> {
        let [a, b, c] = corners.map(|corner| (corner - from).normalize_or_zero());
        // Normals of the planes through the point and each edge
        let ab = a.cross(b).try_normalize()?;
        let ca = c.cross(a).try_normalize()?;
        // Solid angle (Van Oosterom and Strackee 1983, eq. 8): accurate where the sum of angles is not
        let volume = a.dot(b.cross(c)).abs();
        let denominator = 1.0 + a.dot(b) + b.dot(c) + c.dot(a);
        let area = 2.0 * math::atan2(volume, denominator);
        if !(1e-3..6.2).contains(&area) {
            return None;
        }
        let cos_alpha = (-ab.dot(ca)).clamp(-1.0, 1.0);
        let sin_alpha = (1.0 - cos_alpha * cos_alpha).sqrt();
        (sin_alpha > 1e-4).then_some(Self { a, b, c, cos_alpha, sin_alpha, area })
    }

    /// Returns the density of the directions that [`Self::sample`] draws.
    pub(super) fn pdf(&self) -> SolidAnglePdf {
        SolidAnglePdf::uniform(self.area)
    }

    /// Draws a point whose direction is uniform over the projection. Returns its barycentric coordinates (of the second
    /// and third corner); `None`: they are beyond single precision.
    pub(super) fn sample(&self, corners: &[Vec3; 3], from: Vec3, u: [f32; 2]) -> Option<(f32, f32)> {
        let direction = self.direction(u);
        // Intersect the direction with the triangle's plane (Möller and Trumbore 1997)
        let [p0, p1, p2] = *corners;
        let (e1, e2) = (p1 - p0, p2 - p0);
        let s1 = direction.cross(e2);
        let divisor = s1.dot(e1);
        if divisor == 0.0 {
            return None;
        }
        let s = from - p0;
        let b1 = (s.dot(s1) / divisor).clamp(0.0, 1.0);
        let b2 = (direction.dot(s.cross(e1)) / divisor).clamp(0.0, 1.0);
        let sum = (b1 + b2).max(1.0);
        let (b1, b2) = (b1 / sum, b2 / sum);
        (b1.is_finite() && b2.is_finite()).then_some((b1, b2))
    }

    /// Draws a direction, uniform over the projection.
    fn direction(&self, u: [f32; 2]) -> Vec3 {
        // Area of the part that the great circle through b and the new corner cuts off
        let part = u[0] * self.area + PI;
        let (sin_part, cos_part) = math::sin_cos(part);
        // Sine and cosine of (area of the part − α)
        let sin_phi = sin_part * self.cos_alpha - cos_part * self.sin_alpha;
        let cos_phi = cos_part * self.cos_alpha + sin_part * self.sin_alpha;
        let cos_c = self.a.dot(self.b);
        let k1 = cos_phi + self.cos_alpha;
        let k2 = sin_phi - self.sin_alpha * cos_c;
        let cos_side =
            (k2 + (k2 * cos_phi - k1 * sin_phi) * self.cos_alpha) / ((k2 * sin_phi + k1 * cos_phi) * self.sin_alpha);
        let cos_side = if cos_side.is_nan() { 1.0 } else { cos_side.clamp(-1.0, 1.0) };
        let sin_side = (1.0 - cos_side * cos_side).sqrt();
        let corner = cos_side * self.a + sin_side * orthogonal_part(self.c, self.a);
        // Uniform by area along the arc from b to the new corner
        let cos_theta = 1.0 - u[1] * (1.0 - corner.dot(self.b));
        let sin_theta = (1.0 - cos_theta * cos_theta).max(0.0).sqrt();
        (cos_theta * self.b + sin_theta * orthogonal_part(corner, self.b)).normalize_or_zero()
    }
}

/// Returns the unit direction of the component of `v` orthogonal to the unit vector `axis`.
fn orthogonal_part(v: Vec3, axis: Vec3) -> Vec3 {
    (v - v.dot(axis) * axis).normalize_or_zero()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(side: u32) -> impl Iterator<Item = [f32; 2]> {
        (0..side * side)
            .map(move |i| [((i % side) as f32 + 0.5) / side as f32, ((i / side) as f32 + 0.5) / side as f32])
    }

    /// The mean over the triangle by area of g(direction) · cos / distance², times its area: ∫ g over the solid angle.
    fn by_area(corners: &[Vec3; 3], g: impl Fn(Vec3) -> f64) -> f64 {
        let [a, b, c] = *corners;
        let normal = (b - a).cross(c - a);
        grid(400)
            .map(|u| {
                let (x, y) = crate::sampling::uniform_triangle(u);
                let p = a + (b - a) * x + (c - a) * y;
                g(p.normalize()) * 0.5 * f64::from(normal.dot(p).abs()) / f64::from(p.length().powi(3))
            })
            .sum::<f64>()
            / 160_000.0
    }

    #[test]
    fn directions_are_uniform_over_the_solid_angle() {
        let triangles = [
            [Vec3::X, Vec3::Y, Vec3::Z],
            [Vec3::new(-1.0, 0.5, -1.0), Vec3::new(1.0, 0.4, -1.0), Vec3::new(0.2, 0.6, 2.0)],
            [Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.5, 1.0, 0.0), Vec3::new(0.0, 1.0, 0.5)],
            [Vec3::new(-4.0, 1.0, -3.0), Vec3::new(4.0, 1.0, -3.0), Vec3::new(0.0, 1.0, 5.0)],
        ];
        for corners in triangles {
            let spherical = SphericalTriangle::new(&corners, Vec3::ZERO).unwrap();
            let area = by_area(&corners, |_| 1.0);
            assert!((f64::from(spherical.area) / area - 1.0).abs() < 2e-3, "{} {area}", spherical.area);
            for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(0.6, -0.8, 0.0)] {
                let g = |d: Vec3| f64::from(d.dot(axis)).powi(3) + 0.5 * f64::from(d.dot(axis));
                let mean = grid(200)
                    .map(|u| {
                        let (x, y) = spherical.sample(&corners, Vec3::ZERO, u).unwrap();
                        g((corners[0] + (corners[1] - corners[0]) * x + (corners[2] - corners[0]) * y).normalize())
                    })
                    .sum::<f64>()
                    / 40_000.0;
                let exact = by_area(&corners, g) / area;
                assert!((mean - exact).abs() < 3e-3, "{corners:?} {axis}: {mean} {exact}");
            }
        }
    }

    #[test]
    fn a_triangle_seen_edge_on_is_refused() {
        assert!(SphericalTriangle::new(&[Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0)], Vec3::ZERO).is_none());
        assert!(SphericalTriangle::new(&[Vec3::X; 3], Vec3::ZERO).is_none());
    }
}
