//! Bounds of a group of lights: position, directions of emission, intensity.

use std::f32::consts::{FRAC_PI_2, PI};

use bottega_kernels::{Aabb, math};
use glam::{Quat, Vec3};

/// Bounds of the light that comes from one light or from several.
///
/// Source: Conty Estevez and Kulla 2018, *Importance Sampling of Many Lights with Adaptive Tree Splitting*, §4.1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LightBounds {
    /// Box around all emitting points.
    pub(super) bounds: Aabb,
    /// Cone around the axes of the lights.
    pub(super) cone: Cone,
    /// Largest angle between axis and emitted light, θ_e, in radians.
    pub(super) emission_angle: f32,
    /// `true`: some of the lights emit backwards as they do forwards.
    pub(super) two_sided: bool,
    /// Sum over the lights of their greatest luminous intensity.
    pub(super) intensity: f32,
}

/// The directions within an angle of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cone {
    /// Axis, unit length.
    pub(super) axis: Vec3,
    /// Half-angle θ_o, in radians, from 0 to π.
    pub(super) angle: f32,
}

impl Cone {
    /// The cone of all directions.
    pub(super) const SPHERE: Self = Self { axis: Vec3::Z, angle: PI };

    /// Returns the cone of a single direction.
    pub(super) fn of(axis: Vec3) -> Self {
        Self { axis, angle: 0.0 }
    }

    /// Returns a nearly smallest cone around both.
    fn union(&self, other: &Self) -> Self {
        let (wide, narrow) = if self.angle >= other.angle { (self, other) } else { (other, self) };
        let between = math::acos(wide.axis.dot(narrow.axis).clamp(-1.0, 1.0));
        if (between + narrow.angle).min(PI) <= wide.angle {
            return *wide;
        }
        let angle = 0.5 * (wide.angle + between + narrow.angle);
        let Some(normal) = wide.axis.cross(narrow.axis).try_normalize() else { return Self::SPHERE };
        if angle >= PI {
            return Self::SPHERE;
        }
        let (sin, cos) = math::sin_cos(0.5 * (angle - wide.angle));
        let turn = Quat::from_xyzw(normal.x * sin, normal.y * sin, normal.z * sin, cos);
        Self { axis: (turn * wide.axis).normalize(), angle }
    }
}

impl LightBounds {
    /// Returns the bounds of a light that emits equally in all directions.
    pub(super) fn point(position: Vec3, intensity: f32) -> Self {
        Self {
            bounds: Aabb { min: position, max: position },
            cone: Cone::SPHERE,
            emission_angle: FRAC_PI_2,
            two_sided: false,
            intensity,
        }
    }

    /// Returns bounds of both.
    pub(super) fn union(&self, other: &Self) -> Self {
        Self {
            bounds: self.bounds.union(&other.bounds),
            cone: self.cone.union(&other.cone),
            emission_angle: self.emission_angle.max(other.emission_angle),
            two_sided: self.two_sided || other.two_sided,
            intensity: self.intensity + other.intensity,
        }
    }

    /// Returns the cost of these lights as one node of a tree: the surface area orientation heuristic (ibid., eq. 1),
    /// without the parent's share.
    pub(super) fn cost(&self) -> f32 {
        self.intensity * solid_angle(self.cone.angle, self.emission_angle) * self.bounds.half_area()
    }
}

/// Returns the measure of the directions of emission (ibid., eq. 2).
fn solid_angle(angle: f32, emission_angle: f32) -> f32 {
    let widest = (angle + emission_angle).min(PI);
    let (sin, cos) = math::sin_cos(angle);
    2.0 * PI * (1.0 - cos)
        + FRAC_PI_2 * (2.0 * widest * sin - math::cos(angle - 2.0 * widest) - 2.0 * angle * sin + cos)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::uniform_sphere;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_union_of_cones_holds_both(
            u in any::<[u16; 4]>(), angles in (0.0f32..3.1, 0.0f32..3.1), place in (0.0f32..6.2, 0.0f32..1.0),
        ) {
            let part = |i: usize| f32::from(u[i]) / 65536.0;
            let a = Cone { axis: uniform_sphere([part(0), part(1)]), angle: angles.0 };
            let b = Cone { axis: uniform_sphere([part(2), part(3)]), angle: angles.1 };
            let both = a.union(&b);
            for cone in [a, b] {
                let (s, t) = crate::sampling::orthonormal_basis(cone.axis);
                let within = cone.angle * place.1;
                let d = cone.axis * within.cos() + (s * place.0.cos() + t * place.0.sin()) * within.sin();
                prop_assert!(d.dot(both.axis).clamp(-1.0, 1.0).acos() <= both.angle + 2e-3, "{a:?} {b:?} {both:?} {d}");
            }
        }
    }

    #[test]
    fn the_solid_angle_of_everything_is_that_of_the_sphere() {
        assert!((solid_angle(PI, FRAC_PI_2) - 4.0 * PI).abs() < 1e-4);
        // ∫ cos θ over the hemisphere.
        assert!((solid_angle(0.0, FRAC_PI_2) - PI).abs() < 1e-4);
    }
}
