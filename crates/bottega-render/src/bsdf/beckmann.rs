//! The Beckmann microfacet distribution: Smith shadowing, visible normals.

use std::f32::consts::{FRAC_2_SQRT_PI, PI};

use bottega_kernels::math;
use glam::Vec3;

/// 0.5 / √π, the factor of the exponential in the projected area of the facets.
pub const HALF_RSQRT_PI: f32 = 0.25 * FRAC_2_SQRT_PI;

/// Beckmann's distribution of microfacet normals, in the frame whose +z is the surface's normal.
///
/// Source: Walter et al. 2007, Microfacet Models for Refraction through Rough Surfaces, eq. 25 to 27.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Beckmann {
    /// α along x and along y, above 0.
    pub(super) alpha: [f32; 2],
}

/// A direction stretched into the space where α is 1.
struct StretchedDirection {
    direction: Vec3,
    /// Length of the stretched vector before normalization.
    length: f32,
    sin: f32,
}

impl Beckmann {
    /// Returns D(h): area of facets facing `h` per area of surface and solid angle, in sr⁻¹.
    pub(super) fn density(&self, h: Vec3) -> f32 {
        let [ax, ay] = self.alpha;
        let cos2 = h.z * h.z;
        if cos2 < 1e-12 {
            return 0.0;
        }
        let (x, y) = (h.x / ax, h.y / ay);
        math::exp(-(x * x + y * y) / cos2) / (PI * ax * ay * cos2 * cos2)
    }

    /// Returns G₁, the share of the facets visible from a direction: the rational fit of eq. 27, common to all renderers,
    /// with an error below 0.35 %.
    pub(super) fn masking(&self, w: Vec3) -> f32 {
        let [ax, ay] = self.alpha;
        let (x, y) = (ax * w.x, ay * w.y);
        let across = (x * x + y * y).sqrt();
        let a = w.z.abs() / across;
        if across == 0.0 || a >= 1.6 { 1.0 } else { (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a) }
    }

    /// Returns ∫ D(h) max(w · h, 0) dω: the area of the facets visible from `w` (above the surface), without the fit.
    pub(super) fn visible_area(&self, w: Vec3) -> f32 {
        let s = self.stretched(w);
        s.length * area_below(&s, s.direction.z / s.sin.max(1e-9))
    }

    fn stretched(&self, w: Vec3) -> StretchedDirection {
        let [ax, ay] = self.alpha;
        let v = Vec3::new(ax * w.x, ay * w.y, w.z);
        let length = v.length();
        let direction = v / length;
        let sin = (direction.x * direction.x + direction.y * direction.y).sqrt();
        StretchedDirection { direction, length, sin }
    }

    /// Draws a facet's normal from the distribution of normals visible from `wo` (wo.z > 0).
    ///
    /// Newton's method with bracketing inverts the distribution function of the slope towards `wo`, in terms of the error
    /// function of the slope, where it is nearly linear. Source: Heitz and d'Eon 2014, Importance Sampling
    /// Microfacet-Based BSDFs using the Distribution of Visible Normals, section 5; Jakob 2014, An Improved Visible
    /// Normal Sampling Routine for the Beckmann Distribution.
    pub(super) fn sample_visible_normal(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        let s = self.stretched(wo);
        let (x, y) = if s.sin < 1e-4 {
            let radius = (-math::ln(1.0 - u[0])).max(0.0).sqrt();
            let (sin, cos) = math::sin_cos_of_turns(u[1]);
            (radius * cos, radius * sin)
        } else {
            let (along, across) = (visible_slope(&s, u[0]), inverse_erf(2.0 * u[1] - 1.0));
            let (cos, sin) = (s.direction.x / s.sin, s.direction.y / s.sin);
            (cos * along - sin * across, sin * along + cos * across)
        };
        let [ax, ay] = self.alpha;
        Vec3::new(-ax * x, -ay * y, 1.0).normalize()
    }
}

/// Returns ∫ from −∞ to x of (cos θ − t sin θ) e^(−t²) / √π dt.
fn area_below(s: &StretchedDirection, x: f32) -> f32 {
    0.5 * s.direction.z * (1.0 + erf(x)) + s.sin * HALF_RSQRT_PI * math::exp(-x * x)
}

