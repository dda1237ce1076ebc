//! Thin-film interference that colours a reflection: soap, oil, anodised metal.
//!
//! Parameters: strength in [0, 1], index of refraction, thickness in nanometres. Source: Belcour and Barla 2017, below.

use std::f32::consts::{PI, TAU};

use bottega_kernels::math;
use bottega_scene::Spectrum;

use super::fresnel::{at_normal_incidence, schlick_weight};

/// A thin film on a base, with an index of refraction of 1 outside.
///
/// Source: Belcour and Barla 2017, A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence,
/// eq. 3 to 11, with Schlick's reflectance instead of the polarized ones, as KHR_materials_iridescence specifies.
#[derive(Clone, Copy, Debug)]
pub(super) struct Film {
    /// Strength of the effect, in [0, 1].
    pub(super) factor: f32,
    ior: f32,
    /// Thickness in nanometres.
    thickness: f32,
}

/// Number of interference terms after the constant one; higher orders are nearly colourless.
pub const TERMS: usize = 2;
/// Thickness in nanometres below which the film's index of refraction fades to 1.
pub const FADING: f32 = 0.03;
/// Number of cosines at which the film's mean reflectance is sampled.
pub const MEAN_STEPS: usize = 8;
/// Number of cosines at which the film's greatest reflectance is sampled.
pub const PEAK_STEPS: usize = 24;

impl Film {
    /// Creates a film; `None` if `factor` or `thickness` is 0.
    pub(super) fn new(factor: f32, ior: f32, thickness: f32) -> Option<Self> {
        (factor > 0.0 && thickness > 0.0).then(|| {
            let t = (thickness / FADING).min(1.0);
            let ior = 1.0 + (ior - 1.0) * t * t * (3.0 - 2.0 * t);
            Self { factor, ior, thickness }
        })
    }

    /// Returns the reflectance for a direction at cosine `cos` outside; `f0`: reflectance of the bare base at normal
    /// incidence.
    pub(super) fn reflectance(&self, cos: f32, f0: Spectrum) -> Spectrum {
        let cos2_within = 1.0 - (1.0 - cos * cos).max(0.0) / (self.ior * self.ior);
        if cos2_within <= 0.0 {
            return Spectrum::ONE;
        }
        let cos_within = cos2_within.sqrt();
        let schlick = |f0: f32, cos: f32| f0 + (1.0 - f0) * schlick_weight(cos);
        let outer = schlick(at_normal_incidence(self.ior), cos);
        let passed = 1.0 - outer;
        let path = 2.0 * self.ior * self.thickness * cos_within;
        // Reflection at a denser medium shifts the phase by π
        let turn_outer = if self.ior < 1.0 { 0.0 } else { PI };
        // Per channel: constant of the series, its first term and ratio, phase shift
        let channels = [f0.x, f0.y, f0.z].map(|f0| {
            let root = f0.clamp(0.0, 0.9999).sqrt();
            let base = (1.0 + root) / (1.0 - root);
            let inner = schlick(at_normal_incidence(base / self.ior), cos_within);
            let product = (outer * inner).clamp(1e-5, 0.9999);
            let repeated = passed * passed * inner / (1.0 - product);
            let turn = turn_outer + if base < self.ior { PI } else { 0.0 };
            (outer + repeated, repeated - passed, product.sqrt(), turn)
        });
        let mut sum = Spectrum::from(channels.map(|(constant, ..)| constant));
        let mut term = Spectrum::from(channels.map(|(_, first, ..)| first));
        let ratio = Spectrum::from(channels.map(|(_, _, ratio, _)| ratio));
        let turn = Spectrum::from(channels.map(|(.., turn)| turn));
        // Sum the interference terms
        for order in 1..=TERMS {
            term *= ratio;
            sum += term * sensitivity(order as f32 * path, order as f32 * turn) * 2.0;
        }
        sum.clamp(Spectrum::ZERO, Spectrum::ONE)
    }

    /// Returns the f₀ for which Schlick's term has the same mean reflectance as the film.
    pub(super) fn mean_f0(&self, f0: Spectrum) -> Spectrum {
        let mut sum = Spectrum::ZERO;
        for step in 0..MEAN_STEPS {
            let cos = ((step as f32 + 0.5) / MEAN_STEPS as f32).sqrt();
            sum += self.reflectance(cos, f0);
        }
        // The mean of Schlick's weight over the hemisphere is 1 / 21
        ((sum / MEAN_STEPS as f32 - 1.0 / 21.0) * (21.0 / 20.0)).clamp(Spectrum::ZERO, Spectrum::ONE)
    }

