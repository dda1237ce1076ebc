//! Mappings from the unit square to directions and points, with known densities.

use bottega_kernels::math;
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

/// Maps `u` to a point of the unit disk, uniform by area: the concentric mapping (Shirley and Chiu 1997), which keeps
/// strata compact.
#[inline(always)]
pub(crate) fn uniform_disk(u: [f32; 2]) -> Vec2 {
    let [a, b] = u.map(|u| 2.0 * u - 1.0);
    if a == 0.0 && b == 0.0 {
        return Vec2::ZERO;
    }
    let (radius, angle) =
        if a.abs() > b.abs() { (a, FRAC_PI_4 * (b / a)) } else { (b, FRAC_PI_2 - FRAC_PI_4 * (a / b)) };
    let (sin, cos) = math::sin_cos(angle);
    radius * Vec2::new(cos, sin)
}

/// Returns the direction at the angle arccos(1 − `one_minus_cos`) to an axis; `turn`: azimuth as a fraction of a turn.
pub(crate) fn around(axis: Vec3, one_minus_cos: f32, turn: f32) -> Vec3 {
    let (s, t) = orthonormal_basis(axis);
    let (sin, cos) = math::sin_cos_of_turns(turn);
    let sine = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
    (s * (sine * cos) + t * (sine * sin) + axis * (1.0 - one_minus_cos)).normalize()
}

/// Maps `u` to a direction, uniform over the sphere.
#[inline(always)]
pub(crate) fn uniform_sphere(u: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u[0];
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = math::sin_cos_of_turns(u[1]);
    Vec3::new(r * cos, r * sin, z)
}

/// Maps `u` to barycentric coordinates (of the second and third vertex), uniform over a triangle, by a mapping that keeps
/// strata compact (Heitz 2019, *A Low-Distortion Map Between Triangle and Square*).
#[inline(always)]
pub(crate) fn uniform_triangle(u: [f32; 2]) -> (f32, f32) {
    let [mut x, mut y] = u;
    if y > x {
        x *= 0.5;
        y -= x;
    } else {
        y *= 0.5;
        x -= y;
    }
    (x, y)
}

/// Returns two unit vectors that form a right-handed frame with the unit vector `n` (Duff et al. 2017, *Building an
/// Orthonormal Basis, Revisited*).
#[inline(always)]
pub(crate) fn orthonormal_basis(n: Vec3) -> (Vec3, Vec3) {
    let sign = 1.0_f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> impl Iterator<Item = [f32; 2]> {
        (0..10_000).map(|i| [((i % 100) as f32 + 0.5) / 100.0, ((i / 100) as f32 + 0.5) / 100.0])
    }

    #[test]
    fn the_disk_is_covered_uniformly() {
        let inside = |r: f32| grid().filter(|&u| uniform_disk(u).length() < r).count() as f32 / 10_000.0;
        assert!((inside(0.5) - 0.25).abs() < 0.01 && inside(1.0) > 0.999);
        let mean: Vec2 = grid().map(uniform_disk).sum::<Vec2>() / 10_000.0;
        assert!(mean.length() < 1e-3);
    }

    #[test]
    fn the_sphere_is_covered_uniformly() {
        let mean: Vec3 = grid().map(uniform_sphere).sum::<Vec3>() / 10_000.0;
        let squares: Vec3 = grid().map(|u| uniform_sphere(u) * uniform_sphere(u)).sum::<Vec3>() / 10_000.0;
        assert!(mean.length() < 1e-3 && (squares - 1.0 / 3.0).length() < 1e-3);
    }

    #[test]
    fn the_triangle_is_covered_uniformly() {
        let (mut b1, mut b2, mut product) = (0.0, 0.0, 0.0);
        for u in grid() {
            let (x, y) = uniform_triangle(u);
            assert!(x >= 0.0 && y >= 0.0 && x + y <= 1.0);
            b1 += x / 10_000.0;
            b2 += y / 10_000.0;
            product += x * y / 10_000.0;
        }
        assert!((b1 - 1.0 / 3.0).abs() < 1e-3 && (b2 - 1.0 / 3.0).abs() < 1e-3 && (product - 1.0 / 12.0).abs() < 1e-3);
    }

    #[test]
    fn a_basis_is_right_handed_and_orthonormal() {
        for u in grid() {
            let n = uniform_sphere(u);
            let (s, t) = orthonormal_basis(n);
            assert!((s.cross(t) - n).length() < 1e-5 && s.dot(n).abs() < 1e-5 && s.is_normalized());
        }
    }
}