/// Returns the slope along the direction at which the distribution function of visible slopes is `u`; below cot θ.
fn visible_slope(s: &StretchedDirection, u: f32) -> f32 {
    let cot = s.direction.z / s.sin;
    let target = u * area_below(s, cot);
    let (mut low, mut high) = (-1.0f32, erf(cot));
    let mut b = low + (high - low) * u;
    let mut x = inverse_erf(b);
    for _ in 0..16 {
        let excess = 0.5 * s.direction.z * (1.0 + b) + s.sin * HALF_RSQRT_PI * math::exp(-x * x) - target;
        if excess.abs() < 1e-7 {
            break;
        }
        if excess < 0.0 {
            low = b;
        } else {
            high = b;
        }
        let slope = 0.5 * (s.direction.z - x * s.sin);
        let next = b - excess / slope;
        b = if next > low && next < high { next } else { 0.5 * (low + high) };
        x = inverse_erf(b);
    }
    x
}

/// Returns the error function. Source: Abramowitz and Stegun 1964, Handbook of Mathematical Functions, 7.1.26; error
/// below 1.5 · 10⁻⁷.
fn erf(x: f32) -> f32 {
    let z = x.abs();
    let t = 1.0 / (1.0 + 0.327_591_1 * z);
    let sum = ((((1.061_405_4 * t - 1.453_152) * t + 1.421_413_7) * t - 0.284_496_74) * t + 0.254_829_6) * t;
    (1.0 - sum * math::exp(-z * z)).copysign(x)
}

/// Returns the inverse error function. Source: Giles 2010, Approximating the erfinv Function, single precision.
fn inverse_erf(y: f32) -> f32 {
    let y = y.clamp(-0.999_999_9, 0.999_999_9);
    let w = -math::ln((1.0 - y) * (1.0 + y));
    let coefficients: [f32; 9] = if w < 5.0 {
        [
            2.810_226_4e-8,
            3.432_739_4e-7,
            -3.523_387_7e-6,
            -4.391_506_5e-6,
            0.000_218_580_87,
            -0.001_253_725,
            -0.004_177_681_6,
            0.246_640_73,
            1.501_409_4,
        ]
    } else {
        [
            -0.000_200_214_26,
            0.000_100_950_56,
            0.001_349_343_2,
            -0.003_673_428_5,
            0.005_739_507_6,
            -0.007_622_461_3,
            0.009_438_870_5,
            1.001_674,
            2.832_976_8,
        ]
    };
    let w = if w < 5.0 { w - 2.5 } else { w.sqrt() - 3.0 };
    coefficients.into_iter().fold(0.0, |sum, c| sum * w + c) * y
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_function_has_its_textbook_values() {
        for (x, y) in [(0.0, 0.0), (0.5, 0.520_499_9), (1.0, 0.842_700_8), (2.0, 0.995_322_3), (-1.0, -0.842_700_8)] {
            assert!((erf(x) - y).abs() < 3e-7, "{x}");
            assert!((inverse_erf(y) - x).abs() < 1e-4, "{x}: {}", inverse_erf(y));
        }
    }

    #[test]
    fn visible_facets_cover_the_visible_surface() {
        // cos θ / G₁ is the visible area, within the error of the fit
        let facets = Beckmann { alpha: [0.4, 0.7] };
        for (x, y, z) in [(0.0, 0.0, 1.0), (0.5, 0.2, 0.8), (0.9, 0.1, 0.2), (-0.3, 0.9, 0.05)] {
            let w = Vec3::new(x, y, z).normalize();
            let expected = w.z / facets.masking(w);
            assert!((facets.visible_area(w) / expected - 1.0).abs() < 5e-3, "{w}: {}", facets.visible_area(w));
        }
    }

    #[test]
    fn drawn_normals_face_both_the_viewer_and_the_surface() {
        let facets = Beckmann { alpha: [0.1, 0.8] };
        for i in 0..1000 {
            let part = |prime: u32| (i * prime % 1009) as f32 / 1009.0;
            let cos = part(3).max(1e-4);
            let (sin_phi, cos_phi) = math::sin_cos_of_turns(part(17));
            let sin = (1.0 - cos * cos).sqrt();
            let wo = Vec3::new(sin * cos_phi, sin * sin_phi, cos);
            let h = facets.sample_visible_normal(wo, [part(101), part(331)]);
            assert!(h.is_normalized() && h.z > 0.0 && wo.dot(h) > -1e-3, "{wo} {h}");
        }
    }
}