    /// Returns the smallest f₀ for which f₀ + (1 − f₀) `rise(cos)` bounds the film's reflectance in every channel.
    pub(super) fn peak_f0(&self, f0: Spectrum, rise: impl Fn(f32) -> f32) -> f32 {
        (1..=PEAK_STEPS).fold(0.0f32, |peak, step| {
            let cos = step as f32 / PEAK_STEPS as f32;
            let rise = rise(cos).min(0.99);
            peak.max((self.reflectance(cos, f0).max_element() - rise) / (1.0 - rise))
        })
    }

    /// Interpolates between the bare reflectance and that of the film by its strength.
    pub(super) fn mix(&self, bare: Spectrum, film: Spectrum) -> Spectrum {
        bare + (film - bare) * self.factor
    }
}

/// The Gaussians of X (two), Y and Z: height, position, variance (table 1 of the paper).
pub const GAUSSIANS: [[f64; 3]; 4] = [
    [5.4856e-13, 1.6810e6, 4.3278e9],
    [9.7470e-14, 2.2399e6, 4.5282e9],
    [4.4201e-13, 1.7953e6, 9.3046e9],
    [5.2481e-13, 2.2084e6, 6.6121e9],
];
/// Integral of Y, which normalizes [`GAUSSIANS`].
pub const GAUSSIANS_NORM: f64 = 1.0685e-7;

/// Returns the response of the colour matching functions to light with the spectrum cos(2π path / λ + turn): their
/// Fourier transform, fitted by Gaussians (eq. 10), in linear Rec. 709. `path` in nanometres; `turn`: phase per channel,
/// in radians.
fn sensitivity(path: f32, turn: Spectrum) -> Spectrum {
    let phase = TAU * path * 1e-9;
    let gauss = |index: usize, turn: f32| {
        let [height, position, variance] = GAUSSIANS[index].map(|number| number as f32);
        height * (TAU * variance).sqrt() * math::cos(position * phase + turn) * math::exp(-variance * phase * phase)
            / GAUSSIANS_NORM as f32
    };
    let x = gauss(0, turn.x) + gauss(1, turn.x);
    let (y, z) = (gauss(2, turn.y), gauss(3, turn.z));
    Spectrum::new(
        3.240_454_2 * x - 1.537_138_5 * y - 0.498_531_4 * z,
        -0.969_266 * x + 1.876_010_8 * y + 0.041_556 * z,
        0.055_643_4 * x - 0.204_025_9 * y + 1.057_225_2 * z,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_film_that_fades_leaves_the_base_as_it_is() {
        let film = Film::new(1.0, 1.3, 1e-6).unwrap();
        let f0 = Spectrum::new(0.9, 0.5, 0.04);
        // Schlick's term rises at both sides of a film, even of one of thickness 0
        for cos in [1.0, 0.8, 0.6] {
            let bare = f0 + (Spectrum::ONE - f0) * schlick_weight(cos);
            let off = (film.reflectance(cos, f0) - bare).abs().max_element();
            assert!(off < 0.07, "{cos}: {} {bare}", film.reflectance(cos, f0));
        }
    }

    #[test]
    fn colours_change_with_thickness_and_angle() {
        let f0 = Spectrum::splat(0.04);
        let color = |thickness: f32, cos: f32| Film::new(1.0, 1.8, thickness).unwrap().reflectance(cos, f0);
        let saturation = |c: Spectrum| c.max_element() - c.min_element();
        assert!(saturation(color(400.0, 1.0)) > 0.05);
        assert!((color(400.0, 1.0) - color(500.0, 1.0)).length() > 0.05);
        assert!((color(400.0, 1.0) - color(400.0, 0.4)).length() > 0.05);
        // A film this thick reflects all colours equally
        assert!(saturation(color(20_000.0, 1.0)) < 0.01);
    }

    #[test]
    fn no_film_reflects_more_than_everything() {
        for thickness in [0.0, 50.0, 200.0, 500.0, 1200.0] {
            for ior in [1.0, 1.3, 2.0, 3.0] {
                for f0 in [0.0, 0.04, 0.6, 1.0] {
                    let Some(film) = Film::new(1.0, ior, thickness) else { continue };
                    for step in 0..=10 {
                        let value = film.reflectance(step as f32 / 10.0, Spectrum::splat(f0));
                        assert!(value.is_finite() && value.min_element() >= 0.0 && value.max_element() <= 1.0);
                    }
                }
            }
        }
    }
}
