//! The trait that every kind of scattering implements.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::{BsdfSample, LobeFlags, TransportMode};

/// Scattering of one kind at one point. `wo` is above the surface.
pub(super) trait Scatter {
    /// Returns f in sr⁻¹ without the cosine, and the density with which `sample` draws `wi`; both exclude Dirac lobes.
    /// If f is estimated by a random walk, the density may be approximate.
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> (Spectrum, f32);

    /// Draws a direction from random numbers in [0, 1). The sample's weight is unbiased, even where density and value are
    /// estimates.
    fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2], mode: TransportMode) -> Option<BsdfSample>;

    /// Estimates the share of the light arriving along `wo` that is scattered in any direction.
    fn albedo(&self, wo: Vec3) -> Spectrum;

    /// Returns a summary of the lobes.
    fn lobes(&self) -> Lobes;

    /// Returns the density in sr⁻¹ with which `sample` draws `wi`, on the side of wo, from a diffuse lobe.
    fn diffuse_pdf(&self, _wo: Vec3, _wi: Vec3) -> f32 {
        0.0
    }

    /// Returns the sample of a non-Dirac lobe for a `wi` already drawn; `None` if f or pdf is 0.
    #[inline]
    fn spread(&self, wo: Vec3, wi: Vec3, mode: TransportMode, lobe: LobeFlags, eta: f32) -> Option<BsdfSample> {
        let (value, pdf) = self.eval_pdf(wo, wi, mode);
        (pdf > 0.0 && value.max_element() > 0.0).then_some(BsdfSample { wi, value, pdf, lobe, eta })
    }
}

/// A summary of the lobes of a BSDF.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lobes {
    /// `true`: some light is scattered into non-Dirac lobes.
    pub(super) has_non_delta: bool,
    /// `true`: light may be transmitted to the other side.
    pub(super) is_transmissive: bool,
    /// Perceptual roughness of the sharpest lobe, in [0, 1].
    pub(super) roughness: f32,
}

impl BsdfSample {
    /// Returns the sample of a Dirac lobe that scatters `energy` (f |cos θi|) into the direction `wi`, chosen with
    /// probability `chance`. `None`: the lobe scatters nothing.
    #[inline]
    pub(super) fn delta(wi: Vec3, energy: Spectrum, chance: f32, side: LobeFlags, eta: f32) -> Option<Self> {
        let value = energy / wi.z.abs();
        let sound = chance > 0.0 && value.max_element() > 0.0 && value.is_finite();
        sound.then_some(Self { wi, value, pdf: chance, lobe: side.union(LobeFlags::DELTA), eta })
    }
}

/// Splits a random number in [0, 1) at `chance`: returns true if it is below, and the number rescaled to [0, 1) within
/// its part.
#[inline]
pub(super) fn split(u: f32, chance: f32) -> (bool, f32) {
    let first = u < chance;
    let rest = if first { u / chance } else { (u - chance) / (1.0 - chance) };
    (first, rest.clamp(0.0, super::warp::ONE_MINUS_EPSILON))
}

/// Clamps `x` to [low, high]; NaN becomes `low`.
pub(super) fn within_range(x: f32, low: f32, high: f32) -> f32 {
    if x > low { x.min(high) } else { low }
}
