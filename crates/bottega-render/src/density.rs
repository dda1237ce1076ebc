//! Probability densities of light sampling: of directions per solid angle, and of points per area.
//!
//! Multiple importance sampling compares the densities with which several strategies draw the same direction, so all of them
//! must be in one measure. The two measures are two types here, and [`AreaPdf::per_solid_angle`] is the only conversion
//! between them.
//!
//! BSDFs, phase functions and guides draw directions alone. Their densities are plain numbers in sr⁻¹, up to the point where
//! an integrator weights them against light sampling.
//!
//! Source: Pharr, Jakob and Humphreys 2023, *Physically Based Rendering*, §4.2.3 (integrals over area); Veach 1997, *Robust
//! Monte Carlo Methods for Light Transport Simulation*, §8.2 (densities by solid angle and by area).

use std::ops::{Div, Mul};

/// The density of a direction, per solid angle, in sr⁻¹.
///
/// These interfaces use it:
/// - the shapes of lights, the environment with its portals, and suns, for the directions that they draw;
/// - light sampling: [`LightSample`](crate::lights::LightSample), and the density of light that a path has hit
///   (`Lights::hit_pdf`, `Lights::place_pdf`, `Lights::far_pdf`);
/// - the emission of photons: the directions that [`AimCone`](crate::lights::AimCone) mixes with those of lights and BSDFs;
/// - the integrators: the weights of MIS, and the density of the direction from a path's previous vertex.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
#[repr(transparent)]
pub(crate) struct SolidAnglePdf(f32);

/// The density of a point, per area perpendicular to a direction, in the inverse square of the scene's unit of length.
///
/// A surface at an angle θ to that plane has the density p_A = p cos θ per its own area. These interfaces use the type: points
/// that lights draw by area, and the origins of photons from infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(transparent)]
pub(crate) struct AreaPdf {
    /// The inverse of the density; for a uniform density, the projected area.
    inverse: f32,
}

impl SolidAnglePdf {
    /// The density of a direction that is never drawn.
    pub(crate) const ZERO: Self = Self(0.0);
    /// Stands for the density of a direction that is the only one: of parallel light, or of light without extent. Times
    /// the probability of choosing the light, it gives that probability.
    pub(crate) const ONLY: Self = Self(1.0);

    /// Creates a density from its value in sr⁻¹.
    #[inline(always)]
    pub(crate) const fn new(per_sr: f32) -> Self {
        Self(per_sr)
    }

    /// Returns the density of directions drawn uniformly from a solid angle, in sr.
    #[inline(always)]
    pub(crate) fn uniform(solid_angle: f32) -> Self {
        Self(1.0 / solid_angle)
    }

    /// Returns the value in sr⁻¹.
    #[inline(always)]
    pub(crate) const fn per_sr(self) -> f32 {
        self.0
    }

    /// Returns true if the density is neither infinite nor NaN.
    #[inline(always)]
    pub(crate) fn is_finite(self) -> bool {
        self.0.is_finite()
    }

    /// Returns true if an estimate may be divided by the density: it is finite and above 0.
    #[inline(always)]
    pub(crate) fn is_sound(self) -> bool {
        self.0 > 0.0 && self.0.is_finite()
    }
}

/// Multiplies by a probability, a number of samples, or a ratio of densities.
impl Mul<f32> for SolidAnglePdf {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f32) -> Self {
        Self(self.0 * factor)
    }
}

impl Mul<SolidAnglePdf> for f32 {
    type Output = SolidAnglePdf;

    #[inline(always)]
    fn mul(self, pdf: SolidAnglePdf) -> SolidAnglePdf {
        SolidAnglePdf(self * pdf.0)
    }
}

/// Returns the ratio of two densities.
impl Div for SolidAnglePdf {
    type Output = f32;

    #[inline(always)]
    fn div(self, other: Self) -> f32 {
        self.0 / other.0
    }
}

impl AreaPdf {
    /// Creates a density from its value per area perpendicular to the direction.
    #[inline(always)]
    pub(crate) fn new(per_area: f32) -> Self {
        Self { inverse: per_area.recip() }
    }

    /// Returns the density of points drawn uniformly from a surface.
    ///
    /// - `projected`: area of the surface, times the absolute cosine between its normal and the direction.
    #[inline(always)]
    pub(crate) const fn uniform(projected: f32) -> Self {
        Self { inverse: projected }
    }

    /// Converts the density of a point to that of the direction in which it is seen from a distance d: p_ω = p d², with p per
    /// projected area, which is p_A d² / |cos θ| for p_A per area of the surface.
    #[inline(always)]
    pub(crate) fn per_solid_angle(self, distance_squared: f32) -> SolidAnglePdf {
        SolidAnglePdf(distance_squared / self.inverse)
    }

    /// Returns the étendue that a ray stands for, in sr times the square of the scene's unit of length: the inverse of the
    /// densities of its origin and its direction.
    #[inline(always)]
    pub(crate) fn etendue(self, direction: SolidAnglePdf) -> f32 {
        self.inverse / direction.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_density_by_area_becomes_one_by_solid_angle() {
        // A square of area 4, seen at 60° from a distance of 10, has about the solid angle 4 · ½ / 100
        let pdf = AreaPdf::uniform(4.0 * 0.5).per_solid_angle(100.0);
        assert_eq!(pdf, SolidAnglePdf::uniform(0.02));
        assert_eq!(AreaPdf::new(0.5), AreaPdf::uniform(2.0));
    }

    #[test]
    fn a_ray_stands_for_the_area_and_the_solid_angle_that_it_was_drawn_from() {
        assert_eq!(AreaPdf::uniform(8.0).etendue(SolidAnglePdf::uniform(0.5)), 4.0);
    }

    #[test]
    fn only_densities_that_estimates_may_be_divided_by_are_sound() {
        assert!(SolidAnglePdf::ONLY.is_sound());
        for value in [0.0, -1.0, f32::INFINITY, f32::NAN] {
            assert!(!SolidAnglePdf::new(value).is_sound(), "{value}");
        }
        assert_eq!(0.5 * SolidAnglePdf::new(3.0) / SolidAnglePdf::new(6.0), 0.25);
    }
}
