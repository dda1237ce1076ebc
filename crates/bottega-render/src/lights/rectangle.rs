//! Spherical rectangles: uniform sampling of the solid angle of a rectangle seen from a point.

use std::f32::consts::PI;

use bottega_kernels::math;
use glam::Vec3;

use crate::density::SolidAnglePdf;

/// The projection of a rectangle onto the unit sphere around a point.
///
/// Source: Ureña, Fajardo and King 2013, *An Area-Preserving Parametrization for Spherical Rectangles*.
pub(super) struct SphericalRectangle {
    /// Lower corner relative to the point, in the rectangle's frame with x and y along its sides; `high`: the upper
    /// corner.
    low: [f32; 2],
    high: [f32; 2],
    /// Distance of the point from the rectangle's plane, above 0.
    height: f32,
    /// z of the normal of the plane through the point and the side at low y; `high_normal`: at high y.
    low_normal: f32,
    high_normal: f32,
    /// 2π minus the angles at the two corners with low x.
    far_angles: f32,
    /// Solid angle in sr.
    area: f32,
}

/// A rectangle with the values that do not depend on the point that sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rectangle {
    corner: Vec3,
    /// Unit vectors along the sides from the corner, perpendicular to each other.
    x: Vec3,
    y: Vec3,
    /// Their cross product.
    normal: Vec3,
    /// Lengths of the sides.
    width: f32,
    depth: f32,
}

impl Rectangle {
    /// Creates the rectangle with the sides `x` and `y` from `corner`, perpendicular to each other.
    pub(super) fn new(corner: Vec3, x: Vec3, y: Vec3) -> Self {
        let (width, depth) = (x.length(), y.length());
        let (x, y) = (x / width, y / depth);
        Self { corner, x, y, normal: x.cross(y), width, depth }
    }
}

impl SphericalRectangle {
    /// Projects a rectangle onto the sphere around a point; `None` if it is seen edge-on, or too small for single precision.
    #[inline(always)]
    pub(super) fn new(rectangle: &Rectangle, from: Vec3) -> Option<Self> {
        let Rectangle { corner, x, y, normal, width, depth } = *rectangle;
        let to_corner = corner - from;
        let low = [to_corner.dot(x), to_corner.dot(y)];
        let high = [low[0] + width, low[1] + depth];
        let height = to_corner.dot(normal).abs();
        let size = width.max(depth);
        if height.is_nan() || height <= 1e-4 * size {
            return None;
        }
        // Normals of the planes through the point and each side: z is the only component that is not 0 or ±1
        let tilt = |offset: f32| offset / (height * height + offset * offset).sqrt();
        let [low_y, high_x, high_y, low_x] = [-tilt(low[1]), tilt(high[0]), tilt(high[1]), -tilt(low[0])];
        let cosines = [-low_y * high_x, -high_x * high_y, -high_y * low_x, -low_x * low_y];
        let [g0, g1, g2, g3] = math::acos_of_four(cosines.map(|cosine| cosine.clamp(-1.0, 1.0)));
        let area = g0 + g1 + g2 + g3 - 2.0 * PI;
        (area > 5e-3).then_some(Self {
            low,
            high,
            height,
            low_normal: low_y,
            high_normal: high_y,
            far_angles: 2.0 * PI - g2 - g3,
            area,
        })
    }

    /// Returns the density of the directions that [`Self::sample`] draws.
    #[inline(always)]
    pub(super) fn pdf(&self) -> SolidAnglePdf {
        SolidAnglePdf::uniform(self.area)
    }

    /// Draws a point whose direction is uniform over the projection; returns its coordinates in [0, 1] along both sides.
    #[inline(always)]
    pub(super) fn sample(&self, u: [f32; 2]) -> [f32; 2] {
        let (sin, cos) = math::sin_cos(u[0] * self.area + self.far_angles);
        let f = (cos * self.low_normal - self.high_normal) / sin;
        let cosine = (1.0 / (f * f + self.low_normal * self.low_normal).sqrt()).copysign(f).clamp(-1.0, 1.0);
        let x = cosine * self.height / (1.0 - cosine * cosine).max(1e-12).sqrt();
        let x = if x.is_nan() { self.low[0] } else { x.clamp(self.low[0], self.high[0]) };
        let distance = (x * x + self.height * self.height).sqrt();
        let sine = |y: f32| y / (distance * distance + y * y).sqrt();
        let (low, high) = (sine(self.low[1]), sine(self.high[1]));
        let sine = low + u[1] * (high - low);
        let y = sine * distance / (1.0 - sine * sine).max(1e-12).sqrt();
        let y = y.clamp(self.low[1], self.high[1]);
        let share =
            |axis: usize, place: f32| ((place - self.low[axis]) / (self.high[axis] - self.low[axis])).clamp(0.0, 1.0);
        [share(0, x), share(1, y)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(side: u32) -> impl Iterator<Item = [f32; 2]> {
        (0..side * side)
            .map(move |i| [((i % side) as f32 + 0.5) / side as f32, ((i / side) as f32 + 0.5) / side as f32])
    }

    /// The integral over the rectangle by area of g(direction) · cos / distance².
    fn by_area(corner: Vec3, x: Vec3, y: Vec3, g: impl Fn(Vec3) -> f64) -> f64 {
        let normal = x.cross(y);
        grid(500)
            .map(|u| {
                let p = corner + x * u[0] + y * u[1];
                g(p.normalize()) * f64::from(normal.dot(p).abs()) / f64::from(p.length().powi(3))
            })
            .sum::<f64>()
            / 250_000.0
    }

    #[test]
    fn directions_are_uniform_over_the_solid_angle() {
        let rectangles = [
            (Vec3::new(-1.0, -1.0, 1.0), Vec3::X * 2.0, Vec3::Y * 2.0),
            (Vec3::new(0.5, 0.25, -0.5), Vec3::Y, Vec3::X * 3.0),
            (Vec3::new(-4.0, 0.3, -5.0), Vec3::X * 9.0, Vec3::Z * 7.0),
            (Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, 0.6, -0.8), Vec3::new(0.5, 0.0, 0.0)),
        ];
        for (corner, x, y) in rectangles {
            let spherical = SphericalRectangle::new(&Rectangle::new(corner, x, y), Vec3::ZERO).unwrap();
            let area = by_area(corner, x, y, |_| 1.0);
            assert!((1.0 / f64::from(spherical.pdf().per_sr()) / area - 1.0).abs() < 2e-3, "{} {area}", spherical.area);
            for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(0.6, -0.8, 0.0)] {
                let g = |d: Vec3| f64::from(d.dot(axis)).powi(3) + 0.5 * f64::from(d.dot(axis));
                let mean = grid(200)
                    .map(|u| {
                        let [s, t] = spherical.sample(u);
                        g((corner + x * s + y * t).normalize())
                    })
                    .sum::<f64>()
                    / 40_000.0;
                let exact = by_area(corner, x, y, g) / area;
                assert!((mean - exact).abs() < 3e-3, "{corner} {axis}: {mean} {exact}");
            }
        }
    }

    #[test]
    fn a_rectangle_seen_edge_on_or_from_afar_is_refused() {
        assert!(SphericalRectangle::new(&Rectangle::new(Vec3::X, Vec3::X, Vec3::Y), Vec3::ZERO).is_none());
        assert!(SphericalRectangle::new(&Rectangle::new(Vec3::Z * 100.0, Vec3::X, Vec3::Y), Vec3::ZERO).is_none());
    }
}
