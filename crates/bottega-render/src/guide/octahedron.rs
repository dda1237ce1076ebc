//! The octahedral map of directions to a square, without transcendental functions in either direction.
//!
//! A direction is projected from the center onto the octahedron |x| + |y| + |z| = 1, whose lower half is folded out
//! around the upper one (Meyer et al. 2010, *On Floating-Point Normal Vectors*). Areas are not preserved, but their
//! ratio is a cube: with s = |x| + |y| + |z| of the unit direction, dω = s³ dA for the square [−1, 1]².

use glam::{Vec2, Vec3};

/// Returns the position of a unit direction in [−1, 1]², and s (see the [module](self)).
#[inline(always)]
pub(crate) fn square_from_direction(w: Vec3) -> (Vec2, f32) {
    let sum = w.x.abs() + w.y.abs() + w.z.abs();
    let inverse = 1.0 / sum;
    let upper = Vec2::new(w.x * inverse, w.y * inverse);
    let folded = Vec2::new((1.0 - upper.y.abs()).copysign(w.x), (1.0 - upper.x.abs()).copysign(w.y));
    (if w.z < 0.0 { folded } else { upper }, sum)
}

/// Returns the unit direction at a position in [−1, 1]², and its s.
#[inline(always)]
pub(crate) fn direction_from_square(place: Vec2) -> (Vec3, f32) {
    let z = 1.0 - place.x.abs() - place.y.abs();
    let under = (-z).max(0.0);
    let on_octahedron = Vec3::new(place.x - under.copysign(place.x), place.y - under.copysign(place.y), z);
    let s = 1.0 / on_octahedron.length();
    (on_octahedron * s, s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::uniform_sphere;

    fn grid() -> impl Iterator<Item = [f32; 2]> {
        (0..40_000).map(|i| [((i % 200) as f32 + 0.5) / 200.0, ((i / 200) as f32 + 0.5) / 200.0])
    }

    #[test]
    fn there_and_back_is_where_one_was() {
        for u in grid() {
            let w = uniform_sphere(u);
            let (place, s) = square_from_direction(w);
            assert!(place.abs().max_element() <= 1.0);
            let (back, again) = direction_from_square(place);
            assert!((back - w).length() < 1e-5 && (s - again).abs() < 1e-5, "{w} {place} {back}");
        }
    }

    #[test]
    fn solid_angles_are_areas_times_the_cube() {
        // ∫ g dω over the sphere, by the square.
        for g in [(|_| 1.0) as fn(Vec3) -> f32, |w| w.z * w.z, |w| w.x.max(0.0)] {
            let by_square: f64 = grid()
                .map(|[u, v]| {
                    let (w, s) = direction_from_square(Vec2::new(2.0 * u - 1.0, 2.0 * v - 1.0));
                    f64::from(g(w) * s * s * s) * 4.0 / 40_000.0
                })
                .sum();
            let by_sphere: f64 =
                grid().map(|u| f64::from(g(uniform_sphere(u))) * 4.0 * std::f64::consts::PI / 40_000.0).sum();
            assert!((by_square / by_sphere - 1.0).abs() < 1e-3, "{by_square} {by_sphere}");
        }
    }
}
